"""Many samples of a large pencil solved together, and proof that no mode of any was missed.

Along a trajectory K and M vary in the rows and columns of few unknowns only: S, those at joints,
the held and the free coordinates. With I all others, K_II and M_II are the same at every sample.
u_I = w − K_II⁻¹ K_IS u_S takes K apart into diag(K_II, Σ), Σ = K_SS − K_SI K_II⁻¹ K_IS, and the
inverse form M z = μ K z reads, in the rows of I times K_II⁻¹,

    T w + b(θ) u_S = μ w,   T = K_II⁻¹ M_II,   b = K_II⁻¹ (M_IS − M_II K_II⁻¹ K_IS) .

T is one operator for all samples, self-adjoint in K_II. Galerkin's method on w = W a and all of u_S
gives pairs (μ̂, a, u_S) from matrices of some tens of rows at each sample. Their residuals

    ρ = T W a + b u_S − μ̂ W a

lie in the span of T W and of the few columns that b is made of: on a K_II-orthonormal basis Q of it
|ρ| is the length of a short vector. W grows by the leading directions of the residuals of all
samples at once until |ρ| ≤ 1e-9 μ̂ everywhere: as exact as arithmetic makes λ, whose error is of
second order in ρ.

What W and S do not hold is D = (1 − P) T (1 − P) at every sample alike, P the projection on W. With
m the number of negative pivots of K_II − M_II/ν, T has m eigenvalues above ν; where as many Ritz
values θ_i of T on W lie above it, with residuals r_i, by Haynsworth's inertia formula

    D ≤ ν' = ν + Σ_i |r_i|² / (θ_i − ν) .

Let μ̂_c be the last pair that counts and R the residuals of the pairs beyond it. For ν' < x < μ̂_c,
again by inertia,

    diag(μ̂_j) + RᵀR/(x − ν') < x  for j > c
        ⟹   0 ≤ μ_i − μ̂_i ≤ μ̂_i max_j≤c c |ρ_j|² / (μ̂_j (μ̂_c − x))  for i ≤ c:

the pairs are those of the c lowest modes, and one factorisation has proved it for all
samples. A sample where this fails is solved by itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import linalg

from eigassign.errors import LIMP, AccuracyError, MechanismError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.mechanism.elements.craig_bampton import definite_factor, largest_modes
from eigassign.modal.exact.condensation import (
    Modes,
    condense_blocks,
    mass_sizes,
    may_be_roundoff,
    positive_at_top,
)
from eigassign.modal.exact.dense import inverse_factor
from eigassign.modal.exact.inertia import negative_pivots
from eigassign.modal.exact.sparse import block, principal, solve_sparse

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Flags = NDArray[np.bool_]
EPS = float(np.finfo(np.float64).eps)


# --- What varies: S, and the blocks of K and M in its rows

MOST_VARYING = 150  # unknowns S: beyond, a sample's own matrices are as large as a sparse solve


def varying_unknowns(pencil: Pencil, theta: Floats) -> Ints | None:
    """Unknowns S without the free coordinates, one in each entry that varies; None if many.

    A vertex cover: always the unknown with most varying entries that are not covered yet.
    """
    changes = np.ptp(theta, axis=1) > 4.0 * EPS * np.abs(theta).max(axis=1)
    terms = np.flatnonzero(changes)
    touched = np.zeros(len(pencil.rows), dtype=bool)
    for weights in pencil.by_term:
        touched[weights[:, terms].indices] = True
    rows, columns = pencil.rows[touched], pencil.columns[touched]
    chosen = np.zeros(pencil.n_dof, dtype=bool)
    chosen[rows[rows == columns]] = True
    chosen[pencil.rigid] = True
    while chosen.sum() <= MOST_VARYING:
        open_ = ~(chosen[rows] | chosen[columns])
        rows, columns = rows[open_], columns[open_]
        if not len(rows):
            chosen[pencil.rigid] = False
            return np.flatnonzero(chosen)
        chosen[np.bincount(rows).argmax()] = True
    return None


@dataclass(frozen=True, eq=False)
class Split:
    """I, S (the free coordinates last), and where each dof stands in its own of the two."""

    inner: Ints
    outer: Ints
    is_outer: Flags
    place: Ints


def _split(pencil: Pencil, varying: Ints) -> Split:
    outer = np.concatenate([varying, pencil.rigid])
    is_outer = np.zeros(pencil.n_dof, dtype=bool)
    is_outer[outer] = True
    inner = np.flatnonzero(~is_outer)
    place = np.empty(pencil.n_dof, dtype=np.intp)
    place[inner], place[outer] = np.arange(len(inner)), np.arange(len(outer))
    return Split(inner, outer, is_outer, place)


def _outer_block(pencil: Pencil, split: Split, weights: sparse.csr_array, theta: Floats) -> Floats:
    """K_SS or M_SS (n_samples, s, s)."""
    entries = np.flatnonzero(split.is_outer[pencil.rows] & split.is_outer[pencil.columns])
    out = np.zeros((theta.shape[1], len(split.outer), len(split.outer)))
    i, j = split.place[pencil.rows[entries]], split.place[pencil.columns[entries]]
    out[:, i, j] = (weights[entries] @ theta).T
    return out


def _coupling(
    pencil: Pencil, split: Split, weights: sparse.csr_array, theta: Floats
) -> tuple[Floats, Floats]:
    """G (n_I, g) and H (n_samples, g, s) with K_IS or M_IS = G H(θ).

    G holds the columns of all terms, unit vectors of the same direction once: solved twice, they
    would differ by the round-off of K_II alone, and Q would take that for a direction.
    """
    entries = np.flatnonzero(~split.is_outer[pencil.rows] & split.is_outer[pencil.columns])
    terms = weights[entries].tocoo()
    terms.eliminate_zeros()
    entry, term = terms.coords
    row, column = (split.place[a[entries[entry]]] for a in (pencil.rows, pencil.columns))
    s, n = len(split.outer), len(split.inner)
    labels, vector = np.unique(term * s + column, return_inverse=True)
    vectors = sparse.csc_array((terms.data, (row, vector)), shape=(n, len(labels)))
    vectors.sort_indices()
    known: dict[bytes, int] = {}
    directions: list[tuple[NDArray[np.int32], Floats]] = []
    which, scales = [], []
    for start, end in zip(vectors.indptr[:-1], vectors.indptr[1:], strict=True):
        rows, values = vectors.indices[start:end], vectors.data[start:end]
        large = np.abs(values) > 0.5 * np.abs(values).max()
        scale = np.copysign(np.linalg.norm(values), values[large.argmax()])
        key = rows.tobytes() + (np.round(values / scale, 12) + 0.0).tobytes()
        if key not in known:
            known[key] = len(directions)
            directions.append((rows, values / scale))
        which.append(known[key])
        scales.append(scale)
    G = np.zeros((n, len(directions)))
    for k, (rows, values) in enumerate(directions):
        G[rows, k] = values
    at = np.array(which, dtype=np.intp) * s + labels % s
    shape = (len(directions) * s, len(theta))
    table = sparse.csr_array((np.array(scales), (at, labels // s)), shape=shape)
    return G, (table @ theta).T.reshape(theta.shape[1], len(directions), s)


def solve_large_statics(pencil: Pencil, theta: Floats, f: Floats) -> Floats:
    """u (n, n_dof, r) with K_E u_E = f_E at θ (n_theta, n) for f (n, n_dof, r), 0 where free.

    By Σ u_S = f_S, u_I = −K_II⁻¹ K_IS u_S, where S has all that any force acts on too; sample by
    sample where S is large. Raises MechanismError where K_E is not definite.
    """
    varying, u, E = varying_unknowns(pencil, theta), np.zeros(f.shape), pencil.elastic
    loaded = np.flatnonzero((f != 0.0).any(axis=(0, 2)))
    outer = np.union1d([] if varying is None else varying, np.setdiff1d(loaded, pencil.rigid))
    if varying is None or len(outer) > MOST_VARYING:
        for k, data in enumerate((pencil.stiffness @ theta).T):
            factor = _definite(principal(pencil, data, E))
            u[k, E] = factor.solve(np.ascontiguousarray(f[k, E]))
        return u
    split, s = _split(pencil, outer.astype(np.intp)), len(outer)
    factor = _definite(principal(pencil, pencil.stiffness @ theta[:, 0], split.inner))
    K_SS = _outer_block(pencil, split, pencil.stiffness, theta)
    G, H = _coupling(pencil, split, pencil.stiffness, theta)
    X = factor.solve(G) if G.size else G
    inverse = inverse_factor((K_SS - np.swapaxes(H, 1, 2) @ (G.T @ X) @ H)[:, :s, :s])
    u_S = np.swapaxes(inverse, 1, 2) @ (inverse @ f[:, split.outer[:s]])
    u[:, split.outer[:s]] = u_S
    u[:, split.inner] = -(X @ (H[:, :, :s] @ u_S))
    return u


def _definite(K: sparse.csc_array) -> linalg.SuperLU:
    factor = definite_factor(K)
    if factor is None:
        raise MechanismError("mechanism", LIMP)
    return factor


# --- What is the same at every sample: T on a growing basis

BLOCK = 16  # vectors made orthonormal at once
DEPENDENT = 1e-12  # remainder, relative to the vector, below which it is taken as dependent
ROUND_OFF = 0.1  # of a remainder orthogonalised again, below which it was nothing else


@dataclass(frozen=True, eq=False)
class Inner:
    """K_II and M_II, the basis Q, and W = Q ``W``, T W = Q ``TW`` in its coordinates.

    T goes through K_II⁻¹, which a fine mesh makes inexact. It serves the residuals; the matrices
    of Galerkin's method are made of M_II and the vectors themselves.
    """

    K: sparse.csr_array
    M: sparse.csr_array
    factor: linalg.SuperLU
    Q: Floats  # (n_I, q), QᵀK_II Q = I
    W: Floats  # (q, k) orthonormal
    TW: Floats  # (q, k)
    vectors: Floats  # (n_I, k): W itself
    mass: Floats  # (k, k): WᵀM_II W

    @classmethod
    def empty(cls, K: sparse.csc_array, M: sparse.csc_array, factor: linalg.SuperLU) -> Inner:
        """The operator without a vector."""
        none, long = np.zeros((0, 0)), np.zeros((K.shape[0], 0))
        return cls(K.T, M.T, factor, long, none, none, long, none)

    def solve(self, forces: Floats) -> Floats:
        """K_II⁻¹ times ``forces`` (n_I, r); SuperLU wants at least one."""
        return self.factor.solve(forces) if forces.size else forces

    def spanning(self, vectors: Floats) -> tuple[Inner, Floats]:
        """The same with Q grown to hold ``vectors`` (n_I, r), and these in its coordinates."""
        Q, parts = self.Q, [np.zeros((self.Q.shape[1], 0))]
        for i in range(0, vectors.shape[1], BLOCK):
            # twice: a small remainder is not orthogonal to Q yet, or nothing but round-off
            once, across, within = _remainder(self.K, Q, vectors[:, i : i + BLOCK], DEPENDENT)
            twice, more, again = _remainder(self.K, Q, once, ROUND_OFF)
            Q = np.hstack([Q, twice])
            parts.append(np.vstack([across + more @ within, again @ within]))
        found = np.hstack([_taller(part, Q.shape[1]) for part in parts])
        W, TW = (_taller(A, Q.shape[1]) for A in (self.W, self.TW))
        return replace(self, Q=Q, W=W, TW=TW), found

    def with_vectors(self, coordinates: Floats) -> Inner:
        """The same with W grown by vectors given in coordinates of Q (q, r)."""
        k = self.W.shape[1]
        W = np.linalg.qr(np.hstack([self.W, coordinates]))[0]
        new = W[:, k:]
        vectors = self.Q @ new
        heavy = self.M @ vectors
        across, square = self.vectors.T @ heavy, vectors.T @ heavy
        grown, image = self.spanning(self.solve(heavy))
        return replace(
            grown,
            W=np.hstack([grown.W, _taller(new, grown.Q.shape[1])]),
            TW=np.hstack([grown.TW, image]),
            vectors=np.hstack([self.vectors, vectors]),
            mass=np.block([[self.mass, across], [across.T, 0.5 * (square + square.T)]]),
        )

    def above(self, nu: float) -> int:
        """Number of eigenvalues of T above ν; UNCERTAIN where one is too near."""
        scale = 1.0 / np.sqrt(self.K.diagonal() + self.M.diagonal() / nu)
        S = sparse.diags_array(scale)
        return negative_pivots(sparse.csc_array(S @ (self.K - self.M / nu) @ S))

    def modes(self, count: int) -> Floats:
        """Vectors (n_I, count) of the largest eigenvalues of T."""
        return largest_modes(self.factor, self.K, lambda v: np.asarray(self.M @ v), count)[1]

    def largest_outside(self, nu: float) -> float | None:
        """ν' ≥ the largest eigenvalue of D; None where W lacks a mode above ν, or may lack one."""
        values, shapes = np.linalg.eigh(self.mass)
        above = values > nu
        if above.sum() != self.above(nu):
            return None
        theta, v = values[above], shapes[:, above]
        rest = self.TW @ v - self.W @ (v * theta)
        return nu + float((np.square(rest).sum(axis=0) / (theta - nu)).sum())


