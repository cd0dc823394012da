"""What the drives of the paper's arm carry under its weight, and limits of it."""

import csv
import io
from itertools import product

import numpy as np
import pytest
from run_cases import DESIGN, TAIL, answered, changed, held

from eigassign.case import parse
from eigassign.output import results_document, run_figures, run_tables, sample_files
from eigassign.pipeline import Result, solve_case
from eigassign.study import AssignmentRow, BuiltCase

HEAD = held(changed(("samples: 152", "samples: 21"))).split("design: #")[0]
WANTED = "  - {mode: 1, frequency: 30 Hz}\n"


def solved(
    design: str = DESIGN, targets: str = WANTED, head: str = HEAD
) -> tuple[Result, AssignmentRow]:
    return answered(head + design + TAIL + targets)


def test_every_place_says_what_the_drives_carry_before_and_after() -> None:
    result, _ = solved(DESIGN + "  torque: {q1: {max: 50 N m}}\n")
    q1, q2 = result.results.drives
    case = BuiltCase(parse((HEAD + DESIGN + TAIL + WANTED).encode(), "case.yaml"))
    y = np.array(list(result.design.values()))
    drives = case.model().drives
    np.testing.assert_allclose(q1.optimal_curve, drives.along(case.trajectory, y)[1][:, 0])
    assert (q1.unit, q1.of, q1.limit, q2.limit) == ("N m", "weight and motion", 50.0, None)
    fine = case.trajectory.finely
    peak = np.abs(drives.curves(fine, np.array([row.initial for row in result.results.design])))
    assert q2.initial.peak == peak[:, 1].max() > np.abs(q2.initial_curve).max()
    assert fine.where(int(peak[:, 1].argmax())) == q2.initial.at
    kept = results_document(result.results)["drives"]
    assert kept["q2"]["initial"]["peak"] == q2.initial.peak
    rows = list(csv.DictReader(io.StringIO(sample_files(result.results)["drives.csv"].decode())))
    np.testing.assert_allclose(
        [float(row["q1 torque exact [N m]"]) for row in rows], q1.optimal_curve
    )
    (table,) = [t for t in run_tables(result.results) if t.title == "What the drives carry"]
    assert [row[0] for row in table.rows] == ["q1", "q2"]
    assert "drives" in [plan.name for plan in run_figures(result.results)]


def test_without_weight_the_motion_is_told_alone_and_without_both_nothing() -> None:
    head = HEAD.replace("  gravity: [0, -9.81]\n", "")
    result, _ = solved(head=head)
    assert {row.of for row in result.results.drives} == {"the motion alone (gravity is not stated)"}
    assert "drives" not in [plan.name for plan in run_figures(result.results)]
    limited, _ = solved(DESIGN + "  torque: {q1: {max: 50 N m}}\n", head=head)
    assert "drives" in [plan.name for plan in run_figures(limited.results)]
    still = head[: head.index("trajectory:")] + "trajectory: {q: [[1, 5], [1, 5]], duration: 1 s}\n"
    result, _ = solved(head=still)
    assert result.results.drives == ()
    assert "drives.csv" not in sample_files(result.results)


def test_a_limit_of_a_torque_holds_at_every_instant_and_is_named_where_it_binds() -> None:
    free, _ = solved()
    worst = free.results.drives[0].optimal.peak
    least = free.results.drives[0].initial.peak
    assert least < worst
    asked = least + 0.5 * (worst - least)
    result, row = solved(DESIGN + f"  torque: {{q1: {{max: {asked:.6f} N m}}}}\n")
    assert result.results.drives[0].optimal.peak == pytest.approx(asked, rel=1e-6)
    assert "design.torque.q1" in [limit.name for limit in row.active]
    (limit,) = row.limits
    assert (limit.unit, limit.lower, limit.satisfied) == ("N m", None, True)
    # nothing on a fine grid is better and keeps it
    case = BuiltCase(parse((HEAD + DESIGN + TAIL + WANTED).encode(), "case.yaml"))
    model, path = case.model(), case.trajectory
    best = min(
        np.sqrt(np.mean((model.frequencies(path.q, y, 1) / 30.0 - 1.0)[:, 0] ** 2))
        for y in product(np.linspace(0, 0.25, 11), repeat=2)
        if np.abs(model.drives.along(path.finely, np.array(y))[1][:, 0]).max() <= asked
    )
    hz = result.results.targets[0].exact_hz
    assert np.sqrt(np.mean((hz / 30.0 - 1.0) ** 2)) <= best * (1 + 1e-9)


def test_a_torque_that_no_design_keeps_is_infeasible_with_place_and_least_amount() -> None:
    result, row = solved(DESIGN + "  torque: {q1: {max: 3 N m}}\n")
    assert row.verdict == "infeasible"
    assert row.conflict == ("design.torque.q1",)
    (limit,) = row.limits
    assert limit.extreme == pytest.approx(result.results.drives[0].initial.peak)
    assert "torque of q1" in row.reason
    assert "at an instant between samples 17 and 18" in row.reason
    assert "at most 3 N m" in row.reason


