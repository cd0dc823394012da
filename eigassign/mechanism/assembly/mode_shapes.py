"""What a mode does: how nodes and beams move; and the total mass.

Every link with its bodies moves as one in a translation e of its nodes, so that its mass is eᵀ m e
with the link's own mass matrix m = Σ μ_i(y) m_i. Links held by the ground count as well; what a
drive reflects through its gear is no mass.

The local motion of a link's nodes is v = B [u; q̇] of eq. (1), of a reduced link that of all the
nodes it stands for. It is turned into world axes for drawing. Between nodes a beam takes the shapes
of its elements.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from eigassign.arrays import Floats, Ints
from eigassign.brief import Brief
from eigassign.case.case_file import CaseFile
from eigassign.mechanism.assembly.build import local_links
from eigassign.mechanism.assembly.congruence import LocalLink, motion_matrix, motion_scalars
from eigassign.mechanism.elements.beam import Shear, fields
from eigassign.mechanism.elements.links import LinkMesh, Strand, axes
from eigassign.mechanism.kinematics.forward import LinkFrames, Placement
from eigassign.mechanism.kinematics.joints import Objects
from eigassign.mechanism.kinematics.loop_closure import reference
from eigassign.mechanism.kinematics.parameters import ModelParameters, written_loads
from eigassign.series.algebra import Tangents
from eigassign.series.compiler import CompiledTable, compile_table
from eigassign.series.expression import Scalar


@dataclass(frozen=True, eq=False)
class TotalMass:
    """Σ_links Σ_i μ_i(y) eᵀ m_i e; it does not depend on the pose."""

    table: CompiledTable  # one row
    at: Floats  # z = (s, y) (n_z,) where the mechanism can be put together
    n_y: int
    loads: Floats  # (n_loads,) that it is with: as written

    @property
    def is_affine(self) -> bool:
        """True where it is of degree 1 in y at most, by its form."""
        return self.table.program.is_affine(np.arange(len(self.at)) >= len(self.at) - self.n_y)

    def __call__(self, y: Floats) -> tuple[float, Floats]:
        """The mass in kg of a design y (n_y,), and its slope (n_y,) in kg per SI unit of y."""
        first = len(self.at) - self.n_y
        z = np.zeros((len(self.at), 1 + self.n_y))
        z[:, 0] = self.at
        z[first:, 0] = y
        z[first:, 1:] = np.eye(self.n_y)
        row = self.table.evaluate(Tangents(1, self.n_y), z)[0]
        return float(row[0]), row[1:]


def total_mass(
    case: CaseFile, parameters: ModelParameters, meshes: Iterable[LinkMesh]
) -> TotalMass:
    """The mass of the links of a mechanism, each with all its dofs and its bodies."""
    mass: Scalar = 0.0
    for mesh in meshes:
        # Translation does not depend on y: the first column of all terms of N is one of numbers.
        e = np.sum([term.matrix[:, [0]].toarray()[:, 0] for term in mesh.rigid], axis=0)
        for term in mesh.mass:
            mass = mass + term.coefficient * float(e @ (term.matrix @ e))
    at = reference(case, parameters)
    table = compile_table(parameters.recorder, [mass], len(at))
    return TotalMass(table, at, len(parameters.design), written_loads(case))


@dataclass(frozen=True, repr=False)
class NodeShape(Brief):
    """One node: ``place`` (3,) m, ``motion`` (count, 6): v and ω in world axes per vector."""

    place: Floats
    motion: Floats


@dataclass(frozen=True, repr=False)
class StrandShape(Brief):
    """One beam, or one straight connection of a link without beams: points along it.

    ``places`` (n_points, d) in m where the equivalent rigid link has them, ``motions``
    (count, n_points, d) their displacements per vector, in world axes; d is 2 in a plane, else 3.
    """

    link: str
    places: Floats
    motions: Floats


class Shapes(NamedTuple):
    """The motion of a mechanism in ``count`` vectors, at one pose and design."""

    strands: tuple[StrandShape, ...]
    nodes: Mapping[tuple[str, str], NodeShape]  # by (link, node)


def shapes(poses: LinkFrames, x: Floats, phi: Floats) -> tuple[Shapes, ...]:
    """The motion of all nodes and beams in the vectors ``phi`` (n, n_dof, count) at samples x."""
    case = poses.case
    links, numbering = local_links(case, poses.parameters, poses.motion)
    parts = [
        _symbols(link, placement, numbering.meshes[placement.link], poses)
        for link, placement in zip(links, poses.motion.placements, strict=True)
    ]
    values = poses.values(x, [array for part in parts for array in part.arrays])
    d = 2 if case.mechanism.space == "planar" else 3
    found = []
    for k, vectors in enumerate(phi):
        here = (each[k] for each in values)
        own = [
            _LinkMotion(p, [next(here) for _ in p.arrays], vectors, numbering.count) for p in parts
        ]
        strands = tuple(strand for motion in own for strand in motion.strands(d))
        nodes = {name: node for motion in own for name, node in motion.nodes().items()}
        found.append(Shapes(strands, nodes))
    return tuple(found)


class _Symbols(NamedTuple):
    """The arrays of scalars of one link that are evaluated at x, in a fixed order."""

    name: str
    local: LocalLink
    mesh: LinkMesh  # with all its nodes
    strands: tuple[Strand, ...]
    arrays: tuple[Objects, ...]


def _symbols(local: LocalLink, placement: Placement, mesh: LinkMesh, poses: LinkFrames) -> _Symbols:
    mesh = mesh.whole
    strands = tuple(mesh.strands) or _spokes(placement.link, mesh, poses)
    arrays = [
        placement.world_rotation,
        placement.world_origin,
        np.array(list(mesh.positions.values()), dtype=object).reshape(-1, 3),
        *motion_scalars(local),
    ]
    for strand in strands:
        shear = np.array(strand.shear, dtype=object).reshape(-1, 2, 2)
        arrays += [np.array(list(strand.points), dtype=object), shear]
    return _Symbols(placement.link, local, mesh, strands, tuple(arrays))


def _spokes(link: str, mesh: LinkMesh, poses: LinkFrames) -> tuple[Strand, ...]:
    """The connections drawn of a rigid link or a superelement, each as one element."""
    none = Shear(0.0, 0.0)
    return tuple(
        Strand(
            [_slots(mesh, name) for name in pair],
            [mesh.positions[name] for name in pair],
            None,
            [(none, none)],
        )
        for pair in poses.drawn[poses.links.index(link)]
    )


def _slots(mesh: LinkMesh, node: str) -> Ints:
    return mesh.nodes["@origin" if "@origin" in mesh.nodes else node]


class _LinkMotion:
    """One link in numbers: where it is, and how its nodes move in its own axes."""

    def __init__(self, part: _Symbols, values: Sequence[Floats], phi: Floats, n_u: int) -> None:
        self.part = part
        self.rotation, self.origin, self.positions, *motion, strands = [*values[:6], values[6:]]
        self.lines = list(zip(part.strands, strands[::2], strands[1::2], strict=True))
        v = motion_matrix(part.local, motion, n_u, len(phi)) @ phi
        reduction = part.local.reduction
        self.local = v if reduction is None else reduction.basis @ v  # (n_local, count)

    def at(self, slots: Ints, X: Floats) -> Floats:
        """(6, count): motion of the node with these slots at X, in the link's axes."""
        motion = np.zeros((6, self.local.shape[1]))
        motion[slots >= 0] = self.local[slots[slots >= 0]]
        if "@origin" in self.part.mesh.nodes:  # of a rigid link, v + ω × X
            motion[:3] += np.cross(motion[3:].T, X).T
        return motion

    def nodes(self) -> dict[tuple[str, str], NodeShape]:
        """The shapes of all named nodes."""
        found = {}
        for name, X in zip(self.part.mesh.positions, self.positions, strict=True):
            motion = self.at(_slots(self.part.mesh, name), X)
            world = np.concatenate([self.rotation @ motion[:3], self.rotation @ motion[3:]])
            found[self.part.name, name] = NodeShape(self.origin + self.rotation @ X, world.T)
        return found

    def strands(self, d: int) -> list[StrandShape]:
        """The shapes of all lines, as points in world axes."""
        found = []
        for strand, X, shear in self.lines:
            at_nodes = np.stack(
                [self.at(s, place) for s, place in zip(strand.slots, X, strict=True)]
            )
            places, motions = along(X, at_nodes, shear, strand.axes)
            found.append(
                StrandShape(
                    self.part.name,
                    (self.origin + places @ self.rotation.T)[:, :d],
                    (motions @ self.rotation.T)[..., :d],
                )
            )
        return found


