"""`eigassign compare`: runs side by side, and what is no run of this version by its name."""

import json
import re
import shutil
from pathlib import Path
from typing import Any

import pytest
import yaml

from eigassign.cli import main
from eigassign.output import run_folder

TEMPLATE = Path(__file__).parents[2] / "eigassign" / "starters" / "planar_arm.yaml"
TWO_LINK = Path(__file__).parents[2] / "cases" / "two_link.yaml"
LITTLE = ("--study", "none", "--report", "none", "--figures", "none", "--quiet")
BAND = "clear of 24 … 26 Hz"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three runs: a case, the same with another target, name and duration, and another case."""
    made = tmp_path_factory.mktemp("runs")
    text = TEMPLATE.read_text().replace("samples: 101", "samples: 21")
    other = text.replace("frequency: 15 Hz", "frequency: 14 Hz").replace(
        "  diameter: {", "  pipe: {"
    )
    (made / "one.yaml").write_text(text)
    (made / "two.yaml").write_text(other.replace("duration: 1 s", "duration: 2 s"))
    short = TWO_LINK.read_text().replace("samples: 152", "samples: 12")
    (made / "three.yaml").write_text(short)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(made)
        for name in ("one", "two", "three"):
            assert main(["optimize", f"{name}.yaml", *LITTLE]) == 0
    return made


@pytest.fixture
def _here(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(folder, tmp_path / "work")
    monkeypatch.chdir(tmp_path / "work")


pytestmark = pytest.mark.usefixtures("_here")


def compared(*runs: str, capsys: pytest.CaptureFixture[str]) -> dict[str, dict[str, list[str]]]:
    """The cells of each row of each table."""
    capsys.readouterr()
    assert main(["compare", *runs, "--json", "--out", "side"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["page"] == "side/compare.html"
    assert all(table["columns"][1:] == list(runs) for table in told["tables"])
    return {t["title"]: {row[0]: row[1:] for row in t["rows"]} for t in told["tables"]}


def drawn(page: Path) -> dict[str, Any]:
    """The plot of the frequencies on a page."""
    text = page.read_text().partition('id="figures">')[2].partition("</script>")[0]
    plot: dict[str, Any] = json.loads(text)["compared"]
    return plot


def test_runs_stand_side_by_side_and_what_one_lacks_is_empty(
    capsys: pytest.CaptureFixture[str],
) -> None:
    tables = compared("one.yaml", "results/two", "results/three", capsys=capsys)
    assert tables["Runs"]["verdict"] == ["Reached"] * 3
    found = [json.loads(Path("results", n, "results.json").read_text()) for n in ("one", "two")]
    for k, name in enumerate(("diameter", "pipe")):
        cells = tables["Design"][f"{name} [mm]"]
        assert cells[k] == f"{1e3 * found[k]['design'][name]['optimal']:.4g}"
        assert [cell for cell in cells if cell] == [cells[k]]
    assert tables["Asked"]["mode 1 at 15 Hz"][1:] == ["", ""]
    assert tables["Asked"][f"every mode {BAND}"][2] == ""
    assert tables["Asked"][f"every mode {BAND}"][0].startswith("met")
    masses = [f"{each['mass']['optimal']:.4g}" for each in found]
    assert tables["Runs"]["mass [kg]"][:2] == masses


def test_the_page_has_every_run_and_makes_no_request(capsys: pytest.CaptureFixture[str]) -> None:
    compared("results/one", "results/two", capsys=capsys)
    page, plot = Path("side/compare.html").read_text(), drawn(Path("side/compare.html"))
    assert {"mode 1, results/one", "mode 1, results/two"} <= {d.get("name") for d in plot["data"]}
    assert {"mode 1 at 15 Hz", "mode 1 at 14 Hz"} <= {d.get("name") for d in plot["data"]}
    assert "part of the duration" in json.dumps(plot["layout"])  # 1 s and 2 s
    assert "default-src 'none'" in page


def test_along_several_trajectories_each_has_its_own_curve(
    capsys: pytest.CaptureFixture[str],
) -> None:
    case = yaml.safe_load(Path("one.yaml").read_text())
    own = case["trajectory"]
    case["trajectory"] = [{**own, "name": "there"}, {**own, "name": "back", "duration": "0.5 s"}]
    case["targets"] = [
        {"mode": 1, "frequency": "15 Hz", "trajectory": k} for k in ("there", "back")
    ]
    Path("both.yaml").write_text(json.dumps(case))
    assert main(["optimize", "both.yaml", *LITTLE]) == 0
    compared("both.yaml", "one.yaml", capsys=capsys)
    data = drawn(Path("side/compare.html"))["data"]
    ends = [d["x"][-1] for d in data if d.get("name") == "mode 1, both.yaml"]
    assert sorted(ends) == [0.5, 1.0]


def test_of_equal_durations_the_time_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    compared("results/one", "one.yaml", capsys=capsys)
    assert '"time [s]"' in Path("side/compare.html").read_text()


@pytest.mark.parametrize(
    ("name", "code", "says"),
    [
        ("nowhere", 2, "nowhere is no finished run"),
        ("missing.yaml", 2, "results/missing is no finished run"),
        ("lost", 2, "lost: a file of it was changed or lost"),
        ("edited", 2, "edited: a file of it was changed or lost"),
        ("older", 2, "older: its results.json has schema 2, and"),
        ("drawn", 2, "drawn is no run of eigassign optimize, or its case has no targets"),
    ],
)
def test_what_is_no_run_is_refused_by_its_name(
    name: str, code: int, says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for copy in ("lost", "edited"):
        shutil.copytree("results/one", copy)
    Path("lost/frequencies.csv").unlink()
    Path("edited/results.json").write_text("{")
    for copy, text in (("older", '{"schema": 2}'), ("drawn", "")):
        with run_folder(Path(copy), case_path=Path("one.yaml"), key="k") as hidden:
            (hidden / ("results.json" if text else "picture.png")).write_text(text)
    capsys.readouterr()
    assert main(["compare", "results/two", name]) == code
    assert says in capsys.readouterr().err
    assert not Path("results/compare.html").exists()


def test_modes_that_are_far_off_do_not_squash_what_is_compared(
    capsys: pytest.CaptureFixture[str],
) -> None:
    found = json.loads(Path("results/one/results.json").read_text())
    band = next(row for row in found["targets"] if row["kind"] == "keep_out")
    band["near"].append(
        {**band["near"][0], "mode": 9, "optimal_hz": [383.0] * len(band["near"][0]["optimal_hz"])}
    )
    with run_folder(Path("far"), case_path=Path("one.yaml"), key="k") as hidden:
        (hidden / "results.json").write_text(json.dumps(found))
    compared("far", "two.yaml", capsys=capsys)
    page = Path("side/compare.html")
    low, high = drawn(page)["layout"]["yaxis"]["range"]
    assert 0.0 <= low < 14.0
    assert 26.0 < high < 60.0
    assert re.search(r"Outside the axis: [^.]*mode 9, far", page.read_text())


def test_without_frequencies_that_are_wanted_there_is_no_error(
    capsys: pytest.CaptureFixture[str],
) -> None:
    case = yaml.safe_load(Path("one.yaml").read_text())
    case["targets"] = [{"keep_out": ["14 Hz", "15 Hz"]}]
    Path("band.yaml").write_text(json.dumps(case))
    main(["optimize", "band.yaml", *LITTLE])
    runs = compared("band.yaml", "one.yaml", capsys=capsys)["Runs"]
    assert runs["worst error"][0] == runs["worst error before"][0] == runs["rms error"][0] == ""
    assert runs["worst error"][1] != ""
    assert runs["worst violation"][0] != ""
    assert not {"worst error", "rms error"} & set(compared("band.yaml", capsys=capsys)["Runs"])


def test_what_is_no_page_of_ours_is_left_alone(capsys: pytest.CaptureFixture[str]) -> None:
    page = Path("side/compare.html")
    page.parent.mkdir()
    page.write_text("<p>my own</p>")
    assert main(["compare", "one.yaml", "--out", "side"]) == 3
    assert "side/compare.html is no page of eigassign; it was left alone" in capsys.readouterr().err
    assert page.read_text() == "<p>my own</p>"
    assert main(["compare", "one.yaml", "--out", "side", "--force"]) == 0
    assert Path("side/compare.html.1").read_text() == "<p>my own</p>"
    assert main(["compare", "two.yaml", "--out", "side"]) == 0  # one of ours
    assert "two.yaml" in page.read_text()
    assert "Case <code>" not in page.read_text()
    for inside in ("results/one", "results/one/figures"):
        assert main(["compare", "one.yaml", "--out", inside, "--force"]) == 3
        assert "run folder or in one; choose another with --out" in capsys.readouterr().err
    assert not Path("results/one/figures").exists()
    assert not Path("results/one/compare.html").exists()


def test_cells_stand_alike_in_all_tables(capsys: pytest.CaptureFixture[str]) -> None:
    compared("one.yaml", "two.yaml", capsys=capsys)
    page = Path("side/compare.html").read_text()
    assert "<td>" not in page  # all are of the class left
    assert '<th scope="col">' not in page


def test_a_page_that_cannot_be_written_is_an_io_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", "results/one", "results/two", "--out", "one.yaml/side"]) == 3
    assert "one.yaml" in capsys.readouterr().err
