"""Pictures of modes, and how space is shown on a sheet."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from PIL import Image

import eigassign as ea
from eigassign.output import (
    draw,
    mechanism_plan,
    mode_figures,
    render,
    scale_words,
    thumbnail,
    write_modes,
)
from eigassign.study import DrawnBody, DrawnPoses, ModePictures, draw_modes, with_middle_loads

CASES = Path(__file__).parents[2] / "cases"
GALLERY = CASES / "gallery"
ALL = sorted(path.stem for path in CASES.glob("*.yaml"))
BLUE, SKY = "#0072B2", "#56B4E9"
BY_DEFAULT = ("arm_6r",)


def pictures(name: str, count: int = 2) -> ModePictures:
    case = ea.load_case(CASES / f"{name}.yaml")
    q = with_middle_loads(case.file, case.file.expansion.q)
    return draw_modes(case.file, case.model(), q, case.initial_design, count)


def pixels(data: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(int)


def segments(figure: Figure, colour: str) -> list[np.ndarray]:
    """The links that are drawn in this colour, in order."""
    drawn = [c for c in figure.axes[0].collections if to_hex(c.get_color()[0]) == colour.lower()]
    return [piece for collection in drawn for piece in collection.get_segments()]


@pytest.mark.parametrize(
    "name",
    [n if n in BY_DEFAULT else pytest.param(n, marks=pytest.mark.slow) for n in ALL],
)
def test_every_shipped_mechanism_has_figures_that_keep_within_their_edges(name: str) -> None:
    found = pictures(name)
    files = render(mode_figures(found))
    assert list(files) == ["mode_1.png", "mode_2.png"]
    for data in files.values():
        image = pixels(data)
        assert image.shape[1] == 880
        there = (image < 250).any(axis=2)
        edge = [there[:3], there[-2:], there[:, :3].T, there[:, -3:].T]
        assert not any(side.any() for side in edge)
    assert files["mode_1.png"] != files["mode_2.png"]
    assert render(mode_figures(pictures(name))) == files


def test_a_mode_is_drawn_over_the_links_at_rest_with_the_other_phase_beside_it() -> None:
    found = pictures("four_bar")
    figure = draw(mode_figures(found)[1])
    assert figure.get_suptitle().endswith(f"mode 2, {found.frequencies_hz[1]:.5g} Hz")
    for drawn, line in zip(segments(figure, "#d4d4d4"), found.rest.lines[0], strict=True):
        np.testing.assert_allclose(drawn, line)
    for drawn, line in zip(segments(figure, BLUE), found.deformed.lines[1], strict=True):
        np.testing.assert_allclose(drawn, line)
    other = [line for line in figure.axes[0].get_lines() if line.get_color() == SKY]
    for drawn, rest, moved in zip(other, found.rest.lines[0], found.deformed.lines[1], strict=True):
        np.testing.assert_allclose(drawn.get_xydata(), 2.0 * rest - moved)
    assert figure.axes[0].get_aspect() == 1.0
    where = ", ".join(text.get_text() for text in figure.texts)
    assert f"{found.q[0][0]} = " in where


@pytest.mark.parametrize("name", ALL)
def test_the_gallery_has_a_small_picture_of_every_shipped_case(name: str) -> None:
    file = GALLERY / f"{name}.png"
    assert file.stat().st_size < 40_000
    drawn = pixels(thumbnail(pictures(name, 1)))
    committed = pixels(file.read_bytes())
    assert committed.shape == drawn.shape
    # letters may differ by the version of matplotlib; what is drawn is the same
    assert (np.abs(committed - drawn).max(axis=2) > 40).mean() < 0.01, "run cases/gallery/draw.py"


def test_the_gallery_has_the_first_screen_of_every_report_and_nothing_else() -> None:
    expected = {f"{name}{end}.png" for name in ALL for end in ("", "_report")}
    assert {path.name for path in GALLERY.glob("*.png")} == expected, "run cases/gallery/draw.py"
    assert sum(path.stat().st_size for path in GALLERY.glob("*.png")) < 2_000_000
    listed = (CASES / "README.md").read_text(encoding="utf-8")
    assert [name for name in expected if f"gallery/{name}" not in listed] == []


def test_the_shapes_are_left_as_numbers_too(tmp_path: Path) -> None:
    found = pictures("four_bar", 3)
    write_modes(found, tmp_path)
    document = json.loads((tmp_path / "modes.json").read_text())
    assert document["frequencies_hz"] == list(found.frequencies_hz)
    assert [line["link"] for line in document["lines"]] == ["crank", "coupler", "follower"]
    for k, line in enumerate(document["lines"]):
        np.testing.assert_array_equal(line["rest"], found.rest.lines[0][k])
        np.testing.assert_array_equal(line["deformed"][2], found.deformed.lines[2][k])
    assert sorted(p.name for p in (tmp_path / "figures").iterdir()) == [
        "mode_1.png",
        "mode_2.png",
        "mode_3.png",
    ]


# --- A drawing


def poses(*lines: list[list[float]], **more: object) -> DrawnPoses:
    """One pose of these lines."""
    more = {"line_links": ("a",) * len(lines), **more}
    return DrawnPoses(np.zeros(1), (tuple(np.array(line) for line in lines),), ("a",), **more)


def bearings(figure: Figure) -> list[np.ndarray]:
    """The axes' directions on the sheet."""
    ends = [line.get_xydata() for line in figure.axes[1].get_lines()[:-1]]
    return [end[1] - end[0] for end in ends]


