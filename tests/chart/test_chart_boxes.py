"""How far a method goes: slopes of the theory, and figures that are known of the paper's arm."""

from pathlib import Path

import numpy as np
import pytest
from charts import CANTILEVER, charted, rows_of

from eigassign import load_case
from eigassign.chart import Chart


@pytest.fixture
def arm() -> Chart:
    return charted("two_link")


def errors_of(chart: Chart, method: str, varied: str) -> tuple[np.ndarray, np.ndarray]:
    rows = [r for r in chart.boxes if (r.method, r.varied) == (method, varied)]
    return np.array([(r.half_width, r.worst_relative) for r in rows]).T


@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize("varied", ["y", "q and y"])
def test_the_error_of_a_series_falls_with_the_power_after_its_order(
    arm: Chart, order: int, varied: str
) -> None:
    for method, power in (("Taylor", order + 1), ("Taylor, linearised in y", 2)):
        h, error = errors_of(arm, f"{method}, order {order}", varied)
        used = (h <= 0.2) & (error > 30.0 * arm.asked.floor)
        assert used.sum() >= 3
        slope = np.polyfit(np.log(h[used]), np.log(error[used]), 1)[0]
        assert slope == pytest.approx(power, abs=0.15), method


def test_the_papers_arm_has_the_known_errors(arm: Chart) -> None:
    full, linear = (rows_of(arm, name) for name in ("Taylor", "Taylor, linearised in y"))
    # 1.354 % and 0.0525 % over the box of y at q0, whose worst are corners: test points have them
    for order in (2, 4, 8):
        off = errors_of(arm, f"Taylor, linearised in y, order {order}", "y")[1][-1]
        assert off == pytest.approx(0.01354, rel=1e-3)
    assert errors_of(arm, "Taylor, order 4", "y")[1][-1] == pytest.approx(0.000525, rel=1e-3)
    # 0.0901 % and 1.604 % at the 152 samples, whose worst are at the corner y = 0
    assert full["4"].worst_relative == pytest.approx(0.000901, rel=0.01)
    flat = [linear[str(p)].worst_relative for p in range(4, 9)]
    assert flat == pytest.approx([0.01604] * 5, rel=0.01)
    assert all(full[str(p + 1)].worst_relative < 0.5 * full[str(p)].worst_relative
               for p in range(1, 8))  # fmt: skip


def test_a_method_reaches_to_where_its_curve_meets_the_accuracy(arm: Chart) -> None:
    assert len(arm.reach) == len({(r.method, r.varied) for r in arm.boxes})
    for one in arm.reach:
        h, error = errors_of(arm, one.method, one.varied)
        assert one.error_at_all == error[-1]
        crossed = np.exp(np.interp(np.log(1e-2), np.log(error), np.log(h)))
        assert one.half_width == pytest.approx(1.0 if error.max() <= 1e-2 else crossed)


def test_meshes_converge_with_the_fourth_power_to_the_beam_of_the_book(tmp_path: Path) -> None:
    """A cantilever has 1.875104²/(2π) √(EI/(ρA L⁴)); what is charted is the error to it."""
    path = tmp_path / "cantilever.yaml"
    path.write_text(CANTILEVER)
    meshes = rows_of(charted(path), "mesh")
    hz = 1.8751040687**2 / (2.0 * np.pi) * np.sqrt(70e9 * 0.005**2 / (2700 * 0.5**4))
    for n in ("1", "2", "4"):
        path.write_text(CANTILEVER.replace("elements: 1", meshes[n].use))
        case = load_case(path)
        off = case.model().frequencies([], case.initial_design, 1).item() / hz - 1.0
        assert meshes[n].worst_relative == pytest.approx(off, rel=2e-3)  # the limit has an h⁶ left
    error = {n: p.worst_relative for n, p in rows_of(charted("two_link"), "mesh").items()}
    assert np.log2(error["2"] / error["4"]) == pytest.approx(4.0, abs=0.35)
