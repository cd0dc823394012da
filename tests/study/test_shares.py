"""Who gets which part of the accuracy asked for."""

from __future__ import annotations

from pathlib import Path

import pytest
from scenes import SHIPPED

from eigassign import load_case
from eigassign.study import mesh_share, series_share, truncation_share


@pytest.mark.parametrize(
    ("elements", "more", "mesh", "truncation", "series"),
    [
        ("4", "", 0.0, 0.0, 1.0),
        ("auto", "", 0.5, 0.0, 0.5),
        ("4", ", reduce_to: 9 kHz", 0.0, 0.25, 0.75),
        ("auto", ", reduce_to: auto", 0.5, 0.25, 0.5),
    ],
)
def test_what_is_left_to_decide_shares_all_of_it(
    tmp_path: Path, elements: str, more: str, mesh: float, truncation: float, series: float
) -> None:
    path = tmp_path / "arm.yaml"
    path.write_text(SHIPPED.replace("elements: 4", f"elements: {elements}{more}"))
    file = load_case(path).file
    shares = mesh_share(file), truncation_share(file), series_share(file)
    assert shares == pytest.approx((1e-3 * mesh, 1e-3 * truncation, 1e-3 * series))
