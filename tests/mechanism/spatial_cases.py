"""Mechanisms for tests in the language of a case file, and what is built from them."""

import copy
import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from eigassign import Case
from eigassign.case import CaseFile, parse
from eigassign.mechanism import Pencil, build_link_frames, build_pencil, erls_motion, parameters
from eigassign.modal import eigenvalues

Tree = dict[str, Any]
CASES = Path(__file__).parents[2] / "cases"
STEEL = {"youngs_modulus": 210e9, "density": 7850.0, "poissons_ratio": 0.3}
ALLOY = {"youngs_modulus": 70e9, "density": 2700.0, "shear_modulus": 26e9}

ROD = {"shape": "circle", "diameter": 0.02}


def linkage(
    links: Tree,
    joints: Tree,
    coordinates: Tree | None = None,
    section: Tree = ROD,
    material: Tree = ALLOY,
    **more: Any,
) -> Tree:
    """A planar mechanism of a material m and a section s, where ``more`` does not say otherwise."""
    own: Tree = {"space": "planar", "materials": {"m": {**material}}}
    own |= {"sections": {"s": {**section}}, "links": links, "joints": joints}
    return {"mechanism": own | more, "coordinates": coordinates or {}}


def case_of(tree: Tree, path: Path = Path("test.yaml")) -> CaseFile:
    """The case of a tree as a case file would hold it (JSON is YAML)."""
    return parse(json.dumps({"title": "test", **tree}).encode(), path)


@dataclass(frozen=True)
class Built:
    """A case with everything the mechanism layer makes of it."""

    case: CaseFile
    numbers: Any  # its variables
    motion: Any  # its rigid links

    @cached_property
    def pencil(self) -> Pencil:
        return build_pencil(self.case, self.numbers, self.motion)

    @cached_property
    def poses(self) -> Any:
        return build_link_frames(self.case, self.numbers, self.motion)

    @cached_property
    def y(self) -> np.ndarray:
        return Case(self.case).initial_design

    def x(self, q: Any) -> np.ndarray:
        q = np.atleast_2d(np.asarray(q, float))
        return np.hstack([q, np.broadcast_to(self.y, (len(q), len(self.y)))])

    def lam(self, q: Any, count: int) -> np.ndarray:
        """λ (count,) at one q and the design of the case."""
        return eigenvalues(self.pencil, self.x(q), count)[0]

    @property
    def n_elastic(self) -> int:
        return len(self.pencil.elastic)


def built(tree: Tree, path: Path = Path("test.yaml")) -> Built:
    return of_case(case_of(tree, path))


def of_case(case: CaseFile) -> Built:
    numbers = parameters(case)
    return Built(case, numbers, erls_motion(case, numbers))


def shipped(name: str, *changes: tuple[str, str]) -> Built:
    """A shipped case with some of its text replaced."""
    text = (CASES / f"{name}.yaml").read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return of_case(parse(text.encode(), CASES / f"{name}.yaml"))


def changed(tree: Tree, path: str, value: Any) -> Tree:
    """A copy with the number at a key path of the mechanism (or a drive) replaced."""
    out = copy.deepcopy(tree)
    at = out if path.startswith("coordinates.") else out["mechanism"]
    *keys, last = path.split(".")
    for key in keys:
        at = at[key]
    at[int(last) if isinstance(at, list) else last] = value
    return out
