"""Mechanisms for tests in the language of a case file, and what is built from them."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import SimpleNamespace as Given
from typing import Any

import numpy as np

from eigassign.mechanism.build import build_pencil
from eigassign.mechanism.kinematics import Kinematics, kinematics
from eigassign.mechanism.parameters import Parameters, initial_design, parameters
from eigassign.mechanism.pencil import Pencil
from eigassign.mechanism.poses import Poses, build_poses
from eigassign.modal.exact import eigenvalues

Tree = dict[str, Any]
STEEL = {"youngs_modulus": 210e9, "density": 7850.0, "poissons_ratio": 0.3}
ALLOY = {"youngs_modulus": 70e9, "density": 2700.0, "shear_modulus": 26e9}
DEFAULTS: dict[str, Tree] = {
    "materials": {"poissons_ratio": None, "shear_modulus": None},
    "sections": {
        "shape": "bare", "bending_inertia": None, "inertia_z": None, "inertia_y": None,
        "torsion_constant": None, "polar_inertia": None, "shear_coefficient": None,
        "inner_diameter": None, "thickness": None,
    },
    "links": {"type": "beam"},
    "joints": {"position": (0.0, 0.0, 0.0), "axis": None},
    "bodies": {"mass": 0.0, "inertia": 0.0, "offset": None},
    "springs": {"translational": 0.0, "rotational": 0.0},
}  # fmt: skip


def case_of(tree: Tree, path: Path = Path("test.yaml")) -> Any:
    """The case of a tree, as the mechanism layer reads it."""
    m = tree["mechanism"]
    groups = {
        group: {name: given(data, DEFAULTS[group]) for name, data in m.get(group, {}).items()}
        for group in DEFAULTS
    }
    if m["space"] == "planar":
        for joint in groups["joints"].values():
            joint.angle = getattr(joint, "angle", 0.0)
    assembly = m.get("assembly")
    mechanism = Given(
        space=m["space"],
        assembly=Given(**{"at": {}, "guess": {}, **assembly}) if assembly else None,
        **groups,
    )
    drives = {"drive": "free", "angle": "relative", "component": None}
    coordinates = {n: given(d, drives) for n, d in tree["coordinates"].items()}
    design = {n: Given(**d) for n, d in tree.get("design", {}).items()}
    return Given(
        mechanism=mechanism,
        coordinates=coordinates,
        design=Given(parameters=design),
        expansion=Given(q="auto"),
        path=path,
    )


def given(data: Tree, defaults: Tree) -> Given:
    if data.get("type") == "rigid":
        defaults = {"length": None, "nodes": {}, "mass": 0.0, "inertia": 0.0, "center": None}
    data = {**defaults, **data}
    for key in ("section", "drive"):
        if isinstance(data.get(key), dict):
            data[key] = Given(**data[key])
    if "beams" in data:
        data["beams"] = {k: beam(v) for k, v in data["beams"].items()}
    if data.get("type") == "superelement":
        data["nodes"] = {k: Given(**v) for k, v in data["nodes"].items()}
    return Given(**data)


def beam(data: Tree) -> Given:
    rest = {k: v for k, v in data.items() if k not in ("from", "to")}
    return Given(from_node=data["from"], to_node=data["to"], **{"elements": 1, **rest})


@dataclass(frozen=True)
class Built:
    """A case with everything the mechanism layer makes of it."""

    case: Any
    numbers: Parameters
    motion: Kinematics

    @cached_property
    def pencil(self) -> Pencil:
        return build_pencil(self.case, self.numbers, self.motion)

    @cached_property
    def poses(self) -> Poses:
        return build_poses(self.case, self.numbers, self.motion)

    @cached_property
    def y(self) -> np.ndarray:
        return initial_design(self.case)

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
    case = case_of(tree, path)
    numbers = parameters(case)
    return Built(case, numbers, kinematics(case, numbers))


def changed(tree: Tree, path: str, value: Any) -> Tree:
    """A copy with the number at a key path of the mechanism (or a drive) replaced."""
    out = copy.deepcopy(tree)
    at = out if path.startswith("coordinates.") else out["mechanism"]
    *keys, last = path.split(".")
    for key in keys:
        at = at[key]
    at[last] = value
    return out
