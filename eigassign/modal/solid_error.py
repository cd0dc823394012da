"""How far the frequencies of solid parts are from those of finer meshes, about."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.assembly.congruence import LocalLink, motion_matrix, motion_scalars
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.mechanism.elements.mesh import LinkMesh, Lost
from eigassign.mechanism.kinematics.joints import Objects
from eigassign.mechanism.kinematics.parameters import ModelParameters
from eigassign.modal.exact.solver import lowest_modes
from eigassign.series.compiler import CompiledArrays

Floats = NDArray[np.float64]
BESIDE = 6  # modes above the highest one asked for that may be lower at last
# A part of one layer of elements of four nodes is known to add so little to λ, or nothing is known
LITTLE = 0.01
REFUSED = 0.5  # relative error in frequency above which nothing is said


def solid_error(solids: SolidLinks, x: Floats, modes: Sequence[int]) -> Floats:
    """How much meshes of solids raise frequencies, about, (n_samples, n_modes); inf: not known."""
    pencil, highest, out = solids.pencil, max(modes), np.empty((len(x), len(modes)))
    for s in range(len(x)):
        found = lowest_modes(pencil, pencil.theta(x[s : s + 1]), highest, BESIDE)
        lam = found.lam[0]
        shares, unknown = solids.shares(x[s], found.phi[0] / np.sqrt(lam), lam)
        # a mode beside may be lower at last, where a coarse mesh makes it too stiff
        least = np.sort(lam * np.maximum(1.0 - shares.sum(axis=0), 1e-12))[:highest]
        error = np.sqrt(lam[:highest] / least) - 1.0
        error[(shares[unknown, :highest] > LITTLE).any(axis=0)] = np.inf
        out[s] = error[np.array(modes) - 1]
    return np.where(out < REFUSED, np.maximum(out, 0.0), np.inf)


@dataclass(frozen=True, eq=False)
class SolidLinks:
    """The solids of a mechanism: their places among the unknowns, what their meshes lack."""

    links: tuple[tuple[LocalLink, Lost], ...]
    parameters: ModelParameters
    pencil: Pencil

    def shares(self, x: Floats, z: Floats, lam: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """What their meshes add to λ of modes z (n_dof, count) at x (n_x,), about, relative.

        (n_links, count), where zᵀ K z = 1; and of which links nothing is known, (n_links,).
        """
        values = [each[0] for each in self._table(self.parameters.z(x[None]))]
        found = np.empty((len(self.links), len(lam)))
        for k, ((local, lost), gram) in enumerate(zip(self.links, self._grams, strict=True)):
            B = motion_matrix(local, values[4 * k : 4 * k + 3], self.pencil.n_u, len(z))
            (E, rho), v = values[4 * k + 3], np.asarray(B @ z)
            G, v = (lost.gram(v), np.eye(len(lam))) if gram is None else (gram, v)
            w = np.vstack([E * v, -rho * v * lam])
            found[k] = np.einsum("ij,ij->j", w, G @ w) / E
        return found, np.array([lost.one_layer() for _, lost in self.links])

    @cached_property
    def _grams(self) -> list[Floats | None]:
        """`Enriched.gram` of all motions of reduced links."""
        pairs = [(lost, local.reduction) for local, lost in self.links]
        return [None if own is None else lost.gram(own.basis) for lost, own in pairs]

    @cached_property
    def _table(self) -> CompiledArrays:
        """`motion_scalars` of each link, modulus and density."""
        arrays: list[Objects] = []
        for local, lost in self.links:
            given = np.array([lost.modulus, lost.density], dtype=object)
            arrays += [*motion_scalars(local), given]
        return self.parameters.compiled(*arrays)


def solid_links(
    parameters: ModelParameters,
    links: Sequence[LocalLink],
    meshes: Mapping[str, LinkMesh],
    pencil: Pencil,
) -> SolidLinks | None:
    """The links that are solids, each with its mesh; None without any."""
    each = zip(links, meshes.values(), strict=True)
    found = [(local, mesh.whole.lost) for local, mesh in each if mesh.whole.lost is not None]
    return SolidLinks(tuple(found), parameters, pencil) if found else None
