"""What a mesh leaves out: the motion inside its elements while all nodes are held.

Its shapes b are polynomials that vanish at both nodes: ξ(1−ξ) P_k of stretch and twist, and of
deflection and rotation with shear; ξ²(1−ξ)² P_k of bending without. With the element's own shapes c
they have the matrices K_bc, M_bc, K_bb and M_bb. Without a taper K_bc = 0, for the element's shapes
are those of least energy. With one, what is left out is K-orthogonal to the mesh after some c is
added to it, and has at least the stiffness

    S = K_bb − K_bc K_cc⁺ K_cb .

Of an element with one section, b contains all that the inertia of c does inside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import legendre, polynomial
from numpy.typing import NDArray

from eigassign.mechanism.elements.beam import DEFLECTION, LINEAR, PLANES, ROTATION, shear
from eigassign.mechanism.elements.profiles import Profile

Floats = NDArray[np.float64]
TAU, WEIGHTS = legendre.leggauss(30)  # from −1 to 1, exact up to degree 59
XI = 0.5 * (1.0 + TAU)
# Shapes b of each field. Elements of one section need a quarter of them; in strong tapers with so
# few errors were up to 1.42 times what is stated (`tests/stability/tapers.py`).
STRETCHED, BENT, DEFLECTED, TURNED = 20, 20, 20, 19


class InnerPart(NamedTuple):
    """One field of n elements; ``dofs`` × ``scale`` are the amplitudes of its n_c shapes c."""

    dofs: tuple[int, ...]  # of the element's 12, in its axes
    scale: Floats  # (n, n_c)
    stiffness: Floats  # K_bc (n, n_b, n_c)
    mass: Floats  # M_bc
    inverse: Floats  # S⁻¹ (n, n_b, n_b)
    beta: Floats  # (n, 3): the largest bᵀ M_bb b / bᵀ S b, in s², and where an end is free
    tie: Floats  # (n,): the largest bᵀ (K_bb − S) b / bᵀ S b, of tapers


class _Energy(NamedTuple):
    """∫ value h^power a aᵀ dξ of the field a = [c, b]."""

    value: str
    power: int
    own: Floats  # c at the Gauss points, (n or 1, n_xi, n_c)
    inner: Floats  # b, (n_xi, n_b)


def inner_parts(profile: Profile, h: Floats, space: str) -> list[InnerPart]:
    """Stretch, twist and two bendings of n elements, from their values and lengths (n,).

    Raises numpy.linalg.LinAlgError where one has no stiffness.
    """
    line, b = [_at(LINEAR, k)[None] for k in (0, 1)], [_inner(1, STRETCHED, k) for k in (0, 1)]
    parts = []
    for first, stiff, mass in ((0, "EA", "mass"), (3, "GJ", "polar")):
        if first == 0 or space == "spatial":
            strain, motion = _Energy(stiff, -1, line[1], b[1]), _Energy(mass, 1, line[0], b[0])
            scale = np.ones((len(h), 2))
            parts.append(_part((first, first + 6), scale, profile, h, [strain], [motion]))
    bent = shear(profile, h)  # type: ignore[arg-type]
    for (w, slope, sign), axis, (phi, skew) in zip(PLANES, "zy", bent, strict=True):
        if axis == "z" or space == "spatial":
            dofs = (w, slope, w + 6, slope + 6)
            scale = np.stack([np.ones_like(h), sign * h] * 2, axis=1)
            slender = profile[0].shear_z is None
            energies = _slender(axis) if slender else _sheared(axis, phi, skew)
            parts.append(_part(dofs, scale, profile, h, *energies))
    return parts


def _slender(axis: str) -> tuple[list[_Energy], list[_Energy]]:
    """EI w''²/h³ and ρA h w²."""
    own, inner = [_at(DEFLECTION[0], k)[None] for k in (0, 2)], [_inner(2, BENT, k) for k in (0, 2)]
    return (
        [_Energy(f"EI_{axis}", -3, own[1], inner[1])],
        [_Energy("mass", 1, own[0], inner[0])],
    )


def _sheared(axis: str, phi: Any, skew: Any) -> tuple[list[_Energy], list[_Energy]]:
    """The energies EI t'²/h³ + κGA (w' − t)²/h and ρA h w² + ρI t²/h, t = h × rotation."""

    of_phi, of_skew = np.asarray(phi)[:, None, None], np.atleast_1d(skew)[:, None, None]

    def own(shapes: Sequence[Floats], k: int) -> Floats:
        plain, sheared, skewed = (_at(each, k) for each in shapes)
        whole = plain + of_phi * sheared + of_skew * skewed
        return np.asarray(whole / (1.0 + of_phi))

    def inner(of_w: float, of_t: float, k_w: int, k_t: int) -> Floats:
        return np.hstack([of_w * _inner(1, DEFLECTED, k_w), of_t * _inner(1, TURNED, k_t)])

    strain = own(DEFLECTION, 1) - own(ROTATION, 0)
    return (
        [
            _Energy(f"EI_{axis}", -3, own(ROTATION, 1), inner(0.0, 1.0, 0, 1)),
            _Energy(f"shear_{axis}", -1, strain, inner(1.0, -1.0, 1, 0)),
        ],
        [
            _Energy("mass", 1, own(DEFLECTION, 0), inner(1.0, 0.0, 0, 0)),
            _Energy(f"rotary_{axis}", -1, own(ROTATION, 0), inner(0.0, 1.0, 0, 0)),
        ],
    )


def _part(
    dofs: tuple[int, ...],
    scale: Floats,
    profile: Profile,
    h: Floats,
    strains: Sequence[_Energy],
    motions: Sequence[_Energy],
) -> InnerPart:
    K, M = (
        np.sum([_matrix(each, profile, h) for each in group], axis=0)
        for group in (strains, motions)
    )
    c, b = slice(len(dofs)), slice(len(dofs), None)
    taken = np.zeros_like(K[:, b, b])
    if len(profile) > 1:
        taken = K[:, b, c] @ np.linalg.pinv(K[:, c, c], rcond=1e-10, hermitian=True) @ K[:, c, b]
    S = K[:, b, b] - taken
    half, masses = len(dofs) // 2, [M[:, b, b]] * 3
    if len(profile) > 1:
        for k, end in enumerate((slice(half), slice(half, 2 * half)), start=1):
            follows = np.linalg.solve(M[:, end, end], M[:, end, b])
            masses[k] = M[:, b, b] - M[:, b, end] @ follows
    beta = np.stack([_largest(mass, S) for mass in masses], axis=1)
    inverse = np.linalg.inv(S)
    return InnerPart(dofs, scale, K[:, b, c], M[:, b, c], inverse, beta, _largest(taken, S))


def _largest(A: Floats, S: Floats) -> Floats:
    """The largest bᵀ A b / bᵀ S b of n pairs of matrices, (n,)."""
    root = np.linalg.cholesky(S)
    ratio = np.linalg.solve(root, np.linalg.solve(root, A).transpose(0, 2, 1))
    return np.asarray(np.linalg.eigvalsh(0.5 * (ratio + ratio.transpose(0, 2, 1)))[:, -1])


def _matrix(energy: _Energy, profile: Profile, h: Floats) -> Floats:
    """Over [c, b], (n, n_c + n_b, n_c + n_b)."""
    n = len(h)
    series = np.stack([np.broadcast_to(getattr(p, energy.value), n) for p in profile], axis=1)
    values = series @ legendre.legvander(TAU, len(profile) - 1).T
    factor = values * h[:, None] ** energy.power * (0.5 * WEIGHTS)
    shapes = (energy.own, energy.inner[None])
    a = np.concatenate([np.broadcast_to(s, (n, *s.shape[1:])) for s in shapes], axis=2)
    return np.asarray((a * factor[:, :, None]).transpose(0, 2, 1) @ a)


def _at(shapes: Floats, k: int) -> Floats:
    """The k-th derivatives by ξ of polynomials, rows of coefficients, at the Gauss points."""
    return np.asarray(polynomial.polyval(XI, polynomial.polyder(shapes.T, k)).T)


@cache
def _inner(power: int, count: int, k: int) -> Floats:
    """The k-th derivatives of [ξ(1−ξ)]^power P_j(2ξ − 1), (n_xi, count)."""
    hold = legendre.legpow([1.0 / 6.0, 0.0, -1.0 / 6.0], power)  # in τ, for powers of ξ lose digits
    shapes = [legendre.legmul(hold, [0.0] * j + [1.0]) for j in range(count)]
    return np.stack([legendre.legval(TAU, legendre.legder(s, k, scl=2.0)) for s in shapes], axis=1)
