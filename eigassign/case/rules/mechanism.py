"""Links, their materials and sections, joints between them, coordinates, and how loops close."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from eigassign.case.reader import Finding, KeyPath, listed, shown, suggestion, unknown
from eigassign.case.rules.lookups import beams, freedoms, guessed, moving, node_problem
from eigassign.case.schema.document import Document
from eigassign.case.schema.links import (
    BareSection,
    BeamLink,
    FrameLink,
    RigidLink,
    SectionBase,
    SolidLink,
    SuperelementLink,
)
from eigassign.case.schema.mechanism import (
    Coordinate,
    JointBase,
    Mechanism,
    NutJoint,
    RevoluteJoint,
)
from eigassign.case.schema.trajectory import TipTrajectory, named_trajectories
from eigassign.files import how_to_raise, raised

MOST_ELEMENTS = 20_000  # `check` takes 10 to 30 s and 230 MB, in proportion

# --- Materials and sections


def links_have_known_materials(document: Document) -> Iterator[Finding]:
    """The material of every beam and solid exists, and has what these need of it."""
    mechanism = document.mechanism
    known, spatial = mechanism.materials, mechanism.space == "spatial"
    needs: dict[str, str] = {}
    for path, beam in beams(mechanism):
        if beam.material not in known:
            yield (*path, "material"), unknown("material", beam.material, known)
        elif spatial or beam.shear:
            needs[beam.material] = (
                "beams in space twist" if spatial else "a beam with shear: true uses it"
            )
    for name, what in needs.items():
        if known[name].poissons_ratio is None and known[name].shear_modulus is None:
            message = f"needs poissons_ratio or shear_modulus: {what}"
            yield ("mechanism", "materials", name), message
    for name, solid in mechanism.links.items():
        if not isinstance(solid, SolidLink):
            continue
        if (material := known.get(solid.material)) is None:
            path = ("mechanism", "links", name, "material")
            yield path, unknown("material", solid.material, known)
        elif material.poissons_ratio is None:  # its matrices are made for one ν
            instead = "" if material.shear_modulus is None else " instead of shear_modulus"
            path = ("mechanism", "materials", solid.material)
            yield path, f"a solid needs poissons_ratio{instead}"


def beams_have_known_sections(document: Document) -> Iterator[Finding]:
    """The section of every beam exists, or both sections of a taper; these are alike."""
    known = document.mechanism.sections
    for path, beam in beams(document.mechanism):
        if isinstance(beam.section, str):
            given: dict[KeyPath, str] = {("section",): beam.section}
        else:
            given = {("section", end): getattr(beam.section, end) for end in ("start", "end")}
        missing = {key: name for key, name in given.items() if name not in known}
        for key, name in missing.items():
            yield (*path, *key), unknown("section", name, known)
        if len(given) == 2 and not missing:
            a, b = given.values()
            if _keys(known[a]) != _keys(known[b]):
                message = "a taper runs between sections of one shape, given by the same keys: "
                yield (*path, "section"), f"{message}{a!r} and {b!r} are not"


def _keys(section: SectionBase) -> tuple[object, set[str]]:
    return type(section), section.model_fields_set - {"shape"}


def bare_sections_have_the_moments_of_their_space(document: Document) -> Iterator[Finding]:
    """One second moment of area in a plane; two, and the torsion constant, in space."""
    missing = "required key is missing: second moment of area (in m4 when bare; or mm4, cm4)"
    for name, section in document.mechanism.sections.items():
        if not isinstance(section, BareSection):
            continue
        path: KeyPath = ("mechanism", "sections", name)
        if document.mechanism.space == "planar":
            if not section.in_plane:
                yield (*path, "bending_inertia"), missing
        elif section.bending_inertia is None:
            for key in ("inertia_y", "inertia_z", "torsion_constant"):
                if getattr(section, key) is None:
                    yield (*path, key), missing
        else:
            message = "is for planar mechanisms: in space write inertia_z (bending in the local "
            yield (*path, "bending_inertia"), message + "x-y plane) and inertia_y (x-z)"


# --- Links


def rigid_links_have_one_end(document: Document) -> Iterator[Finding]:
    """The node `end` of a rigid link is given by its length or by its place."""
    for name, link in document.mechanism.links.items():
        if isinstance(link, RigidLink) and link.length is not None and "end" in link.nodes:
            message = "the node 'end' is given by length already: leave one of them out"
            yield ("mechanism", "links", name, "nodes", "end"), message


def frames_hang_together(document: Document) -> Iterator[Finding]:
    """A frame's beams run between nodes in different places, and connect all of them."""
    for name, link in document.mechanism.links.items():
        if not isinstance(link, FrameLink):
            continue
        path: KeyPath = ("mechanism", "links", name)
        nodes = link.nodes
        if "start" not in nodes:
            yield (*path, "nodes"), "a frame needs a node 'start'"
        joined: dict[str, list[str]] = {node: [] for node in nodes}
        ends_exist = True
        for key, beam in link.beams.items():
            inner, (a, b) = (*path, "beams", key), (beam.from_node, beam.to_node)
            for end, node in (("from", a), ("to", b)):
                if node not in nodes:
                    yield (*inner, end), unknown("node", node, nodes)
                    ends_exist = False
            if a not in nodes or b not in nodes:
                continue
            if nodes[a] == nodes[b]:
                yield inner, f"has no length: {a!r} and {b!r} are the same place"
            joined[a].append(b)
            joined[b].append(a)
        if ends_exist and nodes:
            yield from _loose_nodes(path, joined)