def _taller(A: Floats, rows: int) -> Floats:
    return np.vstack([A, np.zeros((rows - len(A), A.shape[1]))])


def _remainder(
    K: sparse.csr_array, Q: Floats, vectors: Floats, least: float
) -> tuple[Floats, Floats, Floats]:
    """Orthonormal R, A and B with ``vectors`` (n, r) = Q A + R B, by Gram-Schmidt.

    Parts below ``least`` are left out.
    """
    K_vectors = K @ vectors
    size = np.sqrt(np.maximum(np.einsum("ij,ij->j", vectors, K_vectors), 0.0))
    across = Q.T @ K_vectors
    rest = vectors - Q @ across
    r, rank = vectors.shape[1], 0
    R, KR, within = np.zeros_like(rest), np.zeros_like(rest), np.zeros((r, r))
    for j, v in enumerate(rest.T):
        part = KR[:, :rank].T @ v
        v = v - R[:, :rank] @ part
        Kv = K @ v
        length = np.sqrt(max(float(v @ Kv), 0.0))
        within[:rank, j] = part
        if length > least * size[j]:
            R[:, rank], KR[:, rank], within[rank, j] = v / length, Kv / length, length
            rank += 1
    return R[:, :rank], across, within[:rank]


# --- The samples on that basis


