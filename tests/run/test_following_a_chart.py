"""From a chart to a run in two steps: what is followed, when not, and what the log says."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from eigassign.api import load_case
from eigassign.chart.effort import Effort
from eigassign.chart.study import Wish
from eigassign.chart.timing import Patience
from eigassign.errors import CaseError
from eigassign.modal.adaptive import order as expansion_choice
from eigassign.output.chart_report import to_json
from eigassign.pipeline.chart import chart_case, with_lines
from eigassign.pipeline.run import Options, optimize, solve_case

SHIPPED = (Path(__file__).parents[2] / "cases" / "two_link.yaml").read_text()
EFFORT = Effort(
    random_points=20, designs=2, samples_per_design=9, orders=(3, 4, 5, 6), half_orders=(),
    expansion_points=(1,), nodes=(), stations=(), accuracies=(), training=(27,), kriging=0,
    reference_s=1e9, training_s=1e9, factors=(1.0,), objectives=3, searched_s=0.1,
    patience=Patience(rounds=1, seconds=0.0, long_s=60.0),
)  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shipped case beside a chart of it, in a folder that holds nothing else."""
    home = tmp_path_factory.mktemp("home")
    (home / "arm.yaml").write_text(SHIPPED)
    case = load_case(home / "arm.yaml")
    made = chart_case(case, Options(), EFFORT, Wish(accuracy=1e-3))
    made = with_lines(made, case.file, home / "charted")
    (home / "charted").mkdir()
    (home / "charted" / "chart.json").write_text(to_json(made))
    (home / "line.txt").write_text(made.advice[0].use)
    return home


def replaced(line: str) -> str:
    """The case with this line in the place of its expansion."""
    start, end = SHIPPED.index("expansion:"), SHIPPED.index("targets:")
    return f"{SHIPPED[:start]}{line}\n{SHIPPED[end:]}"


def run(folder: Path, text: str, tmp_path: Path) -> tuple[int, str]:
    (folder / "follows.yaml").write_text(text)
    options = Options(out=tmp_path / "run", use_cache=False)
    findings = optimize(folder / "follows.yaml", options).findings
    return findings.studies[0].order, (tmp_path / "run" / "log.txt").read_text()


def slowed(chart: Path, method: str) -> None:
    """The chart, as a machine on which this method is slow would have it."""
    content = json.loads(chart.read_text())
    for point in content["points"]:
        if point["method"] == method:
            point["offline"]["median_s"] = 1e3
    chart.write_text(json.dumps(content))


def test_the_line_advised_makes_a_run_take_what_was_charted(folder: Path, tmp_path: Path) -> None:
    line = (folder / "line.txt").read_text()
    assert line.startswith("expansion: {order: auto, accuracy: 0.001, chart: charted/chart.json, q")
    content = json.loads((folder / "charted" / "chart.json").read_text())
    order, log = run(folder, replaced(line), tmp_path)
    assert f"Taylor {order} full" == content["advice"][0]["followed"]
    assert f"the chart is followed: Taylor {order} full is its quickest expansion" in log
    assert f"note      Taylor {order} full, charted with" in log
    assert "charted/chart.json" in log  # by its SHA-256


def test_another_order_is_taken_where_the_chart_says_it_is_quicker(
    folder: Path, tmp_path: Path
) -> None:
    """The file decides, not this machine."""
    chart = tmp_path / "chart.json"
    shutil.copy(folder / "charted" / "chart.json", chart)
    line = (folder / "line.txt").read_text().replace("charted/chart.json", f'"{chart}"')
    for slow, order in ((("4", "5"), 6), (("4", "6"), 5)):
        shutil.copy(folder / "charted" / "chart.json", chart)
        for number in slow:
            slowed(chart, f"Taylor {number} full")
        assert run(folder, replaced(line), tmp_path)[0] == order


def test_an_expansion_that_the_estimate_does_not_bear_out_is_not_taken(
    folder: Path, tmp_path: Path
) -> None:
    """A chart that claims order 3 to be right to 1e-9 is not believed."""
    content = json.loads((folder / "charted" / "chart.json").read_text())
    content["points"] = [p for p in content["points"] if p["method"] == "Taylor 3 full"]
    content["points"][0]["everywhere"]["worst_relative"] = 1e-9
    (tmp_path / "chart.json").write_text(json.dumps(content))
    line = (folder / "line.txt").read_text()
    line = line.replace("charted/chart.json", f'"{tmp_path / "chart.json"}"')
    order, log = run(folder, replaced(line), tmp_path)
    assert order > 3
    assert "Taylor 3 full, charted with 1.0e-09: error at most" in log
    assert "the estimate bears none of these out: chosen without them" in log


def test_a_case_whose_mechanism_differs_does_not_follow(folder: Path, tmp_path: Path) -> None:
    text = replaced((folder / "line.txt").read_text())
    assert "length: 0.6" in text
    _, log = run(folder, text.replace("length: 0.6", "length: 0.61"), tmp_path)
    assert "the chart is not followed: it is of another case" in log
    _, log = run(folder, text.replace("frequency: 190 Hz", "frequency: 180 Hz"), tmp_path)
    assert "the chart is followed" in log


def test_a_case_that_follows_a_chart_is_charted_as_if_it_did_not(
    folder: Path, tmp_path: Path
) -> None:
    """Also where that chart is none any more."""
    (tmp_path / "old.json").write_text("{}")
    line = (folder / "line.txt").read_text().replace("charted/chart.json", "old.json")
    (tmp_path / "arm.yaml").write_text(replaced(line))
    made = chart_case(load_case(tmp_path / "arm.yaml"), Options(), EFFORT, Wish(accuracy=1e-3))
    content = json.loads((folder / "charted" / "chart.json").read_text())
    assert made.subject_sha256 == content["subject_sha256"]


def test_a_case_whose_auto_refuses_is_charted_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(expansion_choice, "MOST_TERMS", 50)
    (tmp_path / "arm.yaml").write_text(replaced("expansion: {order: auto, accuracy: 1e-9}"))
    made = chart_case(load_case(tmp_path / "arm.yaml"), Options(), EFFORT, Wish(accuracy=1e-9))
    assert made.advice[0].auto is not None
    assert made.advice[0].auto.refused.startswith("no expansion of order up to 4")


def test_a_chart_that_is_missing_or_needs_no_following_is_an_error_at_its_key(
    tmp_path: Path,
) -> None:
    path = tmp_path / "arm.yaml"
    path.write_text(replaced("expansion: {order: auto, chart: none.json}"))
    with pytest.raises(CaseError, match=r"expansion\.chart: no such file: .*`eigassign chart`"):
        load_case(path)
    path.write_text(replaced("expansion: {order: 4, chart: arm.yaml}"))
    with pytest.raises(CaseError, match=r"expansion\.chart: says what order: auto takes"):
        load_case(path)
    path.write_text(replaced("expansion: {order: auto, chart: arm.yaml}"))
    with pytest.raises(CaseError, match=r"arm\.yaml:\d+:\d+: expansion\.chart: .*is no chart"):
        solve_case(load_case(path))
