"""Whether wanted frequencies that change in time are given for the whole motion."""

from __future__ import annotations

from collections.abc import Iterator

from eigassign.case.quantity import Quantity
from eigassign.case.trajectory_parts import DURATION, TIME, TipTrajectory
from eigassign.case.tree import Tree, at, entries, text, trajectories, trajectory_names
from eigassign.case.units import QuantityError
from eigassign.case.yaml_reader import Finding

_SLACK = 1e-9  # of the duration: rounding of the ends, far below a sampling step


def uncovered(tree: Tree) -> Iterator[Finding]:
    """Targets whose profile does not reach both ends of the trajectory."""
    for k, target in enumerate(entries(tree, "targets")):
        span = _span(at(target, "frequency"))
        for which, motion in _motions(tree, text(target, "trajectory")):
            if span is None:
                continue
            slack = _SLACK * (motion[1] - motion[0])
            if span[0] > motion[0] + slack or span[1] < motion[1] - slack:
                yield (
                    ("targets", k, "frequency", "time"),
                    f"covers {span[0]:g} … {span[1]:g} s only; "
                    f"{which} lasts from {motion[0]:g} to {motion[1]:g} s",
                )


def _motions(tree: Tree, wanted: str | None) -> Iterator[tuple[str, tuple[float, float]]]:
    """What to call each trajectory that a target holds along, and its first and last time."""
    several = len(trajectories(tree)) > 1
    for name, (_, body) in zip(trajectory_names(tree), trajectories(tree), strict=True):
        span = _span_of_motion(body)
        if span is not None and wanted in (None, name):
            yield f"trajectory {name!r}" if several else "the trajectory", span


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
