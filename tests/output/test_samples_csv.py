"""CSV files of a run read back to the last bit."""

import csv
import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_results import as_limit, make_results

from eigassign.mechanism import read_samples
from eigassign.output import sample_files
from eigassign.study import Comparison, ModeRow, RunResults


def rows_of(data: bytes) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(data.decode(), newline="")))


def with_tips(results: RunResults) -> RunResults:
    rng = np.random.default_rng(5)
    n = [row.rows.stop - row.rows.start for row in results.trajectories]
    tips = [rng.normal(size=(k, 3)) * 10.0 ** rng.integers(-9, 9, (k, 1)) for k in n]
    pairs = zip(results.trajectories, tips, strict=True)
    return replace(results, trajectories=tuple(replace(row, tip=tip) for row, tip in pairs))


@pytest.mark.parametrize("parts", [(152,), (100, 52)])
def test_a_trajectory_reads_back_bit_for_bit_and_silently(
    tmp_path: Path, parts: tuple[int, ...]
) -> None:
    results = with_tips(make_results(n_q=5, parts=parts))
    for row, (name, data) in zip(
        results.trajectories, list(sample_files(results).items())[:-1], strict=True
    ):
        (tmp_path / name).write_bytes(data)
        table = read_samples(tmp_path / name, results.q_names, results.q_units)
        assert table.time_s.tobytes() == np.ascontiguousarray(results.time_s[row.rows]).tobytes()
        assert table.q.tobytes() == np.ascontiguousarray(results.q[row.rows]).tobytes()
        assert table.notes == ()
        tip = [[float(line[f"tip {axis} [m]"]) for axis in "xyz"] for line in rows_of(data)]
        np.testing.assert_array_equal(tip, row.tip)


def test_files_are_named_after_their_trajectories() -> None:
    assert list(sample_files(make_results())) == ["trajectory.csv", "frequencies.csv"]
    assert list(sample_files(make_results(parts=(150, 2)))) == [
        "trajectory_part0.csv",
        "trajectory_part1.csv",
        "frequencies.csv",
    ]
    assert sample_files(make_results(n_t=0)) == {}


def test_frequencies_stand_beside_time_and_pose() -> None:
    results = make_results(n_targets=2, parts=(100, 52))
    rows = rows_of(sample_files(results)["frequencies.csv"])
    assert [row["trajectory"] for row in rows] == ["part0"] * 100 + ["part1"] * 52
    for target in results.targets:
        for kind in ("target", "initial", "predicted", "exact"):
            column = [float(row[f"mode {target.asked.mode} {kind} [Hz]"]) for row in rows]
            np.testing.assert_array_equal(column, getattr(target.frequencies, f"{kind}_hz"))
    np.testing.assert_array_equal([float(row["q2 [rad]"]) for row in rows], results.q[:, 1])
    assert "trajectory" not in rows_of(sample_files(make_results())["frequencies.csv"])[0]


def test_a_target_on_one_trajectory_leaves_the_others_empty() -> None:
    results = make_results(parts=(100, 52))
    (target,) = results.targets
    rows = slice(100, 152)
    names = [f"{k}_hz" for k in ("initial", "one_shot", "predicted", "exact")]
    narrow = replace(
        target,
        asked=target.asked.part("part1", rows),
        **{name: getattr(target, name)[rows] for name in names},
    )
    lines = rows_of(sample_files(replace(results, targets=(narrow,)))["frequencies.csv"])
    assert [line["mode 1 exact [Hz]"] for line in lines[:100]] == [""] * 100
    assert float(lines[100]["mode 1 exact [Hz]"]) == target.exact_hz[100]


def test_a_limit_beside_a_target_of_the_same_mode_overwrites_nothing() -> None:
    results = make_results()
    (target,) = results.targets
    limit = as_limit(target, "at_most", np.full(152, -np.inf), np.full(152, 205.0))
    other = np.full(152, 180.0)
    twice = replace(target, asked=replace(target.asked, lower=other, upper=other))
    band = as_limit(target, "keep_out", np.full(152, 150.0), np.full(152, 160.0))
    near = tuple(ModeRow(k, np.full(152, 140.0), np.full(152, 170.0)) for k in (1, 2))
    band = replace(band, near=near)
    rows = rows_of(
        sample_files(replace(results, targets=(target, limit, twice, band)))["frequencies.csv"]
    )

    def column(heading: str) -> list[float]:
        return [float(row[f"{heading} [Hz]"]) for row in rows]

    np.testing.assert_array_equal(column("mode 1 target"), target.asked.hz)
    np.testing.assert_array_equal(column("mode 1 (2) target"), np.full(152, 180.0))
    np.testing.assert_array_equal(column("mode 1 at_most target"), np.full(152, 205.0))
    np.testing.assert_array_equal(column("mode 1 at_most exact"), limit.exact_hz)
    assert column("mode 1 keep_out upper") == [160.0] * 152
    assert column("mode 1 keep_out mode 2 exact") == [170.0] * 152
    assert "mode 1 at_most predicted [Hz]" not in rows[0]


def test_without_targets_the_expansions_are_written_with_their_gaps() -> None:
    results = make_results(n_targets=0)
    (study,) = results.studies
    holed = study.over_time.taylor_hz.copy()
    holed[3] = np.nan
    over = Comparison(study.over_time.exact_hz, holed, study.over_time.linearised_hz)
    changed = replace(results, studies=(replace(study, over_time=over),))
    lines = rows_of(sample_files(changed)["frequencies.csv"])
    assert lines[3]["mode 1 taylor [Hz]"] == ""
    assert float(lines[4]["mode 1 taylor [Hz]"]) == holed[4]
    assert float(lines[3]["mode 1 exact [Hz]"]) == over.exact_hz[3]
