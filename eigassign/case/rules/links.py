"""Links, the materials and sections of their beams, and what stands on their nodes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from eigassign.case.reader import Finding, KeyPath, Tree, at, entries, items, names, text
from eigassign.case.rules.lookups import (
    beams,
    is_planar,
    is_spatial,
    links,
    node_problem,
    number,
    trajectories,
)
from eigassign.case.schema.joints import RIDING
from eigassign.case.schema.parts import PLACE
from eigassign.case.suggestions import listed, shown, unknown
from eigassign.files import how_to_raise, raised

MOST_ELEMENTS = 20_000  # `check` takes 10 to 30 s and 230 MB, in proportion

# --- Materials and sections


def links_have_known_materials(tree: Tree) -> Iterator[Finding]:
    """The material of every beam and solid exists."""
    known = names(tree, "mechanism", "materials")
    solids = ((path, body) for _, path, body in links(tree, "solid"))
    for path, beam in (*beams(tree), *solids):
        name = text(beam, "material")
        if name is not None and name not in known:
            yield (*path, "material"), unknown("material", name, known)


def beams_have_known_sections(tree: Tree) -> Iterator[Finding]:
    """The section of every beam exists, or both sections of a taper; these are alike."""
    known = dict(items(tree, "mechanism", "sections"))
    for path, beam in beams(tree):
        ends: list[tuple[KeyPath, str | None]] = [(("section",), text(beam, "section"))]
        ends += [(("section", end), text(beam, "section", end)) for end in ("start", "end")]
        given = [(key, name) for key, name in ends if name is not None]
        missing = [(key, name) for key, name in given if name not in known]
        for key, name in missing:
            yield (*path, *key), unknown("section", name, known)
        if len(given) == 2 and not missing:
            (_, a), (_, b) = given
            if not _alike(known[a], known[b]):
                message = "a taper runs between sections of one shape, given by the same keys: "
                yield (*path, "section"), f"{message}{a!r} and {b!r} are not"


def _alike(a: object, b: object) -> bool:
    if not isinstance(a, Mapping) or not isinstance(b, Mapping):
        return True
    keys = [{*section, "shape"} for section in (a, b)]
    return keys[0] == keys[1] and a.get("shape", "bare") == b.get("shape", "bare")


def materials_have_a_shear_modulus_where_beams_need_it(tree: Tree) -> Iterator[Finding]:
    """Torsion and shear need G, or Poisson's ratio."""
    spatial = is_spatial(tree)
    what = "beams in space twist" if spatial else "a beam with shear: true uses it"
    using = [text(b, "material") for _, b in beams(tree) if spatial or at(b, "shear") is True]
    for name in dict.fromkeys(using):
        material = at(tree, "mechanism", "materials", name or "")
        if not isinstance(material, Mapping):
            continue
        if at(material, "poissons_ratio") is None and at(material, "shear_modulus") is None:
            message = f"needs poissons_ratio or shear_modulus: {what}"
            yield ("mechanism", "materials", name or ""), message


def solids_have_a_poissons_ratio(tree: Tree) -> Iterator[Finding]:
    """The matrices of a solid are made for one ν; Young's modulus and density multiply them."""
    for _, _, body in links(tree, "solid"):
        name = text(body, "material") or ""
        material = at(tree, "mechanism", "materials", name)
        if isinstance(material, Mapping) and at(material, "poissons_ratio") is None:
            instead = " instead of shear_modulus" if "shear_modulus" in material else ""
            yield ("mechanism", "materials", name), f"a solid needs poissons_ratio{instead}"


def bare_sections_have_the_moments_of_their_space(tree: Tree) -> Iterator[Finding]:
    """One second moment of area in a plane; two, and the torsion constant, in space."""
    missing = "required key is missing: second moment of area (in m4 when bare; or mm4, cm4)"
    for name, section in items(tree, "mechanism", "sections"):
        if at(section, "shape") not in (None, "bare") or not isinstance(section, Mapping):
            continue
        path: KeyPath = ("mechanism", "sections", name)
        has = {key for key, value in section.items() if value is not None}
        if not is_spatial(tree):
            if not has & {"bending_inertia", "inertia_z"}:
                yield (*path, "bending_inertia"), missing
        elif "bending_inertia" not in has:
            for key in ("inertia_y", "inertia_z", "torsion_constant"):
                if key not in has:
                    yield (*path, key), missing
        elif "inertia_z" not in has:  # the schema refuses both
            message = "is for planar mechanisms: in space write inertia_z (bending in the local "
            yield (*path, "bending_inertia"), message + "x-y plane) and inertia_y (x-z)"


# --- Links


def rigid_links_have_one_end(tree: Tree) -> Iterator[Finding]:
    """The node `end` of a rigid link is given by its length or by its place."""
    for _, path, body in links(tree, "rigid"):
        if at(body, "length") is not None and "end" in names(body, "nodes"):
            message = "the node 'end' is given by length already: leave one of them out"
            yield (*path, "nodes", "end"), message


