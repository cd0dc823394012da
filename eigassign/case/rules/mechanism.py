"""Links, their materials and sections, joints between them, coordinates, and how loops close."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Any

from eigassign.case.reader import Finding, KeyPath, listed, shown, suggestion, unknown
from eigassign.case.rules.properties import freedoms, guessed, walk
from eigassign.case.schema.document import Document
from eigassign.case.schema.links import (
    BeamLink,
    FrameBeam,
    FrameLink,
    Link,
    RigidLink,
    SolidLink,
    Taper,
)
from eigassign.case.schema.mechanism import (
    RIDING,
    Coordinate,
    JointBase,
    Mechanism,
    NutJoint,
    RevoluteJoint,
)
from eigassign.files import how_to_raise, raised

MOST_ELEMENTS = 20_000  # `check` takes 10 to 30 s and 230 MB, in proportion

# --- What names stand for


def beams(mechanism: Mechanism) -> Iterator[tuple[KeyPath, BeamLink | FrameBeam]]:
    """Key path and content of every beam: links that are one, and those of frames."""
    for name, link in mechanism.links.items():
        path: KeyPath = ("mechanism", "links", name)
        if isinstance(link, BeamLink):
            yield path, link
        if isinstance(link, FrameLink):
            yield from (((*path, "beams", beam), own) for beam, own in link.beams.items())


def node_names(link: Link) -> list[str]:
    """Nodes of one link."""
    if isinstance(link, BeamLink):
        return ["start", "end"]
    if not isinstance(link, RigidLink):
        return list(link.nodes)
    implied = ["start"] if link.length is None else ["start", "end"]
    return list(dict.fromkeys([*implied, *link.nodes]))


def moving(mechanism: Mechanism) -> list[str]:
    """Names of the joints that are not fixed."""
    return [name for name in mechanism.joints if freedoms(mechanism, name)]


def reached(first: str, pairs: Collection[tuple[str, str]]) -> set[str]:
    """What pairs of names lead to from the ``first``."""
    beside: dict[str, set[str]] = {}
    for a, b in pairs:
        beside.setdefault(a, set()).add(b)
        beside.setdefault(b, set()).add(a)
    found, waiting = {first}, [first]
    while waiting:
        new = beside.get(waiting.pop(), set()) - found
        found |= new
        waiting += new
    return found


def node_problem(mechanism: Mechanism, value: str, also: str = "") -> str | None:
    """The mistake in ``value`` as `<link>.<node>`; ``also`` may stand there too."""
    link, _, node = value.partition(".")
    or_else = [also] if also else []
    if link not in mechanism.links:
        expected = f"{also}, " if also else ""
        return (
            f"{unknown('link', link, [*or_else, *mechanism.links])}; expected {expected}"
            "'<link>.start', '<link>.end' or another node"
        )
    nodes = node_names(mechanism.links[link])
    if node in nodes:
        return None
    few = [repr(f"{link}.{name}") for name in nodes]
    spelt = few if len(nodes) <= 6 else [f"'{link}.<node>' ({listed(nodes)})"]
    expected = " or ".join([*or_else, *spelt])
    near = suggestion(node, nodes).replace("mean '", f"mean '{link}.")
    return f"expected {expected}, got {shown(value)}{near}"


# --- Materials and sections


def names_mean_parts(document: Document) -> Iterator[Finding]:
    """The materials, sections and nodes that parts, paths and targets name exist."""
    mechanism = document.mechanism
    for path, name in walk(document):
        if not isinstance(name, str):
            continue
        problem = None
        match path:
            case ("mechanism", "links", *_, "material") if name not in mechanism.materials:
                problem = unknown("material", name, mechanism.materials)
            case ("mechanism", "links", *_, "section") | (
                "mechanism",
                "links",
                _,
                "section",
                "start" | "end",
            ) if name not in mechanism.sections:
                problem = unknown("section", name, mechanism.sections)
            case ("mechanism", "links", str(link), "beams", _, "from" | "to"):
                frame: Any = mechanism.links[link]
                problem = None if name in frame.nodes else unknown("node", name, frame.nodes)
            case ("mechanism", "springs", _, "between", _) if name != "ground":
                problem = node_problem(mechanism, name)
            case (
                ("mechanism", "bodies", _, "at")
                | ("trajectory", *_, "tip")
                | ("targets", _, *_, "at")
                | ("response", *_, "at")
            ):
                problem = node_problem(mechanism, name)
        if problem:
            yield path, problem


def materials_have_what_links_need(document: Document) -> Iterator[Finding]:
    """A shear modulus where beams twist or shear bends them; solids are made for one ν."""
    mechanism = document.mechanism
    spatial = mechanism.space == "spatial"
    sheared = {beam.material for _, beam in beams(mechanism) if spatial or beam.shear}
    solids = {link.material for link in mechanism.links.values() if isinstance(link, SolidLink)}
    for name, material in mechanism.materials.items():
        path = ("mechanism", "materials", name)
        if material.poissons_ratio is None and name in solids:
            instead = "" if material.shear_modulus is None else " instead of shear_modulus"
            yield path, f"a solid needs poissons_ratio{instead}"
        elif material.poissons_ratio is None is material.shear_modulus and name in sheared:
            what = "beams in space twist" if spatial else "a beam with shear: true uses it"
            yield path, f"needs poissons_ratio or shear_modulus: {what}"


def tapers_run_between_like_sections(document: Document) -> Iterator[Finding]:
    """Both sections of a taper are of one shape, given by the same keys."""
    known = document.mechanism.sections
    for path, beam in beams(document.mechanism):
        if isinstance(beam.section, Taper):
            a, b = beam.section.start, beam.section.end
            given = [known[name] for name in (a, b) if name in known]
            kinds = [(type(each), each.model_fields_set - {"shape"}) for each in given]
            if len(kinds) == 2 and kinds[0] != kinds[1]:
                message = "a taper runs between sections of one shape, given by the same keys: "
                yield (*path, "section"), f"{message}{a!r} and {b!r} are not"


# --- Links


def frames_hang_together(document: Document) -> Iterator[Finding]:
    """A frame's beams run between nodes in different places, and connect all of them."""
    for name, link in document.mechanism.links.items():
        if not isinstance(link, FrameLink):
            continue
        path: KeyPath = ("mechanism", "links", name)
        nodes, pairs = link.nodes, [(b.from_node, b.to_node) for b in link.beams.values()]
        if "start" not in nodes:
            yield (*path, "nodes"), "a frame needs a node 'start'"
        for key, (a, b) in zip(link.beams, pairs, strict=True):
            if a in nodes and nodes[a] == nodes.get(b):
                yield (*path, "beams", key), f"has no length: {a!r} and {b!r} are the same place"
        together = reached("start", pairs)
        loose = [node for node in nodes if node not in together]
        if "start" in nodes and loose and {end for pair in pairs for end in pair} <= {*nodes}:
            message = f"no beams connect {listed(loose)} with 'start'"
            yield (*path, "nodes", loose[0]), message


