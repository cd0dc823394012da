"""The mechanism as lines and symbols: in poses, in its modes, and one mode along the trajectory.

Links are polylines through their nodes, as thick as their sections; joints, bodies and springs are
symbols at their nodes. Everything is plain numbers, in m.

At some poses of every trajectory: the rigid links, and the modes at their largest. The sign of a
mode is free; here it is kept from pose to pose, so that neighbours have the same phase.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.arrays import Floats, Ints
from eigassign.assignment.program import frozen
from eigassign.case.case_file import CaseFile
from eigassign.case.schema.mechanism import RIDING, SLIDING
from eigassign.case.units import SI, shown_point
from eigassign.mechanism.kinematics.forward import LinkFrames
from eigassign.mechanism.kinematics.joints import mounting, multiply, sliding_axis
from eigassign.mechanism.kinematics.parameters import initial_design, link_type
from eigassign.mechanism.kinematics.topology import GROUND, JointEdge, NodeName, Topology, split
from eigassign.mechanism.solids.elements import KINDS
from eigassign.mechanism.solids.part import couplings
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.arguments import spread
from eigassign.modal.model import Model, ModeShapes
from eigassign.study.given import section_names
from eigassign.study.results import (
    DrawnBody,
    DrawnJoint,
    DrawnPoses,
    DrawnSolid,
    DrawnSpring,
    ModePictures,
    Motion,
    MovingMode,
)

POSES = 7  # drawn, first and last sample included
CROWDED = 12  # lines of a mechanism of which only three poses can be told apart
AMPLITUDE = 0.1  # a mode's largest displacement, relative to the mechanism's extent


def draw_poses(file: CaseFile, model: Model, trajectory: Trajectories, y: Floats) -> DrawnPoses:
    """Poses at samples evenly spread over the trajectory's length in q, at design y."""
    crowded = sum(map(len, model.poses.drawn)) > CROWDED
    chosen = spread_samples(trajectory.q[:, : len(file.coordinates)], 3 if crowded else POSES)
    seams = [rows.stop for rows in trajectory.rows[:-1]]
    if trajectory.tip is None:
        tip = _farthest_travelled(file, model, model.x(trajectory.q, y), seams)
    else:
        tip = frozen(np.insert(trajectory.tip, seams, np.nan, axis=0))
    poses = _posed(file, model, model.x(trajectory.q[chosen], y), trajectory.time_s[chosen], tip)
    of = (trajectory.name_of(k) for k in chosen if trajectory.several)
    return replace(poses, of=tuple(of))


def rest_pose(file: CaseFile, model: Model, q: Floats, y: Floats) -> DrawnPoses:
    """The one pose of a case without a trajectory."""
    return _posed(file, model, model.one(q, y), np.zeros(1), None)


def spread_samples(q: Floats, count: int) -> list[int]:
    """The rows of at most ``count`` samples, spread evenly over the distance travelled."""
    steps = np.linalg.norm(np.diff(q, axis=0), axis=1)
    travelled = np.concatenate([[0.0], np.cumsum(steps)])
    if travelled[-1] == 0.0:
        return [0]
    wanted = np.linspace(0.0, travelled[-1], count)
    return sorted({int(np.abs(travelled - distance).argmin()) for distance in wanted})


def draw_modes(file: CaseFile, model: Model, q: Floats, y: Floats, count: int) -> ModePictures:
    """The lowest elastic modes at one pose and design, rigid motion φ_q included.

    Raises what `Model.shapes` raises.
    """
    shapes, x = model.shapes(q, y, count), model.one(q, y)
    names, q_units = (*model.q_names, *model.y_names), map(str, file.q_units)
    units = (*(SI(unit, "deg" * (unit == "rad")) for unit in q_units), *file.design_units)
    scales = AMPLITUDE * extent_of(shapes) / largest_of(shapes) * _phase(shapes)
    return ModePictures(
        title=file.title,
        rigid_modes=model.n_rigid,
        frequencies_hz=tuple(float(hz) for hz in shapes.frequencies),
        where=shown_point(names, x[0], units),
        amplitude=AMPLITUDE,
        rest=displaced(file, model, x, [shapes], np.zeros((1, count))),
        deformed=displaced(file, model, np.repeat(x, count, 0), [shapes] * count, np.diag(scales)),
    )


def extent_of(shapes: ModeShapes) -> float:
    """Diagonal of the box that holds the rigid links, m."""
    return float(np.linalg.norm(np.ptp(np.concatenate([s.places for s in shapes.strands]), axis=0)))


