"""What the names in a case file's plain data stand for, before anything is known to be right.

Where the data do not say (a key is missing, or holds another kind of value), the answer is None or
empty: the schema reports such a key, and no rule reports it again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from eigassign.case.reader import KeyPath, Tree, at, entries, items, lacks, names, text
from eigassign.case.schema.design import PRICE, RESERVED, column_names, is_entry
from eigassign.case.schema.joints import FREEDOMS
from eigassign.case.schema.links import LINKS
from eigassign.case.schema.parts import ANGLE, PLACE, Quantity
from eigassign.case.schema.targets import TARGETS
from eigassign.case.suggestions import listed, shown, suggestion, unknown
from eigassign.case.units import QuantityError

ANY = Quantity()  # dimension unknown because of an error elsewhere


def number(value: object, quantity: Quantity) -> float | None:
    """SI value; None where there is none, or the schema reports it."""
    try:
        return None if value is None else quantity.read(value)
    except QuantityError:
        return None


def is_spatial(tree: Tree) -> bool:
    """True where the file says that the mechanism is spatial."""
    return text(tree, "mechanism", "space") == "spatial"


def is_planar(tree: Tree) -> bool:
    """True where the file says that the mechanism is planar."""
    return text(tree, "mechanism", "space") == "planar"


# --- Links and their nodes


def links(tree: Tree, kind: str) -> Iterator[tuple[str, KeyPath, object]]:
    """Name, key path and content of each link of a type."""
    for name, body in items(tree, "mechanism", "links"):
        if type_of(body) == kind:
            yield name, ("mechanism", "links", name), body


def type_of(link: object) -> str | None:
    """beam, rigid, frame, superelement or solid; None if it is none of them."""
    if not isinstance(link, Mapping):
        return None
    kind = link.get("type", "beam")
    return kind if isinstance(kind, str) and kind in LINKS else None


def beams(tree: Tree) -> Iterator[tuple[KeyPath, object]]:
    """Key path and content of every beam: links that are one, and those of frames."""
    for _, path, body in links(tree, "beam"):
        yield path, body
    for _, path, body in links(tree, "frame"):
        for beam, inner in items(body, "beams"):
            yield (*path, "beams", beam), inner


def node_names(link: object) -> list[str] | None:
    """Nodes of one link; None where its type or its nodes are not known."""
    kind = type_of(link)
    if kind == "beam":
        return ["start", "end"]
    nodes = at(link, "nodes")
    if kind is None or (nodes is not None and not isinstance(nodes, Mapping)):
        return None
    if kind != "rigid":
        return names(link, "nodes") if nodes is not None else None
    implied = ["start", "end"] if at(link, "length") is not None else ["start"]
    return list(dict.fromkeys([*implied, *names(link, "nodes")]))


def node_problem(tree: Tree, value: str, also: str = "") -> str | None:
    """The mistake in ``value`` as `<link>.<node>`; ``also`` may stand there too."""
    link, _, node = value.partition(".")
    or_else = [also] if also else []
    if lacks(tree, ("mechanism", "links"), link):
        known = [*or_else, *names(tree, "mechanism", "links")]
        expected = f"{also}, " if also else ""
        return (
            f"{unknown('link', link, known)}; expected {expected}'<link>.start', '<link>.end' or "
            "another node"
        )
    nodes = node_names(at(tree, "mechanism", "links", link))
    if nodes is None or node in nodes:
        return None
    few = [repr(f"{link}.{name}") for name in nodes]
    spelt = few if len(nodes) <= 6 else [f"'{link}.<node>' ({listed(nodes)})"]
    expected = " or ".join([*or_else, *spelt])
    return f"expected {expected}, got {shown(value)}{suggestion(node, nodes)}"


# --- Joints and coordinates


def freedoms(tree: Tree, joint: str) -> tuple[str, ...] | None:
    """Names of a joint's freedoms, in order; None if the joint or its type is unknown."""
    return FREEDOMS.get(text(tree, "mechanism", "joints", joint, "type") or "")


def moving(tree: Tree) -> list[str]:
    """Names of the joints that are not fixed."""
    return [name for name in names(tree, "mechanism", "joints") if freedoms(tree, name)]


def driven(tree: Tree, coordinate: object) -> str | None:
    """The freedom of its joint that a coordinate is; None where that cannot be told."""
    known = freedoms(tree, text(coordinate, "joint") or "")
    component = at(coordinate, "component")
    if not known or isinstance(component, bool):
        return None
    if component is None:
        return known[0] if len(known) == 1 else None
    return str(component) if str(component) in known else None


def guessed(tree: Tree, joint: str, count: int) -> tuple[str, ...] | None:
    """The freedoms that a list of ``count`` guesses of a joint gives: all of them, or the passive.

    None if the joint or its type is unknown, or no list of this length can be meant.
    """
    known = freedoms(tree, joint)
    if known is None or count == len(known):
        return known
    own = [body for _, body in items(tree, "coordinates") if text(body, "joint") == joint]
    taken = {driven(tree, body) for body in own}
    passive = tuple(freedom for freedom in known if freedom not in taken)
    return passive if count == len(passive) else None


