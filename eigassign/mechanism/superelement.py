"""A link from another finite-element program: K, M and its interface nodes, reduced if asked for.

Craig-Bampton (AIAA J. 6 (1968) 1313): u_i = Ψ u_b + Φ η with the constraint modes
Ψ = −K_ii⁻¹ K_ib and the fixed-interface modes Φ below a stated frequency. The rigid motion of the
interior follows from the interface, N_i = Ψ N_b, because K N = 0.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.case import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.links import add_bodies
from eigassign.mechanism.mesh import DOFS, Entries, LinkMesh, Term, rigid_motion
from eigassign.mechanism.parameters import Parameters
from eigassign.mechanism.rotations import vector

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
SYMMETRY = 1e-8  # relative asymmetry of K or M that is taken for round-off
STRAIN_FREE = 1e-6  # largest |K N| relative to |K| |N| that passes for a rigid motion


def superelement_mesh(case: CaseFile, parameters: Parameters, name: str) -> LinkMesh:
    """The mesh of a superelement; raises MechanismError for matrices that cannot be one."""
    link: Any = case.mechanism.links[name]
    path = f"mechanism.links.{name}"
    folder = Path(getattr(case, "path", ".")).parent
    K = _symmetric(read_matrix(folder / link.stiffness, f"{path}.stiffness"), f"{path}.stiffness")
    M = _symmetric(read_matrix(folder / link.mass, f"{path}.mass"), f"{path}.mass")
    if K.shape != M.shape:
        raise MechanismError(f"{path}.mass", f"is {M.shape}, the stiffness is {K.shape}")
    boundary = _boundary(link, K.shape[0], path)
    K, M, n_b = craig_bampton(K, M, boundary, getattr(link, "reduce_to", None), path)
    return _mesh(case, parameters, name, K, M, n_b, path)


def _mesh(
    case: CaseFile,
    parameters: Parameters,
    name: str,
    K: sparse.csr_array,
    M: sparse.csr_array,
    n_b: int,
    path: str,
) -> LinkMesh:
    """Interface dofs first, node by node; then the interior or modal ones."""
    space, n = case.mechanism.space, K.shape[0]
    link: Any = case.mechanism.links[name]
    width, kept = len(DOFS[space]), list(DOFS[space])
    nodes, places = {}, {}
    for k, (key, node) in enumerate(link.nodes.items()):
        slots = np.full(6, -1, dtype=np.intp)
        slots[kept] = width * k + np.arange(width)
        nodes[key], places[key] = slots, vector([float(c) for c in node.position])
    at_interface = rigid_motion(list(places.values()), list(nodes.values()), n, space)
    rigid = [Term(t.coefficient, _follow(K, t.matrix, n_b)) for t in at_interface]
    _check_rigid(K, rigid, path)
    mass = Entries((n, n))
    add_bodies(case, parameters, name, mass, nodes)
    return LinkMesh(n, nodes, places, [Term(1.0, K)], [Term(1.0, M), *mass.terms()], rigid)


def _follow(K: sparse.csr_array, N: sparse.csr_array, n_b: int) -> sparse.csr_array:
    """Rigid motion of the interior from that of the interface: N_i = −K_ii⁻¹ K_ib N_b."""
    if n_b == K.shape[0]:
        return N
    from scipy.sparse.linalg import splu

    dense = np.asarray(N.todense())
    right = -(K[n_b:][:, :n_b] @ dense[:n_b])
    dense[n_b:] = splu(K[n_b:][:, n_b:].tocsc()).solve(np.asarray(right))
    dense[np.abs(dense) < 1e-12 * max(1.0, np.abs(dense).max())] = 0.0
    return sparse.csr_array(dense)


def _check_rigid(K: sparse.csr_array, rigid: list[Term], path: str) -> None:
    N = np.sum([t.matrix.toarray() for t in rigid], axis=0)  # the nodes are numbers, not variables
    strained = float(np.abs(np.asarray(K @ N)).max())
    if strained > STRAIN_FREE * float(abs(K).max()) * float(np.abs(N).max()):
        raise MechanismError(
            f"{path}.stiffness",
            "strains under rigid motion: the node positions or dof numbers do not fit the "
            "matrix, or the part is supported (its own supports must be released)",
        )


def craig_bampton(
    K: sparse.csr_array,
    M: sparse.csr_array,
    boundary: Ints,
    frequency_hz: float | None,
    path: str,
) -> tuple[sparse.csr_array, sparse.csr_array, int]:
    """K, M with the interface first; with a frequency, fixed-interface modes up to it only."""
    interior = np.setdiff1d(np.arange(K.shape[0]), boundary)
    order, n_b = np.concatenate([boundary, interior]), len(boundary)
    K, M = K[order][:, order].tocsr(), M[order][:, order].tocsr()
    if frequency_hz is None or not len(interior):
        return K, M, n_b
    T = _transformation(K, M, n_b, frequency_hz, path)
    dense = [np.asarray(T.T @ (A @ T)) for A in (K, M)]
    return sparse.csr_array(_cleaned(dense[0])), sparse.csr_array(_cleaned(dense[1])), n_b


def _cleaned(A: Floats) -> Floats:
    """Symmetric, round-off zeros removed."""
    A = 0.5 * (A + A.T)
    scale = np.sqrt(np.abs(np.diag(A)))
    A[np.abs(A) < 1e-13 * np.outer(scale, scale)] = 0.0
    return A


def _transformation(
    K: sparse.csr_array, M: sparse.csr_array, n_b: int, frequency_hz: float, path: str
) -> Floats:
    """[[I, 0], [Ψ, Φ]]."""
    from scipy.sparse.linalg import splu

    K_ii, M_ii = K[n_b:][:, n_b:].tocsc(), M[n_b:][:, n_b:].tocsc()
    try:
        factor = splu(K_ii)
    except RuntimeError as error:
        raise MechanismError(f"{path}.stiffness", "is singular with the interface held") from error
    Psi = -factor.solve(np.asarray(K[n_b:][:, :n_b].todense()))
    Phi = _fixed_modes(K_ii, M_ii, (2.0 * np.pi * frequency_hz) ** 2)
    top = np.hstack([np.eye(n_b), np.zeros((n_b, Phi.shape[1]))])
    return np.vstack([top, np.hstack([Psi, Phi])])


def _fixed_modes(K: sparse.csc_array, M: sparse.csc_array, lam: float) -> Floats:
    """Mass-normalised modes of the fixed interface with eigenvalue up to ``lam``."""
    n = K.shape[0]
    if n <= 1500:
        from scipy.linalg import eigh

        values, vectors = eigh(K.toarray(), M.toarray(), subset_by_value=(-1.0, lam), driver="gvx")
        return np.asarray(vectors)
    from scipy.sparse.linalg import eigsh

    count = 20
    while True:
        start = np.random.default_rng(0).standard_normal(n)
        values, vectors = eigsh(K, min(count, n - 2), M, sigma=0.0, which="LM", v0=start)
        if values.max() > lam or count >= n - 2:
            return np.asarray(vectors[:, values <= lam])
        count *= 2


def _boundary(link: Any, n: int, path: str) -> Ints:
    dofs = [int(d) for node in link.nodes.values() for d in node.dofs]
    if len(set(dofs)) != len(dofs) or min(dofs) < 0 or max(dofs) >= n:
        message = f"dof numbers must be different and within 0 to {n - 1}"
        raise MechanismError(f"{path}.nodes", message)
    return np.array(dofs, dtype=np.intp)


def read_matrix(file: Path, key: str) -> sparse.csr_array:
    """A square matrix from Matrix Market (.mtx) or NumPy (.npy, .npz of scipy.sparse)."""
    try:
        if file.suffix == ".npy":
            matrix = sparse.csr_array(np.load(file, allow_pickle=False))
        elif file.suffix == ".npz":
            matrix = sparse.csr_array(sparse.load_npz(file))
        else:
            from scipy.io import mmread

            matrix = sparse.csr_array(mmread(file))
    except (OSError, ValueError, TypeError) as error:
        raise MechanismError(key, f"cannot read {file.name}: {error}") from error
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        raise MechanismError(key, f"{file.name} is not a square matrix: {matrix.shape}")
    if not np.isfinite(matrix.data).all():
        raise MechanismError(key, f"{file.name} has entries that are not finite")
    return matrix.astype(np.float64)


def _symmetric(A: sparse.csr_array, key: str) -> sparse.csr_array:
    lost = abs(A - A.T).max()
    if lost > SYMMETRY * abs(A).max():
        raise MechanismError(key, f"is not symmetric: entries differ by {lost:.3g}")
    return sparse.csr_array(0.5 * (A + A.T))