@dataclass(frozen=True, eq=False)
class Outer:
    """Arrays over n samples of what differs; S with its f free coordinates last."""

    inverse: Floats  # (n, s − f, s − f): L⁻¹ with Σ = L Lᵀ
    mass: Floats  # (n, s, s): M_SS after the change of unknowns
    drive: Floats  # (n, g, s): M_IS after it is A drive, with A (n_I, g) the same at all samples
    b: Floats  # (n, q0, s) in the first coordinates of Q: K_II⁻¹ A drive
    follow: Floats  # (n, h, s): u_I = w − X follow u_S

    def at(self, some: Ints) -> Outer:
        """The arrays of some samples."""
        return Outer(*(getattr(self, each.name)[some] for each in fields(self)))


def _prepared(
    pencil: Pencil, split: Split, theta: Floats, empty: Inner
) -> tuple[Inner, Outer, Floats, Floats] | None:
    """T without vectors W yet, the samples, X (n_I, h) with K_II⁻¹ K_IS = X follow, and A.

    None where b has too many columns. Raises MechanismError where Σ is indefinite.
    """
    K_SS, M_SS = (_outer_block(pencil, split, w, theta) for w in (pencil.stiffness, pencil.mass))
    stiff, follow = _coupling(pencil, split, pencil.stiffness, theta)
    heavy, push = _coupling(pencil, split, pencil.mass, theta)
    h = stiff.shape[1]
    if h + heavy.shape[1] > MOST_VECTORS:
        return None
    X = empty.solve(stiff)
    MX = empty.M @ X
    A, drive = np.hstack([MX, heavy]), np.concatenate([-follow, push], axis=1)
    inner, inputs = empty.spanning(empty.solve(A))
    down = np.swapaxes(follow, 1, 2)
    sigma = K_SS - down @ (stiff.T @ X) @ follow
    cross = np.swapaxes(push, 1, 2) @ (heavy.T @ X) @ follow
    mass = M_SS - cross - np.swapaxes(cross, 1, 2) + down @ (X.T @ MX) @ follow
    elastic = slice(0, len(split.outer) - len(pencil.rigid))
    inverse = inverse_factor(sigma[:, elastic, elastic])
    return inner, Outer(inverse, mass, drive, inputs @ drive, follow), X, A


