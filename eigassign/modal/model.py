"""The model of a case: its affine pencil with names, exact frequencies and matrices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import UsageError
from eigassign.mechanism.kinematics import Kinematics
from eigassign.mechanism.local_motion import ReducedLinks
from eigassign.mechanism.pencil import Pencil
from eigassign.mechanism.poses import Poses
from eigassign.modal.exact import eigenvalues, modes
from eigassign.modal.samples import samples

if TYPE_CHECKING:
    from eigassign.modal.tracking import Tracked

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Model:
    """A mechanism as functions of its coordinates q (rad) and design parameters y (SI)."""

    pencil: Pencil
    poses: Poses
    motion: Kinematics
    q_names: tuple[str, ...]
    y_names: tuple[str, ...]
    reduced: ReducedLinks | None = None  # the links that Craig-Bampton made smaller

    @property
    def n_rigid(self) -> int:
        """Number of rigid-body modes: the free coordinates."""
        return len(self.pencil.rigid)

    @property
    def n_dof(self) -> int:
        """Order of K and M of eq. (1)."""
        return self.pencil.n_dof

    def x(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """(q, y) as rows (n_samples, n_q + n_y); raises UsageError for a wrong shape."""
        return samples(q, y, len(self.q_names), len(self.y_names))

    def frequencies(self, q: ArrayLike, y: ArrayLike, count: int = 3) -> Floats:
        """Exact frequencies of the lowest elastic modes, (n_samples, count) in Hz."""
        return np.sqrt(eigenvalues(self.pencil, self.x(q, y), count)) / (2.0 * np.pi)

    def modes(self, q: ArrayLike, y: ArrayLike, count: int = 3) -> tuple[Floats, Floats]:
        """Frequencies (n_samples, count) in Hz and mass-normalised modes (…, n_dof, count)."""
        found = modes(self.pencil, self.x(q, y), count)
        return np.sqrt(found.lam) / (2.0 * np.pi), found.phi

    def truncation_error(self, q: ArrayLike, y: ArrayLike, modes: Sequence[int] = (1,)) -> Floats:
        """By how much reduced links raise frequencies at most, relative, (n_samples, n_modes).

        Zero without reduced links; infinite where nothing can be vouched for.
        """
        x = self.x(q, y)
        if self.reduced is None:
            return np.zeros((len(x), len(modes)))
        from eigassign.modal.truncation import truncation_error

        return truncation_error(self.reduced, x, modes)

    def tracked(self, q: ArrayLike, y: ArrayLike, modes: Sequence[int] = (1,)) -> Tracked:
        """``modes`` of the first sample followed along the samples by their shapes.

        ``.frequencies`` (n_samples, n_modes) in Hz, ``.swaps``, ``.encounters`` and ``.notes``.
        """
        from eigassign.modal.tracking import track

        return track(self.pencil, self.x(q, y), modes)

    def matrices(self, q: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
        """M and K of eq. (1) for one sample, dense (n_dof, n_dof), unknowns [u; q̇].

        Raises UsageError for several samples.
        """
        x = self.x(q, y)
        if len(x) != 1:
            raise UsageError(f"matrices are for one sample of q and y, not {len(x)}")
        K, M = self.pencil.matrices(self.pencil.theta(x))
        return M[0], K[0]
