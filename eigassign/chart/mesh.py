"""Elements per link against discretisation error: the limit that the frequencies converge to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.chart.results import MeshRow
from eigassign.chart.timing import Effort, measure
from eigassign.mechanism.assembly.build import refined
from eigassign.study.build import build_model

Floats = NDArray[np.float64]


def chart_meshes(
    file: CaseFile, x: Floats, modes: Sequence[int], effort: Effort
) -> tuple[MeshRow, ...]:
    """One row for each mesh up to ``effort.most_dof``, from coarse to fine, at points x (n, n_x).

    The limit is extrapolated from the two finest, f + (f − f_coarser)/15, for errors fall like h⁴
    where cubic beam elements are halved; the finest row's own error is therefore an estimate. No
    rows where fewer than two meshes differ.
    """
    meshes = {
        counts: (k, finer) for k in sorted(effort.factors) for finer, counts in [refined(file, k)]
    }
    rows, solved = list[MeshRow](), list[Floats]()
    for counts, (factor, finer) in meshes.items():
        model = build_model(finer)
        if not counts or model.n_dof > effort.most_dof:
            break
        q, y = np.split(x, [len(model.q_names)], axis=1)
        hz, spent = measure(partial(model.frequencies, q, y, max(modes)), effort, len(x))
        solved.append(hz[:, np.array(modes) - 1])
        rows.append(MeshRow(factor, sum(counts), model.n_dof, 0.0, 0.0, None, spent))
    if len(rows) < 2:
        return ()
    off = np.array(solved) - (limit := solved[-1] + (solved[-1] - solved[-2]) / 15.0)
    worst, relative = (np.abs(e).max(axis=(1, 2)).tolist() for e in (off, off / limit))
    orders: list[float | None] = [None] * len(rows)
    for k in range(len(rows) - 2):
        if worst[k] > 0.0 and 0.0 < worst[k + 1] < np.inf:
            finer_by = rows[k + 1].factor / rows[k].factor
            orders[k] = float(np.log(worst[k] / worst[k + 1]) / np.log(finer_by))
    found = zip(rows, worst, relative, orders, strict=True)
    return tuple(replace(r, worst_hz=w, worst_relative=e, order=p) for r, w, e, p in found)
