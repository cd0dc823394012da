"""Whole runs with modes that are followed by their shape, against each decoupled half by itself."""

import csv
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from chains import case_of
from rail_and_mast import HEIGHT, LAMP, OUT, alone, case, tree
from scipy.optimize import brentq, minimize_scalar

import eigassign as ea
from eigassign.errors import CaseError, LostModeError
from eigassign.output import results_document, sample_files
from eigassign.pipeline import Options, check, solve_case
from eigassign.study import RunResults

CASES = Path(__file__).parents[2] / "cases"
RAIL, MAST = alone("rail").model(), alone("mast").model()
X = alone("rail").trajectory.q
RAIL_LIKE = {"like": 1, "at": {"time": 0.0}}
MAST_LIKE = {"like": 2, "at": {"time": 0.0}}
FALLING = {"time": [0.0, 1.0], "frequency": [31.0, 25.0]}
TARGETS = [{"mode": RAIL_LIKE, "frequency": FALLING}, {"mode": MAST_LIKE, "frequency": 27.0}]


def lamp_for(hz: float) -> float:
    return brentq(lambda m: MAST.frequencies([], [m], 1)[0, 0] - hz, 0.2, 3.0, xtol=1e-14)


def rail_hz(height: float) -> np.ndarray:
    return RAIL.frequencies(X, [height], 1)[:, 0]


@pytest.fixture(scope="module")
def found() -> RunResults:
    return solve_case(case([*TARGETS, {"mode": 2, "at_least": 26.0}])).results


def test_the_optimum_is_that_of_each_half_though_their_modes_cross(found: RunResults) -> None:
    time_s = np.linspace(0.0, 1.0, len(X))

    def mean_square(height: float) -> float:
        wanted = np.interp(time_s, FALLING["time"], FALLING["frequency"])
        return float(np.trapezoid((rail_hz(height) / wanted - 1.0) ** 2, time_s))

    best = minimize_scalar(
        mean_square, bounds=(0.02, 0.05), method="bounded", options={"xatol": 1e-9}
    )
    optimum = [row.optimal for row in found.design]
    np.testing.assert_allclose(optimum, [best.x, lamp_for(27.0)], rtol=1e-6)
    rail, mast, limit = found.targets
    np.testing.assert_allclose(rail.exact_hz, rail_hz(optimum[0]), rtol=1e-9)
    np.testing.assert_allclose(mast.exact_hz, 27.0, rtol=1e-7)
    assert limit.satisfied
    assert found.assignment.optimality.stationarity < 1e-6
    assert found.assignment.one_shot is None


def test_a_followed_mode_changes_its_number_once(found: RunResults) -> None:
    (rail,) = found.targets[0].followed
    assert (rail.initial_numbers == 1).all()
    assert rail.exact_numbers[[0, -1]].tolist() == [2, 1]
    assert np.count_nonzero(np.diff(rail.exact_numbers)) == 1


def test_every_file_tells_followed_from_numbered_modes(found: RunResults) -> None:
    rail, mast, numbered = results_document(found)["targets"]
    assert (rail["mode"], rail["modes"], numbered["mode"]) == (None, (), 2)
    assert rail["followed"]["name"] == "the mode like mode 1 (t = 0 s)"
    assert set(mast["followed"]["exact_modes"].tolist()) == {1, 2}
    rows = list(csv.DictReader(io.StringIO(sample_files(found)["frequencies.csv"].decode())))
    columns = {
        "the mode like mode 1 (t = 0 s)": found.targets[0],
        "the mode like mode 2 (t = 0 s)": found.targets[1],
        "mode 2 at least 26 Hz": found.targets[2],
    }
    for name, target in columns.items():
        written = [float(row[f"{name} exact [Hz]"]) for row in rows]
        np.testing.assert_array_equal(written, target.exact_hz)
    both = np.column_stack([found.targets[k].exact_hz for k in (0, 1)])
    np.testing.assert_allclose(found.targets[2].exact_hz, both.max(axis=1), rtol=1e-9)


