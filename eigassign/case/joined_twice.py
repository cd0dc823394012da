"""Joints that close a loop without any link in it: several on one pin, of which one is too many.

A loop has the breadth of the links in it. Where joints alone lead from a node back to it, as with
two joints between the same two nodes, or three among three links on one pin, all of them hold the
same place, and the last adds nothing as long as it allows what the others allow. Loops that are
overconstrained otherwise (hinges side by side, a planar linkage in space, a frame clamped at both
ends) hold flexible links in different places, and are none of this.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from eigassign.case.yaml_reader import Finding

Node = tuple[str, tuple[float, ...]]  # a node, and how far from it


def joined_twice(joints: Mapping[str, Any]) -> Iterator[Finding]:
    """A warning for each joint whose two nodes earlier joints join already."""
    led: dict[Node, dict[Node, str]] = {}
    for name, joint in joints.items():
        base, follower = _node(joint.base, joint), (joint.follower, ())
        others = _path(led, base, follower)
        if others:
            yield ("mechanism", "joints", name), _message(joint, others)
        else:
            led.setdefault(base, {})[follower] = name
            led.setdefault(follower, {})[base] = name


def _node(name: str, joint: Any) -> Node:
    """The base's node, or a place beside it."""
    position = tuple(float(x) for x in getattr(joint, "position", None) or ())
    return name, position if any(position) else ()


def _path(led: Mapping[Node, Mapping[Node, str]], start: Node, end: Node) -> list[str]:
    """The joints on the way from one node to another; none where there is no way."""
    ways: dict[Node, list[str]] = {start: []}
    queue = [start]
    for here in queue:
        for there, joint in led.get(here, {}).items():
            if there not in ways:
                ways[there] = [*ways[here], joint]
                queue.append(there)
    return ways.get(end, [])


def _message(joint: Any, others: list[str]) -> str:
    held = " and ".join(repr(name) for name in others)
    verb = "joins" if len(others) == 1 else "join"
    return (
        f"is redundant: {held} {verb} {joint.base} and {joint.follower} already, so that it holds "
        "nothing new where it allows the same motion; leave it out, or was another node meant?"
    )
