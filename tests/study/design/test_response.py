"""Frequencies along the trajectory and their slopes, as the assignment asks for them."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from redesigned_arms import cart, extrapolated

import eigassign as ea
from eigassign.pipeline import Stages, prepare
from eigassign.study import (
    ReducedModels,
    Scene,
    reduced_models,
    response_of,
)


def test_a_coordinate_that_rests_may_follow_the_design_all_the_same() -> None:
    scene = prepare(cart([[0.2, 0.3], [0.6, 0.3]], leaning=True), Stages(lambda line: None), None)
    assert np.ptp(scene.path.q[:, 1]) < 1e-12
    response, y = response_of(scene, 2), np.array([0.52])
    slopes = response(y).slopes
    beside = extrapolated(lambda v: response(v).hz, y, 1e-3)
    np.testing.assert_allclose(slopes, beside, rtol=1e-7)


@pytest.fixture(scope="module")
def fine(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """The paper's arm with a mesh of 363 unknowns."""
    data = yaml.safe_load(Path("cases/two_link.yaml").read_text(encoding="utf-8"))
    for link in data["mechanism"]["links"].values():
        link["elements"] = 60
    path = tmp_path_factory.mktemp("fine") / "fine.yaml"
    path.write_text(yaml.safe_dump(data), encoding="utf-8")
    return prepare(ea.load_case(path), Stages(lambda line: None), None)


def test_reduced_models_stand_for_exact_solves_of_large_models(fine: Scene) -> None:
    """At the initial design and far from it, where a second one may be made."""
    models, exact = reduced_models(fine), response_of(fine, 2)
    assert models is not None
    reduced = response_of(fine, 2, models=models)
    lower, upper = fine.bounds
    for y in (fine.initial, 0.05 * lower + 0.95 * upper):
        said, right = reduced(y), exact(y)
        np.testing.assert_allclose(said.hz, right.hz[:, :2], rtol=1e-5)
        slopes = right.slopes[:, :2]
        assert (np.abs(said.slopes - slopes) <= 1e-3 * np.abs(slopes).max(axis=0)).all()
    assert models.exact_solves == 2 * len(models.watched) == 4


def test_exact_solves_stand_in_where_no_reduced_model_may_be_made(fine: Scene) -> None:
    models = ReducedModels(fine.model, fine.path, left=0)
    reduced = response_of(fine, 1, models=models)
    right = response_of(fine, 1)(fine.initial)
    np.testing.assert_array_equal(reduced(fine.initial).hz, right.hz)
    assert reduced.exact_solves == len(fine.path.q)


def test_small_models_need_no_reduced_ones() -> None:
    scene = prepare(ea.load_case("cases/two_link.yaml"), Stages(lambda line: None), None)
    assert reduced_models(scene) is None
