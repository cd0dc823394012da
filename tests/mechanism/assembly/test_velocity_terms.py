"""The velocity terms: spin softening, symmetry, the mass matrix from B, and Coriolis coupling."""

from typing import Any

import numpy as np
import pytest
from spatial_cases import ALLOY, Built, built, linkage
from spatial_examples import arm3r, four_bar, gantry, slider_crank
from spatial_oracle import Tree
from spatial_random import random_closed, random_open
from timed_motions import timed

from eigassign.mechanism import velocity_terms
from eigassign.modal import motion_effect

NONE = np.zeros(0)


def terms(model: Built) -> Any:
    return velocity_terms(model.case, model.numbers, model.motion)


def at(model: Built, q: Any, rate: Any, acceleration: Any) -> tuple[np.ndarray, np.ndarray]:
    numbers = (np.asarray(v, float) for v in (rate, acceleration))
    C, K = terms(model).at(np.asarray(q, float), NONE, *numbers)
    return C.toarray(), K.toarray()


def matrices(model: Built, q: Any) -> tuple[np.ndarray, np.ndarray]:
    K, M = model.pencil.matrices(model.pencil.theta(model.x(q)))
    return K[0], M[0]


def blade(elements: int, space: str = "planar", drive: str = "locked") -> Tree:
    """A beam that turns about its root; its area is so large that it hardly stretches."""
    stiff = {"area": 5e-4, "inertia_z": 1e-9, "inertia_y": 4e-9, "torsion_constant": 4e-9}
    if space == "planar":
        stiff = {"area": 5e-4, "bending_inertia": 1e-9}
    return linkage(
        {"b": {"length": 1.0, "elements": elements, "material": "m", "section": "s"}},
        {"r": {"type": "revolute", "base": "ground", "follower": "b.start"}},
        {"q": {"joint": "r", "drive": drive}},
        section=stiff,
        space=space,
    )


def softened(model: Built, rate: float) -> np.ndarray:
    K, M = matrices(model, [0.3])
    _, K_v = at(model, [0.3], [rate], [0.0])
    lam = np.linalg.eigvals(np.linalg.solve(M, K + K_v))
    return np.sort(lam.real)


@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_a_rotating_cantilever_softens_by_the_square_of_its_spin_in_its_plane(space: str) -> None:
    """Without stretch and Coriolis coupling (M + K_v/K alone): λ = ω² − Ω² exactly in the plane.

    Ω acts on nodal values, so that the elements' slopes leave an error of h².
    """
    spin, errors = 8.0, []
    for n in (2, 4, 8):
        model = built(blade(n, space))
        still = model.lam([0.3], 3)
        moved = softened(model, spin)
        errors.append(abs(moved[0] - (still[0] - spin**2)) / spin**2)
    assert errors[-1] < 2e-2
    assert errors[1] < errors[0] / 3
    assert errors[2] < errors[1] / 3


def test_bending_across_the_plane_of_rotation_does_not_soften() -> None:
    model = built(blade(6, "spatial"))
    still = model.lam([0.3], 2)
    moved = softened(model, 8.0)
    assert np.abs(moved / still[1] - 1).min() < 1e-4  # softening would be Ω²/ω² = 2e-2


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_c_is_gyroscopic_but_for_the_growth_of_the_mass(seed: int, space: str) -> None:
    for make in (random_open, random_closed):
        tree, q, *_ = make(seed, space)
        if not len(q):
            continue
        model = built(tree)
        rate = np.random.default_rng(seed).uniform(-1, 1, len(q)) * 0.7
        C, K_v = at(model, q, rate, 0 * rate)
        h = 1e-5
        growth = (matrices(model, q + h * rate)[1] - matrices(model, q - h * rate)[1]) / (2 * h)
        scale = max(np.abs(C).max(), 1e-12)
        np.testing.assert_allclose(0.5 * (C + C.T), 0.5 * (growth + growth.T), atol=1e-5 * scale)
        assert np.isfinite(K_v).all()


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_k_v_grows_with_the_square_of_the_speed_and_c_with_the_speed(seed: int, space: str) -> None:
    tree, q, *_ = random_closed(seed, space)
    if not len(q):
        return
    model = built(tree)
    rate = np.random.default_rng(seed).uniform(-1, 1, len(q))
    C1, K1 = at(model, q, rate, 0 * rate)
    C3, K3 = at(model, q, 3 * rate, 0 * rate)
    np.testing.assert_allclose(C3, 3 * C1, atol=1e-4 * max(np.abs(C1).max(), 1e-9))
    np.testing.assert_allclose(K3, 9 * K1, atol=1e-4 * max(np.abs(K1).max(), 1e-9))


