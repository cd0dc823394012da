"""Modes counted by pivots against full spectra: of an independent program, and of our solvers."""

from collections.abc import Callable

import numpy as np
import pytest
from chains import model_of, two_link
from large import HELD, Q0, Y0, arm, large
from scipy.linalg import eigh
from spatial_cases import built
from spatial_oracle import Tree, world
from spatial_random import random_closed, random_open

from eigassign.errors import MechanismError, UsageError
from eigassign.mechanism import Pencil
from eigassign.modal import count_below

Floats = np.ndarray
UNCERTAIN = -1
Way = Callable[[Pencil], Pencil]


@pytest.fixture(params=[10**6, 0], ids=["dense", "sparse"])
def way(request: pytest.FixtureRequest) -> Way:
    """Either algebra for models of any size."""
    return lambda pencil: large(pencil, request.param)


def spectrum(tree: Tree, q: Floats) -> Floats:
    """All elastic λ of the plain frame program, the rigid motions left out by count."""
    frame = world(tree, q)
    K, M = frame.projected()
    return np.sort(eigh(K, M, eigvals_only=True))[frame.n_free :]


def between(lam: Floats) -> tuple[Floats, list[int]]:
    """Frequencies in Hz in the wider gaps of a spectrum, and how many of it lie below each."""
    edges = np.concatenate([[0.25 * lam[0]], np.sqrt(lam[1:] * lam[:-1]), [4.0 * lam[-1]]])
    wide = np.concatenate([[True], lam[1:] / lam[:-1] > 1.001, [True]])
    return np.sqrt(edges[wide]) / (2.0 * np.pi), np.flatnonzero(wide).tolist()


@pytest.mark.parametrize("space", ["planar", "spatial"])
@pytest.mark.parametrize("seed", [2, 6, 5, 8, 0, 1, 3, 4, 7])  # trees and loops by default
def test_the_count_is_that_of_an_independent_programs_whole_spectrum(
    seed: int, space: str, way: Way
) -> None:
    """Trees and loops: free, locked and held joints, springs, rods and bodies without mass."""
    tree, q = random_open(seed, space) if seed < 6 else random_closed(seed, space)[:2]
    model = built(tree)
    lam = spectrum(tree, q)
    # of the plain program the highest modes only: its lowest have 1e-16 × λ_n/λ_1 of round-off
    lam = lam[lam > 1e-6 * lam[-1]] if len(lam) > 40 else lam
    hz, counts = between(lam)
    skipped = model.n_elastic - len(lam)
    found = count_below(way(model.pencil), model.x(q), hz[None])[0]
    assert found.tolist() == [skipped + c for c in counts]


@pytest.mark.parametrize("drives", [("free", "free"), ("locked", HELD), ("free", HELD)], ids=str)
def test_next_to_a_mode_the_count_is_right_or_not_given(drives: tuple, way: Way) -> None:
    model = arm(drives)
    x = model.x(Q0, Y0)
    hz = model.frequencies(Q0, Y0, 5)[0]
    sides = 10.0 ** np.arange(-15, -2)[:, None] * np.array([-1.0, 1.0])
    found = count_below(way(model.pencil), x, (hz[:, None, None] * (1.0 + sides)).reshape(1, -1))
    found = found.reshape(5, len(sides), 2)
    right = np.arange(5)[:, None, None] + np.array([0, 1])
    # 16 elements: round-off of the modes themselves is below 1e-11
    assert ((found == right) | (found == UNCERTAIN))[:, 4:].all()
    assert (found == right)[:, 9:].all()
    assert (found == UNCERTAIN)[:, 0].all()


def test_frequencies_of_one_sample_of_each_or_several_of_each(way: Way) -> None:
    model = model_of(two_link())
    q = np.array([[0.3, 1.9], [1.0, 0.2], [-2.0, 0.5]])
    x = model.x(q, [0.1, 0.1])
    hz = model.frequencies(q, [0.1, 0.1], 4)
    assert count_below(way(model.pencil), x, hz[0, 1] * 1.01).shape == (3,)
    assert count_below(way(model.pencil), x, hz[:, 1] * 1.01).tolist() == [2, 2, 2]
    edges = hz[:, [0, 3]] * [0.99, 1.01]
    assert count_below(way(model.pencil), x, edges).tolist() == [[0, 4]] * 3
    assert count_below(way(model.pencil), x, edges[:1]).shape == (3, 2)
    assert count_below(way(model.pencil), x[:0], 100.0).shape == (0,)


@pytest.mark.parametrize("drives", [("free", "free"), ("locked", "locked")])
@pytest.mark.parametrize("density", [0.0, 1e-30])
def test_unknowns_without_mass_are_not_counted(
    density: float, drives: tuple[str, str], way: Way
) -> None:
    tree = two_link(masses=(0.0, 0.5), elements=(3, 3), drives=drives, design={})
    mechanism = tree["mechanism"]
    mechanism["materials"]["ghost"] = {"youngs_modulus": 1e6, "density": density}
    mechanism["links"]["fore"]["material"] = "ghost"
    model = model_of(tree)
    most = {"free": 10, "locked": 11}[drives[0]]  # the rest is the rod's (test_modes_with_mass)
    hz = model.frequencies([0.3, 0.9], [], most)[0]
    x = model.x([0.3, 0.9], [])
    assert count_below(way(model.pencil), x, hz[-1] * 1.01).tolist() == [most]
    if density == 0.0:
        assert count_below(way(model.pencil), x, hz[-1] * 30.0).tolist() == [most]


def test_a_fine_mesh_is_counted_up_to_its_own_round_off() -> None:
    """500 elements a link: the matrices hold the frequencies to some 1e-4."""
    model = model_of(two_link((500, 500), design={}))
    coarse = model_of(two_link((24, 18), design={})).frequencies([0.3, 1.9], [], 4)[0]
    x = model.x([0.3, 1.9], [])
    for away in (1e-2, 1e-3):  # the coarse mesh is right to 1e-6
        hz = np.concatenate([coarse * (1.0 - away), coarse * (1.0 + away)])
        found = count_below(model.pencil, x, hz[None])[0]
        right = np.array([0, 1, 2, 3, 1, 2, 3, 4])
        assert ((found == right) | (found == UNCERTAIN)).all()
        assert away < 1e-2 or (found == right).all()


def test_wrong_frequencies_and_free_coordinates_without_mass_are_refused(way: Way) -> None:
    model = model_of(two_link())
    x = model.x(Q0, [0.1, 0.1])
    for hz in (0.0, -3.0, np.nan, [[[1.0]]]):
        with pytest.raises(UsageError, match="must be positive numbers"):
            count_below(way(model.pencil), x, hz)
    tree = two_link(design={})
    tree["mechanism"]["materials"]["al"]["density"] = 0.0
    ghost: Pencil = model_of(tree).pencil
    with pytest.raises(MechanismError, match="moves no mass"):
        count_below(way(ghost), x[:, :2], 10.0)
