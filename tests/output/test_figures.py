"""Figures show what the results say, the same every time, whatever the mechanism is like."""

from __future__ import annotations

import dataclasses
import io
import itertools
import xml.etree.ElementTree as ET

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image
from synthetic_results import as_limit, make_results, studied

from eigassign.output import draw, render, run_figures
from eigassign.output.figures import graph, style
from eigassign.study import OtherModes, RunResults

LONG = "ein_sehr_langer_Name_für_$x_1^2$_中_\x1b[31m_"
EVERY = {
    "paper": {},
    "one sample": {"n_t": 1, "n_q": 1, "n_y": 1, "n_links": 1},
    "two samples": {"n_t": 2},
    "one parameter": {"n_y": 1, "n_q": 1},
    "many of all": {"n_q": 12, "n_y": 50, "n_links": 12, "n_targets": 3},
    "long names": {"prefix": LONG, "title": "<script>" * 30},
    "huge": {"scale_hz": 1e12, "scale_m": 1e9},
    "tiny": {"scale_hz": 1e-12, "scale_m": 1e-9},
    "nothing varies": {"varies": False},
    "spatial": {"spatial": True},
}
BY_DEFAULT = ("one sample", "long names", "spatial")  # of these figures; all of them: a minute


@pytest.fixture(scope="module")
def paper() -> RunResults:
    return make_results()


@pytest.fixture(scope="module")
def files(paper: RunResults) -> dict[str, bytes]:
    return render(run_figures(paper))


def drawn(results: RunResults) -> dict[str, Figure]:
    with style.applied():
        return {plan.name: draw(plan) for plan in run_figures(results)}


def title(figure: Figure) -> str:
    return figure.get_suptitle()


def legend(figure: Figure) -> list[str]:
    owners = [figure, *figure.axes]
    keys = [each.get_legend() if each is not figure else None for each in owners]
    return [text.get_text() for key in [*figure.legends, *keys] if key for text in key.get_texts()]


