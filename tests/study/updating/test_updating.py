"""Updating cases by measured frequencies: recovery, intervals, words, and measurements as given."""

import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from two_elastic_links import TWO_LINKS

from eigassign.case import Measurement, MeasurementFile, parse
from eigassign.errors import CaseError
from eigassign.pipeline import update_case
from eigassign.study import BuiltCase, UpdateResults, load_case, read_measurements

CASES = Path(__file__).parents[3] / "cases"


def shipped(name: str, poses: int, modes: int, truth: np.ndarray, **how: object) -> BuiltCase:
    """A shipped case with frequencies measured on the same mechanism with the design ``truth``."""
    case = load_case(CASES / f"{name}.yaml")
    q = case.trajectory.q[:: len(case.trajectory.q) // poses][:poses]
    hz = case.model().frequencies(q, np.tile(truth, (len(q), 1)), modes)
    return measuring(case, q, hz, **how)


def measuring(
    case: BuiltCase, q: np.ndarray, hz: np.ndarray, deviation: object = "0.5 %"
) -> BuiltCase:
    """The case with ``hz`` (n, modes) measured at ``q`` (n, n_q)."""
    listed = tuple(
        Measurement(q=tuple(map(float, pose)), mode=k, frequency=float(f), deviation=deviation)
        for pose, row in zip(q, hz, strict=True)
        for k, f in enumerate(row, start=1)
    )
    return BuiltCase(replace(case.file, measurements=listed))


def updated(case: BuiltCase) -> UpdateResults:
    return update_case(case).results


@pytest.mark.parametrize(
    ("name", "poses", "modes", "share"),
    [("two_link", 4, 2, (0.7, 0.4)), ("four_bar", 4, 3, None), ("luffing_boom", 4, 3, None)],
)
def test_the_parameters_of_a_perturbed_mechanism_are_recovered(
    name: str, poses: int, modes: int, share: tuple[float, ...] | None
) -> None:
    file = load_case(CASES / f"{name}.yaml").file
    bounds = np.array([(p.min, p.max) for p in file.design.parameters.values()])
    along = np.array(share or np.linspace(0.3, 0.8, len(bounds)))
    truth = bounds[:, 0] + along * (bounds[:, 1] - bounds[:, 0])
    results = updated(shipped(name, poses, modes, truth))
    np.testing.assert_allclose(list(results.design.values()), truth, rtol=1e-6)
    assert results.verdict == "fitted"
    assert results.unidentified == ()
    for row, true in zip(results.parameters, truth, strict=True):
        assert row.low < true < row.high


def test_the_shipped_update_finds_what_its_measurements_were_made_from() -> None:
    found = update_case(load_case(CASES / "arm_update.yaml"))
    results, case = found.results, found.case
    assert results.verdict == "fitted"
    truth = {"k1": 52.6e3, "k2": 17.8e3, "wrist": 1.83}
    for name, (low, high) in results.intervals.items():
        assert low < truth[name] < high
    assert case.file.design.parameters == {}
    left = case.file.uncertain
    assert {n: one.value for n, one in left.entries.items()} == pytest.approx(results.design)
    assert left.correlation["k2"]["wrist"] == pytest.approx(0.6554, abs=1e-4)
    at = [each.q for each in results.measurements]
    after = case.model().frequencies(np.array(at), (), 3)
    np.testing.assert_allclose(
        [row.updated_hz for row in results.measurements],
        [after[k, row.mode - 1] for k, row in enumerate(results.measurements)],
        rtol=1e-9,
    )
    assert results.measurements[0].label == "arm_update.csv:4"


def test_two_masses_on_one_node_are_told_only_together() -> None:
    text = (CASES / "two_link.yaml").read_text()
    text = text.replace("    tool_mass:", "    more: {at: forearm.end, mass: 0}\n    tool_mass:")
    text = text.replace(
        "\nexpansion:", "  m3: {parameter: bodies.more.mass, min: 0, max: 250 g}\n\nexpansion:"
    ).replace("y: [0.125, 0.125]", "y: [0.125, 0.125, 0.1]")
    base = case_of(text)
    q = base.trajectory.q[::40]
    hz = base.model().frequencies(q, np.tile((0.1, 0.08, 0.05), (len(q), 1)), 2)
    results = updated(measuring(base, q, hz))
    assert results.verdict == "not_identified"
    (direction,) = results.unidentified
    assert direction.words == "m2 and m3 are determined only together, as m2 + m3"
    assert direction.change["m2"] == pytest.approx(-direction.change["m3"], rel=1e-6)
    assert results.design["m1"] == pytest.approx(0.1, rel=1e-6)
    assert results.design["m2"] + results.design["m3"] == pytest.approx(0.13, rel=1e-6)
    rows = {row.name: row for row in results.parameters}
    assert rows["m1"].deviation is not None
    assert rows["m2"].deviation is None
    assert (rows["m2"].low, rows["m2"].low_is_bound) == (0.0, True)
    assert rows["m2"].high == pytest.approx(results.design["m2"] + results.design["m3"], abs=0.02)


def test_what_scales_together_is_told_in_per_cent_though_a_bound_holds() -> None:
    """Of E, ρ and a mass the frequencies tell ratios; 2 g that are not there hold ρ at a bound."""
    text = (CASES / "two_link.yaml").read_text()
    design = """design:
  E: {parameter: materials.aluminium.youngs_modulus, min: 40 GPa, max: 200 GPa}
  rho: {parameter: materials.aluminium.density, min: 2000, max: 3500}
  m2: {parameter: bodies.tool_mass.mass, min: 0.05, max: 2}

"""
    text = text[: text.index("design:")] + design + text[text.index("targets:") :]
    true, truth = case_of(text), {"E": 69e9, "rho": 2700.0, "m2": 0.2}
    q = true.trajectory.q[::50]
    hz = true.model().frequencies(q, np.tile(list(truth.values()), (len(q), 1)), 2)
    text = text.replace("upper_arm.end, mass: 0}", "upper_arm.end, mass: 0.002}")
    results = updated(measuring(case_of(text), q, hz))
    assert [row.held for row in results.parameters] == ["", "upper", ""]
    for name, (low, high) in results.intervals.items():
        assert low < truth[name] < high
    assert results.intervals["rho"] == (2000.0, 3500.0)
    assert results.verdict == "not_identified"
    (direction,) = results.unidentified
    same = "E, rho and m2 can change together without effect, all by the same percentage"
    assert direction.words == same
    assert [row.deviation for row in results.parameters] == [None] * 3
    assert any("assume rho at its upper bound" in note for note in results.notes)


def test_a_fit_that_explains_nothing_is_sought_from_other_starts_too() -> None:
    """From a longer link with a heavier tip there is another minimum, at χ² = 200."""
    case = copy.deepcopy(TWO_LINKS)
    case["mechanism"]["links"]["a"]["length"] = 0.8313
    case["mechanism"]["bodies"]["tool"]["mass"] = 4.7275
    case["design"] = {
        "la": {"parameter": "links.a.length", "min": 0.722, "max": 0.9},
        "tip": {"parameter": "bodies.tool.mass", "min": 0.55, "max": 10},
        "mass": {"max": 1},
    }
    model, truth = load_case(case).model(), np.array([0.735, 2.66])
    poses = np.array([[0.871, 0.598, 0.388, 0.15, 0.379, 0.59],
                      [0.995, 0.33, 0.911, 1.996, 2.353, 1.531]]).T  # fmt: skip
    found = updated(measuring(load_case(case), poses, model.frequencies(poses, truth, 2), "0.4 %"))
    assert found.verdict == "fitted"
    np.testing.assert_allclose([row.value for row in found.parameters], truth, rtol=1e-4)
    notes = " ".join(found.notes)
    assert "starts led to 2 distinct minima" in notes
    assert "left aside" in notes


def test_a_wrong_measurement_is_an_outlier_and_the_fit_poor() -> None:
    truth = np.array([0.13, 0.09])
    case = shipped("two_link", 6, 2, truth)
    given = list(case.file.measurements)  # type: ignore[arg-type]
    given[3] = given[3].model_copy(update={"frequency": given[3].frequency * 1.05})
    results = updated(BuiltCase(replace(case.file, measurements=tuple(given))))
    assert results.verdict == "poor_fit"
    off = [row.label for row in results.measurements if row.is_outlier]
    assert off[0] == "measurements[3]"


# --- Measurements as they are given


def case_of(text: str, folder: Path = CASES) -> BuiltCase:
    return BuiltCase(parse(text.encode(), folder / "two_link.yaml"))


def from_file(folder: Path, content: str, name: str = "two_link", **keys: object) -> BuiltCase:
    (folder / "m.csv").write_text(content)
    given = MeasurementFile(file=str(folder / "m.csv"), **keys)  # type: ignore[arg-type]
    return BuiltCase(replace(load_case(CASES / f"{name}.yaml").file, measurements=given))


def test_measurements_are_read_in_si_and_placed(tmp_path: Path) -> None:
    content = "time [ms],mode,frequency [kHz],deviation [%],by\n500,1,0.19,0.5,x\n503,2,0.5,1,x\n"
    case = from_file(tmp_path, content)
    rows, notes = read_measurements(case)
    assert [(r.label, r.mode, r.hz) for r in rows] == [("m.csv:2", 1, 190.0), ("m.csv:3", 2, 500.0)]
    np.testing.assert_allclose([r.deviation_hz for r in rows], [0.95, 5.0])
    assert [r.time_s for r in rows] == [0.5, 0.503]
    path = case.trajectory  # between its samples, and not on the chord
    chord = [np.interp(0.503, path.time_s, path.q[:, i]) for i in range(2)]
    assert 1e-7 < np.abs(rows[1].q - chord).max() < 1e-5
    assert notes == ("m.csv: ignored the columns by",)


def test_a_deviation_for_all_rows_stands_in_the_case(tmp_path: Path) -> None:
    content = "q1 [deg],q2,mode,frequency\n104,5.3,1,190\n"
    for given, wanted in (("0.5 %", 0.95), (0.3, 0.3)):
        rows, _ = read_measurements(from_file(tmp_path, content, deviation=given))
        assert rows[0].deviation_hz == pytest.approx(wanted)
        np.testing.assert_allclose(rows[0].q, [np.radians(104), 5.3])


def test_measurements_without_modes_are_paired_by_frequency_and_said(tmp_path: Path) -> None:
    """In any order, with every frequency 10 % low, and where the file calls columns otherwise."""
    case = case_of((CASES / "two_link.yaml").read_text())
    hz = 0.9 * case.model().frequencies(case.trajectory.q[0], case.initial_design, 4)[0]
    rows = "".join(f"0,{hz[mode]},0.1\n" for mode in (2, 0, 1))
    named = {"columns": {"frequency": "peak [Hz]", "time": "t"}}
    content = f"t,peak,deviation\n{rows}"
    measured, _ = read_measurements(from_file(tmp_path, content, **named))
    assert [each.mode for each in measured] == [3, 1, 2]
    found = updated(from_file(tmp_path, content, **named))
    (said,) = (w for w in found.warnings if "paired by frequency" in w)
    assert f"m.csv:2, {hz[2]:g} Hz, is mode 3, {hz[2] / 0.9:.4g} Hz there" in said
    twice = f"time,mode,frequency,deviation\n0,1,{hz[0]},0.1\n"
    measured, _ = read_measurements(from_file(tmp_path, twice))
    assert measured[0].paired_hz is None


def test_ranges_stand_in_two_columns_of_a_file(tmp_path: Path) -> None:
    rows, _ = read_measurements(from_file(tmp_path, f"{RANGES}\n0,1,1,10.1,10.4\n0,1,2,32,34\n"))
    both = [(row.hz, row.deviation_hz, row.is_range) for row in rows]
    np.testing.assert_allclose(both, [(10.25, 0.15, True), (33.0, 1.0, True)])


def test_of_several_trajectories_each_row_names_its_own(tmp_path: Path) -> None:
    case = load_case(CASES / "five_bar.yaml")
    names = [name for _, name, _ in case.file.trajectories]
    content = f"time,trajectory,mode,frequency,deviation\n0,{names[1]},1,50,1\n"
    case = from_file(tmp_path, content, "five_bar")
    rows, _ = read_measurements(case)
    np.testing.assert_array_equal(rows[0].q, case.trajectories[1].trajectory.q[0])
    for wrong, why in ((",", "which trajectory"), (",nowhere", "unknown trajectory 'nowhere'")):
        content = f"time,trajectory,mode,frequency,deviation\n0{wrong},1,50,1\n"
        with pytest.raises(CaseError, match=f"m.csv:2: {why}"):
            read_measurements(from_file(tmp_path, content.replace(",,", ",,"), "five_bar"))


HEADER = "time,mode,frequency,deviation"
RANGES = "q1,q2,mode,lower,upper [Hz]"
ALONE = "of ranges give lower and upper alone"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "m.csv: is empty"),
        (f"{HEADER}\n", "m.csv: no measurements"),
        ("time,mode,deviation\n0,1,1\n", "m.csv:1: no column frequency"),
        ("time,mode,frequency\n0,1,1\n", "m.csv:1: no column deviation"),
        ("mode,frequency,deviation\n1,1,1\n", "either the column time, or one for each coordinate"),
        ("q1,mode,frequency,deviation\n1,1,1,1\n", "either the column time, or one for each"),
        ("time,q1,q2,mode,frequency,deviation\n0,1,2,1,1,1\n", "either the column time, or one"),
        ("time,mode,frequency [rad/s],deviation\n0,1,1,1\n", "is no unit of frequency"),
        ("time,mode,frequency [herz],deviation\n0,1,1,1\n", "unknown unit 'herz'"),
        ("time,mode [Hz],frequency,deviation\n0,1,1,1\n", "column mode: .* is no unit"),
        ("time,mode,frequency,deviation [kg]\n0,1,1,1\n", "column deviation: .* is no unit"),
        (f"{HEADER}\n0,1,nan,1\n", "m.csv:2: column frequency: 'nan' is not a finite number"),
        (f"{HEADER}\n0,1,-3,1\n", "m.csv:2: column frequency: must be > 0 Hz, got -3"),
        (f"{HEADER}\n0,1,3,1\n0,1,3,-1\n", "m.csv:3: column deviation: must be > 0, got -1.0"),
        (f"{HEADER}\n0,1,3,0\n", "m.csv:2: column deviation: must be > 0"),
        (f"{HEADER}\n0,0,3,1\n", "m.csv:2: column mode: 0 is not a mode"),
        (f"{HEADER}\n0,1.5,3,1\n", "m.csv:2: column mode: 1.5 is not a mode"),
        (f"{HEADER}\n0,1e9,3,1\n", r"m.csv:2: column mode: 1e\+09 is not a mode"),
        (f"{HEADER}\n7,1,3,1\n", "m.csv:2: 7 s is outside: the trajectory lasts from 0 to 1 s"),
        (f"{HEADER}\n0,1,3\n", "m.csv:2: 3 values for 4 columns"),
        (f"{RANGES}\n0,1,1,10.4,10.1\n", "m.csv:2: lower 10.4 is not below upper 10.1"),
        (f"{RANGES}\n0,1,1,-1,10\n", "m.csv:2: column lower: must be > 0 Hz, got -1"),
        ("q1,q2,mode,lower\n0,1,1,10\n", ALONE),
        (f"{RANGES},deviation\n0,1,1,9,10,1\n", ALONE),
        (f"{RANGES},frequency\n0,1,1,9,10,9.5\n", ALONE),
        ("q1,q2,mode,upper\n0,1,1,10\n", "m.csv:1: no column frequency"),
    ],
)
def test_files_that_hold_no_measurements_are_refused(
    tmp_path: Path, content: str, message: str
) -> None:
    with pytest.raises(CaseError, match=message) as error:
        read_measurements(from_file(tmp_path, content))
    assert error.value.exit_code == 2


def test_a_deviation_for_all_ranges_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CaseError, match=ALONE):
        read_measurements(from_file(tmp_path, f"{RANGES}\n0,1,1,9,10\n", deviation="1 %"))


def test_a_case_that_lacks_measurements_and_parameters_is_told_both() -> None:
    text = (CASES / "two_link.yaml").read_text()
    text = text[: text.index("design:")] + text[text.index("validation:") :]
    with pytest.raises(CaseError) as error:
        update_case(case_of(text))
    assert [p.path for p in error.value.problems] == ["design", "measurements"]