def test_space_is_seen_from_above_with_z_upright_and_x_to_the_right() -> None:
    cloud = np.random.default_rng(0).standard_normal((40, 3)).tolist()
    x, y, z = bearings(draw(mechanism_plan("", poses(cloud))))
    assert z[0] == pytest.approx(0.0)
    assert z[1] > 0.0
    assert x[0] > 0.0
    assert x[1] < 0.0 < y[1]
    sheet = np.array([x, y, z]) / np.linalg.norm([x[0], y[0]])
    np.testing.assert_allclose(sheet.T @ sheet, np.eye(2), atol=1e-12)


def test_a_mechanism_in_the_plane_of_sight_is_seen_from_another_side() -> None:
    rng, turn = np.random.default_rng(0), np.radians(-60.0)
    flat = rng.uniform(size=(50, 2)) @ np.array([[np.cos(turn), np.sin(turn), 0], [0, 0, 1]])
    usual = bearings(draw(mechanism_plan("", poses(rng.uniform(size=(50, 3)).tolist()))))
    figure = draw(mechanism_plan("", poses(flat.tolist())))
    assert not np.allclose(bearings(figure), usual)
    (line,) = segments(figure, BLUE)
    assert np.linalg.svd(line - line.mean(axis=0), compute_uv=False)[1] > 1.0


def test_a_taper_is_drawn_in_pieces_that_grow_thinner() -> None:
    line = [[0.0, 0.0], [1.0, 0.0]]
    figure = draw(mechanism_plan("", poses(line, depths=((0.1, 0.025),))))
    _, links = figure.axes[0].collections  # over a gap around it
    widths = np.array(links.get_linewidths())
    assert len(widths) > 4
    assert (np.diff(widths) < 0.0).all()
    np.testing.assert_allclose(links.get_segments()[0][0], line[0])
    np.testing.assert_allclose(links.get_segments()[-1][-1], line[1], atol=1e-12)


def test_sections_are_drawn_to_scale_or_so_many_times_as_thick() -> None:
    lines = [[[0.0, float(k)], [2.0, float(k)]] for k in range(3)]
    for depth, times, words in (
        (0.2, 1, "to scale"),
        (0.01, 10, "10 times"),
        (5.0, None, "thinner"),
    ):
        depths = ((depth, depth), (depth / 2, depth / 2), (0.0, 0.0))
        shown = poses(*lines, depths=depths)
        axes = draw(mechanism_plan("", shown)).axes[0]
        points_per_metre = np.diff(axes.transData.transform([[0, 0], [1, 0]])[:, 0])[0]
        points_per_metre *= 72.0 / axes.figure.dpi
        thick, thin, plain = (c.get_linewidths()[0] for c in axes.collections[1::2])
        assert thin == pytest.approx(thick / 2)
        assert plain >= 1.3
        if times:
            assert thick == pytest.approx(times * depth * points_per_metre, rel=1e-6)
        assert words in scale_words(shown)


def test_heavy_bodies_are_large() -> None:
    line = [[0.0, 0.0], [1.0, 0.0]]
    bodies = tuple(DrawnBody(f"{m}", m, np.zeros((1, 2))) for m in (8.0, 1.0, 0.0))
    axes = draw(mechanism_plan("", poses(line, bodies=bodies))).axes[0]
    assert [dot.get_markersize() for dot in axes.get_lines()] == [12.0, 9.0, 6.0]


@pytest.mark.parametrize(
    ("size", "label"), [(0.5, "0.1 m"), (0.2, "20 mm"), (10.0, "2 m"), (2e-7, "2·10⁻⁸ m")]
)
def test_the_scale_is_a_round_length(size: float, label: str) -> None:
    figure = draw(mechanism_plan("", poses([[0.0, 0.0], [size, 0.0]])))
    texts = [text.get_text() for text in figure.axes[1].texts]
    assert texts == ["x", "y", label]
