"""The velocity terms of eq. (1), which the method neglects: built here so that they can be checked.

With the local motion w = B x of a link whose frame turns at ω(t), the velocity of its nodes in its
own axes is B ẋ + P x, P = Ḃ + ω̃ B, and that of its matter N (B ẋ + P x) + Ṅ B x: the shapes N
change at a place of the link where its mesh moves with a carriage or nut. With m = ∫ ρ Nᵀ N,
G = ∫ ρ Nᵀ Ṅ and H = ∫ ρ Ṅᵀ Ṅ the kinetic energy gives

    M = Bᵀ m B,   C = Ṁ + Q − Qᵀ,   K_v = Q̇ − R,
    Q = Bᵀ (m P + G B),   R = Pᵀ m P + Pᵀ G B + Bᵀ Gᵀ P + Bᵀ H B .

C is gyroscopic up to Ṁ; K_v holds the centrifugal and Euler terms. Derivatives in time are central
differences of the kinematics along the motion q(t), q̇(t), q̈(t).

Convection: nodes travel with a carriage or nut, x_a(s) and h(s) in an element, so that the shapes
change at a fixed place x of the beam: with ξ = (x − x_a)/h and Φ of `beam`,

    Ṅ = d/dt N(ξ, h, Φ),   ξ̇ = −(ẋ_a + ξ ḣ)/h .

N and Ṅ are cubic in ξ: four Gauss points integrate their products exactly.

All links stand one below the other in few sparse matrices: B = Ψ (U + N T), with joined nodes U,
twists T spread over the nodes by N, and Ψ what reduced links stand for; m; and the spins ω̃ of the
frames. Each is a fixed pattern: only its numbers change along a motion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from scipy import sparse

from eigassign.arrays import Floats, Ints
from eigassign.case.case_file import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.assembly.build import by_name, local_links
from eigassign.mechanism.assembly.congruence import LocalLink
from eigassign.mechanism.assembly.node_motion import NodeMotions
from eigassign.mechanism.elements.beam import fields
from eigassign.mechanism.elements.links import Entries, LinkMesh, Strand, Term
from eigassign.mechanism.elements.sections import field_inertia
from eigassign.mechanism.kinematics.forward import Kinematics
from eigassign.mechanism.kinematics.joints import CROSS, DOFS, Objects
from eigassign.mechanism.kinematics.loop_closure import all_moving
from eigassign.mechanism.kinematics.parameters import ModelParameters, is_imported
from eigassign.series.compiler import CompiledArrays

Matrix = Any  # sparse, or dense where that is quicker
Values = Sequence[Floats]  # the numbers of all matrices at one instant, see `StackedLinks`
# Of differences in `StackedLinks.time_scale`: they err by its square, 1e-8, and by round-off over
# it, 1e-12.
STEP = 1e-4
IMAGINARY = 1e-30  # step of derivatives along the imaginary axis, which lose no digits


@dataclass(frozen=True, eq=False)
class VelocityTerms:
    """C and K_v of a mechanism along a motion; built once, evaluated at instants."""

    stack: StackedLinks
    table: CompiledArrays
    parameters: ModelParameters
    step: float = STEP

    def at(
        self, q: Floats, y: Floats, rate: Floats, acceleration: Floats
    ) -> tuple[sparse.csr_array, sparse.csr_array]:
        """C [N s/m] and K_v [N/m] (n_dof, n_dof) for q, q̇, q̈ (n_q,) of one instant.

        The loads in q rest.
        """
        h = self.interval(q, y, rate, acceleration)
        t = h * np.arange(-2.0, 3.0)[:, None]
        z = self.values(q + rate * t + acceleration * (t * t / 2.0), y)
        B, W = (
            [self.stack.motion(each) for each in z],
            (rate + acceleration * t)[:, : len(self.parameters.coordinates)],
        )
        m = [self.stack.mass(z[k]) for k in (1, 2, 3)]
        P = [
            (B[k + 1] - B[k - 1]) * (0.5 / h) + self.stack.turned(z[k], W[k], B[k])
            for k in (1, 2, 3)
        ]
        growth = (B[3].T @ m[2] @ B[3] - B[1].T @ m[0] @ B[1]) * (0.5 / h)
        G, H = zip(*(self.stack.convection(z[k - 1 : k + 2], h) for k in (1, 2, 3)), strict=True)
        Q = [b.T @ (a @ p + g @ b) for a, b, p, g in zip(m, B[1:4], P, G, strict=True)]
        cross = P[1].T @ G[1] @ B[2]
        R = P[1].T @ m[1] @ P[1] + cross + cross.T + B[2].T @ H[1] @ B[2]
        C, K = growth + Q[1] - Q[1].T, (Q[2] - Q[0]) * (0.5 / h) - R
        return sparse.csr_array(C), sparse.csr_array(K)

    def interval(self, q: Floats, y: Floats, rate: Floats, acceleration: Floats) -> float:
        """The interval of the differences, s."""
        (z,) = self.values(q[None], y)
        return self.step * self.stack.time_scale(z, rate, acceleration)

    def values(self, q: Floats, y: Floats) -> list[Values]:
        """The numbers of all matrices at each of the poses q (n, n_q)."""
        z = self.parameters.z(np.hstack([q, np.tile(y, (len(q), 1))]))
        return list(zip(*self.table(z), strict=True))


def placeless(case: CaseFile) -> tuple[str, ...]:
    """Superelements and solids: which way their inner dofs point, and so turn, is not known."""
    return tuple(n for n in case.mechanism.links if is_imported(case, n))


def velocity_terms(
    case: CaseFile, parameters: ModelParameters, motion: Kinematics
) -> VelocityTerms:
    """Collect what varies along a motion: carried nodes, twists, spins, mass coefficients.

    Raises MechanismError as `heavy_links` does.
    """
    links, nodes = heavy_links(case, parameters, motion)
    stack, meshes = stacked(links, nodes, all_moving(case, parameters, motion), motion)
    scalars = [*stack.scalars, *(array for mesh in meshes for array in _mesh_scalars(mesh))]
    return VelocityTerms(stack, parameters.compiled(*scalars), parameters)


def heavy_links(
    case: CaseFile, parameters: ModelParameters, motion: Kinematics
) -> tuple[dict[str, LocalLink], NodeMotions]:
    """The links with mass by name, which rigid ones may not have, and the motions of nodes.

    Raises MechanismError for superelements and solids, whose inner dofs have no directions.
    """
    for name in placeless(case):
        message = "has inner dofs of unknown direction: its velocity terms cannot be formed"
        raise MechanismError(f"mechanism.links.{name}", message)
    links, nodes = local_links(case, parameters, motion)
    return {n: link for n, link in by_name(motion, links).items() if whole_mass(link)}, nodes


def stacked(
    links: Mapping[str, LocalLink],
    nodes: NodeMotions,
    moving: Kinematics,
    motion: Kinematics,
) -> tuple[StackedLinks, list[LinkMesh]]:
    """The links one below the other, and the meshes of those on which something rides.

    ``moving`` has every coordinate among its columns, as from `all_moving`.
    """
    kept, n_dof = DOFS[nodes.space], nodes.count + len(motion.columns)
    sizes = [whole_size(link) for link in links.values()]
    n_local, n_whole = sum(len(link.own) for link in links.values()), sum(sizes)
    n_twist = len(kept) * len(links)
    U, N, T = Entries((n_local, n_dof)), Entries((n_local, n_twist)), Entries((n_twist, n_dof))
    m, rates = (
        Entries((n_whole, n_whole)),
        Entries((6 * len(links), len(motion.coordinates.relative))),
    )
    local = whole = 0
    riders, meshes, bases = [], [], []
    for k, (name, link) in enumerate(links.items()):
        own, size = np.flatnonzero(link.own >= 0), sizes[k]
        U.add(1.0, local + own, link.own[own], np.ones(len(own)))
        for slot, row in link.carried.items():
            unknowns = np.array([unknown for unknown, _ in row], dtype=np.intp)
            U.add_scalars([c for _, c in row], np.full(len(row), local + slot), unknowns)
        add_terms(N, link.rigid, local, len(kept) * k)
        _add_dense(T, link.twist, len(kept) * k, nodes.count)
        add_terms(m, whole_mass(link), whole, whole)
        _add_dense(rates, moving.placement(name).twist, 6 * k, 0)
        if motion.tree.riders[name]:
            meshes.append(nodes.meshes[name])
            riders.append(Riding.of(meshes[-1].strands[0], whole, n_whole))
        basis = sparse.eye_array(size) if link.reduction is None else link.reduction.basis
        bases.append(sparse.coo_array(basis))
        local, whole = local + len(link.own), whole + size
    stack = StackedLinks(
        pattern(U),
        pattern(N),
        pattern(T),
        pattern(m),
        pattern(rates),
        sparse.csr_array(sparse.block_diag(bases)) if n_local != n_whole else None,
        np.repeat(np.arange(len(links)), [size // len(kept) for size in sizes]),
        np.array(kept),
        tuple(riders),
    )
    return stack, meshes


def whole_mass(link: LocalLink) -> Sequence[Term]:
    """The mass terms of a link with all its dofs."""
    return link.mass if link.reduction is None else link.reduction.mesh.mass


def whole_size(link: LocalLink) -> int:
    """Number of dofs of a link before it was reduced."""
    return len(link.own) if link.reduction is None else link.reduction.mesh.n_local


def add_terms(out: Entries, terms: Sequence[Term], row: int, column: int) -> None:
    """Σ coefficient × matrix with its corner at (row, column)."""
    for coefficient, matrix in terms:
        A = matrix.tocoo()
        out.add(coefficient, row + A.row.astype(np.intp), column + A.col.astype(np.intp), A.data)


def _add_dense(out: Entries, block: Objects, row: int, column: int) -> None:
    """A block of scalars with its corner at (row, column)."""
    i, j = np.indices(block.shape).reshape(2, -1)
    out.add_scalars(block.ravel().tolist(), row + i, column + j)


# --- convection: a mesh that moves along its beam


@dataclass(frozen=True, eq=False)
class StackedElements:
    """The elements of a row of beams among the dofs of all links."""

    dofs: Ints  # (n, 12) dofs of each element; −1 where a plane has none
    turn: Floats  # (12, 12) from the link's axes to those of the section
    n_whole: int

    @classmethod
    def of(cls, strand: Strand, first: int, n_whole: int) -> Self:
        """The elements of a strand, its link's dofs counted from ``first``."""
        assert strand.axes is not None
        slots = np.array(list(strand.slots), dtype=np.intp)
        slots = np.where(slots >= 0, first + slots, -1)
        turn = np.kron(np.eye(4), strand.axes).astype(np.float64)
        return cls(np.hstack([slots[:-1], slots[1:]]), turn, n_whole)

    def seen(self, values: Floats) -> Floats:
        """Values (n_whole, count) at the dofs of each element in its axes, (n, 12, count)."""
        own = np.where((self.dofs >= 0)[..., None], values[self.dofs], 0.0)
        return np.asarray(self.turn @ own)

    def assembled(self, blocks: Floats) -> sparse.csr_array:
        """Matrices (n, 12, 12) of the elements in the section's axes, on the dofs of all links."""
        blocks = self.turn.T @ blocks @ self.turn
        places = self.dofs[:, :, None], self.dofs[:, None, :]
        rows, columns = (np.broadcast_to(a, blocks.shape) for a in places)
        kept = (rows >= 0) & (columns >= 0)
        entries = (blocks[kept], (rows[kept], columns[kept]))
        return sparse.csr_array(entries, shape=(self.n_whole, self.n_whole))