def largest_of(shapes: ModeShapes) -> Floats:
    """The largest displacement in each mode, (count,)."""
    each = [np.linalg.norm(strand.motions, axis=2).max(axis=1) for strand in shapes.strands]
    return np.asarray(np.max(each, axis=0))


def _phase(shapes: ModeShapes) -> Floats:
    """±1 (count,): a phase that round-off does not decide where two nodes move equally far.

    The sign of Σ_l v̄_l · (1, 0.7, 0.4) / l over the lines l = 1, 2, … with mean motion v̄_l.
    """
    leaning = np.array([1.0, 0.7, 0.4])
    means = (s.motions.mean(axis=1) for s in shapes.strands)
    each = [v @ leaning[: v.shape[1]] / k for k, v in enumerate(means, start=1)]
    return np.where(np.sum(each, axis=0) < 0.0, -1.0, 1.0)


def displaced(
    file: CaseFile,
    model: Model,
    x: Floats,
    found: Sequence[ModeShapes],
    factors: Floats,
    points: int | None = None,
) -> DrawnPoses:
    """Poses at x (n, n_x): ``found`` times ``factors`` (n, count), lines of ``points`` at most."""
    d, n = _dimension(file), len(found)

    def at(node: NodeName) -> Floats:
        own = zip((one.nodes[node] for one in found), factors, strict=True)
        return frozen(np.array([at.place + f @ at.motion[:, :3] for at, f in own])[:, :d])

    lines = []
    for one, f in zip(found, factors, strict=True):
        whole = (s.places + np.tensordot(f, s.motions, axes=1) for s in one.strands)
        lines.append(tuple(frozen(spread(line, points or len(line))) for line in whole))
    axes = model.poses.values(x, joint_axes(file, model.poses))
    y = x[0, len(model.q_names) :]
    solids = _solids(file, model, x) if points is None else ()
    return DrawnPoses(
        time_s=np.zeros(n),
        lines=tuple(lines),
        solids=tuple(_moved(solid, found, factors) for solid in solids),
        **_symbols(file, model, y, at, [axis[:, :d] for axis in axes]),
    )


def _posed(
    file: CaseFile, model: Model, x: Floats, time_s: Floats, tip_path: Floats | None
) -> DrawnPoses:
    """Undeformed poses at samples x, all of one design."""
    poses, d = model.poses, _dimension(file)
    nodes = _named_nodes(file, model)
    axes = joint_axes(file, poses)
    values = poses.values(x, [*(poses.world(*node) for node in nodes), *axes])
    place = {node: frozen(value[:, :d]) for node, value in zip(nodes, values, strict=False)}
    lines = [
        np.stack([place[link, start], place[link, end]], axis=1)
        for link, pairs in zip(poses.links, poses.drawn, strict=True)
        for start, end in pairs
    ]
    directions = [frozen(value[:, :d]) for value in values[len(nodes) :]]
    return DrawnPoses(
        time_s=frozen(time_s),
        lines=tuple(tuple(frozen(line[k]) for line in lines) for k in range(len(x))),
        tip_path=tip_path,
        solids=tuple(_solids(file, model, x)),
        **_symbols(file, model, x[0, len(model.q_names) :], place.__getitem__, directions),
    )


def _symbols(
    file: CaseFile, model: Model, y: Floats, at: At, axes: Sequence[Floats]
) -> dict[str, Any]:
    """The joints, bodies and springs of poses, and how thick lines are, of one design."""
    file, poses = file.with_design(y), model.poses
    return {
        "link_names": poses.links,
        "line_links": tuple(
            link for link, pairs in zip(poses.links, poses.drawn, strict=True) for _ in pairs
        ),
        "joints": joints(file, poses.motion.tree, at, axes),
        "bodies": bodies(file, at),
        "springs": springs(file, at),
        "depths": depths(file, poses.links, poses.drawn),
    }


def _solids(file: CaseFile, model: Model, x: Floats) -> Iterator[DrawnSolid]:
    """The surfaces of meshed links at samples x (n, n_x), undeformed."""
    for link in (link for link in model.poses.links if link_type(file, link) == "solid"):
        mesh, _ = couplings(file.mechanism.links[link], f"mechanism.links.{link}")
        faces = [(part, f) for n, part in mesh.elements.items() for f in KINDS[n].faces]
        keys = [np.sort(np.pad(part[:, f], ((0, 0), (0, 4 - len(f))), constant_values=-1), axis=1)
                for part, f in faces]  # fmt: skip
        _, first, count = np.unique(
            np.concatenate(keys), axis=0, return_index=True, return_counts=True
        )
        every = np.concatenate([part[:, [*f, f[-1]][:4]] for part, f in faces])
        used, corners = np.unique(every[first[count == 1]], return_inverse=True)
        frame = [model.poses.motion.placement(link).at(X)[1] for X in (np.zeros(3), *np.eye(3))]
        origin, *ends = model.poses.values(x, frame)
        axes = np.stack(ends, axis=1) - origin[:, None]
        places = (origin[:, None] + mesh.x[used] @ axes)[..., : _dimension(file)]
        yield DrawnSolid(link, frozen(places), corners.reshape(-1, 4))


