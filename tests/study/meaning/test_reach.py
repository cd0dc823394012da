"""What can be reached within the bounds, and what deviations do: against brute force."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from scenes import changed, scene_of

from eigassign import load_case
from eigassign.pipeline import Options, solve_case
from eigassign.study import Scene, proved_ranges, solve_design, unreachable

SHORT = ("samples: 152", "samples: 8")


def grid(lower: np.ndarray, upper: np.ndarray, n: int = 4) -> list[np.ndarray]:
    axes = [np.linspace(a, b, n) for a, b in zip(lower, upper, strict=True)]
    return [np.array(y) for y in itertools.product(*axes)]


def said(scene: Scene, y: np.ndarray) -> list[str]:
    return list(
        unreachable(scene, scene.wanted, y, solve_design(scene, (), y), 0.02, proved_ranges(scene))
    )


def test_two_corners_bound_every_design_of_added_masses(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, changed(SHORT))
    ranges = proved_ranges(scene)
    all_hz = np.array([scene.exact(y) for y in grid(*scene.bounds)])
    np.testing.assert_allclose(ranges[0].hz, all_hz.min(axis=0), rtol=1e-10)
    np.testing.assert_allclose(ranges[1].hz, all_hz.max(axis=0), rtol=1e-10)


SECTION = ("bodies.tool_mass.mass, min: 0, max: 250 g", "sections.rod.area, min: 7e-4, max: 7.1e-4")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ((), "within the bounds, proved)"),
        ((SECTION,), "(found by a search from 3 starts within the limits)"),
    ],
)
def test_a_target_that_no_design_reaches_is_named_with_what_can_be(
    tmp_path: Path, changes: tuple[tuple[str, str], ...], words: str
) -> None:
    text = changed(SHORT, ("190 Hz}", "400 Hz}"), *changes)
    scene = scene_of(tmp_path, text)
    (line,) = said(scene, scene.bounds[0])
    assert line.startswith("mode 1 at 400 Hz is out of reach at ")
    assert words in line


@pytest.mark.parametrize("changes", [(), (SECTION,)])
def test_a_target_that_is_missed_for_want_of_one_design_is_not_out_of_reach(
    tmp_path: Path, changes: tuple[tuple[str, str], ...]
) -> None:
    scene = scene_of(tmp_path, changed(SHORT, *changes))
    assert said(scene, scene.bounds[1]) == []


M1, M2 = "max: 250 g}\n  m2", "max: 250 g}\n\nexp"
TOLERANT = (
    (M1, "max: 250 g, tolerance: 20 g}\n  m2"),
    (M2, "max: 250 g, tolerance: 10 %}\n\nexp"),
)


def test_what_tolerances_move_is_told_to_first_order(tmp_path: Path) -> None:
    path = tmp_path / "case.yaml"
    path.write_text(changed(SHORT, *TOLERANT))
    case = load_case(path)
    found = solve_case(case, Options(use_cache=False))
    y = np.array([*found.design.values()])
    hz = case.model().frequencies(case.trajectory.q, y, 1)
    step = np.array([0.02, 0.1 * y[1]])
    moved = np.abs(hz - case.model().frequencies(case.trajectory.q, y + step, 1)).max()
    (said,) = (n for n in found.results.notes if "within the tolerances it moves" in n)
    assert float(said.split()[-3]) == pytest.approx(moved, rel=0.05)