@dataclass(frozen=True, eq=False)
class RitzPairs:
    """Ritz pairs of n samples, μ̂ descending: (n, p), a (n, k, p), u_S (n, s, p)."""

    mu: Floats
    a: Floats
    u: Floats


def _ritz(inner: Inner, outer: Outer, A: Floats) -> RitzPairs:
    """z = [a; u_S] has unit K-norm."""
    k, e, s = inner.W.shape[1], outer.inverse.shape[1], outer.mass.shape[1]
    n, low = len(outer.mass), np.swapaxes(outer.inverse, 1, 2)
    M = np.empty((n, k + s, k + s))
    M[:, :k, :k], M[:, k:, k:] = inner.mass, outer.mass
    M[:, :k, k:] = (inner.vectors.T @ A) @ outer.drive
    M[:, k:, :k] = np.swapaxes(M[:, :k, k:], 1, 2)
    E, F = slice(0, k + e), slice(k + e, k + s)
    coupling, M_c = condense_blocks(M[:, E, E].copy(), M[:, F, E], M[:, F, F])
    M_c[:, k:] = outer.inverse @ M_c[:, k:]
    M_c[:, :, k:] = M_c[:, :, k:] @ low
    mu, v = np.linalg.eigh(M_c)
    mu, v = mu[:, ::-1], v[:, :, ::-1].copy()
    v[:, k:] = low @ v[:, k:]
    return RitzPairs(mu, v[:, :k], np.concatenate([v[:, k:], -coupling @ v], axis=1))


