"""How much a mesh of solids raises λ: what its elements would take off it with one degree more.

Functions of the next degree, zero at all nodes, are added while the nodes move on by u, uᵀM u = 1
(Zienkiewicz, Gago and Kelly, Computers & Structures 16 (1983) 53):

    Δλ = rᵀ K_bb⁻¹ r,   r = (K_bn − λ M_bn) u.

With L_a the (tri)linear function of corner a, and N_ab that of the node between two corners:

    4 nodes     L_a L_b of each edge
    10 nodes    N_ab (L_b − L_a) of each edge, L_a L_b L_c of each face
    20 nodes    N_ab × the coordinate from a to b, L_a L_c of each face

Averaged stresses (Zienkiewicz and Zhu) show as little as a third of what the ends of surfaces that
move as one cost. Functions on surfaces that nodes of the part stand for are left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.mechanism.solids.elements import (
    KINDS,
    assembled,
    dofs,
    gradients,
    shapes,
    slopes,
    strain_energy,
)
from eigassign.mechanism.solids.mesh_file import SolidMesh

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
AT_ONCE = 500  # elements, of up to 60 functions
# λ loses so many times what the next degree takes off it. Surfaces that move as one have corners
# where that is about half; see tests/mechanism/elements/test_solid_meshes.py
LEFT = {4: 1.1, 10: 1.9, 20: 2.0}
# Of conjugate gradients: within 4 % of an exact solve on bars, blocks and channels of tetrahedra,
# within 11 % on a thin plate
STEPS = 12


@dataclass(frozen=True, eq=False)
class Enriched:
    """The functions that a mesh lacks, for E = 1 and ρ = 1."""

    stiffness: sparse.csr_array  # K_bb, (3 n_b, 3 n_b)
    to_nodes: sparse.csr_array  # K_bn, (3 n_b, 3 n)
    mass: sparse.csr_array  # M_bn, (n_b, n)
    left: float
    one_layer: bool  # most elements are of four nodes, all of them on the surface

    def gram(self, u: Floats) -> Floats:
        """G of motions u (3 n, count): Δλ = wᵀ G w / E with w = [E c, −λ ρ c], (2 count, 2 count).

        The mode's motion is u c.
        """
        count = u.shape[1]
        inertia = (self.mass @ u.reshape(self.mass.shape[1], -1)).reshape(-1, count)
        R = np.hstack([self.to_nodes @ u, inertia])
        G = R.T @ self._solved(R)
        return np.asarray(0.5 * self.left * (G + G.T))

    def _solved(self, R: Floats) -> Floats:
        """K_bb⁻¹ R, about, by one polynomial in K_bb for all columns: rigid motion cancels."""
        d = 1.0 / self.stiffness.diagonal()[:, None]
        size = np.maximum(np.sqrt((d * R * R).sum(axis=0)), np.finfo(float).tiny)
        r, X = R / size, np.zeros_like(R)
        p = d * r
        rest = (r * p).sum()
        for _ in range(STEPS):
            if not rest > 0.0:
                break
            ahead = self.stiffness @ p
            step = rest / (p * ahead).sum()
            X, r = X + step * p, r - step * ahead
            before, rest = rest, (r * d * r).sum()
            p = d * r + (rest / before) * p
        return np.asarray(X * size)


def enriched(mesh: SolidMesh, nu: float, held: Ints) -> Enriched:
    """The functions that a mesh lacks; those within the ``held`` nodes of its surfaces are zero."""
    keys = []  # the number of nodes of an element, and the corners of the edge or face, sorted
    for count, rows in mesh.elements.items():
        for each in owners(count):
            keys.append(np.full((len(rows), 5), -1))
            keys[-1][:, 0], keys[-1][:, 1 : 1 + len(each)] = count, np.sort(rows[:, each], axis=1)
    names, place = np.unique(np.vstack(keys), axis=0, return_inverse=True)
    n, n_b, done = len(mesh.x), len(names), 0
    K, M = sparse.csr_array((3 * n_b, 3 * (n + n_b))), sparse.csr_array((n_b, n))
    for count, elements in mesh.elements.items():
        size = len(elements) * len(owners(count))
        own = place.ravel()[done : done + size].reshape(-1, len(elements)).T
        done += size
        for k in range(0, len(elements), AT_ONCE):
            rows, to = elements[k : k + AT_ONCE], own[k : k + AT_ONCE]
            stiff, heavy = _matrices(mesh.x[rows], rows, count, nu)
            K = K + assembled(stiff, dofs(to), dofs(np.hstack([rows, n + to])), K.shape)
            M = M + assembled(heavy, to, rows, M.shape)
    free = np.flatnonzero(~np.isin(names[:, 1:], np.append(held, -1)).all(axis=1))
    K, left = K[dofs(free[None])[0]], max(LEFT[count] for count in mesh.elements)
    return Enriched(K[:, dofs(n + free[None])[0]], K[:, : 3 * n], M[free], left, _one_layer(mesh))


def owners(count: int) -> list[tuple[int, ...]]:
    """The corners of the edges and faces that the functions of a kind belong to."""
    return [*KINDS[count].edges, *KINDS[count].faces] if count > 4 else list(KINDS[10].edges)


def bubbles(count: int, xi: Any) -> Any:
    """The functions of a kind at real or complex places xi (n, 3): (n, n_functions)."""
    kind, linear = KINDS[count], count < 20
    L = shapes(4, xi) if linear else np.prod(0.5 * (1.0 + xi[:, None] * kind.corners), axis=2)
    a, b = np.array(kind.edges or KINDS[10].edges).T
    if count == 4:
        return L[:, a] * L[:, b]
    along = L[:, b] - L[:, a] if linear else xi @ (0.5 * (kind.corners[b] - kind.corners[a])).T
    edges = shapes(count, xi)[:, len(kind.corners) :] * along
    faces = [L[:, face if linear else face[::2]].prod(axis=1) for face in kind.faces]
    return np.column_stack([edges, *faces])


def _matrices(x: Floats, rows: Ints, count: int, nu: float) -> tuple[Floats, Floats]:
    """K_b,nb (m, 3 k, 3 n_nodes + 3 k) and ∫ N_b N_n dV of elements with nodes x (m, n_nodes, 3).

    Both elements of an edge count along it alike.
    """
    xi, weights = KINDS[count].heavy
    sign = np.ones((len(rows), count + len(owners(count))))
    for k, (a, b) in enumerate(KINDS[count].edges):
        sign[:, count + k] = np.where(rows[:, a] < rows[:, b], 1.0, -1.0)
    dN = np.concatenate([slopes(count, xi), slopes(count, xi, bubbles)], axis=2)
    dN, det = gradients(x, count, xi, dN)
    K = strain_energy(dN * sign[:, None, None], det * weights, nu)
    N = (bubbles(count, xi), shapes(count, xi))
    M = np.einsum("mg,gi,gj->mij", det * weights, *N, optimize=True)
    return K[:, 3 * count :], M * sign[:, count:, None]


def _one_layer(mesh: SolidMesh) -> bool:
    """True where most elements have four nodes, all of them on the surface: no two in a wall."""
    rows = mesh.elements.get(4, np.zeros((0, 4), dtype=np.intp))
    faces = np.sort(rows[:, np.array(KINDS[4].faces)].reshape(-1, 3), axis=1)
    names, times = np.unique(faces, axis=0, return_counts=True)
    outside = np.isin(rows, names[times == 1]).all(axis=1).sum()
    return bool(2 * outside > sum(map(len, mesh.elements.values())))
