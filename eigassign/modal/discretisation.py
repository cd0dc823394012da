"""How far the frequencies of a mesh are from those of the beams themselves, without a finer mesh.

Elements are what Craig and Bampton's links are in `truncation`: what their shapes leave out, C, is
the motion inside them while their nodes are held, and K-orthogonal to the mesh. With μ̂_j = 1/λ̂_j of
its modes, ‖z_j‖_K = 1, the true μ are at most the eigenvalues of

    [ diag(μ̂)  R ]        R Rᵀ = G,   G_jk = Σ_elements ρ_jᵀ S⁻¹ ρ_k,
    [ Rᵀ       X ],       ρ_j = M_bc v_j − μ̂_j K_bc v_j        (see `inner`),

where X is not less than M on C: β = max μ inside an element. Where sections vary along elements, C
reaches over nodes by some motion of the mesh, and X = β + Rᵀ diag(1/μ̂) R.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.assembly.inside_links import Alike, MeshedLinks
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.mechanism.elements.inner import InnerPart, inner_parts
from eigassign.modal.exact.solver import lowest_modes
from eigassign.modal.truncation import REFUSED

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
BESIDE = 24  # modes above the highest one asked for; with 6, few elements in space err 0.3 % more


@dataclass(frozen=True, eq=False)
class DiscretisationError:
    """Bounds on how much a mesh raises frequencies, relative; infinite where there is none."""

    total: Floats  # (n_samples, n_modes)
    links: Mapping[str, Floats]  # what each link alone has in it, about, (n_samples, n_modes)


def discretisation_error(
    parts: MeshedLinks, x: Floats, modes: Sequence[int]
) -> DiscretisationError:
    """Bounds at samples x (n_samples, n_x); each costs an exact solve of the mesh."""
    pencil, pick, highest = parts.pencil, np.array(modes) - 1, max(modes)
    total = np.empty((len(x), len(modes)))
    of_links = np.empty((len(parts.links), len(x), len(modes)))
    theta = pencil.theta(x)
    inside = _Inside(parts)
    for s in range(len(x)):
        found = lowest_modes(pencil, theta[:, s : s + 1], highest, BESIDE)
        mu = 1.0 / found.lam[0]
        gram, own, beta = inside.at(x[s], found.phi[0] * np.sqrt(mu), mu)
        total[s] = _bounds(mu, gram, float(beta.max()), inside.tapered, highest, pencil)[pick]
        room = np.maximum(mu[pick] - beta[:, None], 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = 0.5 * own[:, pick] / (room * mu[pick])
        of_links[:, s] = np.where(own[:, pick] > 0.0, share, 0.0)
    names = [link.name for link in parts.links]
    return DiscretisationError(total, dict(zip(names, of_links, strict=True)))


def _bounds(
    mu: Floats, gram: Floats, beta: float, tapered: bool, highest: int, pencil: Pencil
) -> Floats:
    """√(μ/μ̂) − 1 at most, for every mode up to ``highest``."""
    kept = len(mu)
    if kept < len(pencil.elastic) and kept > highest:  # the last stands for all above it
        kept, beta = kept - 1, max(beta, float(mu[-1]))
    values, turns = np.linalg.eigh(gram[:kept, :kept])
    R = turns * np.sqrt(np.maximum(values, 0.0))
    X = beta * np.eye(kept) + (R.T @ (R / mu[:kept, None]) if tapered else 0.0)
    top = np.linalg.eigvalsh(np.block([[np.diag(mu[:kept]), R], [R.T, X]]))[::-1][:highest]
    error = np.sqrt(np.maximum(top / mu[:highest], 1.0)) - 1.0
    return np.where((mu[:highest] > beta) & (error < REFUSED), error, np.inf)


class _Inside:
    """The elements' inner parts; those of one sample serve the next where they are the same."""

    def __init__(self, parts: MeshedLinks) -> None:
        self.parts = parts
        self.key, self.tapered = np.zeros(0), False
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
            np.add.at(own, self.parts.owners[which], (rho * answer).sum(axis=1))
            np.maximum.at(beta, self.parts.owners[which], part.beta[like])
        return 0.5 * (gram + gram.T), own, beta

    def _update(self, elements: list[Alike]) -> None:
        key = np.concatenate([np.append(each.values, each.h) for each in elements])
        if np.array_equal(key, self.key):
            return
        self.key, self.inner, self.tapered = key, [], False
        for each in elements:
            self.tapered |= each.values.shape[1] > 1
            once, like = each.different()
            for part in inner_parts(once.profile(), once.h, self.parts.space):
                self.inner.append((each.elements, like, part))
