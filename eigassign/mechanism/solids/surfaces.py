"""Nodes that stand for surfaces of a solid mesh, as rigid bodies (RBE2) or by the mean (RBE3).

With q the motion of the node, r the arms from its place, s those from the centre of the surface, d
that of its place, and A = 1:

    rigid           u = q_u + q_θ × r                                   the surface follows
    distributing    q_θ = J⁻¹ ∫ s × u dA,  q_u = ∫ u dA + q_θ × d       it follows their mean

where J = ∫ s·s 1 − s sᵀ dA. Six dofs of the surface, by pivots, follow from q and the others.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import qr
from scipy.sparse.csgraph import connected_components

from eigassign.mechanism.solids.elements import KINDS, jacobians, shapes
from eigassign.mechanism.solids.mesh_file import SolidMesh

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
ON_A_LINE = 1e-9  # of the second moment of a surface, about the line that its nodes lie on
# each pair of dofs of a distributing surface makes an entry: 1 000 nodes take 200 MB
MOST_DISTRIBUTING = 1000


class Coupling(NamedTuple):
    """A node at ``place`` (3,), m, that stands for the nodes ``own`` of a surface."""

    own: Ints
    place: Floats
    rigid: bool


class UnfitSurfaceError(Exception):
    """The surface cannot be stood for; begins with a verb."""


def centre(mesh: SolidMesh, own: Ints) -> Floats:
    """The centre (3,) of a surface of the nodes ``own``."""
    return _moments(mesh, own)[0] @ mesh.x[own]


def _moments(mesh: SolidMesh, own: Ints) -> tuple[Floats, Floats]:
    """∫ N_i dA (n,) and ∫ N_i x dA (n, 3) of a surface of the nodes ``own``, for an area of 1.

    Its faces are those all of whose nodes are among them; those of two elements are inside the
    part. Without any its nodes count alike.
    """
    inside = np.zeros(len(mesh.x), dtype=bool)
    inside[own] = True
    faces: dict[tuple[int, ...], tuple[Ints, Floats]] = {}
    for count, elements in mesh.elements.items():
        kind = KINDS[count]
        for k, corners in enumerate(kind.faces):
            nodes = elements[:, kind.face(k)]
            chosen = np.flatnonzero(inside[nodes].all(axis=1))
            shares = _shares(mesh.x[elements[chosen]], count, kind.corners[list(corners)])
            keys = np.sort(nodes[chosen][:, : len(corners)], axis=1).tolist()
            for key, row, share in zip(map(tuple, keys), elements[chosen], shares, strict=True):
                faces[key] = (row, share if key not in faces else 0.0 * share)
    found = np.zeros((len(mesh.x), 4))
    for row, share in faces.values():
        found[row] += share
    if (area := found[own, 0].sum()) > 0.0:
        return found[own, 0] / area, found[own, 1:] / area
    return np.full(len(own), 1.0 / len(own)), mesh.x[own] / len(own)


def _shares(x: Floats, count: int, corners: Floats) -> Floats:
    """∫ N_i [1, x] dA over one face of elements with nodes x (m, n_nodes, 3): (m, n_nodes, 4)."""
    across = np.array([corners[1] - corners[0], corners[-1] - corners[0]])
    g, v = np.polynomial.legendre.leggauss(3)
    at = 0.5 + 0.5 * np.array([(a, b) for a in g for b in g])
    w = 0.25 * np.outer(v, v).ravel()
    if len(corners) == 3:  # a square whose one side is a point
        at, w = np.stack([at[:, 0], at[:, 1] * (1.0 - at[:, 0])], axis=1), w * (1.0 - at[:, 0])
    xi = corners[0] + at @ across
    tangents, N = across @ jacobians(x, count, xi), shapes(count, xi)
    area = w * np.linalg.norm(np.cross(tangents[:, :, 0], tangents[:, :, 1]), axis=2)
    places = np.concatenate([np.ones((*area.shape, 1)), N @ x], axis=2)
    return np.asarray(N.T @ (area[:, :, None] * places))


def joined(mesh: SolidMesh, couplings: Mapping[str, Coupling]) -> tuple[sparse.csr_array, Ints]:
    """T, u = T [q; u_f], (3 n, 6 n_couplings + n_free), and the dofs u_f of the mesh.

    Raises UnfitSurfaceError (name, why) where the node of this name cannot stand for its surface.
    """
    owner: dict[int, str] = {}
    for name, each in couplings.items():
        for node in each.own.tolist():
            if (other := owner.setdefault(node, name)) != name:
                raise UnfitSurfaceError(name, f"shares nodes with that of {other!r}")
    found = [_followers(mesh, name, each) for name, each in couplings.items()]
    n, first = 3 * len(mesh.x), 6 * len(found)
    free = np.setdiff1d(np.arange(n), np.concatenate([one.dofs for one in found]))
    place = np.full(n, -1)
    place[free] = first + np.arange(len(free))
    rows, columns, values = [free], [place[free]], [np.ones(len(free))]
    for k, one in enumerate(found):
        to = np.append(6 * k + np.arange(6), place[one.others])
        rows.append(np.repeat(one.dofs, len(to)))
        columns.append(np.tile(to, len(one.dofs)))
        values.append(one.motion.ravel())
    where = (np.concatenate(rows), np.concatenate(columns))
    return sparse.csr_array((np.concatenate(values), where), shape=(n, first + len(free))), free


class _Followers(NamedTuple):
    """Dofs of a surface that are given: u = motion [q; u_others]."""

    dofs: Ints
    others: Ints
    motion: Floats  # (n_dofs, 6 + n_others)


def _followers(mesh: SolidMesh, name: str, each: Coupling) -> _Followers:
    x, dofs = mesh.x[each.own], (3 * each.own[:, None] + np.arange(3)).ravel()
    w, _, levers, J = moments(mesh, each)
    values = np.linalg.eigvalsh(0.5 * (J + J.T))
    if not values[0] > ON_A_LINE * values[-1]:
        raise UnfitSurfaceError(
            name, "has nodes on one line only, about which no turn is defined: name a surface"
        )
    if each.rigid:
        return _Followers(dofs, dofs[:0], rigid_rows(x - each.place))
    if len(each.own) > MOST_DISTRIBUTING:
        raise UnfitSurfaceError(
            name,
            f"has {len(each.own)} nodes, distributing is for {MOST_DISTRIBUTING} at most: name a "
            "smaller surface, or write coupling: rigid",
        )
    mean = np.kron(w, np.eye(3))
    turn = np.linalg.solve(J, np.hstack([crossed(lever) for lever in levers]))
    B = np.vstack([mean - crossed(each.place - w @ x) @ turn, turn])
    size = np.append(np.ones(3), np.full(3, np.sqrt(values[-1])))[:, None]  # turns as lengths
    order = qr(B * size, mode="r", pivoting=True)[1]
    six, rest = np.sort(order[:6]), np.sort(order[6:])
    inverse = np.linalg.inv(B[:, six])
    return _Followers(dofs[six], dofs[rest], np.hstack([inverse, -inverse @ B[:, rest]]))


def moments(mesh: SolidMesh, each: Coupling) -> tuple[Floats, Floats, Floats, Floats]:
    """Of a surface ∫ N_i dA (n,), arms s (n, 3), ∫ N_i s dA (n, 3) and J (3, 3).

    Where it moves as one its nodes count alike.
    """
    x = mesh.x[each.own]
    w, first = (
        (np.full(len(x), 1.0 / len(x)), x / len(x)) if each.rigid else _moments(mesh, each.own)
    )
    arms, levers = x - w @ x, first - np.outer(w, w @ x)
    return w, arms, levers, (levers * arms).sum() * np.eye(3) - arms.T @ levers


def pieces(mesh: SolidMesh) -> int:
    """How many parts of a mesh share no node."""
    pairs = [
        (np.repeat(e[:, :1], e.shape[1] - 1), e[:, 1:].ravel()) for e in mesh.elements.values()
    ]
    rows, columns = (np.concatenate(each) for each in zip(*pairs, strict=True))
    n = len(mesh.x)
    graph = sparse.coo_array((np.ones(len(rows)), (rows, columns)), shape=(n, n))
    return int(connected_components(graph, directed=False)[0])


def rigid_rows(arms: Floats) -> Floats:
    """u = v + θ × r of points at arms r (n, 3): (3 n, 6)."""
    return np.vstack([np.hstack([np.eye(3), -crossed(arm)]) for arm in arms])


def crossed(a: Floats) -> Floats:
    """[a]×"""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])