def along(X: Floats, motion: Floats, shear: Floats, turn: Floats | None) -> tuple[Floats, Floats]:
    """Places (n_points, 3) and displacements (count, n_points, 3) along a row of beam elements.

    ``X`` (n + 1, 3) are its nodes, ``motion`` (n + 1, 6, count) their motion, ``shear`` (n, 2, 2)
    Φ and Φ r of each element in both planes; ``turn`` has the elements' axes as rows, in the axes
    of all these.
    """
    step = np.diff(X, axis=0)
    h = np.linalg.norm(step, axis=1)
    if not h.all():  # a spoke of no length
        return X, motion[:, :3].transpose(2, 0, 1)
    turn = axes(step[0]) if turn is None else turn
    # at least 24 intervals drawn of a beam, and one of each element
    n, count = len(h), max(1, -(-24 // len(h)))
    xi = np.arange(count) / count
    N = fields(np.tile(xi, (n, 1)), h[:, None], shear[:, None])[..., :3, :]  # (n, n_xi, 3, 12)
    turned = np.concatenate([turn @ motion[:, :3], turn @ motion[:, 3:]], axis=1)
    both = np.concatenate([turned[:-1], turned[1:]], axis=1)  # of each element, (n, 12, count)
    inner = np.einsum("exij,ejc->cexi", N, both) @ turn
    places = X[:-1, None] + xi[:, None] * step[:, None]
    ends = motion[-1, :3].T[:, None]
    flat = inner.reshape(len(inner), n * len(xi), 3)
    return np.concatenate([places.reshape(-1, 3), X[-1:]]), np.concatenate([flat, ends], axis=1)
