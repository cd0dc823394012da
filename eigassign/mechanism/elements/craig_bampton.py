"""Craig-Bampton reduction of a link, and factors of symmetric definite sparse matrices.

Craig and Bampton (AIAA J. 6 (1968) 1313): with the interface b and the interior i of a link,

    u_i = Ψ u_b + W η,   Ψ = −K_ii⁻¹ K_ib,   W ⊇ Φ,   K_ii Φ = M_ii Φ Λ,  λ ≤ (2π f)² .

Links stay affine in y: the basis is constant, taken in the middle of the design's bounds, and every
constant matrix of the link is projected on it. Where the link itself changes with y, W also holds
what Ψ and Φ become at both ends of the bounds, and the part of N(y) that Ψ does not carry, so that
rigid-body motion is in the span at every y. Under gravity that of an imported part holds its sag as
well, K_ii⁻¹ (M r)_i of translations r: the weight's stiffness, which joins M r to the nodes
(`assembly.loads.second_order`), is nothing then on what is left out. What that changes is measured
against the whole links (`modal.mesh_error`).

The modes are solved in the inverse form M_ii φ = μ K_ii φ, μ = 1/λ, in which massless dofs (μ = 0,
as of rotations without inertia) do no harm.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from scipy import sparse
from scipy.linalg import eigh
from scipy.sparse import linalg

from eigassign.arrays import Floats, Ints
from eigassign.case.case_file import CaseFile
from eigassign.case.schema.targets import StaticTarget
from eigassign.errors import AccuracyError, MechanismError
from eigassign.mechanism.elements.links import LinkMesh, Reduction, Term, total
from eigassign.mechanism.kinematics.parameters import ModelParameters, is_imported, link_type

Product = Callable[[Floats], Floats]


def factorise(matrix: sparse.csc_array) -> linalg.SuperLU:
    """LU without pivoting off the diagonal: cheap in fill-in, right for definite matrices.

    For others the caller checks what comes out.
    """
    options = {"SymmetricMode": True}
    return lu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)


def lu(matrix: sparse.csc_array, **options: Any) -> linalg.SuperLU:
    """SuperLU's factors; RuntimeError where a pivot is exactly zero, MemoryError without memory."""
    try:
        return linalg.splu(matrix, **options)
    except RuntimeError as error:
        if "singular" in str(error):
            raise
        raise MemoryError(str(error)) from error  # of a malloc that failed


def has_positive_pivots(factor: linalg.SuperLU) -> bool:
    """True where all pivots are on the diagonal and positive: the matrix is definite."""
    return bool((factor.perm_r == factor.perm_c).all() and (factor.U.diagonal() > 0.0).all())


def definite_factor(matrix: sparse.csc_array) -> linalg.SuperLU | None:
    """The factor of a symmetric positive definite matrix; None where it is not definite."""
    try:
        factor = factorise(matrix)
    except RuntimeError:  # a pivot is exactly zero
        return None
    diagonal = np.asarray(matrix.diagonal())[np.argsort(factor.perm_c)]
    pivots = np.asarray(factor.U.diagonal())
    # a pivot of a definite matrix is more than the round-off of its diagonal entry
    return factor if (pivots > 1e-15 * np.abs(diagonal)).all() else None


@dataclass(frozen=True)
class _Matrix:
    """A sparse matrix, the same where all its numbers are."""

    digest: bytes
    matrix: sparse.csc_array = field(compare=False)


def kept_factor(matrix: sparse.csc_array) -> linalg.SuperLU | None:
    """`definite_factor`, once for a matrix that is asked for again and again.

    A part that a design leaves alone has the same stiffness at every design and in every model.
    """
    return _kept(_digested(matrix))


def _digested(matrix: sparse.csc_array) -> _Matrix:
    indices = (np.asarray(a, dtype=np.int64) for a in (matrix.indptr, matrix.indices))
    parts = (*indices, np.asarray(matrix.data, dtype=np.float64))  # the first tells the order n
    digest = hashlib.sha256(b"".join(hashlib.sha256(a.tobytes()).digest() for a in parts)).digest()
    return _Matrix(digest, matrix)


@lru_cache(maxsize=4)  # few, for factors of large parts are large
def _kept(asked: _Matrix) -> linalg.SuperLU | None:
    return definite_factor(asked.matrix)


