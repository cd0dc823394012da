"""What a chart says at its end, before any of it is written."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "chart"))

from chart_scenes import TINY

from eigassign import load_case
from eigassign.chart import Request
from eigassign.pipeline import Options, chart_case

SHIPPED = (Path(__file__).parents[2] / "cases" / "two_link.yaml").read_text()
FEW = replace(TINY, half_orders=(), expansion_points=(1,), factors=(1.0,), objectives=3)


def test_a_case_whose_auto_refuses_is_charted_all_the_same(tmp_path: Path) -> None:
    start, end = SHIPPED.index("expansion:"), SHIPPED.index("targets:")
    line = "expansion: {order: auto, accuracy: 1e-13}\n"
    (tmp_path / "arm.yaml").write_text(f"{SHIPPED[:start]}{line}{SHIPPED[end:]}")
    request = Request((3e-11,))
    made = chart_case(load_case(tmp_path / "arm.yaml"), Options(), FEW, request)
    assert made.advice[0].auto is not None
    assert made.advice[0].auto.refused.startswith("no reduced model of up to 200 vectors")
    assert "Taylor 4 full" in {p.method for p in made.points}
    assert len(made.designs) == 6
    assert made.seconds > 0.0
