"""Forces: on a mechanism at rest, and what its drives exert along trajectories.

A unit force along n at a node does the work b = n·v on the motion v = B [u; q̇] of the node, in the
axes of the ground; the weight does Qᵀ m N Rᵀ g on u, the links' origins not moving.

With T(q, y) the twists of a link per q̇ in its own axes, V = T q̇ = (v, ω), its inertia
J = Nᵀ m N about its origin, momentum (p, L) = J V, and drive inertias J_d on ṡ = A q̇, virtual work
in the closed kinematics gives (loops need nothing else: passive joints are functions of q)

    Aᵀ τ = Σ_links Tᵀ [ J (T q̈ + Ṫ q̇ − (Rᵀ g, 0)) + (ω × p, ω × L + v × p) ] + Aᵀ J_d s̈.

τ acts on the relative motion of each joint, in N m or N, positive along its coordinate: what its
drive must exert, whether the coordinate is locked, held by a spring or free. Springs of `springs`
rest in the unloaded pose: where nothing bends they carry nothing. Slopes in y are exact: Ṫ, and
all that is a product, by rates along the imaginary axis, which lose no digits.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.arrays import Floats, Ints
from eigassign.case.case_file import CaseFile
from eigassign.mechanism.assembly.build import drive_value, gravity, local_links, rigid_links
from eigassign.mechanism.assembly.congruence import inertia, pulled, scattered
from eigassign.mechanism.assembly.dynamics.velocity_terms import IMAGINARY
from eigassign.mechanism.assembly.node_motion import MotionRow, SpringEnds, along, combined
from eigassign.mechanism.kinematics.forward import Kinematics
from eigassign.mechanism.kinematics.joints import DOFS, multiply
from eigassign.mechanism.kinematics.loop_closure import all_moving
from eigassign.mechanism.kinematics.parameters import ModelParameters
from eigassign.mechanism.kinematics.topology import split
from eigassign.mechanism.trajectory.motion import Moving
from eigassign.mechanism.trajectory.trajectory import Trajectories, Trajectory, rates_at
from eigassign.series.algebra import Tangents
from eigassign.series.compiler import CompiledArrays
from eigassign.series.expression import Scalar


@dataclass(frozen=True, eq=False)
class Forces:
    """Forces as functions of x = (q, y): the non-zeros at ``unknowns`` of each, by one program."""

    unknowns: Sequence[Ints]
    table: CompiledArrays
    parameters: ModelParameters

    def is_fixed(self, variables: NDArray[np.bool_]) -> bool:
        """True where they depend on none of the ``variables`` (n_x,)."""
        moved = (self.parameters.to_z[:, variables] != 0.0).any(axis=1)
        return not self.table.table.program.dependence[:, moved].any()

    def at(self, x: Floats, along: Ints) -> list[tuple[Floats, Floats]]:
        """Of each force the non-zeros (n, k) at samples x (n, n_x), and their slopes (d, n, k).

        The slopes are those in the d variables ``along`` of x.
        """
        n, d, to_z = len(x), len(along), self.parameters.to_z
        z = np.hstack([self.parameters.z(x), np.repeat(to_z[:, along], n, axis=1)])
        found = self.table(z, Tangents(n, d))
        parts = [each.reshape(1 + d, n, each.shape[1]) for each in found]
        return [(part[0], part[1:]) for part in parts]


def forces(
    case: CaseFile,
    parameters: ModelParameters,
    motion: Kinematics,
    nodes: Mapping[str, Sequence[Sequence[float]]],
    weight: bool = False,
) -> Forces:
    """Unit forces at ``nodes``, each along its directions, one after the other; last the weight."""
    links, motions = local_links(case, parameters, motion)
    ends = SpringEnds(case, parameters, motion, motions.rows, motions.count)
    rows: list[MotionRow] = []
    for node, directions in nodes.items():
        moved = ends.in_world(split(node))
        rows += [along(moved, direction) for direction in directions]
    g = gravity(case)
    if weight and g is not None:
        total: dict[int, Scalar] = {}
        for placement, link in zip(motion.placements, links, strict=True):
            pull = np.zeros(6, dtype=object)
            pull[:3] = multiply(placement.world_rotation.T, g[:, None].astype(object))[:, 0]
            kept = list(DOFS[case.mechanism.space])
            total = combined(total, scattered(link, pulled(link, pull[kept])), 1.0)
        rows.append(total)
    arrays = [np.array(list(row.values()), dtype=object) for row in rows]
    unknowns = [np.array(list(row), dtype=np.intp) for row in rows]
    return Forces(unknowns, parameters.compiled(*arrays), parameters)


BLOCK = 1_000_000  # complex numbers evaluated together: 16 MB
Numbers = NDArray[Any]  # real, or complex with slopes along the imaginary axis


@dataclass(frozen=True, eq=False)
class DriveForces:
    """τ of a mechanism; built once, evaluated along trajectories."""

    table: CompiledArrays  # T, (Rᵀg, 0) and J of links with mass, (n_links, 6, n + 7); J_d (n,)
    parameters: ModelParameters

    @property
    def is_affine(self) -> bool:
        """True where τ along given coordinates is affine in the design, which moves no link."""
        table, n_y = self.table.table, len(self.parameters.design)
        of_design = np.arange(self.parameters.count) >= self.parameters.count - n_y
        still = np.zeros(self.table.shapes[0], dtype=bool)
        still[..., :-6] = True
        of_motion = table.weights[: still.size][still.ravel()].indices
        moved = table.program.dependence[np.unique(of_motion)][:, of_design].any()
        return table.program.is_affine(of_design) and not bool(moved)

    def along(
        self, path: Trajectories, y: Floats, slopes: bool = False
    ) -> tuple[Ints, Floats, Floats]:
        """Samples (m,) of the path, τ (m, n) at design y (n_y,), its slopes (m, n, n_y or 0).

        At all samples and instants; at a corner both sides count, and not the blow.
        """
        samples, motions = [], []
        for part, rows in zip(path.parts, path.rows, strict=True):
            motion = rates_at(part.trajectory, y, slopes)
            samples.append(rows.start + motion[0].samples)
            motions.append([[m.q, m.rate, m.acceleration] for m in motion])
        here, by_design = (
            [np.concatenate(each) for each in zip(*own, strict=True)]
            for own in zip(*motions, strict=True)
        )
        size = max(prod(self.table.shapes[0]), self.table.table.program.n_atoms)
        block = max(1, BLOCK // (size * (1 + len(y) * slopes)))
        parts = []
        for first in range(0, len(here[0]), block):
            q, q_by_y = ([a[first : first + block] for a in each] for each in (here, by_design))
            parts.append(self.at(q, q_by_y, y, slopes))
        tau, by_y = (np.concatenate(each) for each in zip(*parts, strict=True))
        return np.concatenate(samples), tau, by_y

    def exerted(self, trajectory: Trajectory, time_s: Floats, y: Floats) -> Floats:
        """τ (n, n_q) at any times (n,) of a trajectory, at design y (n_y,)."""
        motion = trajectory.motion.moving(time_s, y)
        if trajectory.stretch is not None:
            share = trajectory.stretch[1] / y[trajectory.stretch[0]]
            motion = Moving(motion.q, share * motion.rate, share**2 * motion.acceleration)
        still = [np.zeros((*each.shape, len(y))) for each in motion]
        return self.at([*motion], still, y, slopes=False)[0]

    def curves(self, path: Trajectories, y: Floats) -> Floats:
        """τ (n_t, n) at all samples and instants: of a corner the larger side."""
        samples, tau, _ = self.along(path, y)
        out = np.zeros((len(path.time_s), tau.shape[1]))
        for k, row in zip(samples, tau, strict=True):
            out[k] = np.where(np.abs(row) > np.abs(out[k]), row, out[k])
        return out

    def at(
        self, motion: list[Floats], by_design: list[Floats], y: Floats, slopes: bool
    ) -> tuple[Floats, Floats]:
        """τ and slopes for q, q̇, q̈ (m, n_q), which change with the design (m, n_q, n_y)."""
        A, n_y = self.parameters.relative, len(y) if slopes else 0
        n, m = len(A), len(motion[0])
        x = np.zeros((1 + n_y, m, motion[0].shape[1] + len(y)), dtype=complex)
        moved = [np.moveaxis(each, 2, 0)[:n_y] for each in by_design]
        q, rate, acceleration = (
            np.concatenate([here[None], slope]) for here, slope in zip(motion, moved, strict=True)
        )
        x[..., : q.shape[2]] = q + 1j * IMAGINARY * rate
        x[0, :, q.shape[2] :] = y
        x[1 + np.arange(n_y), :, q.shape[2] + np.arange(n_y)] = 1.0
        z = x @ self.parameters.to_z.T
        z[0] += self.parameters.shift
        found = self.table(z.reshape(x.shape[0] * m, -1).T, Tangents(m, n_y))
        parts, drives = (each.reshape(1 + n_y, m, *each.shape[1:]) for each in found)
        T, g, J = np.split(parts.real, [n, n + 1], axis=-1)
        T_rate = parts.imag[..., :n] / IMAGINARY
        terms = [T, T_rate, g, J, drives.real, rate[..., :n], acceleration[..., :n]]
        value = _exerted(A, *(each[0] for each in terms))
        steps = (each[:1] + 1j * IMAGINARY * each[1:] for each in terms)
        return value, np.moveaxis(_exerted(A, *steps).imag / IMAGINARY, 0, 2)


def _exerted(A: Floats, *terms: Numbers) -> Numbers:
    """τ (…, n) of the formula above; T, Ṫ, (Rᵀg, 0) and J (…, n_links, 6, n), J_d, q̇ and q̈."""
    T, T_rate, g, J, drives, rate, acceleration = terms
    q_rate, q_push = (each[..., None, :, None] for each in (rate, acceleration))
    V = T @ q_rate
    momentum = (J @ V)[..., 0]
    (v, w), (p, L) = (np.split(each, 2, axis=-1) for each in (V[..., 0], momentum))
    force = (J @ (T @ q_push + T_rate @ q_rate - g))[..., 0]
    force = force + np.concatenate([np.cross(w, p), np.cross(w, L) + np.cross(v, p)], axis=-1)
    work = np.einsum("...lik,...li->...k", T, force)
    return np.asarray(work @ np.linalg.inv(A) + drives * (acceleration @ A.T))


def drive_forces(case: CaseFile, parameters: ModelParameters, motion: Kinematics) -> DriveForces:
    """The drives of a mechanism, with its weight where `mechanism.gravity` is a vector."""
    moving, kept = all_moving(case, parameters, motion), list(DOFS[case.mechanism.space])
    g = gravity(case)
    parts = []
    links = rigid_links(case, parameters, motion)
    for placement, link in zip(moving.placements, links, strict=True):
        J = np.zeros((6, 6), dtype=object)
        J[np.ix_(kept, kept)] = inertia(link)
        if not J.any():
            continue
        pull = np.zeros((6, 1), dtype=object)
        if g is not None:
            pull[:3, 0] = multiply(placement.world_rotation.T, g)
        parts.append(np.concatenate([placement.twist, pull, J], axis=1))
    drives = np.zeros(len(case.coordinates), dtype=object)
    for i, name in enumerate(case.coordinates):
        drives[i] = drive_value(case, parameters, name, "inertia") or 0.0
    shape = (-1, 6, len(drives) + 7)
    known = parameters.with_passive(moving.passive)
    return DriveForces(known.compiled(np.array(parts, dtype=object).reshape(shape), drives), known)
