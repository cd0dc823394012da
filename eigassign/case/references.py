"""Names that must agree: every reference of the file, and whether the joints make one chain.

Works on the plain tree, so that it speaks up even where the schema has objections elsewhere.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from eigassign.case.suggest import listed, shown, unknown
from eigassign.case.timing import uncovered
from eigassign.case.topology import topology
from eigassign.case.tree import Tree, at, entries, items, lacks, names, parameters, text
from eigassign.case.yaml_reader import Finding, KeyPath

_NAME = re.compile(r"[^\W\d][\w-]{0,63}")
_MOST_NAMED = 1000
_NAMED = (
    *(("mechanism", key) for key in ("materials", "sections", "links", "joints", "bodies")),
    ("coordinates",),
    ("design",),
    ("design", "constraints"),
)


def inconsistent(tree: Tree) -> Iterator[Finding]:
    """Everything that does not fit together."""
    yield from empty(tree)
    yield from _names(tree)
    yield from _titles(tree)
    yield from _space(tree)
    yield from _materials_and_sections(tree)
    yield from topology(tree)
    yield from _bodies(tree)
    yield from _coordinates(tree)
    yield from _trajectory(tree)
    yield from _design(tree)
    yield from _expansion(tree)
    yield from _targets(tree)
    yield from uncovered(tree)


def too_many(tree: Tree) -> Iterator[Finding]:
    """Groups so large that the file is not a mechanism's."""
    for place in _NAMED:
        if len(items(tree, *place)) > _MOST_NAMED:
            yield place, f"more than {_MOST_NAMED} entries"


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
    rule = "names start with a letter and hold letters, digits, _ and - only (at most 64)"
    for place in _NAMED:
        for name in names(tree, *place):
            if not _NAME.fullmatch(name):
                yield (*place, name), f"not a usable name: {rule}"
    if "ground" in names(tree, "mechanism", "links"):
        yield (
            ("mechanism", "links", "ground"),
            "'ground' is the fixed frame: name the link otherwise",
        )


def _titles(tree: Tree) -> Iterator[Finding]:
    for key in ("title", "reference"):
        if not (text(tree, key) or "").isprintable():
            yield (key,), "expected one line of printable text"


def _space(tree: Tree) -> Iterator[Finding]:
    if at(tree, "mechanism", "space") == "spatial":
        yield ("mechanism", "space"), "spatial mechanisms are not supported yet: only planar"


def _materials_and_sections(tree: Tree) -> Iterator[Finding]:
    for link, body in items(tree, "mechanism", "links"):
        for kind in ("material", "section"):
            name, group = text(body, kind), ("mechanism", f"{kind}s")
            if name is not None and lacks(tree, group, name):
                known = names(tree, *group)
                yield ("mechanism", "links", link, kind), unknown(kind, name, known)


def _end_of_link(tree: Tree, value: str) -> str | None:
    """What is wrong with ``value`` as a link's end; None if nothing is."""
    link, _, end = value.partition(".")
    if lacks(tree, ("mechanism", "links"), link):
        links = names(tree, "mechanism", "links")
        return f"{unknown('link', link, links)}; expected '<link>.start' or '<link>.end'"
    if end in ("start", "end") or at(tree, "mechanism", "links", link) is None:
        return None
    return f"expected '{link}.start' or '{link}.end', got {shown(value)}"


def _bodies(tree: Tree) -> Iterator[Finding]:
    for name, body in items(tree, "mechanism", "bodies"):
        place = text(body, "at")
        message = _end_of_link(tree, place) if place is not None else None
        if message:
            yield ("mechanism", "bodies", name, "at"), message


def _revolute(tree: Tree) -> list[str]:
    joints = items(tree, "mechanism", "joints")
    return [name for name, body in joints if at(body, "type") == "revolute"]


def _coordinates(tree: Tree) -> Iterator[Finding]:
    owner: dict[str, str] = {}
    where = ("mechanism", "joints")
    complete = True
    for name, body in items(tree, "coordinates"):
        joint = text(body, "joint")
        path: KeyPath = ("coordinates", name, "joint")
        if joint is None or lacks(tree, where, joint):
            complete = False
            if joint is not None:
                yield path, unknown("joint", joint, names(tree, *where))
        elif at(tree, "mechanism", "joints", joint, "type") == "fixed":
            yield (
                path,
                f"joint {joint!r} is fixed and has no coordinate; revolute: "
                + listed(_revolute(tree)),
            )
        elif joint in owner:
            yield path, f"joint {joint!r} has a coordinate already: {owner[joint]!r}"
        owner.setdefault(joint or "", name)
    for joint in _revolute(tree):
        if complete and joint not in owner:
            message = f"no coordinate: add one under coordinates, e.g. q{len(owner) + 1}: "
            yield ("mechanism", "joints", joint), message + f"{{joint: {joint}}}"


def _length(tree: Tree, value: object, path: KeyPath, kind: str, known: list[str]) -> list[Finding]:
    """A finding if list ``value`` has not one entry for each of ``known``."""
    if not isinstance(value, tuple) or len(value) == len(known):
        return []
    message = f"needs {len(known)} entries, one for each {kind} ({listed(known)}); got {len(value)}"
    return [(path, message)]


def _trajectory(tree: Tree) -> Iterator[Finding]:
    q = names(tree, "coordinates")
    for k, row in enumerate(entries(tree, "trajectory", "q")):
        yield from _length(tree, row, ("trajectory", "q", k), "coordinate", q)
    start = at(tree, "trajectory", "start")
    yield from _length(tree, start, ("trajectory", "start"), "coordinate", q)
    span = at(tree, "validation", "q_span")
    yield from _length(tree, span, ("validation", "q_span"), "coordinate", q)
    tip = text(tree, "trajectory", "tip")
    message = _end_of_link(tree, tip) if tip is not None else None
    if message:
        yield ("trajectory", "tip"), message
    revolute = _revolute(tree)
    for joint in names(tree, "trajectory", "branch"):
        if joint not in revolute:
            message = unknown("revolute joint", joint, revolute)
            yield ("trajectory", "branch", joint), message


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
    q, y = names(tree, "coordinates"), [name for name, _ in parameters(tree)]
    yield from _length(tree, at(tree, "expansion", "q"), ("expansion", "q"), "coordinate", q)
    yield from _length(tree, at(tree, "expansion", "y"), ("expansion", "y"), "design parameter", y)
    seen: set[int] = set()
    for k, mode in enumerate(entries(tree, "expansion", "modes")):
        if not isinstance(mode, int):
            continue
        if mode in seen:
            yield ("expansion", "modes", k), f"mode {shown(mode)} is listed twice"
        seen.add(mode)


def _targets(tree: Tree) -> Iterator[Finding]:
    expanded = entries(tree, "expansion", "modes")
    seen: set[int] = set()
    for k, target in enumerate(entries(tree, "targets")):
        mode = at(target, "mode")
        path: KeyPath = ("targets", k, "mode")
        if not isinstance(mode, int) or mode < 1:
            continue
        if mode in seen:
            yield path, f"mode {mode} has a target already"
        elif expanded and mode not in expanded:
            yield path, f"mode {mode} is not among expansion.modes: add it there, or leave it auto"
        seen.add(mode)
