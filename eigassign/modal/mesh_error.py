"""What meshes leave out: of beams measured by finer ones, of solids estimated.

With f_0 of a mesh, f_1, f_2, … of 2, 4, … times its elements and differences d_k = f_(k−1) − f_k,

    |f_0 − f| / f ≈ (Σ_(k≤n) |d_k| + |d_n| / (r − 1)) / f_n ,   r = min(|d_(n−1) / d_n|, 4) .

Bending converges with the fourth power of the element's length, so that r = 16, stretch, twist,
shear and weight with the second, r = 4, which is what is taken at most. One difference tells
enough, with r = 4, where every beam has two elements, d_1 is small, no weight takes off what
bending adds, and nothing rides on a beam, whose node both meshes may have at other places. Else the
elements are doubled until the last two differences fall, and `MARGIN` times that is stated; where
they never do, nothing is known.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from eigassign.arrays import Bools, Floats
from eigassign.errors import MechanismError
from eigassign.mechanism.assembly.congruence import LocalLink, motion_matrix, motion_scalars
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.mechanism.elements.links import LinkMesh, Lost
from eigassign.mechanism.kinematics.joints import Objects
from eigassign.mechanism.kinematics.parameters import ModelParameters
from eigassign.modal.exact.solver import eigenvalues, lowest_modes
from eigassign.series.compiler import CompiledArrays

FACTORS = (2.0, 4.0, 8.0, 16.0)  # times the elements
# Of every beam, from which on half the elements tell the error, d_0 / (r − 1): what twice as many
# change of 400 elements a link, 4e-5, is round-off, and their true error below 3e-10
FINE = 16
CLOSE = 1e-4  # relative difference of two meshes up to which one tells enough
SLOWEST = 1.7  # r from which on differences fall: where a rider's weight bends a beam it is 2
LARGE = 0.05  # last difference, relative: of steep tapers of one element r falls where it is larger
SAME = 1e-9  # relative difference that may be round-off, whatever r is
# Of 707 errors of random mechanisms of one to four elements, against six times the elements, 0.6 %
# are above what is stated with 1, 0.4 % with 1.02, none with 1.03
MARGIN = 1.03


def mesh_error(
    mesh: Callable[[float], Pencil],
    x: Floats,
    modes: Sequence[int],
    certain: bool,
    fine: bool = False,
) -> Floats:
    """By how much a mesh raises frequencies, about, relative, (n_samples, n_modes).

    ``mesh`` gives the pencil with so many times the elements; ``certain``: one difference may
    tell enough, where the mesh is ``fine`` that from half the elements. Infinite where nothing is
    known.
    """
    error, rows, pick = np.full((len(x), len(modes)), np.inf), np.arange(len(x)), max(modes)
    columns = np.array(modes) - 1
    hz = [np.sqrt(eigenvalues(mesh(1.0), x, pick))[:, columns]]
    if fine:
        half = standing_frequencies(mesh(0.5), x, pick)[:, columns]
        return np.abs(half / hz[0] - 1.0) / 3.0
    for factor in FACTORS:
        hz.append(standing_frequencies(mesh(factor), x[rows], pick)[:, columns])
        error[rows] = _stated(np.array(hz), certain)
        open_ = np.isinf(error[rows]).any(axis=1)
        if not open_.any():
            break
        rows, hz = rows[open_], [each[open_] for each in hz]
    return error


def _stated(hz: Floats, certain: bool) -> Floats:
    """The error of the first of several meshes' frequencies (n_meshes, …)."""
    d = np.abs(np.diff(hz, axis=0) / hz[-1])
    if len(d) == 1:
        known, r, margin = certain & (d[0] < CLOSE), np.full(d[0].shape, 4.0), 1.0
    else:
        margin = MARGIN
        r = d[-2] / np.maximum(d[-1], 1e-300)
        known = (r >= SLOWEST) & (d[-1] < LARGE) | (d[-1] < SAME)
    error = margin * (d.sum(axis=0) + d[-1] / (np.clip(r, SLOWEST, 4.0) - 1.0))
    return np.where(known & np.isfinite(error), error, np.inf)


def standing_frequencies(pencil: Pencil, x: Floats, count: int) -> Floats:
    """√λ (n_samples, count); not a number at samples where it buckles."""
    try:
        return np.asarray(np.sqrt(eigenvalues(pencil, x, count)))
    except MechanismError:
        if len(x) == 1:
            return np.full((1, count), np.nan)
    return np.vstack([standing_frequencies(pencil, each[None], count) for each in x])


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

    def shares(self, x: Floats, z: Floats, lam: Floats) -> tuple[Floats, Bools]:
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