def _residuals(inner: Inner, outer: Outer, pairs: RitzPairs) -> Floats:
    """ρ (n, q, p) in coordinates of Q: their length is that in K_II.

    μ̂ W a cancels what W has of the rest: in a fine mesh down to the round-off of K itself, by
    which T is not self-adjoint, and no vector would make it smaller.
    """
    rho = inner.TW @ pairs.a
    rho[:, : outer.b.shape[1]] += outer.b @ pairs.u
    return np.asarray(rho - inner.W @ (inner.W.T @ rho))


# --- The whole

# Samples that repay what they share, at 300 to 10⁴ unknowns (benchmarks/many_samples.py).
FEWEST = 20
CONVERGED = 1e-9  # |ρ|/μ̂: the vectors' error; that of λ is of second order in it
MOST_VECTORS = 250  # of W: beyond, a sample's own matrices are as large as a sparse solve
BESIDE = 4  # modes above the highest wanted one that the cut may take in
NEGLIGIBLE = 1e-12  # relative error of λ: below the round-off of any solver


def solve_large(pencil: Pencil, theta: Floats, count: int, vectors: bool) -> Modes:
    """Modes at θ (n_theta, n_samples): together where that is proved, the others one by one."""
    parts = range(0, theta.shape[1], 256)  # so many at once, for memory
    found = [_large(pencil, theta[:, i : i + 256], count, vectors) for i in parts]
    return Modes(np.concatenate([f.lam for f in found]), np.concatenate([f.phi for f in found]))