def pixels(data: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(float)


def test_the_paper_s_case_has_all_of_its_figures(files):
    assert list(files) == [
        "frequencies.png",
        "mechanism.png",
        "assignment_mode_1.png",
        "other_modes.png",
        "progress.png",
        "approximation_mode_1_time.png",
        "approximation_mode_1_q.png",
        "approximation_mode_1_design.png",
        "coordinates.png",
    ]


@pytest.mark.parametrize(
    "options",
    [
        pytest.param(EVERY[name], id=name, marks=[] if name in BY_DEFAULT else pytest.mark.slow)
        for name in EVERY
    ],
)
def test_every_kind_of_results_gives_figures_with_nothing_over_their_edge(options):
    files = render(run_figures(studied(make_results(**options))))
    assert len(files) >= 11
    for name, data in files.items():
        image = pixels(data)
        assert image.shape[1] == 880, name
        assert 200 < image.shape[0] < 900, name
        there = (image < 250).any(axis=2)
        assert 0.01 < there.mean() < 0.6, name
        edges = [there[:2], there[-2:], there[:, :2], there[:, -2:]]
        assert not any(edge.any() for edge in edges), f"{name} runs over its edge"


def test_the_assignment_shows_target_frequencies_and_distances(paper):
    figure, target = drawn(paper)["assignment_mode_1"], paper.targets[0]
    assert title(figure) == "Mode 1: assigned frequency"
    above, below = figure.axes
    shown = [line.get_ydata() for line in above.get_lines()]
    curves = (target.initial_hz, target.exact_hz, target.predicted_hz, target.one_shot_hz)
    wanted = (target.target_hz, *curves)
    for line, hz in zip(shown, wanted, strict=True):
        np.testing.assert_array_equal(line, hz)
    np.testing.assert_array_equal(above.get_lines()[0].get_xdata(), paper.time_s)
    off = below.get_lines()[2].get_ydata()
    np.testing.assert_allclose(off, 100.0 * (target.exact_hz / target.target_hz - 1.0))
    assert (above.get_ylabel(), below.get_ylabel()) == ("frequency [Hz]", "off target [%]")
    assert below.get_xlabel() == "time [s]"
    assert legend(figure) == [
        "target",
        "initial (worst 6.00 %)",
        "optimal, exact (worst 1.00 %)",
        "optimal, predicted (worst 1.00 %)",
        "one shot (worst 2.00 %)",
    ]


def test_a_limit_is_drawn_with_what_it_forbids_and_equal_names_are_numbered(paper):
    (target,) = paper.targets
    endless = np.full(target.lower_hz.size, np.inf)
    limits = (
        as_limit(target, "at_least", target.lower_hz, endless),
        as_limit(target, "at_most", -endless, target.upper_hz),
        as_limit(target, "keep_out", target.lower_hz, 1.02 * target.lower_hz),
        as_limit(target, "keep_out", 0.9 * target.lower_hz, 0.95 * target.lower_hz),
        as_limit(target, "gap", target.lower_hz, endless),
    )
    found = drawn(dataclasses.replace(paper, targets=limits))
    names = [f"{t.kind}_mode_1" for t in limits]
    names[3] += "_2"
    assert [name for name in found if name in names] == names
    for name, limit in zip(names, limits, strict=True):
        (axes,) = found[name].axes
        (shade,) = axes.collections
        heights = shade.get_paths()[0].get_extents()
        edges = [hz[0] for hz in (limit.lower_hz, limit.upper_hz) if np.isfinite(hz).all()]
        for edge in edges:
            assert min(abs(edge - heights.y0), abs(edge - heights.y1)) < 1e-9
        assert legend(found[name])[0] == "forbidden"


def test_the_progress_shows_every_step_and_the_one_shot(paper):
    (axes,) = drawn(paper)["progress"].axes
    assert legend(drawn(paper)["progress"]) == ["initial", "taken", "given up", "one shot"]
    steps = paper.assignment.steps
    taken = [100.0 * np.sqrt(step.objective) for step in steps if step.taken]
    shown = next(line for line in axes.get_lines() if line.get_label() == "taken")
    np.testing.assert_allclose(shown.get_ydata(), taken)
    limit = as_limit(paper.targets[0], "at_least", paper.targets[0].lower_hz, np.full(152, np.inf))
    axes, below = drawn(dataclasses.replace(paper, targets=(limit,)))["progress"].axes
    assert axes.get_ylabel() == "objective"
    assert below.get_ylabel() == "limits missed [%]"  # by the initial design


def test_steps_that_miss_limits_say_by_how_much(paper):
    steps = [dataclasses.replace(s, violation=v) for s, v in zip(
        paper.assignment.steps, (0.03, 0.001, 0.0), strict=True)]  # fmt: skip
    row = dataclasses.replace(paper.assignment, steps=tuple(steps))
    above, below = drawn(dataclasses.replace(paper, assignment=row))["progress"].axes
    assert below.get_ylabel() == "limits missed [%]"
    _, taken = below.get_lines()[:2]
    assert taken.get_ydata()[0] == pytest.approx(3.0)
    assert above.get_ylabel() == "rms error [%]"


def test_a_band_is_drawn_with_all_modes_near_it(paper):
    (target,) = paper.targets
    near = OtherModes((2, 3), np.full((152, 2), [160.0, 230.0]), np.full((152, 2), [170.0, 240.0]))
    band = as_limit(target, "keep_out", np.full(152, 180.0), np.full(152, 220.0))
    figure = drawn(dataclasses.replace(paper, targets=(dataclasses.replace(band, near=near),)))[
        "keep_out_mode_1"
    ]
    (axes,) = figure.axes
    shown = {line.get_ydata()[0] for line in axes.get_lines()}
    assert shown == {180.0, 220.0, 160.0, 170.0, 230.0, 240.0}
    assert {text.get_text() for text in axes.texts} >= {"mode 2", "mode 3"}
    assert legend(figure) == ["forbidden", "initial design", "optimal design"]


def test_sensitivities_are_bars_of_the_largest(paper):
    results = studied(make_results(n_y=12, n_targets=2))
    (axes,) = drawn(results)["sensitivity"].axes
    names = [text.get_text() for text in axes.get_yticklabels()]
    assert len(names) == 10
    rows = [r for r in results.meaning.sensitivity if r.parameter in names]
    assert sorted(bar.get_width() for bar in axes.patches) == pytest.approx(
        sorted(r.percent_per_percent for r in rows)
    )
    assert legend(drawn(results)["sensitivity"]) == ["mode 1 at 190 Hz", "mode 2 at 380 Hz"]
    assert (
        "10 largest of 12"
        in next(p for p in run_figures(results) if p.name == "sensitivity").caption
    )


def test_ranges_enclose_the_answer_along_each_trajectory():
    results = studied(make_results(parts=(100, 52)))
    found = drawn(results)
    assert {"range_1", "range_2"} <= set(found)
    (axes,) = found["range_2"].axes
    reach, spread = (shade.get_paths()[0].get_extents() for shade in axes.collections[:2])
    answer = results.targets[0].exact_hz[100:]
    assert reach.y0 == pytest.approx(results.meaning.reach[0].lowest_hz[100:].min())
    assert spread.y1 == pytest.approx(1.01 * answer.max())
    np.testing.assert_array_equal(axes.get_lines()[0].get_ydata(), answer)


def test_error_falls_over_mass_to_the_answer(paper):
    results = studied(paper)
    (axes,) = drawn(results)["trade_off"].axes
    curve, end = axes.get_lines()[:2]
    points = results.meaning.trade_off.points
    np.testing.assert_allclose(curve.get_ydata(), [100.0 * p.error for p in points])
    np.testing.assert_allclose(end.get_xdata(), [points[-1].amount])
    assert axes.get_xlabel() == "mass [kg]"


def test_the_comparison_shows_both_expansions_and_their_errors(paper):
    figure, study = drawn(paper)["approximation_mode_1_time"], paper.studies[0]
    above, below = figure.axes
    values = study.over_time
    for line, hz in zip(
        above.get_lines(), (values.exact_hz, values.taylor_hz, values.linearised_hz), strict=True
    ):
        np.testing.assert_array_equal(line.get_ydata(), hz)
    assert below.get_yscale() == "log"
    bottom = below.get_ylim()[0]
    off = np.maximum(100.0 * np.abs(values.taylor_error), bottom)
    np.testing.assert_array_equal(below.get_lines()[0].get_ydata(), off)
    assert legend(figure)[:2] == ["exact", "Taylor, order 4 (worst 0.0900 %)"]


def test_the_coordinates_have_a_panel_for_each_unit():
    found = make_results(n_q=5)
    figure = drawn(found)["coordinates"]
    angles, strokes = figure.axes
    assert (angles.get_ylabel(), strokes.get_ylabel()) == ("joint angle [rad]", "joint stroke [m]")
    (stroke,) = strokes.get_lines()
    np.testing.assert_array_equal(stroke.get_ydata(), found.q[:, 3])
    assert sorted(legend(figure)) == ["q1", "q2", "q3", "q4", "q5"]


def test_next_modes_are_named_at_the_end_of_their_curves(paper):
    (axes,) = drawn(paper)["other_modes"].axes
    assert [text.get_text() for text in axes.texts] == ["mode 2", "mode 3", "mode 4"]
    solid = [line for line in axes.get_lines() if line.get_linestyle() == "-"]
    for line, text, hz in zip(solid, axes.texts, paper.others.optimal_hz.T, strict=True):
        np.testing.assert_array_equal(line.get_ydata(), hz)
        assert text.get_color() == line.get_color()


def test_maps_stand_side_by_side_with_the_expansion_point(paper):
    figure = drawn(paper)["approximation_mode_1_design"]
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
def test_the_mechanism_is_drawn_at_one_scale_in_all_directions(spatial):
    found = make_results(spatial=spatial)
    figure = drawn(found)["mechanism"]
    axes = figure.axes[0]
    assert axes.get_aspect() == 1.0
    box = axes.get_position()
    width, height = figure.get_size_inches() * (box.width, box.height)
    x, y = np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())
    assert width / x == pytest.approx(height / y)
    assert legend(figure)[:3] == ["tip path", "elbow_mass", "tool_mass"]
    assert len(legend(figure)) == 3 + len(found.poses.lines)
    if not spatial:
        tip = next(line for line in axes.get_lines() if line.get_color() == graph.VERMILLION)
        np.testing.assert_array_equal(tip.get_xydata(), found.poses.tip_path)


