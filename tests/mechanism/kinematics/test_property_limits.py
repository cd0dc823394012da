"""Values that no mechanism can have are refused, whoever gives them."""

from typing import Any

import numpy as np
import pytest
from chains import Tree, case_of, two_link

import eigassign as ea
from eigassign.errors import CaseError, UsageError
from eigassign.modal import Model

SECTIONS: dict[str, Tree] = {
    "tube": {"shape": "tube", "outer_diameter": 0.03, "thickness": 0.003},
    "bored": {"shape": "tube", "outer_diameter": 0.03, "inner_diameter": 0.02},
    "flat": {"shape": "rectangle", "width": 0.03, "height": 0.02},
    "box": {"shape": "box", "width": 0.03, "height": 0.02, "thickness": 0.002},
    "round": {"shape": "circle", "diameter": 0.03},
    "profile": {
        "shape": "i_profile",
        "height": 0.04,
        "width": 0.03,
        "flange_thickness": 0.004,
        "web_thickness": 0.003,
    },
}


def varied(path: str, low: float, high: float, section: str | None = None) -> Model:
    """The paper's arm with one design parameter."""
    tree = two_link(tip_inertia=1e-3, masses=(0.1, 0.1))
    m: dict[str, Any] = tree["mechanism"]
    if section is not None:
        m["sections"]["rod"] = SECTIONS[section]
    m["springs"] = {"s": {"between": ["fore.end", "ground"], "translational": 10.0}}
    tree["coordinates"]["q2"]["drive"] = {"stiffness": 1000.0, "inertia": 0.01}
    tree["design"] = {"p": {"parameter": path, "min": low, "max": high}}
    return case_of(tree).model()


@pytest.mark.parametrize(
    ("path", "low", "high", "section", "wrong"),
    [
        ("bodies.elbow_mass.mass", 0.0, 1.0, None, (-0.1, -5.0)),
        ("bodies.tool_mass.inertia", 0.0, 1.0, None, (-0.01,)),
        ("materials.al.density", 1000.0, 4000.0, None, (-100.0,)),
        ("materials.al.youngs_modulus", 1e9, 1e11, None, (0.0, -1e9)),
        ("links.upper.length", 0.1, 1.0, None, (0.0, -0.3)),
        ("coordinates.q2.drive.stiffness", 10.0, 1e4, None, (0.0, -100.0)),
        ("coordinates.q2.drive.inertia", 0.0, 1.0, None, (-0.01,)),
        ("springs.s.translational", 1.0, 1e4, None, (-1.0,)),
        ("sections.rod.thickness", 1e-3, 1e-2, "tube", (0.0, -1e-3, 0.0151)),
        ("sections.rod.outer_diameter", 0.02, 0.05, "tube", (-0.03, 5e-3)),
        ("sections.rod.inner_diameter", 0.01, 0.025, "bored", (0.03, 0.04)),
        ("sections.rod.height", 0.01, 0.05, "flat", (-0.03,)),
        ("sections.rod.diameter", 0.01, 0.05, "round", (-0.03,)),
        ("sections.rod.thickness", 1e-3, 8e-3, "box", (0.0, 0.0081)),
        ("sections.rod.width", 0.01, 0.05, "box", (0.0049,)),
        ("sections.rod.web_thickness", 1e-3, 5e-3, "profile", (0.031,)),
        ("sections.rod.flange_thickness", 1e-3, 5e-3, "profile", (0.02,)),
    ],
)
def test_a_value_that_no_mechanism_can_have_is_refused(path, low, high, section, wrong):
    """A negative mass, a diameter or a wall gave frequencies as if nothing were wrong."""
    model, pose = varied(path, low, high, section), [0.5, 1.0]
    for value in (low, high):
        assert np.isfinite(model.frequencies(pose, [value], 2)).all()
    for value in wrong:
        asks = [
            lambda y: model.frequencies(pose, y, 2),
            lambda y: model.frequencies(pose, [[low], y], 2),
            lambda y: model.modes(pose, y, 2),
            lambda y: model.shapes(pose, y, 2),
            lambda y: ea.expand(model, pose, y, order=2),
            lambda y: ea.reduce(model, pose, y),
        ]
        for ask in asks:
            with pytest.raises(UsageError, match=rf"no mechanism has p = .*{path.split('.')[-1]}"):
                ask([value])
    if path == "bodies.elbow_mass.mass":
        with pytest.raises(UsageError, match=r"p = -1 kg: bodies.elbow_mass.mass must be >= 0 kg"):
            model.mass([-1.0])


def test_round_off_of_a_limit_is_no_value_beyond_it():
    model = varied("bodies.elbow_mass.mass", 0.0, 1.0)
    at_limit = model.frequencies([0.5, 1.0], [0.0], 2)
    np.testing.assert_allclose(model.frequencies([0.5, 1.0], [-1e-12], 2), at_limit, rtol=1e-9)


def test_a_trajectory_cannot_set_one_either():
    tree = two_link(masses=(0.1, 0.1))
    tree["trajectory"] = [
        {
            "duration": 1.0,
            "q": [[0.0, 1.0], [0.0, 1.5]],
            "set": {"bodies.tool_mass.mass": -5.0},
        }
    ]
    tree["design"] = {}
    with pytest.raises(CaseError, match="must be >= 0 kg, got -5"):
        case_of(tree)
    tree["trajectory"][0]["set"] = {"bodies.tool_mass.mass": 5.0}
    model = case_of(tree).model()
    with pytest.raises(UsageError, match=r"no mechanism has bodies\.tool_mass\.mass = -5 kg"):
        model.frequencies([0.0, 1.0, -5.0], [], 2)
