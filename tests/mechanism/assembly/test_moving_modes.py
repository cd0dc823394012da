"""The effect of a motion on the frequencies, its modes followed: against integration in time."""

from typing import Any

import numpy as np
import pytest
from spatial_cases import ALLOY, Built, built, linkage, shipped
from spatial_examples import four_bar
from timed_motions import RestToRest, integrated

from eigassign.mechanism import velocity_terms
from eigassign.modal import change_at, eigenvalues, modes, moving_modes, theta_in_time


def paper_arm() -> Built:
    """The paper's arm with an element a link and masses on it: eight unknowns."""
    return shipped(
        "two_link",
        ("elements: 4", "elements: 1"),
        ("elements: 3", "elements: 1"),
        ("upper_arm.end, mass: 0", "upper_arm.end, mass: 0.05"),
        ("forearm.end, mass: 0", "forearm.end, mass: 0.1"),
    )


def coarse_loop() -> Built:
    """A four-bar linkage with one or two elements a link."""
    tree = four_bar("locked")
    for name, count in (("crank", 1), ("coupler", 2), ("rocker", 2)):
        tree["mechanism"]["links"][name]["elements"] = count
    return built(tree)


def changes(model: Built, *motion: Any, wanted: tuple[int, ...] = (1,)) -> np.ndarray:
    terms = velocity_terms(model.case, model.numbers, model.motion)
    q, rate, push = (np.asarray(a, float).reshape(1, -1) for a in motion)
    return change_at(model.pencil, terms, q, rate, push, model.y, wanted)[0]


def estimated(motion: RestToRest, tau: np.ndarray, duration: float, mode: int) -> np.ndarray:
    return np.array(
        [changes(motion.model, *motion.at(t, duration), wanted=(mode,))[0] for t in tau]
    )


# Against the linear equations of the motion, integrated


ARM = (paper_arm, [0.3, 2.5], [0.8, 2.0])
LOOP = (coarse_loop, [0.4], [0.9])


@pytest.mark.parametrize(("example", "mode"), [(ARM, 1), (LOOP, 1)])
def test_the_phase_of_a_mode_turns_as_estimated_to_the_fourth_power_of_the_speed(
    example: Any, mode: int
) -> None:
    """The estimate is of second order in the speed and even in it: what it misses is of fourth.

    Four times as slow, the phase rate must be missed by 1/256, give or take the little that
    vibrates freely in other modes, while what is estimated falls to 1/16.
    """
    make, start, move = example
    model, tau = make(), np.linspace(0.1, 0.9, 9)
    motion = RestToRest(model, start, move)
    still = np.sqrt(eigenvalues(model.pencil, motion.x(tau), mode)[:, -1])
    missed, size = [], []
    for periods in (8, 32):
        duration = periods * 2 * np.pi / still[0]
        truth = integrated(motion, duration, mode)
        found = still * estimated(motion, tau, duration, mode)
        missed.append(np.linalg.norm(truth.beyond(tau * duration) - found))
        size.append(np.linalg.norm(found))
    assert size[0] / size[1] == pytest.approx(16.0, rel=0.01)
    assert missed[0] / missed[1] > 4.0**3.5  # a term of second order missing would give 16
    assert missed[1] < 0.003 * size[1]


# What it is made of


def at_one_instant() -> tuple[Built, np.ndarray, np.ndarray, np.ndarray]:
    return paper_arm(), np.array([0.4, 2.7]), np.array([1.0, -2.0]), np.array([5.0, 3.0])


def exact_modes(model: Built, q: np.ndarray, like: np.ndarray) -> np.ndarray:
    """The lowest two with the signs of ``like``."""
    phi = modes(model.pencil, model.x(q), like.shape[1]).phi[0]
    return np.asarray(phi * np.sign(np.einsum("ik,ik->k", phi, like)))


