"""Which joints, bodies and springs of a case are drawn where, and how thick its lines are."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.case import CaseFile
from eigassign.mechanism.geometry import link_type
from eigassign.mechanism.joints import RIDING, sliding_axis
from eigassign.mechanism.kinematics import mounting
from eigassign.mechanism.poses import Poses as LinkPoses
from eigassign.mechanism.rotations import multiply
from eigassign.mechanism.sections import section_values
from eigassign.mechanism.tree import GROUND, Edge, Node, Tree, split
from eigassign.study.pictures import BodyMark, JointMark, SpringMark

Floats = NDArray[np.float64]
At = Callable[[Node], Floats]  # places (n, d) of a node in n poses
SLIDING = ("prismatic", "cylindrical", "screw", *RIDING)
_ALONG = np.array([1.0, 0.0, 0.0])


def edges(tree: Tree) -> tuple[Edge, ...]:
    """All joints as the file has them, those that close loops last."""
    return tuple(edge.written for edge in (*tree.edges, *tree.loops))


def joint_axes(file: CaseFile, poses: LinkPoses) -> list[NDArray[np.object_]]:
    """Per joint the direction to draw it along, in world axes: where it slides, else its link."""
    return [_axis(file, poses, edge) for edge in edges(poses.motion.tree)]


def _axis(file: CaseFile, poses: LinkPoses, edge: Edge) -> NDArray[np.object_]:
    joint: Any = file.mechanism.joints[edge.joint]
    if joint.type not in SLIDING:
        R = poses.motion.placement(edge.follower[0]).world_rotation
        ahead = -1.0 if edge.follower[1] == "end" else 1.0
        return np.asarray(multiply(R, ahead * _ALONG))
    axis = _ALONG if joint.type in RIDING else sliding_axis(joint)
    turned = multiply(np.eye(3) if joint.type in RIDING else mounting(joint), axis)
    if edge.base == GROUND:
        return np.asarray(turned)
    return np.asarray(multiply(poses.motion.placement(edge.base[0]).world_rotation, turned))


def joints(file: CaseFile, tree: Tree, at: At, axes: Sequence[Floats]) -> tuple[JointMark, ...]:
    """A mark for every joint, at its follower's node; ``axes`` are (n, d) each."""
    driven = {coordinate.joint for coordinate in file.coordinates.values()}
    marks = []
    for edge, axis in zip(edges(tree), axes, strict=True):
        kind = file.mechanism.joints[edge.joint].type
        family = "sliding" if kind in SLIDING else "fixed" if kind == "fixed" else "turning"
        grounded = edge.base == GROUND
        places = at(edge.follower)
        marks.append(JointMark(edge.joint, family, grounded, edge.joint in driven, places, axis))
    return tuple(marks)


def bodies(file: CaseFile, mass: Callable[[str, float], float], at: At) -> tuple[BodyMark, ...]:
    """Every body, and every rigid link that has no extent; ``mass(path, value)`` at the design."""
    found = []
    for name, body in file.mechanism.bodies.items():
        found.append(BodyMark(name, mass(f"bodies.{name}.mass", body.mass), at(split(body.at))))
    links: Mapping[str, Any] = file.mechanism.links
    for name, link in links.items():
        if link_type(file, name) == "rigid" and not _has_extent(link):
            node = next(iter(link.nodes or {"start": None}))
            found.append(BodyMark(name, mass(f"links.{name}.mass", link.mass), at((name, node))))
    return tuple(found)


def _has_extent(link: Any) -> bool:
    places = {tuple(map(float, X)) for X in (link.nodes or {}).values()}
    return link.length is not None or any(map(any, places))


def springs(file: CaseFile, at: At) -> tuple[SpringMark, ...]:
    """Every spring."""
    given: Mapping[str, Any] = getattr(file.mechanism, "springs", None) or {}
    marks = []
    for name, spring in given.items():
        first, second = spring.between
        grounded = "ground" in (first, second)
        ends = [at(split(end)) for end in (first, second) if end != "ground"]
        marks.append(SpringMark(name, grounded, not spring.translational, ends[0], ends[-1]))
    return tuple(marks)


def sizes(
    file: CaseFile, links: tuple[str, ...], drawn: tuple[tuple[tuple[str, str], ...], ...]
) -> tuple[tuple[float, float], ...]:
    """Per line the larger radius of gyration √(I/A) of its section at both ends, in m."""
    found: list[tuple[float, float]] = []
    for link, pairs in zip(links, drawn, strict=True):
        data: Any = file.mechanism.links[link]
        beams = data.beams.values() if link_type(file, link) == "frame" else [data] * len(pairs)
        found += [_line_sizes(file, getattr(beam, "section", None)) for beam in beams]
    return tuple(found)


def _line_sizes(file: CaseFile, section: Any) -> tuple[float, float]:
    if section is None:
        return 0.0, 0.0
    names = (section, section) if isinstance(section, str) else (section.start, section.end)
    start, end = (_gyration(file.mechanism.sections[name]) for name in names)
    return start, end


def _gyration(section: Any) -> float:
    values: Any = section_values(section, lambda _key, value: value)
    return float(np.sqrt(max(values.inertia_z, values.inertia_y) / values.area))