def _loose_nodes(path: KeyPath, joined: Mapping[str, list[str]]) -> Iterator[Finding]:
    first = "start" if "start" in joined else next(iter(joined))
    reached, waiting = {first}, [first]
    while waiting:
        new = [node for node in joined[waiting.pop()] if node not in reached]
        reached.update(new)
        waiting += new
    if loose := [node for node in joined if node not in reached]:
        message = f"no beams connect {listed(loose)} with {first!r}"
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


def superelements_have_rows_of_their_own_for_each_node(document: Document) -> Iterator[Finding]:
    """A node of a superelement has as many rows as degrees of freedom, shared with no other."""
    planar = document.mechanism.space == "planar"
    wanted = "u_x, u_y, θ_z" if planar else "u_x, u_y, u_z, θ_x, θ_y, θ_z"
    n = len(wanted.split())
    for name, link in document.mechanism.links.items():
        owner: dict[int, str] = {}
        numbered: dict[int, str] = {}
        for node, body in link.nodes.items() if isinstance(link, SuperelementLink) else ():
            path: KeyPath = ("mechanism", "links", name, "nodes", node)
            number = body.id[0] if isinstance(body.id, tuple) else body.id
            first = node if number is None else numbered.setdefault(number, node)
            if first != node and body.dofs is None:
                yield (*path, "id"), f"node {number} is {first!r} already"
            if body.dofs is not None and len(body.dofs) != n:
                message = f"needs {n} entries, the rows of {wanted}; got {len(body.dofs)}"
                yield (*path, "dofs"), message
            for k, dof in enumerate(body.dofs or ()):
                if dof in owner:
                    yield (*path, "dofs", k), f"row {dof} belongs to node {owner[dof]!r} already"
                owner.setdefault(dof, node)


def links_that_a_joint_travels_along_are_not_reduced(document: Document) -> Iterator[Finding]:
    """A link on which a carriage or nut travels bends differently at every place of it."""
    for name, joint in document.mechanism.joints.items():
        base = document.mechanism.links.get(joint.base)
        if joint.travels and isinstance(base, BeamLink) and base.reduce_to is not None:
            message = f"{name!r} travels along this link, so that it cannot be reduced: "
            path = ("mechanism", "links", joint.base, "reduce_to")
            yield path, message + "leave reduce_to out"


# --- Bodies, springs and the tip stand on nodes


