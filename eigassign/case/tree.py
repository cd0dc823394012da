"""Looking into a file's plain data before anything about it is known to be right."""

from __future__ import annotations

from collections.abc import Mapping

Tree = Mapping[str, object]


def at(node: object, *keys: str) -> object:
    """Value below ``keys``, or None where there is no such key."""
    for key in keys:
        node = node.get(key) if isinstance(node, Mapping) else None
    return node


def items(node: object, *keys: str) -> list[tuple[str, object]]:
    """Entries of the mapping below ``keys``; none if it is not a mapping."""
    inner = at(node, *keys)
    return list(inner.items()) if isinstance(inner, Mapping) else []


def names(node: object, *keys: str) -> list[str]:
    """Keys of the mapping below ``keys``."""
    return [name for name, _ in items(node, *keys)]


def lacks(node: object, keys: tuple[str, ...], name: str) -> bool:
    """Whether the mapping below ``keys`` has no ``name``; False where it is missing or no mapping
    (one error is enough)."""
    inner = at(node, *keys)
    return isinstance(inner, Mapping) and name not in inner


def entries(node: object, *keys: str) -> tuple[object, ...]:
    """Items of the list below ``keys``; none if it is not a list."""
    inner = at(node, *keys)
    return inner if isinstance(inner, tuple) else ()


def text(node: object, *keys: str) -> str | None:
    """Text below ``keys``, or None."""
    inner = at(node, *keys)
    return inner if isinstance(inner, str) else None


def trajectories(tree: object) -> list[tuple[tuple[str | int, ...], object]]:
    """Key path and content of each trajectory: the one below `trajectory`, or those of the list."""
    given = at(tree, "trajectory")
    if isinstance(given, tuple):
        return [(("trajectory", k), body) for k, body in enumerate(given)]
    return [] if given is None else [(("trajectory",), given)]


def trajectory_names(tree: object) -> list[str]:
    """What each trajectory is called: its name, or its place counted from 1."""
    bodies = [body for _, body in trajectories(tree)]
    return [text(body, "name") or str(k) for k, body in enumerate(bodies, start=1)]


def parameters(tree: object) -> list[tuple[str, object]]:
    """Design parameters as the file has them: what stands under `design` but the constraints."""
    return [(name, body) for name, body in items(tree, "design") if name != "constraints"]
