"""What targets ask between samples counts, and a band is one along each trajectory."""

from typing import Any

import numpy as np
import pytest
import yaml
from load_cases import LOADED, arm
from scenes import SHIPPED, changed

import eigassign as ea
from eigassign.case import parse
from eigassign.mechanism import rates
from eigassign.pipeline import Result
from eigassign.study import AssignmentRow

BOX = {
    "stiffness": {"parameter": "coordinates.q1.drive.stiffness", "min": 3.8e4, "max": 4.2e4},
}
TARGET = "- {mode: 1, frequency: 190 Hz}"
# At 0.4967 and 0.5033 s there are samples; mode 1 is from 184 to 206 Hz, whatever the masses.
PEAK = "{time: [0, 0.499, 0.5, 0.501, 1], frequency: [100, 100, 190, 100, 100]}"


def assigned(text: str) -> tuple[ea.Case, Result, AssignmentRow]:
    case = ea.Case(parse(text.encode(), "case.yaml"))
    result = ea.assign(case)
    row = result.results.assignment
    return case, result, row


def shipped(target: str) -> tuple[ea.Case, Result, AssignmentRow]:
    return assigned(changed((TARGET, f"- {target}")))


def loaded(**more: Any) -> tuple[ea.Case, Result, AssignmentRow]:
    """The arm that picks 3 kg, with mode 1 at 7 Hz, and returns empty, with mode 1 at 17 Hz."""
    band = {"targets": [{"keep_out": [10.0, 14.0]}]}
    return assigned(yaml.safe_dump(arm(*LOADED[:2], design=BOX, title="loads", **band, **more)))


def test_a_band_is_clear_with_another_number_of_modes_below_it_along_each_trajectory() -> None:
    _, result, row = loaded()
    assert [(one.below, one.clear) for one in row.clearances] == [(1, True), (0, True)]
    assert row.verdict == "reached"
    (target,) = result.results.targets
    names = [along.name for along in target.along]
    assert len(set(names)) == 2
    labels = [f"{target.asked.label} along {name!r}" for name in names]
    assert [one.label for one in row.clearances] == labels
    assert target.satisfied
    assert target.error.exact.max_relative == 0.0
    assert [along.error.exact.max_relative for along in target.along] == [0.0, 0.0]


def modes_inside(case: ea.Case, result: Result, at: float, low: float, high: float) -> int:
    """How many modes are in a band at an instant."""
    pose = case.trajectory.pose(at, None)[None]
    hz = case.model().frequencies(pose, np.array(list(result.design.values())), 3)
    return int(((hz > low) & (hz < high)).sum())


def test_a_peak_of_a_profile_between_two_samples_is_kept_clear_of() -> None:
    """The band is below mode 1, and about it for a millisecond; no design leaves it there."""
    case, result, row = shipped(f"{{keep_out: {{harmonic: 1, of: {PEAK}, margin: 10 %}}}}")
    assert modes_inside(case, result, 0.5, 171.0, 209.0) == 1
    assert not all(one.clear for one in row.clearances)
    assert row.verdict not in ("reached", "improved")
    assert 0.5 in result.results.time_s


def test_a_peak_that_the_design_can_clear_is_cleared() -> None:
    """Mode 1 of the lightest design is at 198.4 Hz at 0.5 s, where the band reaches 197.6 Hz."""
    heavy = (
        "elbow_mass: {at: upper_arm.end, mass: 0}",
        "elbow_mass: {at: upper_arm.end, mass: 0.1}",
    )
    target = f"- {{keep_out: {{harmonic: 1, of: {PEAK}, margin: 4 %}}}}"
    case, result, row = assigned(changed((TARGET, target), heavy))
    assert modes_inside(case, result, 0.5, 182.4, 197.6) == 0
    assert row.verdict == "reached"
    assert all(one.clear for one in row.clearances)


