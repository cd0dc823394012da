"""What a part is by itself, in words: wrong units, rows and supports show here.

The free-free modes K φ = λ M φ are solved as M φ = μ (K + s M) φ, μ = 1 / (λ + s), with s near the
lowest λ of the part held at its nodes, so that rigid-body modes and elastic ones are both accurate.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import LinAlgError, eigh

from eigassign.case.case_file import CaseFile
from eigassign.errors import AccuracyError
from eigassign.mechanism.elements.craig_bampton import DENSE, coefficients
from eigassign.mechanism.elements.mesh import LinkMesh, total
from eigassign.mechanism.elements.sparse_factor import kept_factor, largest_modes
from eigassign.mechanism.elements.superelement import (
    STRAIN_FREE,
    rigid_strain,
    solid_mesh,
    superelement_mesh,
)
from eigassign.mechanism.imports.parts import imported_part
from eigassign.mechanism.kinematics.parameters import (
    ModelParameters,
    initial_design,
    is_imported,
    link_type,
    parameters,
    written_loads,
)

Floats = NDArray[np.float64]
_ELASTIC = 3  # free-free frequencies that are shown
_RIGID = 1e-6  # of the highest λ looked at, three or more beyond the rigid ones: below none bends
_NOISE = 1e-13  # of the mean of K over that of M: round-off of what does not bend at all
_MASSLESS = 1e-10  # of the largest μ: what moves no mass has μ = 0
_NOWHERE = 1e-9  # of a part's size: a centre of mass as near to an axis is shown on it
_THIN = 1e-5  # kg/m³ of a cube as large as the part: a wire of 10 g/m has that from 30 m on
_FAR = 10.0  # radii of gyration: the ends of a bar are 1.7 from its centre
_FAST = 3e4  # m/s: of the lowest free frequency × size, half a wave at twice the speed in diamond
_SEEN = 1e-6  # relative: uncertainty of a frequency that is worth a word
_UNKNOWN = 0.1  # and from which on no frequency is known


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
            if flat if kind == "solid" else imported_part(case, name).held:
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
    strain = rigid_strain(K, N)
    free, lowest = _free_modes(K, M, mesh, strain, len(J))
    lines = [
        f"{title}: {mesh.n_local} dofs, {m:.4g} kg, centre of mass at ({centre}) m, about it "
        f"{about} kg m2",
        f"{title}: {free}strain under rigid motion {strain:.1g} (accepted up to {STRAIN_FREE:g})",
    ]
    if far > _FAR * gyration:
        lines.append(
            f"{title}: its nodes are up to {far:.3g} m from its centre of mass, a part of about "
            f"{2.0 * gyration:.2g} m: see the positions and their units"
        )
    if (size > 1.0 and m < _THIN * size**3) or lowest * size > _FAST:
        lines.append(
            f"{title}: no part has {m:.3g} kg, nodes up to {far:.3g} m from their centre and "
            f"frequencies from {lowest:.3g} Hz on: if its files are in mm, write units: mm-t-s or "
            "mm-kg-ms"
        )
    return lines


def _free_modes(
    K: sparse.csr_array, M: sparse.csr_array, mesh: LinkMesh, strain: float, expected: int
) -> tuple[str, float]:
    """The number of rigid modes and the lowest elastic frequencies, in words, and the first in Hz.

    Nothing and 0 where they fail.
    """
    try:
        lam, phi = _lowest(K, M, mesh, expected + 2 * _ELASTIC)
    except (LinAlgError, ArithmeticError, AccuracyError, IndexError):
        return "", 0.0
    least = max(_RIGID * lam[-1], _NOISE * K.trace() / M.trace())
    rigid = int((lam < least).sum())
    why = "is it in pieces?" if rigid > expected else "is it supported, or has it too few digits?"
    loose = "" if rigid == expected else f" ({expected} expected: {why})"
    hz = np.sqrt(lam[rigid:][:_ELASTIC]) / (2.0 * np.pi)
    text = f"free: {rigid} rigid modes{loose}"
    if len(hz):
        text += f", then {', '.join(f'{f:.5g}' for f in hz)} Hz"
        # entries that are wrong by ε √(K_ii K_jj), each by itself, change λ by ε φᵀ diag(K) φ
        shape = phi[:, rigid]
        unsure = 0.5 * strain * (K.diagonal() @ shape**2) / (shape @ (K @ shape))
        how = f"by {100 * unsure:.1g} %" if unsure < _UNKNOWN else "beyond any use"
        text += f" (uncertain {how}: few digits)" if unsure > _SEEN else ""
    return f"{text}; ", float(hz[0]) if len(hz) else 0.0


def _lowest(
    K: sparse.csr_array, M: sparse.csr_array, mesh: LinkMesh, count: int
) -> tuple[Floats, Floats]:
    """The ``count`` lowest λ at most, ascending, and their modes."""
    s = 1e-6 * float(K.trace() / M.trace())
    if K.shape[0] <= DENSE:
        for _ in range(2):  # the second time with s near what was found
            mu, phi = eigh(M.toarray(), (K + s * M).toarray())
            mu, phi = mu[::-1][:count], phi[:, ::-1][:, :count]
            lam = 1.0 / mu[mu > _MASSLESS * mu[0]] - s
            s = max(s, float(lam[-1]))
        return np.asarray(lam), np.asarray(phi)
    s = max(1e-6 * s, _held_eigenvalue(K, M, mesh))
    A = sparse.csc_array(K + s * M)
    if (factor := kept_factor(A)) is None:
        raise AccuracyError("a part without mass is loose")
    mu, phi = largest_modes(factor, A.T, lambda v: np.asarray(M @ v), count)
    return 1.0 / mu[mu > _MASSLESS * mu[0]] - s, phi


def _held_eigenvalue(K: sparse.csr_array, M: sparse.csr_array, mesh: LinkMesh) -> float:
    """About the lowest λ with the nodes held, by four steps of inverse iteration; 0 without it."""
    held = np.concatenate([slots[slots >= 0] for slots in mesh.nodes.values()])
    i = np.setdiff1d(np.arange(K.shape[0]), held)
    factor = kept_factor(sparse.csc_array(K[i][:, i])) if len(i) else None
    if factor is None:
        return 0.0
    M_ii, v = M[i][:, i], np.random.default_rng(0).standard_normal(len(i))
    for _ in range(4):
        v = factor.solve(M_ii @ v)
        v /= np.abs(v).max() or 1.0
    return float((v @ (K[i][:, i] @ v)) / (v @ (M_ii @ v)))
