"""Where sparse algebra overtakes dense: sets the limits in ``eigassign/modal/arguments.py``.

Both paths are forced in turn on arms of growing mesh; a row gives the median times of one expansion
of order 4 and of one exact solve for two modes.
"""

from __future__ import annotations

import common  # first: settles the threads

# isort: split
from collections.abc import Callable

import arms
import numpy as np
from literal_procedure import Q0, design

import eigassign as ea
from eigassign.modal import projection
from eigassign.modal.exact import solver
from eigassign.modal.model import Model
from eigassign.modal.taylor import coefficients


def forced(limit: int, job: Callable[[], object]) -> Callable[[], object]:
    """The job with every limit set to ``limit``."""

    def run() -> object:
        kept = [module.DENSE_LIMIT for module in (coefficients, solver, projection)]
        for module in (coefficients, solver, projection):
            module.DENSE_LIMIT = limit
        try:
            return job()
        finally:
            for module, value in zip((coefficients, solver, projection), kept, strict=True):
                module.DENSE_LIMIT = value

    return run


def row(model: Model, what: str, q0: np.ndarray, y0: np.ndarray) -> common.Row:
    jobs = {
        "expand": lambda: ea.expand(model, q0, y0, (1,), 4),
        "one exact solve": lambda: model.modes(q0, y0, 2),
        "50 exact solves": lambda: model.frequencies(np.tile(q0, (50, 1)), y0, 2),
    }
    both = {
        f"{name}, {kind}": forced(limit, job)
        for name, job in jobs.items()
        for kind, limit in (("dense", 10**9), ("sparse", 0))
    }
    times = common.medians(both, 9)
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
