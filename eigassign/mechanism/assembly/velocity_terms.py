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

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.case.case_file import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.assembly.build import local_links
from eigassign.mechanism.assembly.congruence import LocalLink, motion_scalars
from eigassign.mechanism.elements.beam import PLANES, RealOrComplex, bending_shapes, bending_slopes
from eigassign.mechanism.elements.mesh import LinkMesh, Term
from eigassign.mechanism.elements.profiles import field_inertia
from eigassign.mechanism.kinematics.forward import Kinematics
from eigassign.mechanism.kinematics.loop_closure import all_moving
from eigassign.mechanism.kinematics.parameters import ModelParameters, link_type
from eigassign.mechanism.kinematics.rotations import CROSS, DOFS
from eigassign.series.algebra import Samples
from eigassign.series.compiler import CompiledTable, compile_table
from eigassign.series.expression import Scalar

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Matrix = Any  # sparse, or dense where that is quicker
IMAGINARY = 1e-30  # step of derivatives along the imaginary axis, which lose no digits


@dataclass(frozen=True, eq=False)
class VelocityTerms:
    """C and K_v of a mechanism along a motion; built once, evaluated at instants."""

    stack: StackedLinks
    table: CompiledTable
    parameters: ModelParameters
    # Of the differences, in the time in which the fastest coordinate or spin moves, or would, by
    # 1 rad or m: they err by its square, 1e-8, and by round-off over it, 1e-12.
    step: float = 1e-4

    def at(
        self, q: Floats, y: Floats, rate: Floats, acceleration: Floats
    ) -> tuple[sparse.csr_array, sparse.csr_array]:
        """C [N s/m] and K_v [N/m] (n_dof, n_dof) for q, q̇, q̈ (n_q,) of one instant.

        The loads in q rest.
        """
        h = self._step(q, y, rate, acceleration)
        t = h * np.arange(-2.0, 3.0)[:, None]
        z = self.values(q + rate * t + acceleration * (t * t / 2.0), y)
        B, W = [self.stack.motion(each) for each in z], self._joints(rate + acceleration * t)
        m = [self.stack.mass(z[k]) for k in (1, 2, 3)]
        P = [
            (B[k + 1] - B[k - 1]) * (0.5 / h) + self.stack.spin(z[k], W[k]) @ B[k]
            for k in (1, 2, 3)
        ]
        growth = (B[3].T @ m[2] @ B[3] - B[1].T @ m[0] @ B[1]) * (0.5 / h)
        G, H = zip(*(self.stack.convection(z[k - 1 : k + 2], h) for k in (1, 2, 3)), strict=True)
        Q = [b.T @ (a @ p + g @ b) for a, b, p, g in zip(m, B[1:4], P, G, strict=True)]
        cross = P[1].T @ G[1] @ B[2]
        R = P[1].T @ m[1] @ P[1] + cross + cross.T + B[2].T @ H[1] @ B[2]
        C, K = growth + Q[1] - Q[1].T, (Q[2] - Q[0]) * (0.5 / h) - R
        return sparse.csr_array(C), sparse.csr_array(K)

    def _step(self, q: Floats, y: Floats, rate: Floats, acceleration: Floats) -> float:
        """The interval of the differences, s: a screw turns much faster than its nut travels."""
        (z,) = self.values(q[None], y)
        spins = self.stack.spins.at(z)
        turned = (spins @ self._joints(rate), spins @ self._joints(acceleration))
        fastest, hardest = (
            np.abs(np.concatenate(both)).max()
            for both in zip((rate, acceleration), turned, strict=True)
        )
        speed = max(float(fastest), float(np.sqrt(hardest)))
        return self.step / speed if speed > 0.0 else self.step

    def values(self, q: Floats, y: Floats) -> Floats:
        """The values of all scalars at poses q (n, n_q), and a 1: (n, n_scalars + 1)."""
        z = self.parameters.z(np.hstack([q, np.tile(y, (len(q), 1))]))
        return np.column_stack([self.table.evaluate(Samples(), z).T, np.ones(len(q))])

    def _joints(self, rates: Floats) -> Floats:
        """The rates of the coordinates alone, of rates (…, n_q) of loads too."""
        return rates[..., : len(self.parameters.coordinates)]


def placeless(case: CaseFile) -> tuple[str, ...]:
    """Superelements: nobody knows which way their inner dofs point, and so how they turn."""
    return tuple(n for n in case.mechanism.links if link_type(case, n) == "superelement")