def is_semidefinite(matrix: sparse.csr_array, tolerance: float) -> bool:
    """Whether A + tolerance × diag(A) is positive definite on the rows that are not zero.

    Negative eigenvalues within the tolerance, relative to the diagonal, pass for round-off.
    """
    diagonal = np.asarray(matrix.diagonal())
    present = np.flatnonzero(np.asarray(abs(matrix).sum(axis=1)).ravel())
    if (diagonal[present] <= 0.0).any():
        return False
    if not len(present):
        return True
    scale = sparse.diags_array(1.0 / np.sqrt(diagonal[present]))
    scaled = scale @ matrix[present][:, present] @ scale
    eye = sparse.eye_array(len(present))
    return definite_factor(sparse.csc_array(scaled + tolerance * eye)) is not None


# --- The largest modes of M z = μ K z, K factored

LOOSE = 1e-3  # relative accuracy up to which the largest μ beside others is found at first
SAME = 1e-10  # relative: a μ that is larger by more was missed


def largest_modes(
    factor: linalg.SuperLU, K: sparse.csr_array, mass: Product, count: int
) -> tuple[Floats, Floats]:
    """The ``count`` largest μ of M z = μ K z, descending, and z (n, count) with zᵀKz = I.

    ``factor`` is that of K, ``mass`` the product with M, semidefinite. A Krylov space holds one
    vector of equal μ; round-off brings the others, or does not. So the largest μ beside those found
    is looked for until it is no larger than the last of them. Raises AccuracyError without
    convergence, ArpackError where so few unknowns have mass that there is no such space.
    """
    # Lanczos vectors before a restart: few modes converge in fewer than ARPACK's own 20
    krylov = min(max(20, 2 * count + 1), 10 + 2 * count)
    mu, z = _lanczos(factor, K, mass, count, krylov)
    for _ in range(count):
        try:
            more, v = largest_beside(factor, K, mass, z, LOOSE)
            if more > mu[-1] * (1.0 - 2.0 * LOOSE):
                more, v = largest_beside(factor, K, mass, z, 0.0)
        except linalg.ArpackError:  # nothing beside them has mass
            break
        if more <= mu[-1] * (1.0 + SAME):
            break
        mu, z = np.append(mu, more), np.column_stack([z, v])
        order = np.argsort(-mu)[:count]
        mu, z = mu[order], z[:, order]
    return mu, z


def largest_beside(
    factor: linalg.SuperLU, K: sparse.csr_array, mass: Product, W: Floats, tolerance: float
) -> tuple[float, Floats]:
    """The largest μ = wᵀMw / wᵀKw over all w with WᵀK w = 0, within a tolerance, and that w.

    By deflation: M' = Pᵀ M P with P = I − W (WᵀKW)⁻¹ WᵀK has μ = 0 on the span of W. It starts
    from another vector than what found W, which had nothing of the modes that this missed.
    """
    KW = np.asarray(K @ W)
    kept = np.linalg.solve(W.T @ KW, KW.T) if W.shape[1] else np.zeros((0, len(W)))

    def deflated(v: Floats) -> Floats:
        heavy = mass(v - W @ (kept @ v))
        return np.asarray(heavy - kept.T @ (W.T @ heavy))

    # of 6, 8, 10 and 20 Lanczos vectors 8 were the fastest for pencils of 500 to 3 000 unknowns
    mu, w = _lanczos(factor, K, deflated, 1, krylov=8, tolerance=tolerance, seed=1)
    return float(mu[0]), w[:, 0]


def _lanczos(
    factor: linalg.SuperLU,
    K: sparse.csr_array,
    mass: Product,
    count: int,
    krylov: int,
    tolerance: float = 0.0,
    seed: int = 0,
) -> tuple[Floats, Floats]:
    n = K.shape[0]
    M = linalg.LinearOperator((n, n), matvec=mass, dtype=np.float64)
    inverse = linalg.LinearOperator((n, n), matvec=factor.solve, dtype=np.float64)
    start = np.random.default_rng(seed).standard_normal(n)
    how: Any = {"which": "LA", "v0": start, "ncv": krylov, "tol": tolerance}
    try:
        mu, z = linalg.eigsh(M, count, M=K, Minv=inverse, **how)
    except linalg.ArpackNoConvergence as error:
        raise AccuracyError(f"the modes of a large matrix did not converge: {error}") from error
    order = np.argsort(-mu)
    return np.asarray(mu[order]), np.asarray(z[:, order])


