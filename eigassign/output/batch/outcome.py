"""How one case of a batch ended: a row of plain values."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from typing import Annotated, Any, Literal, get_args

from eigassign.facts import Fact, Seconds, Share
from eigassign.files import name_of
from eigassign.study.design.verdict import verdict_word
from eigassign.study.results import RunResults

Status = Literal["ok", "tolerance", "failed", "error"]
Range = tuple[str, float, float, float]  # of what, lowest, mean, highest


@dataclass(frozen=True)
class CaseOutcome:
    """How one case of a batch ended.

    ``status``: ok; tolerance (it ran, and misses the tolerance asked for); failed (it ran, and
    there is no answer: infeasible, unreachable); error (wrong input, no disk, a bug).
    Errors are fractions of the target; None where there is no number. ``values`` are what a sweep
    sets, by key; ``frequencies`` the lowest, mean and highest exact frequency in Hz that each
    target has along the trajectory at the answer; ``units`` those in SI of swept values and of the
    design, by name.
    """

    name: Annotated[str, Fact("of the case, and of its variant", "case")]
    path: Annotated[str, Fact("of the case file")]
    status: Status
    seconds: Annotated[Seconds, Fact(heading="time")]
    message: str = ""
    run_folder: Annotated[str | None, Fact("as seen from the folder of the batch")] = None
    initial_max_relative: Annotated[Share | None, Fact("largest error", "worst before")] = None
    predicted_max_relative: Annotated[Share | None, Fact(heading="worst predicted")] = None
    exact_max_relative: Annotated[Share | None, Fact("largest error", "worst error")] = None
    exact_rms_relative: Annotated[Share | None, Fact("over time", "rms error")] = None
    initial_violation: Annotated[Share | None, Fact("of any limit", "violated before")] = None
    exact_violation: Annotated[Share | None, Fact("the largest of any limit", "violated by")] = None
    mass: Annotated[float | None, Fact("of all links and bodies", "total mass", "kg")] = None
    price: Annotated[float | None, Fact("of the choices and of the change")] = None
    design: Annotated[Sequence[tuple[str, float]], Fact("the optimum, SI")] = ()
    frequencies: Annotated[Sequence[Range], Fact("exact, of each target", unit="Hz")] = ()
    verdict: str = ""
    values: Mapping[str, Any] = field(default_factory=dict)
    units: Annotated[Mapping[str, str], Fact("SI, of values and design")] = field(
        default_factory=dict
    )
    index: Annotated[int, Fact("place in the batch")] = 0
    key: Annotated[str, Fact("of what was computed")] = ""

    @property
    def word(self) -> Annotated[str, Fact(heading="verdict")]:
        """How it ended as people say it: the verdict, or of a case without one its status."""
        return verdict_word(self.verdict) or _WITHOUT.get(self.status, self.status)


_WITHOUT = {"ok": "Done", "tolerance": "Over tolerance", "failed": "No answer", "error": "Failed"}
_STATUSES = get_args(Status)
NUMBERS = (  # that every case has, or lacks
    "initial_max_relative", "predicted_max_relative", "exact_max_relative", "exact_rms_relative",
    "initial_violation", "exact_violation", "mass", "price",
)  # fmt: skip
_ORDER = (
    "index", "name", "key", "values", "status", "verdict", "message", "initial_max_relative",
    "predicted_max_relative", "exact_max_relative", "exact_rms_relative", "initial_violation",
    "exact_violation", "mass", "price", "design", "units", "frequencies", "seconds", "path",
    "run_folder",
)  # fmt: skip


def to_plain(outcome: CaseOutcome) -> dict[str, Any]:
    """The outcome as JSON has it, ``index`` first; a number that is not finite is None."""
    plain = {name: getattr(outcome, name) for name in _ORDER}
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in plain.items()
    }


def from_plain(row: Any) -> CaseOutcome:
    """The outcome that `to_plain` wrote, with lists for tuples.

    Raises ValueError or TypeError for anything else.
    """
    found = CaseOutcome(**row)
    if {type(found.values), type(found.units)} != {dict}:
        raise ValueError("no outcome of a case")
    places = [found.path, "" if found.run_folder is None else found.run_folder]
    texts = [found.name, found.message, found.verdict, found.key, *map(name_of, places)]
    texts += [*found.units, *found.units.values()]
    given = (getattr(found, name) for name in NUMBERS)
    numbers = [found.seconds, *(number for number in given if number is not None)]
    for name, number in found.design:
        texts.append(name)
        numbers.append(number)
    for name, lowest, mean, highest in found.frequencies:
        texts.append(name)
        numbers += (lowest, mean, highest)
    right = found.status in _STATUSES and type(found.index) is int
    if not right or {*map(type, texts)} != {str} or not {*map(type, numbers)} <= {int, float}:
        raise ValueError("no outcome of a case")
    return found


def frequency_ranges(results: RunResults) -> tuple[Range, ...]:
    """The ``frequencies`` of a run, each under a name of its own.

    What is wanted is not in the names: it may be swept.
    """
    return ranges(
        (t.asked.form.curve_of(t.asked.curve_name), t.asked.trajectory, t.exact_hz.tolist())
        for t in results.targets
    )


def ranges(curves: Iterable[tuple[str, str | None, Sequence[float]]]) -> tuple[Range, ...]:
    """Lowest, mean and highest of each: name, trajectory or None, values in Hz."""
    found: dict[str, Range] = {}
    for name, trajectory, hz in curves:
        name += "" if trajectory is None else f" along {trajectory!r}"
        names = (f"{name} ({k})" if k > 1 else name for k in count(1))
        free = next(each for each in names if each not in found)
        found[free] = (free, min(hz), math.fsum(hz) / len(hz), max(hz))
    return tuple(found.values())
