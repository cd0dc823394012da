"""Values of the mechanism that other keys decide → SI numbers, absolute files, default vectors."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from eigassign.case.freedoms import ANY, driven, freedoms, of_freedom
from eigassign.case.nodes import kind_of
from eigassign.case.properties import held
from eigassign.case.si import si
from eigassign.case.tree import Tree, at, items, text
from eigassign.case.yaml_reader import Finding, KeyPath


def mechanism(tree: Tree, folder: Path, findings: list[Finding]) -> dict[str, object]:
    """What is to replace `mechanism.joints`, `.links` and `.assembly`."""
    groups = {
        "joints": _joints(tree),
        "springs": _springs(tree),
        "links": _links(tree, folder, findings),
    }
    changed: dict[str, object] = {k: v for k, v in groups.items() if v}
    given = at(tree, "mechanism", "assembly")
    if isinstance(given, Mapping):
        changed["assembly"] = {**given, **_assembly(tree, findings)}
    return changed


def coordinates(tree: Tree, findings: list[Finding]) -> dict[str, object]:
    """`coordinates` with drive stiffnesses in SI."""
    changed: dict[str, object] = {}
    for name, body in items(tree, "coordinates"):
        changed[name] = body
        stiffness = at(body, "drive", "stiffness")
        if isinstance(body, Mapping) and stiffness is not None:
            path: KeyPath = ("coordinates", name, "drive", "stiffness")
            value = si(stiffness, held(tree, body), path, findings, harmless=1.0)
            changed[name] = {**body, "drive": {**body["drive"], "stiffness": value}}
    return changed


def _joints(tree: Tree) -> dict[str, object]:
    """Joints with their place written out: zeros where the file is silent."""
    spatial = text(tree, "mechanism", "space") == "spatial"
    default: dict[str, object] = {"position": (0.0,) * (3 if spatial else 2)}
    if spatial:
        default["orientation"] = (0.0, 0.0, 0.0)
    joints = items(tree, "mechanism", "joints")
    return {n: {**default, **b} if isinstance(b, Mapping) else b for n, b in joints}


def _springs(tree: Tree) -> dict[str, object]:
    """Springs with their spatial orientation written out."""
    spatial = text(tree, "mechanism", "space") == "spatial"
    default: dict[str, object] = {"orientation": (0.0, 0.0, 0.0)} if spatial else {}
    springs = items(tree, "mechanism", "springs")
    return {n: {**default, **b} if isinstance(b, Mapping) else b for n, b in springs}


def _links(tree: Tree, folder: Path, findings: list[Finding]) -> dict[str, object]:
    """Links with the files of superelements as absolute paths."""
    changed: dict[str, object] = {}
    for name, body in items(tree, "mechanism", "links"):
        changed[name] = body
        if isinstance(body, Mapping) and kind_of(body) == "superelement":
            path = ("mechanism", "links", name)
            files = {
                key: found(text(body, key), folder, (*path, key), findings)
                for key in ("stiffness", "mass")
                if text(body, key) is not None
            }
            changed[name] = {**body, **files}
    return changed


def found(
    file: str | None, folder: Path, path: KeyPath, findings: list[Finding], hint: str = ""
) -> str:
    """The absolute path of ``file``; a finding, with a ``hint``, if there is no such file."""
    absolute = os.path.abspath(folder / (file or ""))
    if not os.path.isfile(absolute):
        named = absolute if absolute.isprintable() else ascii(absolute)
        findings.append((path, f"no such file: {named}{hint}"))
    return absolute


def _assembly(tree: Tree, findings: list[Finding]) -> dict[str, object]:
    path: KeyPath = ("mechanism", "assembly")
    changed: dict[str, object] = {}
    given = at(tree, "mechanism", "assembly")
    if isinstance(at(given, "at"), Mapping):
        changed["at"] = {
            name: si(
                value,
                of_freedom(driven(tree, at(tree, "coordinates", name))),
                (*path, "at", name),
                findings,
            )
            for name, value in items(given, "at")
        }
    if isinstance(at(given, "guess"), Mapping):
        changed["guess"] = {
            joint: _guess(tree, joint, value, (*path, "guess", joint), findings)
            for joint, value in items(given, "guess")
        }
    return changed


def _guess(tree: Tree, joint: str, value: object, path: KeyPath, findings: list[Finding]) -> object:
    kinds = [of_freedom(freedom) for freedom in freedoms(tree, joint) or ()]
    if not isinstance(value, tuple):
        return si(value, kinds[0] if len(kinds) == 1 else ANY, path, findings)
    kinds += [ANY] * len(value)
    return tuple(si(v, kinds[k], (*path, k), findings) for k, v in enumerate(value))
