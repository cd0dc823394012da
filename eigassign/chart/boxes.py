"""Error against the size of the box: how far a method may be trusted, in q, in y and in both.

All points are drawn towards the point x0 of expansion, x0 + h (x − x0): h = 1 are the case's own
ranges. Fits learn anew in every box.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from eigassign.chart.methods import FULL, KRIGING, LINEAR, RITZ, SURFACE, Built, surrogates
from eigassign.chart.question import Effort, Points, Subject, asked, errors
from eigassign.chart.results import BoxRow, Reach
from eigassign.errors import EigassignError

Floats = NDArray[np.float64]
HALF_WIDTHS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
SERIES = tuple(f"{curve}, order {p}" for curve in (FULL, LINEAR) for p in (1, 2, 4, 8))
FITS = (f"{SURFACE}, degree 2", f"{KRIGING}, 25 points")


def study_boxes(
    subject: Subject, effort: Effort, built: Mapping[str, Built], floor: float
) -> tuple[BoxRow, ...]:
    """The worst error of each method in each box; none where nothing varies."""
    is_q = np.arange(len(subject.x0)) < len(subject.model.q_names)
    varied = {"q": is_q, "y": ~is_q, "q and y": np.ones_like(is_q)}
    if not (subject.rows and subject.changes):
        varied = {k: varied[k] for k in ("q",) * bool(subject.rows) + ("y",) * subject.changes}
    tests = subject.tested(replace(effort, designs=effort.boxes, instants=effort.boxes))
    fits = [m for m in surrogates(subject, effort) if f"{m.curve}, {m.size}" in FITS]
    ritz = [name for name in built if name.startswith(RITZ) and " at " not in name]
    kept = {name: one for name, one in built.items() if name in (*SERIES, *ritz[-1:])}
    rows = list[BoxRow]()
    for name, mask in varied.items():
        for h in HALF_WIDTHS:

            def drawn(points: Points, h: float = h, mask: NDArray[np.bool_] = mask) -> Points:
                x = subject.x0 + np.where(mask, h, 0.0) * (points.x - subject.x0)
                return replace(points, x=x)

            made, points = dict(kept), drawn(tests)
            for fit in fits:
                with suppress(EigassignError, np.linalg.LinAlgError):
                    made[f"{fit.curve}, {fit.size}"] = fit.build(drawn(subject.learnt(fit.learns)))
            exact = subject.exact(points.x)
            for method, one in made.items():
                error = errors(asked(one.answer, points, exact), exact)[0]
                claimed = None
                if one.claimed is not None:
                    claimed = errors(1.0 + asked(one.claimed, points, exact), exact * 0.0 + 1.0)[0]
                rows.append(BoxRow(method, name, h, max(error, floor), claimed))
    return tuple(rows)


def reaches(rows: Sequence[BoxRow], accuracy: float) -> tuple[Reach, ...]:
    """Where each method's error passes the accuracy, between boxes by straight lines of logarithms.

    0 where it is above in the smallest box already, 1 where it is below in all.
    """
    found = list[Reach]()
    for method, varied in dict.fromkeys((r.method, r.varied) for r in rows):
        own = [r for r in rows if (r.method, r.varied) == (method, varied)]
        h, error = (
            np.array([getattr(r, k) for r in own]) for k in ("half_width", "worst_relative")
        )
        k = int(np.append(~(error <= accuracy), True).argmax())
        reach = 1.0 if k == len(h) else 0.0
        if 0 < k < len(h):
            low, high, wanted = np.log([error[k - 1], error[k], accuracy])
            share = (wanted - low) / (high - low) if np.isfinite(high) else 0.0
            reach = float(h[k - 1] * (h[k] / h[k - 1]) ** share)
        found.append(Reach(method, varied, reach, float(error[-1])))
    return tuple(found)
