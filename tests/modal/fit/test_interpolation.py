"""Interpolants: identities of Newton's basis, and errors that are estimated, met or refused."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np
import pytest

from eigassign.errors import AccuracyError
from eigassign.modal import Interpolant, Nodes, basis_at, interpolate, interval_nodes, sample_nodes
from eigassign.series import total_degree

Function = Callable[[np.ndarray], np.ndarray]
NODES = interval_nodes(20)


def smooth(v: np.ndarray) -> np.ndarray:
    return np.exp(-0.4 * v[:, 0]) / (2.0 + 0.5 * v[:, 1]) + 0.1 * np.cos(2.0 * v[:, 2])


def made(
    f: Function, axes: Sequence[Nodes], accuracy: float | None, most: int = 3000
) -> tuple[Interpolant, float, int]:
    """The interpolant of a mode without neighbours, its true error and how many values it asked."""
    asked = 0

    def ask(points: np.ndarray) -> np.ndarray:
        nonlocal asked
        asked += len(points)
        at = [each.points[column] for each, column in zip(axes, points.T, strict=True)]
        return np.column_stack([f(np.column_stack(at)), np.full(len(points), np.inf)])

    found = interpolate(axes, ask, (1,), accuracy, most)
    at = np.random.default_rng(0).uniform(-1.0, 1.0, (500, len(axes)))
    at[:100] = np.sign(at[:100])
    g = (basis_at(axes, found.members, at) @ found.coefficients.T)[:, 0]
    return found, float(np.abs(g ** (1.0 / found.power) / f(at) - 1.0).max()), asked


@pytest.mark.parametrize("nodes", [NODES, sample_nodes(np.linspace(-1.0, 1.0, 152), 20)])
def test_nodes_are_distinct_and_the_basis_is_at_most_one_everywhere(nodes: Nodes) -> None:
    assert len(set(nodes.v.tolist())) == 20
    members = np.arange(20)[:, None]
    h = basis_at([nodes], members, nodes.v[:, None])
    np.testing.assert_allclose(np.diag(h), 1.0)
    assert np.abs(np.triu(h, 1)).max() == 0.0
    assert np.abs(basis_at([nodes], members, nodes.domain[:, None])).max() <= 1.0 + 1e-12
    assert not set(nodes.checks.tolist()) & set(nodes.v.tolist())


def test_fewer_samples_than_nodes_are_all_taken() -> None:
    nodes = sample_nodes(np.linspace(-1.0, 1.0, 5), 20)
    assert sorted(nodes.v.tolist()) == [-1.0, -0.5, 0.0, 0.5, 1.0]
    assert nodes.whole


def test_a_polynomial_of_the_set_is_reproduced_wherever_it_is_evaluated() -> None:
    members, axes = total_degree(3, 4).indices, [NODES] * 3

    def f(v: np.ndarray) -> np.ndarray:
        x, y, z = v.T
        return 1.0 + x * y * z - 2.0 * x**3 * z + y**4 + z

    v = NODES.v[members]
    c = np.linalg.solve(basis_at(axes, members, v), f(v))
    at = np.random.default_rng(2).uniform(-1.0, 1.0, (700, 3))
    np.testing.assert_allclose(basis_at(axes, members, at) @ c, f(at), atol=1e-12)


def test_a_coefficient_is_the_error_of_the_interpolant_before_it() -> None:
    def f(v: np.ndarray) -> np.ndarray:
        return np.exp(0.1 * v[:, 0])

    c = {k: made(f, [NODES], None, k)[0] for k in range(4, 9)}
    for k in range(4, 8):
        v = NODES.v[k : k + 1, None]
        before = basis_at([NODES], c[k].members, v) @ c[k].coefficients[0]
        assert c[k].power == c[k + 1].power
        assert c[k + 1].coefficients[0, k] == pytest.approx(
            f(v)[0] ** c[k].power - before[0], abs=1e-14
        )


@pytest.mark.parametrize("accuracy", [1e-2, 1e-4, 1e-6, 1e-8, 1e-10])
def test_the_accuracy_is_met_and_estimated(accuracy: float) -> None:
    found, off, asked = made(smooth, [NODES] * 3, accuracy)
    assert off <= found.error <= accuracy
    assert found.asked == asked > len(found.members)  # some are held out


def test_a_higher_accuracy_takes_more_values_but_far_fewer_than_a_grid() -> None:
    counts = [made(smooth, [NODES] * 3, accuracy)[2] for accuracy in (1e-2, 1e-5, 1e-8)]
    assert counts == sorted(counts)
    assert counts[-1] < 600  # a tensor grid of the same degrees has over 2000


def test_an_axis_that_nothing_depends_on_takes_no_degrees() -> None:
    found, off, _ = made(lambda v: np.exp(v[:, 0]), [NODES] * 3, 1e-8)
    assert off <= 1e-8
    assert (found.members[:, 1:] > 0).any(axis=1).sum() <= 12  # those it started with
    assert found.rates[1:].tolist() == [0.0, 0.0]


@pytest.mark.parametrize("power", [1.0, 2.0, -2.0])
def test_the_power_that_is_a_polynomial_is_found(power: float) -> None:
    found, off, _ = made(lambda v: (3.0 + v.sum(axis=1)) ** (1.0 / power), [NODES] * 2, 1e-9)
    assert found.power == power
    assert off < 1e-12
    assert found.asked <= 40


def test_an_even_function_does_not_look_finished_before_it_is() -> None:
    found, off, _ = made(lambda v: 1.0 / (1.5 + np.cos(3.0 * v[:, 0])), [NODES], 1e-5)
    assert off <= found.error <= 1e-5


@pytest.mark.parametrize(
    "f",
    [
        lambda v: 1.0 / (1.3 - v[:, 0] * v[:, 1]),
        lambda v: 2.0 + np.exp(v[:, 0] * v[:, 1]),
        lambda v: 2.0 + 0.5 * np.sin(3.0 * v[:, 0] * v[:, 1]),
        lambda v: 1.0 / (2.0 + v[:, 0] ** 2 * v[:, 1] ** 2 * np.exp(v[:, 0])),
    ],
    ids=["pole", "exponential", "wave", "even"],
)
def test_what_depends_on_two_axes_only_together_does_not_look_constant(f: Function) -> None:
    """Its coefficients vanish on both axes, from which the others seemed to follow."""
    for accuracy in (1e-2, 1e-3, 1e-4, 1e-6):
        found, off, _ = made(f, [NODES] * 2, accuracy)
        assert off <= found.error + 1e-14
        assert found.error <= accuracy
    for count in (24, 36, 48, 60):  # of which those held out are no nodes
        with suppress(AccuracyError):  # most are refused
            found, off, _ = made(f, [NODES] * 2, None, count)
            assert off <= 3.0 * found.error + 1e-14, count


def test_a_kink_is_refused() -> None:
    with pytest.raises(AccuracyError, match="leave an estimated error of"):
        made(lambda v: 2.0 + np.abs(v[:, 0] - 0.3 + 0.1 * v[:, 1]), [NODES] * 2, 1e-4, 800)


@pytest.mark.parametrize("accuracy", [1e-2, 1e-3, 1e-6])
def test_values_that_agree_at_the_first_nodes_are_no_constant(accuracy: float) -> None:
    nodes = interval_nodes(48)
    first = nodes.v[: 4 if accuracy > 5e-3 else 5 if accuracy > 5e-4 else 8]
    largest = float(np.abs(np.prod(nodes.domain[:, None] - first, axis=1)).max())
    found, off, asked = made(
        lambda v: 1.0 + 0.3 / largest * np.prod(v - first, axis=1), [nodes], accuracy, 300
    )
    assert off <= found.error + 1e-14  # a polynomial is found but for round-off
    assert found.error <= accuracy
    assert asked > len(found.members)  # one is held out


def test_a_box_is_checked_at_points_that_are_no_nodes() -> None:
    def f(v: np.ndarray) -> np.ndarray:  # 1 at all nodes of the grid
        return 1.0 + 2e4 * np.prod(v[:, :1] - NODES.v, axis=1)

    with pytest.raises(AccuracyError, match="leave an estimated error"):
        made(f, [NODES] * 2, 1e-3)


def test_checks_count_among_the_most_values() -> None:
    asked = made(smooth, [NODES] * 3, 1e-6)[2]
    assert made(smooth, [NODES] * 3, 1e-6, most=asked)[2] == asked
    with pytest.raises(AccuracyError, match=f"over {asked - 1} are not allowed"):
        made(smooth, [NODES] * 3, 1e-6, most=asked - 1)