@dataclass(frozen=True, eq=False)
class Riding(StackedElements):
    """A straight beam whose mesh moves."""

    def at(self, values: Sequence[Values], step: float) -> tuple[sparse.csr_array, ...]:
        """G [kg/s] and H [kg/s²] (n_whole, n_whole) at the middle of three instants ``step`` apart.

        ``values`` at the three are places x (n + 1,) of the nodes, Φ and Φ r (n, 1, 2, 2) of the
        elements, and their inertia (n, n_legendre, 6).
        """
        (x_before, phi_before, _), (x, phi, inertia), (x_after, phi_after, _) = values
        x_rate, phi_rate = (
            (x_after - x_before) * (0.5 / step),
            (phi_after - phi_before) * (0.5 / step),
        )
        h, h_rate = np.diff(x)[:, None], np.diff(x_rate)[:, None]
        xi, weights = np.polynomial.legendre.leggauss(4)
        xi, weights = np.tile(0.5 * (1.0 + xi), (len(h), 1)), 0.5 * weights
        xi_rate = -(x_rate[:-1, None] + xi * h_rate) / h
        moved = 1j * IMAGINARY
        shapes = fields(xi + moved * xi_rate, h + moved * h_rate, phi + moved * phi_rate)
        N, N_rate = shapes.real, shapes.imag / IMAGINARY
        legendre = np.polynomial.legendre.legvander(2.0 * xi[0] - 1.0, inertia.shape[1] - 1)
        matter = h[..., None] * weights[:, None] * (legendre @ inertia)  # (n, n_xi, 6)
        G = np.einsum("epri,epr,eprj->eij", N, matter, N_rate)
        H = np.einsum("epri,epr,eprj->eij", N_rate, matter, N_rate)
        return self.assembled(G), self.assembled(H)


