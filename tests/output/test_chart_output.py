"""What a chart leaves: figures, tables, a page and JSON, all from the same numbers."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

sys.path.insert(0, str(Path(__file__).parents[1] / "study"))

from eigassign.chart.results import (
    Advice,
    Asked,
    AutoTakes,
    Chart,
    ChartPoint,
    DesignRun,
    Errors,
    Front,
    Machine,
    MeshRow,
    Timing,
)
from eigassign.output import (
    FigurePlan,
    MethodLine,
    chart_figures,
    draw,
    render,
    scatter,
    write_chart,
)
from eigassign.output.figures import screen, style
from eigassign.output.reports import chart as chart_report


def timing(seconds: float, repeats: int = 5) -> Timing:
    return Timing(seconds, 0.9 * seconds, 1.1 * seconds, repeats)


def point(name: str, family: str, ours: bool, online: float, worst: float) -> ChartPoint:
    errors = Errors(worst, worst / 3.0, worst / 200.0, 100, 0)
    return ChartPoint(
        name, family, ours, {"order": 4, "q0": np.zeros(2)}, timing(1e-3), timing(online), 1, 0.0,
        errors, errors, errors, 12.5,
    )  # fmt: skip


def design(name: str, excess: float, trace: tuple[tuple[float, float], ...] = ()) -> DesignRun:
    return DesignRun(
        name, not trace, {}, timing(0.1), 3, (0.1, 0.2), 1e-4 * (1 + excess), 0.02, 0.01, excess,
        trace,
    )  # fmt: skip


CHART = Chart(
    title="An <arm> & more",
    case_name="arm",
    case_sha256="ab" * 32,
    reference=None,
    version="1.0",
    quick=True,
    machine=Machine("CPU", 2, "Linux x86_64", {"Python": "3.12"}, "blas 1", "1"),
    asked=Asked((1,), 23, ("place", "m1"), 30, 2, 9, 152, 152.0, 7, 200.0, 1e-10),
    points=(
        point("exact dense", "exact", True, 1e-4, 0.0),
        point("Taylor 4 full", "Taylor, full", True, 1e-7, 1e-1),
        point("grid linear 4", "grid, linear", False, 2e-7, 1e-2),
        point("hopeless", "grid, linear", False, 2e-7, np.inf),
    ),
    skipped=(("RBF", "too few points"),),
    fronts=(
        Front("one trajectory", 152.0, ("exact dense", "Taylor 4 full")),
        Front("online alone", None, ("exact dense", "grid linear 4", "Taylor 4 full")),
    ),
    advice=(
        Advice(
            "accuracy",
            1e-4,
            None,
            152.0,
            "exact dense",
            {},
            0.0,
            0.0152,
            "words",
            False,
            AutoTakes("Taylor 4 full", 5e-5, 0.00304, 0.4, ""),
        ),
        Advice(
            "accuracy",
            1e-8,
            None,
            152.0,
            "exact dense",
            {},
            0.0,
            0.0152,
            "words",
            False,
            AutoTakes(None, None, None, 0.4, "no expansion reaches 1.0e-08"),
        ),
        Advice("budget", None, 1e-9, 152.0, None, {}, None, None, "nothing"),
    ),
    mesh=(
        MeshRow(1.0, 7, 23, 0.06, 3e-4, 4.0, timing(1e-4)),
        MeshRow(2.0, 14, 44, 0.004, 2e-5, None, timing(2e-4, 0)),
    ),
    designs=(design("program", 0.02), design("search", 0.0, ((0.1, 1e-3), (0.4, 1e-4)))),
    notes=("a note",),
    warnings=(),
    seconds=3.0,
)


def test_every_figure_has_a_name_of_its_own_and_is_drawn() -> None:
    plans = chart_figures(CHART)
    files = render(plans)
    names = ("cost_one_trajectory", "online_alone", "mesh", "designs")
    assert set(files) == {f"{name}.png" for name in names}
    assert all(data.startswith(b"\x89PNG") for data in files.values())
    assert render(plans) == files


def test_captions_tell_what_is_not_drawn() -> None:
    plans = {plan.name: plan.caption for plan in chart_figures(CHART)}
    assert "1 method is wrong by over 100 %" in plans["cost_one_trajectory"]
    assert "0.06 Hz from the limit" in plans["mesh"]


@pytest.mark.parametrize(
    ("worst", "words"),
    [
        (0.1, "line is the error of Taylor 4 full"),
        (0.0, "line is the error of Taylor 4 full"),
        (np.inf, "Taylor 4 full is wrong by over 100 %"),
        (1e9, "Taylor 4 full is wrong by over 100 %"),
    ],
)
def test_the_mesh_is_drawn_beside_a_taylor_polynomial_that_is_right_somehow(
    worst: float, words: str
) -> None:
    wrong = point("Taylor 4 full", "Taylor, full", True, 1e-7, worst)
    chart = replace(CHART, points=(CHART.points[0], wrong, *CHART.points[2:]))
    plan = next(p for p in chart_figures(chart) if p.name == "mesh")
    assert words in plan.caption
    with style.applied():
        axes = draw(plan).axes[0]
    said = [text.get_text() for text in axes.texts]
    assert said == (["error of Taylor 4 full"] if "dashed" in plan.caption else [])


def test_a_chart_without_meshes_or_designs_has_no_such_figures() -> None:
    bare = replace(CHART, mesh=(), designs=())
    assert {p.name for p in chart_figures(bare)} == {
        "cost_one_trajectory",
        "online_alone",
    }
    assert "Designs" not in [table.title for table in chart_report.tables(bare)]


def test_the_json_holds_every_point_and_no_numbers_that_json_has_not(tmp_path: Path) -> None:
    write_chart(CHART, tmp_path)
    data = json.loads((tmp_path / "chart.json").read_text(), parse_constant=pytest.fail)
    assert [p["method"] for p in data["points"]] == [p.method for p in CHART.points]
    assert data["points"][3]["everywhere"]["worst_hz"] is None
    assert data["points"][1]["parameters"] == {"order": 4, "q0": [0.0, 0.0]}
    assert data["schema"] == 4


def test_the_page_shows_tables_and_figures_and_escapes_titles(tmp_path: Path) -> None:
    write_chart(CHART, tmp_path, kind="light")
    page = (tmp_path / "report.html").read_text()
    assert "An &lt;arm&gt; &amp; more" in page
    assert page.count("data:image/png;base64") == 4
    for word in ("What to choose", "Front: one trajectory", "All methods", "Mesh", "Machine"):
        assert word in page
    assert len(list((tmp_path / "figures").iterdir())) == 4


def test_fronts_are_listed_from_the_quickest_with_whose_they_are() -> None:
    table = chart_report.front(CHART, CHART.fronts[1])
    assert [row[0] for row in table.rows] == ["Taylor 4 full", "grid linear 4", "exact dense"]
    assert [row[1] for row in table.rows] == ["yes", "no", "yes"]


def test_what_auto_takes_stands_beside_the_choice() -> None:
    table = chart_report.auto(CHART)
    taken, refused = table.rows
    assert taken == (
        "1e-04", "152", "Taylor 4 full", "5.0e-05", "3.04 ms", "0.2 × as long", "400 ms",
    )  # fmt: skip
    assert refused[2:] == ("refused", "", "", "", "400 ms")
    assert table.caption.endswith("1e-08 is refused: no expansion reaches 1.0e-08.")


def test_accuracies_for_which_auto_is_not_asked_any_more_are_named() -> None:
    known, other = CHART.advice[:2]
    below = replace(other, accuracy=1e-12, auto=None, is_below_round_off=True)
    budget = replace(other, accuracy=None, budget_s=1.0, auto=None)
    left = (replace(other, auto=None), replace(other, auto=None, evaluations=1e6))
    said = chart_report.auto(replace(CHART, advice=(known, *left, below, budget))).caption
    assert said.endswith("Not asked for 1e-08: choosing had already taken too long.")
    assert "Not asked" not in chart_report.auto(replace(CHART, advice=(known, below))).caption


def test_what_auto_takes_is_ringed() -> None:
    plan = chart_figures(CHART)[0]
    bare = chart_figures(replace(CHART, advice=()))[0]
    with style.applied():
        ringed, plain = draw(plan), draw(bare)
    (ring,) = [line for line in ringed.axes[0].get_lines() if line.get_markersize() == 12.0]
    np.testing.assert_allclose(ring.get_xydata(), [(CHART.points[1].total_s(152.0), 0.1)])
    assert "taken by order: auto" in words(ringed)
    assert "taken by order: auto" not in words(plain)


def words(figure: Figure) -> list[str]:
    return [text.get_text() for key in figure.legends for text in key.get_texts()]


def test_points_are_drawn_by_kind_and_the_front_as_steps_through_the_best() -> None:
    with style.applied():
        figure = draw(chart_figures(CHART)[1])
    (axes,) = figure.axes
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("time [s]", "worst error [Hz]")
    assert words(figure)[:6] == [
        "eigassign", "exact solves", "series of λ", "others", "interpolation and surrogates",
        "taken by order: auto",
    ]  # fmt: skip
    shown = {line.get_label(): line for line in axes.get_lines()}
    np.testing.assert_array_equal(shown["series of λ"].get_xydata(), [(1e-7, 0.1)])
    np.testing.assert_array_equal(
        shown["interpolation and surrogates"].get_xydata(), [(2e-7, 0.01)]
    )
    assert shown["interpolation and surrogates"].get_markerfacecolor() == "white"
    (steps,) = [line for line in axes.get_lines() if line.get_linewidth() == 7.0]
    np.testing.assert_array_equal(steps.get_ydata()[1:5], [0.1, 0.1, 0.01, 0.01])


def test_every_family_of_methods_has_its_kind_and_a_legend_eight_at_most() -> None:
    families = (
        "exact", "exact by others", "Taylor, full", "1/λ, full", "reduced, 1 point",
        "fit to an accuracy", "fit of given solves", "stations, cubic", "grid, linear",
        "RBF, quintic", "Taylor, linearised",
    )  # fmt: skip
    points = [
        replace(CHART.points[0], method=f"m {f}", family=f, ours="," not in f) for f in families
    ]
    shown = chart_figures(replace(CHART, points=tuple(points)))[0].shows
    labels = [curve.label for curve in shown.panels[0].curves if curve.label]
    assert len(labels) == len(set(labels)) <= 8
    looks = {curve.look for curve in shown.panels[0].curves if curve.names}
    assert len(looks) == 7
    (figure,) = screen.figures(shown)
    assert {name for trace in figure["data"] for name in trace.get("text", ())} == {
        f"m {family}" for family in families
    }
    _, rows = screen.table(shown)
    assert next(row[0] for row in rows).startswith("m ")


def test_a_time_measured_once_says_so() -> None:
    assert chart_report.spread(timing(2.0, 0)) == "2 s (once)"
    assert chart_report.spread(timing(2.0)) == "2 s (1.8 s–2.2 s)"


def test_points_without_a_front_and_a_single_line_can_be_drawn() -> None:
    with style.applied():
        lines = [MethodLine("a", np.ones(1), np.ones(1), True)]
        shown = scatter("t", ("x", "s"), ("y", "Hz"), lines)
        figure = draw(FigurePlan("", "", "", "", shown))
        assert style.encoded(figure, "png").startswith(b"\x89PNG")
    assert words(figure) == ["a"]
    low, high = figure.axes[0].get_xlim()
    assert low < 1.0 < high
