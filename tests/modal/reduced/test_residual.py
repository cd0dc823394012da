"""The residual of a Ritz pair by small arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from large import DRIVES, Q0, Y0, arm, large

from eigassign.mechanism import factorise
from eigassign.modal import residual_terms, ritz_basis


@pytest.mark.parametrize("drives", DRIVES, ids=str)
def test_residuals_have_the_same_size_from_unit_and_from_chosen_vectors(
    drives: tuple[Any, Any],
) -> None:
    """From half a solve with a basis of the residuals' span, against L⁻¹ B_j."""
    pencil = arm(drives).pencil
    basis = ritz_basis(pencil, np.concatenate([Q0, Y0])[None], (1,), 2, True, None)
    given = basis.K0, factorise(basis.K0), basis.wide
    right, found = (residual_terms(each, *given) for each in (pencil, large(pencil)))
    np.testing.assert_array_equal(found.stiffness_terms, right.stiffness_terms)
    np.testing.assert_array_equal(found.mass_terms, right.mass_terms)
    rng = np.random.default_rng(5)
    for a, b in ((found.stiffness, right.stiffness), (found.mass, right.mass)):
        # any combination of the terms, applied to any vector, has the same length
        coefficients = rng.standard_normal((30, len(b), b.shape[2]))
        lengths = [
            np.linalg.norm(np.einsum("tak,stk->sa", r, coefficients), axis=1) for r in (a, b)
        ]
        np.testing.assert_allclose(*lengths, rtol=1e-6)
