"""Large pencils: sparse and dense algebra say the same, and memory stays with the vectors."""

from __future__ import annotations

import itertools
import tracemalloc
from typing import Any

import numpy as np
import pytest
from large import DRIVES, Q0, Y0, arm, large

from eigassign.modal import Expansion, expand


def agree(thin: Expansion, full: Expansion, tolerance: float) -> None:
    """Coefficients and vectors, relative to the largest of their degree or kind."""
    starts = full.space.degree_starts
    for a, b in zip(thin.clusters, full.clusters, strict=True):
        assert a.modes == b.modes
        for first, last in itertools.pairwise(starts):
            right = b.coefficients[..., first:last]
            wrong = np.abs(a.coefficients[..., first:last] - right).max()
            assert wrong <= tolerance * np.abs(right).max()
        largest = np.abs(b.vectors).max()
        np.testing.assert_allclose(a.vectors, b.vectors, atol=10 * tolerance * largest)


@pytest.mark.parametrize("drives", DRIVES, ids=str)
@pytest.mark.parametrize("linear", [False, True])
def test_every_kind_of_drive_is_expanded_sparsely_to_the_same_series(
    drives: tuple[Any, Any], linear: bool
) -> None:
    pencil = arm(drives).pencil
    thin, full = (expand(each, Q0, Y0, (1, 2), 4, linear) for each in (large(pencil), pencil))
    # round-off of K0 itself: 1e-16 (elements)^4 times its stiffest over its softest, ~1e-9
    agree(thin, full, 1e-8)


def test_clusters_are_expanded_sparsely_to_the_same_series() -> None:
    pencil = arm().pencil
    thin, full = (
        expand(each, Q0, Y0, (1, 5), 5, cluster_gap=0.5) for each in (large(pencil), pencil)
    )
    assert [c.modes for c in full.clusters] == [(1,), (4, 5, 6)]
    agree(thin, full, 1e-8)


def test_no_array_of_unknowns_times_coefficients_is_ever_stored() -> None:
    pencil = arm(elements=(500, 400)).pencil
    expand(pencil, Q0, Y0, (1,), 2)
    tracemalloc.start()
    found = expand(pencil, Q0, Y0, (1,), 9)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    vectors = found.clusters[0].vectors.nbytes
    assert len(found.space) > 6 * len(found.vector_space)
    assert peak < 6 * vectors
    assert peak < pencil.n_dof * len(found.space) * 8
