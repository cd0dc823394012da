"""The fastest motion of the shipped SCARA against a grid, for three timing laws.

Each design of a grid of both drives and the height of the upper tube is looked at for 281 motion
times; the fastest that keeps the limit is what `optimize` is compared with. Its own answer is
looked at with a step five times as fine.
"""

from __future__ import annotations

import common  # first: settles the threads

# isort: split
from itertools import product
from typing import Any

import numpy as np
import yaml

import eigassign as ea
from eigassign.assignment import design_limits
from eigassign.modal import Sizes

FINE = Sizes(steps=640, poses=5, loads=25)
TIMES = np.linspace(0.12, 0.4, 281)
COUNTS = 12, 12, 5  # of k1, k2 and h1
CASES = (
    ("quintic", "0.2 mm"), ("cubic", "0.2 mm"), ("trapezoidal", "0.6 mm"), ("trapezoidal", "0.2 mm")
)  # fmt: skip


def case_of(law: str, most: str) -> ea.Case:
    data: dict[str, Any] = yaml.safe_load((common.CASES / "scara.yaml").read_text())
    data["trajectory"]["timing"] = law
    data["targets"][0]["at_most"] = most
    return ea.load_case(data)


def best_of_grid(case: ea.Case, limit: Any) -> tuple[float, np.ndarray]:
    """The least motion time of a grid, and the design with it."""
    best, design = np.inf, np.zeros(0)
    ends = case.file.box[:-1]
    grid = product(*(np.linspace(*end, n) for end, n in zip(ends, COUNTS, strict=True)))
    for own in grid:
        kept = limit.quantity.along(np.array([*own, 0.25]), TIMES) <= limit.allowed[1]
        if kept.any() and TIMES[kept.argmax()] < best:
            best, design = float(TIMES[kept.argmax()]), np.array(own)
    return best, design


def main() -> None:
    rows = []
    for law, most in CASES:
        case, found = case_of(law, most), []
        spent = common.once(lambda own=case, out=found: out.append(ea.assign(own)))
        results, y = found[0].results, np.array(list(found[0].design.values()))
        limits = design_limits(case.file, case.model(), case.trajectory)
        limit = next(one for one in limits if one.is_residual)
        grid: list[tuple[float, np.ndarray]] = []
        looked = common.once(lambda own=case, of=limit, out=grid: out.append(best_of_grid(own, of)))
        best, design = grid[0]
        rows.append(
            {
                "timing": law,
                "limit": most,
                "verdict": results.assignment.verdict,
                "motion time": f"{y[-1]:.4f} s",
                "of the grid": f"{best:.3f} s",
                "relative": f"{100.0 * (y[-1] / best - 1.0):+.2f} %",
                "residual, finely, of the limit": limit.quantity.along(y, y[-1:], FINE)[0]
                / limit.allowed[1],
                "optimize": f"{spent:.0f} s",
                "grid": f"{looked:.0f} s",
                "design": " ".join(f"{v:.4g}" for v in y[:-1]),
                "design of the grid": " ".join(f"{v:.4g}" for v in design),
            }
        )
    remarks = [f"grid: {' × '.join(map(str, COUNTS))} designs at {len(TIMES)} motion times, 1 ms"]
    common.report("fastest_motion", "The fastest motion that stands still", rows, remarks)


if __name__ == "__main__":
    main()
