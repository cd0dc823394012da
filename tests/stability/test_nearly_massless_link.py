"""A mass ratio of 1e8: 0.3 g a metre of link carries up to 40 kg."""

from __future__ import annotations

import numpy as np
import pytest
from chains import bar, model_of
from stress import case, judged

from eigassign.errors import MechanismError
from eigassign.modal import expand, reduce

M = np.linspace(5.0, 40.0, 15)[:, None]
POSE = [0.0, 1.0]


def test_expansion_and_reduced_model_know_their_errors():
    model = case("massless_link").model()
    expansion = expand(model.pencil, POSE, [20.0], (1, 2), order=6)
    reduced = reduce(model.pencil, POSE, [20.0], (1, 2), 2)
    judged(model, expansion, POSE, M)
    assert judged(model, reduced, POSE, M).max() < 1e-7


def test_a_cantilever_of_almost_no_mass_is_a_spring_with_a_mass():
    """f = √(3EI/(L³m))/2π; the link's own mass changes it by less than its share, 1e-8."""
    tree = bar(4, 0.5, 70e9, 1e-4, {"area": 3e-4, "bending_inertia": 8e-9})
    tree["mechanism"]["bodies"] = {"load": {"at": "bar.end", "mass": 1.5}}
    f = model_of(tree).frequencies([], [], 1)[0, 0]
    assert f == pytest.approx(np.sqrt(3 * 70e9 * 8e-9 / 0.5**3 / 1.5) / (2 * np.pi), rel=1e-7)


def test_no_mass_at_all_on_a_free_joint_is_refused_by_name():
    tree = bar(2, 0.5, 70e9, 0.0, {"area": 3e-4, "bending_inertia": 8e-9}, root="revolute")
    with pytest.raises(MechanismError, match="moves no mass"):
        model_of(tree).frequencies([0.0], [], 1)


def test_more_modes_than_have_mass_are_refused_by_name():
    tree = bar(2, 0.5, 70e9, 0.0, {"area": 3e-4, "bending_inertia": 8e-9})
    tree["mechanism"]["bodies"] = {"load": {"at": "bar.end", "mass": 1.5}}
    model = model_of(tree)
    assert model.frequencies([], [], 2).shape == (1, 2)
    with pytest.raises(MechanismError, match="only 2 modes whose mass is more"):
        model.frequencies([], [], 3)
    assert judged(model, reduce(model.pencil, [], [], (1,)), [], []).max() < 1e-10
