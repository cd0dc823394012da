"""Modes expanded together: right through crossings and veerings, where a single one is lost."""

import itertools
import math

import numpy as np
import pytest
from chains import bar, model_of
from large import large
from pencils import crossing

from eigassign import expand
from eigassign.errors import UsageError
from eigassign.modal import clusters, eigenvalues
from eigassign.modal import expand as expand_pencil


def test_neighbours_are_grouped_and_others_left_out() -> None:
    lam = np.array([1.0, 1.01, 1.02, 2.0, 3.0, 3.03, 9.0])
    assert clusters(lam, (1,), 0.02) == ((1, 2, 3),)
    assert clusters(lam, (4, 6), 0.02) == ((4,), (5, 6))
    assert clusters(lam, (1, 2, 7), 1e-9) == ((1,), (2,), (7,))


GRID = np.array(list(itertools.product(np.linspace(-0.15, 0.15, 13), (0.0, 0.05))))


@pytest.mark.parametrize("gap", [0.0, 1e-2], ids=["crossing", "veering"])
@pytest.mark.parametrize("x0", [[0.0, 0.0], [0.004, 0.1]])
def test_a_cluster_is_right_through_crossings_and_veerings(gap: float, x0: list[float]) -> None:
    pencil, x = crossing(gap), GRID + x0
    expected = eigenvalues(pencil, x, 2)
    together = expand_pencil(pencil, x0, [], (1, 2), 12)
    assert [c.modes for c in together.clusters] == [(1, 2)]
    np.testing.assert_allclose(together.eigenvalues(x, []), expected, atol=1e-12)


def test_a_single_mode_is_lost_where_its_cluster_is_not() -> None:
    pencil = crossing(1e-2)
    x = GRID + np.array([0.004, 0.1])
    expected = eigenvalues(pencil, x, 2)
    alone = expand_pencil(pencil, [0.004, 0.1], [], (1, 2), 8, cluster_gap=0.0)
    assert [c.modes for c in alone.clusters] == [(1,), (2,)]
    assert np.abs(alone.eigenvalues(x, []) - expected).max() > 1.0


@pytest.mark.parametrize("order", [2, 4, 6])
def test_the_error_of_a_cluster_falls_with_one_power_more_than_the_order(order: int) -> None:
    pencil, errors = crossing(1e-2), []
    e = expand_pencil(pencil, [0.0, 0.0], [], (1, 2), order)
    for h in (0.1, 0.05):
        x = h * np.array([[c, s] for c, s in zip(np.cos(range(9)), np.sin(range(9)), strict=True)])
        errors.append(np.sqrt(np.mean((e.eigenvalues(x, []) - eigenvalues(pencil, x, 2)) ** 2)))
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order + 1, abs=0.25)


def test_one_mode_of_a_cluster_can_be_asked_for_but_has_no_series_of_its_own() -> None:
    pencil, x = crossing(0.0), GRID
    e = expand_pencil(pencil, [0.0, 0.0], [], (2,), 8)
    assert e.modes == (2,)
    assert e.eigenvalues(x, []).shape == (26, 1)
    expected = eigenvalues(pencil, x, 2)[:, 1:]
    np.testing.assert_allclose(e.eigenvalues(x, []), expected, atol=1e-8)
    with pytest.raises(UsageError, match="cluster"):
        _ = e.coefficients
    assert any("1-2" in note for note in e.notes)


def test_as_many_modes_as_coincide_are_expanded_together() -> None:
    tree = bar(2, 0.5, 200e9, 7800.0, {"shape": "circle", "diameter": 0.02})
    mechanism = tree["mechanism"]
    for k in range(8):
        mechanism["links"][f"b{k}"] = mechanism["links"]["bar"]
        mechanism["joints"][f"j{k}"] = {
            "type": "fixed",
            "base": "ground",
            "follower": f"b{k}.start",
        }
    mechanism["bodies"] = {"tip": {"at": "bar.end", "mass": 0.0}}
    tree["design"] = {"m": {"parameter": "bodies.tip.mass", "min": 0.0, "max": 1.0}}
    model = model_of(tree)
    e = expand(model, [], [0.0], (1, 3), 6)
    assert [c.modes for c in e.clusters] == [tuple(range(1, 10))]
    f = model.frequencies([], [0.05], 3)[:, [0, 2]]
    np.testing.assert_allclose(e.frequencies([], [0.05]), f, rtol=1e-4)


def test_a_cluster_is_expanded_sparsely_as_well() -> None:
    pencil = crossing(1e-2)
    dense = expand_pencil(pencil, [0.0, 0.1], [], (1, 2), 5)
    thin = expand_pencil(large(pencil), [0.0, 0.1], [], (1, 2), 5)
    np.testing.assert_allclose(
        thin.clusters[0].coefficients, dense.clusters[0].coefficients, atol=1e-10
    )
