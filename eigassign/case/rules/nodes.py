"""The named nodes of links, as the file has them."""

from __future__ import annotations

from collections.abc import Mapping

from eigassign.case.reader import Tree, at, lacks, names
from eigassign.case.schema.links import LINKS
from eigassign.case.suggestions import listed, shown, suggestion, unknown

_MOST = 6  # node names spelt out in a message


def kind_of(link: object) -> str | None:
    """beam, rigid, frame or superelement; None if it is none of them."""
    if not isinstance(link, Mapping):
        return None
    kind = link.get("type", "beam")
    return kind if isinstance(kind, str) and kind in LINKS else None


def node_names(link: object) -> list[str] | None:
    """Nodes of one link; None where its type or its nodes are not known."""
    kind = kind_of(link)
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
    """What is wrong with ``value`` as `<link>.<node>`; ``also`` is what else may stand there."""
    link, _, node = value.partition(".")
    if lacks(tree, ("mechanism", "links"), link):
        links = names(tree, "mechanism", "links")
        known = [*([also] if also else []), *links]
        expected = f"{also}, " if also else ""
        return (
            f"{unknown('link', link, known)}; expected {expected}'<link>.start', '<link>.end' or "
            "another node"
        )
    nodes = node_names(at(tree, "mechanism", "links", link))
    if nodes is None or node in nodes:
        return None
    expected = " or ".join([*([also] if also else []), *_spelt(link, nodes)])
    return f"expected {expected}, got {shown(value)}{suggestion(node, nodes)}"


def _spelt(link: str, nodes: list[str]) -> list[str]:
    if len(nodes) <= _MOST:
        return [repr(f"{link}.{node}") for node in nodes]
    return [f"'{link}.<node>' ({listed(nodes)})"]
