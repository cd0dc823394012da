"""Where no frequency depends on any variable, automatic orders are still orders."""

from pathlib import Path

from eigassign.case import parse
from eigassign.modal import raise_order
from eigassign.study import BuiltCase

TEXT = Path(__file__).with_name("nothing_matters.yaml").read_text(encoding="utf-8")


def test_the_order_is_at_least_one() -> None:
    case = BuiltCase(parse(TEXT.encode(), "case.yaml"))
    model = case.model()
    x = model.x(case.trajectory.q, case.initial_design)
    chosen = raise_order(model.pencil, x, x[0], 1e-3)
    assert not model.pencil.active.any()
    assert chosen.order == 1
