"""What gives way under forces at nodes and the weight, against dense solves and differences."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calibration import Floats
from chains import model_of
from large import large_model
from rungs import derivative
from spatial_random import random_open
from weighed_draws import weighed

from eigassign import load_case
from eigassign.mechanism import shapes
from eigassign.modal import Flexibility, Model, compliances, sag_of_nodes, sags

CASES = Path(__file__).parents[2] / "cases"
SHIPPED = sorted(path.stem for path in CASES.glob("*.yaml"))
FREE = 1e-9  # of a force: more of it on a free joint moves that


def seeds(few: int, all_: int) -> list[Any]:
    """The first few in every run, the others in long ones."""
    more = (pytest.param(seed, marks=pytest.mark.slow) for seed in range(few, all_))
    return [*range(few), *more]


def on_unknowns(model: Model, x: Floats, node: str, axes: int) -> Floats:
    """b (n, axes, n_dof): how each unknown moves the node, by the shapes that are drawn."""
    eye = np.tile(np.eye(model.n_dof), (len(x), 1, 1))
    found = (one.nodes for one in shapes(model.poses, x, eye))
    link, _, name = node.partition(".")
    return np.array([own[link, name].motion[:, :axes].T for own in found])


def nodes_of(model: Model) -> list[str]:
    """Where bodies are."""
    return sorted({body.at for body in model.poses.case.mechanism.bodies.values()})


def check(model: Model, q: Floats, y: Floats, node: str) -> int:
    """Compare with dense solves; return the number of samples and directions that give way."""
    x = model.x(q, y)
    axes = 2 if model.poses.case.mechanism.space == "planar" else 3
    found = compliances(model, {node: np.eye(axes).tolist()})
    c = found.at(x, np.zeros(x.shape[1], dtype=bool))[0]
    b, E, F = on_unknowns(model, x, node, axes), model.pencil.elastic, model.pencil.rigid
    count = 0
    for k, own in enumerate(x):
        K = model.matrices(own[: len(model.q_names)], own[len(model.q_names) :])[1][np.ix_(E, E)]
        for j in range(axes):
            if np.abs(b[k, j, F]).max(initial=0.0) > FREE * np.abs(b[k, j]).max(initial=0.0):
                assert c[k, j] == np.inf
                continue
            exact = b[k, j, E] @ np.linalg.solve(K, b[k, j, E])
            # what almost nothing gives way to is a difference of what does
            size = np.abs(c[k][np.isfinite(c[k])]).max()
            assert abs(c[k, j] - exact) <= 1e-9 * max(exact, 1e-3 * size)
            count += 1
    return count


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize("few", [5, pytest.param(10**6, marks=pytest.mark.slow)])
def test_a_shipped_mechanism_gives_way_as_a_dense_solve_says(name: str, few: int) -> None:
    case = load_case(CASES / f"{name}.yaml")
    model, y = case.model(), case.initial_design
    q = case.trajectory.at(y)[0]
    q = q[:: max(1, len(q) // few)]
    for node in nodes_of(model)[:: 1 if few > 5 else 2]:
        check(model, q, y, node)
        if model.pencil.weight is not None:
            g = case.file.mechanism.gravity
            names, moved = sag_of_nodes(model, q, y, g)
            known = moved[:, names.index(node), : len(g)]
            x = model.x(q, y)
            found = sags(model, node).at(x, np.zeros(x.shape[1], dtype=bool))[0]
            np.testing.assert_allclose(found, known, rtol=1e-9, atol=1e-9 * np.abs(known).max())


def slopes_hold(found: Flexibility, x: Floats) -> None:
    """Slopes in every coordinate and parameter are those of differences."""
    everything = np.ones(len(x), dtype=bool)
    span = np.where(np.arange(len(x)) < found.pencil.n_q, 1e-3, 1e-3 * np.abs(x))
    span[span == 0.0] = 1e-6
    value, slopes = (each[0] for each in found.at(x[None], everything))
    there = np.isfinite(value)
    size = np.abs(value[there]).max(initial=0.0)

    def at(w: Floats) -> Floats:
        return np.asarray(found.at((x + w * span)[None], everything)[0][0, there])

    for j in range(len(x)):
        expected = derivative(at, np.eye(len(x))[[j]], value[there])
        # differences lose what K's condition number takes off the digits of the value
        np.testing.assert_allclose(
            slopes[there, j] * span[j], expected, rtol=1e-6, atol=1e-8 * size + 1e-24
        )


@pytest.mark.parametrize("seed", seeds(6, 60))
def test_slopes_under_weight_are_those_of_finite_differences(seed: int) -> None:
    """Of compliances and sags, with lengths that move the node, loops and springs."""
    drawn = weighed(seed, 1)
    if drawn is None:
        pytest.skip("falls either way")
    model, x = drawn.model, drawn.model.x(drawn.q0, drawn.y0)[0]
    node = ".".join(list(shapes(model.poses, x[None], np.zeros((1, model.n_dof, 1)))[0].nodes)[-1])
    axes = 2 if model.poses.case.mechanism.space == "planar" else 3
    for found in (compliances(model, {node: np.eye(axes).tolist()}), sags(model, node)):
        slopes_hold(found, x)


@pytest.mark.parametrize("name", ["two_link", "gantry", "arm_6r", "luffing_boom"])
def test_a_large_pencil_gives_way_like_a_small_one(name: str) -> None:
    """From one factorisation for all samples, and sample by sample where the weight acts."""
    case = load_case(CASES / f"{name}.yaml")
    model, y = case.model(), case.initial_design
    x = model.x(case.trajectory.at(y)[0][::10], y)
    wanted = np.ones(x.shape[1], dtype=bool)
    for node in nodes_of(model):
        axes = np.eye(2 if model.poses.case.mechanism.space == "planar" else 3).tolist()
        small, big = (
            compliances(each, {node: axes}).at(x, wanted) for each in (model, large_model(model))
        )
        for own, other in zip(small, big, strict=True):
            there = np.isfinite(own)
            assert np.array_equal(there, np.isfinite(other))
            size = np.abs(own[there]).max(initial=0.0)
            np.testing.assert_allclose(other[there], own[there], rtol=1e-8, atol=1e-9 * size)


@pytest.mark.parametrize("seed", seeds(4, 40))
@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_random_mechanisms_give_way_as_a_dense_solve_says(seed: int, space: str) -> None:
    tree, q = random_open(seed, space)
    model = model_of(tree)
    for node in nodes_of(model):
        check(model, np.atleast_2d(q), np.zeros(0), node)
