"""The ERLS pencil against a frame assembled plainly in global coordinates (frame_oracle.py).

Both are the same discretisation in other unknowns, so the spectra agree to round-off: 1e-9 leaves
room for the condition number of the lowest modes of a few elements.
"""

from __future__ import annotations

import numpy as np
import pytest
from chains import model_of, random_chain, two_link
from frame_oracle import frame

from eigassign.errors import UsageError


@pytest.mark.parametrize("seed", range(60))
def test_random_chains_have_the_spectrum_of_the_global_frame(seed: int) -> None:
    tree, q = random_chain(seed)
    model, oracle = model_of(tree), frame(tree, q)
    count = min(6, model.n_dof - model.n_rigid)
    assert model.n_rigid == oracle.n_free
    lam = (2.0 * np.pi * model.frequencies(q, [], count)[0]) ** 2
    np.testing.assert_allclose(lam, oracle.eigenvalues(count), rtol=1e-9)


@pytest.mark.parametrize("seed", range(60))
def test_the_unknowns_span_exactly_the_admissible_motions(seed: int) -> None:
    tree, q = random_chain(seed)
    model, oracle = model_of(tree), frame(tree, q)
    rank = np.linalg.matrix_rank(oracle.constraints)
    assert model.n_dof == len(oracle.K) - rank


def test_more_modes_than_there_are_is_refused() -> None:
    model = model_of(two_link())
    assert model.frequencies([0.1, 0.2], [0.0, 0.0], 21).shape == (1, 21)
    with pytest.raises(UsageError, match="22 modes"):
        model.frequencies([0.1, 0.2], [0.0, 0.0], 22)
