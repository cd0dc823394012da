"""Runs of cases whose trajectories set properties: folders, questions, and mistakes."""

from pathlib import Path

import numpy as np
import pytest
from load_cases import INERTIA, LOADED, MASS, alone, arm, case, text
from run_cases import solved, written

from eigassign import load_case
from eigassign.errors import CaseError, UsageError
from eigassign.output import results_document, sample_files
from eigassign.pipeline import Result, check, modes
from eigassign.study import read_measurements

TARGET = [{"mode": 1, "frequency": 13.0}]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Result:
    return solved(tmp_path_factory.mktemp("run"), text(arm(*LOADED, targets=TARGET)))


def test_one_design_is_verified_along_every_trajectory_with_what_that_sets(run: Result) -> None:
    tree = arm(*LOADED, targets=TARGET)
    y = np.array(list(run.design.values()))
    initial, exact = [], []
    for k in range(3):
        one = case(alone(tree, k))
        q = one.trajectory.q
        initial.append(one.model().frequencies(q, one.initial_design, 1)[:, 0])
        exact.append(one.model().frequencies(q, y, 1)[:, 0])
    np.testing.assert_allclose(run.initial_hz, np.concatenate(initial), rtol=1e-10)
    np.testing.assert_allclose(run.exact_hz, np.concatenate(exact), rtol=1e-10)


def test_results_say_what_each_trajectory_sets_and_tables_hold_coordinates_only(
    run: Result,
) -> None:
    document = results_document(run.results)
    assert [row["set"] for row in document["trajectories"]] == [
        {MASS: 3.0, INERTIA: 5e-3},
        {MASS: 0.0, INERTIA: 1e-3},
        {MASS: 0.5, INERTIA: 1e-3},
    ]
    header = sample_files(run.results)["trajectory_pick.csv"].decode().splitlines()[0]
    assert header == "time [s],q1 [rad],q2 [rad]"
    assert f"trajectory 'pick': {MASS} = 3 kg" in run.results.notes


def test_modes_take_the_coordinates_alone_or_with_the_loads(tmp_path: Path) -> None:
    path = written(tmp_path, text(arm(*LOADED)))
    as_written = modes(path, "30 deg 90 deg")
    assert as_written.q[2:] == ((MASS, 0.5), (INERTIA, 1e-3))
    assert as_written == modes(path, [np.radians(30), np.radians(90)])
    loaded = modes(path, "30 deg, 90 deg, 3 kg, 50 kg cm2")
    assert dict(loaded.q)[MASS] == 3.0
    assert loaded.frequencies_hz[0] < as_written.frequencies_hz[0]
    with pytest.raises(UsageError, match=rf"expected 4 values, q1, q2, {MASS}, {INERTIA}; got 3"):
        modes(path, "30 deg 90 deg 3 kg")
    with pytest.raises(UsageError, match=f"{MASS}.*expected a mass"):
        modes(path, "30 deg, 90 deg, 3 m, 50 kg cm2")
    with pytest.raises(UsageError, match="q has 3 values"):
        modes(path, [0.0, 0.1, 0.2])
    assert modes(path).q[0] == ("q1", 0.3)  # where the first trajectory starts, with its loads
    assert dict(modes(path).q)[MASS] == 3.0


def test_check_counts_coordinates_and_says_what_is_set(tmp_path: Path) -> None:
    answer = check(written(tmp_path, text(arm(*LOADED))))
    assert answer.q_names == ("q1", "q2")
    assert f"trajectory 'idle': {MASS} = 500 g" in answer.notes


@pytest.mark.parametrize(
    ("own", "message"),
    [
        ({"bodies.paylod.mass": 1.0}, "unknown body 'paylod'; did you mean 'payload'"),
        ({"bodies.payload.mas": 1.0}, "did you mean 'mass'"),
        ({MASS: "3 m"}, "expected a mass"),
        ({MASS: -1.0}, "must be >= 0 kg"),
        ({MASS: "heavy"}, "expected a mass"),
        ({"links.fore.elements": 3}, "cannot vary as it is in this file; can vary"),
        ({"links.fore.material": "al"}, "cannot vary as it is in this file; can vary"),
        ({"coordinates.q2.drive.inertia": 3}, "drive.inertia has no value in this file"),
        ({"bodies.elbow_mass.mass": 1.0}, "is the design parameter 'm1'"),
        ({MASS: None}, "has no value"),
        ({MASS: [1.0]}, "got"),
        ("heavy", "expected a mapping"),
    ],
)
def test_a_wrong_setting_is_told_where_it_is(own: object, message: str, tmp_path: Path) -> None:
    path = written(tmp_path, text(arm({}, own)))  # type: ignore[arg-type]
    with pytest.raises(CaseError, match=message) as caught:
        load_case(path)
    assert all(problem.path.startswith("trajectory[1].set") for problem in caught.value.problems)


def test_a_section_that_cannot_be_along_a_trajectory_is_refused(tmp_path: Path) -> None:
    tree = arm({}, {"sections.pipe.thickness": 0.03})
    tree["mechanism"]["sections"]["pipe"] = {
        "shape": "tube",
        "outer_diameter": 0.04,
        "thickness": 0.002,
    }
    with pytest.raises(CaseError, match="cannot exist") as caught:
        load_case(written(tmp_path, text(tree)))
    assert caught.value.problems[0].path == "trajectory[1].set.sections.pipe.thickness"


def test_a_frequency_measured_in_a_pose_is_of_the_load_that_its_trajectory_sets(
    tmp_path: Path,
) -> None:
    pose = {"q": [0.5, 1.6], "mode": 1, "frequency": 12.0, "deviation": "1 %"}
    measured = [{**pose, "trajectory": "pick"}, pose]
    case_file = load_case(written(tmp_path, text(arm(*LOADED, measurements=measured))))
    loaded, as_written = read_measurements(case_file)[0]
    assert loaded.q.tolist() == [0.5, 1.6, 3.0, 5e-3]
    assert as_written.q.tolist() == [0.5, 1.6, 0.5, 1e-3]
