"""Shear, torsion and sections against closed forms and exact transfer matrices."""

from types import SimpleNamespace as Given
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq
from spatial_cases import built, linkage
from spatial_oracle import Tree

from eigassign.mechanism import section_values

E, NU, RHO = 210e9, 0.3, 7800.0
G = E / (2 + 2 * NU)
B, H = 0.05, 0.1
A, I, KAPPA = B * H, B * H**3 / 12, 5 / 6  # noqa: E741


def bar(length: float, n: int, space: str = "planar", **beam: Any) -> Tree:
    """One beam clamped to the ground; H lies in the plane."""
    link = {"length": length, "elements": n, "section": "s", "material": "m", **beam}
    return linkage(
        {"bar": link},
        {"root": {"type": "fixed", "base": "ground", "follower": "bar.start"}},
        section={"shape": "rectangle", "width": B, "height": H},
        material={"youngs_modulus": E, "density": RHO, "poissons_ratio": NU},
        space=space,
    )


def pinned(tree: Tree) -> Tree:
    """The same on two pins."""
    tree["mechanism"]["joints"] = {
        "left": {"type": "revolute", "base": "ground", "follower": "bar.start"},
        "right": {"type": "revolute", "base": "ground", "follower": "bar.end",
                  "position": [tree["mechanism"]["links"]["bar"]["length"], 0.0]},
    }  # fmt: skip
    return tree


def omega(tree: Tree, count: int) -> np.ndarray:
    return np.sqrt(built(tree).lam([], count))


def pinned_timoshenko(n: int, length: float, shear: float, rotary: float) -> float:
    """Lower root of EI k⁴ − (ρA + ρI k² + ρA EI k²/κGA) λ + ρI ρA/κGA λ² = 0 (Huang 1961)."""
    k = n * np.pi / length
    mass = RHO * A
    a = rotary * mass * shear
    b = mass + rotary * k**2 + mass * E * I * k**2 * shear
    c = E * I * k**4
    root = np.sqrt(b * b - 4 * a * c)
    return float(np.sqrt(2 * c / (b + root)))


@pytest.mark.parametrize("length", [0.4, 1.0, 4.0])
def test_a_short_pinned_beam_has_the_timoshenko_frequencies(length: float) -> None:
    found = omega(pinned(bar(length, 60, shear=True)), 12)
    shear = 1 / (KAPPA * G * A)
    for n in (1, 2, 3):
        exact = pinned_timoshenko(n, length, shear, RHO * I)
        # shear-flexible elements of length h err by (k h)² where the beam is short
        assert np.abs(found / exact - 1.0).min() < (n * np.pi / 60) ** 2 / 40, n


def test_the_error_of_shear_elements_falls_with_the_mesh() -> None:
    exact = pinned_timoshenko(1, 0.4, 1 / (KAPPA * G * A), RHO * I)
    error = [abs(omega(pinned(bar(0.4, n, shear=True)), 1)[0] / exact - 1) for n in (4, 8, 16)]
    assert error[0] / error[1] > 3.5
    assert error[1] / error[2] > 3.5


def test_without_shear_flexibility_the_rotary_inertia_remains() -> None:
    tree = pinned(bar(0.5, 40, shear=True))
    material = tree["mechanism"]["materials"]["m"]
    del material["poissons_ratio"]
    material["shear_modulus"] = 1e18
    exact = pinned_timoshenko(1, 0.5, 0.0, RHO * I)  # Rayleigh's beam
    assert omega(tree, 1)[0] == pytest.approx(exact, rel=1e-6)
    assert exact < 0.99 * pinned_timoshenko(1, 0.5, 0.0, 0.0)


def transfer(lam: float, length: float) -> float:
    """Exact clamped-free condition: det of (M, Q) at the end per (M, Q) at the clamp.

    w' = θ + Q/κGA, θ' = M/EI, M' = −Q − ρI λ θ, Q' = −ρA λ w.
    """
    system = np.zeros((4, 4))
    system[0, 1], system[0, 3] = 1.0, 1 / (KAPPA * G * A)
    system[1, 2] = 1 / (E * I)
    system[2, 3], system[2, 1] = -1.0, -RHO * I * lam
    system[3, 0] = -RHO * A * lam
    return float(np.linalg.det(expm(system * length)[2:, 2:]))


