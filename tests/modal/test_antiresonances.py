"""Antiresonances against sign changes of direct responses, closed forms, differences, series."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calibration import Floats
from chains import model_of
from spatial_random import last_node, random_closed, random_open

import eigassign as ea
from eigassign.modal import Antiresonances, Model, compliances

ARM = Path(__file__).parents[2] / "cases" / "milling_arm.yaml"
Tree = dict[str, Any]
SEEN = 1e-13  # of the largest share of a mode in H: of less, round-off says where it lies


def held(tree: Tree, rng: np.random.Generator) -> Tree:
    """The tree with a drive on every coordinate that is free."""
    for own in tree["coordinates"].values():
        if own.get("drive", "free") == "free":
            own["drive"] = {"stiffness": float(10 ** rng.uniform(3, 6))}
    return tree


def drawn(seed: int) -> tuple[Model, Floats, str, Floats]:
    """A random tree or loop, in a plane or in space, its pose, a node and a direction."""
    rng = np.random.default_rng([seed, 45])
    space = ("planar", "spatial")[seed % 2]
    if seed % 4 < 2:
        tree, q = random_open(seed, space)
    else:
        tree, q, _ = random_closed(seed, space, kinds=("beam", "rigid"))
    return (
        model_of(held(tree, rng)),
        q,
        last_node(tree),
        rng.normal(size=2 if space == "planar" else 3),
    )


def force(model: Model, x: Floats, node: str, n: Floats) -> Floats:
    """b (n_dof,) of a unit force."""
    b, one = np.zeros(model.n_dof), compliances(model, {node: [n.tolist()]}).forces
    b[one.unknowns[0]] = one.at(x, np.array([], dtype=np.intp))[0][0][0]
    return b


def seen(model: Model, x: Floats, b: Floats) -> tuple[Floats, Floats]:
    """λ of all modes that b moves, and their shares of the static compliance."""
    n_q = len(model.q_names)
    hz, phi = model.modes(x[:, :n_q], x[:, n_q:], least_with_mass(model, x))
    lam, share = (2.0 * np.pi * hz[0]) ** 2, (b @ phi[0]) ** 2
    share = share / lam
    first = np.append(True, np.diff(lam) > 1e-9 * lam[1:])  # of modes that coincide one is seen
    together = np.add.reduceat(share, np.flatnonzero(first))
    keep = together > SEEN * share.max()
    return lam[first][keep], together[keep]


def least_with_mass(model: Model, x: Floats) -> int:
    """The number of modes that have mass."""
    n_q, most = len(model.q_names), model.n_dof
    while True:
        try:
            model.frequencies(x[:, :n_q], x[:, n_q:], most)
            return most
        except ea.EigassignError:
            most -= 1


@pytest.mark.parametrize(
    "seed", [pytest.param(k, marks=() if k < 16 else pytest.mark.slow) for k in range(120)]
)
def test_a_direct_response_changes_its_sign_there_and_nowhere_between(seed: int) -> None:
    """H = bᵀ(K − λM)⁻¹b, of either sign beside each zero; one between two poles that are seen."""
    model, q, node, n = drawn(seed)
    x = model.x(q, ())
    try:
        own = Antiresonances.of(model, node, n.tolist())
    except ea.EigassignError:
        assert np.abs(force(model, x, node, n)).max() < 1e-14
        return
    b = force(model, x, node, n)
    K, M = (A for A in reversed(model.matrices(q, ())))
    s = 1.0 / np.sqrt(np.diag(K))

    def H(lam: float) -> float:
        return float((b * s) @ np.linalg.solve((K - lam * M) * np.outer(s, s), b * s))

    poles, _ = seen(model, x, b)
    count = min(3, len(poles) - 1)
    if count < 1:
        return
    z = (2.0 * np.pi * own.frequencies(q, (), count)[0]) ** 2
    for k, lam in enumerate(z):
        near = min(1e-6, 0.3 * np.abs(poles / lam - 1.0).min())
        sides = H(lam * (1.0 - near)), H(lam * (1.0 + near))
        assert sides[0] < 0.0 < sides[1]  # H grows with λ
        assert poles[k] < lam < poles[k + 1]


def test_an_absorber_holds_its_node_still_at_its_own_frequency() -> None:
    """√(k/m) to 1e-12, whatever it hangs on."""
    k, m = 2.0e5, 3.0
    tree = chain([50.0, m], [1.0e6, k])
    found = Antiresonances.of(model_of(tree), "cart1.tip", [1, 0]).frequencies([0.0] * 2, (), 1)
    assert found[0, 0] == pytest.approx(np.sqrt(k / m) / (2.0 * np.pi), rel=1e-12)


def chain(masses: list[float], stiffnesses: list[float]) -> Tree:
    """Carts on rails, each on its drive against the one before."""
    links = {
        f"cart{k}": {"type": "rigid", "nodes": {"tip": [0.0, 0.0]}}
        for k in range(1, 1 + len(masses))
    }
    joints, coordinates, bodies, before = {}, {}, {}, "ground"
    for k, (mass, stiffness) in enumerate(zip(masses, stiffnesses, strict=True), 1):
        joints[f"rail{k}"] = {"type": "prismatic", "base": before, "follower": f"cart{k}.tip"}
        coordinates[f"x{k}"] = {"joint": f"rail{k}", "drive": {"stiffness": stiffness}}
        bodies[f"b{k}"] = {"at": f"cart{k}.tip", "mass": mass}
        before = f"cart{k}.tip"
    return {
        "mechanism": {"space": "planar", "links": links, "joints": joints, "bodies": bodies},
        "coordinates": coordinates,
    }


def test_a_chain_of_masses_rests_where_those_beyond_and_before_it_swing() -> None:
    """The zeros of mass 3 of 5 are the frequencies of both parts, it being held."""
    masses, k = [1.0, 2.0, 3.0, 4.0, 5.0], [100.0, 90.0, 80.0, 70.0, 60.0]
    found = Antiresonances.of(model_of(chain(masses, k)), "cart3.tip", [1, 0])
    zeros = found.frequencies([0.0] * 5, (), 4)[0]
    parts = []
    for own, springs in ((masses[:2], k[:3]), (masses[3:], [*k[3:], 0.0])):
        K = (
            np.diag(np.array(springs[:-1]) + springs[1:])
            - np.diag(springs[1:-1], 1)
            - np.diag(springs[1:-1], -1)
        )
        parts.append(np.sqrt(np.linalg.eigvals(K / np.array(own)[:, None]).real) / (2.0 * np.pi))
    np.testing.assert_allclose(zeros, np.sort(np.concatenate(parts)), rtol=1e-10)
    with pytest.raises(ea.EigassignError, match="has 4 antiresonances, not 5"):
        found.frequencies([0.0] * 5, (), 5)


def test_a_mode_that_the_force_does_not_see_is_not_counted() -> None:
    """Of two arms side by side that only the ground joins, the other's modes are no zeros."""
    tree = chain([1.0], [100.0])
    tree["mechanism"]["links"]["aside"] = {"type": "rigid", "nodes": {"tip": [0.0, 0.0]}}
    tree["mechanism"]["joints"]["side"] = {
        "type": "prismatic",
        "base": "ground",
        "follower": "aside.tip",
    }
    tree["coordinates"]["y"] = {"joint": "side", "drive": {"stiffness": 50.0}}
    tree["mechanism"]["bodies"]["b"] = {"at": "aside.tip", "mass": 1.0}
    found = Antiresonances.of(model_of(tree), "cart1.tip", [1, 0])
    assert found.held.frequencies([0.0, 0.0], (), 1)[0, 0] > 0.0
    with pytest.raises(ea.EigassignError, match="has 0 antiresonances, not 1"):
        found.frequencies([0.0, 0.0], (), 1)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_series_and_slopes_are_those_of_the_zeros(order: int) -> None:
    """The error of the series falls with the distance to the power p + 1."""
    case = ea.load_case(ARM)
    model, q0, y0 = case.model(), np.array([0.4, -0.9]), case.initial_design
    own = Antiresonances.of(model, "forearm.end", [0, 1])
    series = ea.expand(own.held, q0, y0, modes=(1, 2), order=order)
    rng = np.random.default_rng(order)
    dq, dy = rng.normal(size=2), rng.normal(size=len(y0)) * y0 * 0.5
    errors = [
        np.abs(
            series.frequencies(q0 + h * dq, y0 + h * dy)
            / own.frequencies(q0 + h * dq, y0 + h * dy, 2)
            - 1.0
        )
        for h in (0.04, 0.02)
    ]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order + 1, abs=0.3)
    x = model.x(q0, y0)
    steep = own.slopes(x, 1, np.ones(x.shape[1]))[1][0]
    for k, slope in enumerate(steep):
        h = 1e-5 * max(abs(x[0, k]), 0.1) * np.eye(x.shape[1])[k]
        both = [own.counted(x + sign * h, 1)[0][0, 0] for sign in (1.0, -1.0)]
        assert slope == pytest.approx(
            (both[0] - both[1]) / (2.0 * h[k]), rel=1e-6, abs=1e-6 * np.abs(steep).max()
        )
