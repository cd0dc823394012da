"""Objectives that are no error: the lightest design, the highest mode, the widest room."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

import eigassign as ea
from eigassign.cli import main
from eigassign.pipeline import Options, solve_case
from eigassign.study import AimRow, AssignmentRow

CASES = Path(__file__).parents[2] / "cases"


def solved(
    name: str, objective: object, targets: object, **changes: object
) -> tuple[ea.Case, object, AssignmentRow, AimRow]:
    """A shipped case with another question: the case, its result, its row and what was reached."""
    content = yaml.safe_load((CASES / f"{name}.yaml").read_text())
    content = {**content, "targets": targets, "assignment": {"objective": objective}, **changes}
    case = ea.load_case({key: value for key, value in content.items() if value is not None})
    result = solve_case(case, Options(use_cache=False, study="none", report="none"))
    row = result.results.assignment
    return case, result, row, row.aim


def grid(case: ea.Case, count: int = 9) -> np.ndarray:
    """Designs all over the bounds."""
    parameters = case.file.design.parameters.values()
    each = [np.linspace(p.min, p.max, count) for p in parameters]
    return np.stack([axis.ravel() for axis in np.meshgrid(*each)], axis=1)


def test_the_lightest_design_keeps_its_limits_and_none_on_a_grid_is_lighter() -> None:
    limit = {"mode": 1, "at_least": 0.14, "trajectory": "lift"}
    keys = {"objective": "lightest", "max_error": 0.05}  # the sag changes so soft a boom by 4 %
    case, result, row, aim = solved("crane_boom", None, [limit], assignment=keys)
    assert row.verdict == "reached"
    initially = "initially 7960 kg, with limits broken"
    assert row.reason == f"lightest design found: 8208 kg ({initially}), all limits kept"
    rows, model = case.trajectory.rows_of("lift"), case.model()
    y = np.array(list(result.design.values()))
    assert row.objective_optimal == aim.optimal == pytest.approx(model.mass(y), rel=1e-12)

    def lowest(y: np.ndarray) -> float:
        return float(model.frequencies(case.trajectory.q[rows], y, 1).min())

    assert lowest(y) >= 0.14 * (1.0 - 1e-8)
    kept = [model.mass(y) for y in grid(case) if lowest(y) >= 0.14]
    assert aim.optimal <= min(kept) * (1.0 + 1e-9)


def test_without_targets_the_lightest_design_keeps_what_drives_may_exert() -> None:
    design = {
        "wall": {"parameter": "sections.tube.thickness", "min": "10 mm", "max": "16 mm"},
        "head": {"parameter": "bodies.head.mass", "min": 500, "max": 1500},
        "mass": {"min": 8000},
        "torque": {"luff": {"max": "2.7 MN m"}},
    }
    _, result, row, aim = solved("crane_boom", "lightest", None, design=design)
    assert row.verdict == "reached"
    assert aim.optimal == pytest.approx(8000.0, rel=1e-7)
    assert result.results.targets == ()
    assert result.results.error is None
    assert all(limit.satisfied for limit in row.limits)


def test_a_mode_is_highest_along_the_trajectory_that_is_named() -> None:
    design = {
        "diameter": {
            "parameter": "sections.tube.outer_diameter", "min": "600 mm", "max": "670 mm"},
        "wall": {"parameter": "sections.tube.thickness", "min": "12 mm", "max": "16 mm"},
        "mass": {"max": 9000},
    }  # fmt: skip
    objective = {"highest": {"mode": 1, "trajectory": "lift"}}
    case, _, row, aim = solved("crane_boom", objective, None, design=design)
    assert row.verdict == "reached"
    assert row.objective == "highest"
    model, rows = case.model(), case.trajectory.rows_of("lift")
    q = case.trajectory.q[rows]
    lowest = [
        model.frequencies(q, y, 1).min() for y in grid(case, 15) if model.mass(y) <= 9000.0
    ]  # fmt: skip
    assert -row.objective_optimal >= max(lowest)
    assert 1.0 - 1e-4 <= aim.optimal / -row.objective_optimal <= 1.0
    assert "mode 1 is at least 0.1" in row.reason
    assert "along 'lift' (initially 0.1305 Hz), all limits kept" in row.reason


def test_room_is_widest_and_bands_stay_checked() -> None:
    targets = [
        {"gap": {"between": [1, 2], "at_least": 20}},
        {"modes": "all", "keep_out": [85.0, 90.0]},
    ]
    case, result, row, aim = solved("arm_3r", "widest", targets)
    assert row.verdict == "reached"
    model, q = case.model(), case.trajectory.q

    def room(y: np.ndarray) -> float:
        f = model.frequencies(q, y, 3)
        clear = [
            min(1.0 - f[:, k - 1].max() / 85.0 if k else np.inf, f[:, k].min() / 90.0 - 1.0)
            for k in range(3)
        ]
        return float(min((f[:, 1] - f[:, 0]).min() / 20.0 - 1.0, max(clear)))

    best = max(room(y) for y in grid(case, 7))
    assert -row.objective_optimal >= best - 1e-9
    q = case.trajectory.finely.q  # what is told is the room between the samples too
    assert aim.optimal == pytest.approx(room(np.array([*result.design.values()])), rel=1e-3)
    assert row.clearances[0].clear
    assert row.reason.startswith("nearest band or gap: 8.769 %")


def test_a_price_of_the_mass_is_what_is_minimised_where_no_frequency_is_wanted() -> None:
    limit = {"mode": 1, "at_least": 0.14, "trajectory": "lift"}
    content = yaml.safe_load((CASES / "crane_boom.yaml").read_text())
    content["design"]["mass"] = {"price": "4 / kg"}
    content["assignment"] = {"max_error": 0.05}
    case = ea.load_case({**content, "targets": [limit]})
    result = ea.assign(case).results
    assert result.assignment.verdict == "reached"
    lightest = solved("crane_boom", "lightest", [limit])[3].optimal
    assert result.mass.optimal == pytest.approx(lightest, rel=1e-7)
    assert result.price == pytest.approx(4.0 * (lightest - result.mass.initial), rel=1e-6)
    assert result.assignment.objective_optimal == pytest.approx(result.price, rel=1e-9)


def test_a_search_that_was_ended_before_has_only_improved() -> None:
    keys = {"objective": {"highest": {"mode": 1, "trajectory": "lift"}}, "steps": 1, "starts": 1}
    keys["max_error"] = 0.05
    _, _, row, _ = solved("crane_boom", None, None, assignment=keys)
    assert row.verdict == "improved"
    assert "not first-order optimal" in row.reason
    assert row.reason.endswith("unfinished: steps used up")


def test_a_mode_that_does_not_exist_is_refused_by_check(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    content = yaml.safe_load((CASES / "two_link.yaml").read_text())
    del content["targets"]
    content["assignment"] = {"objective": {"highest": 900}}
    (tmp_path / "case.yaml").write_text(yaml.safe_dump(content))
    assert main(["check", str(tmp_path / "case.yaml")]) == 2
    assert "there is no mode 900: with these elements the model has" in capsys.readouterr().err


def test_the_page_and_the_files_say_what_was_reached(tmp_path: Path) -> None:
    content = yaml.safe_load((CASES / "two_link.yaml").read_text())
    del content["targets"]
    content["assignment"] = {"objective": {"highest": 1}}
    content["trajectory"]["samples"] = 20
    (tmp_path / "arm.yaml").write_text(yaml.safe_dump(content))
    out = tmp_path / "out"
    case = str(tmp_path / "arm.yaml")
    light = ["--report", "light", "--figures", "none", "--no-cache", "--quiet"]
    assert main(["optimize", case, "--out", str(out), *light]) == 0
    document = json.loads((out / "results.json").read_text())
    aim = document["assignment"]["aim"]
    assert aim["unit"] == "Hz"
    assert aim["optimal"] >= aim["initial"]
    assert document["targets"][0]["kind"] == "highest"
    assert document["targets"][0]["satisfied"]
    assert document["error"] is None
    page = (out / "report.html").read_text()
    assert "mode 1 is at least" in page.lower()
    assert " rms" not in page[: page.index("Sensitivity")]
    assert "mode 1 is at least" in (out / "log.txt").read_text()


LISTED = {
    "diameter": {
        "parameter": "sections.tube.outer_diameter",
        "values": ["39.5 mm", "40.2 mm", "40.8 mm", "41.5 mm"],
    },
    "m": {"parameter": "bodies.counterweight.mass", "values": [0, "40 g", "100 g"]},
}
AT_LEAST = {"mode": 1, "at_least": 75.5}
BAND = {"modes": "all", "keep_out": [85.0, 90.0]}


@pytest.mark.parametrize(
    ("objective", "targets"),
    [("lightest", [AT_LEAST]), ({"highest": 2}, [AT_LEAST]), ("widest", [BAND])],
)
def test_of_listed_values_none_is_better(objective: object, targets: list[object]) -> None:
    case, result, row, _ = solved("arm_3r", objective, targets, design=LISTED)
    assert row.verdict == "reached"
    assert row.optimality.kind == "proved"
    model, q = case.model(), case.trajectory.q
    values = [np.array(own.rows)[:, 0] for own in case.file.design.catalogues]
    worths = []
    for y in np.stack([axis.ravel() for axis in np.meshgrid(*values)], axis=1):
        f = model.frequencies(q, y, 3)
        if objective == "widest":
            sides = [(1.0 - f[:, k].max() / 85.0, f[:, k + 1].min() / 90.0 - 1.0) for k in range(2)]
            room = max(map(min, sides))
            worths.append((-room if room > 0.0 else np.inf, y))
        else:
            value = model.mass(y) if objective == "lightest" else -f[:, 1].min()
            worths.append((value if f[:, 0].min() >= 75.5 else np.inf, y))
    value, y = min(worths, key=lambda each: each[0])
    assert row.objective_optimal == pytest.approx(value, rel=1e-12)
    np.testing.assert_allclose(list(result.design.values()), y, rtol=1e-12)