def _moved(solid: DrawnSolid, found: Sequence[ModeShapes], factors: Floats) -> DrawnSolid:
    """The surface where modes take it, about: each point goes with the nodes that are near."""
    places = solid.places.copy()
    for one, f, own, rest in zip(found, factors, places, solid.places, strict=True):
        nodes = [node for (link, _), node in one.nodes.items() if link == solid.link]
        arms = np.stack([rest - node.place for node in nodes])
        near = 1.0 / ((arms**2).sum(axis=2, keepdims=True) + 1e-12)
        v = np.stack([f @ node.motion for node in nodes])[:, None]
        own += (near / near.sum(axis=0) * (v[..., :3] + np.cross(v[..., 3:], arms))).sum(axis=0)
    return replace(solid, places=frozen(places))


def _named_nodes(file: CaseFile, model: Model) -> list[NodeName]:
    """The nodes that something is drawn at, each once."""
    poses = model.poses
    drawn = zip(poses.links, poses.drawn, strict=True)
    nodes = [(link, name) for link, pairs in drawn for pair in pairs for name in pair]

    def ask(node: NodeName) -> Floats:
        nodes.append(node)
        return np.zeros(0)

    axes = [np.zeros(0)] * len(edges(poses.motion.tree))
    _symbols(file, model, initial_design(file), ask, axes)
    return list(dict.fromkeys(nodes))


def _farthest_travelled(file: CaseFile, model: Model, x: Floats, seams: Sequence[int]) -> Floats:
    """The path (n, d) of the node that travels farthest, NaN at ``seams`` between trajectories."""
    nodes = [model.poses.world(*node) for node in _named_nodes(file, model)]
    paths = np.insert(np.stack(model.poses.values(x, nodes)), list(seams), np.nan, axis=1)
    way = np.nansum(np.linalg.norm(np.diff(paths, axis=1), axis=2), axis=1)
    farthest = int(np.argmax(way >= way.max() * (1.0 - 1e-9)))  # the first of those that coincide
    return frozen(paths[farthest, :, : _dimension(file)])


def _dimension(file: CaseFile) -> int:
    return 2 if file.mechanism.space == "planar" else 3


# --- Joints, bodies and springs, and the size of sections

At = Callable[[NodeName], Floats]  # places (n, d) of a node in n poses


def edges(tree: Topology) -> tuple[JointEdge, ...]:
    """The joints as the file has them, those that close loops last."""
    return tuple(edge.written for edge in (*tree.edges, *tree.loops))


def joint_axes(file: CaseFile, poses: LinkFrames) -> list[NDArray[np.object_]]:
    """The direction to draw each joint along, in world axes: where it slides, else its link."""
    found = []
    for edge in edges(poses.motion.tree):
        joint: Any = file.mechanism.joints[edge.joint]
        base, axis = edge.base, np.array([1.0, 0.0, 0.0])
        if joint.type not in SLIDING:
            base, axis = edge.follower, -axis if edge.follower[1] == "end" else axis
        elif joint.type not in RIDING:
            mount = mounting(poses.parameters.angles(f"joints.{edge.joint}", joint))
            axis = multiply(mount, sliding_axis(joint))
        if base != GROUND:
            axis = multiply(poses.motion.placement(base[0]).world_rotation, axis)
        found.append(np.asarray(axis))
    return found


def joints(
    file: CaseFile, tree: Topology, at: At, axes: Sequence[Floats]
) -> tuple[DrawnJoint, ...]:
    """The joints, each at its follower's node; ``axes`` are (n, d) each."""
    driven = {coordinate.joint for coordinate in file.coordinates.values()}
    found = []
    for edge, axis in zip(edges(tree), axes, strict=True):
        kind = file.mechanism.joints[edge.joint].type
        family = "sliding" if kind in SLIDING else "fixed" if kind == "fixed" else "turning"
        grounded = edge.base == GROUND
        places = at(edge.follower)
        found.append(DrawnJoint(edge.joint, family, grounded, edge.joint in driven, places, axis))
    return tuple(found)


