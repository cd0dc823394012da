"""Random sets of limits that contradict or do not: verdict, names and amounts by linear programs.

Parameters are added masses, so that the limit of the mass is linear in them as the others are.
"""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import linprog

from eigassign.case import parse
from eigassign.pipeline import Options, solve_case
from eigassign.study import BuiltCase

TEXT = (Path(__file__).parents[3] / "cases" / "two_link.yaml").read_text()
HEAD = TEXT.replace("samples: 152", "samples: 5").split("design: #")[0]
HEAD = HEAD.replace("elements: 4", "elements: 2").replace("elements: 3", "elements: 1")
HEAD = HEAD.replace("  bodies:", "  bodies:\n    hub: {at: upper_arm.start, mass: 0}\n    #")
TAIL = "expansion: {order: 2, q: [1.817, 5.312], y: auto, modes: [1]}\nassignment: {starts: 1}\n"
PATHS = {"hub": 0.2, "elbow_mass": 0.25, "tool_mass": 0.3}  # and upper bounds in kg
ARM = 1.995  # kg
TARGETS = ("{mode: 1, frequency: 190 Hz}", "{mode: 1, at_least: 150 Hz}")
CLEAR = 1e-4  # kg: where limits are this near to a contradiction, or to none, nothing is asserted


class Limits:
    """low ≤ C y ≤ high in kg by their names, that of the mass without the arm's own."""

    def __init__(self, seed: int) -> None:
        rng, self.top = np.random.default_rng(seed), np.array(list(PATHS.values()))
        count = int(rng.integers(1, 5))
        C = rng.choice([-1.0, 0.0, 0.5, 1.0, 2.0], (count, 3))
        C[~C.any(axis=1)] = 1.0
        self.names = [f"limit{k}" for k in range(count)]
        if rng.random() < 0.6:
            C, self.names = np.vstack([C, np.ones(3)]), [*self.names, "design.mass"]
        least, most = np.minimum(C, 0.0) @ self.top, np.maximum(C, 0.0) @ self.top
        edge = least + rng.uniform(-0.15, 1.15, len(C)) * (most - least)
        upper = rng.random(len(C)) < 0.5
        self.C, self.low = C, np.where(upper, -np.inf, edge)
        self.high = np.where(upper, edge, np.inf)

    def yaml(self) -> str:
        """The section design of a case file."""
        lines = ["design:"]
        for k, (body, most) in enumerate(PATHS.items()):
            lines.append(f"  m{k}: {{parameter: bodies.{body}.mass, min: 0, max: {most!r}}}")
        rows = []
        for name, row, low, high in zip(self.names, self.C, self.low, self.high, strict=True):
            side, edge = ("max", float(high)) if np.isfinite(high) else ("min", float(low))
            if name == "design.mass":
                lines.append(f"  mass: {{{side}: {max(edge + ARM, 1e-3)!r}}}")
                continue
            terms = ", ".join(f"m{k}: {float(c)!r}" for k, c in enumerate(row) if c)
            rows.append(f"    {name}: {{terms: {{{terms}}}, {side}: {edge!r}}}")
        return "\n".join([*lines, *(["  constraints:", *rows] if rows else []), ""])

    def gap(self, some: list[int]) -> float:
        """The least by which some of the limits must be missed, in kg; negative: room for all."""
        C, low, high = self.C[some], self.low[some], self.high[some]
        A = np.vstack([C[np.isfinite(high)], -C[np.isfinite(low)]])
        b = np.append(high[np.isfinite(high)], -low[np.isfinite(low)])
        found = linprog(
            [0.0, 0.0, 0.0, 1.0], np.hstack([A, -np.ones((len(A), 1))]), b,
            bounds=[*((0.0, most) for most in self.top), (-10.0, 10.0)],
        )  # fmt: skip
        return float(found.x[3])

    def extreme(self, k: int) -> float:
        """The amount of the most extreme design within the bounds, towards the limit."""
        parts = (np.minimum if np.isfinite(self.high[k]) else np.maximum)(self.C[k], 0.0)
        return float(parts @ self.top)


@pytest.mark.parametrize(
    "seed", [pytest.param(k, marks=() if k < 12 else pytest.mark.slow) for k in range(300)]
)
def test_limits_are_said_to_contradict_where_they_do(seed: int) -> None:
    limits = Limits(seed)
    text = HEAD + limits.yaml() + TAIL + f"targets:\n  - {TARGETS[seed % 2]}\n"
    case = BuiltCase(parse(text.encode(), "case.yaml"))
    result = solve_case(case, Options(use_cache=False, study="none"))
    row, y = result.results.assignment, np.array(list(result.design.values()))
    gap, amounts = limits.gap(list(range(len(limits.names)))), limits.C @ y
    said = {one.name: one for one in row.limits}
    own = {name: ARM if name == "design.mass" else 0.0 for name in limits.names}
    for k, name in enumerate(limits.names):
        assert said[name].optimal == pytest.approx(amounts[k] + own[name], abs=1e-6)
    if gap < -CLEAR:
        assert row.verdict != "infeasible", row.reason
        assert row.conflict == ()
        assert all(one.satisfied for one in row.limits)
    elif gap > CLEAR:
        assert row.verdict == "infeasible", row.reason
        named = [limits.names.index(name) for name in row.conflict]
        assert limits.gap(named) > 0.0
        for k in named:  # none of them could be left out
            assert limits.gap([other for other in named if other != k]) < CLEAR
        broken = [one for one in row.limits if not one.satisfied]
        assert broken
        for one in broken:
            assert one.stated in row.reason
            k = limits.names.index(one.name)
            if one.extreme is not None:
                assert one.extreme == pytest.approx(limits.extreme(k) + own[one.name], abs=1e-6)
            else:
                assert limits.gap([k]) < CLEAR
