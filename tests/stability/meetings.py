"""Two cantilevers whose first modes meet as the modulus of one passes that of the other."""

from typing import Any

import numpy as np
from chains import Tree, model_of
from spatial_cases import linkage

from eigassign.modal import Model

E_ONE, E_LOW, E_HIGH = 70e9, 60e9, 80e9


def two_bars(stub: float | None = None, stiffer: float = 1.0) -> Model:
    """Two equal bars on the ground, or both at the end of a stiff stub of that length (m).

    On the ground they know nothing of each other: an exact crossing. The stub couples them, the
    more the longer it is: a veering. Its modulus is that of the bars, or so many times as
    ``stiffer``. The design parameter E is the second bar's modulus.
    """
    bar: dict[str, Any] = {"length": 0.5, "section": "rod", "elements": 3}
    tree: Tree = linkage(
        {"one": {**bar, "material": "a"}, "two": {**bar, "material": "b"}},
        {
            "j1": {"type": "fixed", "base": "ground", "follower": "one.start"},
            "j2": {"type": "fixed", "base": "ground", "follower": "two.start"},
        },
        sections={"rod": {"area": 3e-4, "bending_inertia": 8e-9}},
        materials={
            "a": {"youngs_modulus": E_ONE, "density": 2700.0},
            "b": {"youngs_modulus": E_ONE, "density": 2700.0},
        },
    ) | {"design": {"E": {"parameter": "materials.b.youngs_modulus", "min": E_LOW, "max": E_HIGH}}}
    if stub is not None:
        _mount(tree["mechanism"], stub, stiffer)
    return model_of(tree)


def _mount(mechanism: Tree, stub: float, stiffer: float) -> None:
    mechanism["materials"]["c"] = {"youngs_modulus": stiffer * E_ONE, "density": 2700.0}
    mechanism["sections"]["stiff"] = {"area": 3e-2, "bending_inertia": 8e-6}
    block = {"length": stub, "material": "c", "section": "stiff", "elements": 1}
    mechanism["links"]["stub"] = block
    for name in ("j1", "j2"):
        mechanism["joints"][name]["base"] = "stub.end"
    mechanism["joints"]["j2"]["angle"] = 1.0
    mechanism["joints"]["j0"] = {"type": "fixed", "base": "ground", "follower": "stub.start"}


def line(count: int) -> np.ndarray:
    """x = (E,) from below the meeting to above it, (count, 1)."""
    return np.linspace(E_LOW, E_HIGH, count)[:, None]
