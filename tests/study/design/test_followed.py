"""Followed modes at any design and sample, against each decoupled half by itself."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from chains import case_of
from rail_and_mast import LAMP, OUT, alone, case, tree
from redesigned_arms import extrapolated
from scipy.optimize import brentq

from eigassign import Case
from eigassign.assignment import Solved
from eigassign.case import parse
from eigassign.errors import LostModeError
from eigassign.pipeline import Stages, prepare
from eigassign.study import Scene, find_answer, followers, response_of, solve_design

RAIL_LIKE = {"like": 1, "at": {"time": 0.0}}
MAST_LIKE = {"like": 2, "at": {"time": 0.0}}
BOTH = [{"mode": RAIL_LIKE, "frequency": 25.0}, {"mode": MAST_LIKE, "at_least": 20.0}]
RAIL, MAST = alone("rail").model(), alone("mast").model()
DESIGNS = ((0.03, 0.9), (0.038, 2.09), (0.05, 3.0), (0.02, 0.2), (0.05, 0.2))


def scene_of(given: Case) -> Scene:
    return prepare(given, Stages(lambda line: None), None)


def solved(scene: Scene, y: tuple[float, ...] | np.ndarray) -> Solved:
    return solve_design(scene, followers(scene, scene.wanted), np.array(y))


def halves(q: np.ndarray, y: tuple[float, ...] | np.ndarray) -> np.ndarray:
    """First frequencies of the rail and of the mast, (n, 2)."""
    rail = RAIL.frequencies(q, [y[0]], 1)
    return np.column_stack([rail, np.full(len(q), MAST.frequencies([], [y[1]], 1)[0, 0])])


@pytest.mark.parametrize("y", DESIGNS)
def test_each_curve_is_that_of_its_half_whatever_its_number(y: tuple[float, float]) -> None:
    scene = scene_of(case(BOTH))
    found = solved(scene, y)
    np.testing.assert_allclose(found.followed, halves(scene.path.q, y), rtol=1e-9)
    rows = np.arange(len(scene.path.q))
    for column in (0, 1):
        own = found.hz[rows, found.numbers[:, column] - 1]
        np.testing.assert_allclose(found.followed[:, column], own, rtol=1e-9)


def test_it_does_not_matter_on_how_many_samples_or_trajectories_or_from_where() -> None:
    two = [{"name": "out", **OUT}, {"name": "back", **OUT, "points": [[0.9], [0.5]]}]
    targets = [
        {"mode": {"like": 2, "at": {"time": 0.31, "trajectory": "back"}}, "frequency": 25.0},
        {"mode": {"like": 1, "at": {"q": [0.4]}}, "frequency": 25.0},
    ]
    found = tree(targets, trajectory=two)
    found["mechanism"]["sections"]["rail"]["height"] = 0.045  # the mast is the lower one there
    found["mechanism"]["bodies"]["lamp"]["mass"] = 2.5
    scene = scene_of(case_of(found))
    some = replace(scene, trajectory=scene.path.chosen([0, 30, 33, 61]))
    for each in (scene, some):
        there = solved(each, (0.036, 1.9))
        np.testing.assert_allclose(there.followed, halves(each.path.q, (0.036, 1.9)), rtol=1e-9)
        assert len(np.unique(there.numbers[:, 0])) == 2


def test_a_mode_is_found_however_high_its_number_becomes() -> None:
    sections = {"design": {"mast": {"parameter": "sections.mast.height", "min": 0.01, "max": 0.4}}}
    scene = scene_of(case([{"mode": MAST_LIKE, "frequency": 25.0}], **sections))
    found = solved(scene, (0.4,))
    assert found.numbers.min() >= 4
    low, high = solved(scene, (0.03,)).followed, found.followed
    assert np.all(high / low > 10.0)


def test_slopes_are_those_of_the_shape_even_where_modes_cross() -> None:
    """The lamp is such that both frequencies are the same at sample 12, to the last digit."""
    scene = scene_of(case(BOTH))
    k, height = 12, 0.037
    rail = RAIL.frequencies(scene.path.q[[k]], [height], 1)[0, 0]
    lamp = brentq(lambda m: MAST.frequencies([], [m], 1)[0, 0] - rail, 0.2, 3.0, xtol=1e-15)
    y = np.array([height, lamp])
    response = response_of(scene, 1, followers(scene, scene.wanted))
    found = response(y)
    beside = extrapolated(lambda v: halves(scene.path.q, v), y, 1e-3)
    np.testing.assert_allclose(found.slopes[:, -2:], beside, rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(found.hz[k, -2], found.hz[k, -1], rtol=1e-12)


def test_a_lost_mode_is_named_with_place_design_and_nearest_candidates() -> None:
    """An elastic foot couples both: where they meet, neither is the rail's or the mast's."""
    scene = scene_of(case(BOTH, coupled=0.1))
    assert (solved(scene, (0.03, 0.9)).numbers == [1, 2]).all()
    with pytest.raises(LostModeError) as caught:
        solved(scene, (0.038, 2.09))
    said, nearest = str(caught.value), caught.value.candidates
    assert "the mode like mode 1 (t = 0 s) is lost" in said
    assert "height = 38 mm, lamp = 2.09 kg" in said
    assert "sample " in said
    assert all(f"mode {c.number} ({c.hz:.5g} Hz, MAC {c.mac:.2f})" in said for c in nearest)
    assert {c.number for c in nearest} == {1, 2}
    hz = scene.exact(np.array([0.038, 2.09]))
    assert any(
        np.allclose([row[c.number - 1] for c in nearest], [c.hz for c in nearest]) for row in hz
    )
    # beyond the meeting each has its shape again
    beyond = solved(scene, (0.05, 3.0))
    assert (beyond.numbers == [2, 1]).all()


def test_where_a_target_does_not_hold_its_mode_need_not_be_known() -> None:
    early = [dict(one, during=[0.0, 0.3]) for one in BOTH]
    scene = scene_of(case(early, coupled=0.1))
    found = solved(scene, (0.038, 2.09))
    known = np.isfinite(found.followed).all(axis=1)
    np.testing.assert_array_equal(known, scene.path.time_s <= 0.3 + 1e-9)
    assert (found.numbers[known] == [2, 1]).all()


def test_modes_that_coincide_by_symmetry_are_followed_together() -> None:
    """The screw's shaft is round: its bending modes come in pairs on either side of the nut."""
    text = (Path(__file__).parents[3] / "cases" / "ball_screw.yaml").read_text()
    target = "targets:\n  - {mode: {like: 3, at: {time: %s}}, at_least: 100}\nvalidation:"
    start, end = text.index("targets:"), text.index("validation:")

    def with_target(time: str) -> Scene:
        new = text[:start] + target % time + text[end + len("validation:") :]
        return scene_of(Case(parse(new.encode(), "case.yaml")))

    scene = with_target("0.2")
    found = solved(scene, scene.initial)
    hz = scene.model.frequencies(scene.path.q, scene.initial, 20)
    for k, number in enumerate(found.numbers[:, 0]):
        np.testing.assert_allclose(hz[k, number - 1 : number + 1], found.followed[k, 0], rtol=1e-8)