@pytest.mark.parametrize("during", ["[0.1 s, 0.5 s]", "[0.498 s, 0.502 s]"])
def test_a_part_that_ends_or_lies_between_samples_is_kept_clear_to_its_end(during: str) -> None:
    """Mode 1 of the initial design rises through 198.39 Hz at 0.5 s, from 198.28 Hz before."""
    case, result, row = shipped(f"{{keep_out: [198.35, 206], during: {during}}}")
    for at in (0.5, 0.499):
        assert modes_inside(case, result, at, 198.35, 206.0) == 0
    assert row.verdict == "reached"
    assert all(one.clear for one in row.clearances)
    (target,) = result.results.targets
    assert result.results.time_s[target.asked.rows][-1] == float(during.split()[-2])


def test_limits_and_wanted_frequencies_count_between_samples_too() -> None:
    case, result, _ = shipped("{mode: 1, at_most: 190, during: [0.498, 0.502]}")
    assert modes_inside(case, result, 0.5, 0.0, 190.0 * (1.0 + 1e-6)) == 1
    _, result, row = shipped(f"{{mode: 1, frequency: {PEAK.replace('100', '195')}}}")
    (target,) = result.results.targets
    assert target.asked.hz.min() == 190.0
    assert any("3 instants between samples" in note for note in result.results.notes)
    assert row.max_error == 0.02


def test_samples_keep_their_numbers_and_rates_where_instants_are_between_them() -> None:
    plain = ea.Case(parse(SHIPPED.encode(), "case.yaml"))
    path = plain.trajectory
    refined = path.with_instants([[0.5, path.time_s[3], 2e-3]])
    assert len(refined.q) == len(path.q) + 2
    assert refined.inserted.sum() == 2
    k = int(np.searchsorted(refined.time_s, 0.5))
    assert refined.sample(k) == "an instant between samples 75 and 76"
    assert refined.sample(k + 1) == "sample 76"
    (part,) = refined.parts
    assert part.trajectory.given is path.parts[0].trajectory
    np.testing.assert_array_equal(refined.q[~refined.inserted], path.q)
    own = part.trajectory.motion.poses(np.array([0.5]))[0]
    np.testing.assert_allclose(refined.q[k], own, rtol=1e-12)
    chord = 0.5 * (path.q[75] + path.q[76])  # 0.5 s is midway, and q bends by some 1e-5 rad
    assert 1e-7 < np.abs(refined.q[k] - chord).max() < 1e-4


def test_what_holds_during_a_part_is_weighed_over_that_part_alone() -> None:
    """152 samples a second: 0.03 s are four intervals and a half, and half of none beyond them."""
    _, result, row = shipped("{mode: 1, frequency: 190 Hz, during: [0 s, 0.03 s]}")
    (target,) = result.results.targets
    time_s = result.results.time_s[target.asked.rows]
    assert time_s[-1] == 0.03
    error = (target.exact_hz / 190.0 - 1.0) ** 2
    rms = np.sqrt(np.trapezoid(error, time_s) / 0.03)
    assert target.error.exact.rms_relative == pytest.approx(rms, rel=1e-12)
    assert row.objective_optimal == pytest.approx(rms**2, rel=1e-9)


def test_rates_and_the_speed_of_the_motion_are_those_of_the_samples() -> None:
    """What the case itself has stays as it was given, and so does what is said of its speed."""
    case, result, _ = shipped("{mode: 1, at_most: 190, during: [0.49801, 0.498015]}")
    before = ea.Case(parse(SHIPPED.encode(), "case.yaml")).trajectory
    np.testing.assert_array_equal(case.trajectory.time_s, before.time_s)
    np.testing.assert_array_equal(case.trajectory.q, before.q)
    assert len(result.results.time_s) == len(before.time_s) + 2
    refined = before.with_instants([[0.49801, 0.498015]])
    own, given = (rates(path.parts[0].trajectory) for path in (refined, before))
    kept = ~refined.inserted[own.samples]
    np.testing.assert_allclose(own.rate[kept], given.rate, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(own.acceleration[kept], given.acceleration, rtol=1e-9, atol=1e-9)
    _, plain, _ = shipped("{mode: 1, at_most: 190}")
    (slow,), (other,) = (
        [note.split(" by about ") for note in each.results.notes if "velocity terms" in note]
        for each in (result, plain)
    )
    assert slow[0] == other[0]
    (change, where), (changed, there) = (each[1].split(" % at ") for each in (slow, other))
    assert where == there
    assert float(change) == pytest.approx(float(changed), rel=0.2)  # of another design
