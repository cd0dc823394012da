"""K = Bᵀ k B and M = Bᵀ m B of eq. (1) with B = [Q, N T], link by link.

The local motion of a link's dofs is v = Q u + N T q̇. Some dofs are unknowns themselves (P picks
them, with constant entries 1), dofs s move with other links (c_s, a row of functions of (q, y)):

    Q = P + Σ_s e_s c_s,    N = Σ_b ν_b(y) N_b,    T = T(q, y).

With constant symmetric matrices a of k = Σ κ_i(y) k_i and m = Σ μ_i(y) m_i, and a_s = a e_s,

    Qᵀ a Q = Pᵀ a P + Σ_s (Pᵀ a_s c_s + c_sᵀ a_sᵀ P) + Σ_st a_st c_sᵀ c_t,

    K = | Qᵀ k Q  0 |        M = | Qᵀ m Q   Qᵀ m N T     |
        | 0       0 |,           | sym.     Tᵀ (Nᵀ m N) T |,

for k N = 0 exactly: a rigid motion strains nothing. Where entries go, with what function of (q, y),
is the matter of `pencil`.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.arrays import Floats, Ints
from eigassign.mechanism.assembly.pencil import AffineEntries, Row
from eigassign.mechanism.elements.links import Reduction, Term, total
from eigassign.mechanism.kinematics.joints import multiply, scaled, some
from eigassign.series.expression import Scalar

Objects = NDArray[np.object_]


class LocalLink(NamedTuple):
    """One link in its own frame, with its place among the global unknowns.

    ``own`` (n_local,) is P: the global index of each local dof, or -1 where it is slaved;
    ``carried`` maps a slaved local dof s to c_s: empty for a clamped one.
    """

    stiffness: Sequence[Term]  # κ_i k_i
    mass: Sequence[Term]  # μ_i m_i
    rigid: Sequence[Term]  # ν_b N_b, each (n_local, n_twist)
    twist: Objects  # T (n_twist, n_columns)
    own: Ints
    carried: Mapping[int, Row]
    reduction: Reduction | None = None


def add_links(K: AffineEntries, M: AffineEntries, links: Sequence[LocalLink], n_u: int) -> None:
    """K += Bᵀ k B and M += Bᵀ m B of every link; the q̇ are numbered from ``n_u`` on."""
    known: dict[object, _Constants] = {}
    for link in links:
        matrices = id(link.stiffness), id(link.mass), id(link.rigid)
        kind = matrices, tuple(link.carried), (link.own < 0).tobytes()
        numbers = known[kind] if kind in known else known.setdefault(kind, _constants(link))
        for k, k_s in zip(link.stiffness, numbers.stiffness, strict=True):
            _add_elastic(K, k, k_s, link)  # Qᵀ k Q
        _add_whole(M, link.mass, numbers, link, n_u)


def add_stressed(K: AffineEntries, link: LocalLink, terms: Sequence[Term], n_u: int) -> None:
    """K += Bᵀ k_σ B of one link, which resists rigid motions, too."""
    _add_whole(K, terms, _constants(link._replace(mass=terms)), link, n_u)


def _add_whole(
    target: AffineEntries, terms: Sequence[Term], numbers: _Constants, link: LocalLink, n_u: int
) -> None:
    """Bᵀ a B with all of B = [Q, N T], a the matrices that ``numbers`` has as masses."""
    for a, a_s in zip(terms, numbers.mass, strict=True):
        _add_elastic(target, a, a_s, link)  # Qᵀ a Q
    if link.twist.shape[1]:
        T = [[(n_u + k, rate) for k, rate in enumerate(row)] for row in link.twist.tolist()]
        for coefficient, momentum in numbers.momenta:
            for column, row in zip(momentum.T, T, strict=True):  # Qᵀ a N T and its transpose
                target.add_coupling(coefficient, column, link.own, row)
                for s, c_s in link.carried.items():
                    target.add_product(coefficient * float(column[s]), c_s, row)
        target.add_corner(n_u, multiply(link.twist.T, multiply(numbers.inertia, link.twist)))


def inertia(link: LocalLink) -> Objects:
    """Nᵀ m N (n_twist, n_twist) about the link's origin: of a reduced one the whole mass."""
    return _constants(link).inertia


