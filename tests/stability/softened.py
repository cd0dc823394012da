"""Shipped mechanisms whose stiffness moves with the pose, softened over decades.

As ``calibration.draw``: carriages, a nut, drives in loops and springs between links; designs make
sections, moduli, springs and drives up to a thousand times softer.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import yaml
from calibration import Drawn

import eigassign as ea
from eigassign.case import read_quantity
from eigassign.errors import EigassignError

CASES = Path(__file__).parents[2] / "cases"
NAMES = (
    "ball_screw", "gantry", "five_bar", "milling_column", "luffing_boom", "palletiser", "six_bar",
    "slider_crank", "scissor_lift", "pick_and_place", "four_bar", "arm_3r",
)  # fmt: skip
DECADES = {"height": 0.75, "width": 0.75, "diameter": 0.75}  # of others 3: EI falls to 1/1000
KEYS = ("height", "width", "diameter", "youngs_modulus", "rotational", "translational", "stiffness")
Tree = dict[str, Any]


def draw(seed: int, samples: int) -> Drawn | None:
    """One case with one to three parameters of its stiffness; None where it cannot be drawn."""
    rng = np.random.default_rng([seed, 11])
    text = (CASES / f"{NAMES[seed % len(NAMES)]}.yaml").read_text()
    case = {k: yaml.safe_load(text)[k] for k in ("title", "mechanism", "coordinates", "trajectory")}
    if rng.random() < 0.6:
        _tie(case["mechanism"], rng)
    found = _stiffnesses(case)
    chosen = [found[k] for k in rng.permutation(len(found))[: rng.integers(1, 4)]]
    decades = np.array([DECADES.get(path.rpartition(".")[2], 3.0) for path, _ in chosen])
    as_written = np.array([value for _, value in chosen])
    low, high = as_written * 10.0**-decades, as_written * 10.0 ** (decades / 6.0)
    case["design"] = {
        f"y{k}": {"parameter": path, "min": float(low[k]), "max": float(high[k])}
        for k, (path, _) in enumerate(chosen)
    }
    share = rng.uniform(-1.0, 1.0 / 6.0, (samples, len(chosen)))
    if seed % 3 == 0:  # all parts alike
        share = -rng.choice([1 / 3, 2 / 3, 1.0], (samples, 1))
    try:
        built = ea.load_case(case)
        path = built.trajectory.q
        k, part = rng.integers(0, len(path) - 1, samples), rng.random((samples, 1))
        return Drawn(
            seed=seed,
            model=built.model(),
            q0=path[rng.integers(len(path))],
            y0=as_written if rng.random() < 0.7 else 0.5 * (low + high),
            q=path[k] * (1.0 - part) + path[k + 1] * part,
            y=as_written * 10.0 ** (share * decades),
            modes=tuple(range(1, 1 + int(rng.integers(1, 4)))),
            half_order=int(rng.integers(1, 4)),
        )
    except EigassignError:
        return None


def _tie(mechanism: Tree, rng: np.random.Generator) -> None:
    """A spring between two links, or a link and the ground."""
    links = mechanism["links"]
    ends = [
        f"{n}.start" if link.get("type") == "rigid" else f"{n}.end" for n, link in links.items()
    ]
    kind = "rotational" if rng.random() < 0.5 else "translational"
    tied = rng.choice([*ends, "ground"], 2, replace=False).tolist()
    tied.sort(key="ground".__eq__)
    spring = {"between": tied, kind: float(10.0 ** rng.uniform(2.0, 5.0))}
    mechanism.setdefault("springs", {})["tie"] = spring


def _stiffnesses(case: Tree) -> list[tuple[str, float]]:
    """Paths and values in SI of what makes the mechanism stiff."""
    parts: Tree = {k: case["mechanism"].get(k, {}) for k in ("sections", "materials", "springs")}
    parts["coordinates"] = {
        n: {"drive": c["drive"]} for n, c in case["coordinates"].items() if _is_elastic(c)
    }
    return [
        (path, read_quantity(value, None))
        for path, value in _leaves(parts)
        if path.rpartition(".")[2] in KEYS
    ]


def _is_elastic(coordinate: Tree) -> bool:
    return isinstance(coordinate.get("drive"), dict) and "stiffness" in coordinate["drive"]


def _leaves(tree: Tree, path: str = "") -> list[tuple[str, Any]]:
    found = []
    for name, value in tree.items():
        own = f"{path}.{name}" if path else str(name)
        found += _leaves(value, own) if isinstance(value, dict) else [(own, value)]
    return found
