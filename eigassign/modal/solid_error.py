"""How far the frequencies of solid parts are from those of finer meshes, by recovered stresses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.assembly.congruence import LocalLink, motion_matrix, motion_scalars
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.mechanism.elements.mesh import LinkMesh
from eigassign.mechanism.kinematics.parameters import ModelParameters
from eigassign.mechanism.kinematics.rotations import Objects
from eigassign.modal.exact.solver import lowest_modes
from eigassign.series.compiler import CompiledArrays

Floats = NDArray[np.float64]
BESIDE = 6  # modes above the highest one asked for that may be lower at last
# Of solids, λ may lose so many times the energy that recovered stresses show. Of 240 modes of bars
# in few tetrahedra or hexahedra it lost 0.7 times that in the middle, up to 2.3 times in 95 of 100,
# and 3.5 times at most; of 14 parts as gmsh meshes them, 195 modes, 2.6 times at most
RECOVERED = 3.0
REFUSED = 0.5  # relative error in frequency above which nothing is said


def solid_error(solids: SolidLinks, x: Floats, modes: Sequence[int]) -> Floats:
    """How much meshes of solids raise frequencies, estimated, (n_samples, n_modes)."""
    pencil, highest, out = solids.pencil, max(modes), np.empty((len(x), len(modes)))
    for s in range(len(x)):
        found = lowest_modes(pencil, pencil.theta(x[s : s + 1]), highest, BESIDE)
        lam = found.lam[0]
        share = RECOVERED * np.einsum("kjj->j", solids.lost(x[s], found.phi[0] / np.sqrt(lam)))
        # a mode beside may be lower at last, where a coarse mesh makes it too stiff
        least = np.sort(lam * np.maximum(1.0 - share, 1e-12))[:highest]
        out[s] = (np.sqrt(lam[:highest] / least) - 1.0)[np.array(modes) - 1]
    return np.where(out < REFUSED, np.maximum(out, 0.0), np.inf)


class SolidLink(NamedTuple):
    """A solid: its place among the unknowns, and its mesh with all dofs."""

    local: LocalLink
    mesh: LinkMesh


@dataclass(frozen=True, eq=False)
class SolidLinks:
    """The solids of a mechanism."""

    links: tuple[SolidLink, ...]
    parameters: ModelParameters
    pencil: Pencil

    def lost(self, x: Floats, z: Floats) -> Floats:
        """2 × the energy that their meshes lack in motions z (n_dof, count) at x (n_x,), about.

        (n_links, count, count)
        """
        values = [each[0] for each in self._table(self.parameters.z(x[None]))]
        found = []
        for k, link in enumerate(self.links):
            B = motion_matrix(link.local, values[4 * k : 4 * k + 3], self.pencil.n_u, len(z))
            v, gram = np.asarray(B @ z), self._grams[k]
            energy = link.mesh.lost.energy(v) if gram is None else v.T @ gram @ v  # type: ignore
            found.append(values[4 * k + 3][0] * energy)
        return np.array(found)

    @cached_property
    def _grams(self) -> list[Floats | None]:
        """The same of all motions of reduced links, for coefficients of 1."""
        made = []
        for link in self.links:
            reduction = link.local.reduction
            made.append(None if reduction is None else link.mesh.lost.energy(reduction.basis))  # type: ignore
        return made

    @cached_property
    def _table(self) -> CompiledArrays:
        """`motion_scalars` of each link, and the coefficient."""
        arrays: list[Objects] = []
        for link in self.links:
            assert link.mesh.lost is not None
            coefficient = np.array([link.mesh.lost.coefficient], dtype=object)
            arrays += [*motion_scalars(link.local), coefficient]
        return self.parameters.compiled(*arrays)


def solid_links(
    parameters: ModelParameters,
    links: Sequence[LocalLink],
    meshes: Mapping[str, LinkMesh],
    pencil: Pencil,
) -> SolidLinks | None:
    """The links that are solids, each with its mesh; None without any."""
    each = zip(links, meshes.values(), strict=True)
    found = [SolidLink(local, mesh.whole) for local, mesh in each if mesh.whole.lost is not None]
    return SolidLinks(tuple(found), parameters, pencil) if found else None
