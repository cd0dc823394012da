"""Craig-Bampton reduction of a link: few fixed-interface modes instead of its interior dofs.

Craig and Bampton (AIAA J. 6 (1968) 1313): with the interface b and the interior i of a link,

    u_i = Ψ u_b + W η,   Ψ = −K_ii⁻¹ K_ib,   W ⊇ Φ,   K_ii Φ = M_ii Φ Λ,  λ ≤ (2π f)² .

Links stay affine in y: the basis is constant, taken in the middle of the design's bounds, and every
constant matrix of the link is projected on it. Where the link itself changes with y, W also holds
what Ψ and Φ become at both ends of the bounds, and the part of N(y) that Ψ does not carry, so that
rigid-body motion is in the span at every y. Under gravity that of an imported part holds its sag as
well, K_ii⁻¹ (M r)_i of translations r: the weight's stiffness, which joins M r to the nodes
(`assembly.loads.stress`), is nothing then on what is left out. What that changes is measured
against the whole links (`modal.finer_meshes`).

The modes are solved in the inverse form M_ii φ = μ K_ii φ, μ = 1/λ, in which massless dofs (μ = 0,
as of rotations without inertia) do no harm.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import eigh
from scipy.sparse import linalg

from eigassign.case.case_file import CaseFile
from eigassign.case.schema.targets import StaticTarget
from eigassign.errors import MechanismError
from eigassign.mechanism.elements.mesh import LinkMesh, Reduction, Term, total
from eigassign.mechanism.elements.sparse_factor import (
    kept_factor,
    largest_modes,
)
from eigassign.mechanism.kinematics.parameters import ModelParameters, is_imported, link_type

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
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
    """Nodes of a link that stay: of a beam both ends, of others those that something uses."""
    mechanism: Any = case.mechanism
    if link_type(case, name) != "frame":
        return {"start", "end", *(getattr(mechanism.links[name], "nodes", None) or ())}
    return used_nodes(case, name)


def used_nodes(case: CaseFile, name: str) -> set[str]:
    """Nodes of a link that something else is attached to, or that a static target is about."""
    mechanism: Any = case.mechanism
    used = [f"{name}.start"]  # a tip is followed rigidly
    used += [end for joint in mechanism.joints.values() for end in (joint.base, joint.follower)]
    used += [body.at for body in mechanism.bodies.values()]
    used += [end for spring in mechanism.springs.values() for end in spring.between]
    used += [target.place.at for target in case.targets if isinstance(target, StaticTarget)]
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


class _Heavy(NamedTuple):
    """The few dofs h that have mass: a Krylov space would be too small for Lanczos."""

    dofs: Ints
    mass: Floats  # M_hh
    flexible: Floats  # the columns h of K⁻¹, (n, n_h)


def _few_with_mass(M: sparse.csc_array, factor: linalg.SuperLU) -> _Heavy | None:
    """The dofs with mass where these are few among many, else None; ``factor`` is that of K."""
    dofs = np.flatnonzero(abs(M).sum(axis=0))
    if not len(dofs) <= DENSE < M.shape[0]:
        return None
    unit = np.zeros((M.shape[0], len(dofs)))
    unit[dofs, np.arange(len(dofs))] = 1.0
    flexible = factor.solve(unit) if len(dofs) else unit
    return _Heavy(dofs, M[dofs][:, dofs].toarray(), flexible)


def fixed_modes(
    K: sparse.csc_array, M: sparse.csc_array, factor: linalg.SuperLU, lam: float
) -> Floats:
    """The modes (n, k) with λ ≤ ``lam``, φᵀ K φ = I; ``factor`` is that of K."""
    n, least = K.shape[0], 1.0 / lam
    if (heavy := _few_with_mass(M, factor)) is not None:
        root = np.linalg.cholesky(heavy.flexible[heavy.dofs])
        mu, b = np.linalg.eigh(root.T @ heavy.mass @ root)
        return np.asarray(heavy.flexible @ np.linalg.solve(root.T, b[:, mu >= least][:, ::-1]))
    # Lanczos is asked for 16 modes first, then for twice as many
    rows, count = M.T, 16  # M is symmetric: products run faster row by row
    while n > DENSE and count < n // 2:
        mu, phi = largest_modes(factor, K.T, lambda v: np.asarray(rows @ v), count)
        if mu[-1] < least:
            return np.asarray(phi[:, mu >= least])
        count *= 2
    mu, phi = eigh(M.toarray(), K.toarray())
    return np.asarray(phi[:, ::-1][:, mu[::-1] >= least])
