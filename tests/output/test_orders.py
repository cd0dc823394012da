"""Campbell's view: frequencies of the answer over speed, with the orders that targets name."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import eigassign as ea
from eigassign.output import Curve, FigurePlan, Shade

TEMPLATE = Path(__file__).parents[2] / "eigassign" / "starters" / "planar_arm.yaml"


def figures(*targets: object) -> tuple[dict[str, FigurePlan], Any]:
    """Those of the planar arm of which this is asked, and the results."""
    case = yaml.safe_load(TEMPLATE.read_text())
    case["trajectory"]["samples"] = 11
    found = ea.assign(ea.load_case({**case, "targets": list(targets)}))
    return dict(found.plans()), found.results


def test_orders_meet_the_modes_where_their_frequencies_are_equal() -> None:
    band = {"keep_out": {"harmonic": 2, "of": "720 rpm", "margin": "4 %"}}
    plans, results = figures(band, {"mode": 1, "frequency": "900 rpm"})
    shown = plans["orders"].shows
    (panel,) = shown.panels
    assert [mark.label for mark in panel.marks if mark.label.endswith("rpm")] == [
        "720 rpm",
        "900 rpm",
    ]
    meets = {mark.hover: mark for mark in panel.curves if mark.hover}
    own = meets["order 2, mode 1"]
    hz = results.spectrum[0].optimal_hz
    ends = np.array([hz.min(), min(hz.max(), 2.0 * shown.x_limits[1] / 60.0)])
    np.testing.assert_allclose(own.y, ends)
    np.testing.assert_allclose(2.0 * own.x / 60.0, own.y)
    assert "order 1, mode 1" not in meets  # it shall be there
    assert [name for name, _ in panel.key] == ["an order meets a mode"]
    (band,) = (mark for mark in panel.marks if isinstance(mark, Shade) and mark.label)
    assert band.label == "order 2 ± 4 %"
    np.testing.assert_allclose(band.low, [0.0, 2.0 * 0.96 / 60.0 * shown.x_limits[1]])
    np.testing.assert_allclose(band.high, [0.0, 2.0 * 1.04 / 60.0 * shown.x_limits[1]])
    lines = {mark.end: mark for mark in panel.curves if mark.end}
    np.testing.assert_allclose(lines["order 2"].y, 2.0 * lines["order 2"].x / 60.0)
    assert all(isinstance(mark, Curve) and mark.x[-1] <= shown.x_limits[1] for mark in panel.curves)


def test_the_nearest_mode_is_in_view_and_nothing_warns_of_what_nothing_meets() -> None:
    band = {"keep_out": {"harmonic": 2, "of": "120 rpm", "margin": "5 %"}}
    plans, results = figures(band)
    (panel,) = plans["orders"].shows.panels
    assert panel.limits[0] == 0.0
    assert panel.limits[1] > results.spectrum[0].optimal_hz.max()
    assert "mode 1" in {mark.label for mark in panel.marks}
    assert panel.key == ()


def test_a_speed_is_written_out() -> None:
    plans, _ = figures({"mode": 1, "at_most": "11400 rpm"}, {"mode": 1, "at_least": 5})
    (panel,) = plans["orders"].shows.panels
    assert "11400 rpm" in {mark.label for mark in panel.marks}


@pytest.mark.parametrize("target", [{"mode": 1, "frequency": "15 Hz"}, {"mode": 1, "at_least": 9}])
def test_without_a_speed_there_is_no_such_figure(target: object) -> None:
    assert "orders" not in figures(target)[0]
