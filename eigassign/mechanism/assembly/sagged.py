"""A mechanism as its weight has bent it at one pose, assembled anew.

Each element keeps what statics say of it in its own axes, its stretch and the turn of one end
against the other, and is set on the one before it, with rotations of any size. So nodes lie at
other places of their link and are turned in it, joints, bodies and springs with them (`Moved`), and
loops close anew.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from eigassign.case.schema.mechanism import Assembly
from eigassign.case.schema.parts import FrozenDict
from eigassign.mechanism.assembly.build import (
    build_pencil,
    erls_motion,
    local_links,
    with_reduction,
)
from eigassign.mechanism.assembly.dynamics.under_load import Beams, LoadedPose
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.mechanism.elements.links import BentElement, bent_link
from eigassign.mechanism.elements.mesh import LinkMesh, Strand
from eigassign.mechanism.elements.sections import Profile, each_element
from eigassign.mechanism.kinematics.forward import LinkFrames
from eigassign.mechanism.kinematics.joints import X
from eigassign.mechanism.kinematics.parameters import Moved
from eigassign.mechanism.kinematics.topology import NodeName

Floats = NDArray[np.float64]
Nodes = dict[int, tuple[Floats, Floats]]  # place (3,) and turn (3, 3) by a node's first slot


def sagged(
    frames: LinkFrames, meshes: Mapping[str, LinkMesh], pose: LoadedPose, x: Floats, u: Floats
) -> Pencil:
    """K and M of the mechanism bent by u (n_dof,), for the sample x (n_x,) of the ``pose`` alone.

    ``meshes`` are those of the links, of which beams are left whole. Raises MechanismError where
    loops do not close.
    """
    v, beams = np.asarray(pose.strained @ u), iter(pose.beams)
    moved, bent = dict[NodeName, Moved](), dict[str, tuple[Nodes, list[_Element]]]()
    parts = {name: mesh for name, mesh in meshes.items() if not mesh.whole.strands}
    for name, mesh in meshes.items():
        if name not in parts:
            pairs = [(strand, next(beams)) for strand in mesh.whole.strands]
            start = np.array(mesh.whole.strands[0].points[0], dtype=np.float64)
            before, after = (
                [e for strand, own in pairs for e in _elements(strand, own, way)]
                for way in (0.0 * v, v)
            )
            straight, nodes = _set(start, before), _set(start, after)
            bent[name] = nodes, after
            for key, slots in mesh.whole.nodes.items():
                (p, _), (q, R) = straight[int(slots[0])], nodes[int(slots[0])]
                moved[name, key] = Moved(q - p, R)
    case, numbers = frames.case, replace(frames.parameters, moved=moved)
    passive = frames.values(x, [np.array(frames.motion.passive, dtype=object)])[0][0].tolist()
    guess: dict[str, tuple[float, ...]] = {}
    for freedom, value in zip(frames.motion.tree.passive, passive, strict=True):
        guess[freedom.joint] = (*guess.get(freedom.joint, ()), value)
    at = FrozenDict(dict(zip(case.coordinates, x.tolist(), strict=False)))
    assembly = Assembly.model_construct(at=at, guess=FrozenDict(guess))
    update = {"assembly": assembly if guess else None}
    case = replace(case, mechanism=case.mechanism.model_copy(update=update))
    case = with_reduction(case, dict.fromkeys(bent))
    for name, (nodes, elements) in bent.items():
        number = {slot: k for k, slot in enumerate(nodes)}
        named = {key: number[int(s[0])] for key, s in meshes[name].whole.nodes.items()}
        rows = [e.between(nodes, number) for e in elements]
        places = np.array([p for p, _ in nodes.values()])
        parts[name] = bent_link(case, numbers, name, places, named, rows)
    motion = erls_motion(case, numbers)
    return build_pencil(case, numbers, motion, local_links(case, numbers, motion, parts))


class _Element(NamedTuple):
    """An element between nodes, in its axes (rows): from end to end, and how these are turned."""

    ends: tuple[int, int]
    axes: Floats
    step: Floats
    turn: Floats
    profile: Profile

    def between(self, nodes: Nodes, number: Mapping[int, int]) -> BentElement:
        """What it is where the nodes are now: along its chord, its y the mean of both ends'."""
        (p, R), (q, S) = (nodes[slot] for slot in self.ends)
        h = float(np.linalg.norm(q - p))
        along, y = (q - p) / h, (R + S) @ self.axes[1]
        y = y - (along @ y) * along
        y = y / np.linalg.norm(y)
        ends = number[self.ends[0]], number[self.ends[1]]
        return BentElement(ends, np.array([along, y, np.cross(along, y)]), h, self.profile)


def _elements(strand: Strand, own: Beams, v: Floats) -> Iterator[_Element]:
    """The elements of a strand with what the displacements v (n_whole,) do to each."""
    d = own.elements.seen(v[:, None])[..., 0]
    axes = np.array(strand.axes, dtype=np.float64)
    ends = pairwise(int(slots[0]) for slots in strand.slots)
    profiles = each_element(own.profile, len(d))
    for pair, h, each, profile in zip(ends, own.h, d, profiles, strict=True):
        step = h * X + each[6:9] - each[:3] - np.cross(each[3:6], h * X)
        turn = Rotation.from_rotvec(each[9:] - each[3:6]).as_matrix()
        yield _Element(pair, axes, step, turn, profile)


def _set(start: Floats, elements: Sequence[_Element]) -> Nodes:
    """The nodes of elements set on one another, from the first one's start on."""
    found, waiting = {elements[0].ends[0]: (start, np.eye(3))}, list(elements)
    while waiting:
        e = waiting.pop(next(k for k, e in enumerate(waiting) if found.keys() & set(e.ends)))
        a, b = e.ends
        if b not in found:
            p, R = found[a]
            found[b] = p + R @ e.axes.T @ e.step, R @ e.axes.T @ e.turn @ e.axes
        elif a not in found:
            q, S = found[b]
            R = S @ e.axes.T @ e.turn.T @ e.axes
            found[a] = q - R @ e.axes.T @ e.step, R
    return found
