"""Responses by modes against direct solves of the whole system, for every way to state damping."""

from copy import deepcopy
from typing import Any, NamedTuple

import numpy as np
import pytest
from calibration import Floats
from chains import bar, model_of
from spatial_random import last_node, random_closed, random_open

import eigassign as ea
from eigassign.modal import (
    Damping,
    ModalResponse,
    Model,
    dampings,
    modal_response,
    rounding_error,
    unit_forces,
)

OF_ALL, OF_FOUR = 1e-10, 5e-3  # of the largest |H|
SHARES = 0.05  # the worst of 20: 3.2 %; the median 0.02 %
ETA = 0.04


class Shaken(NamedTuple):
    """A mechanism at a pose x, with forces that move a node along two directions n."""

    model: Model
    x: Floats
    at: str
    n: Floats  # (2, d)
    b: Floats  # (2, n_dof)
    omega: Floats  # (1, k): at the first three resonances and beside them

    def responses(self, damping: Damping, highest: float = 1e5) -> ModalResponse:
        own = unit_forces(self.model, {self.at: self.n.tolist()})
        return modal_response(self.model, damping, own, self.x, highest)

    def direct(self, K: Any, C: Any = 0.0, seen: int = 0) -> Any:
        """H by a solve at each frequency."""
        M = self.model.matrices(self.x[:, : len(self.model.q_names)], [])[0]
        systems = (K - w**2 * M + 1j * w * C for w in self.omega[0])
        return np.array([self.b[seen] @ np.linalg.solve(system, self.b[0]) for system in systems])


def drawn(seed: int, losses: str = "", **more: object) -> Shaken:
    """The next random tree or loop, in a plane or in space, whose last node moves; all is held.

    With ``losses`` its materials and drives have loss factors, equal or any, and nothing else is
    stiff.
    """
    while True:
        rng, space = np.random.default_rng([seed, 451]), ("planar", "spatial")[seed % 2]
        if seed % 4 < 2:
            tree, q = random_open(seed, space)
        else:
            tree, q, _ = random_closed(seed, space, kinds=("beam", "rigid"))
        tree = {**deepcopy(tree), **more}  # parts of it are shared
        for own in tree["coordinates"].values():
            if own.get("drive", "free") == "free":
                own["drive"] = {"stiffness": float(10 ** rng.uniform(3, 6))}
        parts = [*tree["mechanism"].get("materials", {}).values()]
        parts += [c["drive"] for c in tree["coordinates"].values() if c["drive"] != "locked"]
        if losses:
            tree["mechanism"].pop("springs", None)
            for part in parts:
                part["loss_factor"] = ETA if losses == "equal" else 10 ** rng.uniform(-3, -1)
        model, at = model_of(tree), last_node(tree)
        x, n = model.x(q, []), rng.normal(size=(2, 2 + (space == "spatial")))
        b = np.zeros((2, model.n_dof))
        own = unit_forces(model, {at: n.tolist()})
        for k, (place, (values, _)) in enumerate(
            zip(own.unknowns, own.at(x, np.array([], dtype=np.intp)), strict=True)
        ):
            b[k, place] = values[0]
        if b.any():
            hz = model.frequencies(q, [], 3)[0]
            beside = rng.uniform(0.2 * hz[0], hz[2], 12)
            omega = 2.0 * np.pi * np.sort(np.concatenate([hz, beside]))
            return Shaken(model, x, at, n, b, omega[None])
        seed += 100


def stiffness_of(one: Shaken) -> Floats:
    return one.model.matrices(one.x[:, : len(one.model.q_names)], [])[1]


def losses_of(one: Shaken, damping: Damping) -> Floats:
    """K_loss, dense."""
    assert damping.loss is not None
    return damping.loss.matrices(damping.loss.theta(one.x))[0][0]


def off(found: Any, exact: Any) -> float:
    """The largest error, of the largest |H|."""
    return float(np.abs(found - exact).max() / np.abs(exact).max())


def exactly(one: Shaken, zeta: Floats) -> float:
    """1e-10, and what round-off of a frequency, δf/f, is in a peak: δf/(ζ f)."""
    return OF_ALL + rounding_error(one.model.pencil, one.x[0], 3) / float(zeta.min())


def of_four(one: Shaken, found: ModalResponse, K: Floats, eta: float = 0.0) -> Any:
    """H by four modes and what the others do at rest."""
    w, beta2, lam = one.omega[0][:, None], found.beta[0, :4, 0] ** 2, found.lam[0, :4]
    zeta = 0.0 if eta else found.zeta[0, :4]
    d = lam * (1.0 + 1j * eta) - w**2 + 2j * zeta * w * np.sqrt(lam)
    left = one.b[0] @ np.linalg.solve(K, one.b[0]) - (beta2 / lam).sum()
    return (beta2 / d).sum(axis=1) + left / (1.0 + 1j * eta)


