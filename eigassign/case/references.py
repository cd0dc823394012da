"""Names that must agree: every reference of the file, and whether the joints make one mechanism.

Works on the plain tree, so that it speaks up even where the schema has objections elsewhere.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from eigassign.case.coordinate_rules import (
    assembly,
    branches,
    coordinates,
    one_for_each,
    per_coordinate,
)
from eigassign.case.link_rules import links
from eigassign.case.nodes import node_problem
from eigassign.case.space_rules import misfits
from eigassign.case.suggest import shown, unknown
from eigassign.case.timing import uncovered
from eigassign.case.topology import topology
from eigassign.case.tree import (
    Tree,
    at,
    entries,
    items,
    names,
    parameters,
    text,
    trajectories,
    trajectory_names,
)
from eigassign.case.yaml_reader import Finding, KeyPath

_NAME = re.compile(r"[^\W\d][\w-]{0,63}")
_UNUSABLE = (
    "not a usable name: names start with a letter and hold letters, digits, _ and - only "
    "(at most 64)"
)
_MOST_NAMED = 1000
_MOST_INSIDE = 10_000  # nodes or beams of one frame
_NAMED = (
    *(
        ("mechanism", key)
        for key in ("materials", "sections", "links", "joints", "bodies", "springs")
    ),
    ("coordinates",),
    ("design",),
    ("design", "constraints"),
)


def inconsistent(tree: Tree) -> Iterator[Finding]:
    """Everything that does not fit together."""
    yield from empty(tree)
    yield from _names(tree)
    yield from _names_of_trajectories(tree)
    yield from _titles(tree)
    yield from misfits(tree)
    yield from links(tree)
    yield from topology(tree)
    yield from _on_nodes(tree)
    yield from coordinates(tree)
    yield from assembly(tree)
    yield from per_coordinate(tree)
    yield from branches(tree)
    yield from _design(tree)
    yield from _expansion(tree)
    yield from _targets(tree)
    yield from uncovered(tree)


def too_many(tree: Tree) -> Iterator[Finding]:
    """Groups so large that the file is not a mechanism's."""
    for place in _NAMED:
        if len(items(tree, *place)) > _MOST_NAMED:
            yield place, f"more than {_MOST_NAMED} entries"
    for place in _inside_links(tree):
        if len(items(tree, *place)) > _MOST_INSIDE:
            yield place, f"more than {_MOST_INSIDE} entries: make it a superelement"


def empty(node: object, path: KeyPath = ()) -> Iterator[Finding]:
    """Keys and list entries without a value."""
    if node is None:
        comma = bool(path) and str(path[-1])[:1].isdigit()
        hint = " (decimals take a point, not a comma)" if comma else ""
        yield path, f"has no value: give one, or leave the key out{hint}"
    for key, inner in node.items() if isinstance(node, Mapping) else ():
        yield from empty(inner, (*path, key))
    for k, inner in enumerate(node) if isinstance(node, tuple) else ():
        if not isinstance(inner, (int, float)):
            yield from empty(inner, (*path, k))


def _names(tree: Tree) -> Iterator[Finding]:
    for place in (*_NAMED, *_inside_links(tree)):
        for name in names(tree, *place):
            if not _NAME.fullmatch(name):
                yield (*place, name), _UNUSABLE
    if "time" in names(tree, "coordinates"):
        yield ("coordinates", "time"), "'time' heads a column of its own: name it otherwise"
    if "ground" in names(tree, "mechanism", "links"):
        yield (
            ("mechanism", "links", "ground"),
            "'ground' is the fixed frame: name the link otherwise",
        )


def _names_of_trajectories(tree: Tree) -> Iterator[Finding]:
    """Each is the only one of its name: it names files, and some file systems ignore case."""
    seen: dict[str, str] = {}
    for path, body in trajectories(tree):
        name = text(body, "name")
        if name is None:
            continue
        if not _NAME.fullmatch(name):
            yield (*path, "name"), _UNUSABLE
        elif name.casefold() in seen:
            same = seen[name.casefold()]
            hint = "" if same == name else f": {same!r} (they name files, where case may be lost)"
            yield (*path, "name"), f"a trajectory has this name already{hint}"
        seen.setdefault(name.casefold(), name)


