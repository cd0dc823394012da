"""Own links reduced: limits, convergence, rigid motion at every y, velocity terms, refusals."""

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from designed_arm import designed
from scipy import sparse
from scipy.linalg import eigh
from spatial_cases import ALLOY, Built, built, linkage
from spatial_oracle import Tree
from timed_motions import timed

from eigassign.errors import CaseError
from eigassign.mechanism import kept_factor, local_links, total, velocity_terms
from eigassign.modal import motion_effect

THIN = {"area": 5e-4, "bending_inertia": 1e-9}


def cantilever(elements: int, **more: Any) -> Tree:
    return linkage(
        {"b": {"length": 1.0, "elements": elements, "material": "m", "section": "s", **more}},
        {"r": {"type": "revolute", "base": "ground", "follower": "b.start"}},
        {"q": {"joint": "r", "drive": "locked"}},
        section=THIN,
    )


def scaled(model: Built, count: int) -> np.ndarray:
    """ω √(ρA l⁴ / EI)."""
    return np.sqrt(model.lam([0.3], count) * ALLOY["density"] * 5e-4 / 70e9 / 1e-9)


def test_without_modes_a_cantilever_is_one_element() -> None:
    """Constraint modes of a beam are its Hermite cubics, so this is one element of length 1: the
    pencil of w and θ at its free end, which misses the exact 3.5160 and 22.034.
    """
    stiffness = np.array([[12.0, -6.0], [-6.0, 4.0]])
    mass = np.array([[156.0, -22.0], [-22.0, 4.0]]) / 420.0
    one_element = np.sqrt(eigh(stiffness, mass, eigvals_only=True))
    found = scaled(built(cantilever(40, reduce_to=1e-3)), 2)
    np.testing.assert_allclose(found, one_element, rtol=2e-5)
    exact = scaled(built(cantilever(40)), 2)
    np.testing.assert_allclose(exact, [3.51602, 22.0345], rtol=1e-5)


def held_frequency(k: float) -> float:
    """Hz just above the k-th bending mode of the beam clamped at both ends, k > 1."""
    wave = (k + 0.5) * np.pi
    return 1.05 * wave**2 * np.sqrt(70e9 * 1e-9 / (ALLOY["density"] * 5e-4)) / (2.0 * np.pi)


def test_the_error_falls_with_the_fifth_power_of_the_modes_kept() -> None:
    """A held mode φ_n of wave number k_n takes part in moving the end by k_n⁻¹, so that it brings
    k_n⁻² λ_n⁻¹ ~ (n + ½)⁻⁶ to μ, and all those beyond N bring (N + 1)⁻⁵.
    """
    exact = built(cantilever(60)).lam([0.3], 1)[0]
    kept = np.array([3, 4, 6, 8, 11])
    found = [built(cantilever(60, reduce_to=held_frequency(n))).lam([0.3], 1)[0] for n in kept]
    error = np.array(found) / exact - 1.0
    assert (np.diff(error) < 0.0).all()
    assert (error > 0.0).all()
    slope = np.polyfit(np.log(kept + 1.0), np.log(error), 1)[0]
    assert slope == pytest.approx(-5.0, abs=0.25)


@pytest.mark.parametrize("narrow", [False, True])
@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_rigid_motion_is_in_the_span_at_every_design(space: str, narrow: bool) -> None:
    """T N' = N, and the whole inertia stays, though the basis is that of one length.

    Where the bounds are so narrow that no other constraint modes are worth a dof, it is too.
    """
    tree = designed(space)
    if narrow:
        tree["design"]["length"] |= {"min": 0.6 - 1e-6, "max": 0.6 + 1e-6}
    model = built(tree)
    links, _ = local_links(model.case, model.numbers, model.motion)
    reduced = [link for link in links if link.reduction is not None]
    assert len(reduced) == 2
    rng = np.random.default_rng(3)
    for y in rng.uniform([0.3, 0.012], [0.9, 0.03], (5, 2)):
        for link in reduced:
            whole = link.reduction.mesh  # type: ignore[union-attr]
            N = _value(model, whole.rigid, y)
            small = _value(model, link.rigid, y)
            carried = link.reduction.basis @ small  # type: ignore[union-attr]
            np.testing.assert_allclose(carried, N, atol=1e-9 * np.abs(N).max())
            inertia = [
                n.T @ _value(model, m, y) @ n for n, m in ((small, link.mass), (N, whole.mass))
            ]
            np.testing.assert_allclose(*inertia, atol=1e-9 * np.abs(inertia[1]).max())


