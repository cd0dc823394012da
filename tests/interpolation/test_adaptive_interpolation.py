"""Interpolants to a stated accuracy: met, estimated, no dearer than they must be, or refused."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from eigassign.errors import AccuracyError
from eigassign.interpolation.adaptive import adaptive, interpolate
from eigassign.interpolation.newton import Interpolant, Nodes, interval, leja, newton_polynomials
from eigassign.modal import interval_nodes

Function = Callable[[np.ndarray], np.ndarray]
NODES = interval()[leja(interval(), 20)]


def smooth(v: np.ndarray) -> np.ndarray:
    return np.exp(-0.4 * v[:, :1]) / (2.0 + 0.5 * v[:, 1:2]) + 0.1 * np.cos(2.0 * v[:, 2:])


def made(f: Function, d: int, accuracy: float, most: int = 3000) -> tuple[Interpolant, float, int]:
    """The interpolant, its true error and how many values were asked for."""
    asked = 0

    def sample(members: np.ndarray) -> np.ndarray:
        nonlocal asked
        asked += len(members)
        return f(NODES[members])

    found = interpolate(sample, adaptive([Nodes(interval(), 20)] * d, accuracy, most))
    at = np.random.default_rng(0).uniform(-1.0, 1.0, (500, d))
    at[:100] = np.sign(at[:100])
    g = newton_polynomials(found.members, [NODES] * d, found.coefficients)(at)
    return found, float(np.abs(g ** (1.0 / found.power) / f(at) - 1.0).max()), asked


@pytest.mark.parametrize("accuracy", [1e-2, 1e-4, 1e-6, 1e-8, 1e-10])
def test_the_accuracy_is_met_and_estimated(accuracy: float) -> None:
    found, off, asked = made(smooth, 3, accuracy)
    assert off <= found.error <= accuracy
    assert found.asked == asked


def test_a_higher_accuracy_takes_more_values_but_far_fewer_than_a_grid() -> None:
    counts = [made(smooth, 3, accuracy)[2] for accuracy in (1e-2, 1e-5, 1e-8)]
    assert counts == sorted(counts)
    assert counts[-1] < 600  # a tensor grid of the same degrees has over 2000


def test_an_axis_that_nothing_depends_on_takes_no_degrees() -> None:
    found, off, _ = made(lambda v: np.exp(v[:, :1]), 3, 1e-8)
    assert off <= 1e-8
    assert (found.members[:, 1:] > 0).any(axis=1).sum() <= 12  # those it started with
    assert found.rates[1:].tolist() == [0.0, 0.0]


@pytest.mark.parametrize("power", [1.0, 2.0, -2.0])
def test_the_power_that_is_a_polynomial_is_found(power: float) -> None:
    found, off, _ = made(lambda v: (3.0 + v[:, :1] + v[:, 1:]) ** (1.0 / power), 2, 1e-9)
    assert found.power == power
    assert off < 1e-12
    assert len(found.members) <= 12


def test_an_even_function_does_not_look_finished_before_it_is() -> None:
    found, off, _ = made(lambda v: 1.0 / (1.5 + np.cos(3.0 * v[:, :1])), 1, 1e-5)
    assert off <= found.error <= 1e-5


def test_a_kink_is_refused() -> None:
    with pytest.raises(AccuracyError, match="leave an estimated error of"):
        made(lambda v: 2.0 + np.abs(v[:, :1] - 0.3 + 0.1 * v[:, 1:]), 2, 1e-4, 800)


def test_too_few_values_are_refused() -> None:
    with pytest.raises(AccuracyError, match="over 30 are not allowed"):
        made(smooth, 3, 1e-8, 30)


@pytest.mark.parametrize("accuracy", [1e-2, 1e-3, 1e-6])
def test_values_that_agree_at_the_first_nodes_are_no_constant(accuracy: float) -> None:
    nodes = interval_nodes(48)
    first = nodes.v[: 4 if accuracy > 5e-3 else 7]
    largest = float(np.abs(np.prod(interval()[:, None] - first, axis=1)).max())

    def f(v: np.ndarray) -> np.ndarray:
        return 1.0 + 0.3 / largest * np.prod(v.reshape(-1, 1) - first, axis=1, keepdims=True)

    found = interpolate(lambda k: f(nodes.points[k]), adaptive([nodes], accuracy, 300))
    at = np.linspace(-1.0, 1.0, 301)[:, None]
    g = newton_polynomials(found.members, [nodes.v], found.coefficients)(at)
    assert np.abs(g ** (1.0 / found.power) / f(at) - 1.0).max() <= found.error <= accuracy
    assert found.asked > len(found.members)  # some are held out


def test_a_box_is_checked_at_points_that_are_no_nodes() -> None:
    nodes = interval_nodes(20)

    def f(v: np.ndarray) -> np.ndarray:  # 1 at all nodes of the grid
        return 1.0 + 2e4 * np.prod(v[:, :1] - nodes.v, axis=1, keepdims=True)

    with pytest.raises(AccuracyError, match="leave an estimated error"):
        interpolate(lambda k: f(nodes.points[k]), adaptive([nodes] * 2, 1e-3, 3000))


def test_checks_count_among_the_most_values() -> None:
    asked = made(smooth, 3, 1e-6)[2]
    assert made(smooth, 3, 1e-6, most=asked)[2] == asked
    with pytest.raises(AccuracyError, match=f"over {asked - 1} are not allowed"):
        made(smooth, 3, 1e-6, most=asked - 1)