def test_several_formats_write_each_figure_in_each(paper):
    plans = run_figures(paper)[:2]
    files = render(plans, ("png", "svg", "pdf"))
    assert list(files) == [
        f"{name}.{kind}" for name in ("frequencies", "mechanism") for kind in style.FORMATS
    ]
    assert files["mechanism.png"].startswith(b"\x89PNG")
    assert files["mechanism.pdf"].startswith(b"%PDF")
    assert ET.fromstring(files["mechanism.svg"]).tag.endswith("svg")
    assert render(plans, ()) == {}


@pytest.mark.parametrize("kind", style.FORMATS)
def test_drawing_twice_gives_the_same_bytes(paper, kind):
    plans = run_figures(paper)[::3]
    files = render(plans, (kind,))
    assert render(plans, (kind,)) == files
    for word in (b"CreationDate", b"dc:date"):
        assert not any(word in data for data in files.values())


def test_the_user_s_matplotlib_settings_change_nothing(paper, files):
    theirs = {"font.size": 30, "font.family": "monospace", "path.simplify": False}
    with matplotlib.rc_context({**theirs, "text.hinting": "force_autohint", "axes.grid": False}):
        assert render(run_figures(paper)) == files


def test_drawing_leaves_the_user_s_settings_alone(paper):
    before = dict(matplotlib.rcParams)
    render(run_figures(paper)[:1])
    assert dict(matplotlib.rcParams) == before


