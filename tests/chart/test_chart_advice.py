"""What a chart tells to write gives what it says; what is left is all from the same numbers."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from charts import CASES, SMALL, charted, rows_of

import eigassign as ea
from eigassign.chart import Chart, advised, build_subject, errors
from eigassign.output import chart_tables, write_chart
from eigassign.pipeline import Stages, prepare

ARM = CASES / "two_link.yaml"
SMALL_ARM = CASES.parent / "benchmarks" / "small_arm.yaml"


@pytest.fixture(scope="module")
def arm() -> Chart:
    return advised(charted("two_link"))


def keys(chart: Chart) -> dict[str, str | None]:
    return {each.question: each.key for each in chart.advice}


def test_the_lowest_order_and_the_coarsest_mesh_within_the_accuracy_are_told(arm: Chart) -> None:
    for accuracy in (1e-2, 1e-3, 1e-4):
        told = keys(advised(replace(arm, asked=replace(arm.asked, accuracy=accuracy))))
        for curve, question in (("Taylor", "the series (`expand`)"), ("mesh", "the mesh")):
            able = [p for p in rows_of(arm, curve).values() if p.worst_relative <= accuracy]
            number = min(int("".join(filter(str.isdigit, p.size))) for p in able)
            assert told[question] == f"{'order' if curve == 'Taylor' else 'elements'}: {number}"
    none = advised(replace(arm, asked=replace(arm.asked, accuracy=1e-13)))
    assert keys(none) == {"the series (`expand`)": None}
    assert "solve exactly" in none.advice[0].words


@pytest.mark.parametrize("path", [ARM, SMALL_ARM], ids=lambda p: p.stem)
def test_what_is_told_to_write_gives_the_error_that_is_told(path: Path, tmp_path: Path) -> None:
    chart = advised(charted(path))
    told = keys(chart)
    subject, _ = build_subject(ea.load_case(path))
    tests = subject.tested(SMALL)
    exact = subject.exact(tests.x)
    q, y = subject.split(tests.x)
    known: dict[str, Any] = {
        "ea": ea, "model": subject.model, "q0": subject.x0[: q.shape[1]],
        "y0": subject.x0[q.shape[1] :],
    }  # fmt: skip
    ready = [p for p in chart.points if p.use.startswith("ea.") and " at " not in p.method]
    assert len(ready) > 10
    for p in ready:
        if p.curve != "Taylor, several points":
            made = eval(p.use, known)
            off = errors(made.frequencies(q, y), exact)[0]
            assert max(off, chart.asked.floor) == pytest.approx(p.worst_relative, rel=1e-6)
    text, key = path.read_text(), str(told["the series (`expand`)"])
    case = tmp_path / "case.yaml"
    case.write_text(text.replace("  order: 4", f"  {key}").replace("order: 3", key))
    assert key in case.read_text()
    own = prepare(ea.load_case(case), Stages(lambda _: None), None).expansions.full
    assert errors(own.frequencies(q, y), exact)[0] == pytest.approx(
        rows_of(chart, "Taylor")[key[-1]].worst_relative, rel=1e-6
    )


def test_a_reader_sees_how_good_the_papers_method_is_and_how_far_it_goes(arm: Chart) -> None:
    line = arm.headline
    worst = rows_of(arm, "Taylor, linearised in y")["4"].worst_relative
    assert f"linearised in y, order 4) is {100 * worst:.3g}" in line
    assert "more orders do not help" in line
    reach = {r.varied: r.half_width for r in arm.reach if r.method.endswith("in y, order 4")}
    assert f"up to {reach['y']:.2g} of the bounds of m1, m2; {reach['q and y']:.2g} of" in line
    assert "Write `order: 2` under `expansion`" in line
    assert charted("stress/mode_swaps").headline.startswith("Found: crossing, too few samples")


def test_a_folder_holds_every_point_and_the_page_begins_with_the_answer(
    arm: Chart, tmp_path: Path
) -> None:
    hopeless = replace(arm.points[2], method="hopeless", worst_relative=np.inf)
    chart = replace(arm, points=(*arm.points, hopeless), title="An <arm> & more")
    write_chart(chart, tmp_path, kind="light")
    data = json.loads((tmp_path / "chart.json").read_text(), parse_constant=pytest.fail)
    assert [p["method"] for p in data["points"]] == [p.method for p in chart.points]
    assert data["points"][-1]["worst_relative"] is None
    assert (data["schema"], len(data["boxes"])) == (9, len(arm.boxes))
    page = (tmp_path / "report.html").read_text()
    above, folded = page.split("<details", 1)
    assert "An &lt;arm&gt; &amp; more" in above
    assert "Write <code>order: 2</code> under <code>expansion</code>" in above
    assert page.count("data:image/png;base64") == 2
    assert all(table.title in page for table in chart_tables(chart))
    assert "All methods" in folded
    figures = {path.stem for path in (tmp_path / "figures").iterdir()}
    assert figures == {"plane", "boxes"}
    assert f"Not drawn: {sum(p.worst_relative > 1.0 for p in chart.points)} over 100 %" in page
