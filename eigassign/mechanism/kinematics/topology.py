"""The graph of links and joints, and the case's coordinates against the freedoms of joints.

The joints that the tree leaves over close loops. Each loop is closed, where it can be, at a node
that deforms: that node's motion then follows from the rest. So a loop is closed at another of its
joints where the first choice ends between rigid links or at nodes that are carried already.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from eigassign.arrays import Floats
from eigassign.case.case_file import CaseFile
from eigassign.case.schema.mechanism import FREEDOMS, RIDING
from eigassign.errors import MechanismError

NodeName = tuple[str, str]  # (link, node); the ground is ("ground", "")
GROUND: NodeName = ("ground", "")


class JointEdge(NamedTuple):
    """One joint as it is walked: ``follower`` hangs on ``base``.

    ``turned`` where the file names the two the other way round: the joint is then walked against
    its own direction, its freedoms keep their meaning.
    """

    joint: str
    base: NodeName
    follower: NodeName
    turned: bool = False

    def reversed(self) -> JointEdge:
        """The joint walked the other way."""
        return JointEdge(self.joint, self.follower, self.base, not self.turned)

    @property
    def written(self) -> JointEdge:
        """The joint as the file has it."""
        return self.reversed() if self.turned else self


class Freedom(NamedTuple):
    """One freedom of one joint: driven by coordinate number ``coordinate``, or passive (None)."""

    joint: str
    component: int
    coordinate: int | None


@dataclass(frozen=True)
class Topology:
    """Tree edges in an order where every base is placed first; loop edges; freedoms.

    The first ``n_elastic`` loops end in a node that deforms and carries nothing else: it follows.
    The others close between nodes that are rigid, or carried themselves.
    """

    edges: tuple[JointEdge, ...]
    loops: tuple[JointEdge, ...]
    n_elastic: int
    freedoms: tuple[Freedom, ...]  # the coordinates in their order, then the passive ones

    @property
    def passive(self) -> tuple[Freedom, ...]:
        """The freedoms without a coordinate."""
        return tuple(f for f in self.freedoms if f.coordinate is None)

    def of_joint(self, joint: str) -> list[int]:
        """Positions among the freedoms of one joint's own, by component."""
        own = [(f.component, k) for k, f in enumerate(self.freedoms) if f.joint == joint]
        return [k for _, k in sorted(own)]

    def hanging(self, node: NodeName) -> list[tuple[JointEdge, int]]:
        """The tree's joints at a node, −1 with the one that the node's own link hangs on."""
        own = [(edge, -1) for edge in self.edges if edge.follower == node]
        return own + [(edge, 1) for edge in self.edges if edge.base == node]

    @cached_property
    def beyond(self) -> dict[str, list[str]]:
        """Every link with all that it carries in the tree."""
        found: dict[str, list[str]] = {"ground": []}
        for edge in reversed(self.edges):
            own = found.setdefault(edge.follower[0], [])
            own.append(edge.follower[0])
            found.setdefault(edge.base[0], []).extend(own)
        return found

    @cached_property
    def riders(self) -> Mapping[str, list[str]]:
        """The carriages and nuts that travel along a link, by its name; none of others."""
        found = defaultdict[str, list[str]](list)
        for edge in (*self.edges, *self.loops):
            if edge.written.base[1] == f"@{edge.joint}":
                found[edge.written.base[0]].append(edge.joint)
        return found


def split(node: str) -> NodeName:
    """ "link.node" → (link, node)."""
    link, _, name = node.partition(".")
    return link, name


def freedoms(case: CaseFile) -> tuple[Freedom, ...]:
    """The driven freedoms in the order of the coordinates, then the passive ones."""
    driven = []
    for i, c in enumerate(case.coordinates.values()):
        names = FREEDOMS[case.mechanism.joints[c.joint].type]
        component = getattr(c, "component", None)
        place = 0 if component is None else names.index(str(component))
        driven.append(Freedom(c.joint, place, i))
    taken = {(f.joint, f.component) for f in driven}
    passive = [
        Freedom(name, k, None)
        for name, joint in case.mechanism.joints.items()
        for k in range(len(FREEDOMS[joint.type]))
        if (name, k) not in taken
    ]
    return tuple(driven + passive)


# --- the spanning tree


class _SpanningTree(NamedTuple):
    """Tree edges, and the other joints sorted: ending in a free node that deforms, or not."""

    edges: list[JointEdge]
    elastic: list[JointEdge]
    rigid: list[JointEdge]


