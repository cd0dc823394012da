"""A band is called clear only where no mode is in it anywhere along the motion."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.sparse
from scenes import SHIPPED, changed, scene_of

import eigassign
from eigassign.assignment import ForbiddenBand
from eigassign.mechanism import NamedTrajectory, Trajectories, Trajectory
from eigassign.pipeline import solve_case
from eigassign.study import RunResults, Scene, check_band, load_case


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return scene_of(tmp_path_factory.mktemp("arm"), SHIPPED)


def still(q: np.ndarray) -> Trajectories:
    """The poses q (n, n_q), a second apart."""
    return Trajectories((NamedTrajectory("1", Trajectory(np.arange(float(len(q))), q)),))


def answered(folder: Path, text: str) -> RunResults:
    path = folder / "case.yaml"
    path.write_text(text)
    return solve_case(load_case(path)).results


def band(scene: Scene, low: float, high: float) -> ForbiddenBand:
    n = len(scene.path.q)
    return ForbiddenBand("band", "", (), slice(0, n), np.full(n, low), np.full(n, high))


def test_room_is_the_least_distance_to_an_edge(arm: Scene) -> None:
    hz = arm.model.frequencies(arm.path.q, arm.initial, 2)
    found = check_band(arm.model, arm.path, band(arm, 230.0, 300.0), 1, arm.initial)
    assert found.clear
    assert found.counted
    exact = min(1.0 - hz[:, 0].max() / 230.0, hz[:, 1].min() / 300.0 - 1.0)
    assert found.room == pytest.approx(exact, rel=0.05)
    assert found.room <= exact


@pytest.mark.parametrize("turns", [(200.0, 920.0), (-350.0, 370.0), (0.0, 1440.0)])
def test_a_mode_that_passes_a_band_between_two_samples_is_seen(
    arm: Scene, turns: tuple[float, float]
) -> None:
    """Poses a turn or two apart are alike, and so are the frequencies halfway between them."""
    q = np.radians([[0.0, turn] for turn in turns])
    way = np.linspace(q[0], q[1], 2_001)
    hz = arm.model.frequencies(way, arm.initial, 1)[:, 0]
    two = arm.model.frequencies(q, arm.initial, 1)[:, 0]
    width, path = 0.02 * np.ptp(hz), still(q)
    for low in np.linspace(hz.min(), hz.max() - width, 9):
        if two.max() < low or two.min() > low + width:
            below = int(two.max() < low)
            there = ForbiddenBand("", "", (), slice(0, 2), np.full(2, low), np.full(2, low + width))
            assert not check_band(arm.model, path, there, below, arm.initial).clear
    above = ForbiddenBand("", "", (), slice(0, 2), *np.full((2, 2), 1.02 * hz.max()))
    assert check_band(arm.model, path, above, 1, arm.initial).clear


def test_a_forged_answer_is_rejected(arm: Scene) -> None:
    for low, high, below in ((150.0, 300.0, 1), (230.0, 300.0, 2), (230.0, 300.0, 0)):
        forged = band(arm, low, high), below, arm.initial
        assert not check_band(arm.model, arm.path, *forged).clear


@pytest.mark.parametrize("low", [196.0, pytest.param(203.0, marks=pytest.mark.slow)])
def test_answers_called_clear_stay_clear_at_random_instants(low: float, tmp_path: Path) -> None:
    text = changed(("  - {mode: 1, frequency: 190 Hz}", f"  - {{keep_out: [{low}, {low + 12}]}}"))
    path = tmp_path / "case.yaml"
    path.write_text(text)
    case = load_case(path)
    result = solve_case(case)
    row = result.results.assignment
    assert row.verdict == "reached"
    assert all(one.clear for one in row.clearances)
    y = np.array(list(result.design.values()))
    (part,) = case.trajectory.parts
    at = np.random.default_rng(0).uniform(0.0, part.trajectory.time_s[-1], 2000)
    hz = case.model().frequencies(part.trajectory.motion.poses(at), y, 3)
    assert not ((hz > low) & (hz < low + 12.0)).any()


COARSE = (("elements: 4", "elements: 2"), ("elements: 3", "elements: 2"))
REDUCED = (
    ("elements: 4", "elements: 12, reduce_to: 500 Hz"),
    ("elements: 3", "elements: 12, reduce_to: 500 Hz"),
)


@pytest.mark.parametrize(
    ("changes", "low", "high", "below"), [(COARSE, 745.0, 790.0, 2), (REDUCED, 540.0, 565.0, 1)]
)
def test_a_mode_that_mesh_or_reduced_links_raise_beyond_a_band_is_not_clear_of_it(
    changes: tuple[tuple[str, str], ...],
    low: float,
    high: float,
    below: int,
    tmp_path: Path,
) -> None:
    fine = (("elements: 4", "elements: 12"), ("elements: 3", "elements: 12"))
    scene, true = scene_of(tmp_path, changed(*changes)), scene_of(tmp_path, changed(*fine))
    pose = np.array([[1.817, 5.312]])
    assert scene.model.frequencies(pose, scene.initial, 3)[0, below] > high
    assert true.model.frequencies(pose, scene.initial, 3)[0, below] < low
    there = ForbiddenBand("band", "", (), slice(0, 1), np.array([low]), np.array([high]))
    found = check_band(scene.model, still(pose), there, below, scene.initial)
    assert found.counted
    assert not found.clear
    assert found.raised > high / low - 1.0
    assert check_band(true.model, still(pose), there, below + 1, scene.initial).clear


def test_links_left_to_auto_are_modelled_up_to_the_bands(tmp_path: Path) -> None:
    """Of elements and reduction, by the mode above the band and not by the targets alone."""
    for name, key in (("elements", "elements: auto"), ("reduced", "elements: 16, reduce_to: auto")):
        links = (("elements: 4", key), ("elements: 3", key))
        path = tmp_path / f"{name}.yaml"
        targets = ("- {mode: 1, frequency: 190 Hz}", "- {keep_out: [900 Hz, 950 Hz]}")
        path.write_text(changed(*links, targets))
        case = load_case(path)
        model, q = case.model(), case.trajectory.q[::50]
        error = model.discretisation_error(q, case.initial_design, (4,)).max()
        error += model.truncation_error(q, case.initial_design, (4,)).max()
        assert error < 5e-4
        assert model.n_dof < 100  # numbers of elements double


def test_a_band_above_all_modes_of_the_model_is_not_clear(tmp_path: Path) -> None:
    one = (("elements: 4", "elements: 1"), ("elements: 3", "elements: 1"))
    targets = ("mode: 1, frequency: 190 Hz", "keep_out: [20 kHz, 21 kHz]")
    row = answered(tmp_path, changed(*one, targets)).assignment
    assert row.verdict == "do_not_use"
    assert "raise reduce_to" in row.reason
    assert [one.raised for one in row.clearances] == [None]


@pytest.mark.parametrize("target", ["{mode: 24, at_least: 3 Hz}", "{keep_out: [100 kHz, 101 kHz]}"])
def test_modes_that_have_no_mass_are_not_asked_for(target: str, tmp_path: Path) -> None:
    """A part with masses and no inertias: 25 of 32 modes have mass."""
    starters = Path(eigassign.__file__).parent / "starters"
    shutil.copytree(starters / "imported_part", tmp_path / "imported_part")
    points = scipy.sparse.diags_array(np.tile([0.13, 0.13, 0.0], 7))
    scipy.io.mmwrite(tmp_path / "imported_part" / "mass.mtx", points)
    text = (starters / "imported_part.yaml").read_text()
    row = answered(tmp_path, text.replace("{mode: 1, frequency: 15 Hz}", target)).assignment
    assert row.verdict == ("do_not_use" if "keep_out" in target else "reached")
    assert ("more elements" in row.reason) == ("keep_out" in target)
    assert [one.below for one in row.clearances] == ([25] if "keep_out" in target else [])


@pytest.mark.parametrize(
    "links", [COARSE, tuple((old, new.replace("500 Hz", "300 Hz")) for old, new in REDUCED)]
)
def test_a_target_that_only_a_coarse_model_meets_is_not_called_reached(
    links: tuple[tuple[str, str], ...], tmp_path: Path
) -> None:
    """Mode 3 of the coarse mesh is 11 % too high, mode 1 of the links without modes 18 %."""
    target = "{mode: 3, at_least: 745 Hz}" if links == COARSE else "{mode: 1, at_least: 210 Hz}"
    targets = (("{mode: 1, frequency: 190 Hz}", target), ("modes: [1]", "modes: auto"))
    whole = changed(*links, *targets)
    row = answered(tmp_path, whole).assignment
    assert row.verdict == "do_not_use"
    assert "more elements" in row.reason
    assert row.model_error > 0.1
    eased = whole.replace("745 Hz", "600 Hz").replace("210 Hz", "180 Hz")
    for text in (whole + "assignment: {max_error: 25 %}\n", eased):
        assert answered(tmp_path, text).assignment.verdict == "reached"


FEW = (("samples: 152", "samples: 12"), ("modes: [1]", "modes: auto"))
ALIKE_3 = "{mode: {like: 3, at: {time: 0.5 s}}, at_least: 745 Hz}"
APART = "{gap: {between: [2, 3], at_least: 219 Hz}}"


@pytest.mark.parametrize(
    ("links", "target", "missed"),
    [
        (COARSE, ALIKE_3, "mode 3"),  # 11 % too high, whatever its number
        ((("elements: 4", "elements: 3"),), APART, "missed by"),  # 1.1 % of mode 3: 8 Hz of 219
    ],
)
def test_a_mesh_counts_in_followed_modes_and_in_the_distance_of_two(
    links: tuple[tuple[str, str], ...], target: str, missed: str, tmp_path: Path
) -> None:
    text = changed(*links, *FEW, ("{mode: 1, frequency: 190 Hz}", target))
    row = answered(tmp_path, text).assignment
    assert row.verdict == "do_not_use"
    assert "more elements" in row.reason
    assert missed in row.reason


def test_what_a_mesh_leaves_open_adds_to_the_distance_of_a_wanted_frequency(tmp_path: Path) -> None:
    words = []
    for accepted in ("2 %", "1.6 %"):
        text = f"{changed(*COARSE, *FEW)}assignment: {{max_error: {accepted}}}\n"
        results = answered(tmp_path, text)
        assert 0.014 < results.targets[0].error.exact.max_relative < 0.016
        assert results.assignment.model_error > 0.003
        words.append(results.assignment.verdict)
    assert words == ["reached", "do_not_use"]


def test_a_coordinate_that_only_trembles_asks_for_no_more_points(arm: Scene) -> None:
    """Round-off of a coordinate at rest is no motion between the samples."""
    solved = []

    class Counting:
        def __getattr__(self, name: str) -> object:
            return getattr(arm.model, name)

        def frequencies(self, q: np.ndarray, y: np.ndarray, count: int = 3) -> np.ndarray:
            solved.append(len(q))
            return arm.model.frequencies(q, y, count)

    q = np.column_stack([np.linspace(1.7, 1.9, 21), 5.3 + 1e-12 * (-1.0) ** np.arange(21)])
    there = ForbiddenBand("", "", (), slice(0, 21), np.full(21, 230.0), np.full(21, 300.0))
    check_band(Counting(), still(q), there, 1, arm.initial)  # type: ignore[arg-type]
    assert max(solved) <= 21
