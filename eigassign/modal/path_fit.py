"""Fits of several stretches of a path, one after the other, that answer as one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import UsageError
from eigassign.modal.fit import Fit

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PathFit:
    """One `Fit` for each stretch between corners, or for each of several trajectories."""

    parts: tuple[Fit, ...]
    rows: tuple[slice, ...]  # which of all samples are whose

    @property
    def modes(self) -> tuple[int, ...]:
        """The modes fitted."""
        return self.parts[0].modes

    @property
    def accuracy(self) -> float | None:
        """Asked for, relative in Hz; None where the solves were given."""
        return self.parts[0].accuracy

    @property
    def error_estimate(self) -> float:
        """Of frequencies anywhere in the region, relative in Hz: the largest of all parts."""
        return max(part.error_estimate for part in self.parts)

    @property
    def solves(self) -> int:
        """Poses at which the source was asked, checks included."""
        return sum(part.solves for part in self.parts)

    @property
    def reasons(self) -> tuple[str, ...]:
        """What was chosen and why, as lines of text, for each part."""
        return tuple(
            f"samples {rows.start} to {rows.stop - 1}: {line}"
            for part, rows in zip(self.parts, self.rows, strict=True)
            for line in part.reasons
        )

    def frequencies(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """(n, n_modes) in Hz. Raises UsageError outside the region."""
        x = self.parts[0].region.samples(q, y)
        hz, left = np.empty((len(x), len(self.modes))), np.ones(len(x), dtype=np.bool_)
        for part in self.parts:
            mine = left & part.region.on_path(x)
            if mine.any():
                n_q = part.region.n_q
                hz[mine] = part.frequencies(x[mine, :n_q], x[mine, n_q:])
                left &= ~mine
        if left.any():
            raise UsageError(f"q lies off the path that was fitted: sample {int(left.argmax())}")
        return hz

    def along(self, y: ArrayLike | None = None) -> Floats:
        """As `Fit.along`, at the samples of all parts in their order."""
        return np.concatenate([part.along(y) for part in self.parts], axis=-2)
