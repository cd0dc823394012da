"""Exact elastic modes: certificates, both solvers, and closed forms."""

import numpy as np
import pytest
from chains import bar, model_of, two_link
from large import HELD, large_model
from scipy import sparse
from spatial_random import random_open

from eigassign.errors import UsageError
from eigassign.mechanism import factorise, largest_beside
from eigassign.modal import Model, rounding_error

POSES = np.array([[0.3, 1.9], [1.0, 0.2], [-2.0, 0.5]])
DESIGN = np.array([[0.0, 0.1], [0.2, 0.0], [0.25, 0.25]])
SQUARE = {"shape": "rectangle", "width": 0.125, "height": 0.125}


def certify(model: Model, q: np.ndarray, y: np.ndarray, f: np.ndarray, phi: np.ndarray) -> None:
    """Residual, normalisation, orthogonality and sign of the modes of one sample."""
    M, K = model.matrices(q, y)
    lam = (2.0 * np.pi * f) ** 2
    residual = K @ phi - (M @ phi) * lam
    # backward stable: small against ‖K‖‖φ‖
    assert np.abs(residual).max() < 1e-12 * np.abs(K).max() * np.abs(phi).max()
    np.testing.assert_allclose(phi.T @ M @ phi, np.eye(len(f)), atol=1e-9)
    rigid = np.eye(model.n_dof)[:, model.pencil.rigid]
    np.testing.assert_allclose(rigid.T @ M @ phi, 0.0, atol=1e-11)
    assert (phi[np.abs(phi).argmax(axis=0), np.arange(len(f))] > 0).all()
    assert (np.diff(f) > 0).all()


@pytest.mark.parametrize("limit", [10**6, 0], ids=["dense", "sparse"])
def test_modes_are_modes(limit: int) -> None:
    model = large_model(model_of(two_link()), limit)
    f, phi = model.modes(POSES, DESIGN, 6)
    for k in range(3):
        certify(model, POSES[k], DESIGN[k], f[k], phi[k])
    np.testing.assert_allclose(f, model.frequencies(POSES, DESIGN, 6), rtol=1e-12)


@pytest.mark.parametrize(
    ("drives", "elements"),
    [
        (("free", "free"), (4, 3)),
        (("locked", HELD), (4, 3)),
        (("free", HELD), (4, 3)),
        ((HELD, "free"), (20, 15)),
    ],
)
def test_how_many_are_solved_at_once_does_not_show(
    drives: tuple[object, object], elements: tuple[int, int]
) -> None:
    """One by one, some and in parts of many; designs at one pose, which share K, and poses."""
    model = model_of(two_link(elements, drives=drives))
    tolerance = 1e-12 if elements[0] < 10 else 1e-10  # round-off in K grows with n⁴
    for q, y in ((POSES, DESIGN), (POSES[:1], DESIGN)):
        x = model.x(q, y)
        alone = np.vstack([model.frequencies(row[:2], row[2:], 6) for row in x])
        shapes = np.vstack([model.modes(row[:2], row[2:], 6)[1] for row in x])
        for times in (1, 25):  # of 75 samples some 50 are solved at once
            many = np.tile(x, (times, 1))
            f, phi = model.modes(many[:, :2], many[:, 2:], 6)
            expected = np.tile(alone, (times, 1))
            np.testing.assert_allclose(
                model.frequencies(many[:, :2], many[:, 2:], 6), expected, rtol=tolerance
            )
            np.testing.assert_allclose(f, expected, rtol=tolerance)
            np.testing.assert_allclose(
                phi, np.tile(shapes, (times, 1, 1)), atol=1e-9 * np.abs(shapes).max()
            )


@pytest.mark.parametrize("drives", [("free", "free"), ("locked", {"stiffness": 3e3})])
def test_dense_and_sparse_solvers_agree(drives: tuple[object, object]) -> None:
    model = model_of(two_link((12, 9), drives=drives))
    f, phi = model.modes(POSES, DESIGN, 5)
    model = large_model(model)
    found, vectors = model.modes(POSES, DESIGN, 5)
    np.testing.assert_allclose(found, f, rtol=1e-10)
    np.testing.assert_allclose(vectors, phi, atol=1e-7 * np.abs(phi).max())
    np.testing.assert_array_equal(model.modes(POSES, DESIGN, 5)[1], vectors)  # no random start


