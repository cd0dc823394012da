"""A robot from a URDF file as the content of a case: a tree of links with elastic drives.

Frames are taken over as they are: a link's frame is at the joint to its parent, turned by roll,
pitch and yaw, R = Rz Ry Rx, and the axis of a joint is in the frame of its child. A link is rigid,
with the mass, centre and inertia of its ``inertial``, or a beam to the next joint: the user says.
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import StorageError, UsageError
from eigassign.files import CASE, read_bytes

Floats = NDArray[np.float64]
Number = float | str
_MOVING = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic"}
_LEVEL = 1e-9  # m: a joint this near to another one is at its place


@dataclass(frozen=True)
class _Frame:
    """A link's frame where it differs from the URDF's: a beam runs along its own x axis."""

    turn: Floats  # (3, 3), from the case's axes of the link to those of the URDF
    end: str | None = None  # the joint at the end of the beam


def urdf_mapping(
    path: str | Path,
    stiffness: Number | Mapping[str, Number | None],
    beams: Mapping[str, Mapping[str, Any]] | None = None,
    sections: Mapping[str, Any] | None = None,
    materials: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """The keys ``title``, ``mechanism`` and ``coordinates`` of a case, for `load_case`.

    ``stiffness`` of the drives of all joints, or by joint (None: free), in N m/rad, N/m where they
    slide, or text with a unit; a parameter is ``coordinates.<joint>.drive.stiffness``. ``beams``
    has of every link that is one its ``material``, ``section`` and ``elements``, named in
    ``materials`` and ``sections`` as in a case; it runs to the one joint that it carries, and its
    section gives its mass in place of the URDF's. Everything else is rigid; the root of the tree
    stands on the ground. Raises UsageError for what is no such robot, and without yourdfpy (the
    extra ``urdf``), StorageError for a file that cannot be read.
    """
    robot, beams = _parsed(Path(path)), dict(beams or {})
    links, joints = {link.name: link for link in robot.links}, robot.joints
    _require_tree(links, joints, path)
    if unknown := sorted(set(beams) - set(links)):
        raise UsageError(f"{path}: no link {', '.join(unknown)}; there are {', '.join(links)}")
    names = _identifiers([*links, *(joint.name for joint in joints)], path)
    carried = {name: [j for j in joints if j.parent == name] for name in links}
    frames = {n: _beam_frame(n, carried[n], path) if n in beams else _RIGID for n in links}
    (root,) = set(links) - {joint.child for joint in joints}
    written: dict[str, Any] = {
        names[name]: {
            "type": "beam",
            "length": float(np.linalg.norm(_place(carried[name][0]))),
            **beams[name],
        }
        if name in beams
        else _rigid(link, carried[name], names, path)
        for name, link in links.items()
    }
    mounting: dict[str, Any] = {"type": "fixed", "base": "ground"}
    mounting |= {"follower": f"{names[root]}.start", "position": [0.0, 0.0, 0.0]}
    mounting["orientation"] = _angles(frames[root].turn)
    ways = {names[j.name]: _joint(j, frames, names) for j in joints}
    moving = {names[j.name]: _drive(j, stiffness, path) for j in joints if j.type in _MOVING}
    named = {"sections": dict(sections or {}), "materials": dict(materials or {})}
    return {
        "title": str(robot.name or Path(path).stem),
        "mechanism": {
            "space": "spatial",
            **{key: value for key, value in named.items() if value},
            "links": written,
            "joints": {"ground": mounting, **ways},
        },
        "coordinates": {name: {"joint": name, "drive": drive} for name, drive in moving.items()},
    }


_RIGID = _Frame(np.eye(3))


def _parsed(path: Path) -> Any:
    """The robot of a file without its meshes; raises UsageError, StorageError."""
    try:
        from yourdfpy import URDF
    except ImportError:
        raise UsageError("URDF needs the package yourdfpy: pip install 'eigassign[urdf]'") from None
    try:
        data = read_bytes(path, CASE)
    except (OSError, ValueError) as error:
        raise StorageError(f"{path}: cannot be read: {error}") from error
    if re.search(rb"<!(DOCTYPE|ENTITY)", data):
        raise UsageError(f"{path}: a URDF file has no document type and no entities")
    meshless = {"build_scene_graph": False, "load_meshes": False}
    try:
        ElementTree.fromstring(data)  # the parser would read what it can of a damaged file
        return URDF.load(io.BytesIO(data), **meshless).robot
    except Exception as error:  # the parser has no errors of its own
        raise UsageError(f"{path}: not a URDF file: {error}") from error


def _require_tree(links: Mapping[str, Any], joints: list[Any], path: str | Path) -> None:
    """Raises UsageError for what is not one tree of joints that a case can have."""
    children = [joint.child for joint in joints]
    missing = {n for j in joints for n in (j.parent, j.child)} - set(links)
    if missing or len(set(children)) != len(children) or len(children) != len(links) - 1:
        raise UsageError(f"{path}: the joints do not connect all links to one tree")
    for joint in joints:
        if joint.type not in (*_MOVING, "fixed"):
            raise UsageError(f"{path}: joint {joint.name}: type {joint.type} is not supported")
        if joint.mimic is not None:
            raise UsageError(f"{path}: joint {joint.name}: mimic is not supported")


def _identifiers(names: list[str], path: str | Path) -> dict[str, str]:
    """Names without what key paths cannot hold; `ground` is taken."""
    found = {name: re.sub(r"\W", "_", name) for name in names}
    if len(set(found.values())) != len(found) or "ground" in found.values():
        raise UsageError(f"{path}: two names of links or joints are alike, or one is ground")
    return found


def _beam_frame(name: str, carried: list[Any], path: str | Path) -> _Frame:
    """Its x axis points at the one joint that the link carries; raises UsageError."""
    if len(carried) != 1 or np.linalg.norm(_place(carried[0])) < _LEVEL:
        raise UsageError(
            f"{path}: link {name} cannot be a beam: it has to carry one joint away from its own"
        )
    x = _place(carried[0]) / np.linalg.norm(_place(carried[0]))
    other = np.eye(3)[int(np.argmin(np.abs(x)))]
    z = np.cross(x, other) / np.linalg.norm(np.cross(x, other))
    return _Frame(np.column_stack([x, np.cross(z, x), z]), carried[0].name)


def _rigid(
    link: Any, carried: list[Any], names: Mapping[str, str], path: str | Path
) -> dict[str, Any]:
    """A rigid link with a node for every joint that it carries."""
    nodes = {names[joint.name]: _place(joint).tolist() for joint in carried}
    found: dict[str, Any] = {"type": "rigid", "nodes": {"start": [0.0, 0.0, 0.0], **nodes}}
    if link.inertial is None:
        return found
    if link.inertial.mass is None or link.inertial.inertia is None:
        raise UsageError(f"{path}: link {link.name}: inertial needs mass and inertia")
    origin = _origin(link.inertial)
    I = origin[:3, :3] @ link.inertial.inertia @ origin[:3, :3].T  # noqa: E741
    tensor = [I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]]
    found["mass"] = float(link.inertial.mass)
    found["center"] = origin[:3, 3].tolist()
    return {**found, "inertia": [float(value) for value in tensor]}


def _joint(joint: Any, frames: Mapping[str, _Frame], names: Mapping[str, str]) -> dict[str, Any]:
    """A joint between the frames that the case gives both links."""
    base, follower = frames[joint.parent], frames[joint.child]
    node = "end" if base.end is not None else names[joint.name]
    turn = base.turn.T @ _origin(joint)[:3, :3] @ follower.turn
    found = {
        "type": _MOVING.get(joint.type, "fixed"),
        "base": f"{names[joint.parent]}.{node}",
        "follower": f"{names[joint.child]}.start",
        "orientation": _angles(turn),
    }
    if joint.type in _MOVING:
        axis = np.array([1.0, 0.0, 0.0] if joint.axis is None else joint.axis, dtype=float)
        found["axis"] = (follower.turn.T @ axis).tolist()
    return found


def _drive(joint: Any, stiffness: Number | Mapping[str, Number | None], path: str | Path) -> Any:
    if not isinstance(stiffness, Mapping):
        return {"stiffness": stiffness}
    if joint.name not in stiffness:
        raise UsageError(f"{path}: no stiffness is given for joint {joint.name}")
    given = stiffness[joint.name]
    return "free" if given is None else {"stiffness": given}


def _origin(part: Any) -> Floats:
    return np.eye(4) if part.origin is None else np.asarray(part.origin, dtype=np.float64)


def _place(joint: Any) -> Floats:
    return _origin(joint)[:3, 3]


def _angles(turn: Floats) -> list[float]:
    """[rx, ry, rz] in rad of Rz Ry Rx."""
    from scipy.spatial.transform import Rotation

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of upright axes, whose angles are not unique
        return [float(a) for a in Rotation.from_matrix(turn).as_euler("xyz")]