@pytest.mark.parametrize("length", [0.3, 0.8])
def test_a_short_cantilever_has_the_exact_timoshenko_frequencies(length: float) -> None:
    lam = omega(bar(length, 80, shear=True), 8) ** 2
    roots = []
    for value in lam:
        low, high = (transfer(value * s, length) for s in (0.998, 1.002))
        if low * high < 0:
            roots.append(brentq(transfer, 0.998 * value, 1.002 * value, args=(length,)) / value)
    assert len(roots) >= 3  # the others are axial
    np.testing.assert_allclose(roots[:3], 1.0, atol=4e-4)


def test_shear_acts_in_both_planes_of_a_spatial_beam() -> None:
    flat = omega(bar(0.4, 6, shear=True), 3)
    deep = omega(bar(0.4, 6, "spatial", shear=True), 12)
    turned = bar(0.4, 6, "spatial", shear=True)
    turned["mechanism"]["sections"]["s"] = {"shape": "rectangle", "width": H, "height": B}
    for w in flat:
        assert np.abs(deep / w - 1).min() < 1e-9
    np.testing.assert_allclose(omega(turned, 8), deep[:8], rtol=1e-9)


# Torsion and stretch


def linear_chain(c: float, length: float, n: int, k: int) -> float:
    """Free-free mode k of n linear elements with consistent mass, exactly."""
    h = length / n
    angle = k * np.pi / n
    return float(c / h * np.sqrt(6 * (1 - np.cos(angle)) / (2 + np.cos(angle))))


@pytest.mark.parametrize("n", [8, 24])
def test_a_shaft_free_to_spin_rings_at_multiples_of_c_over_2l(n: int) -> None:
    length = 2.0
    tree = bar(length, n, "spatial")
    tree["mechanism"]["sections"]["s"] = {"shape": "circle", "diameter": 0.06}
    tree["mechanism"]["joints"]["root"] |= {"type": "revolute", "axis": [1.0, 0.0, 0.0]}
    tree["coordinates"] = {"spin": {"joint": "root"}}
    model = built(tree)
    found = np.sqrt(model.lam([0.0], model.n_elastic))
    c = np.sqrt(G / RHO)
    for k in (1, 2, 3):
        assert np.abs(found / linear_chain(c, length, n, k) - 1).min() < 1e-8
        nearest = found[np.abs(found / linear_chain(c, length, n, k) - 1).argmin()]
        # (k h)²/24 of the exact c/2L multiple
        assert nearest == pytest.approx(k * np.pi * c / length, rel=(k * np.pi / n) ** 2 / 20)


def test_a_rod_rings_along_itself_at_odd_multiples_of_c_over_4l() -> None:
    found = omega(bar(2.0, 32), 24)
    for k in (1, 3, 5):
        exact = k * np.pi / 2 * np.sqrt(E / RHO) / 2.0
        assert np.abs(found / exact - 1).min() < (k * np.pi / 64) ** 2 / 20


# Sections


def plain(_: str, value: float) -> float:
    return value


def values(**section: Any) -> Any:
    return section_values(Given(**section), plain)


def test_an_i_profile_has_the_tabulated_values_of_an_ipe_200_without_its_fillets() -> None:
    # Arcelor tables: A 28.5 cm², I_y 1943, I_z 142 cm⁴, fillet r = 12 mm
    found = values(
        shape="i_profile", height=0.2, width=0.1, flange_thickness=0.0085, web_thickness=0.0056
    )
    r, spandrel = 0.012, (4 - np.pi) * 0.012**2
    arm = 0.1 - 0.0085 - r * (10 - 3 * np.pi) / (12 - 3 * np.pi)  # centroid of a spandrel
    assert found.area + spandrel == pytest.approx(28.5e-4, rel=1e-3)
    assert found.inertia_z + spandrel * arm**2 == pytest.approx(1943e-8, rel=2e-3)
    assert found.inertia_y == pytest.approx(142e-8, rel=5e-3)
    thin = (2 * 0.1 * 0.0085**3 + 0.183 * 0.0056**3) / 3
    assert found.torsion_constant == pytest.approx(thin)
