"""Mechanisms whose tip follows a path while design parameters move it, and extrapolated slopes."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from chains import bar, case_of, two_link
from yaml import safe_load

from eigassign import Case

CASES = Path(__file__).parents[2] / "cases"


def lengths(**links: str) -> dict[str, Any]:
    """Design parameters that are lengths of links."""
    return {
        name: {"parameter": f"links.{link}.length", "min": 0.01, "max": 2.0}
        for name, link in links.items()
    }


def two_link_lengths(branch: tuple[float, float] = (3.2, 5.2)) -> Case:
    """The paper's arm on its path, with both lengths and the mass at the elbow as parameters."""
    tree = two_link()
    waypoints = [[0.33, 0.12], [0.30, 0.19], [0.108, 0.2104], [0.02, 0.1845], [-0.01, 0.19]]
    tree["trajectory"] = {
        "tip": "fore.end",
        "waypoints": waypoints,
        "samples": 24,
        "branch": {"elbow": list(branch)},
    }
    mass = {"parameter": "bodies.elbow_mass.mass", "min": 0.0, "max": 0.25}
    return case_of(tree | {"design": {**lengths(a="upper"), "m": mass, **lengths(b="fore")}})


def box(parameter: str, low: float, high: float) -> dict[str, Any]:
    return {"parameter": parameter, "min": low, "max": high}


def shipped(name: str, trajectory: dict[str, Any], **design: dict[str, Any]) -> Case:
    """A shipped mechanism with another trajectory and design."""
    tree = safe_load((CASES / f"{name}.yaml").read_text(encoding="utf-8"))
    tree = {key: tree[key] for key in ("mechanism", "coordinates")}
    return case_of(tree | {"trajectory": trajectory, "design": design})


TIPS: dict[str, dict[str, Any]] = {
    "five_bar": {"tip": "left_arm.end", "waypoints": [[0.05, 0.5], [0.1, 0.48], [0.15, 0.5]]},
    "arm_6r": {
        "tip": "hand.end",
        "waypoints": [[0.75, -0.2, 0.6], [0.8, 0.1, 0.7], [0.7, 0.3, 0.65]],
        "orientation": [0, "20 deg", 0],
        "start": [-0.2, 0.9, -1.4, 0.2, -0.6, 0.4],
    },
}
SIDES = {
    "left": box("links.left_arm.length", 0.3, 0.4),
    "right": box("links.right_crank.length", 0.2, 0.3),
}


def six_joints() -> Case:
    """The 6R arm, its hand held level, with the length of a beam and of a rigid link."""
    return shipped(
        "arm_6r",
        TIPS["arm_6r"] | {"samples": 12},
        upper=box("links.upper_arm.length", 0.6, 0.8),
        wrist=box("links.wrist.length", 0.05, 0.1),
        m=box("bodies.payload.mass", 3, 6),
    )


def five_bar() -> Case:
    """Two cranks and two forearms that meet at the tool: lengths on both sides of the loop."""
    mass = box("bodies.tool.mass", 0.3, 0.5)
    return shipped("five_bar", TIPS["five_bar"] | {"samples": 12}, **SIDES, m=mass)


def five_bar_in_joints() -> Case:
    """The same with its cranks' angles given: only what closes the loop follows the design."""
    q = [["126 deg", "68 deg"], ["120 deg", "62 deg"], ["114 deg", "56 deg"]]
    return shipped("five_bar", {"q": q, "duration": 1.0}, **SIDES)


def slider_crank() -> Case:
    """One coordinate that moves the slider; the rod's length moves it the same way."""
    path = {"tip": "slider.start", "waypoints": [[0.54, 0], [0.45, 0]], "start": ["60 deg"]}
    return shipped("slider_crank", path | {"samples": 12}, rod=box("links.rod.length", 0.4, 0.5))


def cart(path: list[list[float]], leaning: bool = False, **more: Any) -> Case:
    """A bar on a cart, upright for good, or leaning as its drive tells it.

    The cart alone can bring back no change of the bar's length. Leaning, the bar keeps its angle
    along a level path, and another one with another length.
    """
    tree = bar(2, 0.5, 70e9, 2700.0, {"shape": "circle", "diameter": 0.02})
    tree["mechanism"]["links"]["cart"] = {"type": "rigid", "mass": 1.0}
    kind = "revolute" if leaning else "fixed"
    tree["mechanism"]["joints"] = {
        "rail": {"type": "prismatic", "base": "ground", "follower": "cart.start", "axis": [1, 0]},
        "root": {"type": kind, "base": "cart.start", "follower": "bar.start", "angle": "90 deg"},
    }
    tree["coordinates"] = {"q1": {"joint": "rail"}}
    if leaning:
        tree["coordinates"]["q2"] = {"joint": "root", "drive": {"stiffness": 3000.0}}
    tree["trajectory"] = {"tip": "bar.end", "waypoints": path, "path": "straight", "samples": 5}
    order = {"expansion": {"order": 2}}
    design = {"h": {"parameter": "links.bar.length", "min": 0.45, "max": 0.55}}
    return case_of(tree | order | {"design": design} | more)


def extrapolated(f: Callable[[np.ndarray], np.ndarray], y: np.ndarray, h: float) -> np.ndarray:
    """∂f/∂y (…, n_y) by central differences of three steps, extrapolated to the sixth order."""
    slopes = []
    for direction in np.eye(len(y)):
        rows = []
        for step in (h, h / 2.0, h / 4.0):
            rows.append((f(y + step * direction) - f(y - step * direction)) / (2.0 * step))
        first = [(4.0 * b - a) / 3.0 for a, b in pairwise(rows)]
        slopes.append((16.0 * first[1] - first[0]) / 15.0)
    return np.stack(slopes, axis=-1)
