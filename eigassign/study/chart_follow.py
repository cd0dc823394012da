"""From a chart to what ``auto`` takes: its quickest expansion that meets an accuracy.

One rule for the chart's own advice and for a case that follows the chart (``expansion.chart``). A
chart's times are of one machine: given the file, what is taken depends on it and the case alone.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.case import CaseFile
from eigassign.chart.results import ChartPoint
from eigassign.errors import CaseError, StorageError
from eigassign.modal.adaptive.order import Suggestion
from eigassign.modal.exact.clusters import CLUSTER_GAP

Floats = NDArray[np.float64]
SCHEMA = 2  # of chart.json
FULL, SEVERAL, CLUSTERED = "Taylor, full", "Taylor, several points", "Taylor, wider cluster"
GARBLED = (
    ValueError,
    LookupError,
    TypeError,
    AttributeError,
    ArithmeticError,
    RecursionError,
)  # what reading a file that is no chart raises
FOLLOWED = (FULL, SEVERAL, CLUSTERED)  # the families that a case can be given


@dataclass(frozen=True, eq=False)
class Charted:
    """One expansion of a chart, in full about points q (k, n_q) at the one design y (n_y,).

    Modes closer than ``cluster_gap`` (relative in λ) go together in it.
    """

    method: str
    order: int
    q: Floats
    y: Floats
    cluster_gap: float
    offline_s: float
    online_s: float
    worst_relative: float

    def total_s(self, evaluations: float) -> float:
        """Seconds for set-up and so many evaluations."""
        return self.offline_s + evaluations * self.online_s


@dataclass(frozen=True)
class KeptChart:
    """What of a chart.json is needed to follow it."""

    subject_sha256: str
    modes: tuple[int, ...]
    evaluations: float
    expansions: tuple[Charted, ...]


def within(
    expansions: Iterable[Charted], accuracy: float, evaluations: float
) -> tuple[Charted, ...]:
    """Those whose worst charted error is at most ``accuracy`` (relative), the quickest first."""
    good = [e for e in expansions if e.worst_relative <= accuracy]
    return tuple(sorted(good, key=lambda e: (e.total_s(evaluations), e.method)))


def charted_expansions(points: Iterable[ChartPoint]) -> tuple[Charted, ...]:
    """The charted methods that a case file can ask for."""
    return tuple(_charted(asdict(p)) for p in points if p.family in FOLLOWED)


def _charted(point: Mapping[str, Any]) -> Charted:
    """Of a method as chart.json has it; raises what is in `GARBLED`."""
    how, worst = point["parameters"], point["everywhere"]["worst_relative"]
    q, y = (np.atleast_2d(np.asarray(how[name], dtype=np.float64)) for name in ("q0", "y0"))
    order, gap = int(how["order"]), float(how.get("cluster_gap", CLUSTER_GAP))
    offline, online = (float(point[part]["median_s"]) for part in ("offline", "online"))
    error = math.inf if worst is None else float(worst)
    places = q.ndim == y.ndim == 2 and np.isfinite(q).all() and np.isfinite(y).all()
    if not (places and 1 <= order <= 20 and error >= 0.0):
        raise ValueError(f"{point['method']} has an impossible number")
    if not all(map(_positive, (gap, offline, online))) or np.ptp(y, axis=0).any():
        raise ValueError(f"{point['method']} has an impossible number")
    return Charted(str(point["method"]), order, q, y[0], gap, offline, online, error)


def _positive(value: float) -> bool:
    return math.isfinite(value) and value > 0.0


def read_chart(file: CaseFile) -> KeptChart:
    """What ``expansion.chart`` names; CaseError at its line where that is no chart of ours."""
    try:
        with open(str(file.expansion.chart), encoding="utf-8") as stream:
            return _kept(json.load(stream))
    except OSError as error:
        reason = f"cannot be read: {error.strerror}"
        raise StorageError(f"{file.expansion.chart}: {reason}") from error
    except GARBLED as error:
        problem = file.problem(
            "expansion.chart",
            f"{file.expansion.chart} is no chart.json of this version of eigassign "
            f"({type(error).__name__}: {error}); make it anew with `eigassign chart`",
        )
        raise CaseError((problem,)) from error


def _kept(chart: Mapping[str, Any]) -> KeptChart:
    if chart["schema"] != SCHEMA:
        raise ValueError(f"schema {chart['schema']}, not {SCHEMA}")
    evaluations = float(chart["asked"]["evaluations"])
    if not _positive(evaluations):
        raise ValueError("evaluations must be positive")
    expansions = [p for p in chart["points"] if p["family"] in FOLLOWED]
    modes = tuple(int(mode) for mode in chart["asked"]["modes"])
    made = tuple(_charted(p) for p in expansions)
    return KeptChart(str(chart["subject_sha256"]), modes, evaluations, made)


def suggestions(
    file: CaseFile, q0: Floats, y0: Floats, modes: Sequence[int], accuracy: float
) -> tuple[tuple[Suggestion, ...], tuple[str, ...]]:
    """What a case that follows a chart should try, and why nothing of it if so.

    Only expansions at its design y0 count and, where it gives ``expansion.q``, at that pose. None
    without ``expansion.chart``. Raises CaseError for a file that is no chart.
    """
    if file.expansion.chart is None:
        return (), ()
    chart = read_chart(file)
    if chart.subject_sha256 != file.subject_sha256:
        return (), ("the chart is not followed: it is of another case",)
    if chart.modes != tuple(modes):
        charted = ", ".join(map(str, chart.modes))
        return (), (f"the chart is not followed: it is of mode {charted}",)
    best = within(fitting(chart.expansions, file, q0, y0), accuracy, chart.evaluations)
    if not best:
        return (), (f"the chart has no expansion within {accuracy:.1e}: auto chooses by itself",)
    said = (
        f"the chart is followed: {best[0].method} is its quickest expansion within "
        f"{accuracy:.1e} for {chart.evaluations:.6g} evaluations, if the error estimate agrees"
    )
    return tuple(_suggestion(e) for e in best), (said,)


def fitting(
    expansions: Iterable[Charted], file: CaseFile, q0: Floats, y0: Floats
) -> tuple[Charted, ...]:
    """Those at the design y0 and, where the case gives ``expansion.q``, about that pose alone."""
    return tuple(e for e in expansions if _fits(e, file, q0, y0))


def _fits(expansion: Charted, file: CaseFile, q0: Floats, y0: Floats) -> bool:
    if expansion.q.shape[1] != len(q0) or expansion.y.shape != y0.shape:
        return False
    here = file.expansion.q == "auto" or np.allclose(expansion.q[0], q0)
    return bool(here and np.allclose(expansion.y, y0))


def _suggestion(expansion: Charted) -> Suggestion:
    y = np.broadcast_to(expansion.y, (len(expansion.q), len(expansion.y)))
    name = f"{expansion.method}, charted with {expansion.worst_relative:.1e}"
    points = np.hstack([expansion.q, y])
    return Suggestion(name, expansion.order, points, expansion.cluster_gap)
