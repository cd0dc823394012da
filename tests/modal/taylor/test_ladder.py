"""The ladder: residual, slope, differences, 2m + 1, subsets, sparse algebra, estimate, oracle."""

import numpy as np
import pytest
from ladder_scenes import MADE, SHIPPED, Scene, scene
from large import large_model
from pencils import crossing
from rungs import derivative, residual, slope
from spatial_cases import changed
from spatial_oracle import Tree, world
from weight_oracle import weigh

from eigassign import reduce
from eigassign.case import plain
from eigassign.modal import eigenvalues, rounding_error

NAMES = [*SHIPPED, *MADE]
in_every_scene = pytest.mark.parametrize("name", NAMES)
in_every_case = pytest.mark.parametrize("name", SHIPPED)
HIGHER = [
    ("two_link", 5),
    ("two_link", 6),
    *((n, 5) for n in MADE if n not in ("branched", "portal")),
]


@in_every_scene
def test_the_recursion_leaves_no_residual_at_any_multi_index(name: str) -> None:
    s = scene(name)
    assert residual(s.pencil, s.x0, s.span, 3 if s.few else 2, (1, 2)).max() < 1e-12


def test_the_recursion_of_a_crossing_leaves_no_residual() -> None:
    assert residual(crossing(0.0), np.zeros(2), np.ones(2), 5, (1, 2)).max() < 1e-12


@pytest.mark.parametrize(
    ("name", "order"), [*((n, p) for n in NAMES for p in range(1, 5)), *HIGHER]
)
def test_the_truncation_error_falls_with_one_power_more_than_the_order(
    name: str, order: int
) -> None:
    s = scene(name)
    e = s.expand(order)
    assert e.clusters[0].modes == (1,)
    found = slope(s.pencil, e, s.span, s.floor)
    if found is not None:  # else a polynomial of this order, over the whole box
        assert found == pytest.approx(order + 1, abs=0.1)


@in_every_scene
def test_first_and_second_derivatives_are_those_of_exact_eigenvalues(name: str) -> None:
    s = scene(name)
    found = s.scaled(s.expand(2))
    centre = s.lam(np.zeros(len(s.x0)))
    rng = np.random.default_rng(2)
    for gamma in (g for g in found if sum(g) < 2 or s.few or rng.random() < 0.25):
        along = np.eye(len(s.x0))[np.repeat(np.arange(len(s.x0)), gamma)]
        expected = derivative(lambda w: s.lam(0.5 * w), along, centre) / centre
        np.testing.assert_allclose(
            found[gamma] * 0.5 ** sum(gamma),
            expected[0],
            atol=1e-7 + 100.0 * s.floor,
            err_msg=str(gamma),
        )


@pytest.mark.parametrize("name", ["loop", "slider", "spatial_arm", "portal"])
def test_first_derivatives_are_those_of_the_plain_frame_rebuilt(name: str) -> None:
    """The oracle is built anew for every value: a design parameter that reaches only part of the
    model, or a passive joint that does not follow a length, would show."""
    s = scene(name)
    e = s.expand(1)
    size = float(e.coefficients[0, 0])
    for k, width in enumerate(s.span):
        h = 4e-3 * width
        lam = [_moved(s, s.tree, k, step) for step in (h, -h)]
        at = np.flatnonzero((e.indices == np.eye(len(s.span), dtype=int)[k]).all(axis=1))
        found = float(e.coefficients[0, at[0]]) if len(at) else 0.0
        # differences: h² from truncation, 1e-10/1e-3 from round-off, of the change over the box
        expected = (lam[0] - lam[1]) / 8e-3
        assert found * width == pytest.approx(expected, rel=1e-4, abs=1e-6 * abs(size))


def _moved(s: Scene, tree: Tree, k: int, h: float) -> float:
    x, n_q = s.x0.copy(), s.pencil.n_q
    x[k] += h
    if k >= n_q:
        paths = [d["parameter"] for d in tree["design"].values()]
        tree = changed(tree, paths[k - n_q], float(x[k]))
    frame = world(tree, x[:n_q])
    frame.n_free = len(s.pencil.rigid)  # springs hold free coordinates too
    return float(frame.spectrum(1)[0])