EXACT = 1e-10  # part of a rigid motion, relative, that may be lost to round-off
NEW = 1e-4  # part of a vector of another design, relative, that is worth a dof of its own


def reduced_where_asked(
    case: CaseFile, parameters: ModelParameters, name: str, mesh: LinkMesh
) -> LinkMesh:
    """A link's mesh, its interior replaced by what moves below the frequency it asks for.

    The mesh as it is where none is asked for (a ``reduce_to: auto`` that nobody settled), where it
    is reduced already, or where that would not make it smaller. Raises MechanismError where the
    stiffness is singular with the interface held.
    """
    frequency_hz = getattr(case.mechanism.links[name], "reduce_to", None)
    if not isinstance(frequency_hz, float) or mesh.reduction is not None:
        return mesh
    path = f"mechanism.links.{name}"
    nodes = {key: mesh.nodes[key] for key in mesh.nodes if key in interface(case, name)}
    b = np.concatenate([slots[slots >= 0] for slots in nodes.values()])
    i = np.setdiff1d(np.arange(mesh.n_local), b)
    if not len(i):
        return mesh
    designs, softest = _matrices(case, parameters, mesh, i)
    lam = softest * (2.0 * np.pi * frequency_hz) ** 2
    parts = [_DesignBlocks(K, M, b, i, path) for K, M in designs]
    central = coefficients(parameters, mesh.rigid, _designs(case)[:1])[:, 0]
    N, Psi = total(mesh.rigid, central).toarray(), parts[0].Psi
    Psi = Psi + (N[i] - Psi @ N[b]) @ np.linalg.pinv(N[b])  # Ψ N_b = N_i to the last digit
    heavy = np.zeros((len(i), 0))
    if is_imported(case, name) and isinstance(case.mechanism.gravity, tuple):
        axes = len(case.mechanism.gravity)
        heavy = np.asarray(mesh.mass[0].matrix[i] @ total(mesh.rigid, central)[:, :axes].toarray())
    W = _span(parts, Psi, mesh.rigid, heavy, b, i, lam)
    if W.shape[1] >= len(i):
        return mesh
    T = np.zeros((mesh.n_local, len(b) + W.shape[1]))
    T[b, np.arange(len(b))] = 1.0
    T[i, : len(b)], T[i, len(b) :] = Psi, W
    return _projected(mesh, nodes, Reduction(mesh, T, i), b, parts[0].K_ii)


def interface(case: CaseFile, name: str) -> set[str]:
    """Nodes of a link that stay: of a frame those that something is attached to, or that static
    targets and responses are about; of others all.
    """
    mechanism: Any = case.mechanism
    if link_type(case, name) != "frame":
        return {"start", "end", *(getattr(mechanism.links[name], "nodes", None) or ())}
    used = [f"{name}.start"]  # a tip is followed rigidly
    used += [end for joint in mechanism.joints.values() for end in (joint.base, joint.follower)]
    used += [body.at for body in mechanism.bodies.values()]
    used += [end for spring in mechanism.springs.values() for end in spring.between]
    used += [target.place.at for target in case.targets if isinstance(target, StaticTarget)]
    used += [place.at for response in case.responses for place in response.places]
    pairs = [str(end).partition(".") for end in used]
    return {node for link, _, node in pairs if link == name}


class _DesignBlocks:
    """The blocks of K and M of one design, and the factor of K_ii."""

    def __init__(
        self, K: sparse.csr_array, M: sparse.csr_array, b: Ints, i: Ints, path: str
    ) -> None:
        self.K_ii = sparse.csc_array(K[i][:, i])
        self.K_ib = np.asarray(K[i][:, b].todense())
        self.M_ii = sparse.csc_array(M[i][:, i])
        self.factor = held_factor(self.K_ii, path)
        self.Psi = np.asarray(-self.factor.solve(self.K_ib))


def held_factor(K_ii: sparse.csc_array, path: str) -> linalg.SuperLU:
    """The factor of K_ii; raises MechanismError where the part is limp with its interface held."""
    factor = kept_factor(K_ii)
    if factor is None:
        raise MechanismError(
            path,
            "is loose inside: its stiffness is not positive definite with its interface nodes "
            "held. Fix what is not attached in the part, or add interface nodes",
        )
    return factor


