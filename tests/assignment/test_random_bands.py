"""Random mechanisms that are to keep out of a band: what is called clear stays clear everywhere."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from random_assignments import load_text, random_case

import eigassign as ea
from eigassign.study import Band, prove_clear

SEEDS = range(200)
QUICK = (0,)
EACH = [pytest.param(k, marks=() if k in QUICK else pytest.mark.slow) for k in SEEDS]
INSTANTS = 5000


def banded(seed: int) -> tuple[ea.Case, float, float]:
    """A random case whose first or second mode is to leave a band that it is in at first."""
    rng = np.random.default_rng([seed, 23])
    text = random_case(seed)
    case = load_text(text)
    hz = case.model().frequencies(case.trajectory.q, case.initial_design, 2)
    edge = float(hz[:, rng.integers(2)].mean() * rng.uniform(0.97, 1.01))
    low, high = edge, edge * float(rng.uniform(1.005, 1.03))
    data = yaml.safe_load(text)
    data["targets"] = [{"keep_out": [low, high]}]
    data["assignment"] = {"starts": 1, "steps": 15}
    return load_text(yaml.safe_dump(data)), low, high


def along(case: ea.Case, q: np.ndarray, y: np.ndarray, low: float, high: float) -> np.ndarray:
    """At random instants, q linear in time between the samples: the modes below each edge."""
    at = np.random.default_rng(0).uniform(0, len(q) - 1, INSTANTS)
    between = np.column_stack([np.interp(at, np.arange(len(q)), column) for column in q.T])
    model = case.model()
    available = model.n_dof - model.n_rigid
    count = min(4, available)
    while True:
        hz = model.frequencies(between, y, count)
        if count == available or hz[:, -1].min() > high:
            return np.array([(hz < edge).sum(axis=1) for edge in (low, high)])
        count = min(2 * count, available)


@pytest.mark.parametrize("seed", EACH)
def test_an_answer_called_clear_is_clear_at_random_instants_and_a_forged_one_is_not(
    seed: int,
) -> None:
    """Forged: another number of modes below the band, or a band that a mode is in somewhere."""
    case, low, high = banded(seed)
    found = ea.assign(case)
    row, y = found.results.assignment, np.array(list(found.design.values()))
    assert row is not None
    if row.verdict == "reached":
        assert all(said.clear for said in row.clearances)
    model = case.model()
    for said, rows in zip(row.clearances, case.trajectory.rows, strict=True):
        q = case.trajectory.q[rows]
        edges = np.full(len(q), low), np.full(len(q), high)
        if not said.clear:
            continue
        assert (along(case, q, y, low, high) == said.below).all()
        for k in {said.below + 1, max(said.below - 1, 0)} - {said.below}:
            assert not prove_clear(model, Band("forged", q, *edges, k), y).clear
        hz = model.frequencies(q, y, said.below + 1)[:, said.below]
        wide = edges[0], np.full(len(q), hz.min() * (1.0 + 1e-9))
        assert not prove_clear(model, Band("forged", q, *wide, said.below), y).clear
