"""Elements left to auto: the error of a mesh is not underestimated, and a bad mesh is refused."""

from __future__ import annotations

import numpy as np
import pytest
from paper_arm import FREE, build, exact, samples

from eigassign.errors import AccuracyError
from eigassign.modal.adaptive.mesh import choose_mesh, mesh_error


@pytest.fixture(scope="module")
def x() -> np.ndarray:
    return samples()


def test_a_fixed_mesh_that_is_too_coarse_is_refused(x):
    with pytest.raises(AccuracyError, match=r"the mesh leaves .* mode 1 moves 0.36 % with 4"):
        choose_mesh(build, {"upper": 2, "fore": 2}, x, 1e-4)


def test_the_mesh_error_is_not_below_the_true_one(x):
    true = exact(build({"upper": 40, "fore": 40}), x, (1, 2, 3))
    for n in (2, 3, 5, 8):
        elements = {"upper": n, "fore": n}
        error = np.abs(exact(build(elements), x, (1, 2, 3)) / true - 1.0)
        estimate = mesh_error(build, elements, x, (1, 2, 3))
        assert (estimate >= error).all()
        assert np.median(estimate / error) < 2.0


def test_a_mesh_that_round_off_forbids_is_refused(x):
    with pytest.raises(AccuracyError, match="round-off"):
        choose_mesh(build, FREE, x, 1e-13)