def build_tree(case: CaseFile) -> Topology:
    """From the ground, joints in the order of the file, each from base to follower if possible."""
    joints = []
    for name, joint in case.mechanism.joints.items():
        base = (joint.base, f"@{name}") if joint.type in RIDING else GROUND
        if base == GROUND and joint.base != "ground":
            base = split(joint.base)
        joints.append(JointEdge(name, base, split(joint.follower)))
    rigid = {n for n, link in case.mechanism.links.items() if getattr(link, "type", "") == "rigid"}
    walk = _walk(joints, frozenset(), rigid)
    while better := _better(joints, walk, rigid):
        walk = better
    loops = (*walk.elastic, *walk.rigid)
    return Topology(tuple(walk.edges), loops, len(walk.elastic), freedoms(case))


def _walk(joints: Sequence[JointEdge], closing: frozenset[str], rigid: set[str]) -> _SpanningTree:
    """Hang link after link, keeping the joints ``closing`` for loops."""
    placed, tree = {"ground"}, list[JointEdge]()
    waiting = [e for e in joints if e.joint not in closing]
    while step := next(_steps(waiting, placed), None):
        tree.append(step)
        placed.add(step.follower[0])
        del waiting[next(k for k, e in enumerate(waiting) if e.joint == step.joint)]
    used = {edge.joint for edge in tree}
    return _sorted(tree, [e for e in joints if e.joint not in used], rigid)


def _steps(waiting: Sequence[JointEdge], placed: set[str]) -> Iterator[JointEdge]:
    """Joints that reach a new link: as the file has them first, then against their direction."""
    for edges in (waiting, (e.reversed() for e in waiting)):
        yield from (e for e in edges if e.base[0] in placed and e.follower[0] not in placed)


def _sorted(tree: list[JointEdge], loops: Sequence[JointEdge], rigid: set[str]) -> _SpanningTree:
    """Loop edges towards a node of their own that deforms, and those that have none."""
    carriers = {edge.follower: edge.base for edge in tree}
    roots = {edge.follower[0]: edge.follower for edge in tree}
    walk = _SpanningTree(tree, [], [])
    for edge in loops:
        ends = (e for e in (edge, edge.reversed()) if e.follower[0] not in {"ground", *rigid})
        closed = next((e for e in ends if _free(e, carriers, roots, rigid)), None)
        if closed is None:
            walk.rigid.append(edge)
        else:
            walk.elastic.append(closed)
            carriers[closed.follower] = closed.base
    return walk


def _free(
    edge: JointEdge, carriers: dict[NodeName, NodeName], roots: dict[str, NodeName], rigid: set[str]
) -> bool:
    """True where nothing carries the follower node, and it does not carry the base node itself."""
    node = edge.base
    while node != edge.follower:
        if node in carriers:
            node = carriers[node]
        elif node[0] in rigid:
            node = roots[node[0]]
        else:
            return edge.follower not in carriers
    return False


def _better(
    joints: Sequence[JointEdge], walk: _SpanningTree, rigid: set[str]
) -> _SpanningTree | None:
    """The walk with one more loop closed at a node that deforms, by exchanging two joints."""
    closing = frozenset(e.joint for e in (*walk.elastic, *walk.rigid))
    for edge in walk.rigid:
        for other in _round(walk.edges, edge):
            trial = _walk(joints, closing - {edge.joint} | {other}, rigid)
            if len(trial.rigid) < len(walk.rigid):
                return trial
    return None


def _round(edges: Sequence[JointEdge], closing: JointEdge) -> list[str]:
    """The tree joints of the loop that a joint closes."""
    holder = {edge.follower[0]: edge for edge in edges}
    sides = []
    for link in (closing.base[0], closing.follower[0]):
        path = []
        while link in holder:
            path.append(holder[link].joint)
            link = holder[link].base[0]
        sides.append(path)
    return [j for j in (*sides[0], *sides[1]) if (j in sides[0]) != (j in sides[1])]


Angles = dict[str, tuple[Floats, float] | None]  # per link: row over q and constant, or unknown


