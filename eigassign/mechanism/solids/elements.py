"""Stiffness and mass of solid elements: tetrahedra of 4 and 10 nodes, hexahedra of 20 nodes.

Isoparametric, x(ξ) = Σ N_i(ξ) x_i and u likewise, with Lamé's λ and μ of E = 1 and with ρ = 1:

    K_ia,jb = ∫ λ N_i,a N_j,b + μ N_i,b N_j,a + μ δ_ab N_i,c N_j,c dV,   M_ia,jb = δ_ab ∫ N_i N_j dV

The shape functions are the polynomials of a kind that are 1 at their own node and 0 at all others.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.special import roots_jacobi

from eigassign.arrays import Floats, Ints


class Kind(NamedTuple):
    """A kind of element: corners first, then the node in the middle of each of its ``edges``."""

    corners: Floats  # (n_corners, 3) their places ξ
    edges: tuple[tuple[int, int], ...]
    faces: tuple[tuple[int, ...], ...]  # corners of each, as Abaqus numbers faces
    exponents: Floats  # (n_nodes, 3) of the monomials ξ^i η^j ζ^k
    points: Floats  # (n_g, 3) where the stiffness is integrated
    weights: Floats  # (n_g,)
    mirrored: tuple[int, ...]  # its corners in an order that turns it outside in
    heavy: tuple[Floats, Floats]  # points and weights of the mass

    @property
    def nodes(self) -> Floats:
        """The places ξ of all nodes, (n_nodes, 3)."""
        middle = [0.5 * (self.corners[a] + self.corners[b]) for a, b in self.edges]
        return np.vstack([self.corners, *middle])

    def face(self, k: int) -> list[int]:
        """All nodes of face k, corners first."""
        own, n = self.faces[k], len(self.corners)
        return [*own, *(n + e for e, edge in enumerate(self.edges) if {*edge} <= {*own})]

    def turned(self) -> list[int]:
        """All nodes in the order that turns the element outside in."""
        n = len(self.corners)
        place = {frozenset(edge): n + e for e, edge in enumerate(self.edges)}
        pairs = [frozenset((self.mirrored[a], self.mirrored[b])) for a, b in self.edges]
        return [*self.mirrored, *(place[pair] for pair in pairs)]


def _gauss(n: int) -> tuple[Floats, Floats]:
    """n³ points of a cube."""
    x, w = np.polynomial.legendre.leggauss(n)
    return np.array(list(product(x, repeat=3))), np.prod(list(product(w, repeat=3)), axis=1)


def _conical() -> tuple[Floats, Floats]:
    """27 points of a tetrahedron, for polynomials up to degree 5."""
    rules = [roots_jacobi(3, k, 0) for k in (0, 1, 2)]
    (a, b, c), w = (np.array(list(product(*(rule[i] for rule in rules)))).T for i in (0, 1))
    z, y = 0.5 * (1 + c), 0.25 * (1 + b) * (1 - c)
    return np.stack([0.125 * (1 + a) * (1 - b) * (1 - c), y, z], axis=1), w.prod(axis=0) / 64.0


_SIMPLEX = np.vstack([np.zeros(3), np.eye(3)])
_CUBE = np.array([*product((-1, 1), repeat=3)], dtype=float)[[0, 4, 6, 2, 1, 5, 7, 3]]
_POWERS = np.array(list(product(range(3), repeat=3)), dtype=float)
_TET_EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
_TET_FACES = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))
_HEX_EDGES = tuple(
    [(k, (k + 1) % 4) for k in range(4)]
    + [(4 + k, 4 + (k + 1) % 4) for k in range(4)]
    + [(k, 4 + k) for k in range(4)]
)
_HEX_FACES = ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0))
# exact for the strains of straight elements of ten nodes, of degree 2
_NEAR, _FAR = (5.0 - np.sqrt(5.0)) / 20.0, (5.0 + 3.0 * np.sqrt(5.0)) / 20.0
_FOUR = _NEAR + (_FAR - _NEAR) * _SIMPLEX
_SERENDIPITY = _POWERS[(_POWERS * (_POWERS > 1)).sum(axis=1) <= 2]

KINDS = {
    4: Kind(
        *(_SIMPLEX, (), _TET_FACES, _POWERS[_POWERS.sum(axis=1) <= 1]),
        *(np.full((1, 3), 0.25), np.array([1 / 6]), (0, 2, 1, 3), _conical()),
    ),
    10: Kind(
        *(_SIMPLEX, _TET_EDGES, _TET_FACES, _POWERS[_POWERS.sum(axis=1) <= 2]),
        *(_FOUR, np.full(4, 1 / 24), (0, 2, 1, 3), _conical()),
    ),
    20: Kind(
        _CUBE, _HEX_EDGES, _HEX_FACES, _SERENDIPITY, *_gauss(3), (4, 5, 6, 7, 0, 1, 2, 3), _gauss(3)
    ),
}


@cache
def _monomials(count: int) -> Floats:
    """The coefficients of the shape functions of a kind in its monomials, (n_nodes, n_nodes)."""
    kind = KINDS[count]
    return np.asarray(np.linalg.inv(_powers(kind.nodes, kind.exponents)))


def _powers(xi: Any, exponents: Floats) -> Any:
    return np.prod(xi[:, None] ** exponents, axis=2)


def shapes(count: int, xi: Any) -> Any:
    """The shape functions of a kind at real or complex places xi (n, 3): (n, n_nodes)."""
    return _powers(xi, KINDS[count].exponents) @ _monomials(count)


def slopes(count: int, xi: Floats, functions: Callable[[int, Any], Any] = shapes) -> Floats:
    """Their derivatives by ξ, (n, 3, n_nodes): exact, by a step along the imaginary axis."""
    steps = 1e-30j * np.eye(3)
    return np.stack([functions(count, xi + step).imag / 1e-30 for step in steps], axis=1)


def jacobians(x: Floats, count: int, xi: Floats) -> Floats:
    """∂x/∂ξ of elements with nodes x (m, n_nodes, 3): (m, n, 3, 3)."""
    return np.asarray(slopes(count, xi)[None] @ x[:, None])


def gradients(x: Floats, count: int, xi: Floats, dN: Floats) -> tuple[Floats, Floats]:
    """∂N/∂x (m, n, 3, k) of ∂N/∂ξ (n, 3, k), and det ∂x/∂ξ (m, n)."""
    J = jacobians(x, count, xi)
    dN = np.asarray(np.linalg.solve(J, np.broadcast_to(dN, (*J.shape[:2], *dN.shape[1:]))))
    return dN, np.asarray(np.linalg.det(J))


def lame(nu: float) -> tuple[float, float]:
    """Lamé's λ and μ of E = 1."""
    return nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), 0.5 / (1.0 + nu)