def _matrices(
    case: CaseFile, parameters: ModelParameters, mesh: LinkMesh, i: Ints
) -> tuple[list[tuple[sparse.csr_array, sparse.csr_array]], float]:
    """K and M in the middle of the bounds, then at both ends where their interiors differ there.

    Interiors in proportion have the same Ψ and Φ. With them the largest λ of the middle over that
    of the same mode at such an end, or 1: all that is below a frequency there is below it times so.
    """
    terms = [*mesh.stiffness, *mesh.mass]
    values, n = coefficients(parameters, terms, _designs(case)), len(mesh.stiffness)
    inner = [np.flatnonzero([np.diff(t.matrix[i].indptr).any() for t in mesh.stiffness])]
    inner.append(n + np.flatnonzero([np.diff(t.matrix[i].indptr).any() for t in mesh.mass]))
    different, softest = [0], 1.0
    for k in (1, 2):
        stiff, heavy = (_proportion(values[own, k], values[own, 0]) for own in inner)
        if stiff is None or heavy is None:
            different.append(k)
        else:
            softest = max(softest, heavy / stiff)
    return [
        (total(mesh.stiffness, values[:n, k]), total(mesh.mass, values[n:, k])) for k in different
    ], softest


def _proportion(a: Floats, b: Floats) -> float | None:
    """The factor c of a = c b > 0; 1 of nothing, None where there is no such factor."""
    if not len(a) or np.array_equal(a, b):
        return 1.0
    c = float(a @ b) / float(b @ b) if b.any() else 0.0
    # entries may differ by round-off
    return c if c > 0.0 and (np.abs(a - c * b) <= 1e-12 * np.abs(a)).all() else None


def _designs(case: CaseFile) -> Floats:
    """The middle, the lower and the upper bounds of loads and design, (3, n_p)."""
    low, high = np.array(case.box, dtype=np.float64).reshape(-1, 2).T
    return np.array([0.5 * (low + high), low, high])


def coefficients(parameters: ModelParameters, terms: Sequence[Term], p: Floats) -> Floats:
    """The coefficients of a link's terms at properties p (n, n_p), (n_terms, n), in any pose."""
    table = parameters.compiled(np.array([t.coefficient for t in terms], dtype=object))
    return table(parameters.z(np.hstack([np.zeros((len(p), len(parameters.coordinates))), p])))[0].T


def _span(
    parts: Sequence[_DesignBlocks],
    Psi: Floats,
    rigid: Sequence[Term],
    heavy: Floats,
    b: Ints,
    i: Ints,
    lam: float,
) -> Floats:
    """W (n_i, k), K_ii-orthonormal: rigid remainders, sags under forces ``heavy`` (n_i, n), modes
    with the interface held, other designs.
    """
    first = parts[0]
    K = first.K_ii
    W = np.zeros((len(i), 0))
    for term in rigid:
        N = term.matrix.toarray()
        W = _extended(W, K, N[i] - Psi @ N[b], _norms(K, N[i]), EXACT)
    sags = np.asarray(first.factor.solve(heavy)) if heavy.size else heavy
    W = _extended(W, K, sags, _norms(K, sags), EXACT)
    Phi = fixed_modes(K, first.M_ii, first.factor, lam)
    W = _extended(W, K, Phi, np.ones(Phi.shape[1]), EXACT)
    for part in parts[1:]:
        W = _extended(W, K, part.Psi - Psi, _norms(K, Psi), NEW)
        Phi = fixed_modes(part.K_ii, part.M_ii, part.factor, lam)
        W = _extended(W, K, Phi, _norms(K, Phi), NEW)
    return W


def _norms(K: sparse.csc_array, vectors: Floats) -> Floats:
    squares = (vectors * np.asarray(K @ vectors)).sum(axis=0)
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)))


