"""Figures show what the results say, the same every time, whatever the mechanism is like."""

import dataclasses
import io
import unicodedata
import xml.etree.ElementTree as ET
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image
from synthetic_results import as_limit, make_results, studied

import eigassign as ea
from eigassign.output import Curve, FigurePlan, Look, Panel, draw, render, run_figures
from eigassign.study import RunResults

LONG = "ein_sehr_langer_Name_für_$x_1^2$_中_\x1b[31m_"
EVERY = {
    "paper": {},
    "one sample": {"n_t": 1, "n_q": 1, "n_y": 1, "n_links": 1},
    "two samples": {"n_t": 2},
    "one parameter": {"n_y": 1, "n_q": 1},
    "many of all": {"n_q": 12, "n_y": 50, "n_links": 12, "n_targets": 3},
    "long names in space": {"prefix": LONG, "title": "<script>" * 30, "spatial": True},
    "huge": {"scale_hz": 1e12, "scale_m": 1e9},
    "tiny": {"scale_hz": 1e-12, "scale_m": 1e-9},
    "nothing varies": {"varies": False},
    "spatial": {"spatial": True},
}
BY_DEFAULT = "long names in space"  # of these figures; all of them: a minute
VERMILLION = "#D55E00"
SMALL = Path(__file__).parents[2] / "benchmarks" / "small_arm.yaml"


@pytest.fixture(scope="module")
def paper() -> RunResults:
    return make_results()


def plans_of(results: RunResults, *names: str) -> list[FigurePlan]:
    found = {plan.name: plan for plan in run_figures(results)}
    return [found[name] for name in names]


def drawn(results: RunResults, name: str) -> Figure:
    return draw(*plans_of(results, name))


def legend(figure: Figure) -> list[str]:
    keys = [*figure.legends, *(axes.get_legend() for axes in figure.axes)]
    return [text.get_text() for key in keys if key for text in key.get_texts()]


