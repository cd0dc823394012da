"""Stated mesh errors of random mechanisms at all corners of their design boxes: none too small."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from meshes import ROUND_OFF, mesh
from tapers import figures, judged, judged_reduced

SEEDS = 230
FACTOR = 1.01  # of tapers; see docs/accuracy.md


@pytest.mark.slow
def test_random_tapers_of_few_elements_keep_what_they_state() -> None:
    for each in map(judged, range(200)):
        assert (each.true <= each.stated + each.round_off).all(), each.seed


@pytest.mark.parametrize(
    "seeds", [range(6), pytest.param(range(550), marks=pytest.mark.slow)], ids=len
)
def test_meshes_and_reductions_of_links_together_keep_what_they_state(seeds: range) -> None:
    """A mode of reduced links is stiffer than the mesh's: its shape is not that of the mesh."""
    found = [each for each in map(judged_reduced, seeds) if each is not None]
    sys.stdout.write(figures(found) + "\n")
    for each in found:
        assert (each.true <= each.stated + each.round_off).all(), each.seed
    stated = np.concatenate([each.stated for each in found])
    assert np.isfinite(stated).mean() > 0.75


@pytest.mark.slow
def test_random_meshes_keep_what_they_state() -> None:
    found = [each for each in map(mesh, range(SEEDS)) if each is not None]
    answered = [each for each in found if each.refused is None]
    assert len(found) >= 200
    for each in answered:
        assert (each.true <= FACTOR * each.stated + ROUND_OFF).all(), each.seed
        if each.promised is not None:
            assert (each.true <= FACTOR * each.promised).all(), each.seed
    true, stated = (
        np.concatenate([getattr(e, k).ravel() for e in answered]) for k in ("true", "stated")
    )
    known = np.isfinite(stated)
    counts = known & (true > 10.0 * ROUND_OFF)
    over = stated[counts] / true[counts]
    assert np.median(over) < 1.1
    below = known & (true > stated + ROUND_OFF)
    worst = (true[below] / stated[below]).max(initial=1.0)
    sys.stdout.write(
        f"{len(found)} meshes, {sum(e.promised is not None for e in found)} of them chosen, "
        f"{len(found) - len(answered)} refused; {len(true)} numbers, {(~known).sum()} not stated, "
        f"{below.sum()} below the true error, by {worst:.3f} at most; "
        f"overestimate {np.median(over):.3f}, {np.percentile(over, 90):.2f} in 90 %\n"
    )
