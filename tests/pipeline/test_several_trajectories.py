"""Several trajectories in one case: one design for all, and nothing leaks over a seam."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from run_cases import ONE_SHOT, UNCACHED, case_of, shipped, solved, without, written
from scipy.optimize import lsq_linear

import eigassign as ea
from eigassign.errors import CaseError
from eigassign.output import results_document, sample_files, to_json
from eigassign.pipeline import Options, Result, check, optimize, validate

REST = without(shipped(), "trajectory", "targets") + ONE_SHOT
TARGETS = "targets:\n  - {mode: 1, frequency: 194 Hz}\n"  # that leaves m1 between its bounds
S = np.linspace(0.0, 1.0, 21)
PICK = np.column_stack([1.2 + S, 4.95 + 0.6 * S**2])
BACK = np.column_stack([2.2 - S, 5.55 - 0.7 * S + 0.2 * S**2])


def part(q: np.ndarray, duration: float = 1.0, **more: object) -> str:
    keys = {**more, "q": q.tolist(), "duration": duration}
    return json.dumps(keys)


def several(*parts: str, targets: str = TARGETS) -> str:
    return REST + targets + "trajectory:\n" + "".join(f"  - {p}\n" for p in parts)


def alone(one: str, targets: str = TARGETS) -> str:
    return REST + targets + f"trajectory: {one}\n"


def pair_of(targets: str = TARGETS) -> str:
    return several(part(PICK, name="pick"), part(BACK, 0.5, name="return"), targets=targets)


PAIR = pair_of()


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Result:
    return solved(tmp_path_factory.mktemp("pair"), PAIR)


@pytest.fixture(scope="module")
def singles(tmp_path_factory: pytest.TempPathFactory) -> tuple[Result, Result]:
    folder = tmp_path_factory.mktemp("singles")
    pick, back = alone(part(PICK)), alone(part(BACK, 0.5))
    return solved(folder, pick), solved(folder, back)


def test_a_list_of_one_is_bit_for_bit_the_mapping(tmp_path: Path) -> None:
    both = [solved(tmp_path, text) for text in (alone(part(PICK)), several(part(PICK)))]
    one, two = (json.loads(to_json(result.results)) for result in both)
    for key in ("case", "timing_s"):
        one.pop(key), two.pop(key)
    assert one == two


def test_what_is_known_before_the_design_is_that_of_two_runs(
    pair: Result, singles: tuple[Result, Result]
) -> None:
    for kind in ("target_hz", "initial_hz", "time_s"):
        stacked = np.concatenate([getattr(single, kind) for single in singles])
        np.testing.assert_allclose(getattr(pair, kind), stacked, rtol=1e-12)
    over = [study.over_time for r in (pair, *singles) for study in r.results.studies]
    for kind in ("taylor_hz", "linearised_hz"):
        whole, *each = (getattr(comparison, kind) for comparison in over)
        np.testing.assert_allclose(whole, np.concatenate(each), rtol=1e-12)


def hand_rows(pair: Result, weights: tuple[float, float] = (1.0, 1.0)) -> tuple[np.ndarray, ...]:
    """The rows of the least squares, written out by hand trajectory by trajectory."""
    rows, right = [], []
    for q, duration, weight in ((PICK, 1.0, weights[0]), (BACK, 0.5, weights[1])):
        l0, slope = (part[:, 0] for part in pair.linearised.slopes(q, [0.125, 0.125]))
        step, lam_d = duration / 20, (2 * np.pi * 194) ** 2
        for k in range(21):
            root = np.sqrt(weight * step * (0.5 if k in (0, 20) else 1.0)) / lam_d
            rows.append(root * slope[k, 2:])
            right.append(root * (lam_d - l0[k] + slope[k, 2:] @ [0.125, 0.125]))
    return np.array(rows), np.array(right)


def by_hand(pair: Result, weights: tuple[float, float] = (1.0, 1.0)) -> np.ndarray:
    found = lsq_linear(*hand_rows(pair, weights), (0.0, 0.25), method="bvls", tol=1e-15)
    return np.asarray(found.x)


def test_the_optimum_is_that_of_the_combined_least_squares(
    pair: Result, singles: tuple[Result, Result]
) -> None:
    design = list(pair.design.values())
    np.testing.assert_allclose(design, by_hand(pair), rtol=1e-9, atol=1e-12)
    for single in singles:
        assert abs(design[0] - single.design["m1"]) > 1e-4  # a compromise


@pytest.mark.parametrize("weights", [(3.0, 1.0), (0.2, 7.0)])
def test_each_trajectory_counts_by_its_weight(
    pair: Result, tmp_path: Path, weights: tuple[float, float]
) -> None:
    text = several(part(PICK, weight=weights[0]), part(BACK, 0.5, weight=weights[1]))
    design = list(solved(tmp_path, text).design.values())
    np.testing.assert_allclose(design, by_hand(pair, weights), rtol=1e-9, atol=1e-12)


def test_a_common_factor_of_all_weights_changes_nothing(pair: Result, tmp_path: Path) -> None:
    text = several(part(PICK, name="pick", weight=4), part(BACK, 0.5, name="return", weight=4))
    scaled = solved(tmp_path, text)
    np.testing.assert_allclose(list(scaled.design.values()), list(pair.design.values()), rtol=1e-10)
    one, two = (r.results.error for r in (pair, scaled))
    assert two.exact.rms_relative == pytest.approx(one.exact.rms_relative, rel=1e-9)


@pytest.mark.parametrize(("method", "rtol"), [("one_shot", 1e-9), ("sequential", 1e-7)])
def test_a_trajectory_cut_in_two_is_still_the_same_problem(
    tmp_path: Path, method: str, rtol: float
) -> None:
    """The trapezoidal rule over both halves adds up to the one over the whole.

    Steps end where slopes are balanced to 1e-7, wherever they started.
    """
    texts = alone(part(PICK)), several(part(PICK[:9], 0.4), part(PICK[8:], 0.6))
    whole, halves = (solved(tmp_path, text.replace("one_shot", method)) for text in texts)
    np.testing.assert_allclose(
        list(halves.design.values()), list(whole.design.values()), rtol=rtol, atol=1e-12
    )
    one, two = (r.results.error for r in (whole, halves))
    for kind in ("initial", "predicted", "exact"):
        a, b = getattr(one, kind), getattr(two, kind)
        assert b.rms_relative == pytest.approx(a.rms_relative, rel=rtol)
        assert b.max_relative == pytest.approx(a.max_relative, rel=rtol)


def test_the_errors_of_each_trajectory_are_those_of_its_own_samples(pair: Result) -> None:
    (target,) = pair.results.targets
    off = target.exact_hz / target.asked.hz - 1.0
    for along, rows in zip(target.along, (slice(0, 21), slice(21, 42)), strict=True):
        assert along.rows == rows
        assert along.error.exact.max_relative == pytest.approx(np.abs(off[rows]).max(), rel=1e-12)
        weights = np.ones(21)
        weights[[0, -1]] = 0.5
        rms = np.sqrt(weights @ off[rows] ** 2 / 20)
        assert along.error.exact.rms_relative == pytest.approx(rms, rel=1e-12)
    squares = [along.error.exact.rms_relative**2 for along in target.along]
    total = np.sqrt((1.0 * squares[0] + 0.5 * squares[1]) / 1.5)
    assert target.error.exact.rms_relative == pytest.approx(total, rel=1e-12)


def test_targets_of_trajectories_with_other_numbers_of_samples_are_each_solved_on_its_own(
    tmp_path: Path,
) -> None:
    short = BACK[::4]  # 6 samples beside 21
    targets = TARGETS.replace("Hz}", "Hz, trajectory: return}")
    targets += "  - {mode: 2, frequency: 470 Hz, weight: 2, trajectory: pick}\n"
    text = several(part(PICK, name="pick"), part(short, 0.5, name="return"), targets=targets)
    text = text.replace("modes: [1]", "modes: [1, 2]")
    both = solved(tmp_path, text)
    assert [len(lam) for lam in both.assignment.lam] == [6, 21]
    assert [len(hz) for hz in (both.time_s, both.target_hz, both.exact_hz)] == [6, 6, 6]

    rows, right = [], []
    for q, duration, mode, hz, weight in (
        (short, 0.5, 1, 194, 1.0),
        (PICK, 1.0, 2, 470, 2.0),
    ):
        l0, slope = (p[:, mode - 1] for p in both.linearised.slopes(q, [0.125, 0.125]))
        step, lam_d = duration / (len(q) - 1), (2 * np.pi * hz) ** 2
        share = np.full(len(q), weight * step)
        share[[0, -1]] /= 2
        root = np.sqrt(share)[:, None] / lam_d
        rows.append(root * slope[:, 2:])
        right.append(root[:, 0] * (lam_d - l0 + slope[:, 2:] @ [0.125, 0.125]))
    found = lsq_linear(np.vstack(rows), np.concatenate(right), (0, 0.25), method="bvls", tol=1e-15)
    y = np.array(list(both.design.values()))
    np.testing.assert_allclose(y, found.x, rtol=1e-9, atol=1e-12)
    model = case_of(tmp_path, text).model()
    for target, q in zip(both.results.targets, (short, PICK), strict=True):
        exact = model.frequencies(q, y, target.asked.mode)[:, -1]
        np.testing.assert_allclose(target.exact_hz, exact, rtol=1e-12)
    kept = results_document(both.results)
    assert [len(t["frequencies"]["time_s"]) for t in kept["targets"]] == [6, 21]
    table = sample_files(both.results)["frequencies.csv"].decode().splitlines()
    empty = [[not cell for cell in line.split(",")[4:]] for line in table[1:]]
    assert empty == [[True] * 5 + [False] * 5] * 21 + [[False] * 5 + [True] * 5] * 6


def test_a_target_on_one_trajectory_ignores_the_other(
    singles: tuple[Result, Result], tmp_path: Path
) -> None:
    targets = TARGETS.replace("Hz}", "Hz, trajectory: return}")
    result = solved(tmp_path, pair_of(targets))
    assert result.design == pytest.approx(dict(singles[1].design), rel=1e-9, abs=1e-12)
    found = results_document(result.results)
    assert found["targets"][0]["trajectory"] == "return"
    assert len(found["frequencies"]["time_s"]) == 21
    assert set(found["frequencies"]["trajectory"]) == {"return"}
    assert [row["error"] is None for row in found["trajectories"]] == [True, False]


def test_a_profile_runs_in_the_time_of_each_trajectory(tmp_path: Path) -> None:
    targets = "targets:\n  - {mode: 1, frequency: {time: [0, 1], frequency: [200, 180]}}\n"
    result = solved(tmp_path, several(part(PICK), part(BACK, 0.5), targets=targets))
    pick, back = result.target_hz[:21], result.target_hz[21:]
    np.testing.assert_allclose(pick, 200 - 20 * S)
    np.testing.assert_allclose(back, 200 - 10 * S)


FAR = BACK - np.array([0.0, 3.9])  # the elbow jumps by far more than half a turn between the two


def slow(result: Result) -> list[str]:
    """How much the motion changes."""
    notes = [note for note in result.results.notes if "velocity terms" in note]
    return [note.split("by about ")[1].split(" at ")[0] for note in notes]


def test_a_jump_between_trajectories_is_neither_fast_nor_a_jump(tmp_path: Path) -> None:
    # A sum of a slower part and a very quick seam would be noticed at once.
    near = REST.replace("order: 4", "order: 1")
    far = solved(
        tmp_path, near + TARGETS + f"trajectory:\n  - {part(PICK)}\n  - {part(FAR, 0.5)}\n"
    )
    each = [
        solved(tmp_path, near + TARGETS + f"trajectory: {one}\n")
        for one in (part(PICK), part(FAR, 0.5))
    ]
    joined = json.dumps({"q": [*PICK.tolist(), *FAR.tolist()], "duration": 1.5})
    one_motion = solved(tmp_path, near + TARGETS + f"trajectory: {joined}\n")
    assert any("jumps by" in note for note in one_motion.results.notes)
    assert not any("jumps by" in note for note in far.results.notes)
    assert slow(far)[0] in [slow(single)[0] for single in each]
    assert slow(one_motion) != slow(far)
    assert not any("not slow" in warning for warning in far.results.warnings)


def test_a_quick_trajectory_among_slow_ones_is_named(tmp_path: Path) -> None:
    result = solved(tmp_path, several(part(PICK), part(BACK, 0.001, name="dash")))
    (warning,) = [line for line in result.results.warnings if "not slow" in line]
    assert "of trajectory 'dash'" in warning


def test_the_expansion_point_is_central_over_all(tmp_path: Path) -> None:
    case = case_of(tmp_path, PAIR.replace("q: [1.817, 5.312] #", "q: auto #"))
    elbow = np.concatenate([PICK, BACK])[:, 1] - np.concatenate([PICK, BACK])[:, 0]
    farthest = np.abs(elbow[:, None] - elbow).max(axis=1)
    k = int(np.argmin(farthest))
    result = ea.assign(case)
    np.testing.assert_allclose(result.expansion.q0, case.trajectory.q[k])
    name = "pick" if k < 21 else "return"
    assert any(f"sample {k % 21} of trajectory '{name}'" in note for note in result.results.notes)


def test_automatic_orders_look_at_every_trajectory(tmp_path: Path) -> None:
    result = solved(tmp_path, PAIR.replace("order: 4", "order: auto\n  accuracy: 0.5 %"))
    lines = [note for note in result.results.notes if note.startswith("order ")]
    assert [line.partition(":")[0] for line in lines[:2]] == ["order 2", "order 4"]
    (study,) = result.results.studies
    assert study.over_time.worst["taylor"] < 0.005


def test_each_is_validated_and_counted_and_given_by_itself_and_stacked(tmp_path: Path) -> None:
    rows = validate(written(tmp_path, PAIR), UNCACHED).rows
    assert [row.where for row in rows[:2]] == ["trajectory 'pick'", "trajectory 'return'"]
    assert [row.points for row in rows[:2]] == [21, 21]
    answer = check(written(tmp_path, PAIR))
    assert answer.trajectories == (("pick", 21, 1.0), ("return", 21, 0.5))
    assert (answer.samples, answer.duration_s) == (42, 1.5)
    case = case_of(tmp_path, PAIR)
    (name, pick, weight), back = case.trajectories
    assert (name, weight, back.name) == ("pick", 1.0, "return")
    np.testing.assert_array_equal(np.vstack([pick.q, back.trajectory.q]), case.trajectory.q)


def test_an_error_of_one_trajectory_stands_at_its_own_line(tmp_path: Path) -> None:
    (tmp_path / "back.csv").write_text("time,q1,q2\n0,1,2\n1,1\n")
    text = several(part(PICK), "{file: back.csv}")
    with pytest.raises(CaseError) as caught:
        _ = case_of(tmp_path, text).trajectory
    (problem,) = caught.value.problems
    assert problem.path == "trajectory[1].file"
    assert problem.line == len(text.splitlines())
    assert "back.csv:3" in problem.message


def numbers(folder: Path) -> dict[str, object]:
    found = json.loads((folder / "results.json").read_text())
    return {k: v for k, v in found.items() if k not in ("case", "timing_s", "notes")}


def test_the_run_folder_reruns_from_its_case_and_from_its_csv_files(tmp_path: Path) -> None:
    little = Options(out=tmp_path / "one", use_cache=False, figures=(), report="none")
    optimize(written(tmp_path, PAIR), little)
    optimize(tmp_path / "one" / "case.yaml", replace(little, out=tmp_path / "two"))
    assert numbers(tmp_path / "two") == numbers(tmp_path / "one")
    files = [f"{{name: {n}, file: one/trajectory_{n}.csv}}" for n in ("pick", "return")]
    path = written(tmp_path, several(*files), "files.yaml")
    optimize(path, replace(little, out=tmp_path / "three"))
    assert numbers(tmp_path / "three") == numbers(tmp_path / "one")


def test_figures_and_files_of_each_trajectory_carry_its_name(tmp_path: Path) -> None:
    how = Options(out=tmp_path / "run", use_cache=False, figures=("svg",), report="light")
    optimize(written(tmp_path, PAIR), how)
    names = {p.relative_to(tmp_path / "run").as_posix() for p in (tmp_path / "run").rglob("*.*")}
    for stem in ("frequencies", "coordinates", "approximation_mode_1_time"):
        assert {f"figures/{stem}_pick.svg", f"figures/{stem}_return.svg"} <= names
        assert f"figures/{stem}.svg" not in names
    assert {"trajectory_pick.csv", "trajectory_return.csv", "frequencies.csv"} <= names
    page = (tmp_path / "run" / "report.html").read_text()
    assert "mode 1 at 194 Hz along &#39;pick&#39;" in page
    assert "Coordinates, trajectory &#39;return&#39;" in page


def test_the_drawn_tip_path_stops_where_a_trajectory_does(pair: Result) -> None:
    poses = pair.results.poses
    gaps = np.flatnonzero(np.isnan(poses.tip_path).any(axis=1))
    assert gaps.tolist() == [21]
    assert len(poses.tip_path) == 43
    assert poses.of[0] == "pick"
    assert poses.of[-1] == "return"


@pytest.mark.parametrize(
    ("given", "where"),
    [
        ("[{name: out, q: [[0.3], [0.5]], duration: 1 s}, "
         "{name: home, q: [[0.5], [0.9], [1.7]], duration: 1 s}]",
         "sample 2 of trajectory 'home'"),
        ("{q: [[0.5], [0.9], [1.7]], duration: 1 s}", "sample 2"),
    ],
)  # fmt: skip
def test_a_carriage_beyond_its_beam_is_refused_with_its_trajectory(
    tmp_path: Path, given: str, where: str
) -> None:
    text = (Path(__file__).parents[2] / "cases" / "gantry.yaml").read_text(encoding="utf-8")
    start, end = text.index("trajectory:"), text.index("design:")
    path = tmp_path / "gantry.yaml"
    path.write_text(f"{text[:start]}trajectory: {given}\n{text[end:]}", encoding="utf-8")
    with pytest.raises(CaseError, match=rf"joints\.[a-z]+: .*x = 1\.7 m \({where}\)"):
        _ = ea.load_case(path).trajectory