def few_are_enough(one: Shaken, found: ModalResponse) -> bool:
    """Where four modes are seen, and the next lies above three times the highest frequency.

    Elsewhere what is left out resonates: of 35 mechanisms 4 have errors of 0.5 to 19 %.
    """
    share = found.beta[0, :, 0] ** 2 / found.lam[0]
    fifth = np.append(found.lam[0], np.inf)[min(4, len(share))]
    return share[:3].sum() > 0.01 * share.sum() and fifth > (3.0 * one.omega.max()) ** 2


@pytest.mark.parametrize("seed", range(25))
def test_ratios_of_modes_are_a_matrix_that_is_diagonal_in_modes(seed: int) -> None:
    one = drawn(seed, damping={"ratio": 0.02, "modes": [0.005, 0.03]})
    (damping,) = dampings(one.model)
    found = one.responses(damping)
    zeta = np.array([0.005, 0.03, *[0.02] * found.lam.shape[1]])[: found.lam.shape[1]]
    np.testing.assert_array_equal(found.zeta[0], zeta)
    n_q = len(one.model.q_names)
    M, K = one.model.matrices(one.x[:, :n_q], [])
    hz, phi = one.model.modes(one.x[:, :n_q], [], len(zeta))
    C = M @ phi[0] @ np.diag(4.0 * np.pi * zeta * hz[0]) @ phi[0].T @ M
    assert off(found.at(one.omega, 1, 0)[0], one.direct(K, C, seen=1)) < exactly(one, zeta)
    if few_are_enough(one, found):
        assert off(of_four(one, found, K), one.direct(K, C)) < OF_FOUR


@pytest.mark.parametrize("seed", range(25, 50))
def test_one_loss_factor_makes_the_stiffness_complex(seed: int) -> None:
    one = drawn(seed, "equal")
    (damping,), K = dampings(one.model), stiffness_of(one)
    np.testing.assert_allclose(losses_of(one, damping), ETA * K, atol=1e-10 * np.abs(K).max())
    exact, found = one.direct(K * (1.0 + 1j * ETA)), one.responses(damping)
    assert off(found.at(one.omega)[0], exact) < exactly(one, found.zeta)
    np.testing.assert_allclose(found.zeta, 0.5 * ETA, rtol=1e-5)
    if few_are_enough(one, found):
        assert off(of_four(one, found, K, ETA), exact) < OF_FOUR


@pytest.mark.parametrize("seed", range(50, 70))
def test_unequal_loss_factors_couple_modes_and_shares_of_energy_are_an_estimate(seed: int) -> None:
    """Of factors of 0.1 to 10 %; the shares alone would be d = λ (1 + 2iζ) − ω²."""
    one = drawn(seed, "any")
    (damping,) = dampings(one.model)
    exact = one.direct(stiffness_of(one) + 1j * losses_of(one, damping))
    found = one.responses(damping)
    assert off(found.at(one.omega)[0], exact) < exactly(one, found.zeta[:, :3])
    beta, d = found.beta[0, :, 0], found.lam[0] * (1.0 + 2j * found.zeta[0])
    shares = (beta**2 / (d - one.omega[0][:, None] ** 2)).sum(axis=1)
    assert off(shares, exact) < SHARES


def test_a_range_has_two_ends_and_a_free_coordinate_is_named() -> None:
    one = drawn(1, damping=[0.01, 0.03])
    assert dampings(one.model) == (Damping((0.01,)), Damping((0.03,)))
    tree, _ = random_open(0, "planar")
    tree = deepcopy(tree)
    name, own = next(iter(tree["coordinates"].items()))
    own["drive"] = "free"
    tree["mechanism"].pop("springs", None)
    with pytest.raises(ea.EigassignError, match=f"{name}.*is free"):
        unit_forces(model_of(tree), {last_node(tree): [[1.0, 0.0]]})


def test_without_damping_it_is_what_the_mechanism_does_beside_resonances() -> None:
    one = drawn(1)
    one = one._replace(omega=1.01 * one.omega)
    found = one.responses(Damping())
    assert off(found.at(one.omega)[0], one.direct(stiffness_of(one))) < exactly(
        one, np.array([0.01])
    )


@pytest.mark.parametrize("losses", ["ratios", "factors"])
def test_of_many_modes_those_far_above_are_at_rest(losses: str) -> None:
    """A fine mesh, of which 64 of 120 modes are solved: the others lie 30 times as high."""
    rod, drive = {"shape": "circle", "diameter": 0.03}, {"stiffness": 2e4}
    tree = bar(60, 1.0, 210e9, 7850, rod, "revolute", drive)
    if losses == "factors":
        tree["mechanism"]["materials"]["m"]["loss_factor"] = drive["loss_factor"] = 0.02
    else:
        tree["damping"] = 0.01
    model = model_of(tree)
    own, x = unit_forces(model, {"bar.end": [[0.0, 1.0]]}), model.x([0.3], [])
    omega = 2.0 * np.pi * np.linspace(5.0, 200.0, 50)[None]
    few = modal_response(model, dampings(model)[0], own, x, float(omega.max()))
    every = modal_response(model, dampings(model)[0], own, x, 1e9)
    assert few.lam.shape[1] < every.lam.shape[1]
    assert off(few.at(omega), every.at(omega)) < 1e-5
