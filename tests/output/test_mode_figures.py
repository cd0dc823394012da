"""Pictures of modes, and how space is shown on a sheet."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from synthetic_results import make_results

import eigassign as ea
from eigassign.output.figures import ink, plan
from eigassign.output.figures.lettering import DPI
from eigassign.output.figures.mechanism import (
    diameters,
    extent,
    length_label,
    line_widths,
    round_length,
    view_of,
)
from eigassign.output.figures.modes import plan_modes, thumbnail
from eigassign.output.report import write_modes
from eigassign.study.drawing import draw_modes
from eigassign.study.results import DrawnBody, DrawnPoses, ModePictures

CASES = Path(__file__).parents[2] / "cases"
GALLERY = CASES / "gallery"
ALL = sorted(path.stem for path in CASES.glob("*.yaml"))


def pictures(name: str, count: int = 2) -> ModePictures:
    case = ea.load_case(CASES / f"{name}.yaml")
    q = np.array(case.file.expansion.q, dtype=float)
    return draw_modes(case.file, case.model(), q, case.initial_design, count)


def pixels(data: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(int)


def shows(image: np.ndarray, colour: str) -> int:
    """How many pixels have just this colour."""
    rgb = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    return int((np.abs(image - rgb).max(axis=2) <= 2).sum())


@pytest.mark.parametrize("name", ALL)
def test_every_shipped_mechanism_has_figures_with_rest_mode_and_a_white_margin(name: str) -> None:
    found = pictures(name)
    files = plan.render(plan_modes(found))
    assert list(files) == ["mode_1.png", "mode_2.png"]
    for data in files.values():
        image = pixels(data)
        assert image.shape[1] == 8 * DPI
        assert shows(image, ink.BLUE) > 500
        ink_there = (image < 250).any(axis=2)
        edge = [ink_there[:3], ink_there[-2:], ink_there[:, :3].T, ink_there[:, -3:].T]
        assert not any(side.any() for side in edge)
    assert files["mode_1.png"] != files["mode_2.png"]
    assert plan.render(plan_modes(pictures(name))) == files


def test_a_mode_that_bends_shows_the_grey_links_beside_it() -> None:
    (first, _) = plan.render(plan_modes(pictures("four_bar"))).values()
    assert shows(pixels(first), "#c4c4c4") > 500
    assert shows(pixels(first), ink.SKY) > 100


@pytest.mark.parametrize("name", ALL)
def test_the_gallery_has_a_small_picture_of_every_shipped_case(name: str) -> None:
    file = GALLERY / f"{name}.png"
    assert file.stat().st_size < 40_000
    with ink.settings():
        sheet = thumbnail(pictures(name, 1))
    committed = pixels(file.read_bytes())
    drawn = sheet.pixels()[:, :, :3].astype(int)
    assert committed.shape == drawn.shape
    # letters may differ by the version of the font; what is drawn is the same
    assert (np.abs(committed - drawn).max(axis=2) > 40).mean() < 0.01, "run cases/gallery/draw.py"


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


def test_space_is_seen_from_above_with_z_upright_and_x_to_the_right() -> None:
    view = view_of(np.random.default_rng(0).standard_normal((40, 3)))
    x, y, z = view.flat(np.eye(3))
    assert z[0] == pytest.approx(0.0)
    assert z[1] > 0.9
    assert x[0] > 0.5
    assert x[1] < 0.0 < y[1]
    np.testing.assert_allclose(view.directions @ view.directions.T, np.eye(2), atol=1e-12)


def test_a_mechanism_in_the_plane_of_sight_is_seen_from_another_side() -> None:
    toward = np.array([np.cos(np.radians(-60.0)), np.sin(np.radians(-60.0)), 0.0])
    sheet = np.random.default_rng(0).uniform(size=(50, 2)) @ np.array([toward, [0.0, 0.0, 1.0]])
    flat = view_of(sheet).flat(sheet)
    assert np.linalg.svd(flat - flat.mean(axis=0), compute_uv=False)[1] > 1.0
    plain = view_of(np.random.default_rng(0).uniform(size=(50, 3)))
    assert not np.allclose(view_of(sheet).directions, plain.directions)


def test_a_canvas_keeps_angles_and_holds_everything() -> None:
    poses = make_results(spatial=True).poses
    held = extent(poses)
    with ink.settings():
        canvas = held.on(ink.Sheet(4.0, 3.0), (0.5, 0.5, 3.0, 2.0))
    placed = canvas.place(held.points)
    assert (placed >= 0.5 - 1e-9).all()
    assert (placed <= np.array([3.5, 2.5]) + 1e-9).all()
    touched = np.isclose(np.ptp(placed, axis=0), [3.0, 2.0])
    assert touched.any()
    before, after = np.diff(held.view.flat(held.points), axis=0), np.diff(placed, axis=0)
    np.testing.assert_allclose(after * canvas.per_inch, before, atol=1e-12)


def test_thick_sections_are_drawn_thick_and_heavy_bodies_large() -> None:
    line = np.zeros((2, 2))
    poses = DrawnPoses(
        np.zeros(1), ((line,) * 3,), ("a",), sizes=((0.01, 0.01), (0.0025, 0.01), (0, 0))
    )
    (thick, _), (thin, end), (plain, _) = line_widths(poses)
    assert plain < thick == end
    assert 1.3 < thin < thick
    bodies = [DrawnBody("a", 8.0, line), DrawnBody("b", 1.0, line), DrawnBody("c", 0.0, line)]
    assert diameters(bodies) == [12.0, 9.0, 6.0]
    assert diameters(bodies[2:]) == [8.0]


@pytest.mark.parametrize(
    ("most", "length", "label"),
    [(0.19, 0.1, "0.1 m"), (0.07, 0.05, "50 mm"), (3.0, 2.0, "2 m"), (5e-8, 5e-8, "5·10⁻⁸ m")],
)
def test_the_scale_is_a_round_length(most: float, length: float, label: str) -> None:
    assert round_length(most) == pytest.approx(length)
    assert length_label(round_length(most)) == label
