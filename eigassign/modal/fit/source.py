"""What a fit asks for frequencies: a model's exact solves, a reduced model or an expansion.

Each has an error of its own, of exact solves their round-off, which is part of the fit's estimate.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import AccuracyError, MissingMassError, UsageError
from eigassign.modal.arguments import mode_numbers, shown_numbers
from eigassign.modal.exact.roundoff import rounding_error
from eigassign.modal.exact.solver import eigenvalues
from eigassign.modal.expansion import Expansion
from eigassign.modal.model import Model, as_model
from eigassign.modal.reduced.model import ReducedModel

Floats = NDArray[np.float64]
FINE, FINE_LARGE = 1e-8, 1e-6  # accuracies below which round-off is looked at
SHARE = 0.5  # of the accuracy that the source itself may use


@dataclass(frozen=True, eq=False)
class FitSource:
    """Frequencies of ``modes``, and how far they are off, as functions of x = (q, y).

    ``ask`` gives f (n, modes[-1] + 1) in Hz at x (n, n_x), of all modes up to those and of one
    more, infinite where that one has no mass; ``error`` the largest relative error there.
    """

    modes: tuple[int, ...]
    directions: Floats  # (n_w, n_x): the combinations of x on which anything depends
    n_q: int
    ask: Callable[[Floats], Floats]
    error: Callable[[Floats], float]
    fine: float | None = None  # of exact solves: the accuracy below which their error matters

    def own_error(self, x: Floats, accuracy: float | None) -> float:
        """The error; AccuracyError where it is unknown or leaves nothing of an accuracy."""
        what, error = "round-off" if self.fine else "what is fitted", self.error(x)
        if not error < np.inf:
            raise AccuracyError(f"the error of {what} is not known in the region")
        if accuracy is not None and error > SHARE * accuracy:
            raise AccuracyError(f"{what} leaves an error of {error:.1e}, above {accuracy:.1e}")
        return error


def as_source(given: Any, modes: Sequence[int] | None) -> FitSource:
    """What is asked for ``modes``, which are all of the source, of a model the first, unless given.

    Raises UsageError for a mode that it does not have, and for what is no source.
    """
    if isinstance(given, Expansion | ReducedModel):
        return _stated(given, modes)
    return _exact(as_model(given), modes)


def _exact(model: Model, modes: Sequence[int] | None) -> FitSource:
    pencil, wanted = model.pencil, mode_numbers((1,) if modes is None else modes)
    last, most = wanted[-1], len(pencil.elastic)
    if last > most:
        raise UsageError(
            f"mode {last} cannot be fitted: the model has 1 to {most} elastic ones; ask "
            "for one of those, or refine its mesh"
        )

    def ask(x: Floats) -> Floats:
        try:
            lam = eigenvalues(pencil, x, min(last + 1, most))
        except MissingMassError:
            lam = eigenvalues(pencil, x, last)
        missing = ((0, 0), (0, last + 1 - lam.shape[1]))
        return np.pad(np.sqrt(lam) * (0.5 / np.pi), missing, constant_values=np.inf)

    def error(x: Floats) -> float:
        return rounding_error(pencil, x[0], last)

    fine = FINE if pencil.is_dense else FINE_LARGE
    return FitSource(wanted, pencil.local_directions[1], pencil.n_q, ask, error, fine)


def _stated(given: Expansion | ReducedModel, modes: Sequence[int] | None) -> FitSource:
    """A source that states its error; neighbours of its modes are those of the reduced model."""
    wanted = mode_numbers(given.modes if modes is None else modes)
    if not set(wanted) <= set(given.modes):
        raise UsageError(f"modes {wanted} asked for; the source has {given.modes}")
    reduced = given.reduced if isinstance(given, Expansion) else given
    every = tuple(range(1, min(wanted[-1] + 1, reduced.size) + 1))
    beside, n_q = replace(reduced, modes=every), reduced.n_q
    columns, own = [given.modes.index(m) for m in wanted], [m - 1 for m in wanted]

    def ask(x: Floats) -> Floats:
        q, y = x[:, :n_q], x[:, n_q:]
        hz, all_hz = given.frequencies(q, y)[:, columns], beside.frequencies(q, y)
        if not np.isfinite(hz).all():
            k = int(np.argmin(np.isfinite(hz).all(axis=1)))
            raise AccuracyError(f"the source has no frequency at (q, y) = {shown_numbers(x[k])}")
        all_hz[:, own] = hz
        return all_hz

    def error(x: Floats) -> float:
        return float(given.error_estimate(x[:, :n_q], x[:, n_q:])[:, columns].max())

    directions = reduced.to_program[reduced.program.dependence.any(axis=0)]
    return FitSource(wanted, directions, n_q, ask, error)