@pytest.mark.parametrize("make", [four_bar, slider_crank, gantry])
def test_the_mass_matrix_is_that_of_the_local_motions(make: Any) -> None:
    """Σ Bᵀ m B over the links, with the B the velocity terms use, is the pencil's M."""
    model = built(make("free"))
    q = np.array([0.6])
    found = terms(model)
    (z,) = found.values(q[None], NONE)
    B = found.stack.motion(z)
    total = B.T @ found.stack.mass(z) @ B
    M = matrices(model, q)[1]
    np.testing.assert_allclose(total, M, atol=1e-12 * np.abs(M).max())


@pytest.mark.parametrize("make", [four_bar, slider_crank])
def test_small_and_large_mechanisms_are_treated_alike(make: Any) -> None:
    """Of rigid motion in a plane any mesh gives the same terms: dense matrices or sparse ones."""
    tree = make("free")
    coarse, n = built(tree), len(tree["coordinates"])
    for link in tree["mechanism"]["links"].values():
        if "elements" in link:
            link["elements"] *= 12
    numbers = np.linspace(0.3, 0.6, n), np.linspace(1.0, 2.0, n), np.linspace(-3.0, 2.0, n)
    for one, other in zip(at(coarse, *numbers), at(built(tree), *numbers), strict=True):
        rigid = one[-n:, -n:]
        np.testing.assert_allclose(other[-n:, -n:], rigid, atol=1e-8 * np.abs(rigid).max())


@pytest.mark.parametrize("make", [lambda d: blade(4, drive=d), four_bar])
def test_starting_from_rest_leaves_only_the_euler_terms(make: Any) -> None:
    """K_v at q̇ = 0 is linear in q̈, C vanishes."""
    model = built(make("locked"))
    one = at(model, [0.4], [0.0], [3.0])
    two = at(model, [0.4], [0.0], [6.0])
    assert np.abs(one[0]).max() < 1e-6 * np.abs(one[1]).max()
    assert np.abs(one[1]).max() > 1e-3
    np.testing.assert_allclose(two[1], 2 * one[1], atol=1e-4 * np.abs(one[1]).max())


def test_a_mass_whirling_about_any_axis_has_its_closed_form() -> None:
    """C = 2 m ω̃ and K_v = m (ω̃ ω̃ + α̃) in the beam's axes, which the joint carries around."""
    tree = blade(1, "spatial")
    axis = np.array([0.6, -0.5, 0.4]) / np.linalg.norm([0.6, -0.5, 0.4])
    tree["mechanism"]["joints"]["r"]["axis"] = axis.tolist()
    tree["mechanism"]["materials"] = {"m": {**ALLOY, "density": 1e-6}}
    tree["mechanism"]["bodies"] = {"tip": {"at": "b.end", "mass": 2.0}}
    C, K_v = at(built(tree), [0.7], [6.0], [1.5])
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    np.testing.assert_allclose(C[:3, :3], 2 * 2.0 * 6.0 * cross, rtol=1e-5, atol=1e-4)
    expected = 2.0 * (36.0 * cross @ cross + 1.5 * cross)
    np.testing.assert_allclose(K_v[:3, :3], expected, rtol=1e-5, atol=1e-4)


# Along a motion


def test_the_effect_falls_with_the_square_of_the_speed() -> None:
    model = built(arm3r("free"))
    s = np.linspace(0.0, 1.0, 41)
    q = np.array([0.3, 0.5, -0.9]) + np.outer(10 * s**3 - 15 * s**4 + 6 * s**5, [0.5, 0.4, 0.8])
    found = [
        motion_effect(model.pencil, terms(model), timed(T * s, q), NONE, (1, 2)).change
        for T in (1.0, 2.0)
    ]
    first, second = (np.abs(change).max() for change in found)
    assert first > 1e-6
    assert first / second == pytest.approx(4.0, rel=0.02)
