"""A solid part by its mesh: K of E = 1, M of ρ = 1 and rigid motion, its nodes before its mesh."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.case.suggestions import listed, shown
from eigassign.case.units import DIMENSIONS
from eigassign.errors import MechanismError
from eigassign.mechanism.imports.parts import UNITS
from eigassign.mechanism.solids.elements import (
    KINDS,
    assembled,
    dofs,
    jacobians,
    mass,
    stiffness,
)
from eigassign.mechanism.solids.enriched import Enriched, enriched
from eigassign.mechanism.solids.mesh_file import SolidMesh, read_mesh
from eigassign.mechanism.solids.surfaces import (
    Coupling,
    UnfitSurfaceError,
    centre,
    joined,
    pieces,
    rigid_rows,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
_log = logging.getLogger(__name__)
SEVERAL = 50_000  # unknowns above which a factor may take half a minute and a GB
AT_ONCE = 2_000_000  # numbers that are held at a time: entries of elements' matrices
# Volume of an element at a point, of the box of its edges, that is none: files have few digits
FLAT = 1e-9
HUGE = 1e4  # m³, a cube of 21 m; a part of 10 cm³ has that in mm that are read as m
FOLDED = (
    "has elements that are folded, or have no volume (their Jacobian is not positive at a point of "
    "integration): make the mesh finer where its surface is curved, or its elements straight (in "
    "gmsh Mesh.SecondOrderLinear = 1)"
)


@dataclass(frozen=True, eq=False)
class SolidPart:
    """K and M of a part in local dofs: six of each node of it, then those of its mesh."""

    mesh: SolidMesh
    nu: float
    motion: sparse.csr_array  # T, u = T v, (3 n, n_local)
    stiffness: sparse.csr_array  # for E = 1, (n_local, n_local)
    mass: sparse.csr_array  # for ρ = 1
    rigid: Floats  # (n_local, 6)
    nodes: tuple[Coupling, ...]  # what its nodes stand for

    @cached_property
    def lacked(self) -> Enriched:
        """The functions that its mesh lacks."""
        held = np.concatenate([each.own for each in self.nodes])
        return enriched(self.mesh, self.nu, held)


def couplings(link: Any, path: str) -> tuple[SolidMesh, dict[str, Coupling]]:
    """The mesh of a solid link in metres, and what its nodes stand for.

    Raises MechanismError for what cannot be read, and for surfaces that the mesh does not have.
    """
    mesh = _sound(read_mesh(Path(link.mesh), f"{path}.mesh"), UNITS[link.units].length, path)
    known, found = {name.upper(): own for name, own in mesh.sets.items()}, {}
    for name, node in link.nodes.items():
        own = mesh.sets.get(node.surface, known.get(node.surface.upper()))
        if own is None:
            named = listed(mesh.sets) if mesh.sets else "none: name them in the program that meshes"
            message = f"the mesh has no surface {shown(node.surface)}; it has {named}"
            raise MechanismError(f"{path}.nodes.{name}.surface", message)
        place = centre(mesh, own)
        if node.position is not None:
            place = np.array([*map(float, node.position), 0.0][:3])
        found[name] = Coupling(own, place, node.coupling == "rigid")
    return mesh, found


@lru_cache(maxsize=4)
def _sound(mesh: SolidMesh, factor: float, path: str) -> SolidMesh:
    """The mesh in metres; raises MechanismError for one that no part has."""
    far, length = factor * float(np.abs(mesh.x).max()), DIMENSIONS["length"]
    if not length.smallest < far < length.largest:
        message = f"has nodes {far:.3g} m from its origin: is it damaged, or in other units?"
        raise MechanismError(f"{path}.mesh", message)
    found, volume = mesh if factor == 1.0 else replace(mesh, x=factor * mesh.x), 0.0
    for count, rows in found.elements.items():
        for xi, weights in ((KINDS[count].points, 0.0), KINDS[count].heavy):
            J = jacobians(found.x[rows], count, xi)
            det = np.linalg.det(J)
            if (det <= FLAT * np.linalg.norm(J, axis=3).prod(axis=2)).any():
                raise MechanismError(f"{path}.mesh", FOLDED)
            volume += float((det * weights).sum())
    if (count := pieces(found)) > 1:
        message = (
            f"is in {count} pieces that share no nodes: join its volumes where it is meshed (in "
            "gmsh BooleanFragments), or make a link of each"
        )
        raise MechanismError(f"{path}.mesh", message)
    if volume > HUGE:
        message = f"is a part of {volume:.3g} m3: if it is in mm, write units: mm-t-s or mm-kg-ms"
        raise MechanismError(f"{path}.mesh", message)
    return found


def solid_part(link: Any, nu: float, path: str) -> tuple[SolidPart, Mapping[str, Floats]]:
    """The part of a solid link, and the places of its nodes; raises MechanismError."""
    mesh, nodes = couplings(link, path)
    key = tuple((n, c.own.tobytes(), tuple(c.place.tolist()), c.rigid) for n, c in nodes.items())
    return _made(mesh, nu, key, path), {name: each.place for name, each in nodes.items()}


@lru_cache(maxsize=4)  # a case makes its links for each model anew
def _made(
    mesh: SolidMesh, nu: float, key: tuple[tuple[str, bytes, Any, bool], ...], path: str
) -> SolidPart:
    given = {
        name: Coupling(np.frombuffer(own, dtype=np.intp), np.array(place), rigid)
        for name, own, place, rigid in key
    }
    try:
        T, free = joined(mesh, given)
    except UnfitSurfaceError as error:
        name, why = error.args
        raise MechanismError(f"{path}.nodes.{name}.surface", f"the surface {why}") from error
    _tell_size(T.shape[1], path)
    n = T.shape[0]
    K, M = sparse.csr_array((n, n)), sparse.csr_array((n, n))
    for count, rows in mesh.pieces(AT_ONCE // 2000):
        x = mesh.x[rows]
        to = dofs(rows)
        K = K + assembled(stiffness(x, count, nu), to, to, (n, n))
        heavy = np.asarray(np.kron(mass(x, count), np.eye(3)))
        M = M + assembled(heavy, to, to, (n, n))
    whole = rigid_rows(mesh.x)
    rigid = np.vstack([*(_at_node(each.place) for each in given.values()), whole[free]])
    K, M = (sparse.csr_array(T.T @ A @ T) for A in (K, M))
    return SolidPart(mesh, nu, T, 0.5 * (K + K.T), 0.5 * (M + M.T), rigid, tuple(given.values()))


def _at_node(place: Floats) -> Floats:
    """Rigid motion (6, 6) of a node, its turn included."""
    return np.vstack([rigid_rows(place[None]), np.hstack([np.zeros((3, 3)), np.eye(3)])])


def _tell_size(n: int, path: str) -> None:
    """Name time and memory where they are large: those of a cube, the worst shape there is.

    Of 24 000 unknowns its factor took 9 s and 0.32 GB, growing with n² and n^(4/3).
    """
    if n > SEVERAL:
        seconds, memory = 9.0 * (n / 24e3) ** 2, 0.32 * (n / 24e3) ** (4 / 3)
        _log.warning(
            "%s: %d unknowns: each factor takes up to %.2g s and %.2g GB; thin parts far less",
            *(path, n, seconds, memory),
        )