def _mesh_scalars(mesh: LinkMesh) -> list[Objects]:
    """The scalars of a `Riding`: its nodes' places, and shear and inertia of its elements."""
    (strand,) = mesh.strands
    places = [X[0] for X in strand.points]
    shear = np.array(strand.shear, dtype=object).reshape(-1, 1, 2, 2)
    inertia = [[field_inertia(beam) for beam in each] for each in strand.profiles]
    return [np.array(places, dtype=object), shear, np.array(inertia, dtype=object)]


# --- all links one below the other


@dataclass(frozen=True, eq=False)
class Pattern:
    """A sparse matrix Σ c_k A_k: its numbers change, their places do not."""

    coefficients: tuple[Any, ...]  # c_k as scalars
    weights: sparse.csr_array  # entries of A_k as columns, (n_entries, n_coefficients)
    places: Ints  # row and column of each entry as one number, ascending
    shape: tuple[int, int]

    def at(self, c: Floats) -> Matrix:
        """The matrix for numbers c (n_coefficients,)."""
        data = self.weights @ c
        # up to 128 rows and columns dense is quicker
        if max(self.shape) <= 128:
            out = np.zeros(self.shape)
            out.flat[self.places] = data
            return out
        columns, starts = self._compressed
        return sparse.csr_array((data, columns, starts), shape=self.shape)

    def times(self, c: Floats, v: Floats, transposed: bool = False) -> Floats:
        """A v (n, n_rows), or Aᵀ v, of vectors v (n, …) and numbers c (n, n_coefficients)."""
        sides = np.divmod(self.places, self.shape[1])
        to, of = sides[::-1] if transposed else sides
        entries = (np.ones(len(to)), (to, np.arange(len(to))))
        sums = sparse.csr_array(entries, shape=(self.shape[transposed], len(to)))
        return np.asarray(sums @ (np.asarray(self.weights @ c.T) * v.T[of])).T

    @cached_property
    def _compressed(self) -> tuple[Ints, Ints]:
        """Columns of the entries, and where each row starts."""
        rows, width = self.shape
        return self.places % width, np.searchsorted(self.places, np.arange(rows + 1) * width)


