"""Error against mass or price: what is promised can be had, and no random design does better."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scenes import changed, scene_of

from eigassign.assignment import requirements_of
from eigassign.study import Found, Scene, TradeOff, TradeOffPoint, find_answer, kept, trade_off

FEW = ("samples: 152", "samples: 12")
PRICED = "{parameter: bodies.elbow_mass.mass, price: 2, "
WORST = ("validation:", "assignment: {objective: worst_case}\nvalidation:")


def curve_of(folder: Path, *changes: tuple[str, str]) -> tuple[Scene, Found, TradeOff | None]:
    scene = scene_of(folder, changed(FEW, *changes))
    answer = find_answer(scene, requirements_of(scene.file, scene.path), lambda line: None)
    assert answer.found is not None
    return scene, answer.found, trade_off(scene, answer.found)


@pytest.mark.parametrize(
    ("changes", "quantity"),
    [
        ((), "mass"),
        ((WORST,), "mass"),
        ((("{parameter: bodies.elbow_mass.mass, ", PRICED),), "price"),
    ],
)
def test_no_design_of_that_mass_or_price_is_better(
    changes: tuple[tuple[str, str], ...], quantity: str, tmp_path: Path
) -> None:
    scene, found, curve = curve_of(tmp_path, *changes)
    assert curve is not None
    assert curve.quantity == quantity
    price = np.array([2.0, 0.0])

    def amount(y: np.ndarray) -> float:
        return scene.model.mass(y) if quantity == "mass" else float(price @ (y - scene.initial))

    weights = np.convolve(np.diff(scene.path.time_s), [0.5, 0.5])

    def error(y: np.ndarray) -> float:
        off = scene.exact(y)[:, 0] / 190.0 - 1.0
        if curve.error == "worst error":
            return float(np.abs(off).max())
        return float(np.sqrt(weights @ off**2 / weights.sum()))

    assert curve.initial == amount(scene.initial)
    assert len(curve.points) >= 6
    assert curve.points[-1].design.tolist() == found.best.y.tolist()
    for less, more in pairwise(curve.points):
        assert less.amount < more.amount
        assert less.error > more.error
    designs = scene.bounds[0] + np.random.default_rng(0).random((60, 2)) * np.ptp(
        scene.bounds, axis=0
    )
    tried = [(amount(y), error(y)) for y in designs]
    for point in curve.points:
        assert point.amount == pytest.approx(amount(point.design), abs=1e-12)
        assert point.error == pytest.approx(error(point.design), rel=1e-9)
        assert all(e >= point.error * (1.0 - 1e-6) for a, e in tried if a <= point.amount)


def test_an_answer_that_is_the_lightest_design_has_nothing_to_trade(tmp_path: Path) -> None:
    # more than the arm has without any mass: nothing is added
    assert curve_of(tmp_path, ("frequency: 190 Hz", "frequency: 260 Hz"))[2] is None


def test_an_answer_that_removes_mass_is_followed_to_the_lightest_design(tmp_path: Path) -> None:
    at = "elbow_mass: {at: upper_arm.end, mass: "
    scene, _, curve = curve_of(tmp_path, (f"{at}0}}", f"{at}250 g}}"))
    assert curve is not None
    assert curve.points[-1].amount < curve.initial
    assert curve.points[0].amount == pytest.approx(scene.model.mass(scene.bounds[0]), rel=1e-9)


def test_limits_alone_have_no_error_to_trade(tmp_path: Path) -> None:
    assert curve_of(tmp_path, ("frequency: 190 Hz", "at_most: 195 Hz"))[2] is None


def test_gains_that_no_digit_shows_are_left_out_but_for_the_answer() -> None:
    errors = (0.08, 0.05, 0.04999, 0.03, 0.029999)
    points = [TradeOffPoint(float(k), error, np.zeros(1)) for k, error in enumerate(errors)]
    assert [point.amount for point in kept(points)] == [0.0, 1.0, 3.0, 4.0]