def _large(pencil: Pencil, theta: Floats, count: int, vectors: bool) -> Modes:
    together = solve_together(pencil, theta, count, vectors) if theta.shape[1] >= FEWEST else None
    if together is None:
        return solve_sparse(pencil, theta, count, vectors)
    modes, sure = together
    if not sure.all():
        alone = solve_sparse(pencil, theta[:, ~sure], count, vectors)
        modes.lam[~sure], modes.phi[~sure] = alone.lam, alone.phi
    return modes


def solve_together(
    pencil: Pencil, theta: Floats, count: int, vectors: bool
) -> tuple[Modes, Flags] | None:
    """Modes at θ (n_theta, n_samples), and at which samples they are proved; None if at none.

    Where they are not proved the rows mean nothing.
    """
    varying = varying_unknowns(pencil, theta)
    if varying is None:
        return None
    split = _split(pencil, varying)
    K, M = (
        principal(pencil, w @ theta[:, 0], split.inner) for w in (pencil.stiffness, pencil.mass)
    )
    factor = definite_factor(K)
    if factor is None:
        return None
    try:
        prepared = _prepared(pencil, split, theta, Inner.empty(K, M, factor))
        if prepared is None:
            return None
        inner, outer, X, A = prepared
        solved = _converged(inner, outer, A, count)
    except (MechanismError, AccuracyError):
        return None  # of one sample, which is named where it is solved by itself
    if solved is None:
        return None
    inner, pairs, sure = solved
    shapes = []
    for part, phi in _shapes(pencil, split, inner, outer, X, pairs, count):
        sure[part] &= _have_mass(pencil, theta[:, part], phi, pairs.mu[part, :count])
        if vectors:
            shapes.append(positive_at_top(phi))
    lam = 1.0 / pairs.mu[:, :count]
    return Modes(lam, np.concatenate(shapes) if vectors else np.zeros((len(lam), 0, count))), sure


def _converged(
    inner: Inner, outer: Outer, A: Floats, count: int
) -> tuple[Inner, RitzPairs, Flags] | None:
    """W grown until all residuals are small and the modes are proved; None if that fails."""
    n = len(outer.mass)
    start = np.random.default_rng(0).standard_normal((inner.K.shape[0], count))
    inner, seeds = inner.spanning(inner.solve(inner.M @ start))
    inner = inner.with_vectors(seeds)
    every = np.arange(n)
    some = np.unique(np.linspace(0, n - 1, min(n, 16)).round().astype(int))  # W is for these first
    looked_inside = False
    for _ in range(25):
        part = outer.at(some)
        pairs = _ritz(inner, part, A)
        if pairs.mu.shape[1] < count or (pairs.mu[:, :count] <= 0.0).any():
            return None  # so few have mass
        cut = _cuts(pairs.mu, count)
        rho = _residuals(inner, part, pairs)
        counts = np.arange(pairs.mu.shape[1]) < cut[:, None]
        relative = np.where(counts[:, None], rho / pairs.mu[:, None], 0.0)
        if np.sqrt(np.square(relative).sum(axis=1).max(initial=0.0)) > CONVERGED:
            leftover = relative.transpose(1, 0, 2).reshape(len(inner.W), -1)
            U, size, _ = np.linalg.svd(leftover, full_matrices=False)
            # what is below a fiftieth of the largest is left to later rounds, as more than 24 are
            new = U[:, : min(int((size > 0.02 * size[0]).sum()), 24)]
        elif len(some) < n:
            some = every
            continue
        else:
            nu = 0.5 * float(np.take_along_axis(pairs.mu, cut[:, None] - 1, axis=1).min())
            outside = inner.largest_outside(nu)
            if outside is not None:
                return inner, pairs, proved(pairs.mu, rho, cut, outside)
            inside = inner.above(nu)
            if looked_inside or not 0 < inside <= 64:
                return None
            looked_inside = True
            inner, new = inner.spanning(inner.modes(inside))
        if inner.W.shape[1] + new.shape[1] > MOST_VECTORS:
            return None
        inner = inner.with_vectors(new)
    return None


