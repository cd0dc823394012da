"""How far a design softens or stiffens each part of a mechanism.

What a link, spring or drive contributes to K is never negative, though it may be the sum of many
terms θ_t K_t, some of them negative, some with joint coordinates in θ_t. Its stiffness is a factor
of each of them, so that the ratio r_t = θ_t(q, y)/θ_t(q, y0) is the same for all, whatever q, and

    α K(q, y0) ≤ K(q, y) ≤ β K(q, y0) ,   α = min_t r_t ,  β = max_t r_t .

Parameters that change the motion of the parts too, such as lengths, stay at y0 in the ratios of
terms that joint coordinates enter: they act like another pose. Of K_g, which may be negative, none
of this is true: it is left out here, and what it does is read off the reduced model (see
`error_estimate`). A shape φ is softened to
Σ_t r_t e_t, e_t = θ_t φᵀK_tφ / φᵀKφ being the share of a term in its energy.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import EigassignError, SingularityError
from eigassign.mechanism.assembly.pencil import Pencil, theta_at
from eigassign.modal.projection import entries

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Flags = NDArray[np.bool_]
NEARBY = 1e-3  # of a variable: a step that shows whether it scales a term or steers it
ALIKE = 1e-10  # relative: products of θ that differ by round-off alone
LEAST = 1e-300  # of a ratio: what is softer, or changes its sign, has no stiffness left


@dataclass(frozen=True, eq=False)
class DesignStiffness:
    """The stiffness terms of a pencil, and their shares in the energy of shapes. Immutable."""

    still_terms: Ints  # indices of θ with a stiffness term that no joint coordinate enters
    moving_terms: Ints  # those that one enters
    steers: Flags  # (n_loads + n_y,): parameters that change the motion, too
    at_points: Floats  # (n_points, n_terms): r_t at the expansion points
    energy: Floats  # (n_points, n_terms, c): e_t of the shapes there
    weighs: bool = False  # True where there is K_g beside these terms

    def scaling(self, y: Floats, y0: Floats) -> Floats:
        """y (n, n_y) with the parameters that steer at y0."""
        return np.where(self.steers, y0, y)

    def ratio(self, theta: Floats, scaled: Floats, turned: Floats) -> Floats:
        """r_t (n_terms, n): θ at (q, y), ``scaled`` at that y, ``turned`` at (q, y0)."""
        now = np.concatenate([theta[self.still_terms], scaled[self.moving_terms]])
        before = turned[np.concatenate([self.still_terms, self.moving_terms])]
        return np.asarray(np.divide(now, before, out=np.ones_like(now), where=before != 0.0))

    def softer_shapes(self, ratio: Floats) -> tuple[Floats, Floats]:
        """α relative to each point (n_points, n, 1); Σ r_t e_t of its shapes (n_points, n, c)."""
        of = self.at_points[:, None, :]  # 0 of a term that is nothing there, which none softens
        relative = np.divide(ratio.T, of, out=np.ones((len(of), *ratio.T.shape)), where=of != 0.0)
        least = relative.min(axis=2, initial=1.0)[:, :, None]
        own = np.einsum("pnt,ptc->pnc", relative, self.energy)
        return np.maximum(least, LEAST), np.maximum(own, np.maximum(least, LEAST))


def design_stiffness(pencil: Pencil, points: Floats, phi: Floats) -> DesignStiffness:
    """The terms at ``points`` (n_points, n_x), the modes ``phi`` (n_points, n_dof, c) there."""
    weight, n = pencil.weight, pencil.n_joints
    terms = pencil.by_term[0] if weight is None else weight.without.tocsc()
    stiff = np.flatnonzero(np.diff(terms.indptr))
    moving = np.append(False, pencil.program.dependence[:, :n].any(axis=1))[stiff]
    still, moving = stiff[~moving], stiff[moving]
    theta, before, scaled = pencil.theta(points), points.copy(), points.copy()
    made = DesignStiffness(still, moving, _steering(pencil, points[0], moving), *(np.zeros(0),) * 2)
    before[:, n:] = points[0, n:]
    scaled[:, n:] = made.scaling(points[:, n:], points[0, n:])
    try:
        ratio = made.ratio(theta, pencil.theta(scaled), pencil.theta(before)).T
    except EigassignError:  # no mechanism at one point with the design of another
        ratio = np.ones((len(points), len(stiff)))
    every, energy = np.concatenate([still, moving]), []
    for t in every.tolist():
        i, j, data = entries(pencil, terms, t)
        energy.append(theta[t][:, None] * np.einsum("e,pec,pec->pc", data, phi[:, i], phi[:, j]))
    shares = np.array(energy).swapaxes(0, 1)
    shares = shares / shares.sum(axis=1, keepdims=True)
    return replace(made, at_points=ratio, energy=shares, weighs=weight is not None)


def _steering(pencil: Pencil, x0: Floats, moving: Ints) -> Flags:
    """Which parameters (n_loads + n_y,) do not just scale the ``moving`` terms of θ.

    A factor of its own, θ_t(q, y) = s(y) c(q), has θ_t(q', y') θ_t(q, y) = θ_t(q', y) θ_t(q, y').
    """
    n, n_x = pencil.n_joints, len(x0)
    step = np.diag(NEARBY * np.maximum(np.abs(x0), NEARBY))
    pose, flags = step[:n].sum(axis=0), np.zeros(n_x - n, dtype=bool)
    for k, own in enumerate(step[n:]):
        x = x0 + np.array([pose, 3.0 * pose, pose + own, 3.0 * pose + own])  # x0 may be special
        z = x @ pencil.to_program.T
        try:
            theta = theta_at(pencil.program, (z + pencil.shift).T)[moving]
        except SingularityError:
            theta = np.full((len(moving), 4), np.nan)
        theta = theta / np.maximum(np.abs(theta).max(axis=1, keepdims=True), LEAST)
        product = theta[:, 0] * theta[:, 3]
        same = np.abs(product - theta[:, 1] * theta[:, 2]) <= ALIKE * np.abs(product)
        flags[k] = not same.all()
    return flags