def of_freedom(freedom: str | None) -> Quantity:
    """Angle or length; anything where the freedom is unknown."""
    if freedom is None:
        return ANY
    return PLACE if freedom == "translation" else ANGLE


def coordinate_quantities(tree: Tree) -> list[Quantity]:
    """Angle or length for each coordinate, in the order of q."""
    return [of_freedom(driven(tree, body)) for _, body in items(tree, "coordinates")]


def coordinate_lists(tree: Tree) -> Iterator[tuple[KeyPath, object]]:
    """Key path and content of whatever has an entry for each coordinate, if it is a list."""
    yield ("expansion", "q"), at(tree, "expansion", "q")
    for path, body in trajectories(tree):
        for key in ("q", "points"):
            yield from (((*path, key, k), row) for k, row in enumerate(entries(body, key)))
        yield (*path, "start"), at(body, "start")
    for path, body in followed_modes(tree):
        yield (*path, "at", "q"), at(body, "at", "q")
    for k, body in enumerate(entries(tree, "measurements")):
        yield ("measurements", k, "q"), at(body, "q")


# --- Trajectories, targets and design parameters


def trajectories(tree: Tree) -> list[tuple[KeyPath, object]]:
    """Key path and content of each trajectory: the one below `trajectory`, or those of the list."""
    given = at(tree, "trajectory")
    if isinstance(given, tuple):
        return [(("trajectory", k), body) for k, body in enumerate(given)]
    return [] if given is None else [(("trajectory",), given)]


def trajectory_names(tree: Tree) -> list[str]:
    """Names of the trajectories; of one without, its place counted from 1."""
    bodies = [body for _, body in trajectories(tree)]
    return [text(body, "name") or str(k) for k, body in enumerate(bodies, start=1)]


def design_entries(tree: Tree) -> list[tuple[str, object]]:
    """Parameters and lists of choices: what stands under `design` but its reserved names."""
    entries = items(tree, "design")
    return [(name, body) for name, body in entries if name not in RESERVED or is_entry(body)]


def choices(entry: object) -> list[tuple[str, object]] | None:
    """Name and content of each choice of a design entry; None of one that is a parameter."""
    return None if at(entry, "choices") is None else items(entry, "choices")


class PlacedColumn(NamedTuple):
    """One component of y as the file has it: its name, its property, and where that is named.

    ``others`` are further properties in its proportion: path, factor and place of each.
    """

    name: str
    parameter: str | None
    place: KeyPath
    others: tuple[tuple[str, object, KeyPath], ...] = ()

    @property
    def properties(self) -> list[tuple[str, KeyPath]]:
        """Path and place of each of its properties."""
        first = [] if self.parameter is None else [(self.parameter, self.place)]
        return [*first, *((path, place) for path, _, place in self.others)]


def columns(tree: Tree) -> list[PlacedColumn]:
    """The components of y, in order: parameters, and what the first choice of a list sets."""
    found = []
    for name, body in design_entries(tree):
        listed_choices = choices(body)
        if listed_choices is None:
            found.append(parameter(name, body))
        for first, choice in (listed_choices or ())[:1]:
            paths = [path for path in names(choice) if path != PRICE]
            place: KeyPath = ("design", name, "choices", first)
            pairs = zip(column_names(name, paths), paths, strict=True)
            found += [PlacedColumn(column, path, (*place, path)) for column, path in pairs]
    return found


def parameter(name: str, body: object) -> PlacedColumn:
    """The column of a parameter, of one property or of several."""
    place: KeyPath = ("design", name, "parameter")
    own, first = text(body, "parameter"), place
    others: list[tuple[str, object, KeyPath]] = []
    for k, each in enumerate(entries(body, "parameter")):
        if k == 0 and isinstance(each, str):
            own, first = each, (*place, k)
        elif isinstance(each, str):
            others.append((each, 1.0, (*place, k)))
        else:
            others += [(path, factor, (*place, k, path)) for path, factor in items(each)]
    return PlacedColumn(name, own, first, tuple(others))


def curves(tree: Tree) -> list[tuple[KeyPath, object]]:
    """Key path and content of every frequency of a target that may change in time."""
    found: list[tuple[KeyPath, object]] = []
    for k, target in enumerate(entries(tree, "targets")):
        for keys in (keys for form in TARGETS.values() for keys in form.in_time):
            if (curve := at(target, *keys)) is not None:
                found.append((("targets", k, *keys), curve))
    return found


def followed_modes(tree: Tree) -> list[tuple[KeyPath, object]]:
    """Key path and content of every mode that is named by its shape."""
    found: list[tuple[KeyPath, object]] = []
    for k, target in enumerate(entries(tree, "targets")):
        found.append((("targets", k, "mode"), at(target, "mode")))
        pair = enumerate(entries(target, "gap", "between"))
        found += ((("targets", k, "gap", "between", i), body) for i, body in pair)
    return [(path, body) for path, body in found if isinstance(body, Mapping)]