def _extended(
    W: Floats, K: sparse.csc_array, vectors: Floats, size: Floats, least: float
) -> Floats:
    """W with the K-orthonormal directions that ``vectors`` add to it, relative to ``size``."""
    new = vectors[:, size > 0.0] / size[size > 0.0]
    for _ in range(2):
        new = new - W @ (W.T @ np.asarray(K @ new))
    values, turns = np.linalg.eigh(new.T @ np.asarray(K @ new))
    # 1e-14 is the round-off of squares of lengths
    keep = values > max(least**2, 1e-14 * values.max(initial=0.0))
    return np.hstack([W, new @ (turns[:, keep] / np.sqrt(values[keep]))])


def _projected(
    mesh: LinkMesh, kept: dict[str, Ints], reduction: Reduction, b: Ints, K_ii: sparse.csc_array
) -> LinkMesh:
    """Interface dofs first, node by node; then the coordinates of W."""
    T, i = reduction.basis, reduction.interior
    place = np.full(mesh.n_local, -1, dtype=np.intp)
    place[b] = np.arange(len(b))
    nodes = {key: np.where(slots >= 0, place[slots], -1) for key, slots in kept.items()}
    W = T[i, len(b) :]
    KW = np.asarray(K_ii @ W)

    def coordinates(term: Term) -> Term:
        N = term.matrix.toarray()
        eta = np.linalg.solve(W.T @ KW, KW.T @ (N[i] - T[i, : len(b)] @ N[b]))
        eta[np.abs(eta) <= EXACT * _norms(K_ii, N[i])] = 0.0
        return Term(term.coefficient, sparse.csr_array(np.vstack([N[b], eta])))

    return LinkMesh(
        T.shape[1],
        nodes,
        {key: mesh.positions[key] for key in kept},
        [Term(t.coefficient, project(t.matrix, T)) for t in mesh.stiffness],
        [Term(t.coefficient, project(t.matrix, T)) for t in mesh.mass],
        [coordinates(t) for t in mesh.rigid],
        reduction=reduction,
    )


def project(A: sparse.csr_array, T: Floats) -> sparse.csr_array:
    """Tᵀ A T, symmetric, without zeros that are only round-off."""
    out = T.T @ np.asarray(A @ T)
    out = 0.5 * (out + out.T)
    scale = np.sqrt(np.abs(np.diag(out)))
    # entries of 1e-15 beside their diagonal are zeros
    out[np.abs(out) < 1e-15 * np.outer(scale, scale)] = 0.0
    return sparse.csr_array(out)


# --- fixed-interface modes: K_ii φ = λ M_ii φ, solved as M_ii φ = μ K_ii φ

DENSE = 400  # interior dofs up to which all eigenvalues are computed


@lru_cache(maxsize=4)  # what is reduced to higher and higher frequencies asks for the same ones
def _lowest(stiff: _Matrix, heavy: _Matrix, count: int) -> tuple[Floats, Floats]:
    factor, rows = _kept(stiff), heavy.matrix.T  # symmetric: products run faster row by row
    assert factor is not None
    return largest_modes(factor, stiff.matrix.T, lambda v: np.asarray(rows @ v), count)


def fixed_modes(
    K: sparse.csc_array, M: sparse.csc_array, factor: linalg.SuperLU, lam: float
) -> Floats:
    """The modes (n, k) with λ ≤ ``lam``, φᵀ K φ = I; ``factor`` is that of K."""
    n, least = K.shape[0], 1.0 / lam
    h = np.flatnonzero(abs(M).sum(axis=0))  # with mass: few make no Krylov space for Lanczos
    if len(h) <= DENSE < n:
        flexible = np.zeros((n, len(h)))
        flexible[h, np.arange(len(h))] = 1.0
        flexible = factor.solve(flexible) if len(h) else flexible  # the columns h of K⁻¹
        root = np.linalg.cholesky(flexible[h])
        mu, b = np.linalg.eigh(root.T @ M[h][:, h].toarray() @ root)
        return np.asarray(flexible @ np.linalg.solve(root.T, b[:, mu >= least][:, ::-1]))
    # Lanczos is asked for 16 modes first, then for twice as many
    stiff, heavy, count = _digested(K), _digested(M), 16
    while n > DENSE and count < n // 2:
        mu, phi = _lowest(stiff, heavy, count)
        if mu[-1] < least:
            return np.asarray(phi[:, mu >= least])
        count *= 2
    mu, phi = eigh(M.toarray(), K.toarray())
    return np.asarray(phi[:, ::-1][:, mu[::-1] >= least])
