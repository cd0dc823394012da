"""Other values of some keys of a file: a dotted key → its path in the tree → the tree with them.

A dotted key is a path into the file: `mechanism.bodies.tool.mass`, `targets.0.frequency`.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from difflib import get_close_matches
from itertools import islice
from pathlib import Path
from typing import Any

from eigassign.case.reader import KeyPath, Tree
from eigassign.case.schema.document import validated

_BRACKET = re.compile(r"\[(\d+)\]")


def key_path(tree: Tree, key: str) -> KeyPath:
    """The path that a dotted key means in the file; what is not there is taken as it is written.

    Where a name holds dots itself, as the paths below `set` do, the longest that is there is meant.
    """
    parts, path = _BRACKET.sub(r".\1", key).split("."), list[str | int]()
    node: Any = tree
    while parts:
        if isinstance(node, tuple) and parts[0].isdecimal():
            step: str | int = int(parts[0])
        else:
            names = (".".join(parts[:n]) for n in range(len(parts), 0, -1))
            known = node if isinstance(node, Mapping) else {}
            step = next((name for name in names if name in known), parts[0])
        path.append(step)
        del parts[: str(step).count(".") + 1]
        node = _below(node, step)
    return tuple(path)


def short_keys(keys: Iterable[str], least: int = 1) -> dict[str, str]:
    """The end of each key, from a name on and of at least so many parts, that no other key has.

    The whole key where there is none, of ten parts at most.
    """
    parts = {key: key.rsplit(".", 10) for key in keys}
    ends = {
        key: [".".join(p[-n:]) for n in range(least, len(p)) if not p[-n].isdecimal()]
        for key, p in parts.items()
    }
    counts = Counter(end for own in ends.values() for end in own)
    return {key: next((e for e in own if counts[e] == 1), key) for key, own in ends.items()}


def _below(node: Any, step: str | int) -> Any:
    """The value there, or None."""
    if isinstance(node, tuple):
        return node[step] if isinstance(step, int) and step < len(node) else None
    return node.get(step) if isinstance(node, Mapping) else None


def with_values(tree: Tree, values: Mapping[str, object]) -> Tree:
    """``tree`` with these values at these keys, and without its sweep."""
    changed: Any = {key: body for key, body in tree.items() if key != "sweep"}
    for key, value in values.items():
        changed = _with(changed, key_path(tree, key), value)
    whole: Tree = changed
    return whole


def _with(node: Any, path: KeyPath, value: object) -> Any:
    if not path:
        return value
    step, inner = path[0], _with(_below(node, path[0]), path[1:], value)
    if isinstance(node, tuple) and isinstance(step, int):
        return (*node[:step], inner, *node[step + 1 :])
    return {**(node or {}), step: inner}


def objection(tree: Tree, folder: Path, key: str, value: object) -> str | None:
    """Why no case could have this key; None where the file has it, or may have it with ``value``.

    ``folder`` is that of the file.
    """
    path, node = key_path(tree, key), tree
    if path[0] == "sweep":
        return "a sweep gives values to other keys than its own"
    known = 0  # steps of the path that are there
    for step in path:
        if (below := _below(node, step)) is None:
            break
        node, known = below, known + 1
    if known == len(path):
        return None
    wrong = []
    if isinstance(node, Mapping):  # perhaps a key that the file leaves to its default
        first = path[: known + 1]
        _, findings = validated(with_values(tree, {key: value}), folder)
        about = [(place, why) for place, why in findings if place[: len(first)] == first]
        wrong = [why for at, why in about if at != path or why.startswith("unknown key")]
        if not wrong:
            return None
    if (near := _nearest(tree, key)) is None:
        return wrong[0] if wrong else f"no such key: {path[known]!r} is not there"
    return f"no such key; did you mean {near!r}?"


def _nearest(tree: Tree, key: str) -> str | None:
    """The key of the file that was probably meant."""
    names = (".".join(map(str, path)) for path in _leaves(tree, ()) if path[0] != "sweep")
    known = list(islice(names, 2000))  # a fraction of a second, however long the file
    longer = [name for name in known if name.endswith(f".{key}")]
    return next(iter(longer or get_close_matches(key, known, n=1, cutoff=0.6)), None)


def _leaves(node: Any, path: KeyPath) -> Iterator[KeyPath]:
    if isinstance(node, Mapping):
        inner: Any = node.items()
    elif isinstance(node, tuple) and any(isinstance(v, (Mapping, tuple)) for v in node):
        inner = enumerate(node)
    else:
        yield path
        return
    for step, below in inner:
        yield from _leaves(below, (*path, step))
