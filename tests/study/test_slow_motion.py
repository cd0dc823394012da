"""The speed of the motion is judged, and said when it is not slow."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from chains import case_of, two_link

from eigassign import load_case
from eigassign.mechanism import Trajectory, rates, velocity_terms
from eigassign.modal import change_at
from eigassign.pipeline import solve_case
from eigassign.study import gap_along

CASE = Path(__file__).parents[2] / "cases" / "two_link.yaml"


def test_the_papers_motion_is_slow_and_that_is_noted() -> None:
    results = solve_case(load_case(CASE)).results
    assert any(note.startswith("speed of the motion") for note in results.notes)
    assert not any("not slow" in warning for warning in results.warnings)


@pytest.mark.parametrize(("duration", "expected"), [("4 ms", True), ("200 ms", False)])
def test_a_motion_in_milliseconds_is_warned_of(
    tmp_path: Path, duration: str, expected: bool
) -> None:
    text = CASE.read_text(encoding="utf-8").replace("duration: 1 s", f"duration: {duration}")
    (tmp_path / "timed.yaml").write_text(text, encoding="utf-8")
    results = solve_case(load_case(tmp_path / "timed.yaml")).results
    assert any("not slow" in warning for warning in results.warnings) is expected


def test_near_modes_are_looked_at_first() -> None:
    """g is the nearest neighbour of a wanted mode, 1 at most and never 0."""
    hz = np.array([[100.0, 150.0, 300.0], [100.0, 110.0, 300.0]])
    np.testing.assert_allclose(gap_along(hz, (1,)), [1.0, 0.21])
    np.testing.assert_allclose(gap_along(hz, (3,)), 1.0)
    np.testing.assert_allclose(gap_along(hz[:, :1], (1,)), 1.0)
    np.testing.assert_allclose(gap_along(np.array([[100.0, 100.0]]), (2,)), 1e-6)


def test_the_speed_is_judged_on_the_elements_that_auto_chose(tmp_path: Path) -> None:
    text = (CASE.parent / "pick_and_place.yaml").read_text(encoding="utf-8")
    path = tmp_path / "automatic.yaml"
    path.write_text(text.replace("elements: 3", "elements: auto"), encoding="utf-8")
    results = solve_case(load_case(path)).results
    assert any("velocity terms" in line for line in (*results.notes, *results.warnings))


@pytest.mark.parametrize(("before", "hz", "fast"), [(400.0, 2.2, True), (10.0, 10.6, False)])
def test_the_answer_is_judged_and_not_the_initial_design(
    before: float, hz: float, fast: bool
) -> None:
    """The softer its drive, the more the motion changes."""
    tree = two_link(elements=(1, 1), drives=({"stiffness": 2e4}, {"stiffness": before}))
    tree["trajectory"] = {"points": [[0.1, 0.5], [0.6, 1.5]], "duration": 0.5, "samples": 9}
    tree["design"] = {"k": {"parameter": "coordinates.q2.drive.stiffness", "min": 10, "max": 1e3}}
    tree |= {"targets": [{"mode": 1, "frequency": hz}], "assignment": {"starts": 1}}
    results = solve_case(case_of(tree)).results
    assert any("not slow" in warning for warning in results.warnings) is fast


VEERING = CASE.parent / "stress" / "veering_motion.yaml"


def veering(duration: str) -> dict[str, Any]:
    """Two modes pass each other at 0.7 %; only a drive may change, by 1 %."""
    tree = yaml.safe_load(VEERING.read_text(encoding="utf-8"))
    for one in tree["trajectory"]:
        one["duration"] = duration
    place = ["coordinates.q1.drive.stiffness", "coordinates.q2.drive.stiffness"]
    tree["design"] = {"k": {"parameter": place, "min": 1420, "max": 1430}}
    tree |= {"targets": [{"mode": 1, "at_least": "11.9 Hz"}], "assignment": {"starts": 1}}
    return tree


@pytest.mark.parametrize(
    ("duration", "verdict", "least", "most"),
    [
        ("0.6 s", "do_not_use", 2.0, 5.0),
        ("6 s", "reached", 0.5, 1.0),
    ],
)
def test_a_veering_is_said_by_mode_and_sample_and_the_verdict_follows(
    tmp_path: Path, duration: str, verdict: str, least: float, most: float
) -> None:
    """Once "1e+02 %" at any speed, and reached."""
    path = tmp_path / "veering.yaml"
    path.write_text(yaml.safe_dump(veering(duration)), encoding="utf-8")
    results = solve_case(load_case(path)).results
    assert results.assignment.verdict == verdict
    said = [line for line in (*results.warnings, *results.notes) if "velocity terms" in line]
    (change,) = re.findall(
        r"change mode 1 by about (\S+) % at sample 26 of trajectory 'full'", said[0]
    )
    assert least <= float(change) < most
    assert ("velocity terms" in results.assignment.reason) is (verdict == "do_not_use")
    assert any("not slow" in warning for warning in results.warnings)


def test_away_from_a_veering_the_effect_falls_with_the_square_of_the_speed() -> None:
    case = load_case(VEERING)
    model, samples = case.model(), [4, 8, 12, 20]
    terms = velocity_terms(case.file, model.poses.parameters, model.motion)
    changes = []
    for slower in (1.0, 2.0):
        part = case.trajectory.parts[0].trajectory
        moving = rates(Trajectory(part.time_s * 5.0 * slower, part.q.copy()))
        at = (each[samples] for each in (moving.q, moving.rate, moving.acceleration))
        own = change_at(model.pencil, terms, *at, case.initial_design, (1, 2), model.under_load)
        changes.append(own)
    np.testing.assert_allclose(changes[0] / changes[1], 4.0, rtol=0.05)
