"""What ``expansion.order: auto`` takes for each accuracy, charted beside everything else."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import ceil, floor, log10

import numpy as np
from numpy.typing import NDArray

from eigassign.case import CaseFile
from eigassign.errors import AccuracyError
from eigassign.modal.clusters import CLUSTER_GAP
from eigassign.study.chart_data import Advice, AutoTakes, ChartPoint
from eigassign.study.chart_follow import CLUSTERED, SEVERAL, charted_expansions, fitting, within
from eigassign.study.chart_front import time_words
from eigassign.study.chart_methods import Method, nearest_expansion
from eigassign.study.chart_timing import timed
from eigassign.study.choices import OrderChoice, asked_accuracy, choose_order, series_share
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Taken:
    """The choice for one accuracy, or in words why there is none, and the seconds it took."""

    accuracy: float
    choice: OrderChoice | None
    refused: str
    seconds: float

    @property
    def method(self) -> str | None:
        """The charted method that it is."""
        if self.choice is None:
            return None
        order, n = self.choice.order, 1 + len(self.choice.more_q)
        if n > 1:
            return f"Taylor {order} at {n} points by auto {self.accuracy:.0e}"
        wider = self.choice.cluster_gap != CLUSTER_GAP
        return f"Taylor {order}, modes in a wider cluster" if wider else f"Taylor {order} full"

    @property
    def is_plain(self) -> bool:
        """Whether it is one of the charted orders about the case's own point."""
        return self.choice is not None and self.method == f"Taylor {self.choice.order} full"


def taken_by_auto(
    scene: Scene, accuracies: Sequence[float], most_s: float
) -> tuple[tuple[Taken, ...], tuple[str, ...]]:
    """The choices by the very function that a run asks, the loosest accuracy first; notes.

    None is made any more after one that took over ``most_s`` seconds.
    """
    made: list[Taken] = []
    for accuracy in sorted(accuracies, reverse=True):
        if made and made[-1].seconds > most_s:
            note = (
                f"what auto takes is not charted from {accuracy:.0e} on: its choice for "
                f"{made[-1].accuracy:.0e} took {time_words(made[-1].seconds)}"
            )
            return tuple(made), (note,)
        (choice, refused), spent = timed(partial(_choice, scene, accuracy))
        made.append(Taken(accuracy, choice, refused, spent))
    return tuple(made), ()


def _choice(scene: Scene, accuracy: float) -> tuple[OrderChoice | None, str]:
    full = scene.expansions.full
    file = with_expansion(scene.file, accuracy=accuracy, chart=None)
    try:
        made = choose_order(
            file, scene.model, scene.trajectory, full.q0, full.y0, scene.expansions.modes
        )
    except AccuracyError as error:
        return None, str(error)
    return made, ""


def with_expansion(file: CaseFile, **changes: object) -> CaseFile:
    """The case with other keys below ``expansion``."""
    return replace(file, expansion=file.expansion.model_copy(update=changes))


def auto_methods(scene: Scene, taken: Sequence[Taken]) -> Iterator[Method]:
    """Choices that are no plain order about the case's own point, each once."""
    special = [t for t in taken if t.choice is not None and not t.is_plain]
    for each in {t.method: t for t in special}.values():
        choice, y0 = each.choice, scene.expansions.full.y0
        assert choice is not None
        q = np.vstack([choice.q0, *choice.more_q])
        yield Method(
            str(each.method),
            SEVERAL if len(q) > 1 else CLUSTERED,
            True,
            {
                "order": choice.order,
                "q0": q,
                "y0": np.tile(y0, (len(q), 1)),
                "cluster_gap": choice.cluster_gap,
            },
            partial(nearest_expansion, scene, q, y0, choice.order, choice.cluster_gap),
            solves=len(q),
            use=f"in the case file, expansion: {{order: auto, accuracy: {each.accuracy:g}}}",
        )


def beside_auto(
    advice: Advice, scene: Scene, points: Sequence[ChartPoint], taken: Sequence[Taken]
) -> Advice:
    """The advice with what ``auto`` takes, by itself and where it follows this chart."""
    full, share = scene.expansions.full, series_share(scene.file) / asked_accuracy(scene.file)
    able = fitting(charted_expansions(points), scene.file, full.q0, full.y0)
    accuracy, n = advice.accuracy, advice.evaluations
    if accuracy is None:
        affordable = [e for e in able if e.total_s(n) <= (advice.budget_s or 0.0)]
        least = min((e.worst_relative for e in affordable), default=np.inf)
        accuracy = _rounded_up(least / share) if np.isfinite(least) else None
    if accuracy is None or advice.is_below_round_off:
        return advice
    quickest = next(iter(within(able, share * accuracy, n)), None)
    known = {p.method: p for p in points}
    own = next((t for t in taken if t.accuracy == advice.accuracy), None)
    advice = replace(
        advice,
        auto=None if own is None else _takes(own, known, n),
        followed=None if quickest is None else quickest.method,
        followed_s=None if quickest is None else quickest.total_s(n),
        followed_accuracy=accuracy,
    )
    return replace(advice, words="; ".join([advice.words, *_words(advice)]))


def _rounded_up(value: float) -> float:
    """To two digits."""
    size = 10.0 ** (floor(log10(value)) - 1)
    return float(f"{ceil(value / size) * size:.1e}")


def _takes(own: Taken, known: dict[str, ChartPoint], evaluations: float) -> AutoTakes:
    point = known.get(own.method or "")
    if point is None:
        why = own.refused or f"{own.method} could not be charted"
        return AutoTakes(None, None, None, own.seconds, why)
    worst, total = point.everywhere.worst_relative, point.total_s(evaluations)
    return AutoTakes(point.method, worst, total, own.seconds, "")


def _words(advice: Advice) -> Iterator[str]:
    auto = advice.auto
    if auto is not None and auto.total_s is None:
        yield f"`expansion.order: auto` refuses: {auto.refused}"
    elif auto is not None and auto.total_s is not None:
        yield (
            f"`expansion.order: auto` takes {auto.method}, {time_words(auto.total_s)} in all"
            f"{_against(advice, auto.method, auto.total_s)}, worst error "
            f"{auto.worst_relative:.1e}, after {time_words(auto.choosing_s)} of choosing"
        )
    if advice.followed_s is not None and (auto is None or advice.followed != auto.method):
        spent = time_words(advice.followed_s)
        yield f"following this chart it takes {advice.followed}, {spent} in all"


def _against(advice: Advice, method: str | None, total_s: float) -> str:
    """How many times as long as the choice, and as the quickest expansion."""
    others = {advice.method: advice.total_s, advice.followed: advice.followed_s}
    times = [
        f"{total_s / spent:.2g} times as long as {name}"
        for name, spent in others.items()
        if name != method and spent
    ]
    return f", {' and '.join(times)}" if times else ""
