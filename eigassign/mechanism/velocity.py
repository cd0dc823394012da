"""The velocity terms of eq. (1), which the method neglects: built here so that they can be checked.

With the local motion w = B x of a link whose frame turns at ω(t), the velocity of its nodes in its
own axes is B ẋ + P x, P = Ḃ + ω̃ B, and that of its matter N (B ẋ + P x) + Ṅ B x: the shapes N
change at a place of the link where its mesh moves with a carriage or nut (`convection`). With
m = ∫ ρ Nᵀ N, G = ∫ ρ Nᵀ Ṅ and H = ∫ ρ Ṅᵀ Ṅ the kinetic energy gives

    M = Bᵀ m B,   C = Ṁ + Q − Qᵀ,   K_v = Q̇ − R,
    Q = Bᵀ (m P + G B),   R = Pᵀ m P + Pᵀ G B + Bᵀ Gᵀ P + Bᵀ H B .

C is gyroscopic up to Ṁ; K_v holds the centrifugal and Euler terms. Derivatives in time are central
differences of the kinematics along the motion q(t), q̇(t), q̈(t).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.case import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.assembly import LocalLink
from eigassign.mechanism.build import local_links
from eigassign.mechanism.convection import Riding, mesh_scalars, riding
from eigassign.mechanism.craig_bampton import total
from eigassign.mechanism.geometry import link_type
from eigassign.mechanism.kinematics import Kinematics, all_moving
from eigassign.mechanism.local_motion import motion_matrix, motion_scalars
from eigassign.mechanism.mesh import DOFS, Term
from eigassign.mechanism.parameters import Parameters
from eigassign.series.algebra import Samples
from eigassign.series.expression import Scalar
from eigassign.series.table import Table, compile_table

Floats = NDArray[np.float64]
STEP = 1e-4  # of the time in which the fastest coordinate or spin moves, or would, by 1 rad or m


@dataclass(frozen=True, eq=False)
class _LinkTable:
    """One link with everything about it that varies, in one table of scalars."""

    link: LocalLink
    riding: Riding | None  # its beam where something rides on it
    spin: slice  # rows of ω per q̇, all coordinates moving
    carries: slice
    twist: slice
    rigid: slice
    mass: slice
    mesh: slice


@dataclass(frozen=True, eq=False)
class VelocityTerms:
    """C and K_v of a mechanism along a motion; built once, evaluated at instants."""

    links: tuple[_LinkTable, ...]
    table: Table
    relative: Floats
    offset: Floats
    n_u: int
    n_dof: int
    space: str

    def at(
        self, q: Floats, y: Floats, rate: Floats, acceleration: Floats
    ) -> tuple[sparse.csr_array, sparse.csr_array]:
        """C [N s/m] and K_v [N/m] (n_dof, n_dof) for q, q̇, q̈ (n_q,) of one instant."""
        h = self._step(q, y, rate, acceleration)
        t = h * np.arange(-2.0, 3.0)[:, None]
        values = list(self._values(q + rate * t + acceleration * (t * t / 2.0), y))
        rates = list(rate + acceleration * t)
        C = sparse.csr_array((self.n_dof, self.n_dof))
        K = sparse.csr_array((self.n_dof, self.n_dof))
        for one in self.links:
            if not whole_mass(one.link):  # a rigid link without mass
                continue
            c, k = self._link_terms(one, values, rates, h)
            C, K = C + c, K + k
        return sparse.csr_array(C), sparse.csr_array(K)

    def _step(self, q: Floats, y: Floats, rate: Floats, acceleration: Floats) -> float:
        """Interval of the differences, s: a screw turns much faster than its nut travels."""
        (values,) = self._values(q[None], y)
        spins = [values[one.spin].reshape(3, -1) for one in self.links]
        moved = np.vstack([np.eye(len(rate)), *spins])
        speed = max(np.abs(moved @ rate).max(), np.sqrt(np.abs(moved @ acceleration)).max())
        return STEP / float(speed) if speed > 0.0 else STEP

    def _values(self, q: Floats, y: Floats) -> Floats:
        """All scalars at each of several poses q (n, n_q)."""
        z = np.vstack([self.relative @ q.T + self.offset[:, None], np.tile(y[:, None], len(q))])
        return self.table.evaluate(Samples(), z).T

    def _link_terms(
        self, one: _LinkTable, values: list[Floats], rates: list[Floats], h: float
    ) -> tuple[sparse.csr_array, sparse.csr_array]:
        B = [self._motion(one, v) for v in values]
        m = [total(whole_mass(one.link), values[k][one.mass]) for k in (1, 2, 3)]
        P = [
            (B[k + 1] - B[k - 1]) * (0.5 / h) + self._spin(one, values[k], rates[k]) @ B[k]
            for k in (1, 2, 3)
        ]
        growth = (B[3].T @ m[2] @ B[3] - B[1].T @ m[0] @ B[1]) * (0.5 / h)
        G, H = zip(
            *(self._convection(one, values[k - 1 : k + 2], h) for k in (1, 2, 3)), strict=True
        )
        Q = [b.T @ (a @ p + g @ b) for a, b, p, g in zip(m, B[1:4], P, G, strict=True)]
        cross = P[1].T @ G[1] @ B[2]
        R = P[1].T @ m[1] @ P[1] + cross + cross.T + B[2].T @ H[1] @ B[2]
        return growth + Q[1] - Q[1].T, (Q[2] - Q[0]) * (0.5 / h) - R

    def _convection(
        self, one: _LinkTable, values: list[Floats], h: float
    ) -> tuple[sparse.csr_array, sparse.csr_array]:
        """G and H at the middle of three instants; 0 where the mesh stays where it is."""
        if one.riding is None:
            n = whole_mass(one.link)[0].matrix.shape[0]
            return sparse.csr_array((n, n)), sparse.csr_array((n, n))
        return one.riding.at([v[one.mesh] for v in values], h)

    def _motion(self, one: _LinkTable, values: Floats) -> sparse.csr_array:
        """B (n_local, n_dof) of all local dofs, of a reduced link of those it stands for too."""
        groups = (values[one.carries], values[one.twist], values[one.rigid])
        B = motion_matrix(one.link, *groups, self.n_u, self.n_dof)
        reduction = one.link.reduction
        return B if reduction is None else sparse.csr_array(reduction.basis @ B)

    def _spin(self, one: _LinkTable, values: Floats, rate: Floats) -> sparse.csr_array:
        """ω̃ on the translations and rotations of every node, in the link's axes."""
        wx, wy, wz = values[one.spin].reshape(3, -1) @ rate
        tilde = np.array([[0.0, -wz, wy], [wz, 0.0, -wx], [-wy, wx, 0.0]])
        kept = list(DOFS[self.space])
        block = np.kron(np.eye(2), tilde)[np.ix_(kept, kept)]
        n = whole_mass(one.link)[0].matrix.shape[0] // len(kept)
        return sparse.csr_array(sparse.kron(sparse.eye_array(n), block, format="csr"))


