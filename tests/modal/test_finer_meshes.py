"""What a mesh leaves out, measured by finer ones: not below the true error, and near it."""

from typing import Any

import numpy as np
import pytest
from chains import Tree, case_of, model_of
from spatial_cases import linkage
from spatial_examples import gantry

from eigassign import Case
from eigassign.mechanism import refined
from eigassign.study import build_model

FINE = 24.0


def cantilever(n: int, space: str = "spatial", **beam: object) -> Tree:
    ends = {"shape": "rectangle", "width": 0.03, "height": 0.05}
    return linkage(
        {"bar": {"length": 0.6, "material": "m", "elements": n, **beam}},
        {"root": {"type": "fixed", "base": "ground", "follower": "bar.start"}},
        sections={"a": ends, "b": {**ends, "width": 0.02, "height": 0.02}},
        material={"youngs_modulus": 7e10, "density": 2.7e3, "poissons_ratio": 0.33},
        space=space,
    )


def stated_over_true(case: Case, q: Any, modes: tuple[int, ...]) -> np.ndarray:
    """The stated error of each mode over the true one, by a mesh `FINE` times as fine."""
    model, fine = case.model(), build_model(refined(case.file, FINE)[0])
    pick = np.array(modes) - 1
    hz, right = (each.frequencies(q, [], max(modes))[0, pick] for each in (model, fine))
    error = hz / right - 1.0
    assert (error > 1e-6).all()
    return np.asarray(model.discretisation_error(q, [], modes)[0] / error)


@pytest.mark.parametrize("shear", [False, True])
@pytest.mark.parametrize("section", ["a", {"start": "a", "end": "b"}])
@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_a_clamped_beam_is_stated_above_its_error_and_within_half_of_it(
    n: int, section: object, shear: bool
) -> None:
    found = stated_over_true(case_of(cantilever(n, section=section, shear=shear)), [], (1, 2, 3, 4))
    assert (found >= 1.0).all()
    assert (found < 1.5).all()


@pytest.mark.parametrize("n", [1, 2, 3])
def test_a_carriage_on_a_girder_whose_two_meshes_may_be_alike(n: int) -> None:
    tree = gantry("free")
    for link in tree["mechanism"]["links"].values():
        if link.get("elements"):
            link["elements"] = n
    found = stated_over_true(case_of(tree), [0.6], (1, 2, 3))
    assert (found >= 1.0).all()
    assert (found < 1.5).all()


def test_where_a_finer_mesh_buckles_the_error_is_not_known() -> None:
    tree = cantilever(1, "planar", section="a")
    EI, weight = 7e10 * 0.03 * 0.05**3 / 12.0, 2.7e3 * 0.03 * 0.05
    load = 7.8373 * EI / 0.6**3 / weight  # of a column under its weight
    for share, known in ((0.5, True), (1.0005, False)):
        tree["mechanism"]["gravity"] = [-share * load, 0.0]
        found = model_of(tree).discretisation_error([], [], (1,))[0, 0]
        assert np.isfinite(found) == known


def test_of_a_fine_mesh_round_off_of_a_finer_one_is_not_stated() -> None:
    case = case_of(cantilever(200, "planar", section="a"))
    assert (case.model().discretisation_error([], [], (1, 2))[0] < 1e-7).all()
    found = stated_over_true(case_of(cantilever(16, section="a", shear=True)), [], (3, 4))
    assert (found >= 1.0).all()
    assert (found < 6.0).all()  # bending: the rate is 16 and not 4


def test_rigid_links_have_no_mesh() -> None:
    tree = cantilever(1, "planar", section="a")
    tree["mechanism"]["links"]["bar"] = {"type": "rigid", "mass": 1.0, "inertia": 0.1}
    tree["mechanism"]["joints"]["root"]["type"] = "revolute"
    tree["coordinates"] = {"q": {"joint": "root", "drive": {"stiffness": 100.0}}}
    assert model_of(tree).discretisation_error([0.0], [], (1,)).tolist() == [[0.0]]