def test_a_band_of_a_followed_mode_lets_the_others_pass() -> None:
    """The rail, mode 1 or 2, goes through the band; the mast keeps out of it, above or below."""
    band = {"keep_out": [18.0, 40.0], "mode": MAST_LIKE}
    rail = {"mode": RAIL_LIKE, "frequency": 25.0}
    for lamp in (0.4, 1.5, 3.0):
        scene = scene_of(case([rail, band], design={"lamp": {**LAMP, "max": 3.0}}))
        wanted = scene.wanted
        y = np.array([lamp])
        one = wanted[1]
        found = solve_design(scene, followers(scene, wanted), y)
        mast = halves(scene.path.q, (0.03, lamp))[:, 1]
        np.testing.assert_allclose(one.curve(found), mast, rtol=1e-9)
        off = np.minimum(mast / 18.0 - 1.0, 1.0 - mast / 40.0)
        assert one.errors(found).max() == pytest.approx(max(0.0, off.max()), rel=1e-8, abs=1e-15)
    best = find_answer(scene, lambda line: None)
    (row,) = best.found.clearances
    mast = float(MAST.frequencies([], best.y, 1)[0, 0])
    assert row.clear
    above = mast / (1.0 + row.raised) / 40.0 - 1.0
    assert row.room == pytest.approx(1.0 - mast / 18.0 if row.below else above, rel=1e-6)


def test_the_gap_between_followed_modes_is_that_of_their_halves() -> None:
    gap = {"gap": {"between": [RAIL_LIKE, MAST_LIKE], "at_least": 4.0}}
    scene = scene_of(case([gap]))
    (one,), y = scene.wanted, (0.03, 0.9)
    rail, mast = halves(scene.path.q, y).T
    np.testing.assert_allclose(one.curve(solved(scene, y)), mast - rail, rtol=1e-8)
    answer = find_answer(scene, lambda line: None)
    rail, mast = halves(scene.path.q, answer.y).T
    assert (mast - rail).min() >= 4.0 - 1e-6