def bodies_and_tips_are_on_nodes(document: Document) -> Iterator[Finding]:
    """The node of a body, and the one that a trajectory guides, exist."""
    placed: dict[KeyPath, str] = {
        ("mechanism", "bodies", name, "at"): body.at
        for name, body in document.mechanism.bodies.items()
    }
    for path, _, motion in named_trajectories(document.trajectory):
        if isinstance(motion, TipTrajectory):
            placed[(*path, "tip")] = motion.tip
    for path, node in placed.items():
        if problem := node_problem(document.mechanism, node):
            yield path, problem


def springs_join_two_nodes(document: Document) -> Iterator[Finding]:
    """A spring runs from a node to another, or to the ground, and has a stiffness."""
    for name, spring in document.mechanism.springs.items():
        path: KeyPath = ("mechanism", "springs", name)
        for k, node in enumerate(spring.between):
            if node != "ground" and (problem := node_problem(document.mechanism, node)):
                yield (*path, "between", k), problem
        if spring.between[0] == spring.between[1]:
            yield (*path, "between"), "both ends are the same node"
        if not {"translational", "rotational"} & spring.model_fields_set:
            yield path, "a spring needs translational, rotational or both"


_JOINTS = ("mechanism", "joints")

# --- Joints connect links to the ground


class Edge(NamedTuple):
    """A joint between two links, or the ground and a link."""

    joint: str
    base: str
    follower: str


class Walk(NamedTuple):
    """Links that joints connect to the ground, and the joints that placed none of them."""

    placed: frozenset[str]
    loops: tuple[Edge, ...]  # both their links are placed by others
    apart: tuple[Edge, ...]  # neither of their links is placed


def walk_from_the_ground(mechanism: Mechanism) -> Walk | None:
    """Place link after link, joints in the order of the file.

    None if a joint does not join two links that exist.
    """
    known = set(mechanism.links)
    waiting = []
    for joint, body in mechanism.joints.items():
        base, follower = (node.partition(".")[0] for node in (body.base, body.follower))
        if base not in {*known, "ground"} or follower not in known or base == follower:
            return None
        waiting.append(Edge(joint, base, follower))
    placed = {"ground"}
    while step := next((e for e in waiting if (e.base in placed) != (e.follower in placed)), None):
        placed |= {step.base, step.follower}
        waiting.remove(step)
    loops = tuple(e for e in waiting if e.base in placed)
    return Walk(frozenset(placed), loops, tuple(e for e in waiting if e.base not in placed))


def beams_carry_one_rider(document: Document) -> Iterator[Finding]:
    """One carriage or nut travels along a beam: its mesh is divided where that stands."""
    riders: dict[str, str] = {}
    for name, joint in document.mechanism.joints.items():
        if not joint.travels:
            continue
        if joint.base in riders:
            message = (
                f"{riders[joint.base]!r} travels along {joint.base!r} already, and a beam carries "
                "one carriage or nut: make it two beams, with a fixed joint between them"
            )
            yield (*_JOINTS, name, "base"), message
        riders.setdefault(joint.base, name)


def nuts_are_on_their_shaft(document: Document) -> Iterator[Finding]:
    """A nut turns about its shaft: beside it there is none to turn about."""
    for name, joint in document.mechanism.joints.items():
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
    if not joint.travels:
        return None if base == "ground" else node_problem(mechanism, base, "ground")
    beams = [name for name, link in mechanism.links.items() if isinstance(link, BeamLink)]
    if base in beams:
        return None
    hint = suggestion(base.partition(".")[0], beams)
    if not beams:
        return f"rides along a link of type beam, and there is none; got {shown(base)}"
    return f"rides along a beam: expected one of {listed(beams)}, got {shown(base)}{hint}"


def links_are_connected_to_the_ground(document: Document) -> Iterator[Finding]:
    """Joints lead from the ground to every link; what hangs together apart is reported once."""
    walk = walk_from_the_ground(document.mechanism)
    left = [link for link in document.mechanism.links if walk and link not in walk.placed]
    while walk and left:
        group = {left[0]}
        while more := [e for e in walk.apart if (e.base in group) != (e.follower in group)]:
            group |= {end for edge in more for end in (edge.base, edge.follower)}
        joints = [e.joint for e in walk.apart if e.base in group]
        if joints:
            message = f"{listed(joints)} join {listed([n for n in left if n in group])}"
            yield (*_JOINTS, joints[0]), f"{message}, but no joint connects these to the ground"
        else:
            message = f"no joint holds this link: add one with follower: {left[0]}.<node>"
            yield ("mechanism", "links", left[0]), message
        left = [link for link in left if link not in group]


