"""Whether wanted frequencies that change in time are given for the whole motion."""

from __future__ import annotations

from collections.abc import Iterator

from eigassign.case.quantity import Quantity
from eigassign.case.trajectory_parts import DURATION, TIME, TipTrajectory
from eigassign.case.tree import Tree, at, entries
from eigassign.case.units import QuantityError
from eigassign.case.yaml_reader import Finding

_SLACK = 1e-9  # of the duration: rounding of the ends, far below a sampling step


def uncovered(tree: Tree) -> Iterator[Finding]:
    """Targets whose profile does not reach both ends of the trajectory."""
    motion = _span_of_motion(at(tree, "trajectory"))
    for k, target in enumerate(entries(tree, "targets")):
        span = _span(at(target, "frequency"))
        if motion is None or span is None:
            continue
        slack = _SLACK * (motion[1] - motion[0])
        if span[0] > motion[0] + slack or span[1] < motion[1] - slack:
            yield (
                ("targets", k, "frequency", "time"),
                f"covers {span[0]:g} … {span[1]:g} s only; "
                f"the trajectory lasts from {motion[0]:g} to {motion[1]:g} s",
            )


def _span_of_motion(trajectory: object) -> tuple[float, float] | None:
    for key in ("time", "times"):
        if at(trajectory, key) is not None:
            return _span(trajectory, key)
    default = TipTrajectory.model_fields["duration"].default
    tip = at(trajectory, "tip") is not None
    duration = _number(at(trajectory, "duration") or (default if tip else None), DURATION)
    return None if duration is None else (0.0, duration)


def _span(node: object, key: str = "time") -> tuple[float, float] | None:
    times = entries(node, key)
    if not times:
        return None
    first, last = _number(times[0], TIME), _number(times[-1], TIME)
    return None if first is None or last is None or last < first else (first, last)


def _number(value: object, quantity: Quantity) -> float | None:
    try:
        return quantity.read(value)
    except QuantityError:
        return None
