"""What Craig-Bampton saves on an arm of six lattice booms, and what it costs in accuracy.

Six joints, 10⁴ dof, spatial; the payload and the mass at the elbow are design. Whole and reduced
models take turns. The truncation error is stated by the program's bound, over poses and designs;
beside it stands the true one, from exact solves of the whole arm at the same poses and designs.
"""

from __future__ import annotations

import common  # first: settles the threads

# isort: split
from typing import Any

import numpy as np
from arms import STEEL, case_of

import eigassign as ea
from eigassign.modal import Model, rounding_error

BAYS = 23
MODES = (1, 2, 3)
JOINTS = 6


def boom(length: float, width: float) -> dict[str, Any]:
    """Three chords, battens and diagonals in two elements each, tied together at both ends."""
    nodes: dict[str, list[float]] = {"start": [0.0, 0.0, 0.0], "end": [length, 0.0, 0.0]}
    beams: dict[str, dict[str, Any]] = {}

    def tie(name: str, a: str, b: str, section: str, elements: int = 2) -> None:
        material = {"material": "steel", "section": section, "elements": elements}
        beams[name] = {"from": a, "to": b, **material}

    for bay in range(BAYS + 1):
        for k in range(3):
            turn = 2.0 * np.pi * k / 3.0
            place = [length * bay / BAYS, width * np.cos(turn), width * np.sin(turn)]
            nodes[f"n{bay}_{k}"] = [float(c) for c in place]
            if bay:
                tie(f"chord{bay}_{k}", f"n{bay - 1}_{k}", f"n{bay}_{k}", "chord")
                tie(f"diagonal{bay}_{k}", f"n{bay - 1}_{k}", f"n{bay}_{(k + 1) % 3}", "brace")
            tie(f"batten{bay}_{k}", f"n{bay}_{k}", f"n{bay}_{(k + 1) % 3}", "brace")
    for k in range(3):
        tie(f"foot{k}", "start", f"n0_{k}", "chord", 1)
        tie(f"head{k}", "end", f"n{BAYS}_{k}", "chord", 1)
    return {"type": "frame", "nodes": nodes, "beams": beams}


def arm(reduce_to: float | str | None) -> ea.Case:
    """Yaw, then five pitch and roll joints in turn; the first joint free, the others driven."""
    names = [f"boom{k}" for k in range(JOINTS)]
    axes = [[0, 0, 1], [0, 1, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    bases = ["ground", *(f"{name}.end" for name in names[:-1])]
    links = {n: boom(1.2 - 0.12 * k, 0.08 - 0.008 * k) for k, n in enumerate(names)}
    for link in links.values():
        if reduce_to is not None:
            link["reduce_to"] = reduce_to
    return case_of(
        {
            "title": "Arm of six lattice booms",
            "mechanism": {
                "space": "spatial",
                "materials": {"steel": {**STEEL, "poissons_ratio": 0.3}},
                "sections": {
                    "chord": {"shape": "tube", "outer_diameter": 0.016, "thickness": 0.002},
                    "brace": {"shape": "tube", "outer_diameter": 0.010, "thickness": 0.001},
                },
                "links": links,
                "joints": {
                    f"j{k}": {"type": "revolute", "base": b, "follower": f"{n}.start", "axis": a}
                    for k, (b, n, a) in enumerate(zip(bases, names, axes, strict=True))
                },
                "bodies": {
                    "elbow": {"at": "boom2.end", "mass": 2.0},
                    "payload": {"at": "boom5.end", "mass": 3.0},
                },
            },
            "coordinates": {
                f"q{k}": {"joint": f"j{k}", "drive": "free" if k == 0 else {"stiffness": 2e5}}
                for k in range(JOINTS)
            },
            "trajectory": {"q": [[0.0] * JOINTS, list(POSE)], "duration": 1.0},
            "design": {
                "elbow": {"parameter": "bodies.elbow.mass", "min": 0.0, "max": 6.0},
                "payload": {"parameter": "bodies.payload.mass", "min": 0.0, "max": 6.0},
            },
            "expansion": {"accuracy": 1e-3, "modes": list(MODES)},
        }
    )


POSE = (0.3, -0.6, 1.1, 0.4, -0.8, 0.5)


def main() -> None:
    rng = np.random.default_rng(0)
    q = np.array(POSE) + rng.uniform(-0.5, 0.5, (4, JOINTS))
    y = rng.uniform(0.0, 6.0, (3, 2))
    cases = {"whole": None, "reduced to 300 Hz": 300.0, "reduced to 1 kHz": 1000.0, "auto": "auto"}
    models = {name: arm(reduce_to).model() for name, reduce_to in cases.items()}
    exact = _frequencies(models["whole"], q, y)
    lost = rounding_error(models["whole"].pencil, models["whole"].x(q[0], y[0])[0], 3)
    once = {"whole": 3, "reduced to 300 Hz": 3, "reduced to 1 kHz": 3, "auto": 3}
    build = common.medians({n: lambda c=c: arm(c).model() for n, c in cases.items()}, once)
    solve = common.medians(
        {n: lambda m=m: m.frequencies(q[0], y[0], 3) for n, m in models.items()}, 5
    )
    expand = common.medians(
        {n: lambda m=m: ea.expand(m, q[0], y[0], MODES, 3) for n, m in models.items()}, 3
    )
    rows = []
    for name, model in models.items():
        bound = np.array([model.truncation_error(q, each, MODES) for each in y])
        true = _frequencies(model, q, y) / exact - 1.0
        rows.append(
            {
                "links": name,
                "n_dof": model.n_dof,
                "case to model": common.milliseconds(build[name]),
                "exact solve": common.milliseconds(solve[name]),
                "expansion, order 3": common.milliseconds(expand[name]),
                "solve, times faster": solve["whole"] / solve[name],
                "expansion, times faster": expand["whole"] / expand[name],
                "truncation error stated": float(bound.max()),
                "true": float(max(true.max(), 0.0)),
                "stated / true, least": _ratio(bound, true, lost, np.min),
                "most": _ratio(bound, true, lost, np.max),
            }
        )
    first = models["reduced to 1 kHz"]
    cost = common.medians({"bound": lambda: first.truncation_error(q, y[0], MODES)}, 3)["bound"]
    common.report(
        "craig_bampton",
        f"Craig-Bampton on an arm of six lattice booms, {models['whole'].n_dof} dof",
        rows,
        [
            "errors are relative in frequency, the largest of modes 1-3 over 4 poses and 3 designs;"
            f" ratios where the true one is over the round-off of the whole arm, up to {lost:.1g}",
            f"the bound at 4 poses and one design, reduced to 1 kHz: {common.milliseconds(cost)}",
            "auto: expansion.accuracy 1e-3, of which reduced links may use a quarter",
        ],
    )


def _ratio(bound: np.ndarray, true: np.ndarray, lost: float, which: Any) -> object:
    """Of the ratios where the true error is more than round-off."""
    sure = true > lost
    return float(which(bound[sure] / true[sure])) if sure.any() else ""


def _frequencies(model: Model, q: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.array([model.frequencies(q, each, 3) for each in y])


if __name__ == "__main__":
    main()
