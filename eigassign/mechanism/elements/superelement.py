"""Links from another finite-element program, or from the mesh of a solid part; parts by themselves.

The matrices are read from files and refused where they cannot be those of a part. The rigid motion
of the interior follows from the interface, N_i = −K_ii⁻¹ K_ib N_b, so that K N = 0.

In a plane its nodes keep u_x, u_y and θ_z; u_z, θ_x and θ_y are held.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy import sparse

from eigassign.arrays import Floats
from eigassign.case.case_file import CaseFile
from eigassign.case.reader import listed
from eigassign.errors import MechanismError
from eigassign.mechanism.elements.craig_bampton import coefficients, held_factor, is_semidefinite
from eigassign.mechanism.elements.links import (
    Entries,
    LinkMesh,
    Lost,
    Term,
    add_bodies,
    chain_dofs,
    rigid_motion,
    total,
)
from eigassign.mechanism.elements.solid_stress import stressed
from eigassign.mechanism.imports.parts import UNITS, imported_part, matrix_keys
from eigassign.mechanism.kinematics.joints import DOFS, vector
from eigassign.mechanism.kinematics.parameters import (
    ModelParameters,
    initial_design,
    is_imported,
    link_type,
    parameters,
    written_loads,
)
from eigassign.mechanism.solids.part import solid_part
from eigassign.series.expression import Expression, Scalar

STRAIN_FREE = 1e-6  # largest strain of rigid motion that passes for none
ROUND_OFF = 1e-15  # of strains: what is less is said so
LITTLE = 1e-5  # single precision left 1.2e-6 in a bar of 708 dofs
_SPELT = {1.0: "m", 1e-3: "mm", 0.0254: "inches"}


def superelement_mesh(case: CaseFile, parameters: ModelParameters, name: str) -> LinkMesh:
    """The mesh of a superelement: interface dofs first, node by node; then interior or modal ones.

    Raises MechanismError for matrices that cannot be those of a part.
    """
    link: Any = case.mechanism.links[name]
    path = f"mechanism.links.{name}"
    part = imported_part(case, name)
    keys = matrix_keys(link)
    K, M = (
        _checked(A, f"{path}.{key}", Path(getattr(link, key)).name)
        for A, key in zip((part.K, part.M), keys, strict=True)
    )
    boundary = np.concatenate([*part.rows.values()])
    order = np.concatenate([boundary, np.setdiff1d(np.arange(K.shape[0]), boundary)])
    K, M = K[order][:, order].tocsr(), M[order][:, order].tocsr()
    space, n = case.mechanism.space, K.shape[0]
    slots = chain_dofs(len(link.nodes), space)
    nodes = dict(zip(link.nodes, slots, strict=True))
    places = {key: vector([float(c) for c in place]) for key, place in part.places.items()}

    def rigid_terms(factor: float) -> list[Term]:
        at_interface = rigid_motion([X * factor for X in places.values()], slots, n, space)
        follow = partial(_follow, K, n_b=len(boundary), path=path)
        return [Term(t.coefficient, follow(t.matrix)) for t in at_interface]

    def fits(factor: float) -> bool:
        return rigid_strain(K, whole(rigid_terms(factor))) <= STRAIN_FREE

    rigid = rigid_terms(1.0)
    N = whole(rigid)
    _check_rigid(K, N, f"{path}.{keys[0]}", fits, UNITS[link.units].length)
    _check_mass(M, N[:, : 2 if space == "planar" else 3], f"{path}.{keys[1]}")
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


def whole(rigid: Sequence[Term]) -> Floats:
    """N (n, n_twist): the nodes are numbers, not variables."""
    return np.asarray(np.sum([t.matrix.toarray() for t in rigid], axis=0))


def rigid_strain(K: sparse.csr_array, N: Floats) -> float:
    """The largest |K N|_i relative to √K_ii ‖√K_jj N_j‖: |K_ij| ≤ √(K_ii K_jj), in any units."""
    size = np.sqrt(np.maximum(K.diagonal(), 0.0))
    most = size[:, None] * np.linalg.norm(size[:, None] * N, axis=0)
    strain = np.abs(np.asarray(K @ N))
    if not strain[most > 0.0].size:
        return 0.0
    return float((strain[most > 0.0] / most[most > 0.0]).max())


def _check_rigid(
    K: sparse.csr_array, N: Floats, path: str, fits: Callable[[float], bool], length: float
) -> None:
    """K N = 0, or MechanismError; ``fits``: whether positions times a factor make it so."""
    if (strain := rigid_strain(K, N)) <= STRAIN_FREE:
        return
    message = (
        "strains under rigid motion: the node positions or dof numbers do not fit the "
        "matrix, or the part is supported (its own supports must be released)"
    )
    for other in dict.fromkeys(unit.length for unit in UNITS.values() if unit.length != length):
        if fits(length / other):
            names = " or ".join(name for name, unit in UNITS.items() if unit.length == other)
            message += f"; it does not if lengths in the files are in {_SPELT[other]}: "
            raise MechanismError(path, message + f"write units: {names}")
    if fits(1e-3):
        message += "; it does not with positions a thousandth as large: write 1 mm where that is so"
    if strain < LITTLE:
        message += (
            f"; by {strain:.1g} it may be for few digits alone, as in single precision: export "
            "double"
        )
    raise MechanismError(path, message)


def _check_mass(M: sparse.csr_array, N: Floats, path: str) -> None:
    """A rigid translation, N (n, 2 or 3), moves the same mass in every direction."""
    masses = np.einsum("ij,ij->j", N, np.asarray(M @ N))
    # a part's mass may differ by direction by 1e-3: files have few digits
    if np.ptp(masses) > 1e-3 * masses.max():
        shown = ", ".join(f"{m:.4g}" for m in masses)
        raise MechanismError(
            path,
            f"gives the whole part another mass in each direction ({shown} kg): are its rows in "
            "the order of the stiffness, in the same units?",
        )


# --- K and M: what they must be

ROUNDED = 1e-6  # of the diagonal: files of six digits make eigenvalues that small negative


def _checked(A: sparse.csr_array, key: str, name: str) -> sparse.csr_array:
    lost = abs(A - A.T).tocoo()
    size = np.sqrt(np.maximum(A.diagonal(), 0.0))
    # |A_ij| ≤ √(A_ii A_jj), and of that an asymmetry of 1e-8 is taken for round-off, as is what is
    # lost in sums with the largest entry
    room = 1e-8 * size[lost.row] * size[lost.col] + 1e-12 * abs(A).max()
    if (lost.data > room).any():
        only = sparse.tril(A, -1).nnz == 0 or sparse.triu(A, 1).nnz == 0
        hint = (
            f"{name} holds one triangle only: say 'symmetric' in its header, or write both"
            if only
            else f"entries differ by {lost.data.max():.3g}"
        )
        raise MechanismError(key, f"is not symmetric: {hint}")
    A = sparse.csr_array(0.5 * (A + A.T))
    if not is_semidefinite(A, ROUNDED):
        raise MechanismError(
            key,
            "is not positive semidefinite: some motion would have negative energy; is its file "
            "whole, and of a stiffness or mass?",
        )
    return A


def solid_mesh(case: CaseFile, parameters: ModelParameters, name: str) -> LinkMesh:
    """The mesh of a solid: its nodes' dofs first, node by node; then those of its mesh.

    Raises MechanismError for a mesh that cannot be read, or does not fit its nodes.
    """
    link: Any = case.mechanism.links[name]
    given: Any = case.mechanism.materials[link.material]
    part, places = solid_part(link, float(given.poissons_ratio), f"mechanism.links.{name}")
    space, count = case.mechanism.space, len(places)
    kept = list(DOFS[space])
    own = np.concatenate([6 * k + np.array(kept) for k in range(count)])
    own = np.append(own, np.arange(6 * count, len(part.rigid)))
    nodes = dict(zip(places, chain_dofs(count, space), strict=True))
    E, rho = (
        parameters.number(f"materials.{link.material}.{key}", getattr(given, key))
        for key in ("youngs_modulus", "density")
    )
    bodies = Entries((len(own),) * 2)
    add_bodies(case, parameters, name, bodies, nodes)

    def gram(v: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        return part.lacked.gram(part.motion[:, own] @ v)

    return LinkMesh(
        len(own),
        nodes,
        {key: vector(place.tolist()) for key, place in places.items()},
        [_term(E, part.stiffness[own][:, own])],
        [_term(rho, part.mass[own][:, own]), *bodies.terms()],
        [Term(1.0, sparse.csr_array(part.rigid[own][:, kept]))],
        lost=Lost(E, rho, gram, lambda: part.lacked.one_layer),
        stressed=lambda loads, basis: stressed(part, tuple(kept)).matrices(loads, basis),
    )


def _term(coefficient: Scalar, matrix: sparse.csr_array) -> Term:
    """coefficient × matrix, a number in the matrix."""
    if isinstance(coefficient, Expression):
        return Term(coefficient, sparse.csr_array(matrix))
    return Term(1.0, sparse.csr_array(matrix * coefficient))


_NOWHERE = 1e-9  # of a part's size: a centre of mass as near to an axis is shown on it
_THIN = 1e-5  # kg/m³ of a cube as large as the part: a wire of 10 g/m has that from 30 m on
_FAR = 10.0  # radii of gyration: the ends of a bar are 1.7 from its centre


def part_lines(case: CaseFile) -> tuple[str, ...]:
    """What each superelement and solid is by itself, and what of it is held, in words."""
    numbers, found = parameters(case), list[str]()
    for name in case.mechanism.links:
        if is_imported(case, name):
            kind = link_type(case, name)
            title = f"{kind} {name}"
            mesh = (solid_mesh if kind == "solid" else superelement_mesh)(case, numbers, name)
            found += free_part_lines(case, numbers, title, mesh)
            flat = case.mechanism.space == "planar"
            part = None if kind == "solid" else imported_part(case, name)
            if part is not None and part.null:
                rows = f"rows {listed(part.null)} are zero in stiffness and mass"
                found.append(f"{title}: {rows}, and left out")
            if flat if part is None else part.held:
                found.append(
                    f"{title}: u_z, θ_x and θ_y of its nodes are held; modes in which it moves out "
                    "of the plane between them are counted"
                )
    return tuple(found)


def free_part_lines(
    case: CaseFile, numbers: ModelParameters, title: str, mesh: LinkMesh
) -> list[str]:
    """The part of a mesh at the design as it is written, without bodies on its nodes.

    The first mass term is its own. Its mass m and place c come from NᵀMN = [[m 1, −m[c]×], …].
    """
    y = np.concatenate([written_loads(case), initial_design(case)])[None]
    K, M, rigid = (
        total(terms, coefficients(numbers, terms, y)[:, 0])
        for terms in (mesh.stiffness, mesh.mass[:1], mesh.rigid)
    )
    N = rigid.toarray()
    J = N.T @ (M @ N)
    if not (m := float(J[0, 0])) > 0.0:
        return [f"{title}: {mesh.n_local} dofs, no mass"]
    flat = len(J) == 3
    c = np.array((J[1, 2], -J[0, 2]) if flat else (J[1, 5], J[2, 3], J[0, 4])) / m
    turning = J.diagonal()[2:] if flat else J.diagonal()[3:]
    inertia = turning - m * (c @ c - (0.0 if flat else c**2))
    X = np.array([p[: len(c)] for p in mesh.positions.values()], dtype=np.float64)
    far = float(np.linalg.norm(X - c, axis=1).max(initial=0.0))
    gyration = float(np.sqrt(max(inertia.max(), 0.0) / m))
    size = far + gyration
    centre = ", ".join(f"{x:.4g}" for x in np.where(np.abs(c) < _NOWHERE * size, 0.0, c))
    about = ", ".join(f"{each:.4g}" for each in inertia)
    strain = max(rigid_strain(K, N), ROUND_OFF)  # the digits below differ by machine
    lines = [
        f"{title}: {mesh.n_local} dofs, {m:.4g} kg, centre of mass at ({centre}) m, about it "
        f"{about} kg m2",
        f"{title}: strain under rigid motion {strain:.1g} (accepted up to {STRAIN_FREE:g})",
    ]
    if far > _FAR * gyration:
        lines.append(
            f"{title}: its nodes are up to {far:.3g} m from its centre of mass, a part of about "
            f"{2.0 * gyration:.2g} m: see the positions and their units"
        )
    if size > 1.0 and m < _THIN * size**3:
        lines.append(
            f"{title}: no part has {m:.3g} kg and nodes up to {far:.3g} m from their centre: if "
            "its files are in mm, write units: mm-t-s or mm-kg-ms"
        )
    return lines
