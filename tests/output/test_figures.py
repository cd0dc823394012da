"""Figures show what the results say, the same every time, whatever the mechanism is like."""

from __future__ import annotations

import dataclasses
import io
import itertools
import unicodedata
import xml.etree.ElementTree as ET

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image
from synthetic_results import as_limit, make_results, studied

from eigassign.output import Curve, FigurePlan, Graph, Look, Panel, draw, render, run_figures
from eigassign.study import OtherModes, RunResults

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
        "progress",
        "approximation_mode_1_time",
        "approximation_mode_1_q",
        "approximation_mode_1_design",
    ]


@pytest.mark.parametrize(
    "name", [n if n == BY_DEFAULT else pytest.param(n, marks=pytest.mark.slow) for n in EVERY]
)
def test_every_kind_of_results_gives_figures_with_nothing_over_their_edge(name):
    files = render(run_figures(studied(make_results(**EVERY[name]))))
    assert len(files) >= 9
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
    for hz in (target.target_hz, target.initial_hz, target.exact_hz):
        assert any(np.array_equal(curve, hz) for curve in curves_of(above))
    low, high = above.get_ylim()
    asked = np.concatenate([target.target_hz, target.initial_hz, target.exact_hz])
    assert low < asked.min() < asked.max() < high < paper.spectrum.optimal_hz[:, 1].min()
    assert [text.get_text() for text in above.texts] == ["mode 1"]  # mode 2 is far above
    (plan,) = plans_of(paper, "frequencies")
    assert plan.shows.panels[0].whole[1] > paper.spectrum.initial_hz.max()
    off = curves_of(below)[-1]
    np.testing.assert_allclose(off, 100.0 * (target.exact_hz / target.target_hz - 1.0))
    assert (above.get_ylabel(), below.get_ylabel()) == ("frequency [Hz]", "off target [%]")
    assert below.get_xlabel() == "time [s]"
    assert set(legend(figure)) == {"mode 1 at 190 Hz", "initial design", "optimal design"}


def test_targets_far_apart_have_panels_of_their_own(paper):
    results = make_results(n_targets=3)
    (plan,) = plans_of(results, "frequencies")
    panels = [panel for panel in plan.shows.panels if panel.label == "frequency [Hz]"]
    assert len(panels) == 3
    for panel, target in zip(panels, results.targets, strict=True):
        assert panel.limits[0] < target.exact_hz.min() < target.exact_hz.max() < panel.limits[1]
    assert len([p for p in run_figures(results) if p.section == "answer"]) == 2


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


def test_limits_are_strips_on_their_wrong_side_so_that_other_modes_stay_legible(paper):
    lower = paper.targets[0].asked.lower
    endless = np.full(lower.size, np.inf)
    found = with_limits(paper, ("at_least", lower, endless), ("at_most", -endless, lower))
    axes = drawn(found, "frequencies").axes[0]
    below, above = (shade.get_paths()[0].get_extents() for shade in axes.collections)
    assert below.y1 == pytest.approx(lower[0])
    assert above.y0 == pytest.approx(lower[0])
    low, high = axes.get_ylim()
    assert max(below.height, above.height) < 0.06 * (high - low)


def test_the_progress_shows_every_step_and_the_one_shot(paper):
    figure = drawn(paper, "progress")
    assert legend(figure) == ["initial", "taken", "given up", "one shot"]
    taken = [100.0 * np.sqrt(step.objective) for step in paper.assignment.steps if step.taken]
    shown = next(line for line in figure.axes[0].get_lines() if line.get_label() == "taken")
    np.testing.assert_allclose(shown.get_ydata(), taken)
    found = with_limits(paper, ("at_least", paper.targets[0].asked.lower, np.full(152, np.inf)))
    axes, below = drawn(found, "progress").axes
    assert axes.get_ylabel() == "objective"
    assert below.get_ylabel() == "limits missed [%]"  # by the initial design


def test_steps_that_miss_limits_say_by_how_much(paper):
    pairs = zip(paper.assignment.steps, (0.03, 0.001, 0.0), strict=True)
    steps = tuple(dataclasses.replace(step, violation=missed) for step, missed in pairs)
    row = dataclasses.replace(paper.assignment, steps=steps)
    above, below = drawn(dataclasses.replace(paper, assignment=row), "progress").axes
    assert below.get_ylabel() == "limits missed [%]"
    assert below.get_lines()[1].get_ydata()[0] == pytest.approx(3.0)
    assert above.get_ylabel() == "rms error [%]"


def test_a_band_is_shown_with_the_modes_near_it(paper):
    found = with_limits(paper, ("keep_out", np.full(152, 180.0), np.full(152, 220.0)))
    near, far = np.full((152, 3), [160.0, 230.0, 700.0]), np.full((152, 3), [165.0, 240.0, 710.0])
    found = dataclasses.replace(found, spectrum=OtherModes((1, 2, 3), near, far))
    (axes,) = drawn(found, "frequencies").axes
    low, high = axes.get_ylim()
    assert low < 160.0 < 240.0 < high < 400.0
    assert [text.get_text() for text in axes.texts] == ["mode 1", "mode 2"]


