"""Exact elastic modes of large pencils: one sample by Lanczos, many samples together.

Along a trajectory K and M vary in the rows and columns of few unknowns only: S, those at joints,
the held and the free coordinates. With I all others, K_II and M_II are the same at every sample.
u_I = w − K_II⁻¹ K_IS u_S takes K apart into diag(K_II, Σ), Σ = K_SS − K_SI K_II⁻¹ K_IS, and the
inverse form M z = μ K z reads, in the rows of I times K_II⁻¹,

    T w + b(θ) u_S = μ w,   T = K_II⁻¹ M_II,   b = K_II⁻¹ (M_IS − M_II K_II⁻¹ K_IS) .

T is one operator for all samples, self-adjoint in K_II. Galerkin's method on w = W a and all of u_S
gives pairs (μ̂, a, u_S) from matrices of some tens of rows at each sample. Their residuals, less
what W holds, are ρ = R (a, u_S), R that part of the columns of T W and of those b is made of. W
grows by the leading directions of the residuals of all samples at once until |ρ| ≤ 1e-8 μ̂
everywhere: λ is then as exact as arithmetic makes it, for its error is of second order in ρ.

What T has above half of the least μ̂ is in W: it is counted there, and by the negative pivots of
K_II − M_II/ν, ν that half. So no mode is missed that S does not feel, of which no residual knows;
and a pair j beyond the last that counts, c, lacks |ρ_j|²/(μ̂_c − ν) at most, which has to leave it
below μ̂_c.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import linalg

from eigassign.errors import LIMP, AccuracyError, MechanismError, MissingMassError
from eigassign.mechanism.assembly.pencil import Pencil, block, principal
from eigassign.mechanism.elements.craig_bampton import (
    definite_factor,
    factorise,
    has_positive_pivots,
    largest_modes,
)
from eigassign.modal.exact.dense import (
    Modes,
    condense_blocks,
    inverse_factor,
    mass_sizes,
    may_be_roundoff,
    modes_with_mass,
    positive_at_top,
    rigid_coupling,
)
from eigassign.modal.exact.inertia import negative_pivots

Floats = NDArray[np.float64]
FINE = (
    "the exact modes were not found: so fine a mesh, or stiffnesses so far apart, leave only "
    "round-off. Give the links fewer elements"
)
DENSE_MOST = 4000  # elastic unknowns up to which dense algebra settles what may be round-off


def solve_sparse(pencil: Pencil, theta: Floats, count: int, vectors: bool) -> Modes:
    """Modes at θ (n_theta, n_samples), one sample after the other."""
    solved = [_one(pencil, theta[:, k], count) for k in range(theta.shape[1])]
    lam = np.array([s[0] for s in solved])
    phi = np.array([s[1] for s in solved]) if vectors else np.zeros((len(lam), 0, count))
    return Modes(lam, phi)


def _one(pencil: Pencil, theta: Floats, count: int) -> tuple[Floats, Floats]:
    E, F = pencil.elastic, pencil.rigid
    K_E = principal(pencil, pencil.stiffness @ theta, E)
    mass = pencil.mass @ theta
    M_EE, M_F = principal(pencil, mass, E), block(pencil, mass, F)
    M_FE = M_F[:, E]
    coupling = rigid_coupling(M_F[:, F], M_FE)
    try:
        factor = factorise(K_E)
    except RuntimeError as error:
        raise MechanismError("mechanism", LIMP) from error
    if pencil.weight is not None and not has_positive_pivots(factor):
        raise MechanismError("mechanism", LIMP)
    M_rows = M_EE.T  # symmetric: products run faster row by row

    def mass_product(v: Floats) -> Floats:
        return np.asarray(M_rows @ v - (coupling @ v) @ M_FE)

    try:
        mu, z = largest_modes(factor, K_E.T, mass_product, count)
    except linalg.ArpackError as error:
        if len(E) > DENSE_MOST:
            raise AccuracyError(FINE) from error
        # Few directions have mass: ARPACK before SciPy 1.16 cannot build a larger Krylov space.
        mu, z = np.zeros(count), np.zeros((len(E), count))  # none is sure: dense algebra decides
    noise = mass_sizes(pencil, theta[:, None], coupling[None])[0] @ (z * z)
    sure = ~may_be_roundoff(mu, noise, len(E), margin=1.0)  # dense algebra is dear here
    if sure.all():
        lam, phi = 1.0 / mu, np.empty((pencil.n_dof, count))
        phi[E] = z / np.sqrt(mu)
        phi[F] = -coupling @ phi[E]
    elif len(E) <= DENSE_MOST:
        lam, phi = modes_with_mass(pencil, theta[:, None], count)
    else:
        raise MissingMassError(int(sure.argmin()))
    return lam, positive_at_top(phi)


Ints = NDArray[np.intp]
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
    is_outer: NDArray[np.bool_]
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

    G holds the columns of all terms, unit vectors of the same direction once.
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


# --- Galerkin's method on W and S

# Samples that repay what they share, at 300 to 10⁴ unknowns (benchmarks/many_samples.py).
FEWEST = 20
CONVERGED = 1e-8  # |ρ|/μ̂: the vectors' error; that of λ is of second order in it
BESIDE = 2  # pairs beyond the last that are looked at
MOST_VECTORS = 250  # of W: beyond, a sample's own matrices are as large as a sparse solve
AT_FIRST = 16  # samples that W grows for before it is tried at all


@dataclass(frozen=True, eq=False)
class Galerkin:
    """The operator T, and arrays over n samples of what differs; S with its f free ones last."""

    K: sparse.csr_array  # K_II
    M: sparse.csr_array
    factor: linalg.SuperLU
    X: Floats  # (n_I, h) with K_II⁻¹ K_IS = X follow
    follow: Floats  # (n, h, s)
    A: Floats  # (n_I, g) with M_IS − M_II K_II⁻¹ K_IS = A drive
    drive: Floats  # (n, g, s)
    inverse: Floats  # (n, s − f, s − f): L⁻¹ with Σ = L Lᵀ
    mass: Floats  # (n, s, s): M_SS after the change of unknowns

    def solve(self, forces: Floats) -> Floats:
        """K_II⁻¹ times ``forces`` (n_I, r); SuperLU wants at least one."""
        return np.asarray(self.factor.solve(forces)) if forces.size else forces

    def modes(self, count: int) -> Floats:
        """Vectors (n_I, count) of the largest eigenvalues of T."""
        return largest_modes(self.factor, self.K, lambda v: np.asarray(self.M @ v), count)[1]

    def above(self, nu: float) -> int:
        """Number of eigenvalues of T above ν; UNCERTAIN where one is too near."""
        scale = 1.0 / np.sqrt(self.K.diagonal() + self.M.diagonal() / nu)
        S = sparse.diags_array(scale)
        return negative_pivots(sparse.csc_array(S @ (self.K - self.M / nu) @ S))

    def grown(self, W: Floats, vectors: Floats) -> Floats:
        """W with the K_II-orthonormal directions that ``vectors`` add to it."""
        vectors = vectors / np.sqrt(np.einsum("ij,ij->j", vectors, self.K @ vectors))
        for _ in range(2):
            vectors = vectors - W @ (W.T @ (self.K @ vectors))
            values, turns = np.linalg.eigh(vectors.T @ (self.K @ vectors))
            # 1e-14 is the round-off of squares of lengths
            kept = values > 1e-14
            vectors = vectors @ (turns[:, kept] / np.sqrt(values[kept]))
        return np.hstack([W, vectors])

    def pairs(self, W: Floats, some: Ints) -> tuple[Floats, Floats, Floats]:
        """μ̂ (n, p), descending, a (n, k, p) and u_S (n, s, p), of unit K-norm, at ``some``."""
        inverse, mass = self.inverse[some], self.mass[some]
        k, e, s = W.shape[1], inverse.shape[1], mass.shape[1]
        n, low = len(mass), np.swapaxes(inverse, 1, 2)
        M = np.empty((n, k + s, k + s))
        M[:, :k, :k], M[:, k:, k:] = W.T @ (self.M @ W), mass
        M[:, :k, k:] = (W.T @ self.A) @ self.drive[some]
        M[:, k:, :k] = np.swapaxes(M[:, :k, k:], 1, 2)
        E, F = slice(0, k + e), slice(k + e, k + s)
        coupling, M_c = condense_blocks(M[:, E, E].copy(), M[:, F, E], M[:, F, F])
        M_c[:, k:] = inverse @ M_c[:, k:]
        M_c[:, :, k:] = M_c[:, :, k:] @ low
        mu, v = np.linalg.eigh(M_c)
        mu, v = mu[:, ::-1], v[:, :, ::-1].copy()
        v[:, k:] = low @ v[:, k:]
        return mu, v[:, :k], np.concatenate([v[:, k:], -coupling @ v], axis=1)


def _galerkin(pencil: Pencil, split: Split, theta: Floats) -> Galerkin | None:
    """None where K_II is not definite; raises MechanismError where Σ is not."""
    K, M = (
        principal(pencil, w @ theta[:, 0], split.inner) for w in (pencil.stiffness, pencil.mass)
    )
    factor = definite_factor(K)
    if factor is None:
        return None
    K_SS, M_SS = (_outer_block(pencil, split, w, theta) for w in (pencil.stiffness, pencil.mass))
    stiff, follow = _coupling(pencil, split, pencil.stiffness, theta)
    heavy, push = _coupling(pencil, split, pencil.mass, theta)
    X = factor.solve(stiff) if stiff.size else stiff
    MX, down = M.T @ X, np.swapaxes(follow, 1, 2)
    sigma = K_SS - down @ (stiff.T @ X) @ follow
    cross = np.swapaxes(push, 1, 2) @ (heavy.T @ X) @ follow
    mass = M_SS - cross - np.swapaxes(cross, 1, 2) + down @ (X.T @ MX) @ follow
    elastic = slice(0, len(split.outer) - len(pencil.rigid))
    inverse = inverse_factor(sigma[:, elastic, elastic])
    A, drive = np.hstack([MX, heavy]), np.concatenate([-follow, push], axis=1)
    return Galerkin(K.T, M.T, factor, X, follow, A, drive, inverse, mass)


def _converged(one: Galerkin, count: int) -> tuple[Floats, tuple[Floats, Floats, Floats]] | None:
    """W grown until all residuals are small, and the pairs; None if that fails."""
    n, R = len(one.mass), one.solve(one.A)  # R: b's columns and T W, less what W holds
    start, every = np.random.default_rng(0).standard_normal((len(R), count)), np.arange(n)
    W = one.grown(R[:, :0], one.solve(one.M @ start))
    some = np.unique(np.linspace(0, n - 1, min(n, AT_FIRST)).round().astype(int))
    known = 0
    for _ in range(25):
        mu, a, u = found = one.pairs(W, some)
        if mu.shape[1] < count or (mu[:, :count] <= 0.0).any():
            return None  # so few have mass
        new = W[:, known:]
        R -= new @ ((one.K @ new).T @ R)
        image = one.solve(one.M @ new)
        R, known = np.hstack([R, image - W @ (W.T @ (one.K @ image))]), W.shape[1]
        p = count if len(some) == n else min(count + BESIDE, mu.shape[1])
        c = np.concatenate([one.drive[some] @ u, a], axis=1)[..., :p].swapaxes(0, 1)
        scale = np.maximum(mu[:, :p], mu[:, [count - 1]])
        rho = R @ (c / scale).reshape(len(c), -1)
        K_rho = one.K @ rho
        off = np.sqrt(np.maximum((rho * K_rho).sum(axis=0), 0.0)).reshape(-1, p)
        # pairs beyond count as far as what they lack could bring them before the last
        open_ = ((off > CONVERGED) & (mu[:, :p] / scale + 2.0 * off**2 >= 1.0)).ravel()
        if open_.any():
            sizes, turns = np.linalg.eigh(rho[:, open_].T @ K_rho[:, open_])
            # what is below a fiftieth of the largest is left to later rounds, as more than 24 are
            new = rho[:, open_] @ turns[:, sizes > 4e-4 * sizes[-1]][:, -24:]
        elif len(some) < n:
            some = every
            continue
        else:
            nu = 0.5 * float(mu[:, count - 1].min())
            inside = one.above(nu)
            if inside == (np.linalg.eigvalsh(W.T @ (one.M @ W)) > nu).sum():
                return W, found
            if not 0 < inside <= 64:
                return None
            new = one.modes(inside)
        if W.shape[1] + new.shape[1] > MOST_VECTORS:
            return None
        W = one.grown(W, new)
    return None


def solve_large(pencil: Pencil, theta: Floats, count: int, vectors: bool) -> Modes:
    """Modes at θ (n_theta, n_samples): together where that works, else one by one."""
    found = []
    for i in range(0, theta.shape[1], 256):  # so many at once, for memory
        some = theta[:, i : i + 256]
        many = some.shape[1] >= FEWEST
        together = solve_together(pencil, some, count, vectors) if many else None
        found.append(together or solve_sparse(pencil, some, count, vectors))
    return Modes(np.concatenate([f.lam for f in found]), np.concatenate([f.phi for f in found]))


def solve_together(pencil: Pencil, theta: Floats, count: int, vectors: bool) -> Modes | None:
    """Modes at θ (n_theta, n_samples); None where they have to be found one by one."""
    varying = varying_unknowns(pencil, theta)
    if varying is None:
        return None
    split = _split(pencil, varying)
    try:
        one = _galerkin(pencil, split, theta)
        solved = None if one is None else _converged(one, count)
    except (MechanismError, AccuracyError, linalg.ArpackError):
        return None  # of one sample, which is named where it is solved by itself
    if one is None or solved is None:
        return None
    W, (mu, a, u) = solved
    shapes, columns = [], np.hstack([W, one.X])
    step = max(1, 2_000_000 // (pencil.n_dof * count))  # 16 MB of shapes at once
    for i in range(0, len(mu), step):
        part, scale = slice(i, i + step), 1.0 / np.sqrt(mu[i : i + step, None, :count])
        moved = np.concatenate([a[part], -one.follow[part] @ u[part]], axis=1)[..., :count] * scale
        phi = np.empty((len(moved), pencil.n_dof, count))
        phi[:, split.inner], phi[:, split.outer] = columns @ moved, u[part, :, :count] * scale
        if not _have_mass(pencil, theta[:, part], phi, mu[part, :count]):
            return None
        if vectors:
            shapes.append(positive_at_top(phi))
    return Modes(
        1.0 / mu[:, :count], np.concatenate(shapes) if vectors else np.zeros((len(mu), 0, count))
    )


def _have_mass(pencil: Pencil, theta: Floats, phi: Floats, mu: Floats) -> bool:
    """True where no μ of the samples (n,) may be round-off."""
    E, F = pencil.elastic, pencil.rigid
    coupling = np.zeros((len(phi), len(F), len(E)))
    if len(F):
        M_F = np.array([block(pencil, pencil.mass @ each, F) for each in theta.T])
        coupling = np.asarray(np.linalg.solve(M_F[:, :, F], M_F[:, :, E]))
    sizes = mass_sizes(pencil, theta, coupling)
    noise = mu * np.einsum("ki,kic->kc", sizes, np.square(phi[:, E]))
    return not may_be_roundoff(mu, noise, len(E), margin=1.0).any()
