"""How far the frequencies of reduced links are from those of the whole ones, without solving these.

In the inverse form let (μ̂_j, z_j), ‖z_j‖_K = 1, be exact modes of the reduced mechanism, put back
into all dofs. What they leave, ρ_j = M_c z_j − μ̂_j K z_j, vanishes on everything that the reduced
links can do, so that only the space C left out, K-orthogonal to it, sees it. With G_jk the inner
products of the ρ in K⁻¹ and β the largest μ within C, the k-th true μ satisfies

    μ̂_k ≤ μ_k ≤ λ_k( diag(μ̂) + G / (μ̂_k − β) )        (where μ̂_k > β)

by eliminating C. No gap between modes enters, so clusters and crossings do no harm. K splits into
the interiors of the links, each with its interface held, and what the interfaces carry along:

    ρᵀ K⁻¹ ρ = Σ_links ρ_iᵀ K_ii⁻¹ ρ_i + gᵀ S⁻¹ g,   g = Σ_links (Ψ(y) − Ψ_0)ᵀ ρ_i,

the last term being there only where constraint modes change with y. S is taken from the reduced K,
which is stiffer, and a factor makes up for that.
All of it is a matter of each link's own matrices: no factor of the whole mechanism is needed.

Under gravity K_g is indefinite and reaches into C, and none of this is known. There links of beams
are solved whole, and the error is what it is. With the sag of an imported part among what it keeps
(`elements.craig_bampton`), its K_g is nothing on C, and G without it too large by no more than that
sag's own part.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.errors import AccuracyError, MechanismError
from eigassign.mechanism.assembly.inside_links import ReducedLinks
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.mechanism.elements.craig_bampton import largest_left_out
from eigassign.mechanism.elements.mesh import total
from eigassign.mechanism.elements.sparse_factor import factorise, kept_factor
from eigassign.modal.exact.solver import eigenvalues, lowest_modes
from eigassign.modal.exact.sparse import principal

Floats = NDArray[np.float64]
BESIDE = 6  # modes above the highest one asked for that may be drawn in
SAFETY = 4.0  # on the part that the reduced stiffness is used for
REFUSED = 0.5  # relative error in frequency above which nothing is said


@dataclass(frozen=True, eq=False)
class _LinkInterior:
    """One link at one design. ρ_i = X a for a = [v; −μ̂ v], v its reduced local motion."""

    gram: Floats  # Xᵀ K_ii⁻¹ X
    drawn: Floats  # (Ψ(y) − Ψ_0)ᵀ X
    beta: float  # largest μ among what was left out


def truncation_error(parts: ReducedLinks, x: Floats, modes: Sequence[int]) -> Floats:
    """Relative error in frequency (n_samples, n_modes) that the reduction of links leaves at most.

    Frequencies of reduced links are too high by it. Infinite where it is over `REFUSED`, or a
    truncated mode may lie below the mode asked for. Cost: one factor of each link's interior for
    each different y, and one exact solve of the reduced mechanism for each sample.
    """
    pencil, pick, highest = parts.pencil, np.array(modes) - 1, max(modes)
    out, left_out = np.empty((len(x), len(modes))), LeftOut(parts)
    _, which = np.unique(x[:, pencil.n_joints :], axis=0, return_inverse=True)
    for s in np.argsort(which.ravel(), kind="stable"):
        found = lowest_modes(pencil, pencil.theta(x[s : s + 1]), highest, BESIDE)
        mu = 1.0 / found.lam[0]
        z = found.phi[0] * np.sqrt(mu)
        out[s] = truncation_bounds(mu, *left_out.at(x[s], z, mu), highest, pencil)[pick]
    return out


def compared_error(reduced: Pencil, whole: Pencil, x: Floats, modes: Sequence[int]) -> Floats:
    """The same under gravity, against ``whole`` links of beams; infinite where these buckle."""
    out = np.full((len(x), len(modes)), np.inf)
    for s in range(len(x)):
        with suppress(MechanismError):
            lam, true = (
                eigenvalues(each, x[s : s + 1], max(modes))[0] for each in (reduced, whole)
            )
            out[s] = np.maximum(np.sqrt(lam / true) - 1.0, 0.0)[np.array(modes) - 1]
    return np.where(out < REFUSED, out, np.inf)


class LeftOut:
    """What reduced links leave out; the interiors of one sample serve the next of its design."""

    def __init__(self, parts: ReducedLinks) -> None:
        self.parts, self.design = parts, np.full(1, np.nan)
        self.interiors: list[_LinkInterior] = []
        self.known: dict[int, tuple[bytes, _LinkInterior]] = {}

    def at(self, x: Floats, z: Floats, mu: Floats) -> tuple[Floats, float]:
        """G (count, count) of modes z, ‖z‖_K = 1, at x (n_x,), and β."""
        pencil, values = self.parts.pencil, self.parts.values(x)
        if not np.array_equal(x[pencil.n_joints :], self.design):
            self.design = x[pencil.n_joints :]
            every = range(len(self.parts.links))
            self.interiors = [self._interior(link, values) for link in every]
        gram, pull = np.zeros((len(mu), len(mu))), np.zeros_like(z)
        for k, one in enumerate(self.interiors):
            B = self.parts.motion(k, values)
            v = np.asarray(B @ z)
            a = np.vstack([v, -mu * v])
            gram += a.T @ one.gram @ a
            n_b = len(one.drawn)
            pull += np.asarray(B[:n_b].T @ (one.drawn @ a))
        g = pull[pencil.elastic]
        if g.any():
            theta = pencil.theta(x[None])[:, 0]
            K = principal(pencil, pencil.stiffness @ theta, pencil.elastic)
            gram += SAFETY * (g.T @ factorise(K).solve(g))  # gᵀ S⁻¹ g
        return 0.5 * (gram + gram.T), max(one.beta for one in self.interiors)

    def _interior(self, k: int, values: Sequence[Floats]) -> _LinkInterior:
        """That of link k, from the last one of it where both are in proportion."""
        kappa, mu = self.parts.coefficients(k, values)
        stiff, heavy = (next(iter(each[each != 0.0]), 1.0) for each in (kappa, mu))
        key = np.concatenate([kappa / stiff, mu / heavy]).tobytes()
        if self.known.get(k, (b"",))[0] != key:
            self.known[k] = key, _interior(self.parts, k, kappa / stiff, mu / heavy)
        own = self.known[k][1]
        scale = np.repeat([heavy, stiff], own.gram.shape[0] // 2)  # X = [M T, K T] in its interior
        gram = own.gram * np.outer(scale, scale) / stiff
        return _LinkInterior(gram, own.drawn * scale, own.beta * heavy / stiff)


def _interior(parts: ReducedLinks, k: int, kappa: Floats, mu: Floats) -> _LinkInterior:
    """The factor of K_ii serves the Gram matrix, the constraint modes and β alike."""
    reduction = parts.links[k].reduction
    assert reduction is not None
    T, i = reduction.basis, reduction.interior
    b = np.setdiff1d(np.arange(len(T)), i)
    place = np.abs(T[b]).argmax(axis=1)  # reduced local dof of each interface dof
    n_b = len(b)
    K, M = total(reduction.mesh.stiffness, kappa), total(reduction.mesh.mass, mu)
    K_ii, M_ii = (sparse.csc_array(A[i][:, i]) for A in (K, M))
    factor = kept_factor(K_ii)
    if factor is None:
        raise AccuracyError("a reduced link has no stiffness at one of the designs")
    X = np.hstack([np.asarray(A[i] @ T) for A in (M, K)])
    solved = factor.solve(X)
    drawn = np.empty((n_b, X.shape[1]))
    drawn[place] = -np.asarray(K[b][:, i] @ solved) - T[i][:, place].T @ X
    return _LinkInterior(X.T @ solved, drawn, largest_left_out(K_ii, M_ii, factor, T[i, n_b:]))


def truncation_bounds(
    mu: Floats, gram: Floats, beta: float, highest: int, pencil: Pencil
) -> Floats:
    """√(μ/μ̂) − 1 at most, for every mode up to ``highest``."""
    kept = len(mu)
    if kept < len(pencil.elastic) and kept > highest:  # the last stands for all above it
        kept, beta = kept - 1, max(beta, float(mu[-1]))
    error = np.full(highest, np.inf)
    for k in range(highest):
        if mu[k] > beta:
            raised = np.diag(mu[:kept]) + gram[:kept, :kept] / (mu[k] - beta)
            top = np.linalg.eigvalsh(raised)[::-1][k]
            error[k] = np.sqrt(max(top / mu[k], 1.0)) - 1.0
    return np.where(error < REFUSED, error, np.inf)