# --- Coordinates move joints


def coordinates_move_one_freedom_each(document: Document) -> Iterator[Finding]:
    """Each coordinate names a freedom that exists and that no other moves; in an open mechanism
    every freedom has one, since nothing else determines it."""
    mechanism = document.mechanism
    owner: dict[tuple[str, str], str] = {}  # coordinate by joint and freedom
    complete = True
    for name, body in document.coordinates.items():
        path: KeyPath = ("coordinates", name)
        known = freedoms(mechanism, body.joint)
        if problem := _problem(mechanism, known, body, path):
            yield problem
            complete = complete and known == ()
            continue
        freedom = str(body.component or (known or ("",))[0])
        if (body.joint, freedom) in owner:
            of = f"{freedom} of " if known and len(known) > 1 else ""
            message = f"{of}joint {body.joint!r} has a coordinate already: "
            yield (*path, "joint"), f"{message}{owner[body.joint, freedom]!r}"
        owner.setdefault((body.joint, freedom), name)
        if body.angle == "absolute" and not isinstance(mechanism.joints[body.joint], RevoluteJoint):
            yield (*path, "angle"), "only the angle of a revolute joint can be absolute"
    walk = walk_from_the_ground(mechanism)
    if complete and walk is not None and not walk.loops:
        yield from _undriven(document, owner)


def _problem(
    mechanism: Mechanism, known: tuple[str, ...] | None, body: Coordinate, path: KeyPath
) -> Finding | None:
    """The mistake in the joint, or in the component of it, if there is one."""
    joint, component = body.joint, body.component
    if known is None:
        return (*path, "joint"), unknown("joint", joint, mechanism.joints)
    if known == ():
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


def _undriven(document: Document, owner: dict[tuple[str, str], str]) -> Iterator[Finding]:
    for joint in moving(document.mechanism):
        known = freedoms(document.mechanism, joint) or ()
        missing = [freedom for freedom in known if (joint, freedom) not in owner]
        if missing:
            which = f", component: {missing[0]}" if len(known) > 1 else ""
            first = f"q{len(document.coordinates) + 1}"
            message = f"no coordinate: add one under coordinates, e.g. {first}: "
            yield (*_JOINTS, joint), message + f"{{joint: {joint}{which}}}"


# --- Loops are put together


def assembly_names_coordinates_and_joints(document: Document) -> Iterator[Finding]:
    """`at` names coordinates, `guess` joints that move, with a number for each freedom."""
    assembly, path = document.mechanism.assembly, ("mechanism", "assembly")
    for name in assembly.at if assembly else ():
        if name not in document.coordinates:
            yield (*path, "at", name), unknown("coordinate", name, document.coordinates)
    for joint, value in assembly.guess.items() if assembly else ():
        if problem := _guess_problem(document, joint, value):
            yield (*path, "guess", joint), problem


def _guess_problem(document: Document, joint: str, value: object) -> str | None:
    known = freedoms(document.mechanism, joint)
    if known is None:
        return unknown("joint", joint, document.mechanism.joints)
    if known == ():
        return f"joint {joint!r} is fixed: there is nothing to guess"
    count = len(value) if isinstance(value, tuple) else 1
    if len(known) > 1 and guessed(document, joint, count) is None:
        return f"needs a list of {len(known)}: {listed(known)}; or of those without a coordinate"
    if len(known) == 1 and isinstance(value, tuple):
        return f"joint {joint!r} has one freedom: expected a number, got a list"
    return None


def assembly_is_for_loops(document: Document) -> Iterator[Finding]:
    """An open mechanism can be put together in one way only."""
    walk = walk_from_the_ground(document.mechanism)
    if document.mechanism.assembly is not None and walk is not None and not walk.loops:
        yield ("mechanism", "assembly"), "no joint closes a loop: there is nothing to choose"
