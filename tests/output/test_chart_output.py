"""What a chart leaves: figures, tables, a page and JSON, all from the same numbers."""

import json
from pathlib import Path

import numpy as np
import pytest

from eigassign.chart import (
    Advice,
    Asked,
    Chart,
    ChartPoint,
    Errors,
    Front,
    MeshRow,
    Timing,
)
from eigassign.output import (
    Table,
    chart_tables,
    write_chart,
)


def timing(seconds: float, repeats: int = 5) -> Timing:
    return Timing(seconds, 0.9 * seconds, 1.1 * seconds, repeats)


def point(name: str, family: str, ours: bool, online: float, worst: float) -> ChartPoint:
    errors = Errors(worst, worst / 3.0, worst / 200.0, 100, 0)
    return ChartPoint(
        name, family, ours, {"order": 4, "q0": np.zeros(2)}, timing(1e-3), timing(online), 1, 0.0,
        errors, errors, errors, 12.5,
    )  # fmt: skip


BEST = Advice(
    1e-2, "write `order: 4` under `expansion`: 0.05 % off", "order: 4", "Taylor 4 full", 5e-4, 1e-7,
)  # fmt: skip
CHART = Chart(
    title="An <arm> & more",
    case_name="arm",
    case_sha256="ab" * 32,
    reference=None,
    version="1.0",
    quick=True,
    machine={"versions": {"Python": "3.12", "NumPy": "2"}, "blas": "blas 1", "threads": "1"},
    asked=Asked((1,), 23, 30, 2, 9, 152, 7, 200.0, 1e-10),
    points=(
        point("exact dense", "exact", True, 1e-4, 0.0),
        point("Taylor 4 full", "Taylor, full", True, 1e-7, 1e-1),
        point("SciPy one by one", "exact by others", False, 2e-7, 1e-2),
        point("hopeless", "1/λ, full", True, 2e-7, np.inf),
    ),
    skipped=(("reduced", "no basis"),),
    fronts=(
        Front("one trajectory", 152.0, ("exact dense", "Taylor 4 full")),
        Front("online alone", None, ("exact dense", "SciPy one by one", "Taylor 4 full")),
    ),
    advice=(
        BEST,
        Advice(1e-8, "nothing"),
    ),
    mesh=(
        MeshRow(1.0, 7, 23, 0.06, 3e-4, 4.0, timing(1e-4)),
        MeshRow(2.0, 14, 44, 0.004, 2e-5, None, timing(2e-4, 0)),
    ),
    notes=("a note",),
    warnings=(),
    seconds=3.0,
)


def test_a_folder_holds_every_point_the_tables_and_the_figures(tmp_path: Path) -> None:
    write_chart(CHART, tmp_path, kind="light")
    data = json.loads((tmp_path / "chart.json").read_text(), parse_constant=pytest.fail)
    assert [p["method"] for p in data["points"]] == [p.method for p in CHART.points]
    assert data["points"][3]["everywhere"]["worst_hz"] is None
    assert data["points"][1]["parameters"] == {"order": 4, "q0": [0.0, 0.0]}
    assert data["schema"] == 7
    page = (tmp_path / "report.html").read_text()
    assert "An &lt;arm&gt; &amp; more" in page
    assert page.count("data:image/png;base64") == 3
    for word in (
        "What to write in the case",
        "All methods",
        "Mesh",
        "Machine",
    ):
        assert word in page
    figures = {path.name: path.read_bytes() for path in (tmp_path / "figures").iterdir()}
    names = ("cost_one_trajectory", "online_alone", "mesh")
    assert set(figures) == {f"{name}.png" for name in names}
    assert all(data.startswith(b"\x89PNG") for data in figures.values())


def table(title: str, chart: Chart = CHART) -> Table:
    (found,) = [each for each in chart_tables(chart) if each.title == title]
    return found


def test_what_to_write_stands_with_its_error_and_its_time() -> None:
    shown = table("What to write in the case")
    assert shown.columns == ("asked for", "under expansion", "worst error", "a sample")
    assert shown.rows == (
        ("1 %", "order: 4", "0.0500 %", "100 ns"),
        ("1e-06 %", "none", "", ""),
    )


def test_the_page_is_a_sentence_that_names_a_key_one_plot_and_the_rest_is_folded(
    tmp_path: Path,
) -> None:
    write_chart(CHART, tmp_path, kind="light")
    above, folded = (tmp_path / "report.html").read_text().split("<details>", 1)
    assert "Write <code>order: 4</code> under <code>expansion</code>: 0.05 % off." in above
    assert above.count("<figure") == above.count("<h2") == 1
    assert "<table" not in above
    assert "All methods" in folded
    assert "Where this comes from" in folded
