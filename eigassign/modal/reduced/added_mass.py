"""How far added mass may bring down modes that the basis does not hold.

Beside the basis, on w with VᵀK0 w = 0, the mass Δ that a design adds lifts μ = 1/λ by no more than
the sum of the eigenvalues that Δ has by itself (Dunkerley). With rigid-body motion f = −W w of the
expansion point taken along, W = M_FF⁻¹ M_FE and Z = [I; −W],

    μ_max(M + Δ) ≤ μ_max(M) + tr(Δ H) ,   H = Z (K0⁻¹ − V Vᵀ) Zᵀ ,

    Δ = M(q, y⁺) − M(q, y0) = Σ_j (θ_j(q, y⁺) − θ_j(q, y0)) M_j .

H is the flexibility that is left beside V. Taylor vectors answer to the parameters, so that little
is left where these matter: mass that moves with modes of the basis costs nothing, and mass on a
part that the basis knows nothing of costs what it weighs times the flexibility there. y⁺ is y with
all parameters at y0 that make the mechanism lighter, for what one takes away does not pay for what
another adds. Online a trace is one number for each term.

The trace of a part with many unknowns is dear. There g M_j ≤ β g0 M_j, and all μ are taken times β.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import linalg

from eigassign.mechanism.assembly.pencil import Pencil, theta_at
from eigassign.modal.exact.condensation import rigid_coupling
from eigassign.modal.exact.sparse import block
from eigassign.modal.projection import entries

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Flags = NDArray[np.bool_]
WIDE = 12  # unknowns of two nodes in space: terms of more are scaled in a large model
STEP = 1e-6  # of a parameter, or in its unit where it is zero, to see whether it adds mass


@dataclass(frozen=True, eq=False)
class AddedMass:
    """Traces of mass terms beside the basis, and the terms that are scaled. Immutable."""

    terms: Ints  # indices of θ with a mass term that design parameters change
    traces: Floats  # (n_terms,): tr(M_j H), zero for those that are scaled
    moved: Floats  # (n_points, n_terms, c): φᵀM_jφ of the modes at the expansion points
    heavier: Flags  # (n_loads + n_y,): which parameters add mass as they grow, not as they fall
    scaled_terms: Ints  # those of parts with many unknowns
    scaled: Floats  # their values at the first expansion point

    def lifted(self, theta: Floats, turned: Floats) -> Floats:
        """tr Δ H (n,): θ at (q, y⁺), ``turned`` at (q, y0), both (n_theta, n)."""
        return np.maximum(self.traces @ (theta[self.terms] - turned[self.terms]), 0.0)

    def heavier_shapes(self, theta: Floats, turned: Floats) -> Floats:
        """1 + φᵀΔφ (n_points, n, c), at least 1: θ at (q, y), ``turned`` at (q, y0)."""
        return 1.0 + np.maximum((theta[self.terms] - turned[self.terms]).T @ self.moved, 0.0)

    def factor(self, theta: Floats) -> Floats:
        """β ≥ 1 (n,): θ at (q, y), (n_theta, n)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = theta[self.scaled_terms] / self.scaled[:, None]
        return np.asarray(np.nanmax(ratio, axis=0, initial=1.0))

    def heaviest(self, y: Floats, y0: Floats) -> Floats:
        """y⁺ (n, n_y)."""
        return np.where(self.heavier, np.maximum(y, y0), np.minimum(y, y0))


def added_mass(
    pencil: Pencil, factor: linalg.SuperLU, x0: Floats, V: Floats, phi: Floats
) -> AddedMass:
    """The traces of all terms; ``factor`` is that of K0, V (n_elastic, k) with VᵀK0V = I.

    ``phi`` (n_points, n_dof, c) are the modes that V holds as they are.
    """
    theta0 = pencil.theta(x0)[:, 0]
    terms, n = pencil.by_term[1], pencil.n_joints
    depends = np.vstack([np.zeros(len(pencil.shift), dtype=bool), pencil.program.dependence])
    sizes = np.diff(terms.indptr)
    changed = np.flatnonzero(depends[:, n:].any(axis=1) & (sizes > 0))
    rows = {t: np.unique(entries(pencil, terms, t)[0]) for t in changed.tolist()}
    wide = np.array([not pencil.is_dense and len(rows[t]) > WIDE for t in rows], dtype=bool)
    scaled = changed[wide & ~depends[changed, :n].any(axis=1)]
    dofs = np.unique(np.concatenate([[], *(rows[t] for t in changed[~wide].tolist())])).astype(
        np.intp
    )
    whole, H = _flexibility(pencil, factor, theta0, V, dofs)
    traces, flexible = np.zeros(len(changed)), np.zeros(len(changed))
    moved = np.zeros((len(phi), len(changed), phi.shape[2]))
    for k, t in enumerate(changed.tolist()):
        i, j, data = entries(pencil, terms, t)
        moved[:, k] = np.einsum("e,pec,pec->pc", data, phi[:, i], phi[:, j])
        if not wide[k]:
            i, j = np.searchsorted(dofs, i), np.searchsorted(dofs, j)
            traces[k], flexible[k] = data @ H[i, j], data @ whole[i, j]
    y0 = x0[n:]
    if not len(changed):
        heavier = np.ones(len(y0), dtype=bool)
        return AddedMass(changed, traces, moved, heavier, scaled, theta0[scaled])
    step = np.where(y0 != 0.0, STEP * np.abs(y0), STEP)
    z = pencil.to_program @ (x0 + np.pad(np.diag(step), ((0, 0), (n, 0)))).T
    changes = theta_at(pencil.program, z + pencil.shift[:, None]) - theta0[:, None]
    heavier = ~(flexible @ changes[changed] < 0.0)
    return AddedMass(changed, traces, moved, heavier, scaled, theta0[scaled])


def _flexibility(
    pencil: Pencil, factor: linalg.SuperLU, theta0: Floats, V: Floats, dofs: Ints
) -> tuple[Floats, Floats]:
    """Z K0⁻¹ Zᵀ and H on ``dofs``."""
    E, F = pencil.elastic, pencil.rigid
    M_F = block(pencil, pencil.mass @ theta0, F)
    B = np.zeros((len(dofs), len(E)))  # rows of Z
    B[np.isin(dofs, E), np.searchsorted(E, np.intersect1d(dofs, E))] = 1.0
    B[np.isin(dofs, F)] = -rigid_coupling(M_F[:, F], M_F[:, E])[np.isin(F, dofs)]
    whole = B @ factor.solve(np.ascontiguousarray(B.T)) if len(dofs) else np.zeros((0, 0))
    return whole, whole - (B @ V) @ (B @ V).T
