"""Where sparse algebra overtakes dense: sets ``DENSE_LIMIT`` of the pencil.

Both paths are forced in turn on arms of growing mesh; a row gives the median times of one expansion
of order 4 and of one exact solve for two modes.
"""

from __future__ import annotations

import common  # first: settles the threads

# isort: split
from dataclasses import replace

import arms
import numpy as np
from literal_procedure import Q0, design

import eigassign as ea
from eigassign.modal import Model


def row(model: Model, what: str, q0: np.ndarray, y0: np.ndarray) -> common.Row:
    jobs = {}
    for kind, limit in (("dense", 10**9), ("sparse", 0)):
        forced = replace(model, pencil=replace(model.pencil, dense_limit=limit))
        jobs |= {
            f"expand, {kind}": lambda m=forced: ea.expand(m, q0, y0, (1,), 4),
            f"one exact solve, {kind}": lambda m=forced: m.modes(q0, y0, 2),
            f"50 exact solves, {kind}": lambda m=forced: m.frequencies(np.tile(q0, (50, 1)), y0, 2),
        }
    times = common.medians(jobs, 9)
    cells = {name: common.milliseconds(seconds) for name, seconds in times.items()}
    return {"arm": what, "n_dof": model.n_dof, **cells}


def main() -> None:
    rows = []
    for elements in (1, 3, 6, 10, 14, 20, 28):
        case = arms.case_of(arms.serial_arm(elements, design()))
        rows.append(row(case.model(), "six links, 16 variables", Q0, case.initial_design))
    for elements in (8, 20, 32, 50, 80):
        data = arms.serial_arm(elements, {"m": design()["m1"]})
        for k in range(2, 6):
            arms.remove_link(data, k)
        case = arms.case_of(data)
        rows.append(row(case.model(), "two links, 3 variables", Q0[:2], case.initial_design))
    common.report("dense_or_sparse", "Dense or sparse: where the limits are", rows)


if __name__ == "__main__":
    main()
