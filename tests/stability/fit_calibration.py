"""Fits of the shipped cases: what their error estimate says beside the true error.

``python tests/stability/fit_calibration.py`` prints one line for each fit, and a summary;
case files may be named.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import eigassign as ea
from eigassign.errors import AccuracyError, UsageError
from eigassign.modal import Model, rounding_error

CASES = (*sorted(Path("cases").glob("*.yaml")), Path("cases/stress/wide_motion.yaml"))
ACCURACIES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
SOLVES = (3, 4, 5, 6, 7, 9, 12, 17, 25, 40, 64, 120, 250)
MOST_ON_LINE = 17
MODES = ((1,), (2,), (1, 2, 3))
SPAN = 0.1  # rad or m: half-width of a box of q
POINTS = 120  # random ones in a box, beside its corners
MOST = 600  # frequencies for one fit
Floats = np.ndarray


@dataclass(frozen=True)
class Setting:
    """What a fit is over, and points (q, y) of it at which it is judged."""

    name: str
    model: Model
    over: tuple[Floats | ea.Box, Floats | ea.Box]
    q: Floats
    y: Floats


@dataclass(frozen=True)
class Outcome:
    """One fit that was made: estimate and true error, relative in Hz."""

    name: str
    modes: tuple[int, ...]
    asked: str
    estimate: float
    error: float
    solves: int

    @property
    def overshoot(self) -> float:
        """True error over the estimate: over 1 where the estimate is too small."""
        return self.error / self.estimate


def settings(path: Path) -> Iterator[Setting]:
    """Trajectories at three designs, and with all designs; one pose and a box of q with them."""
    case, rng = ea.load_case(path), np.random.default_rng(7)
    model, y0 = case.model(), np.asarray(case.initial_design)
    bounds = case.file.design.parameters.values()
    low, high = np.array([b.min for b in bounds]), np.array([b.max for b in bounds])
    trajectory = case.trajectory
    for part, rows in zip(trajectory.parts, trajectory.rows, strict=True):
        q = trajectory.q[rows]
        name = f"{path.stem}/{part.name}"
        for k, y in enumerate(_distinct([y0, low, high, rng.uniform(low, high)])):
            yield Setting(f"{name} design {k}", model, (q, y), q, np.tile(y, (len(q), 1)))
        if not len(y0):
            continue
        box, y = ea.Box(low, high), _inside(rng, low, high)
        some = q[rng.integers(len(q), size=len(y))]
        yield Setting(f"{name} x box", model, (q, box), some, y)
        yield Setting(f"{name} pose", model, (q[0], box), np.tile(q[0], (len(y), 1)), y)
        middle = q[len(q) // 2]
        q_low, q_high = middle - SPAN, middle + SPAN
        loads = slice(len(case.file.coordinates), None)  # masses and the like: never below 0
        q_low[loads] = np.maximum(q_low[loads], 0.0)
        around = _inside(rng, np.append(q_low, low), np.append(q_high, high))
        q_box = ea.Box(q_low, q_high)
        yield Setting(f"{name} box x box", model, (q_box, box), *np.hsplit(around, [len(middle)]))


def _distinct(rows: list[Floats]) -> list[Floats]:
    return list({row.tobytes(): row for row in rows}.values())


def _inside(rng: np.random.Generator, low: Floats, high: Floats) -> Floats:
    """Random points, the first of them corners."""
    inside = rng.uniform(low, high, (POINTS, len(low)))
    inside[:16] = np.where(rng.random((16, len(low))) < 0.5, low, high)
    return inside


def outcomes(
    paths: Iterable[Path] = CASES,
    accuracies: Iterable[float] = ACCURACIES,
    solves: Iterable[int] = SOLVES,
) -> Iterator[Outcome]:
    """Every fit that is not refused."""
    for path in paths:
        for setting in settings(path):
            exact = setting.model.frequencies(setting.q, setting.y, max(map(max, MODES)))
            for modes in MODES:
                for accuracy in accuracies:
                    found = outcome(setting, modes, {"accuracy": accuracy}, exact)
                    if found is None:  # what is refused to 1e-3 is refused to 1e-4
                        break
                    yield found
                line = not isinstance(setting.over[1], ea.Box)
                for count in (k for k in solves if k <= MOST_ON_LINE or not line):
                    found = outcome(setting, modes, {"solves": count}, exact)
                    if found is not None:
                        yield found


def outcome(
    setting: Setting, modes: tuple[int, ...], asked: dict[str, Any], exact: Floats
) -> Outcome | None:
    """One fit beside the exact frequencies (n, ≥ the last mode); None where it is refused."""
    try:
        fit = ea.fit(setting.model, *setting.over, modes, most=MOST, **asked)
        got = fit.frequencies(setting.q, setting.y)
    except (AccuracyError, UsageError):  # too few solves are no usage
        return None
    off = np.abs(got / exact[:, np.array(modes) - 1] - 1.0).max()
    x = np.append(setting.q[0], setting.y[0])
    own = rounding_error(setting.model.pencil, x, modes[-1])  # the exact frequencies' error
    error = max(0.0, float(off) - own)
    name = " ".join(f"{key} {value:g}" for key, value in asked.items())
    return Outcome(setting.name, modes, name, fit.error_estimate, error, fit.solves)


def summary(found: list[Outcome]) -> str:
    """How many, how often and by how much the estimate is too small, and its usual excess."""
    if not found:
        return "no fits"
    over = np.array([each.overshoot for each in found])
    usual = np.median(1.0 / np.maximum(over, 1e-12))
    below = int((over > 1.0).sum())
    return f"{len(found)} fits, too small {below} times, by {over.max():.2f}; median {usual:.1f}"


def main() -> None:
    found = []
    for each in outcomes(map(Path, sys.argv[1:]) if sys.argv[1:] else CASES):
        found.append(each)
        line = f"{each.overshoot:9.2e} {each.estimate:.1e} {each.solves:5d} {each.asked}"
        sys.stdout.write(f"{line} {each.modes} {each.name}\n")
    for asked in ("accuracy", "solves"):
        own = [one for one in found if one.asked.startswith(asked)]
        for axes in (" design", " pose", " x box", " box x box"):
            sys.stdout.write(f"{asked}{axes} {summary([one for one in own if axes in one.name])}\n")
        sys.stdout.write(f"{asked} {summary(own)}\n")


if __name__ == "__main__":
    main()