def pulled(link: LocalLink, pull: Objects) -> Objects:
    """m N a (n_local,): forces of one acceleration a (n_twist,), in its axes, on a link's dofs."""
    force = np.zeros(len(link.own), dtype=object)
    for coefficient, momentum in _constants(link).momenta:
        force = force + multiply(momentum, scaled(pull, coefficient))
    return force


def scattered(link: LocalLink, force: Objects) -> dict[int, Scalar]:
    """Qᵀ f over u of forces on a link's dofs."""
    found: dict[int, Scalar] = {}
    for slot, each in enumerate(force.tolist()):
        own = int(link.own[slot])
        row = [(own, 1.0)] if own >= 0 else link.carried.get(slot, ())
        for unknown, moved in row if some(each) else ():
            found[unknown] = found.get(unknown, 0.0) + each * moved
    return found


@dataclass(frozen=True, eq=False)
class _Constants:
    """The numbers of a link that its copies at other places share; s are its carried dofs."""

    stiffness: list[Floats]  # rows s of each k_i, (n_s, n_local)
    mass: list[Floats]  # of each m_i
    momenta: list[tuple[Scalar, Floats]]  # μ_i ν_b and m_i N_b
    inertia: Objects  # Nᵀ m N (n_twist, n_twist), about the link's origin


def _constants(link: LocalLink) -> _Constants:
    slots = list(link.carried)
    momenta = [
        (m.coefficient * N.coefficient, _without_roundoff(m.matrix, N.matrix))
        for m, N in itertools.product(link.mass, link.rigid)
    ]
    J = np.zeros((len(link.twist), len(link.twist)), dtype=object)
    for (factor, momentum), N in itertools.product(momenta, link.rigid):
        constant, scale = N.matrix.T @ momentum, factor * N.coefficient
        for a, b in zip(*np.nonzero(constant), strict=True):
            J[a, b] = J[a, b] + scale * float(constant[a, b])
    return _Constants(
        [k.matrix[slots].toarray() for k in link.stiffness],
        [m.matrix[slots].toarray() for m in link.mass],
        momenta,
        J,
    )


def _without_roundoff(A: sparse.csr_array, N: sparse.csr_array) -> Floats:
    """A N, with zero where what adds up cancels."""
    product = (A @ N).toarray()
    product[np.abs(product) < 1e-13 * (abs(A) @ abs(N)).toarray()] = 0.0
    return np.asarray(product)


def _add_elastic(target: AffineEntries, a: Term, a_s: Floats, link: LocalLink) -> None:
    """Qᵀ a Q of one term; ``a_s`` are the rows s of its matrix, which is symmetric."""
    target.add_block(a.coefficient, a.matrix, link.own)
    rows = [(s, c_s, a_row) for (s, c_s), a_row in zip(link.carried.items(), a_s, strict=True)]
    for n, (s, c_s, a_row) in enumerate(rows):
        target.add_coupling(a.coefficient, a_row, link.own, c_s)
        target.add_square(a.coefficient * float(a_row[s]), c_s)
        for t, c_t, _ in rows[n + 1 :]:
            target.add_product(a.coefficient * float(a_row[t]), c_s, c_t)


# --- B of a single link as numbers


def motion_scalars(link: LocalLink) -> list[Objects]:
    """The functions of (q, y) in B, in three arrays: all c_s, T, all ν_b."""
    carries = [carry for row in link.carried.values() for _, carry in row]
    rigid = [N.coefficient for N in link.rigid]
    return [np.array(carries, dtype=object), link.twist, np.array(rigid, dtype=object)]


def motion_matrix(
    link: LocalLink, values: Sequence[Floats], n_u: int, n_dof: int
) -> sparse.csr_array:
    """B (n_local, n_dof) from the values of `motion_scalars`: P, c_s, N T."""
    carries, twist, rigid = values
    own = np.flatnonzero(link.own >= 0)
    pairs = [(slot, unknown) for slot, row in link.carried.items() for unknown, _ in row]
    slots, unknowns = np.array(pairs, dtype=np.intp).reshape(-1, 2).T
    places = np.concatenate([own, slots]), np.concatenate([link.own[own], unknowns])
    entries = np.concatenate([np.ones(len(own)), carries]), places
    B = sparse.csr_array(entries, shape=(len(link.own), n_dof))
    if link.twist.shape[1]:
        N = total(link.rigid, rigid)
        wide = sparse.csr_array((len(link.own), n_u))
        B = B + sparse.hstack([wide, sparse.csr_array(N @ twist)], format="csr")
    return B
