"""Campbell's view: frequencies of the answer over speed, with the orders that targets name."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import eigassign as ea
from eigassign.output import Curve, FigurePlan

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
    for order, times in (("order 1", 1.0), ("order 2", 2.0)):
        own = meets[f"{order}, mode 1"]
        hz = results.spectrum[0].optimal_hz
        ends = np.array([hz.min(), min(hz.max(), times * shown.x_limits[1] / 60.0)])
        np.testing.assert_allclose(own.y, ends)
        np.testing.assert_allclose(times * own.x / 60.0, own.y)
    lines = {mark.end: mark for mark in panel.curves if mark.end}
    np.testing.assert_allclose(lines["order 2"].y, 2.0 * lines["order 2"].x / 60.0)
    assert all(isinstance(mark, Curve) and mark.x[-1] <= shown.x_limits[1] for mark in panel.curves)


@pytest.mark.parametrize("target", [{"mode": 1, "frequency": "15 Hz"}, {"mode": 1, "at_least": 9}])
def test_without_a_speed_there_is_no_such_figure(target: object) -> None:
    assert "orders" not in figures(target)[0]