def velocity_terms(
    case: CaseFile, parameters: ModelParameters, motion: Kinematics
) -> VelocityTerms:
    """Collect what varies along a motion: carried nodes, twists, spins, mass coefficients.

    Raises MechanismError for a superelement, whose inner dofs have no directions.
    """
    for name in placeless(case):
        message = "has inner dofs of unknown direction: its velocity terms cannot be formed"
        raise MechanismError(f"mechanism.links.{name}", message)
    links, nodes = local_links(case, parameters, motion)
    moving = all_moving(case, parameters, motion)
    scalars: list[Scalar] = []
    rows, ridings = [], []
    for link, placement in zip(links, motion.placements, strict=True):
        spin = moving.placement(placement.link).twist[3:]
        mass = [t.coefficient for t in whole_mass(link)]
        mesh, rides = nodes.meshes[placement.link], motion.tree.riders(placement.link)
        parts = [list(spin.ravel()), *motion_scalars(link), mass]
        parts.append(mesh_scalars(mesh) if rides else [])
        cuts = np.cumsum([len(scalars), *(len(p) for p in parts)]).tolist()
        rows.append(ScalarRows(*(slice(a, b) for a, b in itertools.pairwise(cuts))))
        scalars += [s for part in parts for s in part]
        ridings.append(riding(mesh) if rides else None)
    n_dof = nodes.count + len(motion.columns)
    return VelocityTerms(
        stack=stack(links, rows, ridings, case.mechanism.space, nodes.count, n_dof),
        table=compile_table(parameters.recorder, scalars, parameters.count),
        parameters=parameters,
    )


# --- convection: a mesh that moves along its beam


@dataclass(frozen=True, eq=False)
class Riding:
    """A straight beam whose mesh moves; its varying numbers come as rows of a table of scalars."""

    dofs: NDArray[np.intp]  # (n, 12) local dofs of each element; −1 where a plane has none
    turn: Floats  # (12, 12) from the link's axes to those of the section
    n_local: int

    def at(
        self, values: Sequence[Floats], step: float
    ) -> tuple[sparse.csr_array, sparse.csr_array]:
        """G [kg/s] and H [kg/s²] (n_local, n_local) at the middle of three instants ``step`` apart.

        ``values`` are those of `mesh_scalars` at the three.
        """
        n = len(self.dofs)
        before, now, after = (_Elements(v, n) for v in values)
        xi, weights = np.polynomial.legendre.leggauss(4)
        xi, weights = np.tile(0.5 * (1.0 + xi), (n, 1)), 0.5 * weights
        x_rate, h_rate, phi_rate = (
            (getattr(after, key) - getattr(before, key)) * (0.5 / step) for key in ("x", "h", "phi")
        )
        xi_rate = -(x_rate + xi * h_rate) / now.h
        moved = 1j * IMAGINARY
        shapes = fields(xi + moved * xi_rate, now.h + moved * h_rate, now.phi + moved * phi_rate)
        N, N_rate = shapes.real, shapes.imag / IMAGINARY
        legendre = np.polynomial.legendre.legvander(2.0 * xi[0] - 1.0, now.inertia.shape[1] - 1)
        matter = now.h[..., None] * weights[:, None] * (legendre @ now.inertia)  # (n, n_xi, 6)
        G = np.einsum("epri,epr,eprj->eij", N, matter, N_rate)
        H = np.einsum("epri,epr,eprj->eij", N_rate, matter, N_rate)
        return self.assembled(G), self.assembled(H)

    def assembled(self, blocks: Floats) -> sparse.csr_array:
        """Matrices (n, 12, 12) of the elements in the section's axes, on the link's local dofs."""
        blocks = self.turn.T @ blocks @ self.turn
        places = self.dofs[:, :, None], self.dofs[:, None, :]
        rows, columns = (np.broadcast_to(a, blocks.shape) for a in places)
        kept = (rows >= 0) & (columns >= 0)
        entries = (blocks[kept], (rows[kept], columns[kept]))
        return sparse.csr_array(entries, shape=(self.n_local, self.n_local))


class _Elements:
    """Nodes, length, Φ and Φ r (n, 1, 2, 2), inertia (n, n_legendre, 6) of all at one instant."""

    def __init__(self, values: Floats, n: int) -> None:
        nodes, phi, inertia = np.split(values, [n + 1, 5 * n + 1])
        self.x = nodes[:-1, None]
        self.h = np.diff(nodes)[:, None]
        self.phi = phi.reshape(n, 1, 2, 2)
        self.inertia = inertia.reshape(n, -1, 6)


def riding(mesh: LinkMesh) -> Riding:
    """The beam of a link on which a carriage or nut rides."""
    (strand,) = mesh.strands
    assert strand.axes is not None
    slots = np.array(list(strand.slots), dtype=np.intp)
    turn = np.kron(np.eye(4), strand.axes).astype(np.float64)
    return Riding(np.hstack([slots[:-1], slots[1:]]), turn, mesh.n_local)


