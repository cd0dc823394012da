"""Random cases whose objective is no error: light, high and wide designs, over the same mechanisms.

Limits are those that a random design has, drawn over the bounds, which span up to two decades;
in every fifth case two of the parameters take listed values.
"""

from typing import Any

import numpy as np
import yaml
from random_assignments import load_text, random_case

import eigassign as ea

KINDS = ("lightest", "highest", "widest")


def objective_case(kind: str, seed: int) -> str:
    """The text of the case file of this kind and seed; always the same."""
    rng = np.random.default_rng([seed, KINDS.index(kind), 26])
    draw = seed
    while True:
        try:
            found = _case(kind, draw, rng, listed=seed % 5 == 4)
        except ea.EigassignError:
            found = None
        if found is not None:
            return found
        draw += 1000


def _case(kind: str, seed: int, rng: np.random.Generator, listed: bool) -> str | None:
    case = yaml.safe_load(random_case(seed))
    case.pop("targets")
    case["title"] = f"Random objective {seed}: {kind}"
    motions = case["trajectory"] if isinstance(case["trajectory"], list) else [case["trajectory"]]
    for motion in motions:
        motion["samples"] = int(rng.integers(8, 25))
    names = [name for name in case["design"] if name != "constraints"]
    loaded = load_text(yaml.safe_dump(case))
    model, path = loaded.model(), loaded.trajectory
    designs = [_drawn(loaded, rng) for _ in range(12)]
    masses = np.array([model.mass(y) for y in designs])
    moves = bool(np.ptp(masses) > 1e-3 * masses.mean())
    k = int(np.argsort(masses)[6])
    hz = model.frequencies(path.q, designs[k], 4)
    if kind == "lightest":
        if not moves:
            return None
        case["targets"] = [{"mode": 1, "at_least": _short(0.98 * hz[:, 0].min())}]
        if rng.random() < 0.4:
            case["targets"].append({"mode": 2, "at_most": _short(1.05 * hz[:, 1].max())})
        if rng.random() < 0.3:
            case["targets"].append({"mode": 3, "at_least": _short(0.9 * hz[:, 2].min())})
        case["assignment"] = {"objective": "lightest"}
        if rng.random() < 0.3:
            case["assignment"] = {}
            case["design"]["mass"] = {"price": "4 / kg"}
    elif kind == "highest":
        mode = int(rng.integers(1, 4))
        highest: Any = mode
        if len(motions) > 1 and rng.random() < 0.5:
            highest = {"mode": mode, "trajectory": motions[0]["name"]}
        case["assignment"] = {"objective": {"highest": highest}}
        if moves:
            case["design"]["mass"] = {"max": _short(1.001 * masses[k])}
        if rng.random() < 0.3:
            other = 1 if mode > 1 else 2
            case["targets"] = [{"mode": other, "at_least": _short(0.95 * hz[:, other - 1].min())}]
    else:
        case["assignment"] = {"objective": "widest"}
        case["targets"] = list(_kept_apart(hz, rng))
        if moves and rng.random() < 0.7:
            case["design"]["mass"] = {"max": _short(1.001 * masses[k])}
    if listed:
        for name in rng.permutation(names)[:2].tolist():
            entry = case["design"][name]
            low, high = entry.pop("min"), entry.pop("max")
            values = np.linspace(low, high, 4) if low <= 0.0 else np.geomspace(low, high, 4)
            entry["values"] = sorted({_short(v) for v in values})
            for other in case["design"].get("constraints", {}).values():
                other["terms"].pop(name, None)
        rows = {n: c for n, c in case["design"].get("constraints", {}).items() if c["terms"]}
        case["design"].pop("constraints", None)
        if rows and not listed:
            case["design"]["constraints"] = rows
    return str(yaml.safe_dump(case, sort_keys=False))


def _kept_apart(hz: np.ndarray, rng: np.random.Generator) -> Any:
    """A band between two modes that a design has, or a gap, or both."""
    k = int(rng.integers(1, 3))
    low, high = 1.02 * hz[:, k - 1].max(), 0.98 * hz[:, k].min()
    if low < high:
        middle, half = 0.5 * (low + high), min(0.5 * (high - low), 0.1 * low)
        half *= rng.uniform(0.1, 0.9)
        yield {"modes": "all", "keep_out": [_short(middle - half), _short(middle + half)]}
    if low >= high or rng.random() < 0.4:
        room = float((hz[:, k] - hz[:, k - 1]).min())
        least = max(0.3 * room, 1e-3 * hz[:, k].min())
        yield {"gap": {"between": [k, k + 1], "at_least": _short(least)}}


def _drawn(case: ea.Case, rng: np.random.Generator) -> np.ndarray:
    parameters = case.file.design.parameters.values()
    low, high = np.array([p.min for p in parameters]), np.array([p.max for p in parameters])
    u, far = rng.random(len(low)), (low > 0.0) & (high > 10.0 * low)
    base = np.where(far, low, 1.0)
    return np.where(far, base * (np.where(far, high, 1.0) / base) ** u, low + u * (high - low))


def _short(value: float) -> float:
    return float(f"{value:.4g}")