def stiffness(x: Floats, count: int, nu: float) -> Floats:
    """K of elements with nodes x (m, n_nodes, 3) for E = 1: (m, 3 n_nodes, 3 n_nodes)."""
    kind = KINDS[count]
    dN, det = gradients(x, count, kind.points, slopes(count, kind.points))
    return strain_energy(dN, det * kind.weights, nu)


def strain_energy(dN: Floats, volume: Floats, nu: float) -> Floats:
    """K of functions with ∂N/∂x (m, n, 3, k) at n points of ``volume`` (m, n): (m, 3 k, 3 k)."""
    (m, _, _, count), (lam, mu) = dN.shape, lame(nu)
    rows = dN.transpose(0, 3, 2, 1).reshape(m, 3 * count, -1)
    H = ((rows * volume[:, None]) @ rows.transpose(0, 2, 1)).reshape(m, count, 3, count, 3)
    same = np.einsum("mcicj->mij", H.transpose(0, 2, 1, 4, 3))
    K = lam * H + mu * H.transpose(0, 1, 4, 3, 2)
    for a in range(3):
        K[:, :, a, :, a] += mu * same
    return K.reshape(m, 3 * count, 3 * count)


def mass(x: Floats, count: int) -> Floats:
    """∫ N_i N_j dV of elements with nodes x (m, n_nodes, 3): (m, n_nodes, n_nodes)."""
    xi, weights = KINDS[count].heavy
    det = np.linalg.det(jacobians(x, count, xi))
    N = shapes(count, xi)
    products = np.einsum("gi,gj->gij", N, N).reshape(len(xi), -1)
    return np.asarray(((det * weights) @ products).reshape(len(x), count, count))


def dofs(nodes: Ints) -> Ints:
    """The three of each node (m, k): (m, 3 k)."""
    return (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), -1)


def assembled(blocks: Floats, rows: Ints, columns: Ints, shape: Any) -> sparse.csr_array:
    """Σ of the elements' matrices (m, k, l) at their ``rows`` (m, k) and ``columns`` (m, l)."""
    at = (
        np.broadcast_to(each, blocks.shape).ravel() for each in (rows[:, :, None], columns[:, None])
    )
    return sparse.csr_array((blocks.ravel(), tuple(at)), shape=shape)
