"""What gives way under forces at rest, K u = f, with slopes in coordinates and design.

Between two forces l and r that is lᵀ K⁻¹ r: of a unit force at a node against itself the compliance
along it, of one against the weight the sag along it. With u_l and u_r what gives way under each,

    ∂(lᵀ K⁻¹ r)/∂x = ∂lᵀ/∂x u_r + u_lᵀ ∂r/∂x − u_lᵀ ∂K/∂x u_r ,

from one factorisation of K a sample; of a large pencil from one for all samples (`substructure`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import LIMP, MechanismError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.mechanism.forces import Forces, forces
from eigassign.modal.arguments import chunks, solve_blocks
from eigassign.modal.exact.large import solve_large_statics
from eigassign.modal.exact.solver import works_changed
from eigassign.modal.model import Model

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
# Of the largest entry of a force: what is less is round-off of a motion that no free joint makes
STILL = 1e-9


@dataclass(frozen=True, eq=False)
class Flexibility:
    """lᵀ K⁻¹ r of pairs of forces, ``left`` and ``right`` (m,) among all; K that of a pencil."""

    pencil: Pencil
    forces: Forces
    left: Ints
    right: Ints
    held: bool = False  # brakes hold what is rigid in the pencil

    def at(self, x: Floats, wanted: NDArray[np.bool_]) -> tuple[Floats, Floats]:
        """The values (n, m) at samples x (n, n_x), and slopes (n, m, n_x) in those ``wanted``.

        Infinite where a free joint gives way. Raises MechanismError where K is not definite.
        """
        parts = (self._at(some, wanted) for some in solve_blocks(x, self.pencil.n_dof))
        values, slopes = map(np.concatenate, zip(*parts, strict=True))
        return values, slopes

    def _at(self, x: Floats, wanted: NDArray[np.bool_]) -> tuple[Floats, Floats]:
        pencil, theta = self.pencil, self.pencil.theta(x)
        along = np.flatnonzero(wanted & ~np.bool_(self.forces.is_fixed(wanted)))
        given = self.forces.at(x, along)
        f = np.zeros((len(x), pencil.n_dof, len(given)))
        for k, (places, (own, _)) in enumerate(zip(self.forces.unknowns, given, strict=True)):
            f[:, places, k] = own
        size = np.abs(f).max(axis=1, initial=0.0)
        loose = np.abs(f[:, pencil.rigid]).max(axis=1, initial=0.0) > STILL * size
        loose &= not self.held
        u = displaced(pencil, theta, f)
        left, right = u[..., self.left], u[..., self.right]
        values = np.einsum("nim,nim->nm", f[..., self.left], right)
        slopes = -works_changed(pencil, x, left, right, np.zeros(values.shape), wanted)
        for m, (j, k) in enumerate(zip(self.left, self.right, strict=True)):
            for force, moved in ((j, right), (k, left)):
                by_x = given[force][1]
                own = np.einsum("dnk,nk->nd", by_x, moved[:, self.forces.unknowns[force], m])
                slopes[:, m, along] += own
        values[loose[:, self.left] | loose[:, self.right]] = np.inf
        return values, slopes


def displaced(pencil: Pencil, theta: Floats, f: Floats) -> Floats:
    """u (n, n_dof, m) with K_E u_E = f_E at θ (n_theta, n) for f (n, n_dof, m), 0 where free."""
    if not pencil.is_dense:
        return solve_large_statics(pencil, theta, f)
    u, E = np.zeros(f.shape), pencil.elastic
    for part in chunks(np.arange(len(f)), pencil.n_dof**2):
        K = pencil.stiffness_matrices(theta[:, part])[:, E[:, None], E]
        try:
            if pencil.weight is not None:  # else K cannot be indefinite
                np.linalg.cholesky(K)
            u[np.ix_(part, E)] = np.linalg.solve(K, f[np.ix_(part, E)])
        except np.linalg.LinAlgError as error:
            raise MechanismError("mechanism", LIMP) from error
    return u


def compliances(
    model: Model, nodes: Mapping[str, Sequence[Sequence[float]]], finer: bool = False
) -> Flexibility:
    """The way of each node along each of its directions per force along it, m/N; drives hold.

    ``finer``: of a mesh of twice the elements.
    """
    case, pencil = model.refined() if finer else (model.poses.case, model.pencil)
    found = forces(case, model.poses.parameters, model.motion, nodes)
    each = np.arange(len(found.unknowns))
    return Flexibility(pencil, found, each, each)


def sags(model: Model, node: str, finer: bool = False) -> Flexibility:
    """The way of a node along each axis under the weight, m; all coordinates held, K without K_g.

    As `under_load.sag_of_nodes` has it: the pose that the trajectory asks for is where the drives
    hold the mechanism, the weight bends links and passive joints.
    """
    case, pencil = model.refined() if finer else (model.poses.case, model.pencil)
    assert pencil.weight is not None
    axes = np.eye(2 if case.mechanism.space == "planar" else 3)
    found = forces(case, model.poses.parameters, model.motion, {node: axes.tolist()}, weight=True)
    held = replace(
        pencil,
        stiffness=pencil.weight.without,
        rigid=np.arange(pencil.n_u, pencil.n_dof),
        weight=None,
    )
    left = np.arange(len(axes))
    return Flexibility(held, found, left, np.full(len(axes), len(axes)), held=True)