def test_limits_hold_for_the_shape_on_every_trajectory_with_its_load() -> None:
    carriage = "links.carriage.mass"
    motions = [
        {"name": "full", **OUT, "samples": 9, "set": {carriage: 2.0}},
        {"name": "empty", **OUT, "samples": 7, "points": [[0.9], [0.3]], "set": {carriage: 0.5}},
    ]
    design = {"height": dict(HEIGHT, price=1.0), "lamp": dict(LAMP, price=-1e-3)}
    pose = {"at": {"time": 0.0, "trajectory": "full"}}
    targets = [
        {"mode": {"like": 1, **pose}, "at_least": 25.0},
        {"mode": {"like": 2, **pose}, "at_least": 26.0},
    ]
    run = solve_case(case(targets, trajectory=motions, design=design)).results
    rail, mast = run.targets
    assert rail.satisfied
    assert mast.satisfied
    optimum = [row.optimal for row in run.design]
    assert optimum[1] == pytest.approx(lamp_for(26.0), rel=1e-6)
    assert rail.exact_hz.min() == pytest.approx(25.0, rel=1e-7)
    assert (
        len(set(rail.followed[0].exact_numbers)) == 2
    )  # with the full carriage it is the lower one


def test_a_mode_that_is_lost_at_the_initial_design_is_refused() -> None:
    given = tree(TARGETS, coupled=0.1)
    given["mechanism"]["sections"]["rail"]["height"] = 0.038
    given["mechanism"]["bodies"]["lamp"]["mass"] = 2.09
    with pytest.raises(LostModeError, match=r"sample \d+ .* with height = 38 mm, lamp = 2.09"):
        solve_case(case_of(given))


def through_the_mast(hz: float, **keys: Any) -> RunResults:
    """The rail alone may change; the mast stands at 27 Hz, on a foot through which they meet."""
    targets = [{"mode": RAIL_LIKE, "frequency": hz, "during": [0.0, 0.1]}]
    given = tree(targets, coupled=0.1, design={"height": HEIGHT}, **keys)
    given["mechanism"]["bodies"]["lamp"]["mass"] = lamp_for(27.0)
    return solve_case(case_of(given)).results


def test_designs_at_which_a_mode_is_lost_are_stepped_over() -> None:
    found = through_the_mast(31.0)
    assert found.targets[0].satisfied
    assert (found.targets[0].followed[0].exact_numbers == 2).all()


def test_an_answer_at_the_edge_of_where_a_mode_is_lost_says_so() -> None:
    found = through_the_mast(27.0, assignment={"steps": 12, "starts": 1})
    (note,) = (line for line in found.notes if "were left out, the last because" in line)
    assert "the mode like mode 1 (t = 0 s) is lost at sample" in note
    assert found.targets[0].error.exact.max_relative < found.targets[0].error.initial.max_relative


def test_a_case_that_follows_modes_can_be_checked(tmp_path: Path) -> None:
    answer = check(written(tmp_path))
    assert answer.targets == 2
    for like, half in ((1, rail_hz(0.03)[0]), (2, MAST.frequencies([], [0.9], 1)[0, 0])):
        said = f"the mode like mode {like} (t = 0 s) has {half:.6g} Hz there, and is followed"
        assert any(note.startswith(said) for note in answer.notes)


def test_the_one_shot_refuses_to_follow_modes() -> None:
    with pytest.raises(CaseError, match=r"targets\[0\].mode: is followed by its shape.*sequential"):
        case(TARGETS, assignment={"method": "one_shot"})


def written(folder: Path) -> Path:
    given = tree(TARGETS, expansion={"order": 2, "y": [0.03, 0.9]})
    file = folder / "case.yaml"
    file.write_text(json.dumps({"title": "followed", **given}))
    return file


def test_what_moves_in_a_report_is_the_mode_that_it_is_called() -> None:
    """No mode of the five masses is their antiresonance, though it is asked for first."""
    data = yaml.safe_load((CASES / "five_masses.yaml").read_text())
    data["targets"].reverse()
    case = ea.load_case(data)
    results = solve_case(case, Options(report="full", study="none")).results
    (motion,) = results.moving
    assert {one.name for one in motion.modes} == {f"mode {k}" for k in range(1, 6)}
    y = np.array([row.optimal for row in results.design])
    hz = case.model().frequencies(case.trajectory.q[0], y, 5)[0]
    for one in motion.modes:
        np.testing.assert_allclose(one.hz, hz[int(one.name[-1]) - 1], rtol=1e-9)
    row = results_document(results)["targets"][0]
    assert row["mode"] is None
    assert not row.get("followed")
