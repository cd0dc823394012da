"""A link from another finite-element program: K, M and its interface nodes.

The matrices are read from files and refused where they cannot be those of a part. The rigid motion
of the interior follows from the interface, N_i = −K_ii⁻¹ K_ib N_b, so that K N = 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.case.case_file import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.elements.bodies import add_bodies
from eigassign.mechanism.elements.craig_bampton import held_factor
from eigassign.mechanism.elements.matrix_file import read_matrix
from eigassign.mechanism.elements.mesh import Entries, LinkMesh, Term, chain_dofs, rigid_motion
from eigassign.mechanism.elements.sparse_factor import is_semidefinite
from eigassign.mechanism.kinematics.parameters import ModelParameters, link_type, parameters
from eigassign.mechanism.kinematics.rotations import vector

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
STRAIN_FREE = 1e-6  # largest |K N|_i relative to √K_ii ‖√K_jj N_j‖ that passes for none


def superelement_mesh(case: CaseFile, parameters: ModelParameters, name: str) -> LinkMesh:
    """The mesh of a superelement: interface dofs first, node by node; then interior or modal ones.

    Raises MechanismError for matrices that cannot be those of a part.
    """
    link: Any = case.mechanism.links[name]
    path = f"mechanism.links.{name}"
    K, M = read_pair(Path(link.stiffness), Path(link.mass), path)
    boundary = _boundary(link, K.shape[0], path)
    order = np.concatenate([boundary, np.setdiff1d(np.arange(K.shape[0]), boundary)])
    K, M = K[order][:, order].tocsr(), M[order][:, order].tocsr()
    space, n = case.mechanism.space, K.shape[0]
    slots = chain_dofs(len(link.nodes), space)
    nodes = dict(zip(link.nodes, slots, strict=True))
    places = {key: vector([float(c) for c in node.position]) for key, node in link.nodes.items()}
    at_interface = rigid_motion(list(places.values()), slots, n, space)
    rigid = [Term(t.coefficient, _follow(K, t.matrix, len(boundary), path)) for t in at_interface]
    N = _whole(rigid)
    _check_rigid(K, N, path)
    _check_mass(M, N[:, : 2 if space == "planar" else 3], path)
    mass = Entries((n, n))
    add_bodies(case, parameters, name, mass, nodes)
    return LinkMesh(n, nodes, places, [Term(1.0, K)], [Term(1.0, M), *mass.terms()], rigid)


def weights(case: CaseFile) -> tuple[str, ...]:
    """Mass and centre of mass of every superelement, in words: wrong units show here."""
    return tuple(
        _weight(name, superelement_mesh(case, parameters(case), name), case.mechanism.space)
        for name in case.mechanism.links
        if link_type(case, name) == "superelement"
    )


def _weight(name: str, mesh: LinkMesh, space: str) -> str:
    """Mass, and place of its centre c, from NᵀMN = [[m 1, −m[c]×], …]."""
    N = _whole(mesh.rigid)
    J = N.T @ (mesh.mass[0].matrix @ N)
    m = J[0, 0]
    places = (J[1, 2], -J[0, 2]) if space == "planar" else (J[1, 5], J[2, 3], J[0, 4])
    centre = ", ".join(f"{c / m + 0.0:.4g}" for c in places) if m > 0.0 else "nowhere"
    return f"superelement {name}: {mesh.n_local} dofs, {m:.4g} kg, centre of mass at ({centre}) m"


def _follow(K: sparse.csr_array, N: sparse.csr_array, n_b: int, path: str) -> sparse.csr_array:
    """Rigid motion of the interior from that of the interface: N_i = −K_ii⁻¹ K_ib N_b."""
    if n_b == K.shape[0]:
        return N
    dense = np.asarray(N.todense())
    right = -(K[n_b:][:, :n_b] @ dense[:n_b])
    dense[n_b:] = held_factor(K[n_b:][:, n_b:].tocsc(), path).solve(np.asarray(right))
    dense[np.abs(dense) < 1e-12 * max(1.0, np.abs(dense).max())] = 0.0
    return sparse.csr_array(dense)


def _whole(rigid: Sequence[Term]) -> Floats:
    """N (n, n_twist): the nodes are numbers, not variables."""
    return np.asarray(np.sum([t.matrix.toarray() for t in rigid], axis=0))


def _check_rigid(K: sparse.csr_array, N: Floats, path: str) -> None:
    size = np.sqrt(np.maximum(K.diagonal(), 0.0))  # |K_ij| ≤ √(K_ii K_jj), in any units
    most = size[:, None] * np.linalg.norm(size[:, None] * N, axis=0)
    if (np.abs(np.asarray(K @ N)) > STRAIN_FREE * most).any():
        raise MechanismError(
            f"{path}.stiffness",
            "strains under rigid motion: the node positions or dof numbers do not fit the "
            "matrix, or the part is supported (its own supports must be released)",
        )


def _check_mass(M: sparse.csr_array, N: Floats, path: str) -> None:
    """A rigid translation, N (n, 2 or 3), moves the same mass in every direction."""
    masses = np.einsum("ij,ij->j", N, np.asarray(M @ N))
    # a part's mass may differ by direction by 1e-3: files have few digits
    if np.ptp(masses) > 1e-3 * masses.max():
        shown = ", ".join(f"{m:.4g}" for m in masses)
        raise MechanismError(
            f"{path}.mass",
            f"gives the whole part another mass in each direction ({shown} kg): are its rows in "
            "the order of the stiffness, in the same units?",
        )


def _boundary(link: Any, n: int, path: str) -> Ints:
    dofs = [int(d) for node in link.nodes.values() for d in node.dofs]
    if len(set(dofs)) != len(dofs) or min(dofs) < 0 or max(dofs) >= n:
        message = f"dof numbers must be different and within 0 to {n - 1}"
        raise MechanismError(f"{path}.nodes", message)
    return np.array(dofs, dtype=np.intp)


# --- K and M: what they must be

ROUNDED = 1e-6  # of the diagonal: files of six digits make eigenvalues that small negative


def read_pair(stiffness: Path, mass: Path, path: str) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Symmetric positive semidefinite K and M of one size; raises MechanismError naming the key."""
    K = _checked(read_matrix(stiffness, f"{path}.stiffness"), f"{path}.stiffness", stiffness.name)
    M = _checked(read_matrix(mass, f"{path}.mass"), f"{path}.mass", mass.name)
    if K.shape != M.shape:
        raise MechanismError(f"{path}.mass", f"is {M.shape}, the stiffness is {K.shape}")
    return K, M


def _checked(A: sparse.csr_array, key: str, name: str) -> sparse.csr_array:
    lost = abs(A - A.T).max() if A.nnz else 0.0
    # an asymmetry of 1e-8 is taken for round-off
    if lost > 1e-8 * abs(A).max():
        only = sparse.tril(A, -1).nnz == 0 or sparse.triu(A, 1).nnz == 0
        hint = (
            f"{name} holds one triangle only: say 'symmetric' in its header, or write both"
            if only
            else f"entries differ by {lost:.3g}"
        )
        raise MechanismError(key, f"is not symmetric: {hint}")
    A = sparse.csr_array(0.5 * (A + A.T))
    if not is_semidefinite(A, ROUNDED):
        raise MechanismError(
            key, "is not positive semidefinite: some motion would have negative energy"
        )
    return A
