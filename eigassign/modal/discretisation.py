"""How far the frequencies of a mesh are from those of the beams themselves, without a finer mesh.

Elements are what Craig and Bampton's links are in `truncation`: what their shapes leave out, C, is
the motion inside them while their nodes are held, and K-orthogonal to the mesh. With μ̂_j = 1/λ̂_j of
its modes, ‖z_j‖_K = 1, the true μ are at most the eigenvalues of

    [ diag(μ̂)  R ]        R Rᵀ = G,   G_jk = Σ_elements ρ_jᵀ S⁻¹ ρ_k,
    [ Rᵀ       X ],       ρ_j = M_bc v_j − μ̂_j K_bc v_j        (see `inner`),

where X is not less than M on C: β = max μ inside an element, with any motion of an end that is
attached to nothing taken away, for to turn the point of a cone takes no energy. Where sections vary
along elements, C reaches over nodes by some motion of the mesh, and X = β + Rᵀ diag(1/μ̂) R.

Modes of reduced links leave something in the mesh as well (G₁ and β₁ of `truncation`), and C
reaches into that by τ² = max bᵀ(K_bb − S)b / bᵀSb of tapers. For any t > 0 what both leave out is

    G₁ + (1 + t) G + (1 + 1/t) τ² G₁ ,   β₁ + (√β + τ √β₁)² ;

its bound over that of the links alone is the mesh's.

Of solids nothing bounds what their meshes leave out; it is estimated by recovered stresses
(`mechanism.solids.part`).

Under gravity K_g is indefinite, and this is no bound. What a mesh of twice the elements changes
is an estimate then, and the larger of both is stated (see `_estimated`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import MechanismError
from eigassign.mechanism.assembly.inside_links import (
    Alike,
    MeshedLinks,
    ReducedLinks,
    SolidLinks,
)
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.mechanism.elements.inner import InnerPart, inner_parts
from eigassign.modal.exact.solver import lowest_modes
from eigassign.modal.truncation import BESIDE as BESIDE_LINKS
from eigassign.modal.truncation import REFUSED, LeftOut, truncation_bounds

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
BESIDE = 24  # modes above the highest one asked for; with 6, few elements in space err 0.3 % more
# Under weight: modes above those asked for that may be the lowest at last
CLOSE = 2
# λ loses at most as many times what one mesh and two of twice the elements take off it: 16/15
# where it converges with the fourth order, 2 and 4/3 with the first, as the curvature at a carriage
LOST = {1: 2.0, 2: 1.5}
# Of solids, λ may lose so many times the energy that recovered stresses show. Of 240 modes of bars
# in few tetrahedra or hexahedra it lost 0.7 times that in the middle, up to 2.3 times in 95 of 100,
# and 3.5 times at most; of 14 parts as gmsh meshes them, 195 modes, 2.6 times at most
RECOVERED = 3.0
SLOWEST = 0.6  # of the first step is the second; slower, nothing converges for certain
# What grows with 1/h, where carriages slide under a moment: from elements four times as short to
# some a hundred times as short, which a beam of their depth would not be, by 99/3
GROWING = 33.0


@dataclass(frozen=True, eq=False)
class DiscretisationError:
    """Bounds on how much a mesh raises frequencies, relative; infinite where there is none.

    Under gravity estimates.
    """

    total: Floats  # (n_samples, n_modes)
    links: Mapping[str, Floats]  # what each link alone has in it, about, (n_samples, n_modes)


def discretisation_error(
    parts: MeshedLinks,
    x: Floats,
    modes: Sequence[int],
    reduced: ReducedLinks | None = None,
    refinements: Sequence[Pencil] = (),
) -> DiscretisationError:
    """Bounds at samples x (n_samples, n_x); each costs an exact solve of the mesh.

    Under gravity estimates, from the pencils of its ``refinements``: whole links on finer and finer
    meshes.
    """
    pencil, pick, highest = parts.pencil, np.array(modes) - 1, max(modes)
    total = np.empty((len(x), len(modes)))
    of_links = np.empty((len(parts.links), len(x), len(modes)))
    theta = pencil.theta(x)
    inside = _Inside(parts, reduced is None)
    left_out = None if reduced is None else LeftOut(reduced)
    for s in range(len(x)):
        found = lowest_modes(pencil, theta[:, s : s + 1], highest, BESIDE)
        mu = 1.0 / found.lam[0]
        z = found.phi[0] * np.sqrt(mu)
        gram, own, beta = inside.at(x[s], z, mu)
        most = float(beta.max())
        bounds = _bounds(mu, gram, most, inside.tie, highest, pencil)
        if left_out is not None:
            left = (gram, most), left_out.at(x[s], z, mu)
            bounds = np.maximum(bounds, _beside_links(mu, *left, inside.tie, highest, pencil))
        grown = np.ones(highest)
        if refinements:
            more = np.maximum(bounds, _estimated(refinements, x[s : s + 1], highest))
            grown = np.divide(more, bounds, out=grown, where=(bounds > 0.0) & np.isfinite(more))
            bounds = more
        total[s] = bounds[pick]
        room = np.maximum(mu[pick] - beta[:, None], 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = 0.5 * own[:, pick] / (room * mu[pick]) * grown[pick]
        of_links[:, s] = np.where(own[:, pick] > 0.0, share, 0.0)
    names = [link.name for link in parts.links]
    return DiscretisationError(total, dict(zip(names, of_links, strict=True)))


def _bounds(
    mu: Floats, gram: Floats, beta: float, tie: float, highest: int, pencil: Pencil
) -> Floats:
    """√(μ/μ̂) − 1 at most, for every mode up to ``highest``."""
    kept = len(mu)
    if kept < len(pencil.elastic) and kept > highest:  # the last stands for all above it
        kept, beta = kept - 1, max(beta, float(mu[-1]))
    values, turns = np.linalg.eigh(gram[:kept, :kept])
    R = turns * np.sqrt(np.maximum(values, 0.0))
    X = beta * np.eye(kept) + (R.T @ (R / mu[:kept, None]) if tie > 0.0 else 0.0)
    top = np.linalg.eigvalsh(np.block([[np.diag(mu[:kept]), R], [R.T, X]]))[::-1][:highest]
    error = np.sqrt(np.maximum(top / mu[:highest], 1.0)) - 1.0
    return np.where((mu[:highest] > beta) & (error < REFUSED), error, np.inf)


def _beside_links(
    mu: Floats,
    elements: tuple[Floats, float],
    links: tuple[Floats, float],
    tie: float,
    highest: int,
    pencil: Pencil,
) -> Floats:
    """The same of modes of reduced links, from G and β of the elements and of the links."""
    (gram, beta), (of_links, beta_links) = elements, links
    count = highest + BESIDE_LINKS
    alone = truncation_bounds(mu[:count], of_links[:count, :count], beta_links, highest, pencil)
    beta = beta_links + (np.sqrt(beta) + np.sqrt(tie * beta_links)) ** 2
    both = np.empty(highest)
    for k in range(highest):
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.clip(np.nan_to_num(np.sqrt(tie * of_links[k, k] / gram[k, k])), 1e-9, 1e9)
        whole = of_links + (1.0 + t) * gram + (tie + tie / t) * of_links
        both[k] = _bounds(mu, whole, beta, tie, highest, pencil)[k]
    known = np.isfinite(alone)
    return np.where(known, (1.0 + both) / (1.0 + np.where(known, alone, 0.0)) - 1.0, 0.0)


def _estimated(meshes: Sequence[Pencil], x: Floats, highest: int) -> Floats:
    """√(λ/λ_∞) − 1 of modes under weight, from what finer ``meshes`` take off λ.

    The modes `CLOSE` above are converged likewise: one of them may be the lowest at last.
    """
    levels = []
    for pencil in meshes:
        try:
            levels.append(lowest_modes(pencil, pencil.theta(x), highest, CLOSE).lam[0])
        except MechanismError:  # buckles
            return np.full(highest, np.inf)
    count = min(map(len, levels))
    rows = np.array([each[:count] for each in levels])
    steps, change = np.abs(np.diff(rows, axis=0)), np.abs(rows[-1] - rows[0])
    times = np.full(count, LOST[len(steps)])
    if len(steps) > 1:
        times[steps[1] > SLOWEST * steps[0]] = GROWING
    least = np.sort(rows[0] - times * change)[:highest]  # below 0 a mesh fine enough buckles
    left = np.maximum(least / rows[0, :highest], 1e-12)
    error = 1.0 / np.sqrt(left) - 1.0
    return np.where(error < REFUSED, error, np.inf)


def solid_error(solids: SolidLinks, x: Floats, modes: Sequence[int]) -> Floats:
    """How much meshes of solids raise frequencies, estimated, (n_samples, n_modes)."""
    pencil, highest, out = solids.pencil, max(modes), np.empty((len(x), len(modes)))
    for s in range(len(x)):
        found = lowest_modes(pencil, pencil.theta(x[s : s + 1]), highest, BESIDE_LINKS)
        lam = found.lam[0]
        share = RECOVERED * np.einsum("kjj->j", solids.lost(x[s], found.phi[0] / np.sqrt(lam)))
        # a mode beside may be lower at last, where a coarse mesh makes it too stiff
        least = np.sort(lam * np.maximum(1.0 - share, 1e-12))[:highest]
        out[s] = (np.sqrt(lam[:highest] / least) - 1.0)[np.array(modes) - 1]
    return np.where(out < REFUSED, np.maximum(out, 0.0), np.inf)


class _Inside:
    """The elements' inner parts; those of one sample serve the next where they are the same."""

    def __init__(self, parts: MeshedLinks, whole: bool) -> None:
        self.parts = parts
        # of reduced links, nodes that are free do not move by themselves
        self.free = parts.free if whole else np.zeros_like(parts.free)
        self.key, self.tie = np.zeros(0), 0.0
        self.inner: list[tuple[Ints, Ints, InnerPart]] = []  # which, as which of the part

    def at(self, x: Floats, z: Floats, mu: Floats) -> tuple[Floats, Floats, Floats]:
        """G (count, count) of modes z; its diagonal, and β, of each link (n_links, …)."""
        values, links = self.parts.values(x), len(self.parts.links)
        self._update(self.parts.elements(values))
        v = self.parts.motion(values, z)
        gram, own, beta = np.zeros((len(mu),) * 2), np.zeros((links, len(mu))), np.zeros(links)
        for which, like, part in self.inner:
            d = v[which][:, part.dofs] * part.scale[like][:, :, None]
            rho = part.mass[like] @ d - part.stiffness[like] @ (mu * d)
            answer = part.inverse[like] @ rho
            gram += np.einsum("nbj,nbk->jk", rho, answer)
            owners = self.parts.owners[which]
            np.add.at(own, owners, (rho * answer).sum(axis=1))
            np.maximum.at(beta, owners, part.beta[like, self.free[which]])
        return 0.5 * (gram + gram.T), own, beta

    def _update(self, elements: list[Alike]) -> None:
        key = np.concatenate([np.append(each.values, each.h) for each in elements])
        if np.array_equal(key, self.key):
            return
        self.key, self.inner, self.tie = key, [], 0.0
        for each in elements:
            once, like = each.different()
            for part in inner_parts(once.profile(), once.h, self.parts.space):
                self.inner.append((each.elements, like, part))
                self.tie = max(self.tie, float(part.tie.max()))