def test_sensitivities_are_bars_of_the_largest():
    results = studied(make_results(n_y=12, n_targets=2))
    figure = drawn(results, "sensitivity")
    (axes,) = figure.axes
    names = [text.get_text() for text in axes.get_yticklabels()]
    assert len(names) == 10
    rows = [r for r in results.meaning.sensitivity if r.parameter in names]
    assert sorted(bar.get_width() for bar in axes.patches) == pytest.approx(
        sorted(r.percent_per_percent for r in rows)
    )
    assert legend(figure) == ["mode 1 at 190 Hz", "mode 2 at 380 Hz"]
    (plan,) = plans_of(results, "sensitivity")
    assert "10 largest of 12" in plan.caption


def test_ranges_enclose_the_answer_along_each_trajectory():
    results = studied(make_results(parts=(100, 52)))
    assert plans_of(results, "range_1")
    (axes,) = drawn(results, "range_2").axes
    reach, spread = (shade.get_paths()[0].get_extents() for shade in axes.collections[:2])
    answer = results.targets[0].exact_hz[100:]
    assert reach.y0 == pytest.approx(results.meaning.reach[0].lowest_hz[100:].min())
    assert spread.y1 == pytest.approx(1.01 * answer.max())
    np.testing.assert_array_equal(axes.get_lines()[0].get_ydata(), answer)


def test_the_comparison_shows_both_expansions_and_their_errors(paper):
    figure = drawn(paper, "approximation_mode_1_time")
    above, below = figure.axes
    values = paper.studies[0].over_time
    curves = (values.exact_hz, values.taylor_hz, values.linearised_hz)
    for line, hz in zip(above.get_lines(), curves, strict=True):
        np.testing.assert_array_equal(line.get_ydata(), hz)
    assert below.get_yscale() == "log"
    off = np.maximum(100.0 * np.abs(values.taylor_error), below.get_ylim()[0])
    np.testing.assert_array_equal(below.get_lines()[0].get_ydata(), off)
    assert legend(figure)[:2] == ["exact", "Taylor, order 4 (worst 0.0900 %)"]


def test_the_coordinates_have_a_panel_for_each_unit_and_no_two_neighbours_are_alike():
    found = make_results(n_q=12)
    figure = drawn(found, "coordinates")
    angles, strokes = figure.axes
    assert (angles.get_ylabel(), strokes.get_ylabel()) == ("joint angle [rad]", "joint stroke [m]")
    np.testing.assert_array_equal(strokes.get_lines()[0].get_ydata(), found.q[:, 3])
    (plan,) = plans_of(found, "coordinates")
    looks = {curve.label: curve.look for panel in plan.shows.panels for curve in panel.curves}
    ordered = [looks[f"q{k + 1}"] for k in range(12)]
    assert len(set(ordered)) == 12
    assert all(first.dash != second.dash for first, second in itertools.pairwise(ordered))


def test_maps_stand_side_by_side_with_the_expansion_point(paper):
    figure = drawn(paper, "approximation_mode_1_design")
    maps = [axes for axes in figure.axes if axes.get_title(loc="left")]
    assert [axes.get_title(loc="left").splitlines()[0] for axes in maps] == [
        "exact",
        "Taylor, order 4",
        "linearised in y",
    ]
    over = paper.studies[0].over_design
    for axes in maps:
        assert axes.get_xlabel() == "m1 [g]"  # 0.25 kg at most
        assert axes.get_xlim() == pytest.approx((0.0, 1000.0 * over.axes[0][-1]))
        ((x,), (y,)) = axes.get_lines()[0].get_data()
        assert (x, y) == pytest.approx((125.0, 125.0))
    (bands,) = [c for c in maps[0].collections if c.get_array() is not None]
    assert bands.levels[0] <= over.values.exact_hz.min()
    assert bands.levels[-1] >= over.values.exact_hz.max()
    assert legend(figure) == ["expansion point"]


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
    links = [c for c in axes.collections if hasattr(c, "get_segments")]
    links = [c for c in links if c.get_color()[0][:3].min() < 1.0]  # not the gaps around them
    assert len(links) == len(found.poses.lines) * len(found.poses.lines[0])
    for points in (piece for pose in links for piece in pose.get_segments()):
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


def test_another_answer_gives_another_picture(paper):
    moved = dataclasses.replace(paper.targets[0], exact_hz=paper.targets[0].exact_hz * 1.01)
    names = ("frequencies", "coordinates")
    before, after = (
        render(plans_of(results, *names))
        for results in (paper, dataclasses.replace(paper, targets=(moved,)))
    )
    assert [name for name in before if before[name] != after[name]] == ["frequencies.png"]


def test_results_without_a_trajectory_plan_only_what_they_have():
    assert run_figures(make_results(n_t=0, n_y=0)) == ()
    (only,) = run_figures(make_results(n_t=0, n_y=2))
    assert only.name == "approximation_mode_1_design"