def mesh_scalars(mesh: LinkMesh) -> list[Scalar]:
    """The scalars of a `Riding`: its nodes' places, and shear and inertia of its elements."""
    (strand,) = mesh.strands
    places = [X[0] for X in strand.points]
    shear = [value for pair in strand.shear for bent in pair for value in bent]
    inertia = [rho for each in strand.profiles for beam in each for rho in field_inertia(beam)]
    return [*places, *shear, *inertia]


def fields(xi: RealOrComplex, h: RealOrComplex, phi: RealOrComplex) -> RealOrComplex:
    """N (n, n_xi, 6, 12): displacements and rotations at ξ per dof of an element, section's axes.

    xi (n, n_xi), h (n, 1) in m, phi (n, 1, 2, 2): `Shear` of each plane. Stretch and twist are
    linear, bending is that of `bending_shapes` and `bending_slopes`.
    """
    N = np.zeros((*xi.shape, 6, 12), dtype=np.result_type(xi, h, phi))
    for row in (0, 3):
        N[..., row, row], N[..., row, row + 6] = 1.0 - xi, xi
    one = np.ones_like(h)
    for k, (w, slope, sign) in enumerate(PLANES):
        scale = np.stack([one, sign * h, one, sign * h], axis=-1)
        bent = phi[..., k, 0], phi[..., k, 1]
        deflection = bending_shapes(xi, *bent) * scale
        rotation = bending_slopes(xi, *bent) * scale * (sign / h)[..., None]
        for j, dof in enumerate((w, slope, w + 6, slope + 6)):
            N[..., w, dof], N[..., slope, dof] = deflection[..., j], rotation[..., j]
    return N


# --- all links one below the other


@dataclass(frozen=True, eq=False)
class Pattern:
    """A sparse matrix whose entries are sums of constants times scalars."""

    values: Floats  # (n,) constants
    scalars: Ints  # (n,) which scalar each is multiplied by; the last one for none
    slots: Ints  # (n,) which entry each adds to
    places: Ints  # row and column of each entry as one number, ascending
    shape: tuple[int, int]

    def at(self, z: Floats) -> Matrix:
        """The matrix for scalars z."""
        data = np.bincount(self.slots, self.values * z[self.scalars], len(self.places))
        # up to 128 rows and columns dense is quicker
        if max(self.shape) <= 128:
            out = np.zeros(self.shape)
            out.flat[self.places] = data
            return out
        return sparse.csr_array((data, *self._compressed), shape=self.shape)

    @cached_property
    def _compressed(self) -> tuple[Ints, Ints]:
        """Columns of the entries, and where each row starts."""
        rows, width = self.shape
        return self.places % width, np.searchsorted(self.places, np.arange(rows + 1) * width)


@dataclass
class _PatternEntries:
    """Parts of entries on their way to a `Pattern`."""

    parts: list[tuple[Ints, Ints, Floats, Ints]] = field(default_factory=list)

    def add(self, rows: Any, columns: Any, values: Any, scalars: Any) -> None:
        """Entries values × scalars at (rows, columns), broadcast."""
        r, c, v, s = np.broadcast_arrays(rows, columns, values, scalars)
        self.parts.append((_whole(r), _whole(c), np.asarray(v, dtype=np.float64), _whole(s)))

    def add_terms(self, terms: Sequence[Term], first: int, row: int, column: int) -> None:
        """Σ scalar × matrix with its corner at (row, column), scalars counted from ``first``."""
        for k, term in enumerate(terms):
            entries = term.matrix.tocoo()
            self.add(entries.row + row, entries.col + column, entries.data, first + k)

    def pattern(self, shape: tuple[int, int]) -> Pattern:
        empty = (np.zeros(0, np.intp),) * 2 + (np.zeros(0), np.zeros(0, np.intp))
        rows, columns, values, scalars = (
            np.concatenate(each) for each in zip(*(self.parts or [empty]), strict=True)
        )
        places, slots = np.unique(rows * shape[1] + columns, return_inverse=True)
        return Pattern(values, scalars, slots, places, shape)


@dataclass(frozen=True)
class ScalarRows:
    """The rows of a link in a table of scalars: see `velocity_terms`."""

    spin: slice
    carries: slice
    twist: slice
    rigid: slice
    mass: slice
    mesh: slice


@dataclass(frozen=True, eq=False)
class Rider:
    """A beam that something rides on: its first row among all, and its scalars."""

    riding: Riding
    first: int
    rows: slice


