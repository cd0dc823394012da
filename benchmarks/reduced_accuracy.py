"""How accurate the reduced model is on the paper's arm, beside the polynomial of the same cost.

The same vectors to order m = 2 give the polynomial to order 2m + 1 = 5. Along the trajectory at the
initial design, and over random samples of ±60° of elbow and the whole box of y.
"""

from __future__ import annotations

import common  # first: settles the threads

# isort: split
import numpy as np

import eigassign as ea

SAMPLES = 2_000


def worst(found: np.ndarray, exact: np.ndarray) -> float:
    """Largest relative error in Hz; infinite where the polynomial has no root."""
    error = np.abs(found / exact - 1.0)
    return float(np.where(np.isnan(error), np.inf, error).max())


def main() -> None:
    case = ea.load_case(common.CASES / "two_link.yaml")
    model = case.model()
    q0, y0 = np.array([1.817, 5.312]), np.array([0.125, 0.125])
    rng = np.random.default_rng(0)
    along = case.trajectory.q
    places = {
        "trajectory, y = 0": (along, np.zeros((len(along), 2))),
        "trajectory, y in its box": (along, rng.uniform(0.0, 0.25, (len(along), 2))),
        "±60° of elbow, y in its box": (
            q0 + np.column_stack([np.zeros(SAMPLES), np.deg2rad(60) * rng.uniform(-1, 1, SAMPLES)]),
            rng.uniform(0.0, 0.25, (SAMPLES, 2)),
        ),
    }
    models = {
        "reduced, mode 1, m = 2": ea.reduce(model, q0, y0, (1,), 2),
        "reduced, modes 1-3, m = 2": ea.reduce(model, q0, y0, (1, 2, 3), 2),
        "polynomial, order 4": ea.expand(model, q0, y0, (1,), 4),
        "polynomial, order 5": ea.expand(model, q0, y0, (1,), 5, vector_order=2),
    }
    rows = []
    for name, approximation in models.items():
        row: dict[str, object] = {
            "what": name,
            "vectors": getattr(approximation, "size", ""),
        }
        for place, (q, y) in places.items():
            exact = model.frequencies(q, y, 1)
            row[place] = worst(approximation.frequencies(q, y)[:, :1], exact)
        rows.append(row)
    common.report(
        "reduced_accuracy",
        "Worst relative error in Hz of mode 1 on the paper's arm, one expansion point",
        rows,
        [
            "wanted with one mode: 1e-8 along the trajectory, 1e-5 over ±60° and the y-box;"
            " with three modes in the basis: 1e-9",
            f"{SAMPLES} random samples in the box, {len(along)} along the trajectory",
        ],
    )


if __name__ == "__main__":
    main()