def test_another_answer_gives_another_picture(paper, files):
    target = paper.targets[0]
    moved = dataclasses.replace(target, exact_hz=target.exact_hz * 1.01)
    other = dataclasses.replace(paper, targets=(moved,))
    changed = render(run_figures(other))
    assert [name for name in files if changed[name] != files[name]] == [
        "frequencies.png",
        "assignment_mode_1.png",
    ]


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
    target = dataclasses.replace(paper.targets[0], predicted_hz=np.full(paper.time_s.size, np.nan))
    studies = (dataclasses.replace(study, over_design=over),)
    found = dataclasses.replace(paper, studies=studies, targets=(target,))
    assert len(render(run_figures(found))) == 9


def test_a_map_on_which_nothing_varies_is_filled_and_not_left_blank():
    found = make_results(varies=False)
    plans = [p for p in run_figures(found) if p.name.endswith("_design")]
    (image,) = map(pixels, render(plans).values())
    middle = image[image.shape[0] // 2]
    assert (middle < 200).all(axis=1).mean() > 0.5


SPANS = [(0.0, 1.0), (-3.0, 5.0), (190.0, 190.0), (0.0, 0.0), (123456.0, 123456.0001)]


@pytest.mark.parametrize("span", SPANS)
def test_bounds_enclose_all_values_and_are_never_one(span):
    low, high = graph.bounds([np.array([np.nan, *span])])
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
    assert graph.decades([np.array(values)], most) == pytest.approx(limits, abs=0.0)


def test_the_lowest_label_of_a_logarithmic_axis_owns_up_to_what_it_cuts():
    errors = graph.Curve(np.array([0.0, 0.02, 0.5]), graph.Look(graph.BLUE))
    panel = graph.Panel("error", (errors,), logarithmic=True)
    shown = graph.Graph("", "", np.arange(3.0), (panel,))
    with style.applied():
        (axes,) = draw(graph.FigurePlan("", "", "", "", shown)).axes
    show = axes.yaxis.get_major_formatter()
    assert axes.get_ylim() == (0.01, 1.0)
    assert [show(at) for at in (0.01, 0.1, 1.0)] == ["≤0.01", "0.1", "1"]
    np.testing.assert_array_equal(axes.get_lines()[0].get_ydata(), [0.01, 0.02, 0.5])


def test_powers_of_ten_are_written_as_people_read_them():
    assert [graph.power(at) for at in (1e-7, 1e-3, 1.0, 1e4, 1e5)] == [
        "10⁻⁷",
        "0.001",
        "1",
        "10000",
        "10⁵",
    ]


def test_labels_at_curve_ends_are_moved_apart_and_no_further():
    assert graph.spread([0.0, 1.0], 0.2) == [0.0, 1.0]
    np.testing.assert_allclose(graph.spread([0.5, 0.5, 0.5], 0.2), [0.3, 0.5, 0.7])
    np.testing.assert_allclose(graph.spread([0.0, 0.1, 0.25], 0.2), [-1 / 12, 7 / 60, 19 / 60])
    assert graph.spread([], 0.2) == []


def test_neighbouring_curves_never_differ_by_colour_alone():
    looks = [graph.series(i) for i in range(12)]
    assert len({str(look) for look in looks}) == 12
    for first, second in itertools.pairwise(looks):
        assert first.dash != second.dash


def test_names_lose_their_control_characters_and_their_middle():
    assert graph.short("a\x1b[31mb\n") == "a [31mb"
    assert len(graph.short("x" * 500)) == 34
    assert graph.short("begin" + "x" * 50 + "end").endswith("end")


def test_numbers_beside_maps_never_run_into_each_other(paper):
    study = paper.studies[0]
    wide = dataclasses.replace(study.over_design, axes=(np.linspace(1.2e5, 1.8e5, 21),) * 2)
    values = dataclasses.replace(
        wide.values,
        exact_hz=np.ones((21, 21)),
        taylor_hz=np.ones((21, 21)),
        linearised_hz=np.ones((21, 21)),
    )
    over = dataclasses.replace(wide, values=values)
    found = dataclasses.replace(paper, studies=(dataclasses.replace(study, over_design=over),))
    figure = drawn(found)["approximation_mode_1_design"]
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


def test_limits_are_strips_on_their_wrong_side_so_that_other_modes_stay_legible(paper):
    (target,) = paper.targets
    endless = np.full(target.lower_hz.size, np.inf)
    limits = (
        as_limit(target, "at_least", target.lower_hz, endless),
        as_limit(target, "at_most", -endless, target.lower_hz),
    )
    axes = drawn(dataclasses.replace(paper, targets=limits))["frequencies"].axes[0]
    below, above = (shade.get_paths()[0].get_extents() for shade in axes.collections)
    edge = target.lower_hz[0]
    assert below.y1 == pytest.approx(edge)
    assert above.y0 == pytest.approx(edge)
    low, high = axes.get_ylim()
    assert max(below.height, above.height) < 0.06 * (high - low)