def frames_hang_together(tree: Tree) -> Iterator[Finding]:
    """A frame's beams run between nodes in different places, and connect all of them."""
    for _, path, body in links(tree, "frame"):
        nodes = at(body, "nodes")
        if not isinstance(nodes, Mapping):
            continue
        if "start" not in nodes:
            yield (*path, "nodes"), "a frame needs a node 'start'"
        joined: dict[str, list[str]] = {node: [] for node in nodes}
        ends_exist = True
        for name, beam in items(body, "beams"):
            inner = (*path, "beams", name)
            a, b = text(beam, "from"), text(beam, "to")
            for key, node in (("from", a), ("to", b)):
                if node is not None and node not in nodes:
                    yield (*inner, key), unknown("node", node, nodes)
            if a not in nodes or b not in nodes or a is None or b is None:
                ends_exist = False
                continue
            places = [[number(c, PLACE) for c in entries(nodes, node)] for node in (a, b)]
            if a == b or (places[0] == places[1] and places[0] and None not in places[0]):
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


def beams_have_no_more_elements_than_can_be_meant(tree: Tree) -> Iterator[Finding]:
    """The beams together have MOST_ELEMENTS at most."""
    given = [(path, at(body, "elements")) for path, body in beams(tree)]
    allowed = range(100_000 + 1)  # the schema finds the others
    known = [(n, path) for path, n in given if type(n) is int and n in allowed]
    total = sum(n for n, _ in known)
    if total > raised(MOST_ELEMENTS):
        _, path = max(known, key=lambda each: each[0])
        yield (
            (*path, "elements"),
            f"the mechanism has {shown(total)} elements: more than {raised(MOST_ELEMENTS):g} take "
            f"minutes and hundreds of MB; {how_to_raise(total, MOST_ELEMENTS)}",
        )


def superelements_have_rows_of_their_own_for_each_node(tree: Tree) -> Iterator[Finding]:
    """A node of a superelement has as many rows as degrees of freedom, shared with no other."""
    wanted = "u_x, u_y, θ_z" if is_planar(tree) else "u_x, u_y, u_z, θ_x, θ_y, θ_z"
    n = len(wanted.split())
    for _, path, body in links(tree, "superelement"):
        owner: dict[int, str] = {}
        numbered: dict[int, str] = {}
        for name, node in items(body, "nodes"):
            number = at(node, "id")
            number = number[0] if isinstance(number, tuple) and number else number
            first = numbered.setdefault(number, name) if isinstance(number, int) else name
            if first != name and at(node, "dofs") is None:
                message = f"node {shown(number)} is {first!r} already"
                yield (*path, "nodes", name, "id"), message
            dofs, inner = entries(node, "dofs"), (*path, "nodes", name, "dofs")
            if 3 <= len(dofs) <= 6 and len(dofs) != n:
                yield inner, f"needs {n} entries, the rows of {wanted}; got {len(dofs)}"
            for k, dof in enumerate(dofs):
                if not isinstance(dof, int) or isinstance(dof, bool):
                    continue
                if dof in owner:
                    yield (*inner, k), f"row {shown(dof)} belongs to node {owner[dof]!r} already"
                owner.setdefault(dof, name)


def links_that_a_joint_travels_along_are_not_reduced(tree: Tree) -> Iterator[Finding]:
    """A link on which a carriage or nut travels bends differently at every place of it."""
    for joint, body in items(tree, "mechanism", "joints"):
        base = text(body, "base")
        path = ("mechanism", "links", base or "", "reduce_to")
        beams = [name for name, *_ in links(tree, "beam")]
        if text(body, "type") in RIDING and base in beams and at(tree, *path) is not None:
            message = f"{joint!r} travels along this link, so that it cannot be reduced: "
            yield path, message + "leave reduce_to out"


# --- Bodies, springs and the tip stand on nodes


def bodies_and_tips_are_on_nodes(tree: Tree) -> Iterator[Finding]:
    """The node of a body, and the one that a trajectory guides, exist."""
    placed: list[tuple[KeyPath, str | None]] = []
    for name, body in items(tree, "mechanism", "bodies"):
        placed.append((("mechanism", "bodies", name, "at"), text(body, "at")))
    placed += [((*path, "tip"), text(body, "tip")) for path, body in trajectories(tree)]
    for path, node in placed:
        if node is not None and (problem := node_problem(tree, node)):
            yield path, problem


def springs_join_two_nodes(tree: Tree) -> Iterator[Finding]:
    """A spring runs from a node to another, or to the ground, and has a stiffness."""
    for name, spring in items(tree, "mechanism", "springs"):
        path: KeyPath = ("mechanism", "springs", name)
        ends = entries(spring, "between")
        nodes = ((k, e) for k, e in enumerate(ends) if isinstance(e, str) and e != "ground")
        for k, node in nodes:
            if problem := node_problem(tree, node):
                yield (*path, "between", k), problem
        if len(ends) == 2 and ends[0] == ends[1]:
            yield (*path, "between"), "both ends are the same node"
        if isinstance(spring, Mapping) and not {"translational", "rotational"} & set(spring):
            yield path, "a spring needs translational, rotational or both"
