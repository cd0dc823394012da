"""A limit of a drive's torque holds between samples too: one link on a motor, in closed form."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eigassign as ea
from eigassign.case import parse
from eigassign.mechanism import timing_law

CASE = Path(__file__).with_name("torque_limits_case.txt").read_text(encoding="utf-8")
PER_LENGTH = 7850.0 * np.pi / 4.0 * (0.06**2 - 0.054**2)  # kg/m
FAULT = {
    **{"gravity": "none", "length": 0.8, "mass": 9.0, "start": 0.0, "end": 2.0, "duration": 1.0},
    **{"samples": 11, "timing": "quintic", "torque": 80.0, "target": "{mode: 1, at_most: 12 Hz}"},
}


def peak(drawn: dict[str, Any], mass: float) -> float:
    """The largest |J q̈ + (m + ρAL/2) g L cos q| in N m of 20 001 instants."""
    L, T, law = drawn["length"], drawn["duration"], timing_law(drawn["timing"])
    tau, way = np.linspace(0.0, 1.0, 20_001), drawn["end"] - drawn["start"]
    link, g = PER_LENGTH * L, 0.0 if drawn["gravity"] == "none" else 9.81
    inertia, lever = (link / 3.0 + mass) * L**2, (link / 2.0 + mass) * L
    q = drawn["start"] + law.value(tau)[:, 0] * way
    torque = inertia * law.value(tau, 2)[:, 0] * way / T**2 + lever * g * np.cos(q)
    return float(np.abs(torque).max())


def answer(drawn: dict[str, Any]) -> tuple[str, float]:
    """The verdict, and the mass in kg."""
    result = ea.assign(ea.Case(parse(CASE.format(**drawn).encode(), "case.yaml")))
    (row,) = result.results.drives
    mass = result.design["tool"]
    np.testing.assert_allclose(row.optimal.peak, peak(drawn, mass), rtol=1e-3)
    return result.results.assignment.verdict, mass


def test_a_peak_between_eleven_samples_is_no_torque_that_is_kept() -> None:
    """Mode 1 at 12 Hz takes 14 kg and 90 N m, where differences of the samples told 79 N m."""
    verdict, _ = answer(FAULT)
    assert verdict == "infeasible"
    assert peak(FAULT, 14.0) > 90.0


@pytest.mark.parametrize("seed", range(50))
def test_no_limit_is_called_kept_that_is_missed_between_samples(seed: int) -> None:
    random = np.random.default_rng(seed)
    drawn = {
        "gravity": random.choice(["none", "[0.0, -9.81]"]),
        "length": float(10.0 ** random.uniform(-0.7, 0.3)),
        "mass": float(10.0 ** random.uniform(-1.0, 0.8)),
        "start": float(random.uniform(-3.0, 3.0)),
        "end": float(random.uniform(3.2, 6.0)),
        "duration": float(10.0 ** random.uniform(-0.5, 0.7)),
        "samples": int(random.integers(3, 12)),
        "timing": str(random.choice(["cubic", "quintic", "trapezoidal"])),
        "target": "{mode: 1, frequency: 0.1 Hz}",
    }
    least, most = peak(drawn, drawn["mass"]), peak(drawn, 14.0)
    drawn["torque"] = least + random.uniform(0.05, 0.95) * (most - least)
    verdict, mass = answer(drawn)
    assert verdict in ("improved", "unreachable")
    needed = peak(drawn, mass)
    assert needed <= 1.001 * drawn["torque"]
    assert needed >= 0.99 * drawn["torque"]  # and the limit, not caution, ends the search