def pattern(entries: Entries) -> Pattern:
    """The pattern of an affine matrix."""
    none = np.zeros(0, dtype=np.intp)
    keys, columns, data = [none], [none], [np.zeros(0)]
    for k, (_, groups) in enumerate(entries.groups.values()):
        for i, j, values in groups:
            keys.append(np.asarray(i) * entries.size[1] + np.asarray(j))
            columns.append(np.full(len(i), k))
            data.append(values)
    places, slots = np.unique(np.concatenate(keys), return_inverse=True)
    shape = (len(places), len(entries.groups))
    at = slots, np.concatenate(columns)
    weights = sparse.csr_array((np.concatenate(data), at), shape=shape)
    return Pattern(tuple(c for c, _ in entries.groups.values()), weights, places, entries.size)


@dataclass(frozen=True, eq=False)
class StackedLinks:
    """Links; z are the numbers of the five patterns, then three for each rider."""

    joined: Pattern  # U (n_local, n_dof)
    spread: Pattern  # N (n_local, Σ n_twist)
    twist: Pattern  # T (Σ n_twist, n_dof)
    masses: Pattern  # m (n_whole, n_whole)
    rates: Pattern  # twist (v, ω) per rate of every coordinate, (6 n_links, n_coordinates)
    basis: sparse.csr_array | None  # Ψ (n_whole, n_local); None where no link is reduced
    owners: Ints  # the link of each node
    kept: Ints  # of the six dofs of a node
    riders: tuple[Riding, ...]

    @property
    def scalars(self) -> list[Objects]:
        """The coefficients of the five patterns."""
        patterns = (self.joined, self.spread, self.twist, self.masses, self.rates)
        return [np.array(each.coefficients, dtype=object) for each in patterns]

    def twists(self, z: Values, rate: Floats) -> Floats:
        """Twist (v, ω) of every link in its own axes, (n_links, 6)."""
        return np.asarray(self.rates.at(z[4]) @ rate).reshape(-1, 6)

    def time_scale(self, z: Values, rate: Floats, acceleration: Floats) -> float:
        """The time, s, in which the fastest coordinate or spin moves, or would, by 1 rad or m.

        A screw turns much faster than its nut travels. At rest 1 s.
        """
        n, sizes = self.rates.shape[1], []
        for each in (rate, acceleration):
            spins = self.twists(z, each[..., :n])[:, 3:]
            sizes.append(float(np.abs(np.concatenate([each, spins.ravel()])).max()))
        speed = max(sizes[0], float(np.sqrt(sizes[1])))
        return 1.0 / speed if speed > 0.0 else 1.0

    def motion(self, z: Values) -> Matrix:
        """B (n_whole, n_dof)."""
        B = self.joined.at(z[0]) + self.spread.at(z[1]) @ self.twist.at(z[2])
        return B if self.basis is None else self.basis @ B

    def mass(self, z: Values) -> Matrix:
        """m (n_whole, n_whole)."""
        return self.masses.at(z[3])

    def turned(self, z: Values, rate: Floats, B: Matrix) -> Matrix:
        """ω̃ B, ω̃ on translations and rotations of every node, in its link's axes."""
        spins = self.twists(z, rate)[:, 3:]
        turns = np.zeros((len(spins), 6, 6))
        for i, j, component, sign in CROSS:
            turns[:, i, j] = turns[:, 3 + i, 3 + j] = sign * spins[:, component]
        blocks = turns[np.ix_(self.owners, self.kept, self.kept)]
        if isinstance(B, np.ndarray):
            return (blocks @ B.reshape(len(blocks), len(self.kept), -1)).reshape(B.shape)
        nodes = np.arange(len(blocks) + 1)
        return sparse.bsr_array((blocks, nodes[:-1], nodes), shape=self.masses.shape) @ B

    def convection(
        self, values: Sequence[Values], step: float
    ) -> tuple[sparse.csr_array, sparse.csr_array]:
        """G and H (n_whole, n_whole) at the middle of three instants."""
        shape = self.masses.shape
        G, H = sparse.csr_array(shape), sparse.csr_array(shape)
        for k, rider in enumerate(self.riders):
            own = slice(5 + 3 * k, 8 + 3 * k)
            g, h = rider.at([z[own] for z in values], step)
            G, H = G + g, H + h
        return G, H
