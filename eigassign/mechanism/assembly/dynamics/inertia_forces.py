"""Forces of inertia of the rigid motion on the unknowns of eq. (1): f = Bᵀ ∫ ρ Nᵀ a.

With the twist t = (v, ω) of a link in its own axes, its nodes have the accelerations

    a = N ṫ + ω̃ N t,   ṫ = T q̈ + Ṫ q̇,

Coriolis and centrifugal ones included, and the matter between them what the shapes make of these.
The bodies at a node, of mass m, first moment m c and moments of inertia J about it, add what they
bear because they turn; what turns with a drive, on the relative motion s = r q of its joint, J_d:

    f = Bᵀ (m a + (ω × (ω × m c), ω × J ω)) + rᵀ J_d s̈.

In a plane that is exact. In space the shapes take a straight line of accelerations that turns by
ω_x ω_y as a wave of one element, of which meshes of twice the elements keep a quarter. Ṫ comes from
rates along the imaginary axis, which lose no digits. All samples are evaluated together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eigassign.arrays import Floats, Ints
from eigassign.case.case_file import CaseFile
from eigassign.mechanism.assembly.build import drive_value
from eigassign.mechanism.assembly.dynamics.velocity_terms import (
    IMAGINARY,
    StackedLinks,
    heavy_links,
    stacked,
    whole_size,
)
from eigassign.mechanism.assembly.loads.statics import Loaded, first_moment
from eigassign.mechanism.kinematics.forward import Kinematics
from eigassign.mechanism.kinematics.loop_closure import all_moving
from eigassign.mechanism.kinematics.parameters import ModelParameters
from eigassign.series.algebra import Tangents
from eigassign.series.compiler import CompiledArrays


@dataclass(frozen=True, eq=False)
class InertiaForces:
    """f of a mechanism; built once, evaluated at many instants together."""

    stack: StackedLinks
    slots: Ints  # (n_sites, 6): dofs of nodes with bodies among all, −1 where there is none
    owners: Ints  # (n_sites,) their links
    relative: Floats  # (n_coordinates, n_q) rates of joints per q̇
    columns: Floats  # (n_coordinates, n_columns) the same per unknown of a coordinate
    table: CompiledArrays  # the stack, J of the sites (n_sites, 6, 6), J_d (n_coordinates,)
    parameters: ModelParameters

    def at(self, q: Floats, y: Floats, rate: Floats, acceleration: Floats) -> Floats:
        """f (n, n_dof) in N and N m for q, q̇, q̈ (n, n_q) at design y (n_y,)."""
        n, stack = self.stack.rates.shape[1], self.stack
        x = np.hstack([q + 1j * IMAGINARY * rate, np.tile(y, (len(q), 1))])
        found = self.table(self.parameters.z(x), Tangents(len(q), 0))
        U, N, T, m, twists, *_, sites, drives = (each.real for each in found)
        turning = found[4].imag / IMAGINARY
        rate, acceleration = rate[:, :n], acceleration[:, :n]
        t = stack.rates.times(twists, rate)
        push = stack.rates.times(twists, acceleration) + stack.rates.times(turning, rate)
        kept = (6 * np.arange(t.shape[1] // 6)[:, None] + stack.kept).ravel()
        spin = t.reshape(len(q), -1, 6)[..., 3:]
        moved = [stack.spread.times(N, each[:, kept]) for each in (t, push)]
        s, a = moved if stack.basis is None else (each @ stack.basis.T for each in moved)
        g = stack.masses.times(m, a + self._turned(spin, s))
        for slots, owner, J in zip(self.slots, self.owners, np.moveaxis(sites, 1, 0), strict=True):
            w, there = spin[:, owner], slots >= 0
            pull = np.cross(
                w, np.cross(w, first_moment(J[0]))
            )  # bodies differ with the design alone
            g[:, slots[there]] += np.hstack([pull, np.cross(w, w @ J[0, 3:, 3:])])[:, there]
        g = g if stack.basis is None else g @ stack.basis
        rigid = stack.twist.times(T, stack.spread.times(N, g, transposed=True), transposed=True)
        f = stack.joined.times(U, g, transposed=True) + rigid
        driven = drives * (acceleration @ self.relative.T)
        f[:, f.shape[1] - self.columns.shape[1] :] += driven @ self.columns
        return np.asarray(f)

    def _turned(self, spin: Floats, s: Floats) -> Floats:
        """ω̃ s (n, n_whole) of motions s of all nodes, for ω (n, n_links, 3)."""
        kept, nodes = self.stack.kept, s.reshape(len(s), len(self.stack.owners), -1)
        whole = np.zeros((*nodes.shape[:2], 6))
        whole[..., kept] = nodes
        w = spin[:, self.stack.owners]
        halves = [np.cross(w, half) for half in np.split(whole, 2, axis=-1)]
        return np.concatenate(halves, axis=-1)[..., kept].reshape(s.shape)


def inertia_forces(
    case: CaseFile, parameters: ModelParameters, motion: Kinematics
) -> InertiaForces:
    """Collect what f hangs on.

    Raises MechanismError as `heavy_links` does.
    """
    heavy, nodes = heavy_links(case, parameters, motion)
    stack, _ = stacked(heavy, nodes, all_moving(case, parameters, motion), motion)
    sizes = [0, *map(whole_size, heavy.values())]
    first = dict(zip(heavy, np.cumsum(sizes).tolist(), strict=False))
    scene = Loaded(case, parameters.with_passive(motion.passive), motion, heavy, nodes)
    placed = [(scene.whole(name).nodes[node], first[name]) for name, node in scene.sites]
    slots = [np.where(own >= 0, own + start, -1) for own, start in placed]
    drives = np.zeros(len(case.coordinates), dtype=object)
    for i, name in enumerate(case.coordinates):
        drives[i] = drive_value(case, parameters, name, "inertia") or 0.0
    sites = np.array(list(scene.sites.values()), dtype=object).reshape(-1, 6, 6)
    return InertiaForces(
        stack,
        np.array(slots, dtype=np.intp).reshape(-1, 6),
        np.array([list(heavy).index(node[0]) for node in scene.sites], dtype=np.intp),
        parameters.relative,
        motion.coordinates.rates[: len(drives)],
        parameters.compiled(*stack.scalars, sites, drives),
        parameters,
    )