@in_every_scene
def test_half_the_order_of_the_vectors_gives_the_whole_order_of_the_eigenvalue(name: str) -> None:
    s = scene(name)
    order = 5 if s.few else 3
    half = s.expand(order)
    assert half.vector_space.order == order // 2
    close(s.scaled(half), s.scaled(s.expand(order, vector_order=order)), s.floor)


@in_every_scene
def test_the_partially_linear_expansion_has_the_full_ones_coefficients(name: str) -> None:
    s = scene(name)
    order, n_q = 4 if s.few else 3, s.pencil.n_q
    full, part = s.scaled(s.expand(order)), s.scaled(s.expand(order, linear_in_y=True))
    assert set(part) == {g for g in full if sum(g[n_q:]) <= 1}
    close(part, {g: full[g] for g in part}, s.floor)


def close(a: dict[tuple[int, ...], float], b: dict[tuple[int, ...], float], floor: float) -> None:
    assert set(a) == set(b)
    for gamma, value in a.items():
        assert value == pytest.approx(b[gamma], rel=1e-6, abs=1e-9 + 10.0 * floor), gamma


@in_every_scene
def test_sparse_algebra_gives_what_dense_algebra_gives(name: str) -> None:
    s = scene(name)
    thin = large_model(s.model)
    close(s.scaled(s.expand(2, thin)), s.scaled(s.expand(2)), s.floor)
    lam, floor = eigenvalues(s.pencil, s.x0[None], 2), 2.0 * rounding_error(s.pencil, s.x0, 2)
    np.testing.assert_allclose(eigenvalues(thin.pencil, s.x0[None], 2), lam, rtol=10.0 * floor)


@in_every_case
def test_a_reduced_model_answers_along_the_trajectory_and_over_the_design_box(name: str) -> None:
    s = scene(name)
    rng = np.random.default_rng(1)
    q = s.case.trajectory.q
    low, high = (s.x0 + 2.0 * sign * s.span for sign in (-1.0, 1.0))
    points = q[[len(q) // 6, len(q) // 2, 5 * len(q) // 6]]
    y0 = s.x0[s.pencil.n_q :]
    q = q[np.linspace(0, len(q) - 1, 25).astype(int)]
    y = rng.uniform(low, high, (len(q), len(low)))[:, s.pencil.n_q :]
    exact = s.model.frequencies(q, y, 1)
    reduced = reduce(s.model, points, np.tile(y0, (3, 1)), (1,), 2)
    assert np.abs(reduced.frequencies(q, y) / exact - 1.0).max() < 1e-3


@in_every_case
def test_the_frequencies_are_those_of_the_plainly_assembled_mechanism(name: str) -> None:
    """Global coordinates, joints as linear constraints, rigid modes left in: nothing in common."""
    s = scene(name)
    file, q = s.case.file, s.x0[: s.pencil.n_q]
    tree = plain({"mechanism": file.mechanism, "coordinates": file.coordinates})
    assert isinstance(tree, dict)
    kinds = {link["type"] for link in tree["mechanism"]["links"].values()}
    if kinds & {"superelement", "solid"} or kinds == {"rigid"}:
        pytest.skip("matrices from elsewhere, meshes of solids and masses have tests of their own")
    n = len(file.coordinates)
    for load, value in zip(file.loads, q[n:].tolist(), strict=True):
        path = load.removesuffix(".add")
        tree = changed(tree, path, value + (0.0 if path == load else file.value_at(path)))
    rigid, gravity = len(s.pencil.rigid), file.mechanism.gravity
    if isinstance(gravity, tuple):
        expected = weigh(tree, q[:n], gravity).spectrum(4 + rigid)[rigid:]
    else:
        frame = world(tree, q[:n])
        frame.n_free = rigid  # springs hold free coordinates too
        expected = frame.spectrum(4)
    x = np.concatenate([q, s.case.initial_design])[None]
    # The oracle's null space costs it another two digits.
    np.testing.assert_allclose(
        eigenvalues(s.pencil, x, 4)[0], expected, rtol=1e-9 + 100.0 * s.floor
    )