@pytest.mark.parametrize("mode", [1, 2])
def test_modes_move_as_their_differences_say(mode: int) -> None:
    model, q, rate, push = at_one_instant()
    found = modes(model.pencil, model.x(q), 2)
    part = slice(mode - 1, mode)
    theta = theta_in_time(model.pencil, q, rate, push, model.y)
    moving = moving_modes(model.pencil, theta, found.lam[0, part], found.phi[0][:, part])
    h = 1e-4
    places = [q + rate * t + 0.5 * push * t * t for t in (-h, 0.0, h)]
    a, b, c = (exact_modes(model, p, found.phi[0])[:, part] for p in places)
    lam = [model.lam(p, 2)[mode - 1] for p in places]
    np.testing.assert_allclose(moving.phi[1], (c - a) / (2 * h), atol=1e-5 * np.abs(b).max())
    np.testing.assert_allclose(moving.phi[2], (a - 2 * b + c) / h**2, atol=1e-4 * np.abs(b).max())
    assert moving.lam[1].item() == pytest.approx((lam[2] - lam[0]) / (2 * h), rel=1e-5)
    assert moving.lam[2].item() == pytest.approx((lam[0] - 2 * lam[1] + lam[2]) / h**2, rel=1e-3)


def test_a_cluster_stays_normal_to_its_mass_and_does_not_rotate_in_itself() -> None:
    """ΦᵀMΦ = I to second order, Λ = ΦᵀKΦ at the first, and Φᵀ M Φ̇ is symmetric."""
    model, q, rate, push = at_one_instant()
    found = modes(model.pencil, model.x(q), 2)
    theta = theta_in_time(model.pencil, q, rate, push, model.y)
    moving = moving_modes(model.pencil, theta, found.lam[0], found.phi[0])
    K, M = model.pencil.matrices(theta)
    phi = (moving.phi[0], moving.phi[1], 0.5 * moving.phi[2])
    for order, expected in ((0, np.eye(2)), (1, np.zeros((2, 2))), (2, np.zeros((2, 2)))):
        N = sum(
            phi[a].T @ M[b] @ phi[order - a - b]
            for a in range(order + 1)
            for b in range(order + 1 - a)
        )
        np.testing.assert_allclose(N, expected, atol=1e-9)
    turn = phi[0].T @ M[0] @ phi[1]
    np.testing.assert_allclose(turn, turn.T, atol=1e-9)
    stiff = phi[0].T @ K[0] @ phi[1] + phi[0].T @ K[1] @ phi[0] + phi[1].T @ K[0] @ phi[0]
    np.testing.assert_allclose(moving.lam[1], stiff, atol=1e-9 * moving.lam[0].max())


def whirling(width: float) -> Built:
    """A beam that turns about its own axis with a mass at its end, clamped but for that."""
    rod = {"shape": "rectangle", "width": width, "height": 0.02}
    beam = {"length": 1.0, "elements": 1, "material": "m", "section": "s"}
    return built(
        linkage(
            {"b": beam},
            {
                "r": {
                    "type": "revolute",
                    "base": "ground",
                    "follower": "b.start",
                    "axis": [1, 0, 0],
                }
            },
            {"q": {"joint": "r", "drive": "locked"}},
            section=rod,
            material={**ALLOY, "density": 1e-6},
            space="spatial",
            bodies={"tip": {"at": "b.end", "mass": 2.0}},
        )
    )


@pytest.mark.parametrize("width", [0.02, 0.02005, 0.0201, 0.021])
def test_equal_bending_modes_whirl_in_turning_axes(width: float) -> None:
    """Mode 1 and 2 of a mass m on springs k_1, k_2 in axes turning at Ω, Jeffcott's shaft:

    (s² + ω_1² − Ω²)(s² + ω_2² − Ω²) + 4 Ω² s² = 0, which for ω_1 = ω_2 gives ω ± Ω.
    """
    model, spin = whirling(width), 3.0
    low, high = model.lam([0.0], 2)
    a, b = low - spin**2, high - spin**2
    turning = np.sqrt(-np.roots([1.0, a + b + 4 * spin**2, a * b]))
    expected = np.sort(turning.real) / np.sqrt([low, high]) - 1.0
    found = changes(model, 0.0, spin, 0.0, wanted=(1, 2))
    np.testing.assert_allclose(found, expected, rtol=1e-3)
