"""Elements left to auto: the error of a mesh is not underestimated, and a bad mesh is refused."""

from __future__ import annotations

import numpy as np
import pytest
from paper_arm import FREE, build, exact, samples

from eigassign.errors import AccuracyError
from eigassign.modal import cheapest, meshes


@pytest.fixture(scope="module")
def x() -> np.ndarray:
    return samples()[::4]


def test_a_fixed_mesh_that_is_too_coarse_is_refused_with_its_worst_link(x):
    said = r"2 elements: mode 1 at most 0\.4 % too high: give more elements to upper"
    with pytest.raises(AccuracyError, match=said):
        cheapest(meshes(build, {"upper": 2, "fore": 2}, x, 1e-4), 1e-4)


def test_the_choice_is_as_good_as_it_says(x):
    found = cheapest(meshes(build, FREE, x, 1e-4, lambda _model, _x: (1, 2)), 1e-4)
    true = exact(build({"upper": 40, "fore": 40}), x, (1, 2))
    error = exact(build(found.elements), x, (1, 2)) / true - 1.0
    assert (error.max(axis=0) <= found.error).all()
    assert found.error.max() <= 1e-4 < 10.0 * error.max()


def test_a_mesh_that_round_off_forbids_is_refused(x):
    with pytest.raises(AccuracyError, match="round-off"):
        cheapest(meshes(build, FREE, x, 1e-13), 1e-13)
