"""The bordered system that yields every eigenvector coefficient, factored once (eqs. (4)-(6)).

    ⎡ K0 − λ0 M0   −M0 Φ0 ⎤ ⎡ φ_γ ⎤   ⎡ rhs_γ ⎤
    ⎣ −Φ0ᵀ M0        0    ⎦ ⎣ λ_γ ⎦ = ⎣   0   ⎦

Symmetric and regular although K0 − λ0 M0 is singular; it replaces the paper's pseudo-inverse. The
border is scaled to the size of the stiffness so that pivoting does not mix units.

A large pencil has one sparse factorisation, and everything dense is kept out of it. With u the
elastic unknowns, A_uu = K_uu − λ M_uu is sparse, but the rows of the coordinates q̇ and the border
−M0 Φ0 are dense, and A_uu may be singular. So it is pinned, A' = A_uu + Σ τ_k e_k e_kᵀ, at r
unknowns where the modes have most energy, which is undone by r more unknowns t_k = e_kᵀ u:

    ⎡ A'   W ⎤ ⎡ u ⎤   ⎡ g_u ⎤          W = [A_uF, −b_u, −τ e_k],   s = (q̇, Λ_γ, t)
    ⎣ Wᵀ   D ⎦ ⎣ s ⎦ = ⎣ g_s ⎦ ,

solved by the small dense S = D − Wᵀ A'⁻¹ W. Fill-in is that of K alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import blas, lapack
from scipy.sparse import linalg

from eigassign.errors import AccuracyError
from eigassign.mechanism.assembly.pencil import Pencil, block, principal
from eigassign.mechanism.elements.craig_bampton import factorise, lu

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Solve = Callable[[Floats], tuple[Floats, Floats]]
Factorise = Callable[[sparse.csc_array], linalg.SuperLU]
SINGULAR = "the bordered system is singular: a mode of the cluster is missing"
RESIDUAL = 1e-9  # of a trial solve, relative to |A| |x|, above which the pivots are not trusted


def factor_dense(A: Floats, border: Floats) -> Solve:
    """Solver for [[A, −Bᵀ], [−B, 0]], B = ``border`` (r, n): rows (k, n) → x (k, n), l (k, r).

    Raises AccuracyError where the system is singular: the border misses a mode with the same λ.
    """
    r, n = border.shape
    scale = float((np.abs(A).max() or 1.0) / np.abs(border).max())  # A = 0 of a model of one mode
    full = np.zeros((n + r, n + r))
    full[:n, :n] = A
    full[n:, :n] = border
    full[n:] *= -scale
    full[:n, n:] = full[n:, :n].T
    lu, pivots, info = lapack.dgetrf(full.T, overwrite_a=1)
    if info:
        raise AccuracyError(SINGULAR)

    def solve(rows: Floats) -> tuple[Floats, Floats]:
        padded = np.zeros((len(rows), n + r))
        padded[:, :n] = rows
        solution = lapack.dgetrs(lu, pivots, padded.T, overwrite_b=1)[0].T
        return solution[:, :n], scale * solution[:, n:]

    return solve


def with_partial_pivoting(matrix: sparse.csc_array) -> linalg.SuperLU:
    """LU factors without any regard to symmetry: more fill-in than `factorise`, and safe."""
    return lu(matrix, permc_spec="COLAMD")


def factor_sparse(
    pencil: Pencil,
    data: Floats,
    border: Floats,
    phi: Floats,
    factorisations: Sequence[Factorise] = (factorise, with_partial_pivoting),
) -> Solve:
    """Solver for [[A, −Bᵀ], [−B, 0]], A from its non-zeros ``data``, B = ``border`` (r, n).

    ``phi`` (r, n) are the modes; the first of ``factorisations`` whose pivots can be trusted is
    taken. Rows (k, n) → x (k, n), l (k, r). Raises AccuracyError where the system is singular: the
    border misses a mode with the same λ.
    """
    A, pins = pencil.sparse(data), _pins(pencil, data, phi)
    for factorisation in factorisations:
        solve = _solver(pencil, data, border, pins, factorisation)
        if _trial(A, border, solve) <= RESIDUAL:
            return solve
    raise AccuracyError(SINGULAR)


def _pins(pencil: Pencil, data: Floats, phi: Floats) -> Ints:
    """One unknown a mode, where it has most energy, by elimination so that they are independent."""
    diagonal = np.zeros(pencil.n_dof)
    on = pencil.rows == pencil.columns
    diagonal[pencil.rows[on]] = np.abs(data[on])
    left = (phi * np.sqrt(diagonal))[:, : pencil.n_u]
    pins = []
    for _ in phi:
        mode, k = np.unravel_index(np.abs(left).argmax(), left.shape)
        pins.append(int(k))
        left = left - np.outer(left[:, k] / left[mode, k], left[mode])
    return np.array(pins, dtype=np.intp)


@dataclass(frozen=True, eq=False)
class _Bordered:
    """A' factored, W's rows, A'⁻¹ W's rows, and S factored."""

    factor: linalg.SuperLU
    W: Floats  # (m, n_u)
    Z: Floats  # (m, n_u)
    S: tuple[Floats, Ints]
    n_rigid: int
    border_scale: float
    r: int

    def __call__(self, rows: Floats) -> tuple[Floats, Floats]:
        """x (k, n) and l (k, r) for rows (k, n)."""
        n_u = self.W.shape[1]
        v = self.factor.solve(rows[:, :n_u].T).T
        small = -(v @ self.W.T)
        small[:, : self.n_rigid] += rows[:, n_u:]
        s = lapack.dgetrs(*self.S, small.T)[0].T
        x = np.empty_like(rows)
        np.subtract(v, s @ self.Z, out=x[:, :n_u])
        x[:, n_u:] = s[:, : self.n_rigid]
        l = s[:, self.n_rigid : self.n_rigid + self.r]  # noqa: E741
        return x, self.border_scale * l


def _trial(A: sparse.csc_array, border: Floats, solve: Solve) -> float:
    """Residual of one solve with a right-hand side of no special direction."""
    row = np.random.default_rng(0).standard_normal(border.shape[1]) * np.sqrt(A.diagonal().max())
    x, values = solve(row[None])
    rest = A @ x[0] - values[0] @ border - row
    size = abs(A) @ np.abs(x[0]) + np.abs(values[0]) @ np.abs(border) + np.abs(row)
    return float(np.abs(rest).max() / np.abs(size).max())


def _solver(
    pencil: Pencil, data: Floats, border: Floats, pins: Ints, factorise: Factorise
) -> _Bordered:
    n_u, n = pencil.n_u, pencil.n_dof
    f, r = n - n_u, len(border)
    A = principal(pencil, data, np.arange(n_u))
    tau = np.abs(A.diagonal()[pins])
    scale = float(np.abs(data).max() / np.abs(border).max())
    W = np.zeros((f + 2 * r, n_u))
    edge = block(pencil, data, np.arange(n_u, n))
    W[:f] = edge[:, :n_u]
    W[f : f + r] = -scale * border[:, :n_u]
    W[np.arange(f + r, f + 2 * r), pins] = -tau
    D = np.zeros((f + 2 * r, f + 2 * r))
    D[:f, :f] = edge[:, n_u:]
    D[f : f + r, :f] = -scale * border[:, n_u:]
    D[:f, f : f + r] = D[f : f + r, :f].T
    D[np.arange(f + r, f + 2 * r), np.arange(f + r, f + 2 * r)] = tau
    factor = factorise(A + sparse.csc_array((tau, (pins, pins)), shape=A.shape))
    Z = factor.solve(W.T).T
    lu, pivots, info = lapack.dgetrf(D - W @ Z.T)
    if info:
        raise AccuracyError(SINGULAR)
    return _Bordered(factor, W, Z, (lu, pivots), f, scale, r)


def add_product(out: Floats, A: Floats, B: Floats) -> None:
    """out += A B for C-ordered out (m, n), A (m, k), B (k, n)."""
    result = blas.dgemm(1.0, B.T, A.T, 1.0, out.T, overwrite_c=1)
    if not np.may_share_memory(result, out):  # out was not contiguous
        out[...] = result.T
