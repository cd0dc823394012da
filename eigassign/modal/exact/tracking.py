"""A mode followed by its shape, along a path or from where it is named.

A shape ψ, ψᵀMψ = 1, is carried from a place to the next. Its shares in the modes φ_j there are

    s_j = (φ_jᵀ M ψ)² / (ψᵀ M_c ψ),   M_c the mass M of that place without rigid motion.

The mode of the largest share and those within `NEAR` of its frequency are kept,

    ψ ← Σ_j φ_j (φ_jᵀ M ψ) / √Σ_j (φ_jᵀ M ψ)²,

so that a mode far from all others is ψ itself, however its shape changes, and ψ does not turn with
modes that meet: it goes straight through a crossing. In a veering it is a mixture of both, and
comes out as one of them again, the closer the veering the more nearly as the one that has its
shape. Where the modes kept hold less than `CLEAR` of ψ, or the number changes while no other mode
is near, the step is halved; what stays unclear is lost.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eigassign.arrays import Bools, Floats
from eigassign.errors import Candidate, LostModeError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.arguments import chunks, solve_blocks
from eigassign.modal.exact.dense import block
from eigassign.modal.exact.solver import lowest_modes

CLEAR = 0.75  # share of a shape above which a step needs no halving
HALVINGS = 12
COINCIDENT = 1e-9  # relative distance in λ below which shapes are arbitrary
NEAR = 0.15  # relative distance in frequency above which two modes do not meet
EXTRA = 4  # modes above the highest followed one that it may turn out to be
ALIKE = 1e-3  # of the frequency: modes that share a shape and differ by less may both stand for it


def links(pencil: Pencil, x: Floats, before: Floats, after: Floats) -> tuple[Floats, Floats]:
    """φᵀMψ (n, c, m) and ψᵀM_cψ (n, m, m) of shapes ψ ``before`` and modes φ ``after``.

    M is that at x (n, n_x), M_c the same without the rigid motion that shapes contain there.
    """
    theta = pencil.theta(x)
    across = np.empty((len(x), after.shape[2], before.shape[2]))
    sizes = np.empty((len(x), before.shape[2], before.shape[2]))
    every = np.arange(len(x))
    for at in chunks(every, pencil.n_dof**2) if pencil.is_dense else every[:, None]:
        if pencil.is_dense:
            M = pencil.mass_matrices(theta[:, at])
            product, M_FF = M @ before[at], block(M, pencil.rigid, pencil.rigid)
        else:
            whole = pencil.sparse(pencil.mass @ theta[:, at[0]])
            product = np.asarray(whole @ before[at[0]])[None]
            M_FF = whole[pencil.rigid][:, pencil.rigid].toarray()[None]
        on_rigid = product[:, pencil.rigid]
        across[at] = np.swapaxes(after[at], 1, 2) @ product
        sizes[at] = np.swapaxes(before[at], 1, 2) @ product
        if len(pencil.rigid):
            sizes[at] -= np.swapaxes(on_rigid, 1, 2) @ np.linalg.solve(M_FF, on_rigid)
    return across, sizes


class MoreModesError(Exception):
    """The mode may be among those above the modes that were solved."""


@dataclass(frozen=True, eq=False)
class ModesAtPoint:
    """The lowest modes at x (n_x,); ``complete`` where there are no more."""

    x: Floats
    lam: Floats  # (count,)
    phi: Floats  # (n_dof, count)
    complete: bool


@dataclass(frozen=True, eq=False)
class FollowedShape:
    """A shape ψ = Φ a at a place, |a| = 1; ``a`` (count,) is 0 of modes far from it."""

    at: ModesAtPoint
    a: Floats

    @property
    def number(self) -> int:
        """The mode, from 1, that has the largest share; of modes that coincide the first."""
        return int(np.argmax(self._same)) + 1

    @property
    def lam(self) -> float:
        """Its eigenvalue in rad²/s²."""
        return float(self.at.lam[np.argmax(self.a**2)])

    @property
    def phi(self) -> Floats:
        """The mode itself (n_dof,); of modes that coincide the mixture that has the shape."""
        part = np.where(self._same, self.a, 0.0)
        return np.asarray(self.at.phi @ (part / np.linalg.norm(part)))

    @property
    def is_shared(self) -> bool:
        """True where too much of it is other modes, whose frequencies differ too."""
        away = np.abs(np.sqrt(self.at.lam / self.lam) - 1.0)
        return bool((self.a**2)[self._same].sum() < CLEAR and self.a**2 @ away > ALIKE)

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """The modes that have a part of it."""
        return candidates(self.at, self.a**2)

    @property
    def _same(self) -> Bools:
        return np.asarray(np.abs(self.at.lam / self.lam - 1.0) <= COINCIDENT)


def candidates(at: ModesAtPoint, shares: Floats, most: int = 3) -> tuple[Candidate, ...]:
    """The modes of the largest shares, the largest first; none that have hardly any."""
    order = np.argsort(-shares, kind="stable")[:most]
    hz = np.sqrt(at.lam) / (2.0 * np.pi)
    kept = (int(j) for j in order if shares[j] > 0.01)
    return tuple(Candidate(j + 1, float(hz[j]), float(shares[j])) for j in kept)


def places(pencil: Pencil, x: Floats, least: int, extra: int) -> list[ModesAtPoint]:
    """The lowest modes at x (n, n_x), at all as many: ``least``, and up to ``extra`` more.

    Raises what `lowest_modes` raises.
    """
    blocks = solve_blocks(x, pencil.n_dof)
    found = [lowest_modes(pencil, pencil.theta(some), least, extra) for some in blocks]
    count = min(part.lam.shape[1] for part in found)
    lam, phi = (
        np.concatenate([getattr(part, name)[..., :count] for part in found])
        for name in ("lam", "phi")
    )
    complete = count < least + extra or count == len(pencil.elastic)
    return [ModesAtPoint(*each, complete) for each in zip(x, lam, phi, strict=True)]


def follow(
    pencil: Pencil, start: FollowedShape, path: Sequence[ModesAtPoint]
) -> list[FollowedShape]:
    """``start`` carried to the first place of a path, from there to the next, and so on.

    Raises LostModeError, whose ``step`` is the place that the shape was not carried to;
    MoreModesError where the places may hold too few modes.
    """
    if len(path) > 1:
        phi, x = (np.array([getattr(each, name) for each in path]) for name in ("phi", "x"))
        across, sizes = links(pencil, x[1:], phi[:-1], phi[1:])
    found = [start]
    for k, there in enumerate(path):
        link = (across[k - 1], sizes[k - 1]) if k else _link(pencil, start.at, there)
        try:
            found.append(_carried(pencil, found[-1], there, link, 0))
        except LostModeError as lost:
            raise LostModeError(lost.candidates, k) from None
    return found[1:]


def _link(pencil: Pencil, here: ModesAtPoint, there: ModesAtPoint) -> tuple[Floats, Floats]:
    across, sizes = links(pencil, there.x[None], here.phi[None], there.phi[None])
    return across[0], sizes[0]


def _carried(
    pencil: Pencil,
    here: FollowedShape,
    there: ModesAtPoint,
    link: tuple[Floats, Floats],
    depth: int,
) -> FollowedShape:
    """The shape at the next place, by way of the midpoint where the step is unclear."""
    across, sizes = link
    c = across @ here.a
    shares = c**2 / (here.a @ sizes @ here.a)
    best = int(np.argmax(shares))
    near = _near(there, best)
    if near[-1] and not there.complete:
        raise MoreModesError
    before = here.number - 1
    passed = slice(min(before, best), max(before, best) + 1)
    is_met = bool(near[passed].all() and _near(here.at, before)[passed].all())
    if shares[near].sum() >= CLEAR and (depth == HALVINGS or is_met):
        a = np.where(near, c, 0.0)
        return FollowedShape(there, a / np.linalg.norm(a))
    if depth == HALVINGS:
        if shares.sum() < CLEAR and not there.complete:
            raise MoreModesError
        raise LostModeError(candidates(there, shares), 0)
    x = 0.5 * (here.at.x + there.x)
    (middle,) = places(pencil, x[None], len(there.lam), 0)
    middle = replace(middle, complete=there.complete)
    half = _carried(pencil, here, middle, _link(pencil, here.at, middle), depth + 1)
    return _carried(pencil, half, there, _link(pencil, middle, there), depth + 1)


def _near(at: ModesAtPoint, best: int) -> Bools:
    """Flags of the modes near one, in the logarithm of the frequency, which is symmetric."""
    return np.asarray(np.abs(np.log(at.lam / at.lam[best])) < 2.0 * NEAR)