def _value(model: Built, terms: Any, y: np.ndarray) -> np.ndarray:
    coefficients = np.array([term.coefficient for term in terms], dtype=object)
    (values,) = model.poses.values(np.array([[0.0, 0.0, *y]]), [coefficients])
    return total(terms, values[0]).toarray()


def test_nodes_that_nothing_uses_are_interior() -> None:
    model = built(designed("planar"))
    links, _ = local_links(model.case, model.numbers, model.motion)
    frame = links[1]
    kept = frame.reduction.mesh.n_local - len(frame.reduction.interior)
    assert kept == 6  # start and end; the whole frame has three more named nodes


def test_velocity_terms_of_a_reduced_link_are_those_of_its_nodes() -> None:
    """With nearly all modes kept, Coriolis and centrifugal terms change frequencies alike."""
    changes = []
    for hertz in (None, 3e4):
        tree = copy.deepcopy(designed("spatial"))
        del tree["design"]
        for link in tree["mechanism"]["links"].values():
            del link["reduce_to"]
            if hertz:
                link["reduce_to"] = hertz
        model = built(tree)
        s = np.linspace(0.0, 1.0, 11)
        q = np.outer(10 * s**3 - 15 * s**4 + 6 * s**5, [2.0, -3.0])
        terms = velocity_terms(model.case, model.numbers, model.motion)
        changes.append(motion_effect(model.pencil, terms, timed(s, q), np.zeros(0), (1, 2)).change)
    assert np.abs(changes[0]).max() > 1e-5
    np.testing.assert_allclose(changes[1], changes[0], rtol=1e-3, atol=1e-3 * changes[0].max())


def test_a_part_is_factored_once_however_often_it_is_asked_for() -> None:
    """Equal numbers are one matrix, another number is another."""
    A = sparse.csc_array(np.diag([2.0, 3.0]))
    assert kept_factor(A) is kept_factor(A.copy())
    np.testing.assert_allclose(kept_factor(A * 2.0).solve(np.ones(2)), [0.25, 1 / 6])


def test_a_link_that_a_carriage_travels_along_stays_whole() -> None:
    tree = cantilever(6, reduce_to=100.0)
    mechanism = tree["mechanism"]
    mechanism["links"]["cart"] = {"type": "rigid", "mass": 1.0}
    mechanism["joints"]["ride"] = {"type": "carriage", "base": "b", "follower": "cart.start"}
    tree["coordinates"]["s"] = {"joint": "ride"}
    with pytest.raises(CaseError, match=r"links\.b\.reduce_to: 'ride' travels along this link"):
        built(tree)


@pytest.mark.parametrize(
    ("value", "message"),
    [(0, "must be > 0"), (-3, "must be > 0"), ("100 rad/s", "divide by 2π"), ("all", "expected")],
)
def test_frequencies_that_are_none_are_refused(value: Any, message: str) -> None:
    with pytest.raises(CaseError, match=f"reduce_to: .*{message}"):
        built(cantilever(6, reduce_to=value))


def test_auto_leaves_a_link_whole_where_nobody_settles_it(tmp_path: Path) -> None:
    whole, auto = built(cantilever(6)), built(cantilever(6, reduce_to="auto"))
    np.testing.assert_array_equal(auto.lam([0.3], 3), whole.lam([0.3], 3))