def bodies(file: CaseFile, at: At) -> tuple[DrawnBody, ...]:
    """The bodies, and the rigid links without extent."""
    given = file.mechanism.bodies.items()
    found = [DrawnBody(name, body.mass, at(split(body.at))) for name, body in given]
    links: Mapping[str, Any] = file.mechanism.links
    for name, link in links.items():
        if link_type(file, name) != "rigid":
            continue
        places = [tuple(map(float, X)) for X in (link.nodes or {}).values()]
        if link.length is None and not any(map(any, places)):
            node = next(iter(link.nodes or {"start": None}))
            found.append(DrawnBody(name, link.mass, at((name, node))))
    return tuple(found)


def springs(file: CaseFile, at: At) -> tuple[DrawnSpring, ...]:
    """The springs between nodes and to the ground."""
    given: Mapping[str, Any] = getattr(file.mechanism, "springs", None) or {}
    found = []
    for name, spring in given.items():
        first, second = spring.between
        grounded = "ground" in (first, second)
        ends = [at(split(end)) for end in (first, second) if end != "ground"]
        found.append(DrawnSpring(name, grounded, not spring.translational, ends[0], ends[-1]))
    return tuple(found)


def depths(
    file: CaseFile, links: tuple[str, ...], drawn: tuple[tuple[tuple[str, str], ...], ...]
) -> tuple[tuple[float, float], ...]:
    """The depth of each line's section at its two ends, m; 0 without a section."""
    found: list[tuple[float, float]] = []
    for link, pairs in zip(links, drawn, strict=True):
        data: Any = file.mechanism.links[link]
        beams = data.beams.values() if link_type(file, link) == "frame" else [data] * len(pairs)
        for beam in beams:
            ends = (file.mechanism.sections[name] for name in section_names(beam))
            deep = [end.depth(_dimension(file) == 3) for end in ends] or [0.0]
            found.append((deep[0], deep[-1]))
    return tuple(found)


FRAMES, FEW_FRAMES = 41, 9  # poses of all trajectories; of each of several or of a large model
MOVING = 4  # trajectories that are shown
POINTS = 12  # of a line


def motions(
    file: CaseFile, model: Model, path: Trajectories, y: Floats, numbers: Mapping[str, Floats]
) -> Iterator[Motion]:
    """Yield modes of design y by name along each trajectory; ``numbers`` (n_t,) say which each is.

    Raises what `Model.shapes` raises.
    """
    shown = list(zip(path.parts, path.rows, strict=True))[:MOVING]
    each, q = FRAMES // len(shown) if model.pencil.is_dense else 0, path.at(y)[0]
    for part, rows in shown:
        few = spread_samples(q[rows][:, : len(file.coordinates)], max(each, FEW_FRAMES))
        chosen = rows.start + np.array(few)
        which = {name: numbers[name][chosen].astype(int) - 1 for name in numbers}
        count = 1 + int(max(modes.max() for modes in which.values()))
        found, x = model.shapes_along(q[chosen], y, count), model.x(q[chosen], y)
        rest = replace(
            displaced(file, model, x, found, np.zeros((len(x), count)), POINTS),
            time_s=path.time_s[chosen],
            tip_path=part.trajectory.tip,
        )
        yield Motion(part.name, rest, tuple(_modes(file, model, x, found, which)))


def _modes(
    file: CaseFile,
    model: Model,
    x: Floats,
    found: Sequence[ModeShapes],
    which: Mapping[str, Ints],
) -> Iterator[MovingMode]:
    for name, modes in which.items():
        hz = np.array([one.frequencies[m] for one, m in zip(found, modes, strict=True)])
        factors = np.zeros((len(found), found[0].frequencies.size))
        factors[np.arange(len(found)), modes] = _scales(found, modes)
        yield MovingMode(name, hz, displaced(file, model, x, found, factors, POINTS))


def _scales(found: Sequence[ModeShapes], modes: Ints) -> Floats:
    """The factor of each pose that makes the largest displacements alike, signs following on."""
    size = AMPLITUDE * max(extent_of(one) for one in found)
    each = list(zip(found, modes, strict=True))
    moved = [np.concatenate([s.motions[m].ravel() for s in one.strands]) for one, m in each]
    turned = [before @ now < 0.0 for before, now in pairwise(moved)]
    signs = np.cumprod([1.0, *np.where(turned, -1.0, 1.0)])
    return np.asarray(signs * size / [largest_of(one)[m] for one, m in each])
