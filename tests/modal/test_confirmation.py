"""One wrong coefficient, however high its order, is seen; an undamaged expansion is confirmed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from chains import model_of, two_link

from eigassign.errors import UsageError
from eigassign.modal import (
    Expansion,
    ExpansionRequest,
    expand,
    reduce,
    reduced_arrays,
    reduced_from_arrays,
    unlike,
)

Q0, Y0, ORDER = np.array([1.817, 5.312]), np.array([0.125, 0.125]), 4


def changed(expansion: Expansion, k: int) -> Expansion:
    coefficients = expansion.clusters[0].coefficients.copy()
    coefficients[0, 0, k] *= 1.0 + 1e-4
    cluster = replace(expansion.clusters[0], coefficients=coefficients)
    return replace(expansion, clusters=(cluster,))


@pytest.mark.parametrize("linear", [False, True])
def test_every_coefficient_counts(linear: bool) -> None:
    pencil = model_of(two_link()).pencil
    true = expand(pencil, Q0, Y0, (1,), ORDER, linear_in_y=linear)
    wanted = ExpansionRequest(np.concatenate([Q0, Y0]), (1,), 1e-3, ((ORDER, linear),))
    assert unlike(pencil, (true,), wanted) is None
    for k in np.flatnonzero(np.abs(true.clusters[0].coefficients[0, 0]) > 1.0):
        assert unlike(pencil, (changed(true, int(k)),), wanted) is not None, true.space.indices[k]
    for k in range(len(true.vector_space)):
        X = true.vectors[0].copy()
        X[k, np.abs(X[k, :, 0]).argmax()] *= 1.01
        assert unlike(pencil, (replace(true, vectors=(X,)),), wanted) is not None


def test_every_term_of_a_stored_reduced_model_counts() -> None:
    true = reduce(model_of(two_link()).pencil, Q0, Y0, (1,), 1)
    for name in ("stiffness", "mass"):
        terms = getattr(true, name)
        for k in range(len(terms)):
            spoiled = terms.copy()
            at = np.unravel_index(np.abs(np.tril(terms[k])).argmax(), terms[k].shape)
            spoiled[(k, *at)] *= 1.0 + 1e-4
            arrays = reduced_arrays(true)
            size, start = terms.size, _place(arrays["numbers"], terms)
            arrays["numbers"] = arrays["numbers"].copy()
            arrays["numbers"][start : start + size] = spoiled.ravel()
            with pytest.raises(UsageError, match="does not answer as it did"):
                reduced_from_arrays(arrays)


def _place(numbers: np.ndarray, terms: np.ndarray) -> int:
    flat = terms.ravel()
    starts = np.flatnonzero(numbers[: len(numbers) - len(flat) + 1] == flat[0])
    return next(int(s) for s in starts if (numbers[s : s + len(flat)] == flat).all())
