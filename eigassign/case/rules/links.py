"""What must agree within and between links: materials, sections, nodes, frames, matrices."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from eigassign.case.reader import Finding, KeyPath, Tree, at, entries, items, names, text
from eigassign.case.rules.nodes import kind_of
from eigassign.case.schema.vectors import ANGLE, PLACE
from eigassign.case.suggestions import listed, shown, unknown
from eigassign.case.units import Quantity, QuantityError


def links(tree: Tree) -> Iterator[Finding]:
    """Everything about links, their materials and their sections."""
    for path, beam in beams(tree):
        yield from _material(tree, path, beam)
        yield from _sections(tree, path, beam)
        yield from _roll(tree, path, beam)
    for name, body in items(tree, "mechanism", "links"):
        path = ("mechanism", "links", name)
        kind = kind_of(body)
        if kind == "rigid":
            yield from _rigid(path, body)
        elif kind == "frame":
            yield from _frame(path, body)
        elif kind == "superelement":
            yield from _superelement(tree, path, body)
    yield from _ridden(tree)
    yield from _moduli(tree)
    yield from _bare(tree)


def beams(tree: Tree) -> Iterator[tuple[KeyPath, object]]:
    """Every beam of the file: links that are one, and those of frames."""
    for name, body in items(tree, "mechanism", "links"):
        path: KeyPath = ("mechanism", "links", name)
        if kind_of(body) == "beam":
            yield path, body
        elif kind_of(body) == "frame":
            for beam, inner in items(body, "beams"):
                yield (*path, "beams", beam), inner


def section_names(beam: object) -> Iterator[tuple[KeyPath, str]]:
    """Sections of a beam: one, or those at both ends of a taper."""
    section = at(beam, "section")
    if isinstance(section, str):
        yield ("section",), section
    for end in ("start", "end"):
        name = text(section, end)
        if name is not None:
            yield ("section", end), name


def _material(tree: Tree, path: KeyPath, beam: object) -> Iterator[Finding]:
    name, known = text(beam, "material"), at(tree, "mechanism", "materials")
    if name is not None and name not in _given(known):
        yield (*path, "material"), unknown("material", name, _given(known))


def _sections(tree: Tree, path: KeyPath, beam: object) -> Iterator[Finding]:
    known = _given(at(tree, "mechanism", "sections"))
    found = list(section_names(beam))
    missing = [(key, name) for key, name in found if name not in known]
    for key, name in missing:
        yield (*path, *key), unknown("section", name, known)
    if len(found) == 2 and not missing:
        (_, a), (_, b) = found
        if not _alike(at(known, a), at(known, b)):
            message = f"a taper runs between sections of one shape, given by the same keys: {a!r}"
            yield (*path, "section"), f"{message} and {b!r} are not"


def _given(group: object) -> Mapping[str, object]:
    """A group that is missing has no entries; one that is no mapping has its own error."""
    return group if isinstance(group, Mapping) else {}


def _alike(a: object, b: object) -> bool:
    if not isinstance(a, Mapping) or not isinstance(b, Mapping):
        return True
    shapes = a.get("shape", "bare"), b.get("shape", "bare")
    return shapes[0] == shapes[1] and set(a) - {"shape"} == set(b) - {"shape"}


def _roll(tree: Tree, path: KeyPath, beam: object) -> Iterator[Finding]:
    if text(tree, "mechanism", "space") == "planar" and _number(at(beam, "roll"), ANGLE):
        message = "is for spatial mechanisms: in a plane height lies in it, and width does not"
        yield (*path, "roll"), message


def _number(value: object, quantity: Quantity) -> float | None:
    """SI value, None where there is none or its own error is told elsewhere."""
    try:
        return None if value is None else quantity.read(value)
    except QuantityError:
        return None


def _rigid(path: KeyPath, body: object) -> Iterator[Finding]:
    if at(body, "length") is not None and "end" in names(body, "nodes"):
        message = "the node 'end' is given by length already: leave one of them out"
        yield (*path, "nodes", "end"), message


def _frame(path: KeyPath, body: object) -> Iterator[Finding]:
    nodes = at(body, "nodes")
    if not isinstance(nodes, Mapping):
        return
    if "start" not in nodes:
        yield (*path, "nodes"), "a frame needs a node 'start'"
    joined: dict[str, list[str]] = {node: [] for node in nodes}
    sound = True
    for name, beam in items(body, "beams"):
        ends = {key: text(beam, key) for key in ("from", "to")}
        for key, node in ends.items():
            if node is not None and node not in nodes:
                yield (*path, "beams", name, key), unknown("node", node, nodes)
        a, b = ends["from"], ends["to"]
        if a is None or b is None or a not in nodes or b not in nodes:
            sound = False
            continue
        yield from _no_length(nodes, a, b, (*path, "beams", name))
        joined[a].append(b)
        joined[b].append(a)
    if sound and nodes:
        yield from _apart(path, nodes, joined)


def _no_length(nodes: Mapping[str, object], a: str, b: str, path: KeyPath) -> Iterator[Finding]:
    places = [[_number(c, PLACE) for c in entries(nodes, node)] for node in (a, b)]
    if a == b or (places[0] == places[1] and places[0] and None not in places[0]):
        yield path, f"has no length: {a!r} and {b!r} are the same place"


def _apart(
    path: KeyPath, nodes: Mapping[str, object], joined: Mapping[str, list[str]]
) -> Iterator[Finding]:
    first = "start" if "start" in nodes else next(iter(nodes))
    reached, waiting = {first}, [first]
    while waiting:
        new = [node for node in joined[waiting.pop()] if node not in reached]
        reached.update(new)
        waiting += new
    loose = [node for node in nodes if node not in reached]
    if loose:
        message = f"no beams connect {listed(loose)} with {first!r}"
        yield (*path, "nodes", loose[0]), message


def _superelement(tree: Tree, path: KeyPath, body: object) -> Iterator[Finding]:
    seen: dict[int, str] = {}
    planar = text(tree, "mechanism", "space") == "planar"
    wanted = "u_x, u_y, θ_z" if planar else "u_x, u_y, u_z, θ_x, θ_y, θ_z"
    n = 3 if planar else 6
    for name, node in items(body, "nodes"):
        dofs, inner = at(node, "dofs"), (*path, "nodes", name, "dofs")
        if isinstance(dofs, tuple) and 3 <= len(dofs) <= 6 and len(dofs) != n:
            yield inner, f"needs {n} entries, the rows of {wanted}; got {len(dofs)}"
        for k, dof in enumerate(entries(node, "dofs")):
            if not isinstance(dof, int) or isinstance(dof, bool):
                continue
            if dof in seen:
                yield (*inner, k), f"row {shown(dof)} belongs to node {seen[dof]!r} already"
            seen.setdefault(dof, name)
    for key in ("stiffness", "mass"):
        file = text(body, key)
        if file is not None and not file.lower().endswith((".mtx", ".npy", ".npz")):
            message = "expected a Matrix Market (.mtx) or NumPy (.npy, .npz) file, got "
            yield (*path, key), message + shown(file)


def _ridden(tree: Tree) -> Iterator[Finding]:
    """A link on which a carriage travels bends differently at every place: it stays whole."""
    for joint, body in items(tree, "mechanism", "joints"):
        kind, base = text(body, "type"), text(body, "base")
        if kind not in ("carriage", "nut") or base is None:
            continue
        path = ("mechanism", "links", base, "reduce_to")
        if at(tree, *path) is not None:
            message = f"{joint!r} travels along this link, so that it cannot be reduced: "
            yield path, message + "leave reduce_to out"


def _moduli(tree: Tree) -> Iterator[Finding]:
    """Materials whose torsion or shear is asked for need G."""
    spatial = text(tree, "mechanism", "space") == "spatial"
    told: set[str] = set()
    for _, beam in beams(tree):
        name = text(beam, "material") or ""
        material = at(tree, "mechanism", "materials", name)
        if not isinstance(material, Mapping) or name in told:
            continue
        if not (spatial or at(beam, "shear") is True):
            continue
        if at(material, "poissons_ratio") is None and at(material, "shear_modulus") is None:
            told.add(name)
            what = "beams in space twist" if spatial else "a beam with shear: true uses it"
            message = f"needs poissons_ratio or shear_modulus: {what}"
            yield ("mechanism", "materials", name), message


def _bare(tree: Tree) -> Iterator[Finding]:
    """Bare sections need what their space bends and twists."""
    spatial = text(tree, "mechanism", "space") == "spatial"
    for name, section in items(tree, "mechanism", "sections"):
        if at(section, "shape") not in (None, "bare") or not isinstance(section, Mapping):
            continue
        path: KeyPath = ("mechanism", "sections", name)
        has = {key for key, value in section.items() if value is not None}
        missing = "required key is missing: second moment of area (in m4 when bare; or mm4, cm4)"
        if not spatial and not has & {"bending_inertia", "inertia_z"}:
            yield (*path, "bending_inertia"), missing
        if {"bending_inertia", "inertia_z"} <= has:
            continue  # told by the schema
        if spatial and "bending_inertia" in has:
            message = "is for planar mechanisms: in space write inertia_z (bending in the local "
            yield (*path, "bending_inertia"), message + "x-y plane) and inertia_y (x-z)"
        elif spatial:
            for key in ("inertia_y", "inertia_z", "torsion_constant"):
                if key not in has:
                    yield (*path, key), missing
