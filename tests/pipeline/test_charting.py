"""What a chart says at its end, before any of it is written."""

import sys
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "chart"))

from chart_scenes import TINY
from test_without_expansion import fine

from eigassign import load_case
from eigassign.pipeline import Options, chart_case

FEW = replace(TINY, half_orders=(), expansion_points=(1,), factors=(1.0,))


def test_a_case_whose_auto_refuses_is_charted_all_the_same(tmp_path: Path) -> None:
    (tmp_path / "crank.yaml").write_text(fine())
    made = chart_case(load_case(tmp_path / "crank.yaml"), Options(), FEW, (1e-6,))
    assert "Taylor 4 full" in {p.method for p in made.points}
    assert made.seconds > 0.0