def test_a_torque_that_a_search_alone_does_not_meet_is_not_called_infeasible() -> None:
    """A length moves links: the loads are not affine, and another design may keep the limit."""
    design = DESIGN + (
        "  l: {parameter: links.forearm.length, min: 0.44, max: 0.46}\n"
        "  torque: {q1: {max: 3 N m}}\n"
    )
    _, row = solved(design)
    assert row.verdict in ("do_not_use", "unreachable")
    assert "torque of q1" in row.reason
    assert row.conflict == ()


def test_limits_count_along_every_trajectory_with_its_load() -> None:
    start = HEAD.index("trajectory:")
    motion = "points: [[1.2, 5.0], [2.2, 5.5]], duration: 1 s, samples: 9"
    head = HEAD[:start] + (
        "trajectory:\n"
        f"  - {{name: empty, {motion}}}\n"
        f"  - {{name: loaded, {motion}, set: {{bodies.hook.mass: 2 kg}}}}\n"
    )
    head = head.replace(
        "bodies:", "bodies:\n    hook: {at: forearm.end, mass: 0, offset: [1 mm, 0]}"
    )
    tail_q = "\nexpansion: {order: 2, modes: [1]}\ntargets:\n"
    text = head + DESIGN + "  torque: {q2: {max: 5 N m}}\n" + tail_q + WANTED
    result = solve_case(BuiltCase(parse(text.encode(), "case.yaml")))
    q2 = result.results.drives[1]
    assert "'loaded'" in q2.initial.at
    assert q2.initial.peak > 5.0
    assert "along" in result.results.assignment.reason or "trajectory 'loaded'" in (
        result.results.assignment.reason
    )


def test_lists_of_values_keep_limits_of_torques() -> None:
    listed = (
        "design:\n"
        "  m1: {parameter: bodies.elbow_mass.mass, values: [0, 50 g, 100 g, 150 g, 250 g]}\n"
        "  m2: {parameter: bodies.tool_mass.mass, values: [0, 50 g, 100 g, 150 g, 250 g]}\n"
    )
    case = BuiltCase(parse((HEAD + listed + TAIL + WANTED).encode(), "case.yaml"))
    model, path, values = case.model(), case.trajectory, [0.0, 0.05, 0.1, 0.15, 0.25]

    def worth(y: tuple[float, ...]) -> float:
        hz = model.frequencies(path.q, y, 1)[:, 0]
        weights = np.gradient(path.time_s)
        weights[[0, -1]] /= 2
        return float(weights @ (hz / 30.0 - 1.0) ** 2)

    peaks = {
        y: np.abs(model.drives.along(path.finely, np.array(y))[1][:, 0]).max()
        for y in product(values, repeat=2)
    }
    asked = float(np.median(list(peaks.values())))
    result, row = solved(listed + f"  torque: {{q1: {{max: {asked * (1 + 1e-9)!r}}}}}\n")
    best = min((y for y in peaks if peaks[y] <= asked), key=worth)
    assert tuple(result.design.values()) == pytest.approx(best)
    assert row.optimality.kind == "proved"


VARIED = {  # that move the links, and that do not
    "m1": ("bodies.elbow_mass.mass", 0.0, 0.25),
    "m2": ("bodies.tool_mass.mass", 0.0, 0.25),
    "l": ("links.forearm.length", 0.43, 0.47),
    "k": ("coordinates.q1.drive.stiffness", 5e4, 3e5),
    "J": ("coordinates.q2.drive.inertia", 0.001, 0.05),
}


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_no_design_of_a_grid_keeps_a_random_limit_and_is_better(seed: int) -> None:
    rng = np.random.default_rng(seed)
    names = rng.choice(list(VARIED), 2, replace=False)
    own = [VARIED[name] for name in names]
    design = "design:\n" + "".join(
        f"  {name}: {{parameter: {path}, min: {low}, max: {high}}}\n"
        for name, (path, low, high) in zip(names, own, strict=True)
    )
    head = HEAD.replace("duration: 1 s", f"duration: {rng.choice([0.3, 1.0])} s")
    case = BuiltCase(parse((head + design + TAIL + WANTED).encode(), "case.yaml"))
    model, path, column = case.model(), case.trajectory, int(rng.integers(2))
    weights = np.gradient(path.time_s)
    weights[[0, -1]] /= 2
    grid = [np.array(y) for y in product(*(np.linspace(low, high, 13) for _, low, high in own))]
    whole, times = path.parts[0].trajectory, np.linspace(*path.time_s[[0, -1]], 4001)
    peaks = [np.abs(model.drives.exerted(whole, times, y)[:, column]).max() for y in grid]
    hz = [model.frequencies(path.at(y)[0], y, 1)[:, 0] for y in grid]
    means = [weights @ one / weights.sum() for one in hz]
    asked = round(float(rng.uniform(min(means), max(means))), 4)
    limit = float(np.quantile(peaks, rng.uniform(0.0, 0.5)))
    errors = [np.sqrt(weights @ (one / asked - 1.0) ** 2 / weights.sum()) for one in hz]
    best = min(error for error, peak in zip(errors, peaks, strict=True) if peak <= limit)
    torque = f"  torque: {{q{column + 1}: {{max: {limit!r}}}}}\n"
    result, row = solved(design + torque, f"  - {{mode: 1, frequency: {asked} Hz}}\n", head)
    assert result.results.drives[column].optimal.peak <= limit * (1 + 1e-7)
    assert result.results.error.exact.rms_relative <= best * (1 + 1e-6)
    assert row.verdict != "infeasible"
