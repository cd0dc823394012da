"""Beams whose section varies, against the equations of motion integrated along them."""

import math
from typing import Any

import numpy as np
import pytest
from spatial_cases import built, linkage
from spatial_oracle import Tree
from tapered_cantilever import Values, frequency_beside

E, G, RHO, LENGTH = 70e9, 27e9, 2700.0, 1.0
ROUND = {"shape": "circle", "diameter": 0.010}, {"shape": "circle", "diameter": 0.002}
STOCKY = {"shape": "circle", "diameter": 0.30}, {"shape": "circle", "diameter": 0.10}
LYING = (
    {"shape": "rectangle", "width": 0.10, "height": 0.20},
    {"shape": "rectangle", "width": 0.06, "height": 0.04},
)


def bar(n: int, ends: Any, space: str = "planar", **beam: Any) -> Tree:
    """One beam clamped to the ground, from one section to another."""
    link = {"length": LENGTH, "elements": n, "section": {"start": "a", "end": "b"}, "material": "m"}
    return linkage(
        {"bar": {**link, **beam}},
        {"root": {"type": "fixed", "base": "ground", "follower": "bar.start"}},
        sections=dict(zip("ab", ends, strict=True)),
        material={"youngs_modulus": E, "density": RHO, "shear_modulus": G},
        space=space,
    )


def hz(tree: Tree, count: int) -> np.ndarray:
    return np.sqrt(built(tree).lam([0.0] * len(tree["coordinates"]), count)) / (2.0 * np.pi)


def exact(ends: Any, about: float, shear: bool) -> float:
    """The frequency near ``about`` of the beam itself, bending in its plane."""

    def at(x: np.ndarray) -> Values:
        a, b = ends
        size = {k: v + (b[k] - v) * x / LENGTH for k, v in a.items() if k != "shape"}
        if "diameter" in size:
            area, second = np.pi * size["diameter"] ** 2 / 4, np.pi * size["diameter"] ** 4 / 64
            kappa = 0.9
        else:
            area = size["width"] * size["height"]
            second, kappa = area * size["height"] ** 2 / 12, 5 / 6
        on = float(shear)
        return Values(E * second, RHO * area, on / (kappa * G * area), on * RHO * second)

    return frequency_beside(at, LENGTH, about)


@pytest.mark.parametrize(
    ("ends", "shear", "stated"),
    [
        (ROUND, False, (6e-5, 2.1e-3, 1.5e-2)),
        (ROUND, True, (6.1e-5, 2.1e-3, 1.5e-2)),
        (STOCKY, True, (5e-4, 8e-3)),
        (LYING, False, (6e-5, 1.8e-3, 1.4e-2)),
        (LYING, True, (3e-4, 6e-3, 2.7e-2)),
    ],
)
def test_four_elements_are_as_near_as_stated_and_never_too_low(
    ends: Any, shear: bool, stated: tuple[float, ...]
) -> None:
    for value, most in zip(hz(bar(4, ends, shear=shear), len(stated)), stated, strict=True):
        assert 0.0 < value / exact(ends, value, shear) - 1.0 < most


def test_bending_converges_with_the_fourth_power_of_the_element() -> None:
    true = exact(LYING, hz(bar(16, LYING), 1)[0], shear=False)
    error = [hz(bar(n, LYING), 1)[0] / true - 1.0 for n in (16, 32, 64)]
    assert math.log2(error[0] / error[1]) == pytest.approx(4.0, abs=0.25)
    assert math.log2(error[1] / error[2]) == pytest.approx(4.0, abs=0.15)


def test_with_shear_it_converges_with_the_square() -> None:
    true = exact(STOCKY, hz(bar(16, STOCKY, shear=True), 1)[0], shear=True)
    error = [hz(bar(n, STOCKY, shear=True), 1)[0] / true - 1.0 for n in (8, 16, 32)]
    assert math.log2(error[0] / error[1]) == pytest.approx(2.0, abs=0.15)
    assert math.log2(error[1] / error[2]) == pytest.approx(2.0, abs=0.15)


def test_a_full_wedge_approaches_kirchhoffs_frequency() -> None:
    # linear depth down to a point, constant width: ω = 5.315 h/(2 L²) √(E/3ρ) (Kirchhoff 1879)
    wedge = [{"shape": "rectangle", "width": 0.05, "height": h} for h in (0.1, 1e-5)]
    omega = 5.315 * 0.05 / LENGTH**2 * np.sqrt(E / (3 * RHO))
    assert hz(bar(16, wedge), 1)[0] * 2.0 * np.pi == pytest.approx(omega, rel=2e-4)


def test_a_mesh_of_any_size_has_the_whole_mass() -> None:
    mass = RHO * np.pi / 12 * (0.01**2 + 0.01 * 0.002 + 0.002**2)
    for n in (1, 3):
        tree = bar(n, ROUND)
        tree["mechanism"]["joints"]["root"]["type"] = "prismatic"
        tree["coordinates"] = {"q": {"joint": "root", "drive": {"stiffness": 1.0}}}
        assert hz(tree, 1)[0] == pytest.approx(np.sqrt(1.0 / mass) / (2.0 * np.pi), rel=1e-4)


def test_the_torsion_of_a_tapering_rectangle_converges() -> None:
    # from lying to standing: Saint-Venant's constant is no polynomial on the way
    ends = [
        {"shape": "rectangle", "width": b, "height": h} for b, h in ((0.06, 0.02), (0.02, 0.05))
    ]
    spin = {"type": "revolute", "base": "ground", "follower": "bar.start", "axis": [1.0, 0.0, 0.0]}

    def twist(n: int) -> float:
        tree = bar(n, ends, "spatial")
        tree["mechanism"]["joints"]["root"] = spin
        rotor = {"at": "bar.end", "mass": 0.0, "inertia": [9.0, 0.0, 0.0, 0.0, 0.0, 0.0]}
        tree["mechanism"]["bodies"] = {"rotor": rotor}
        tree["coordinates"] = {"q": {"joint": "root", "drive": {"stiffness": 1e9}}}
        return float(np.sqrt(built(tree).lam([0.0], 1)[0]))

    def torsion(s: float) -> float:
        long, short = sorted((0.06 - 0.04 * s, 0.02 + 0.03 * s), reverse=True)
        n = np.arange(1, 40, 2)
        series = np.sum(np.tanh(n * np.pi * long / (2 * short)) / n**5)
        return float(long * short**3 * (1 / 3 - 64 / np.pi**5 * short / long * series))

    s, w = np.polynomial.legendre.leggauss(40)
    compliance = sum(0.5 * w * [1.0 / (G * torsion(0.5 + 0.5 * t)) for t in s]) * LENGTH + 1e-9
    errors = [twist(n) / np.sqrt(1.0 / (compliance * 9.0)) - 1.0 for n in (4, 8, 16)]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.2)
    assert abs(errors[2]) < 2e-3
