"""Carriages and nuts stay on their beams: refused by name, with the pose and the range."""

from __future__ import annotations

import numpy as np
import pytest
from spatial_cases import built
from spatial_examples import gantry, slotted_lever

from eigassign.errors import TravelError
from eigassign.mechanism import resting_pose
from eigassign.modal import eigenvalues

FIRST = 6 * 1e-4 * 1.6  # m: six elements of L/10⁴ before the carriage


@pytest.mark.parametrize("x", [-0.2, 0.0, 0.99 * FIRST, 1.6 - 0.99 * FIRST, 1.6, 2.0, np.nan])
def test_a_carriage_beyond_its_beam_is_refused_with_its_range(x: float) -> None:
    with pytest.raises(TravelError, match=r"from 0.00096 m to 1.59904 m") as caught:
        built(gantry("free")).lam([x], 1)
    assert caught.value.path == "mechanism.joints.car"
    assert f"in the pose x = {x:.6g}" in caught.value.message


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_carriage_near_the_end_keeps_its_digits(mirrored: bool) -> None:
    """At the last place allowed λ is still what the cubic through places nearby leads to.

    Extrapolated by h = 5 mm of 1.6 m: the error is some (h/L)⁴ = 1e-10 times λ's derivatives.
    """
    model = built(gantry("locked"))
    places = np.array([1.01 * FIRST, 0.005, 0.01, 0.015, 0.02])
    x = 1.6 - places if mirrored else places
    lam = np.array([model.lam([v], 1)[0] for v in x])
    fitted = np.polynomial.Polynomial.fit(places[1:], lam[1:], 3)(places[0])
    assert lam[0] == pytest.approx(fitted, rel=1e-7)


def test_the_first_sample_that_leaves_the_beam_is_named() -> None:
    model = built(gantry("free"))
    x = np.array([[0.5], [1.2], [1.7], [-1.0]])
    with pytest.raises(TravelError, match=r"x = 1.7 \(sample 2\)") as caught:
        eigenvalues(model.pencil, x, 1)
    assert caught.value.sample == 2


def test_the_length_that_counts_is_the_designs() -> None:
    tree = gantry("free")
    tree["mechanism"]["joints"].pop("f4")  # an open portal may change its girder's length
    tree["design"] = {"L": {"parameter": "links.girder.length", "min": 1.0, "max": 2.0}}
    model = built(tree)
    assert eigenvalues(model.pencil, np.array([[1.8, 2.0]]), 1)[0, 0] > 0.0
    with pytest.raises(TravelError, match=r"to 1.59904 m"):
        eigenvalues(model.pencil, np.array([[1.8, 1.6]]), 1)


def test_a_passive_block_that_leaves_its_lever_is_named_with_the_pose() -> None:
    tree = slotted_lever("free")
    tree["mechanism"]["links"]["lever"]["length"] = 0.4
    model = built(tree)
    assert model.lam([-1.0], 1)[0] > 0.0
    with pytest.raises(TravelError, match=r"in the pose th = 1.5") as caught:
        model.lam([1.5], 1)
    assert caught.value.path == "mechanism.joints.S"


def test_the_pose_to_try_has_its_carriage_in_the_middle() -> None:
    np.testing.assert_array_equal(resting_pose(built(gantry("free")).case), [0.8])