def pixels(data: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(float)


def with_limits(results: RunResults, *limits) -> RunResults:
    (target,) = results.targets
    return dataclasses.replace(results, targets=tuple(as_limit(target, *each) for each in limits))


def test_the_paper_s_case_has_all_of_its_figures(paper):
    assert [plan.name for plan in run_figures(paper)] == [
        "frequencies",
        "mechanism",
        "coordinates",
        "approximation_mode_1_time",
    ]


@pytest.mark.parametrize(
    "name", [n if n == BY_DEFAULT else pytest.param(n, marks=pytest.mark.slow) for n in EVERY]
)
def test_every_kind_of_results_gives_figures_with_nothing_over_their_edge(name):
    files = render(run_figures(studied(make_results(**EVERY[name]))))
    assert len(files) >= 4
    for name, data in files.items():
        image = pixels(data)
        assert image.shape[1] == 880, name
        assert 200 < image.shape[0] < 900, name
        there = (image < 250).any(axis=2)
        assert 0.01 < there.mean() < 0.6, name
        edges = [there[:2], there[-2:], there[:, :2], there[:, -2:]]
        assert not any(edge.any() for edge in edges), f"{name} runs over its edge"


def curves_of(axes) -> list[np.ndarray]:
    return [line.get_ydata() for line in axes.get_lines()]


def test_what_was_asked_is_drawn_with_the_modes_around_it_and_its_distance(paper):
    figure, target = drawn(paper, "frequencies"), paper.targets[0]
    assert figure.get_suptitle() == "Frequencies before and after"
    above, below = figure.axes
    for hz in (target.asked.hz, target.initial_hz, target.exact_hz):
        assert any(np.array_equal(curve, hz) for curve in curves_of(above))
    low, high = above.get_ylim()
    asked = np.concatenate([target.asked.hz, target.initial_hz, target.exact_hz])
    assert low < asked.min() < asked.max() < high < paper.spectrum[1].optimal_hz.min()
    assert [text.get_text() for text in above.texts] == ["mode 1"]  # mode 2 is far above
    (plan,) = plans_of(paper, "frequencies")
    assert plan.shows.panels[0].whole[1] > max(row.initial_hz.max() for row in paper.spectrum)
    off = curves_of(below)[-1]
    np.testing.assert_allclose(off, 100.0 * (target.exact_hz / target.asked.hz - 1.0))
    assert (above.get_ylabel(), below.get_ylabel()) == ("frequency [Hz]", "off target [%]")
    assert below.get_xlabel() == "time [s]"
    assert set(legend(figure)) == {"mode 1 at 190 Hz", "initial design", "optimal design"}


@pytest.mark.parametrize("times", [0.2, 3.0])
def test_the_panel_of_a_band_holds_the_answer_however_far_it_is(paper, times):
    edges = [times * paper.targets[0].asked.hz[0] * share for share in (0.98, 1.02)]
    band = (np.full(paper.time_s.size, edge) for edge in edges)
    found = with_limits(paper, ("keep_out", *band))
    (asked,) = (target.asked for target in found.targets)
    target = dataclasses.replace(found.targets[0], asked=dataclasses.replace(asked, terms=()))
    (plan,) = plans_of(dataclasses.replace(found, targets=(target,)), "frequencies")
    low, high = plan.shows.panels[0].limits
    assert low <= edges[0] < edges[1] <= high
    inside = [((low < c.y) & (c.y < high)).all() for c in plan.shows.panels[0].curves if c.end]
    assert any(inside)


def test_a_curve_that_leaves_its_panel_is_named_at_the_edge():
    look, x = Look(VERMILLION), np.arange(3.0)
    curves = (
        Curve(np.array([1.0, 2.0, 9.0]), look, end="leaves"),
        Curve(x + 7.0, look, end="never seen"),
    )
    panel = Panel("f [Hz]", curves, within=(0.0, 5.0))
    assert panel.ends() == [("leaves", 5.0, VERMILLION)]


def test_curves_of_few_samples_are_solved_between_them_and_keep_their_points():
    results = ea.assign(ea.load_case(SMALL)).results
    ((name, (time_s, rows)),) = results.between.items()
    assert name == results.trajectories[0].name
    assert time_s.size > 200 > results.time_s.size
    for row, sampled in zip(rows, results.spectrum, strict=True):
        at = np.searchsorted(time_s, results.time_s - 1e-9)
        np.testing.assert_allclose(row.optimal_hz[at], sampled.optimal_hz, rtol=1e-9)
        np.testing.assert_allclose(row.initial_hz[at], sampled.initial_hz, rtol=1e-9)
    (plan,) = plans_of(results, "frequencies")
    curves = plan.shows.panels[0].curves
    assert any(curve.y is rows[0].optimal_hz for curve in curves)
    assert any(c.y is results.spectrum[0].optimal_hz and c.look.marker for c in curves)


def test_all_that_is_forbidden_is_shaded(paper):
    lower, upper = paper.targets[0].asked.lower, paper.targets[0].asked.upper
    endless = np.full(lower.size, np.inf)
    found = with_limits(
        paper,
        ("at_least", lower, endless),
        ("at_most", -endless, upper),
        ("keep_out", lower, 1.02 * lower),
        ("keep_out", 0.9 * lower, 0.95 * lower),
        ("gap", lower, endless),
    )
    frequencies, gap = drawn(found, "frequencies").axes
    edges = [s.get_paths()[0].get_extents() for s in frequencies.collections]
    for limit in found.targets[:4]:
        for edge in (limit.asked.lower[0], limit.asked.upper[0]):
            if np.isfinite(edge):
                assert min(min(abs(edge - e.y0), abs(edge - e.y1)) for e in edges) < 1e-9
    (shade,) = gap.collections
    assert shade.get_paths()[0].get_extents().y1 == pytest.approx(lower[0])
    assert "distance" in gap.get_ylabel()


@pytest.mark.parametrize("spatial", [False, True])
def test_the_mechanism_is_drawn_whole_at_one_scale_in_all_directions(spatial):
    found = make_results(spatial=spatial)
    figure = drawn(found, "mechanism")
    axes = figure.axes[0]
    assert axes.get_aspect() == 1.0
    box = axes.get_position()
    width, height = figure.get_size_inches() * (box.width, box.height)
    low, high = np.transpose([axes.get_xlim(), axes.get_ylim()])
    assert width / (high - low)[0] == pytest.approx(height / (high - low)[1])
    assert legend(figure)[:3] == ["tip path", "elbow_mass", "tool_mass"]
    assert len(legend(figure)) == 3 + len(found.poses.lines)
    thick = [line for line in axes.get_lines() if line.get_linewidth() > 2.0]
    links = [line.get_xydata() for line in thick if line.get_color() != "white"]  # no gaps
    assert len(links) == 8 * len(found.poses.lines) * len(found.poses.lines[0])  # they taper
    for points in links:
        assert ((points >= low) & (points <= high)).all()
    if not spatial:
        tip = next(line for line in axes.get_lines() if line.get_color() == VERMILLION)
        np.testing.assert_array_equal(tip.get_xydata(), found.poses.tip_path)


# --- Files


def test_figures_are_written_in_several_formats_the_same_every_time(paper):
    plans, kinds = plans_of(paper, "mechanism", "coordinates"), ("png", "svg", "pdf")
    files = render(plans, kinds)
    assert list(files) == [f"{plan.name}.{kind}" for plan in plans for kind in kinds]
    assert files["mechanism.png"].startswith(b"\x89PNG")
    assert files["mechanism.pdf"].startswith(b"%PDF")
    assert ET.fromstring(files["mechanism.svg"]).tag.endswith("svg")
    assert render(plans, kinds) == files
    for word in (b"CreationDate", b"dc:date"):
        assert not any(word in data for data in files.values())
    assert render(plans, ()) == {}


def test_the_user_s_matplotlib_settings_change_nothing_and_are_left_alone(paper):
    plans = plans_of(paper, "frequencies")
    before, files = dict(matplotlib.rcParams), render(plans)
    assert dict(matplotlib.rcParams) == before
    theirs = {"font.size": 30, "font.family": "monospace", "path.simplify": False}
    with matplotlib.rc_context({**theirs, "text.hinting": "force_autohint", "axes.grid": False}):
        assert render(plans) == files


def test_results_without_a_trajectory_plan_only_what_they_have():
    assert run_figures(make_results(n_t=0, n_y=0)) == ()


def test_an_expansion_that_fails_somewhere_is_still_drawn(paper):
    study = paper.studies[0]
    broken = study.over_time.linearised_hz.copy()
    broken[:3] = np.nan
    over = dataclasses.replace(study.over_time, linearised_hz=broken)
    studies = (dataclasses.replace(study, over_time=over),)
    found = dataclasses.replace(paper, studies=studies)
    drawn(found, "approximation_mode_1_time").canvas.draw()


def test_names_lose_their_control_characters_and_their_middle():
    found = make_results(prefix=LONG + "x" * 50)
    names = legend(drawn(found, "coordinates"))
    assert all(name.startswith("ein_sehr") and name[-2:] in ("q1", "q2") for name in names)
    assert all(len(name) == 34 and "…" in name for name in names)
    shown = legend(drawn(make_results(prefix="a\x1b[31mb\n"), "coordinates"))
    assert not any(unicodedata.category(c)[0] == "C" for name in shown for c in name)
