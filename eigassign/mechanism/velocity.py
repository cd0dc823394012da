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
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.case import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.build import local_links
from eigassign.mechanism.convection import mesh_scalars, riding
from eigassign.mechanism.geometry import link_type
from eigassign.mechanism.kinematics import Kinematics, all_moving
from eigassign.mechanism.local_motion import motion_scalars
from eigassign.mechanism.parameters import Parameters
from eigassign.mechanism.stacked import Rows, StackedLinks, stack, whole_mass
from eigassign.series.algebra import Samples
from eigassign.series.expression import Scalar
from eigassign.series.table import Table, compile_table

Floats = NDArray[np.float64]
STEP = 1e-4  # of the time in which the fastest coordinate or spin moves, or would, by 1 rad or m


@dataclass(frozen=True, eq=False)
class VelocityTerms:
    """C and K_v of a mechanism along a motion; built once, evaluated at instants."""

    stack: StackedLinks
    table: Table
    relative: Floats
    offset: Floats

    def at(
        self, q: Floats, y: Floats, rate: Floats, acceleration: Floats
    ) -> tuple[sparse.csr_array, sparse.csr_array]:
        """C [N s/m] and K_v [N/m] (n_dof, n_dof) for q, q̇, q̈ (n_q,) of one instant."""
        h = self._step(q, y, rate, acceleration)
        t = h * np.arange(-2.0, 3.0)[:, None]
        z = self.values(q + rate * t + acceleration * (t * t / 2.0), y)
        B, W = [self.stack.motion(each) for each in z], rate + acceleration * t
        m = [self.stack.mass(z[k]) for k in (1, 2, 3)]
        P = [
            (B[k + 1] - B[k - 1]) * (0.5 / h) + self.stack.spin(z[k], W[k]) @ B[k]
            for k in (1, 2, 3)
        ]
        growth = (B[3].T @ m[2] @ B[3] - B[1].T @ m[0] @ B[1]) * (0.5 / h)
        G, H = zip(*(self.stack.convection(z[k - 1 : k + 2], h) for k in (1, 2, 3)), strict=True)
        Q = [b.T @ (a @ p + g @ b) for a, b, p, g in zip(m, B[1:4], P, G, strict=True)]
        cross = P[1].T @ G[1] @ B[2]
        R = P[1].T @ m[1] @ P[1] + cross + cross.T + B[2].T @ H[1] @ B[2]
        C, K = growth + Q[1] - Q[1].T, (Q[2] - Q[0]) * (0.5 / h) - R
        return sparse.csr_array(C), sparse.csr_array(K)

    def _step(self, q: Floats, y: Floats, rate: Floats, acceleration: Floats) -> float:
        """Interval of the differences, s: a screw turns much faster than its nut travels."""
        (z,) = self.values(q[None], y)
        spins = self.stack.spins.at(z)
        turned = (spins @ rate, spins @ acceleration)
        fastest, hardest = (
            np.abs(np.concatenate(both)).max()
            for both in zip((rate, acceleration), turned, strict=True)
        )
        speed = max(float(fastest), float(np.sqrt(hardest)))
        return STEP / speed if speed > 0.0 else STEP

    def values(self, q: Floats, y: Floats) -> Floats:
        """All scalars at each of several poses q (n, n_q), and a 1: (n, n_scalars + 1)."""
        z = np.vstack([self.relative @ q.T + self.offset[:, None], np.tile(y[:, None], len(q))])
        return np.column_stack([self.table.evaluate(Samples(), z).T, np.ones(len(q))])


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
    rows, ridings = [], []
    for link, placement in zip(links, motion.placements, strict=True):
        spin = moving.placement(placement.link).twist[3:]
        mass = [t.coefficient for t in whole_mass(link)]
        mesh, rides = nodes.meshes[placement.link], motion.tree.riders(placement.link)
        parts = [list(spin.ravel()), *motion_scalars(link), mass]
        parts.append(mesh_scalars(mesh) if rides else [])
        cuts = np.cumsum([len(scalars), *(len(p) for p in parts)]).tolist()
        rows.append(Rows(*(slice(a, b) for a, b in itertools.pairwise(cuts))))
        scalars += [s for part in parts for s in part]
        ridings.append(riding(mesh) if rides else None)
    n = len(parameters.coordinates) + len(parameters.design)
    n_dof = nodes.count + len(motion.columns)
    return VelocityTerms(
        stack=stack(links, rows, ridings, case.mechanism.space, nodes.count, n_dof),
        table=compile_table(parameters.recorder, scalars, n),
        relative=motion.relative,
        offset=motion.offset,
    )