def beams_have_no_more_elements_than_can_be_meant(document: Document) -> Iterator[Finding]:
    """The beams together have MOST_ELEMENTS at most."""
    given = [
        (beam.elements, path)
        for path, beam in beams(document.mechanism)
        if isinstance(beam.elements, int)
    ]
    total = sum(n for n, _ in given)
    if total > raised(MOST_ELEMENTS):
        _, path = max(given, key=lambda each: each[0])
        yield (
            (*path, "elements"),
            f"the mechanism has {total} elements: more than {raised(MOST_ELEMENTS):g} take "
            f"minutes and hundreds of MB; {how_to_raise(total, MOST_ELEMENTS)}",
        )


_JOINTS = ("mechanism", "joints")

# --- Joints connect links to the ground


def riders_have_a_beam_of_their_own(document: Document) -> Iterator[Finding]:
    """One carriage or nut travels along a beam, a nut on its axis, and the beam is not reduced."""
    riders: dict[str, str] = {}
    for name, joint in document.mechanism.joints.items():
        base = document.mechanism.links.get(joint.base)
        if joint.type not in RIDING or not isinstance(base, BeamLink):
            continue
        if base.reduce_to is not None:
            message = f"{name!r} travels along this link, so that it cannot be reduced: "
            path = ("mechanism", "links", joint.base, "reduce_to")
            yield path, message + "leave reduce_to out"
        if joint.base in riders:
            message = (
                f"{riders[joint.base]!r} travels along {joint.base!r} already, and a beam carries "
                "one carriage or nut: make it two beams, with a fixed joint between them"
            )
            yield (*_JOINTS, name, "base"), message
        riders.setdefault(joint.base, name)
        if isinstance(joint, NutJoint) and any((joint.position or ())[1:]):
            message = (
                "a nut stands on the axis of its shaft, so that only the first component of its "
                "position may differ from zero: place what it carries by the nodes of its follower"
            )
            yield (*_JOINTS, name, "position"), message


