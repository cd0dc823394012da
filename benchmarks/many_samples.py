"""Exact frequencies of large models at many samples: together, and one by one.

One by one is Lanczos' method with a factorisation of K at every sample, which the solver falls back
on. The whole `optimize` of the six-axis arm is in ``profiles.py``; to compare two versions of it,

    PYTHONPATH=<version> python -m eigassign optimize arm.yaml --figures none --no-cache --force

in turns, with ``case_text`` of that script for arm.yaml.
"""

from __future__ import annotations

import common  # first: settles the threads

# isort: split
import arms
import chart_cases
import numpy as np
import profiles
import yaml

from eigassign.modal import solve_sparse, solve_together

COUNT = 4


def six(elements: int) -> dict[str, object]:
    """The shipped arm with a mesh of so many elements a link."""
    data = yaml.safe_load(chart_cases.six())
    for link in ("column", "upper_arm", "forearm"):
        data["mechanism"]["links"][link]["elements"] = elements
    return data


def rows(name: str, data: dict[str, object], samples: tuple[int, ...]) -> list[common.Row]:
    """One for each number of samples, evenly along the trajectory."""
    case = arms.case_of(data)
    model, q = case.model(), case.trajectory.q
    pencil = model.pencil
    theta = pencil.theta(model.x(q, case.initial_design))
    table = []
    for count in samples:
        part = theta[:, np.linspace(0, len(q) - 1, count).round().astype(int)]
        found = solve_together(pencil, part, COUNT, False)
        alone = solve_sparse(pencil, part, COUNT, False)
        assert found is not None
        times = common.medians(
            {
                "together": lambda part=part: solve_together(pencil, part, COUNT, False),
                "one by one": lambda part=part: solve_sparse(pencil, part, COUNT, False),
            },
            3,
        )
        apart = np.abs(np.sqrt(found.lam / alone.lam) - 1.0).max()
        table.append(
            {
                "case": name,
                "n_dof": pencil.n_dof,
                "samples": count,
                "one by one": common.milliseconds(times["one by one"]),
                "together": common.milliseconds(times["together"]),
                "share": times["together"] / times["one by one"],
                "largest difference in Hz": f"{apart:.0e}",
            }
        )
    return table


def main() -> None:
    found = rows("arm_6r", six(14), (20, 101)) + rows("arm_6r", six(56), (20, 101))
    found += rows("arm_6r", six(profiles.FINE), (20, 101))
    found += rows("trunk with chains", yaml.safe_load(chart_cases.large()), (21,))
    common.report(
        "many_samples",
        "Exact solves at many samples",
        found,
        [f"the lowest {COUNT} modes; the difference is the round-off that a fine mesh's K holds"],
    )


if __name__ == "__main__":
    main()