@dataclass(frozen=True, eq=False)
class StackedLinks:
    """The links with mass; z are the values of a table of scalars, followed by a 1."""

    joined: Pattern  # U (n_local, n_dof)
    spread: Pattern  # N (n_local, Σ n_twist)
    twist: Pattern  # T (Σ n_twist, n_dof)
    basis: sparse.csr_array | None  # Ψ (n_whole, n_local); None where no link is reduced
    masses: Pattern  # m (n_whole, n_whole)
    spins: Pattern  # ω per rate of every coordinate, (3 n_links, n_coordinates)
    turns: Pattern  # ω̃ (n_whole, n_whole) of ω
    riders: tuple[Rider, ...]

    def motion(self, z: Floats) -> Matrix:
        """B (n_whole, n_dof)."""
        B = self.joined.at(z) + self.spread.at(z) @ self.twist.at(z)
        return B if self.basis is None else self.basis @ B

    def mass(self, z: Floats) -> Matrix:
        """m (n_whole, n_whole)."""
        return self.masses.at(z)

    def spin(self, z: Floats, rate: Floats) -> Matrix:
        """ω̃ on the translations and rotations of every node, in its link's axes."""
        return self.turns.at(self.spins.at(z) @ rate)

    def convection(self, values: Floats, step: float) -> tuple[sparse.csr_array, sparse.csr_array]:
        """G and H (n_whole, n_whole) at the middle of three instants."""
        shape = self.masses.shape
        G, H = sparse.csr_array(shape), sparse.csr_array(shape)
        for rider in self.riders:
            found = rider.riding.at([z[rider.rows] for z in values], step)
            g, h = (_placed(each, rider.first, shape) for each in found)
            G, H = G + g, H + h
        return G, H


def _whole(numbers: Any) -> Ints:
    return np.asarray(numbers, dtype=np.intp)


def _placed(block: sparse.csr_array, first: int, shape: tuple[int, int]) -> sparse.csr_array:
    entries = block.tocoo()
    where = (entries.row + first, entries.col + first)
    return sparse.csr_array((entries.data, where), shape=shape)


def whole_mass(link: LocalLink) -> Sequence[Term]:
    """The mass terms of a link with all its dofs."""
    return link.mass if link.reduction is None else link.reduction.mesh.mass


def stack(
    links: Sequence[LocalLink],
    rows: Sequence[ScalarRows],
    ridings: Sequence[Riding | None],
    space: str,
    n_u: int,
    n_dof: int,
) -> StackedLinks:
    """The links that have mass, stacked; ``rows`` are where each has its scalars."""
    joined, spread, twist, masses, spins, turns = (_PatternEntries() for _ in range(6))
    riders, bases = [], []
    local = whole = turned = spun = 0
    for link, own, riding in zip(links, rows, ridings, strict=True):
        mass = whole_mass(link)
        if not mass:  # a rigid link without mass
            continue
        _add_joined(joined, link, own, local)
        spread.add_terms(link.rigid, own.rigid.start, local, turned)
        _add_dense(twist, own.twist, link.twist.shape, turned, n_u)
        masses.add_terms(mass, own.mass.start, whole, whole)
        n = mass[0].matrix.shape[0]
        _add_dense(spins, own.spin, (3, (own.spin.stop - own.spin.start) // 3), spun, 0)
        _add_turns(turns, space, n, whole, spun)
        if riding is not None:
            riders.append(Rider(riding, whole, own.mesh))
        bases.append(sparse.eye_array(n) if link.reduction is None else link.reduction.basis)
        local, whole = local + len(link.own), whole + n
        turned, spun = turned + link.twist.shape[0], spun + 3
    return StackedLinks(
        joined.pattern((local, n_dof)),
        spread.pattern((local, turned)),
        twist.pattern((turned, n_dof)),
        sparse.csr_array(sparse.block_diag(bases)) if local != whole else None,
        masses.pattern((whole, whole)),
        spins.pattern((spun, (rows[0].spin.stop - rows[0].spin.start) // 3)),
        turns.pattern((whole, whole)),
        tuple(riders),
    )


def _add_joined(out: _PatternEntries, link: LocalLink, rows: ScalarRows, first: int) -> None:
    own = np.flatnonzero(link.own >= 0)
    out.add(first + own, link.own[own], 1.0, -1)
    carried = ((slot, unknown) for slot, pairs in link.carried.items() for unknown, _ in pairs)
    for k, (slot, unknown) in enumerate(carried):
        out.add(np.array([first + slot]), unknown, 1.0, rows.carries.start + k)


def _add_dense(
    out: _PatternEntries, scalars: slice, shape: tuple[int, ...], row: int, column: int
) -> None:
    """A full block whose entries are scalars, row by row."""
    i, j = np.indices(shape)
    out.add((row + i).ravel(), (column + j).ravel(), 1.0, np.arange(scalars.start, scalars.stop))


def _add_turns(out: _PatternEntries, space: str, n: int, first: int, spin: int) -> None:
    """ω̃ at every node of a link with n dofs, for translations and rotations alike."""
    kept = DOFS[space]
    nodes = first + len(kept) * np.arange(n // len(kept))
    for half in (0, 3):
        for i, j, component, sign in CROSS:
            if half + i in kept and half + j in kept:
                r, c = kept.index(half + i), kept.index(half + j)
                out.add(nodes + r, nodes + c, sign, spin + component)