def joints_connect_two_links(document: Document) -> Iterator[Finding]:
    """A joint's base and follower are nodes of two links; the base may be the ground, or a beam."""
    for name, joint in document.mechanism.joints.items():
        path = (*_JOINTS, name)
        if problem := _base_problem(document.mechanism, joint):
            yield (*path, "base"), problem
        link = joint.follower.partition(".")[0]
        if link == "ground":
            yield (*path, "follower"), "ground cannot follow: make it the base"
        elif problem := node_problem(document.mechanism, joint.follower):
            yield (*path, "follower"), problem
        elif joint.base.partition(".")[0] == link:
            yield path, "base and follower are the same link: a joint connects two"


def _base_problem(mechanism: Mechanism, joint: JointBase) -> str | None:
    base = joint.base
    if joint.type not in RIDING:
        return None if base == "ground" else node_problem(mechanism, base, "ground")
    beams = [name for name, link in mechanism.links.items() if isinstance(link, BeamLink)]
    if base in beams:
        return None
    hint = suggestion(base.partition(".")[0], beams)
    if not beams:
        return f"rides along a link of type beam, and there is none; got {shown(base)}"
    return f"rides along a beam: expected one of {listed(beams)}, got {shown(base)}{hint}"


def _pairs(mechanism: Mechanism) -> list[tuple[str, str]]:
    """The links, or ground and link, that each joint joins; none if some join no two that exist."""
    known = {*mechanism.links}
    pairs = [
        (joint.base.partition(".")[0], joint.follower.partition(".")[0])
        for joint in mechanism.joints.values()
    ]
    good = all(a in {*known, "ground"} and b in known and a != b for a, b in pairs)
    return pairs if good else []


def _is_open(mechanism: Mechanism) -> bool:
    """True where every joint hangs another link on the ground: no loop is closed."""
    pairs = _pairs(mechanism)
    return len(pairs) == len(mechanism.links) < len(reached("ground", pairs))


def links_are_connected_to_the_ground(document: Document) -> Iterator[Finding]:
    """Joints lead from the ground to every link; what hangs together apart is reported once."""
    mechanism = document.mechanism
    pairs = _pairs(mechanism)
    placed = reached("ground", pairs)
    for link in mechanism.links if pairs or not mechanism.joints else ():
        if link in placed:
            continue
        group = reached(link, pairs)
        placed |= group
        joints = [j for j, pair in zip(mechanism.joints, pairs, strict=True) if group & {*pair}]
        if joints:
            message = f"{listed(joints)} join {listed([n for n in mechanism.links if n in group])}"
            yield (*_JOINTS, joints[0]), f"{message}, but no joint connects these to the ground"
        else:
            message = f"no joint holds this link: add one with follower: {link}.<node>"
            yield ("mechanism", "links", link), message


