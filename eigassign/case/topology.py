"""Whether the joints hold every link exactly once, in chains that start on the ground."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from eigassign.case.suggest import shown, suggestion, unknown
from eigassign.case.tree import Tree, at, items, text
from eigassign.case.yaml_reader import Finding, KeyPath

_LOOPS = "closed loops are not supported yet"


def topology(tree: Tree) -> Iterator[Finding]:
    """Joint ends that do not exist, links held twice, not at all, or in a ring."""
    links = dict(items(tree, "mechanism", "links"))
    if not links:
        return
    holder: dict[str, str] = {}  # link → joint
    parent: dict[str, str] = {}  # link → link or "ground"
    sound = True
    for joint, body in items(tree, "mechanism", "joints"):
        path: KeyPath = ("mechanism", "joints", joint)
        base, link, findings = _ends(body, path, links)
        yield from findings
        sound = sound and base is not None and link is not None
        if link is not None and link in holder:
            message = f"{_LOOPS}: link {link!r} is already held by joint {holder[link]!r}"
            yield (*path, "follower"), message
        elif link is not None:
            holder[link] = joint
            parent[link] = base or "ground"
    if sound:
        yield from _loose(links, holder, parent)


def _ends(
    body: object, path: KeyPath, links: Mapping[str, object]
) -> tuple[str | None, str | None, list[Finding]]:
    """Base (a link or "ground") and follower of one joint, None where wrong."""
    base, follower = text(body, "base"), text(body, "follower")
    findings: list[Finding] = []
    problem = base is not None and _base_problem(base, links)
    if problem:
        findings.append(((*path, "base"), problem))
    if base is not None and base != "ground" and at(body, "position") is not None:
        findings.append(((*path, "position"), "only a joint whose base is ground has a position"))
    held = follower is not None and _follower_problem(follower, links)
    if held:
        findings.append(((*path, "follower"), held))
    return (
        None if problem or base is None else base.partition(".")[0],
        None if held or follower is None else follower.partition(".")[0],
        findings,
    )


def _base_problem(base: str, links: Mapping[str, object]) -> str | None:
    link, _, end = base.partition(".")
    if base == "ground" or (link in links and end in ("start", "end")):
        return None
    if link not in links:
        allowed = "; expected ground, '<link>.start' or '<link>.end'"
        return unknown("link", link, ["ground", *links]) + allowed
    return f"expected ground, '{link}.start' or '{link}.end', got {shown(base)}"


def _follower_problem(follower: str, links: Mapping[str, object]) -> str | None:
    link, _, end = follower.partition(".")
    if link in links and end == "start":
        return None
    if link in links:
        return f"a link is held at its start: write '{link}.start', got {shown(follower)}"
    if link == "ground":
        return "ground cannot follow: make it the base"
    return f"unknown link {shown(link)}{suggestion(link, links)}; expected '<link>.start'"


def _loose(
    links: Mapping[str, object], holder: Mapping[str, str], parent: Mapping[str, str]
) -> Iterator[Finding]:
    """Links without a joint, and rings of links that hold each other but nothing holds."""
    for link in links:
        if link not in holder and link != "ground":
            message = f"no joint holds this link: add one with follower: {link}.start"
            yield ("mechanism", "links", link), message
    walked: set[str] = set()
    for link in links:
        ring = _ring(link, parent, walked)
        if ring:
            joints = ", ".join(sorted(holder[member] for member in ring))
            path = ("mechanism", "joints", holder[ring[0]])
            yield path, f"{_LOOPS}: {joints} form a ring that no joint connects to the ground"


def _ring(link: str, parent: Mapping[str, str], walked: set[str]) -> list[str]:
    """Links that meet again when walking from ``link`` towards the ground over new ones only."""
    path: dict[str, None] = {}
    while link in parent and link not in walked:
        walked.add(link)
        path[link] = None
        link = parent[link]
    chain = list(path)
    return chain[chain.index(link) :] if link in path else []
