"""A robot from a URDF file as the content of a case: a tree of links with elastic drives.

Frames are taken over as they are: a link's frame is at the joint to its parent, turned by roll,
pitch and yaw, R = Rz Ry Rx, and the axis of a joint is in the frame of its child. Links are rigid,
with the mass, centre and inertia of their ``inertial``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from eigassign.arrays import Floats
from eigassign.brief import LONGEST
from eigassign.case.case_file import parse, to_yaml
from eigassign.case.reader import listed, short
from eigassign.case.rules.mechanism import reached
from eigassign.errors import CaseError, StorageError, UsageError
from eigassign.files import CASE, printable, read_bytes

Number = float | str
Inertial = tuple[float, Floats, Floats]  # mass, its centre, inertia about it, in the link's axes
_MOVING = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic"}
_TAKEN = {"ground", "start", "end"}
_NOTHING = 1e-15  # kg m²: zeros of icub.urdf have products of up to 4e-18, which turns no body
_ROUNDED = 1e-30  # of any number: what programs leave of zeros
_LEVEL = 1e-9  # m: a joint this near to another one is at its place


def urdf_mapping(
    path: str | Path, stiffness: Number | Mapping[str, Number | None]
) -> dict[str, Any]:
    """The keys ``title``, ``mechanism`` and ``coordinates`` of a case, for `load_case`.

    ``stiffness`` of the drives of all joints, or by joint (None: free), in N m/rad, N/m where they
    slide, or text with a unit; a parameter is ``coordinates.<joint>.drive.stiffness``. Links are
    rigid; the root of the tree stands on the ground; joints that mimic are locked. Raises
    UsageError for what is no such robot, StorageError for a file that cannot be read.
    """
    title, links, joints, _ = _parsed(Path(path))
    names = _identifiers(links, path)
    own = _identifiers([joint.name for joint in joints], path)
    written: dict[str, Any] = {}
    for name, inertial in links.items():
        nodes = {own[joint.name]: joint.place.tolist() for joint in joints if joint.parent == name}
        written[names[name]] = {"type": "rigid", "nodes": {"start": [0.0, 0.0, 0.0], **nodes}}
        if inertial is not None:
            mass, center, I = inertial  # noqa: E741
            tensor = [I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]]
            written[names[name]] |= {"mass": mass, "center": center.tolist()}
            written[names[name]]["inertia"] = [float(value) for value in tensor]
    (root,) = set(links) - {joint.child for joint in joints}
    ways: dict[str, Any] = {"ground": {"type": "fixed", "base": "ground"}}
    ways["ground"] |= {"follower": f"{names[root]}.start", "position": [0.0, 0.0, 0.0]}
    drives: dict[str, Any] = {}
    for joint in joints:
        ways[own[joint.name]] = {
            "type": _MOVING.get(joint.type, "fixed"),
            "base": f"{names[joint.parent]}.{own[joint.name]}",
            "follower": f"{names[joint.child]}.start",
            **({"orientation": joint.turn.tolist()} if joint.turn.any() else {}),
            **({"axis": joint.axis.tolist()} if joint.type in _MOVING else {}),
        }
        if joint.type in _MOVING:
            by_joint = stiffness if isinstance(stiffness, Mapping) else {joint.name: stiffness}
            if joint.mimic is not None:
                drives[own[joint.name]] = "locked"
                continue
            if joint.name not in by_joint:
                raise UsageError(f"{path}: no stiffness is given for joint {joint.name}")
            given = by_joint[joint.name]
            drives[own[joint.name]] = "free" if given is None else {"stiffness": given}
    return {
        "title": title,
        "mechanism": {"space": "spatial", "links": written, "joints": ways},
        "coordinates": {name: {"joint": name, "drive": drive} for name, drive in drives.items()},
    }


STANDING = {"revolute": "20 kN m/rad", "continuous": "20 kN m/rad", "prismatic": "20 MN/m"}
OUTLOOK = """
# A link that gives is a beam or a solid part in place of `type: rigid`: "eigassign docs own-arm",
# "eigassign docs solid-part". What may change, and what is wanted:
# design:
#   gear: {{parameter: coordinates.{joint}.drive.stiffness, min: {low}, max: {high}}}
# targets:
#   - {{mode: 1, at_least: 10 Hz}}
"""


def urdf_case(path: Path) -> tuple[str, list[str]]:
    """The text of a case file for the robot, and what is to be filled in, which heads the text.

    What URDF does not know has a value that stands for it: flexibility of links that carry a joint
    away from their own, stiffnesses of drives, the trajectory. A joint that moves no mass is
    locked. Raises as `urdf_mapping`, and UsageError for what would be no case.
    """
    _, links, joints, lines = _parsed(path)
    moving = {joint.name: joint for joint in joints if joint.type in _MOVING}
    content = urdf_mapping(path, {key: STANDING[joint.type] for key, joint in moving.items()})
    if not moving:
        raise UsageError(f"{path}: no joint moves: a robot of fixed joints has no coordinate")
    long = {joint.parent for joint in joints if np.linalg.norm(joint.place) > _LEVEL}
    asked = [f"flexibility of link {link}: rigid stands there" for link in links if link in long]
    heavy = _with_mass(links, joints)
    steps = dict[str, Floats]()
    for joint, coordinate in zip(moving.values(), content["coordinates"].values(), strict=True):
        steps[joint.name] = np.zeros(2)
        if joint.mimic is not None:
            one, k, more = joint.mimic
            tied = f"{k:g} × {one}" + (f" {'+' if more > 0 else '−'} {abs(more):g}" if more else "")
            asked.append(f"drive of {joint.name}, which follows as {tied}: locked there")
        elif joint.child not in heavy:
            coordinate["drive"] = "locked"
            asked.append(f"drive of {joint.name}: nothing beyond it has mass in the URDF; locked")
        else:
            drive = f"stiffness of the drive of {joint.name}"
            asked.append(f"{drive}: {STANDING[joint.type]} stands there")
            lower, upper = joint.limits
            start = float(np.clip(0.0, lower, upper))
            step = 0.1 if joint.type == "prismatic" else 0.5
            room = max(upper - start, lower - start, key=abs)
            steps[joint.name] = start + np.array([0.0, np.clip(0.25 * room, -step, step)])
    following = [joint for joint in moving.values() if joint.mimic is not None]
    for _ in following:  # each of a chain of them is right one turn after the one before it
        for joint in following:
            one, k, more = joint.mimic or ("", 0.0, 0.0)
            steps[joint.name] = k * steps.get(one, np.zeros(2)) + more
    if not heavy.intersection(joint.child for joint in moving.values()):
        without = listed(name for name, inertial in links.items() if inertial is None)
        raise UsageError(f"{path}: no joint moves a mass: give links <inertial>, as {without}")
    asked.append("trajectory: poses between which the joints move; small steps stand there")
    points = np.round(np.transpose([*steps.values()]), 6).tolist()
    content["trajectory"] = {"points": points, "duration": "2 s"}
    first = f"From {path.name}: masses, places and axes. To be filled in, as URDF has none:"
    head = "\n".join(f"# {printable(each)}" for each in (first, *(f"- {one}" for one in asked)))
    coordinate, joint = next(iter(content["coordinates"])), next(iter(moving.values()))
    unit = STANDING[joint.type].partition(" ")[2]
    outlook = OUTLOOK.format(joint=coordinate, low=f"5 {unit}", high=f"50 {unit}")
    text = f"{head}\n{to_yaml(content)}\n{outlook}"
    try:
        parse(text.encode(), path.with_suffix(".yaml"))
    except CaseError as error:
        names = {own: name for name, own in _identifiers(links, path).items()}
        told = []
        for problem in error.problems:
            _, _, own, *key = [*problem.path.split("."), "", "", ""]
            name = f"link {names.get(own)}"
            at = f"{name} (line {lines.get(name)}), {'.'.join(filter(None, key))}"
            where = at if name in lines else problem.path
            told.append(f"{where}: {problem.message}")
        raise UsageError(f"{path}: gives no case: {'; '.join(told)}") from error
    return text, asked


def _with_mass(links: Mapping[str, Inertial | None], joints: Sequence[_Joint]) -> set[str]:
    """The links that have mass or inertia, or carry one that has."""
    over = {joint.child: joint.parent for joint in joints}
    found = set[str]()
    for name, inertial in links.items():
        own = inertial is not None and (inertial[0] != 0.0 or inertial[2].any())
        while own and name not in found:
            found.add(name)
            name = over.get(name, name)
    return found


class _Joint(NamedTuple):
    name: str
    type: str
    parent: str
    child: str
    place: Floats  # (3,)
    turn: Floats  # (3,): roll, pitch and yaw
    axis: Floats  # (3,)
    limits: Floats  # lower and upper, infinite where there is none
    mimic: tuple[str, float, float] | None  # k × that joint + so much more


class _Tree(ElementTree.TreeBuilder):
    """Elements as they stand; a document type, which may have entities, is refused."""

    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        """Raises ValueError."""
        raise ValueError("a URDF file has no document type and no entities")


def _parsed(
    path: Path,
) -> tuple[str, dict[str, Inertial | None], list[_Joint], dict[str, int]]:
    """Name, links, joints, lines of links; raises UsageError with all problems, StorageError."""
    try:
        data = read_bytes(path, CASE)
    except (FileNotFoundError, NotADirectoryError):
        raise UsageError(f"{path}: no such URDF file") from None
    except (OSError, ValueError) as error:
        raise StorageError(f"{path}: cannot be read: {error}") from error
    parser = ElementTree.XMLParser(target=_Tree())
    expand = f"xacro is a language that writes URDF: xacro {path} > robot.urdf expands it"
    try:
        parser.feed(data.lstrip())
        robot = parser.close()
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        hint = f"; {expand}" if b"xacro:" in data else ""
        raise UsageError(f"{path}: not a URDF file: {error}{hint}") from error
    if any("xacro}" in e.tag or "${" in str(e.attrib) for e in robot.iter()):
        raise UsageError(f"{path}: not a URDF file: {expand}")
    try:
        if robot.tag != "robot":
            raise ValueError(f"not a URDF file: it begins with <{short(robot.tag)}>, not <robot>")
        wrong, lines = list[str](), _lines(data)
        links = [*_each(robot.findall("link"), _link, wrong, lines)]
        joints = [*_each(robot.findall("joint"), _read_joint, wrong, lines)]
        if wrong:
            raise ValueError("; ".join(wrong))
        if not links:
            raise ValueError("has no link")
        _require_tree(dict(links), joints, len(links))
    except ValueError as error:
        raise UsageError(f"{path}: {printable(str(error))}") from error
    return short(printable(robot.get("name") or path.stem)), dict(links), joints, lines


def _each(
    elements: Sequence[ElementTree.Element],
    read: Callable[[ElementTree.Element], Any],
    wrong: list[str],
    lines: Mapping[str, int],
) -> Iterator[Any]:
    """What is read of each; what is wrong with others goes to ``wrong``, with its line."""
    for element in elements:
        try:
            yield read(element)
        except ValueError as error:
            name, words = f"{element.tag} {element.get('name')}", short(str(error), LONGEST)
            words = words if name in words else f"{name}: {words}"
            wrong.append(f"line {lines[name]}: {words}" if name in lines else words)


def _lines(data: bytes) -> dict[str, int]:
    """The line of each ``link NAME`` and ``joint NAME``."""
    text = data.decode("utf-8", "replace")
    named = re.finditer(r"<(link|joint)\b[^>]*?\bname\s*=\s*([\"'])(.*?)\2", text)
    return {f"{m.group(1)} {m.group(3)}": text.count("\n", 0, m.start()) + 1 for m in named}


def _text(element: ElementTree.Element, *keys: str) -> str:
    """The attribute that the last key names, of the child that the first names if there are two."""
    found = element.find(keys[0]) if keys[1:] else element
    if found is None or not found.get(keys[-1]):
        what = " ".join(filter(None, (element.tag, element.get("name"))))
        raise ValueError(f"not a URDF file: {what} has no {keys[0]}")
    return str(found.get(keys[-1]))


def _numbers(element: ElementTree.Element | None, key: str, default: Sequence[float]) -> Floats:
    """The numbers of an attribute, as many as there are in ``default``; raises ValueError."""
    given = None if element is None else element.get(key)
    try:
        found = np.array(default if given is None else [float(word) for word in given.split()])
    except ValueError:
        found = np.zeros(0)
    unfit = len(found) != len(default) or np.isnan(found).any()
    if unfit or (np.isinf(found) & np.isfinite(default)).any():  # limits alone may be infinite
        many = "a number" if len(default) == 1 else f"{len(default)} numbers"
        raise ValueError(f'<{element.tag} {key}="{given}">: expected {many}')  # type: ignore[union-attr]
    return np.where(np.abs(found) < _ROUNDED, 0.0, found)


def _origin(element: ElementTree.Element) -> tuple[Floats, Floats]:
    """Its place (3,), and roll, pitch and yaw (3,)."""
    origin = element.find("origin")
    return _numbers(origin, "xyz", [0.0] * 3), _numbers(origin, "rpy", [0.0] * 3)


def _link(element: ElementTree.Element) -> tuple[str, Inertial | None]:
    name, inertial = _text(element, "name"), element.find("inertial")
    if inertial is None:
        return name, None
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    if mass is None or inertia is None:
        raise ValueError(f"link {name}: inertial needs mass and inertia")
    xx, xy, xz, yy, yz, zz = (
        float(_numbers(inertia, f"i{key}", [0.0])[0])
        for key in ("xx", "xy", "xz", "yy", "yz", "zz")
    )
    own = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    own *= np.abs(own).max() > _NOTHING
    center, turn = _origin(inertial)
    R = Rotation.from_euler("xyz", turn).as_matrix()
    return name, (float(_numbers(mass, "value", [0.0])[0]), center, R @ own @ R.T)


def _read_joint(element: ElementTree.Element) -> _Joint:
    name, kind = _text(element, "name"), _text(element, "type")
    if kind not in (*_MOVING, "fixed"):
        raise ValueError(
            f'joint {name}: type {kind} is not supported; type="fixed" if it does not move, else '
            "a chain of revolute and prismatic joints"
        )
    mimic, tied = element.find("mimic"), None
    if mimic is not None and kind != "fixed":
        k, more = (_numbers(mimic, w, [d])[0] for w, d in (("multiplier", 1.0), ("offset", 0.0)))
        tied = (_text(element, "mimic", "joint"), float(k), float(more))
    axis = _numbers(element.find("axis"), "xyz", [1.0, 0.0, 0.0])
    if kind != "fixed" and not axis.any():
        raise ValueError(f"joint {name}: its axis has no direction")
    limit = element.find("limit") if kind != "continuous" else None
    lower, upper = (
        _numbers(limit, key, [far])[0] for key, far in (("lower", -np.inf), ("upper", np.inf))
    )
    if not lower < upper:  # as it is written where there are no limits: 0 and 0
        lower, upper = -np.inf, np.inf
    parent, child = (_text(element, key, "link") for key in ("parent", "child"))
    return _Joint(
        name, kind, parent, child, *_origin(element), axis, np.array([lower, upper]), tied
    )


def _require_tree(links: Collection[str], joints: Sequence[_Joint], count: int) -> None:
    """Raises ValueError for what is not one tree of joints that a case can have."""
    if len(links) != count or len({joint.name for joint in joints}) != len(joints):
        raise ValueError("two links or two joints have one name")
    children = [joint.child for joint in joints]
    missing = {n for j in joints for n in (j.parent, j.child)} - set(links)
    _require_masters(joints)
    once = len(set(children)) == len(children) == len(links) - 1
    pairs = [(joint.parent, joint.child) for joint in joints]
    if missing or not once or len(reached(next(iter(links)), pairs)) != count:
        loose = [n for n in links if n not in children][1:] or sorted(missing)
        which = f": see {', '.join(loose)}" if loose else ""
        raise ValueError(f"the joints do not connect all links to one tree{which}")


def _require_masters(joints: Sequence[_Joint]) -> None:
    """Raises ValueError for joints that mimic none, or each other."""
    over, names = {j.name: j.mimic[0] for j in joints if j.mimic}, {j.name for j in joints}
    wrong = [
        f"{name} mimics {at}, which is no joint" for name, at in over.items() if at not in names
    ]
    for name, at in over.items():
        for _ in over:
            at = over.get(at, "")
        wrong += [f"{name} mimics itself, by {over[name]}"] if at in over else []
    if wrong:
        raise ValueError("; ".join(f"joint {each}" for each in wrong))


def _identifiers(names: Iterable[str], path: str | Path) -> dict[str, str]:
    """Names without what key paths cannot hold; those of nodes and of the ground are taken."""
    found = {name: re.sub(r"^(?=\d)", "_", re.sub(r"\W", "_", name)) for name in names}
    own = [*found.values(), *_TAKEN]
    if twice := [name for name, each in found.items() if own.count(each) > 1]:
        raise UsageError(
            f"{path}: two names of links or joints are alike, or one is ground, start or end: "
            f"rename {listed(twice)}"
        )
    return found