@pytest.mark.parametrize("seed", range(0, 60, 5))
def test_modes_of_random_trees_are_modes(seed: int) -> None:
    tree, q = random_open(seed, "planar")
    model = model_of(tree)
    count = min(5, model.n_dof - model.n_rigid)
    f, phi = model.modes(q, [], count)
    certify(model, q, np.zeros(0), f[0], phi[0])


# Closed forms: f = (βL)² / (2πL²) √(EI/ρA)


CLAMPED = [1.8751040687, 4.6940911330, 7.8547574382]
PINNED_FREE = [3.9266023120, 7.0685827456, 10.2101761228]
PINNED_PINNED = [np.pi, 2.0 * np.pi, 3.0 * np.pi]


def beam(elements: int, kind: str) -> Model:
    tree = bar(elements, 10.0, 200e9, 8000.0, SQUARE, "fixed" if kind == "clamped" else "revolute")
    if kind == "held":
        tree["coordinates"]["q1"]["drive"] = {"stiffness": 1e16}
    if kind == "pinned":  # an enormous mass holds the far end, and lets it turn
        tree["mechanism"]["bodies"] = {"anchor": {"at": "bar.end", "mass": 1e10}}
    return model_of(tree)


@pytest.mark.parametrize(
    ("kind", "beta_l"),
    [
        ("clamped", CLAMPED),
        ("held", CLAMPED),
        ("pinned-free", PINNED_FREE),
        ("pinned", PINNED_PINNED),
    ],
)
def test_beams_converge_to_closed_forms_with_the_fourth_power_of_the_mesh(
    kind: str, beta_l: list[float]
) -> None:
    exact_hz = np.square(beta_l) / (2.0 * np.pi * 10.0**2) * 5000.0 * 0.125 / np.sqrt(12.0)
    meshes, errors = (10, 14, 20), []
    for elements in meshes:
        model = beam(elements, kind)
        q = np.zeros(len(model.q_names))
        skip = 1 if kind == "pinned" else 0  # the mass bouncing on the bar's axial stiffness
        errors.append(model.frequencies(q, [], 3 + skip)[0, skip:] / exact_hz - 1.0)
    slopes = np.polyfit(np.log(meshes), np.log(errors), 1)[0]
    np.testing.assert_allclose(slopes, -4.0, atol=0.1)
    assert (np.array(errors) > 0.0).all()  # consistent mass: from above
    np.testing.assert_allclose(errors[-1], np.array(beta_l) ** 4 / 20**4 / 1440, rtol=0.1)


# Shapes and refusals


def test_one_sample_and_many_samples_mix() -> None:
    model = model_of(two_link())
    f = model.frequencies(POSES, [0.1, 0.1], 2)
    assert f.shape == (3, 2)
    # a sample's place in the batch may round it differently, within the round-off that we state
    digits = 2 * rounding_error(model.pencil, np.array([*POSES[1], 0.1, 0.1]), 2)
    np.testing.assert_allclose(model.frequencies(POSES[1], [0.1, 0.1], 2), f[1:2], rtol=digits)
    one = model.frequencies(POSES[0], DESIGN, 2)
    np.testing.assert_allclose(one[2], model.frequencies(POSES[0], DESIGN[2], 2)[0], rtol=digits)
    assert model.frequencies(np.zeros((0, 2)), [0.0, 0.0], 2).shape == (0, 2)
    with pytest.raises(UsageError, match="3 samples of q against 2 of y"):
        model.frequencies(np.zeros((3, 2)), np.zeros((2, 2)), 1)


def test_a_mechanism_without_coordinates_and_design_has_modes() -> None:
    model = beam(3, "clamped")
    assert model.n_rigid == 0
    assert model.frequencies([], [], 2).shape == (1, 2)
    assert model.frequencies(np.zeros((3, 0)), np.zeros((3, 0)), 2).shape == (3, 2)


def test_what_is_beside_some_of_many_equal_modes_is_another_of_them() -> None:
    K = sparse.csc_array(np.diag(np.linspace(1.0, 5.0, 40)))
    mu = np.append(np.full(4, 2.0), np.linspace(1.9, 0.1, 36))
    root = np.sqrt(K.diagonal())
    turn = np.linalg.qr(np.random.default_rng(0).standard_normal((40, 40)))[0]
    M = root[:, None] * (turn * mu) @ turn.T * root
    W = turn[:, :3] / root[:, None]
    largest, w = largest_beside(factorise(K), K.T, lambda v: M @ v, W, 0.0)
    assert largest == pytest.approx(2.0, rel=1e-12)
    np.testing.assert_allclose(W.T @ (K @ w), 0.0, atol=1e-9)