def _inside_links(tree: Tree) -> list[tuple[str, ...]]:
    named = names(tree, "mechanism", "links")
    return [("mechanism", "links", n, key) for n in named for key in ("nodes", "beams")]


def _titles(tree: Tree) -> Iterator[Finding]:
    for key in ("title", "reference"):
        if not (text(tree, key) or "").isprintable():
            yield (key,), "expected one line of printable text"


def _on_nodes(tree: Tree) -> Iterator[Finding]:
    """Bodies, springs and the tip, which stand on nodes."""
    for name, body in items(tree, "mechanism", "bodies"):
        yield from _node(tree, text(body, "at"), ("mechanism", "bodies", name, "at"))
    for name, spring in items(tree, "mechanism", "springs"):
        yield from _spring(tree, spring, ("mechanism", "springs", name))
    for path, body in trajectories(tree):
        yield from _node(tree, text(body, "tip"), (*path, "tip"))


def _node(tree: Tree, place: str | None, path: KeyPath) -> Iterator[Finding]:
    message = node_problem(tree, place) if place is not None else None
    if message:
        yield path, message


def _spring(tree: Tree, spring: object, path: KeyPath) -> Iterator[Finding]:
    ends = entries(spring, "between")
    for k, end in enumerate(ends):
        if isinstance(end, str) and not (k == 1 and end == "ground"):
            hint = "write the ground second" if end == "ground" else node_problem(tree, end)
            if hint:
                yield (*path, "between", k), hint
    if len(ends) == 2 and ends[0] == ends[1]:
        yield (*path, "between"), "both ends are the same node"
    if isinstance(spring, Mapping) and not {"translational", "rotational"} & set(spring):
        yield path, "a spring needs translational, rotational or both"


def _design(tree: Tree) -> Iterator[Finding]:
    owner: dict[str, str] = {}
    for name, body in parameters(tree):
        path = text(body, "parameter")
        if name.lower().startswith("constraint") and path is None:
            yield ("design", name), "did you mean the reserved key 'constraints'?"
        if path is not None and path in owner:
            message = f"{path} is a design parameter already: {owner[path]!r}"
            yield ("design", name, "parameter"), message
        owner.setdefault(path or "", name)
    known = dict(parameters(tree))
    for name in names(tree, "design", "constraints"):
        for term in names(tree, "design", "constraints", name, "terms"):
            if term not in known:
                message = unknown("design parameter", term, known)
                yield ("design", "constraints", name, "terms", term), message


def _expansion(tree: Tree) -> Iterator[Finding]:
    y = [name for name, _ in parameters(tree)]
    path: KeyPath = ("expansion", "y")
    yield from one_for_each(at(tree, *path), path, "design parameter", y)  # type: ignore[arg-type]
    seen: set[int] = set()
    for k, mode in enumerate(entries(tree, "expansion", "modes")):
        if not isinstance(mode, int):
            continue
        if mode in seen:
            yield ("expansion", "modes", k), f"mode {shown(mode)} is listed twice"
        seen.add(mode)


def _targets(tree: Tree) -> Iterator[Finding]:
    expanded = entries(tree, "expansion", "modes")
    known, seen = trajectory_names(tree), set[tuple[int, str]]()
    for k, target in enumerate(entries(tree, "targets")):
        mode, where = at(target, "mode"), text(target, "trajectory")
        path: KeyPath = ("targets", k, "mode")
        if where is not None and where not in known:
            yield ("targets", k, "trajectory"), unknown("trajectory", where, known)
            continue
        if not isinstance(mode, int) or mode < 1:
            continue
        held = {(mode, name) for name in ([where] if where else known or [""])}
        if both := sorted(name for _, name in held & seen):
            along = f" along trajectory {both[0]!r}" if len(known) > 1 else ""
            yield path, f"mode {mode} has a target already{along}"
        elif expanded and mode not in expanded:
            yield path, f"mode {mode} is not among expansion.modes: add it there, or leave it auto"
        seen |= held
