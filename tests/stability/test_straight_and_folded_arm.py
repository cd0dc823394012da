"""Straight and folded, an arm's joint angles have no derivative with respect to its tip."""

from __future__ import annotations

import numpy as np
import pytest
from chains import model_of, two_link
from stress import case, judged

from eigassign.errors import CaseError
from eigassign.modal import expand, reduce

Y0 = np.array([0.125, 0.125])


def test_a_tip_path_out_of_reach_is_refused_at_its_sample():
    with pytest.raises(
        CaseError, match=r"straight_arm\.yaml:\d+:\d+: .*sample \d+ .* out of reach"
    ):
        _ = case("straight_arm").trajectory


@pytest.mark.parametrize("elbow", [0.0, np.pi])
def test_in_joint_coordinates_the_pose_is_like_any_other(elbow):
    """By symmetry the frequency is even in the elbow angle there: odd coefficients vanish."""
    model = model_of(two_link(angles=("relative", "relative")))
    q0 = [0.3, elbow]
    expansion = expand(model.pencil, q0, Y0, (1, 2), order=6)
    q = np.array(q0) + np.column_stack([np.zeros(9), np.linspace(-0.2, 0.2, 9)])
    assert judged(model, expansion, q, Y0).max() < 1e-4
    odd = expansion.indices[:, 1] % 2 == 1
    scale = np.abs(expansion.coefficients).max()
    assert np.abs(expansion.coefficients[:, odd]).max() < 1e-7 * scale
    reduced = reduce(model.pencil, q0, Y0, (1, 2), 2)
    assert judged(model, reduced, q, Y0).max() < 1e-8
