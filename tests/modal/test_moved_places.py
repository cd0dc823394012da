"""Frequencies of mechanisms whose places and angles are design parameters, and their slopes."""

import re
from collections.abc import Callable

import numpy as np
import pytest
from chains import case_of
from moved_places import along_a_tip, drawn
from redesigned_arms import CASES, extrapolated
from yaml import safe_load

from eigassign import Case, load_case
from eigassign.errors import EigassignError, UsageError

COUNT = 3
Floats = np.ndarray
APART = 1e-2  # relative, of λ: nearer modes are not told apart by the differences


def check_slopes(case: Case, lam_at: Callable[[Floats], Floats], q: Floats, by_q: Floats) -> None:
    """dλ/dy along coordinates q (n, n_q) that change by ``by_q`` with the design."""
    model, y = case.model(), case.initial_design
    lam, slopes = model.slopes(q, y, COUNT)
    n_q = q.shape[1]
    total = slopes[:, :, n_q:] + slopes[:, :, :n_q] @ by_q
    beside = extrapolated(lam_at, y, 2e-3)
    gaps = np.abs(lam[:, :, None] / lam[:, None, :] - 1.0) + np.eye(lam.shape[1])
    simple = gaps.min(axis=2) > APART
    size = np.abs(lam).max(axis=1)[:, None, None]
    off = np.abs(total - beside) / np.maximum(np.abs(beside), size)
    assert off[simple].max(initial=0.0) < 1e-7


def check_random(seed: int) -> bool:
    found = drawn(seed)
    if found is None:
        return False
    case, q = found
    y = case.initial_design
    other = y + np.random.default_rng(seed).uniform(-0.02, 0.02, len(y))
    tree = safe_load(case.file.with_design(other).resolved())
    del tree["design"]
    try:
        hz = case.model().frequencies(q, other, COUNT)
        written = case_of(tree).model().frequencies(q, [], COUNT)
    except EigassignError as error:
        if not re.search("falls|cannot be closed|passive", str(error)):
            raise
        return False
    np.testing.assert_allclose(hz, written, rtol=1e-7)

    def lam_at(v: Floats) -> Floats:
        return (2.0 * np.pi * case.model().frequencies(q, v, COUNT)) ** 2

    check_slopes(case, lam_at, q[None], np.zeros((1, len(q), len(y))))
    return True


def check_tip(name: str, seed: int) -> bool:
    case = along_a_tip(name, seed)
    if case is None:
        return False
    path, y = case.trajectory, case.initial_design
    q, by_q = path.at(y)

    def lam_at(v: Floats) -> Floats:
        return (2.0 * np.pi * case.model().frequencies(path.at(v)[0], v, COUNT)) ** 2

    check_slopes(case, lam_at, q, by_q)
    return True


@pytest.mark.parametrize("seed", [0, 1, 2, 7])
def test_slopes_of_moved_places_are_those_of_differences(seed: int) -> None:
    assert check_random(seed)


@pytest.mark.parametrize(("name", "seed"), [("five_bar", 0), ("arm_6r", 1)])
def test_slopes_along_a_path_that_moved_places_keep(name: str, seed: int) -> None:
    assert check_tip(name, seed)


def written(case: Case, y: Floats, added: float) -> Case:
    """The lifting arm with a design, and with what a trajectory adds, as plain numbers."""
    tree = safe_load(case.file.with_design(y).resolved())
    del tree["design"], tree["targets"]
    tree["trajectory"] = {key: tree["trajectory"][0][key] for key in ("points", "duration")}
    tree["mechanism"]["bodies"]["gripper"]["mass"] += added
    tree.pop("expansion")
    return case_of(tree)


def test_an_arm_with_a_knob_and_an_added_mass_is_the_one_that_is_written_so() -> None:
    case = load_case(CASES / "lift_arm.yaml")
    model = case.model()
    assert list(case.file.loads) == ["bodies.gripper.mass.add"]
    for y, added in (([0.55, 0.04, 1.5, -0.3], 0.0), ([0.535, 0.033, 2.2, -0.1], 2.0)):
        other = written(case, np.array(y), added)
        for lift in (1.1, 1.5):
            hz = model.frequencies([lift, added], y, COUNT)
            np.testing.assert_allclose(hz, other.model().frequencies([lift], [], COUNT), rtol=1e-9)
        assert model.mass(y) == pytest.approx(other.model().mass([]) - added)
        assert other.file.mechanism.sections["rod"].height == pytest.approx(0.5 * y[1])
    q, y = np.array([[1.3, 1.7]]), np.array([0.56, 0.035, 1.9, -0.2])

    def lam_at(v: Floats) -> Floats:
        return (2.0 * np.pi * model.frequencies(q, v, COUNT)) ** 2

    slopes = model.slopes(q, y, COUNT)[1][:, :, 2:]
    np.testing.assert_allclose(
        slopes, extrapolated(lam_at, y, 1e-3), rtol=1e-7, atol=1e-9 * np.abs(slopes).max()
    )
    with pytest.raises(UsageError, match="no mechanism has"):
        model.frequencies([1.3, -2.0], y, 1)