def test_an_expansion_that_fails_somewhere_is_still_drawn(paper):
    study = paper.studies[0]
    values = study.over_design.values
    broken = values.linearised_hz.copy()
    broken[:3] = np.nan
    holes = dataclasses.replace(values, linearised_hz=broken)
    over = dataclasses.replace(study.over_design, values=holes)
    studies = (dataclasses.replace(study, over_design=over),)
    found = dataclasses.replace(paper, studies=studies)
    drawn(found, "approximation_mode_1_design").canvas.draw()


def test_a_map_on_which_nothing_varies_is_filled_and_not_left_blank():
    found = make_results(varies=False)
    (data,) = render(plans_of(found, "approximation_mode_1_design")).values()
    image = pixels(data)
    middle = image[image.shape[0] // 2]
    assert (middle < 200).all(axis=1).mean() > 0.5


def test_numbers_beside_maps_never_run_into_each_other(paper):
    study = paper.studies[0]
    wide = dataclasses.replace(study.over_design, axes=(np.linspace(1.2e5, 1.8e5, 21),) * 2)
    flat = dict.fromkeys(("exact_hz", "taylor_hz", "linearised_hz"), np.ones((21, 21)))
    over = dataclasses.replace(wide, values=dataclasses.replace(wide.values, **flat))
    found = dataclasses.replace(paper, studies=(dataclasses.replace(study, over_design=over),))
    figure = drawn(found, "approximation_mode_1_design")
    figure.canvas.draw()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = axis.get_view_interval()
            boxes = [
                tick.label1.get_window_extent()
                for tick in axis.get_major_ticks()
                if low <= tick.get_loc() <= high and tick.label1.get_visible()
            ]
            boxes = [box for box in boxes if box.width > 1.0]
            assert not any(a.overlaps(b) for a, b in itertools.pairwise(boxes))


# --- What a panel holds

PLAIN = Look("#000000")


@pytest.mark.parametrize(
    "span", [(0.0, 1.0), (-3.0, 5.0), (190.0, 190.0), (0.0, 0.0), (123456.0, 123456.0001)]
)
def test_an_ordinate_encloses_all_values_and_is_never_empty(span):
    low, high = Panel("", (Curve(np.array([np.nan, *span]), PLAIN),)).limits
    assert low <= span[0] <= span[1] <= high
    assert high - low > 1e-6 * abs(high)


@pytest.mark.parametrize(
    ("values", "most", "limits"),
    [
        ([0.5, 0.03], 5, (0.01, 1.0)),
        ([2e-7, 3e-6], 5, (1e-7, 1e-5)),
        ([1e-9, 0.5], 5, (1e-5, 1.0)),
        ([3e-11, 5.0, np.inf, 0.0], None, (1e-11, 10.0)),
        ([0.0, 0.0], 5, (1e-11, 1e-10)),
        ([np.nan, 0.2, 0.5], 5, (0.1, 1.0)),
    ],
)
def test_decades_hold_all_values_or_the_highest(values, most, limits):
    curve = Curve(np.array(values), PLAIN)
    panel = Panel("", (curve,), logarithmic=True, decades=most)
    assert panel.limits == pytest.approx(limits, abs=0.0)


def test_the_lowest_label_of_a_logarithmic_axis_owns_up_to_what_it_cuts():
    panel = Panel("error", (Curve(np.array([0.0, 0.02, 0.5]), PLAIN),), logarithmic=True)
    shown = Graph("", "", np.arange(3.0), (panel,))
    (axes,) = draw(FigurePlan("", "", "", "", shown)).axes
    assert axes.get_ylim() == (0.01, 1.0)
    show = axes.yaxis.get_major_formatter()
    labels = [show(at) for at in (0.01, 0.1, 1.0, 1e4, 1e5)]
    assert labels == ["≤0.01", "0.1", "1", "10000", "10⁵"]
    np.testing.assert_array_equal(axes.get_lines()[0].get_ydata(), [0.01, 0.02, 0.5])


@pytest.mark.parametrize(
    ("ends", "places"),
    [
        ([0.0, 1.0], [0.0, 1.0]),
        ([0.5, 0.5, 0.5], [0.3, 0.5, 0.7]),
        ([0.0, 0.1, 0.25], [-1 / 12, 7 / 60, 19 / 60]),
        ([], []),
    ],
)
def test_labels_at_curve_ends_are_moved_apart_and_no_further(ends, places):
    curves = tuple(Curve(np.array([end]), PLAIN, end="a") for end in ends)
    scale = (Curve(np.array([0.0, 1.0]), PLAIN),)
    panel = Panel("", (*curves, *scale), height=0.15 * 1.1 / 0.2)  # a label is 0.2 high then
    np.testing.assert_allclose([at for _, at, _ in panel.ends()], places)


def test_names_lose_their_control_characters_and_their_middle():
    found = make_results(prefix=LONG + "x" * 50)
    names = legend(drawn(found, "coordinates"))
    assert all(name.startswith("ein_sehr") and name[-2:] in ("q1", "q2") for name in names)
    assert all(len(name) == 34 and "…" in name for name in names)
    shown = legend(drawn(make_results(prefix="a\x1b[31mb\n"), "coordinates"))
    assert not any(unicodedata.category(c)[0] == "C" for name in shown for c in name)
