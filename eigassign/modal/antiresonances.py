"""Antiresonances: the frequencies at which a force on a node leaves that node at rest.

The response of a node along n to a force there along n is H = Σ (b·φ_i)²/(λ_i − λ), b·φ its motion
in mode i. Its zeros z_k are the modes of the mechanism with the node held
(`mechanism.assembly.held`), and lie between its poles: λ_k ≤ z_k ≤ λ_{k+1}. A mode that the force
does not see, b·φ_i = 0, is pole and zero at once, and leaves H as it is: such pairs, told by
z = λ, one zero for each pole, are not counted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from eigassign.arrays import Bools, Floats, Ints
from eigassign.errors import MechanismError, MissingMassError
from eigassign.modal.exact.solver import eigenvalues, exact_slopes
from eigassign.modal.model import Model

SAME = 1e-8  # relative distance in λ of a pole and a zero that are one: a hundred times round-off
EXTRA = 2  # solved beyond those asked for, at first


@dataclass(frozen=True, eq=False)
class Antiresonances:
    """Of the response of a node to a force on it, along one direction."""

    model: Model
    held: Model  # with the node held

    @classmethod
    def of(cls, model: Model, node: str, direction: Sequence[float]) -> Antiresonances:
        """Those of the node ``link.node``, the direction in axes of the ground.

        Raises MechanismError where a coordinate is free, or nothing gives way there.
        """
        return cls(model, model.holding(node, direction))

    def frequencies(self, q: ArrayLike, y: ArrayLike, count: int = 3) -> Floats:
        """The lowest ``count``, (n_samples, count) in Hz; raises MechanismError for too many."""
        return np.sqrt(self.counted(self.model.x(q, y), count)[0]) / (2.0 * np.pi)

    def counted(self, x: Floats, count: int) -> tuple[Floats, Ints]:
        """λ (n, count) of the lowest in rad²/s², and which modes of the held mechanism they are."""
        tried = count
        while True:
            tried = min(tried + EXTRA, len(self.held.pencil.elastic))
            lam, poles = _lowest(self.held, x, tried), _lowest(self.model, x, tried + 1)
            equal = np.tril(_same(lam, lam)).sum(axis=2)  # 2 of the second of two that are alike
            apart = equal > _same(lam, poles).sum(axis=2)
            there = int(apart.sum(axis=1).min())
            if there >= count:
                break
            if lam.shape[1] < tried or tried == len(self.held.pencil.elastic):
                message = f"{self.held.held} has {there} antiresonances, not {count}"
                raise MechanismError("mechanism", f"the response of {message}")
            tried *= 2
        order = np.argsort(~apart, axis=1, kind="stable")[:, :count]
        return np.take_along_axis(lam, order, axis=1), order

    def slopes(self, x: Floats, number: int, wanted: ArrayLike) -> tuple[Floats, Floats]:
        """λ (n,) of one of them, from 1, and ∂λ/∂x (n, n_x) where ``wanted`` (n_x,) is not 0."""
        lam, order = self.counted(x, number)
        own = order[:, -1]
        steep = exact_slopes(self.held.pencil, x, int(own.max()) + 1, wanted)[1]
        return lam[:, -1], steep[np.arange(len(x)), own]


def _same(a: Floats, b: Floats) -> Bools:
    """(n, j, k): whether a_j and b_k are one."""
    return np.asarray(np.abs(a[:, :, None] / b[:, None] - 1.0) <= SAME)


def _lowest(model: Model, x: Floats, count: int) -> Floats:
    """λ (n, count) of the lowest modes, fewer where no more have mass."""
    count = min(count, len(model.pencil.elastic))
    try:
        return eigenvalues(model.pencil, x, count)
    except MissingMassError as error:
        return eigenvalues(model.pencil, x, error.most)
