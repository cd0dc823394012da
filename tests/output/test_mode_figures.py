"""Pictures of modes."""

import io
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

import eigassign as ea
from eigassign.output import draw, mode_figures, render, write_figures
from eigassign.study import ModePictures, draw_modes, with_middle_loads

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


def links(figure: Figure, colour: str) -> list[np.ndarray]:
    """The links that are drawn in this colour, in order: what is thicker than any symbol."""
    lines = [line for line in figure.axes[0].get_lines() if line.get_color() == colour]
    return [line.get_xydata() for line in lines if line.get_linewidth() > 1.2]


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
    for drawn, line in zip(links(figure, "#d4d4d4"), found.rest.lines[0], strict=True):
        np.testing.assert_allclose(drawn, line)
    for drawn, line in zip(links(figure, BLUE), found.deformed.lines[1], strict=True):
        np.testing.assert_allclose(drawn, line)
    other = [line for line in figure.axes[0].get_lines() if line.get_color() == SKY]
    for drawn, rest, moved in zip(other, found.rest.lines[0], found.deformed.lines[1], strict=True):
        np.testing.assert_allclose(drawn.get_xydata(), 2.0 * rest - moved)
    assert figure.axes[0].get_aspect() == 1.0
    assert found.where == "crank_angle = 120 deg, coupler = 4 mm, follower = 4 mm"
    assert figure.axes[0].get_xlabel() == found.where


def test_a_solid_is_drawn_by_its_outline_at_the_scale_of_its_mesh() -> None:
    case = ea.load_case(CASES / "casting_arm.yaml")
    found = pictures("casting_arm")
    (solid,) = found.rest.solids
    text = (CASES / "casting_arm" / "forearm.msh").read_text()
    nodes = text.partition("$Nodes")[2].partition("$EndNodes")[0].split("\n")
    mesh = 1e-3 * np.array([row.split() for row in nodes if len(row.split()) == 3], dtype=float)
    farthest = np.linalg.norm(mesh[:, None] - mesh[None, ::7], axis=2).max()
    places = solid.places[0]
    assert np.linalg.norm(places[:, None] - places[None], axis=2).max() == pytest.approx(
        farthest, rel=0.02
    )
    (moved,) = found.deformed.solids
    assert np.linalg.norm(moved.places - places, axis=2).max() < 0.5 * farthest
    lines = [line.get_xydata() for line in draw(mode_figures(found)[0]).axes[0].get_lines()]
    outline = [xy for xy in lines if np.isnan(xy).any() and len(xy) > 60]
    assert len(outline) >= 2  # at rest, and deformed
    assert "deg" in found.where
    assert "rad" not in found.where.replace("m/rad", "")
    assert case.file.title == found.title


def test_the_gallery_has_the_first_screen_of_every_report_and_nothing_else() -> None:
    expected = {f"{name}_report.png" for name in ALL}
    assert {path.name for path in GALLERY.glob("*.png")} == expected, "run cases/gallery/draw.py"
    assert sum(path.stat().st_size for path in GALLERY.glob("*.png")) < 2_000_000
    listed = (CASES / "README.md").read_text(encoding="utf-8")
    assert [name for name in expected if f"gallery/{name}" not in listed] == []


def test_a_folder_has_a_picture_of_each_mode(tmp_path: Path) -> None:
    write_figures(mode_figures(pictures("four_bar", 3)), tmp_path, ["png"])
    assert sorted(p.name for p in (tmp_path / "figures").iterdir()) == [
        "mode_1.png",
        "mode_2.png",
        "mode_3.png",
    ]
