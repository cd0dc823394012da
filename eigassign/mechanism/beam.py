"""Planar Euler-Bernoulli beam elements with axial and bending motion, consistent mass.

A chain of n equal elements of length h = L/n has matrices that are affine in few scalars:

    k = (EA/h) k_a + (EI/h³) k_0 + (EI/h²) k_1 + (EI/h) k_2
    m = ρA (h m_0 + h² m_1 + h³ m_2)

with constant k_·, m_· (cubic Hermite bending, linear axial; any text on structural dynamics).
Degrees of freedom of a node: u_x, u_y [m], θ_z [rad], in the frame of the link.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.series.expression import Scalar

Floats = NDArray[np.float64]
PLANAR = 3  # degrees of freedom of a planar node


class Term(NamedTuple):
    """coefficient × constant matrix; one term of an affine local matrix."""

    coefficient: Scalar
    matrix: sparse.csr_array


def beam_stiffness(n: int, E: Scalar, A: Scalar, I: Scalar, length: Scalar) -> list[Term]:  # noqa: E741
    """Affine terms of k (3(n + 1))²; E in Pa, A in m², I in m⁴, length in m."""
    h = length * (1.0 / n)
    EI = E * I
    coefficients = (E * A / h, EI / h**3.0, EI / h**2.0, EI / h)
    return [Term(c, m) for c, m in zip(coefficients, _chain_stiffness(n), strict=True)]


def beam_mass(n: int, mass_per_length: Scalar, length: Scalar) -> list[Term]:
    """Affine terms of the consistent m; ρA in kg/m, length in m."""
    h = length * (1.0 / n)
    coefficients = (mass_per_length * h, mass_per_length * h**2.0, mass_per_length * h**3.0)
    return [Term(c, m) for c, m in zip(coefficients, _chain_mass(n), strict=True)]


def node_mass(n: int, node: int, mass: Scalar, inertia: Scalar) -> list[Term]:
    """Point mass in kg and rotary inertia in kg m² at one node of a chain of n elements."""
    at = PLANAR * node
    return [
        Term(mass, _diagonal(n, (at, at + 1))),
        Term(inertia, _diagonal(n, (at + 2,))),
    ]


def rigid_modes(n: int) -> tuple[sparse.csr_array, sparse.csr_array]:
    """N_0, N_1 of N = N_0 + L N_1: nodal motion per twist (v_x, v_y, ω_z), (3(n + 1)) × 3.

    v_node = v + ω × (ξL, 0, 0): u_y gains ωξL; θ_z = ω.
    """
    return _rigid_modes(n)


@lru_cache(maxsize=256)
def _rigid_modes(n: int) -> tuple[sparse.csr_array, sparse.csr_array]:
    size = PLANAR * (n + 1)
    constant = sparse.csr_array(
        (np.ones(size), (np.arange(size), np.tile(np.arange(PLANAR), n + 1))), shape=(size, PLANAR)
    )
    xi = np.linspace(0.0, 1.0, n + 1)[1:]
    rows = PLANAR * np.arange(1, n + 1) + 1
    per_length = sparse.csr_array((xi, (rows, np.full(n, 2))), shape=(size, PLANAR))
    return constant, per_length


@lru_cache(maxsize=256)
def _chain_stiffness(n: int) -> tuple[sparse.csr_array, ...]:
    return tuple(_repeat(n, e) for e in _element_stiffness())


@lru_cache(maxsize=256)
def _chain_mass(n: int) -> tuple[sparse.csr_array, ...]:
    return tuple(_repeat(n, e) for e in _element_mass())


def _element_stiffness() -> tuple[Floats, ...]:
    """k_a, k_0, k_1, k_2 of one element, dofs (u1, v1, θ1, u2, v2, θ2)."""
    axial, cubic, square, linear = (np.zeros((6, 6)) for _ in range(4))
    axial[np.ix_([0, 3], [0, 3])] = [[1, -1], [-1, 1]]
    cubic[np.ix_([1, 4], [1, 4])] = [[12, -12], [-12, 12]]
    square[1, [2, 5]] = square[[2, 5], 1] = 6
    square[4, [2, 5]] = square[[2, 5], 4] = -6
    linear[np.ix_([2, 5], [2, 5])] = [[4, 2], [2, 4]]
    return axial, cubic, square, linear


def _element_mass() -> tuple[Floats, ...]:
    """m_0, m_1, m_2 of one element."""
    zeroth, first, second = (np.zeros((6, 6)) for _ in range(3))
    zeroth[np.ix_([0, 3], [0, 3])] = [[1 / 3, 1 / 6], [1 / 6, 1 / 3]]
    zeroth[np.ix_([1, 4], [1, 4])] = np.array([[156, 54], [54, 156]]) / 420
    first[1, [2, 5]] = first[[2, 5], 1] = np.array([22, -13]) / 420
    first[4, [2, 5]] = first[[2, 5], 4] = np.array([13, -22]) / 420
    second[np.ix_([2, 5], [2, 5])] = np.array([[4, -3], [-3, 4]]) / 420
    return zeroth, first, second


def _repeat(n: int, element: Floats) -> sparse.csr_array:
    """The same element matrix between every pair of neighbouring nodes."""
    i, j = np.nonzero(element)
    shift = PLANAR * np.arange(n)[:, None]
    size = PLANAR * (n + 1)
    values = np.tile(element[i, j], n)
    return sparse.csr_array(
        (values, ((shift + i).ravel(), (shift + j).ravel())), shape=(size, size)
    )


def _diagonal(n: int, positions: tuple[int, ...]) -> sparse.csr_array:
    size = PLANAR * (n + 1)
    at = np.array(positions)
    return sparse.csr_array((np.ones(len(at)), (at, at)), shape=(size, size))
