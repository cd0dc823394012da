"""Figures are drawn, the same every time, whatever the mechanism is like."""

from __future__ import annotations

import dataclasses
import io
import itertools

import matplotlib
import numpy as np
import pytest
from PIL import Image
from synthetic_results import make_results

from eigassign.output.figures import plan as figures
from eigassign.output.figures import png, ticks
from eigassign.output.figures.curves import spread
from eigassign.output.figures.frame import Entry, key_rows
from eigassign.output.figures.ink import Sheet, Stroke, series_stroke, settings, short
from eigassign.output.figures.lettering import DPI, text_width
from eigassign.study.results import RunResults

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


@pytest.fixture(scope="module")
def paper() -> RunResults:
    return make_results()


@pytest.fixture(scope="module")
def drawn(paper: RunResults) -> dict[str, bytes]:
    return figures.render(figures.plan(paper))


def pixels(data: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(float)


def test_the_paper_s_case_has_all_of_its_figures(drawn):
    assert list(drawn) == [
        "mechanism.png",
        "coordinates.png",
        "approximation_mode_1_time.png",
        "approximation_mode_1_q.png",
        "approximation_mode_1_design.png",
        "assignment_mode_1.png",
        "other_modes.png",
    ]


@pytest.mark.parametrize("options", EVERY.values(), ids=EVERY)
def test_every_kind_of_results_gives_pictures_with_something_on_them(options):
    found = make_results(**options)
    images = figures.render(figures.plan(found))
    assert len(images) >= 7
    for name, data in images.items():
        image = pixels(data)
        assert image.shape[1] == 8 * DPI, name
        assert 2 * DPI < image.shape[0] < 8 * DPI, name
        ink = (image < 250).any(axis=2)
        assert 0.01 < ink.mean() < 0.6, name
        edge = np.concatenate([ink[:3].ravel(), ink[-2:].ravel(), ink[:, :3].ravel()])
        assert not edge.any(), f"{name} runs over its edge"


def test_nothing_runs_over_the_right_edge(drawn):
    for name, data in drawn.items():
        assert (pixels(data)[:, -3:] > 250).all(), name


def test_drawing_twice_gives_the_same_bytes(paper, drawn):
    assert figures.render(figures.plan(paper)) == drawn


def test_the_user_s_matplotlib_settings_change_nothing(paper, drawn):
    theirs = {"font.size": 30, "font.family": "monospace", "path.simplify": False}
    with matplotlib.rc_context({**theirs, "text.hinting": "force_autohint"}):
        assert figures.render(figures.plan(paper)) == drawn


def test_drawing_leaves_the_user_s_settings_alone(paper):
    before = dict(matplotlib.rcParams)
    figures.render(figures.plan(paper)[:1])
    assert dict(matplotlib.rcParams) == before


def test_another_answer_gives_another_picture(paper, drawn):
    target = paper.targets[0]
    moved = dataclasses.replace(target, exact_hz=target.exact_hz * 1.01)
    other = dataclasses.replace(paper, targets=(moved,))
    changed = figures.render(figures.plan(other))
    assert [name for name in drawn if changed[name] != drawn[name]] == ["assignment_mode_1.png"]


def test_results_without_a_trajectory_plan_only_what_they_have():
    assert figures.plan(make_results(n_t=0, n_y=0)) == ()
    (only,) = figures.plan(make_results(n_t=0, n_y=2))
    assert only.file == "approximation_mode_1_design.png"


def test_an_expansion_that_fails_somewhere_is_still_drawn(paper):
    study = paper.studies[0]
    assert study.over_design is not None
    values = study.over_design.values
    broken = values.linearised_hz.copy()
    broken[:3] = np.nan
    holes = dataclasses.replace(values, linearised_hz=broken)
    over = dataclasses.replace(study.over_design, values=holes)
    target = dataclasses.replace(paper.targets[0], predicted_hz=np.full(paper.time_s.size, np.nan))
    studies = (dataclasses.replace(study, over_design=over),)
    found = dataclasses.replace(paper, studies=studies, targets=(target,))
    assert len(figures.render(figures.plan(found))) == 7


def test_a_map_on_which_nothing_varies_is_filled_and_not_left_blank():
    found = make_results(varies=False)
    plans = [p for p in figures.plan(found) if p.file.endswith("_design.png")]
    (image,) = map(pixels, figures.render(plans).values())
    middle = image[image.shape[0] // 2]
    assert (middle < 200).all(axis=1).mean() > 0.5


def test_a_curve_is_drawn_where_its_numbers_say():
    with settings():
        sheet = Sheet(1.0, 1.0)
        sheet.line(np.array([(0.0, 0.25), (1.0, 0.25)]), Stroke("#000000", 2.0))
    dark = (sheet.pixels()[:, :, 0] < 128).nonzero()[0]
    assert abs(dark.mean() - 0.75 * DPI) <= 1.0  # rows count from the top


def test_text_stands_where_it_was_put_and_is_as_wide_as_said():
    with settings():
        sheet, text = Sheet(4.0, 1.0), "HHHH 0.25 frequency HH"
        sheet.text(3.0, 0.5, text, align="right")
        width = text_width(text)
    rows, columns = (sheet.pixels()[:, :, 0] < 128).nonzero()
    assert columns.max() == pytest.approx(3.0 * DPI, abs=3)
    assert columns.min() == pytest.approx((3.0 - width) * DPI, abs=3)
    assert (rows.min() + rows.max()) / 2 == pytest.approx(0.5 * DPI, abs=3)


def test_upright_text_reads_upwards_around_its_centre():
    with settings():
        level, upright = Sheet(2.0, 2.0), Sheet(2.0, 2.0)
        level.text(1.0, 1.0, "Hz [1]", align="center")
        upright.text(1.0, 1.0, "Hz [1]", upright=True)
    turned = np.rot90(level.pixels())
    rows, columns = (turned[:, :, 0] < 128).nonzero()
    found_rows, found_columns = (upright.pixels()[:, :, 0] < 128).nonzero()
    assert found_rows.mean() == pytest.approx(rows.mean(), abs=2)
    assert found_columns.mean() == pytest.approx(columns.mean(), abs=2)
    assert found_rows.size == rows.size


def test_text_over_the_edge_is_cut_and_joined_scripts_are_drawn():
    with settings():
        sheet = Sheet(1.0, 0.5)
        for at in (-1.0, -0.2, 0.9, 5.0):
            sheet.text(at, 0.25, "over the edge")
            sheet.text(at, 0.25, "upright", upright=True)
        before = (sheet.pixels() < 250).sum()
        sheet.text(0.1, 0.4, "e\u0301 中")
    assert (sheet.pixels() < 250).sum() > before


def test_png_bytes_hold_exactly_the_pixels():
    picture = np.random.default_rng(1).integers(0, 256, (17, 23, 4), dtype=np.uint8)
    image = Image.open(io.BytesIO(png.encode(picture, 110)))
    np.testing.assert_array_equal(np.asarray(image), picture[:, :, :3])
    assert image.info["dpi"] == pytest.approx((110, 110), abs=0.1)


RANGES = [
    (0.0, 1.0),
    (189.9, 202.3),
    (-3.0, 5.0),
    (1e-9, 2e-9),
    (-2e12, 5e12),
    (190.0, 190.0),
    (0.0, 0.0),
    (1e300, 2e300),
    (123456.0, 123456.0001),
    (-0.004, 0.0),
]


@pytest.mark.parametrize("span", RANGES)
def test_linear_ticks_say_the_number_they_stand_at(span):
    values = np.array(span)
    scale = ticks.linear([values], count=5)
    assert 2 <= len(scale.positions) <= 7
    assert scale.low <= values.min() <= values.max() <= scale.high
    for position, label in zip(scale.positions, scale.labels, strict=True):
        said = float(label.replace("\N{MINUS SIGN}", "-")) * 10.0**scale.exponent
        assert said == pytest.approx(position, rel=1e-9, abs=1e-6 * (scale.high - scale.low))
    assert len(set(scale.labels)) == len(scale.labels)
    assert max(map(len, scale.labels)) <= 9


@pytest.mark.parametrize("span", RANGES)
def test_contour_levels_enclose_all_values(span):
    scale = ticks.levels([np.array(span)])
    assert scale.positions[0] <= min(span)
    assert scale.positions[-1] >= max(span)


@pytest.mark.parametrize(
    ("values", "labels"),
    [
        ([0.5, 0.03], ("0.01", "0.1", "1")),
        ([2e-7, 3e-6], ("10⁻⁷", "10⁻⁶", "10⁻⁵")),
        ([1.5, 0.0], ("≤1", "10")),
        ([0.0, 0.0], ("≤10⁻¹¹", "10⁻¹⁰")),
        ([np.nan, 0.2, 0.5], ("0.1", "1")),
    ],
)
def test_logarithmic_ticks_are_decades_and_own_up_to_what_they_cut(values, labels):
    assert ticks.logarithmic([np.array(values)]).labels == labels


def test_places_on_a_scale_follow_its_kind():
    linear, log = ticks.between(2.0, 4.0), ticks.logarithmic([np.array([0.5, 0.002])])
    np.testing.assert_allclose(linear.fraction(np.array([2.0, 3.0, 4.0])), [0.0, 0.5, 1.0])
    np.testing.assert_allclose(log.fraction(np.array([1e-9, 1e-3, 1.0])), [0.0, 0.0, 1.0])


def test_labels_at_curve_ends_are_moved_apart_and_no_further():
    assert spread([0.0, 1.0], 0.2) == [0.0, 1.0]
    np.testing.assert_allclose(spread([0.5, 0.5, 0.5], 0.2), [0.3, 0.5, 0.7])
    np.testing.assert_allclose(spread([0.0, 0.1, 0.25], 0.2), [-1 / 12, 7 / 60, 19 / 60])
    assert spread([], 0.2) == []


def test_a_legend_is_broken_into_rows_that_fit_and_loses_nothing():
    entries = [Entry(f"a rather long entry {i}", Stroke("#000000")) for i in range(7)]
    rows = key_rows(entries, 5.0)
    assert [entry for row in rows for entry in row] == entries
    assert 1 < len(rows) < 7


def test_no_two_of_twelve_curves_look_alike_or_differ_by_colour_alone():
    strokes = [series_stroke(i) for i in range(12)]
    assert len(set(strokes)) == 12
    for first, second in itertools.pairwise(strokes):
        assert first.dashes != second.dashes


def test_names_lose_their_control_characters_and_their_middle():
    assert short("a\x1b[31mb\n") == "a [31mb"
    assert len(short("x" * 500)) == 34
    assert short("begin" + "x" * 50 + "end").endswith("end")