def _cuts(mu: Floats, count: int) -> Ints:
    """Number c (n,) ≥ count of pairs of each sample that count: the next one lies apart."""
    beyond = np.hstack([mu, np.zeros((len(mu), 1))])
    last = min(count + BESIDE, mu.shape[1])
    ratio = beyond[:, count : last + 1] / mu[:, count - 1 : last]
    apart = ratio <= 0.8  # no need to look further
    return np.asarray(
        count + np.where(apart.any(axis=1), apart.argmax(axis=1), ratio.argmin(axis=1))
    )


def proved(mu: Floats, rho: Floats, cut: Ints, nu: float) -> Flags:
    """True where the first ``cut`` pairs are those of the lowest modes; ν' is ``nu``."""
    sure = np.zeros(len(mu), dtype=bool)
    for k, c in enumerate(cut):
        last, beyond = mu[k, c - 1], mu[k, c:]
        x = 0.5 * (last + max(beyond.max(initial=0.0), nu))
        if x >= last:
            continue
        size = np.square(rho[k, :, :c]).sum(axis=0) / mu[k, :c]
        gram = rho[k, :, c:].T @ rho[k, :, c:]
        outside = np.linalg.eigvalsh(gram / (x - nu) + np.diag(beyond))
        sure[k] = outside.max(initial=0.0) < x and c * size.max() < NEGLIGIBLE * (last - x)
    return sure


# --- The modes of the whole model


def _shapes(
    pencil: Pencil,
    split: Split,
    inner: Inner,
    outer: Outer,
    X: Floats,
    pairs: RitzPairs,
    count: int,
) -> Iterator[tuple[slice, Floats]]:
    """φ (n, n_dof, count) with φᵀMφ = 1, of some samples at a time."""
    columns = np.hstack([inner.vectors, X])
    step = max(1, 2_000_000 // (pencil.n_dof * count))  # 16 MB of shapes at once
    for i in range(0, len(pairs.mu), step):
        part = slice(i, i + step)
        scale = 1.0 / np.sqrt(pairs.mu[part, None, :count])
        a, u = pairs.a[part, :, :count] * scale, pairs.u[part, :, :count] * scale
        moved = np.concatenate([a, -outer.follow[part] @ u], axis=1).transpose(1, 0, 2)
        inside = columns @ moved.reshape(columns.shape[1], -1)
        phi = np.empty((len(u), pencil.n_dof, count))
        phi[:, split.inner] = inside.reshape(-1, len(u), count).transpose(1, 0, 2)
        phi[:, split.outer] = u
        yield part, phi


def _have_mass(pencil: Pencil, theta: Floats, phi: Floats, mu: Floats) -> Flags:
    """True at the samples (n,) where no μ may be round-off."""
    E, F = pencil.elastic, pencil.rigid
    coupling = np.zeros((len(phi), len(F), len(E)))
    if len(F):
        M_F = np.array([block(pencil, pencil.mass @ each, F) for each in theta.T])
        coupling = np.asarray(np.linalg.solve(M_F[:, :, F], M_F[:, :, E]))
    sizes = mass_sizes(pencil, theta, coupling)
    noise = mu * np.einsum("ki,kic->kc", sizes, np.square(phi[:, E]))
    return np.asarray(~may_be_roundoff(mu, noise, len(E), margin=1.0).any(axis=1))
