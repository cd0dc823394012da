"""A solid part by its mesh: K of E = 1, M of ρ = 1, nodes for its surfaces, what its mesh lacks.

Functions of the next degree, zero at all nodes, are added while the nodes move on by u, uᵀM u = 1
(Zienkiewicz, Gago and Kelly, Computers & Structures 16 (1983) 53):

    Δλ = rᵀ K_bb⁻¹ r,   r = (K_bn − λ M_bn) u.

With L_a the (tri)linear function of corner a, and N_ab that of the node between two corners:

    4 nodes     L_a L_b of each edge
    10 nodes    N_ab (L_b − L_a) of each edge, L_a L_b L_c of each face
    20 nodes    N_ab × the coordinate from a to b, L_a L_c of each face

Averaged stresses (Zienkiewicz and Zhu) show as little as a third of what the ends of surfaces that
move as one cost. Functions on surfaces that nodes of the part stand for are left out.

With q the motion of the node, r the arms from its place, s those from the centre of the surface, d
that of its place, and A = 1:

    rigid           u = q_u + q_θ × r                                   the surface follows
    distributing    q_θ = J⁻¹ ∫ s × u dA,  q_u = ∫ u dA + q_θ × d       it follows their mean

where J = ∫ s·s 1 − s sᵀ dA. Six dofs of the surface, by pivots, follow from q and the others.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.linalg import qr
from scipy.sparse.csgraph import connected_components

from eigassign.arrays import Floats, Ints
from eigassign.case.reader import listed, shown
from eigassign.case.units import DIMENSIONS
from eigassign.errors import MechanismError
from eigassign.mechanism.imports.parts import UNITS
from eigassign.mechanism.solids.elements import (
    KINDS,
    assembled,
    dofs,
    gradients,
    jacobians,
    mass,
    shapes,
    slopes,
    stiffness,
    strain_energy,
)
from eigassign.mechanism.solids.mesh_file import SolidMesh, read_mesh

ELEMENTS_AT_ONCE = 500  # elements, of up to 60 functions
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
        for k in range(0, len(elements), ELEMENTS_AT_ONCE):
            rows, to = elements[k : k + ELEMENTS_AT_ONCE], own[k : k + ELEMENTS_AT_ONCE]
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
    """K_b,nb (m, 3 k, 3 n_nodes + 3 k), ∫ N_b N_n dV of elements with nodes x (m, n_nodes, 3)."""
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


ON_A_LINE = 1e-9  # of the second moment of a surface, about the line that its nodes lie on
# each pair of dofs of a distributing surface makes an entry: 1 000 nodes take 200 MB
MOST_DISTRIBUTING = 1000


class Coupling(NamedTuple):
    """A node at ``place`` (3,), m, that stands for the nodes ``own`` of a surface."""

    own: Ints
    place: Floats
    rigid: bool
    alike: bool = False  # of a distributing one the nodes count alike, and not by their area


def centre(mesh: SolidMesh, own: Ints) -> Floats:
    """The centre (3,) of a surface of the nodes ``own``."""
    return _moments(mesh, own)[0] @ mesh.x[own]


def _moments(mesh: SolidMesh, own: Ints) -> tuple[Floats, Floats]:
    """∫ N_i dA (n,) and ∫ N_i x dA (n, 3) of a surface of the nodes ``own``, for an area of 1."""
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


def joined(
    mesh: SolidMesh, couplings: Mapping[str, Coupling], path: str
) -> tuple[sparse.csr_array, Ints]:
    """T, u = T [q; u_f], (3 n, 6 n_couplings + n_free), and the dofs u_f of the mesh.

    Raises MechanismError where a node of the link at ``path`` cannot stand for its surface.
    """
    owner: dict[int, str] = {}
    for name, each in couplings.items():
        for node in each.own.tolist():
            if (other := owner.setdefault(node, name)) != name:
                raise _unfit(path, name, f"shares nodes with that of {other!r}")
    found = [_followers(mesh, path, name, each) for name, each in couplings.items()]
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


def _unfit(path: str, name: str, why: str) -> MechanismError:
    return MechanismError(f"{path}.nodes.{name}.surface", f"the surface {why}")


class _Followers(NamedTuple):
    """Dofs of a surface that are given: u = motion [q; u_others]."""

    dofs: Ints
    others: Ints
    motion: Floats  # (n_dofs, 6 + n_others)


def _followers(mesh: SolidMesh, path: str, name: str, each: Coupling) -> _Followers:
    x, dofs = mesh.x[each.own], (3 * each.own[:, None] + np.arange(3)).ravel()
    w, _, levers, J = moments(mesh, each)
    values = np.linalg.eigvalsh(0.5 * (J + J.T))
    if not values[0] > ON_A_LINE * values[-1]:
        why = "has nodes on one line only, about which no turn is defined: name a surface"
        raise _unfit(path, name, why)
    if each.rigid:
        return _Followers(dofs, dofs[:0], rigid_rows(x - each.place))
    if len(each.own) > MOST_DISTRIBUTING:
        most = f"has {len(each.own)} nodes, distributing is for {MOST_DISTRIBUTING} at most"
        raise _unfit(path, name, f"{most}: name a smaller surface, or write coupling: rigid")
    mean = np.kron(w, np.eye(3))
    turn = np.linalg.solve(J, np.hstack([crossed(lever) for lever in levers]))
    B = np.vstack([mean - crossed(each.place - w @ x) @ turn, turn])
    size = np.append(np.ones(3), np.full(3, np.sqrt(values[-1])))[:, None]  # turns as lengths
    order = qr(B * size, mode="r", pivoting=True)[1]
    six, rest = np.sort(order[:6]), np.sort(order[6:])
    inverse = np.linalg.inv(B[:, six])
    return _Followers(dofs[six], dofs[rest], np.hstack([inverse, -inverse @ B[:, rest]]))


def moments(mesh: SolidMesh, each: Coupling) -> tuple[Floats, Floats, Floats, Floats]:
    """Of a surface ∫ N_i dA (n,), arms s (n, 3), ∫ N_i s dA (n, 3) and J (3, 3)."""
    x, alike = mesh.x[each.own], each.rigid or each.alike
    w, first = (np.full(len(x), 1.0 / len(x)), x / len(x)) if alike else _moments(mesh, each.own)
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


AT_ONCE = 2_000_000  # numbers that are held at a time: entries of elements' matrices
# Volume of an element at a point, of the box of its edges, that is none: files have few digits
FLAT = 1e-9
HUGE = 1e4  # m³, a cube of 21 m; a part of 10 cm³ has that in mm that are read as m
FOLDED = (
    "has elements that are folded, or have no volume (their Jacobian is not positive at a point of "
    "integration): make the mesh finer where its surface is curved, or its elements straight (in "
    "gmsh Mesh.SecondOrderLinear = 1)"
)


@dataclass(frozen=True, eq=False)
class SolidPart:
    """K and M of a part in local dofs: six of each node of it, then those of its mesh."""

    mesh: SolidMesh
    nu: float
    motion: sparse.csr_array  # T, u = T v, (3 n, n_local)
    stiffness: sparse.csr_array  # for E = 1, (n_local, n_local)
    mass: sparse.csr_array  # for ρ = 1
    rigid: Floats  # (n_local, 6)
    nodes: tuple[Coupling, ...]  # what its nodes stand for

    @cached_property
    def lacked(self) -> Enriched:
        """The functions that its mesh lacks."""
        held = np.concatenate([each.own for each in self.nodes])
        return enriched(self.mesh, self.nu, held)


def couplings(link: Any, path: str) -> tuple[SolidMesh, dict[str, Coupling]]:
    """The mesh of a solid link in metres, and what its nodes stand for.

    Raises MechanismError for what cannot be read, and for surfaces that the mesh does not have.
    """
    mesh = _sound(read_mesh(Path(link.mesh), f"{path}.mesh"), UNITS[link.units].length, path)
    known, found = {name.upper(): own for name, own in mesh.sets.items()}, dict[str, Coupling]()
    loose = dict(mesh.joined)
    for name, node in link.nodes.items():
        own = mesh.sets.get(node.surface, known.get(node.surface.upper()))
        if own is None:
            named = listed(mesh.sets) if mesh.sets else "none: name them in the program that meshes"
            message = f"the mesh has no surface {shown(node.surface)}; it has {named}"
            raise MechanismError(f"{path}.nodes.{name}.surface", message)
        place, rigid, alike = centre(mesh, own), True, False
        for key in [key for key in loose if np.array_equal(mesh.sets[key], own)]:
            place, rigid, alike = loose.pop(key)
        if node.position is not None:
            place = np.array([*map(float, node.position), 0.0][:3])
        if node.coupling is not None:
            rigid = node.coupling == "rigid"
        found[name] = Coupling(own, place, rigid, alike)
    for key in loose:
        message = f"couples nodes by {shown(key)}, for which no node of the link stands: add one, "
        message += f"{{surface: {shown(key)}}}, or take the coupling out of the file"
        raise MechanismError(f"{path}.mesh", message)
    return mesh, found


@lru_cache(maxsize=4)
def _sound(mesh: SolidMesh, factor: float, path: str) -> SolidMesh:
    """The mesh in metres; raises MechanismError for one that no part has."""
    far, length = factor * float(np.abs(mesh.x).max()), DIMENSIONS["length"]
    if not length.smallest < far < length.largest:
        message = f"has nodes {far:.3g} m from its origin: is it damaged, or in other units?"
        raise MechanismError(f"{path}.mesh", message)
    joined = {n: own._replace(place=factor * own.place) for n, own in mesh.joined.items()}
    found, volume = replace(mesh, x=factor * mesh.x, joined=joined), 0.0
    for count, rows in found.elements.items():
        for xi, weights in ((KINDS[count].points, 0.0), KINDS[count].heavy):
            J = jacobians(found.x[rows], count, xi)
            det = np.linalg.det(J)
            if (det <= FLAT * np.linalg.norm(J, axis=3).prod(axis=2)).any():
                raise MechanismError(f"{path}.mesh", FOLDED)
            volume += float((det * weights).sum())
    if (count := pieces(found)) > 1:
        message = (
            f"is in {count} pieces that share no nodes: join its volumes where it is meshed (in "
            "gmsh BooleanFragments), or make a link of each"
        )
        raise MechanismError(f"{path}.mesh", message)
    if volume > HUGE:
        message = f"is a part of {volume:.3g} m3: if it is in mm, write units: mm-t-s or mm-kg-ms"
        raise MechanismError(f"{path}.mesh", message)
    return found


def solid_part(link: Any, nu: float, path: str) -> tuple[SolidPart, Mapping[str, Floats]]:
    """The part of a solid link, and the places of its nodes; raises MechanismError."""
    mesh, nodes = couplings(link, path)
    key = tuple((n, c.own.tobytes(), tuple(c.place.tolist()), *c[2:]) for n, c in nodes.items())
    return _made(mesh, nu, key, path), {name: each.place for name, each in nodes.items()}


@lru_cache(maxsize=4)  # a case makes its links for each model anew
def _made(
    mesh: SolidMesh, nu: float, key: tuple[tuple[str, bytes, Any, bool, bool], ...], path: str
) -> SolidPart:
    given = {
        name: Coupling(np.frombuffer(own, dtype=np.intp), np.array(place), *kind)
        for name, own, place, *kind in key
    }
    T, free = joined(mesh, given, path)
    n = T.shape[0]
    K, M = sparse.csr_array((n, n)), sparse.csr_array((n, n))
    for count, rows in mesh.pieces(AT_ONCE // 2000):
        x = mesh.x[rows]
        to = dofs(rows)
        K = K + assembled(stiffness(x, count, nu), to, to, (n, n))
        heavy = np.asarray(np.kron(mass(x, count), np.eye(3)))
        M = M + assembled(heavy, to, to, (n, n))
    whole = rigid_rows(mesh.x)
    turn = np.hstack([np.zeros((3, 3)), np.eye(3)])
    of_nodes = (each for c in given.values() for each in (rigid_rows(c.place[None]), turn))
    rigid = np.vstack([*of_nodes, whole[free]])
    K, M = (sparse.csr_array(T.T @ A @ T) for A in (K, M))
    return SolidPart(mesh, nu, T, 0.5 * (K + K.T), 0.5 * (M + M.T), rigid, tuple(given.values()))