class CoordinateMap(NamedTuple):
    """s = ``relative`` q + ``offset`` are the joint coordinates in the order of q.

    ``columns`` are the coordinates that are not locked: the q̇ of eq. (1); ``rates``
    (n_freedoms, n_columns) are the driven freedoms' rates per q̇, locked and passive rows zero. The
    unknown of a held coordinate is the deflection of its drive, so that K = diag(K_E, 0) whatever
    it rides on.
    """

    relative: Floats
    offset: Floats
    columns: tuple[int, ...]
    rates: Floats


def coordinates(case: CaseFile, tree: Topology) -> CoordinateMap:
    """The maps of a case."""
    relative, offset = _relative(case, tree)
    moves = [c.moves for c in case.coordinates.values()]
    columns = tuple(i for i, how in enumerate(moves) if how != "locked")
    free = tuple(i for i in columns if moves[i] == "free")
    # ṡ per q̇: a held joint's own deflection, and free coordinates while all others stand still;
    # q̇ = A⁻¹ ṡ, restricted to the free ones ṡ_F = [(A⁻¹)_FF]⁻¹ q̇_F
    driven = np.eye(len(relative))
    if not np.array_equal(relative, driven):
        driven[np.ix_(free, free)] = np.linalg.inv(np.linalg.inv(relative)[np.ix_(free, free)])
        driven[np.abs(driven) < 1e-12] = 0.0  # round-off of two inverses of a matrix of 0, ±1
    rates = np.zeros((len(tree.freedoms), len(columns)))
    rates[: len(moves)] = driven[:, list(columns)]
    return CoordinateMap(relative, offset, columns, rates)


def _relative(case: CaseFile, tree: Topology) -> tuple[Floats, Floats]:
    """An absolute angle minus the absolute angle of the base and the mounting angle."""
    n = len(case.coordinates)
    relative, offset = np.eye(n), np.zeros(n)
    wanted = [c.angle == "absolute" for c in case.coordinates.values()]
    if not any(wanted):
        return relative, offset
    absolute: Angles = {"ground": (np.zeros(n), 0.0)}
    for edge in (*tree.edges, *tree.loops):
        i = next((f.coordinate for f in tree.freedoms if f.joint == edge.joint), None)
        if i is not None and wanted[i]:
            under = _absolute_base(case, tree, edge, i, absolute)
            relative[i], offset[i] = relative[i] - under[0], -under[1] - _mount(case, edge)
            if np.isnan(offset[i]):
                message = (
                    "is absolute, while the angle of its joint, or of one below, is a design "
                    "parameter or set along a trajectory: write relative"
                )
                raise MechanismError(f"coordinates.{tuple(case.coordinates)[i]}.angle", message)
        if edge in tree.edges:
            absolute[edge.follower[0]] = _carried_angle(
                case, tree, edge, absolute, relative, offset
            )
    return relative, offset


def _mount(case: CaseFile, edge: JointEdge) -> float:
    """The angle that a joint is turned by; NaN where it varies."""
    varies = f"joints.{edge.joint}.angle" in case.varied
    return np.nan if varies else float(case.mechanism.joints[edge.joint].angle)


def _absolute_base(
    case: CaseFile, tree: Topology, edge: JointEdge, i: int, absolute: Angles
) -> tuple[Floats, float]:
    """Absolute angle of the base of a joint whose coordinate i is the follower's."""
    path, (base, _) = f"coordinates.{tuple(case.coordinates)[i]}.angle", edge.written.base
    if edge.turned and edge in tree.edges:
        message = (
            f"joint {edge.joint!r} hangs its base on its follower, whose absolute angle is thus "
            "that of other joints: write relative, or exchange base and follower"
        )
        raise MechanismError(path, message)
    under = absolute[base]
    if under is None:
        raise MechanismError(path, "an absolute angle needs a base that no passive joint carries")
    return under


def _carried_angle(
    case: CaseFile,
    tree: Topology,
    edge: JointEdge,
    absolute: Angles,
    relative: Floats,
    offset: Floats,
) -> tuple[Floats, float] | None:
    """Absolute angle of the link that a tree joint hangs; None where a passive joint is below."""
    below, own = absolute[edge.base[0]], tree.of_joint(edge.joint)
    if below is None or any(tree.freedoms[k].coordinate is None for k in own):
        return None
    turn, constant = np.zeros(len(relative)), _mount(case, edge)
    if own and case.mechanism.joints[edge.joint].type == "revolute":
        turn, constant = relative[own[0]], constant + offset[own[0]]
    sign = -1.0 if edge.turned else 1.0
    return below[0] + sign * turn, below[1] + sign * constant