# --- Coordinates move joints


def coordinates_move_one_freedom_each(document: Document) -> Iterator[Finding]:
    """Each coordinate names a freedom that exists and that no other moves; in an open mechanism
    every freedom has one, since nothing else determines it."""
    mechanism = document.mechanism
    owner: dict[tuple[str, str], str] = {}  # coordinate by joint and freedom
    complete = _is_open(mechanism)
    for name, body in document.coordinates.items():
        path: KeyPath = ("coordinates", name)
        known = freedoms(mechanism, body.joint)
        if problem := _problem(mechanism, known, body, path):
            yield problem
            complete = complete and body.joint in mechanism.joints and not known
            continue
        freedom = str(body.component or known[0])
        if (body.joint, freedom) in owner:
            of = f"{freedom} of " if len(known) > 1 else ""
            message = f"{of}joint {body.joint!r} has a coordinate already: "
            yield (*path, "joint"), f"{message}{owner[body.joint, freedom]!r}"
        owner.setdefault((body.joint, freedom), name)
        if body.angle == "absolute" and not isinstance(mechanism.joints[body.joint], RevoluteJoint):
            yield (*path, "angle"), "only the angle of a revolute joint can be absolute"
    for joint in moving(mechanism) if complete else ():
        known = freedoms(mechanism, joint)
        if missing := [freedom for freedom in known if (joint, freedom) not in owner]:
            which = f", component: {missing[0]}" if len(known) > 1 else ""
            first = f"q{len(document.coordinates) + 1}"
            message = f"no coordinate: add one under coordinates, e.g. {first}: "
            yield (*_JOINTS, joint), message + f"{{joint: {joint}{which}}}"


def _problem(
    mechanism: Mechanism, known: tuple[str, ...], body: Coordinate, path: KeyPath
) -> Finding | None:
    """The mistake in the joint, or in the component of it, if there is one."""
    joint, component = body.joint, body.component
    if joint not in mechanism.joints:
        return (*path, "joint"), unknown("joint", joint, mechanism.joints)
    if not known:
        message = f"joint {joint!r} is fixed and has no coordinate; joints that move: "
        return (*path, "joint"), message + listed(moving(mechanism))
    message = f"joint {joint!r} is {mechanism.joints[joint].type}: "
    if component is None and len(known) > 1:
        message += "say which of its freedoms this is, component: "
        return path, message + " or ".join(known)
    if component is not None and str(component) not in known:
        message += f"expected {' or '.join(known)}, got {shown(component)}"
        return (*path, "component"), message
    return None


def assembly_closes_loops(document: Document) -> Iterator[Finding]:
    """`at` names coordinates, `guess` joints that move, with a number for each freedom."""
    mechanism, path = document.mechanism, ("mechanism", "assembly")
    assembly = mechanism.assembly
    if assembly is None:
        return
    if _is_open(mechanism):
        yield path, "no joint closes a loop: there is nothing to choose"
    for name in assembly.at:
        if name not in document.coordinates:
            yield (*path, "at", name), unknown("coordinate", name, document.coordinates)
    for joint, value in assembly.guess.items():
        known, count = freedoms(mechanism, joint), len(value) if isinstance(value, tuple) else 1
        message = ""
        if joint not in mechanism.joints:
            message = unknown("joint", joint, mechanism.joints)
        elif not known:
            message = f"joint {joint!r} is fixed: there is nothing to guess"
        elif len(known) > 1 and not guessed(document, joint, count):
            message = f"needs a list of {len(known)}: {listed(known)}; or of those without a "
            message += "coordinate"
        elif len(known) == 1 and isinstance(value, tuple):
            message = f"joint {joint!r} has one freedom: expected a number, got a list"
        if message:
            yield (*path, "guess", joint), message
