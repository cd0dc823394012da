"""A link from another finite-element program: K, M and its interface nodes.

The rigid motion of the interior follows from the interface, N_i = −K_ii⁻¹ K_ib N_b, for K N = 0.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.case import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.bodies import add_bodies
from eigassign.mechanism.craig_bampton import held_factor
from eigassign.mechanism.geometry import link_type
from eigassign.mechanism.matrix_files import read_pair
from eigassign.mechanism.mesh import DOFS, Entries, LinkMesh, Term, rigid_motion
from eigassign.mechanism.parameters import Parameters
from eigassign.mechanism.rotations import vector

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
STRAIN_FREE = 1e-6  # largest |K N|_i relative to √K_ii ‖√K_jj N_j‖ that passes for none
ALIKE = 1e-3  # relative difference of a part's mass by direction that passes for round-off


def superelement_mesh(case: CaseFile, parameters: Parameters, name: str) -> LinkMesh:
    """The mesh of a superelement; raises MechanismError for matrices that cannot be one."""
    link: Any = case.mechanism.links[name]
    path = f"mechanism.links.{name}"
    folder = Path(getattr(case, "path", ".")).parent
    K, M = read_pair(folder / link.stiffness, folder / link.mass, path)
    boundary = _boundary(link, K.shape[0], path)
    K, M = _interface_first(K, M, boundary)
    return _mesh(case, parameters, name, K, M, len(boundary), path)


def weights(case: CaseFile) -> tuple[str, ...]:
    """Mass and centre of mass of every superelement, in words: wrong units show here."""
    from eigassign.mechanism.parameters import parameters

    return tuple(
        _weight(name, superelement_mesh(case, parameters(case), name), case.mechanism.space)
        for name in case.mechanism.links
        if link_type(case, name) == "superelement"
    )


def _weight(name: str, mesh: LinkMesh, space: str) -> str:
    """From NᵀMN = [[m 1, −m[c]×], …]: the mass, and where its centre c is."""
    N = np.sum([t.matrix.toarray() for t in mesh.rigid], axis=0)
    J = N.T @ (mesh.mass[0].matrix @ N)
    m = J[0, 0]
    places = (J[1, 2], -J[0, 2]) if space == "planar" else (J[1, 5], J[2, 3], J[0, 4])
    centre = ", ".join(f"{c / m + 0.0:.4g}" for c in places) if m > 0.0 else "nowhere"
    return f"superelement {name}: {mesh.n_local} dofs, {m:.4g} kg, centre of mass at ({centre}) m"


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
    rigid = [Term(t.coefficient, _follow(K, t.matrix, n_b, path)) for t in at_interface]
    _check_rigid(K, rigid, path)
    _check_mass(M, rigid, space, path)
    mass = Entries((n, n))
    add_bodies(case, parameters, name, mass, nodes)
    return LinkMesh(n, nodes, places, [Term(1.0, K)], [Term(1.0, M), *mass.terms()], rigid)


def _follow(K: sparse.csr_array, N: sparse.csr_array, n_b: int, path: str) -> sparse.csr_array:
    """Rigid motion of the interior from that of the interface: N_i = −K_ii⁻¹ K_ib N_b."""
    if n_b == K.shape[0]:
        return N
    dense = np.asarray(N.todense())
    right = -(K[n_b:][:, :n_b] @ dense[:n_b])
    dense[n_b:] = held_factor(K[n_b:][:, n_b:].tocsc(), path).solve(np.asarray(right))
    dense[np.abs(dense) < 1e-12 * max(1.0, np.abs(dense).max())] = 0.0
    return sparse.csr_array(dense)


def _check_rigid(K: sparse.csr_array, rigid: list[Term], path: str) -> None:
    N = np.sum([t.matrix.toarray() for t in rigid], axis=0)  # the nodes are numbers, not variables
    size = np.sqrt(np.maximum(K.diagonal(), 0.0))  # |K_ij| ≤ √(K_ii K_jj), in any units
    most = size[:, None] * np.linalg.norm(size[:, None] * N, axis=0)
    if (np.abs(np.asarray(K @ N)) > STRAIN_FREE * most).any():
        raise MechanismError(
            f"{path}.stiffness",
            "strains under rigid motion: the node positions or dof numbers do not fit the "
            "matrix, or the part is supported (its own supports must be released)",
        )


def _interface_first(
    K: sparse.csr_array, M: sparse.csr_array, boundary: Ints
) -> tuple[sparse.csr_array, sparse.csr_array]:
    interior = np.setdiff1d(np.arange(K.shape[0]), boundary)
    order = np.concatenate([boundary, interior])
    return K[order][:, order].tocsr(), M[order][:, order].tocsr()


def _check_mass(M: sparse.csr_array, rigid: list[Term], space: str, path: str) -> None:
    """A rigid translation moves the same mass in every direction."""
    N = np.sum([t.matrix.toarray() for t in rigid], axis=0)
    moving = DOFS[space].index(5) if space == "planar" else 3
    masses = np.einsum("ij,ij->j", N[:, :moving], np.asarray(M @ N[:, :moving]))
    if np.ptp(masses) > ALIKE * masses.max():
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
