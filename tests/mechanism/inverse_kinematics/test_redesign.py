"""Coordinates along a path of the tip as functions of the design, and their slopes."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from planar_arms import two_link_angles
from redesigned_arms import cart, extrapolated, five_bar, six_joints, slider_crank, two_link_lengths

from eigassign import Case
from eigassign.errors import CaseError, TrajectoryError

EVERY = [two_link_lengths, six_joints, five_bar, slider_crank]


def other_design(case: Case, share: float = 0.02) -> np.ndarray:
    """Every parameter a little off, those that are 0 too."""
    y = case.initial_design
    return y * (1.0 + share * np.cos(np.arange(len(y)))) + 0.1 * (y == 0.0)


def tips(case: Case, y: np.ndarray) -> np.ndarray:
    link, node = case.file.trajectories[0][2].tip.split(".")
    model, path = case.model(), case.trajectory
    d = path.tip.shape[1]
    return model.poses.position(model.x(path.at(y)[0], y), link, node)[:, :d]


@pytest.mark.parametrize("make", EVERY)
def test_the_tip_keeps_its_path_with_another_design(make: Callable[[], Case]) -> None:
    case = make()
    path, y = case.trajectory, other_design(case)
    assert path.follows_design
    np.testing.assert_array_equal(path.at(case.initial_design)[0], path.q)
    assert np.abs(path.at(y)[0] - path.q).max() > 1e-3
    np.testing.assert_allclose(tips(case, y), path.tip, atol=1e-10)


@pytest.mark.parametrize("make", EVERY)
@pytest.mark.parametrize("share", [0.0, 0.02])
def test_slopes_are_those_of_extrapolated_differences(
    make: Callable[[], Case], share: float
) -> None:
    case = make()
    path, y = case.trajectory, other_design(case, share)
    slopes = path.at(y)[1]
    beside = extrapolated(lambda v: path.at(v)[0], y, 1e-3)
    # sixth-order differences leave about 1e-10, and q is known to 1e-13
    np.testing.assert_allclose(slopes, beside, atol=1e-9 * np.abs(slopes).max())


@pytest.mark.parametrize("lengths", [(0.61, 0.43), (0.55, 0.5), (0.7, 0.6)])
def test_both_lengths_of_two_links_give_the_law_of_cosines(lengths: tuple[float, float]) -> None:
    path = two_link_lengths().trajectory
    q, _ = path.at(np.array([lengths[0], 0.1, lengths[1]]))  # the mass between them has no effect
    shoulder, elbow = two_link_angles(path.tip, *lengths, sign=-1.0).T
    off = q - np.stack([shoulder, shoulder + elbow], axis=1)
    np.testing.assert_allclose(off, 2.0 * np.pi * np.round(off / (2.0 * np.pi)), atol=1e-10)


def test_a_parameter_that_does_not_move_the_tip_has_no_slope() -> None:
    case = two_link_lengths()
    _, slopes = case.trajectory.at(other_design(case))
    assert np.abs(slopes[:, :, 1]).max() == 0.0
    assert np.abs(slopes[:, :, [0, 2]]).max() > 1.0


def test_the_answer_depends_on_the_design_alone() -> None:
    case = two_link_lengths()
    path, y = case.trajectory, other_design(case)
    first = path.at(y)[0]
    path.at(other_design(case, -0.04))
    np.testing.assert_array_equal(path.at(y)[0], first)


def test_coordinates_that_are_given_do_not_follow() -> None:
    case = two_link_lengths()
    given = replace(case.trajectory.parts[0].trajectory, known=None)
    q, slopes = given.at(other_design(case))
    np.testing.assert_array_equal(q, given.q)
    assert slopes.shape == (24, 2, 3)
    assert not slopes.any()


@pytest.mark.parametrize(
    ("lengths", "words"),
    [
        (
            (0.3, 0.1),
            r"with a = 0\.3, b = 0\.1: between .* 4 and 5, .* is 0\.\d+ m out of reach",
        ),
        (
            (0.7, 0.3),
            r"with a = 0\.7, b = 0\.3: between .* 4 and 5, .* is 0\.\d+ m out of reach",
        ),
        ((0.2, 0.2), r"with a = 0\.2, b = 0\.2: waypoint 1 .* needs joint elbow at"),
    ],
)
def test_a_design_that_cannot_follow_is_refused_with_its_lengths_and_sample(
    lengths: tuple[float, float], words: str
) -> None:
    path = two_link_lengths().trajectory
    with pytest.raises(TrajectoryError, match=words) as caught:
        path.at(np.array([lengths[0], 0.0, lengths[1]]))
    assert 0 <= caught.value.sample < 24


def test_a_length_that_no_coordinate_can_make_up_for_is_refused_at_its_key() -> None:
    with pytest.raises(CaseError, match=r"design\.h\.parameter: moves the tip where no coordinate"):
        _ = cart([[0.0, 0.5], [0.3, 0.5]]).trajectory