def whole_mass(link: LocalLink) -> Sequence[Term]:
    """The mass terms of a link with all its dofs."""
    return link.mass if link.reduction is None else link.reduction.mesh.mass


def placeless(case: CaseFile) -> tuple[str, ...]:
    """Superelements: nobody knows which way their inner dofs point, and so how they turn."""
    return tuple(n for n in case.mechanism.links if link_type(case, n) == "superelement")


def velocity_terms(case: CaseFile, parameters: Parameters, motion: Kinematics) -> VelocityTerms:
    """Collect what varies along a motion: carried nodes, twists, spins, mass coefficients.

    Raises MechanismError for a superelement, whose inner dofs have no directions.
    """
    for name in placeless(case):
        message = "has inner dofs of unknown direction: its velocity terms cannot be formed"
        raise MechanismError(f"mechanism.links.{name}", message)
    links, nodes = local_links(case, parameters, motion)
    moving = all_moving(case, parameters, motion)
    scalars: list[Scalar] = []
    tables = []
    for link, placement in zip(links, motion.placements, strict=True):
        spin = moving.placement(placement.link).twist[3:]
        parts = [
            list(spin.ravel()),
            *motion_scalars(link),
            [t.coefficient for t in whole_mass(link)],
        ]
        mesh, rides = nodes.meshes[placement.link], motion.tree.riders(placement.link)
        parts.append(mesh_scalars(mesh) if rides else [])
        cuts = np.cumsum([len(scalars), *(len(p) for p in parts)]).tolist()
        slices = [slice(a, b) for a, b in itertools.pairwise(cuts)]
        scalars += [s for part in parts for s in part]
        tables.append(_LinkTable(link, riding(mesh) if rides else None, *slices))
    n = len(parameters.coordinates) + len(parameters.design)
    return VelocityTerms(
        links=tuple(tables),
        table=compile_table(parameters.recorder, scalars, n),
        relative=motion.relative,
        offset=motion.offset,
        n_u=nodes.count,
        n_dof=nodes.count + len(motion.columns),
        space=case.mechanism.space,
    )
