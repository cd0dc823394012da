"""What a fit asks for frequencies: a model's exact solves, a reduced model or an expansion.

Each has an error of its own, of exact solves their round-off, which is part of the fit's estimate.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import AccuracyError, MissingMassError, UsageError
from eigassign.interpolation.newton import Interpolant
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.arguments import mode_numbers, shown_numbers
from eigassign.modal.exact.roundoff import rounding_error
from eigassign.modal.exact.solver import eigenvalues
from eigassign.modal.expansion import Expansion, InverseExpansion
from eigassign.modal.fit.region import Region
from eigassign.modal.model import Model, as_model
from eigassign.modal.reduced.model import ReducedModel

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
HZ = 0.5 / np.pi  # in a rad/s
FINE, FINE_LARGE = 1e-8, 1e-6  # accuracies below which round-off is looked at
SHARE = 0.5  # of the accuracy that the source itself may use
FEW_AXES = 3  # up to which all corners are looked at


def own_error(
    source: Any, region: Region, modes: tuple[int, ...], found: Interpolant, floor: float
) -> float:
    """The floor, or round-off where that was not looked at and may matter beside the error."""
    if floor or not isinstance(source, Model) or found.error >= fine(source):
        return floor
    return rounding_error(source.pencil, region.centre, modes[-1])


def fine(model: Model) -> float:
    """Accuracy below which the round-off of exact solves is looked at."""
    return FINE if model.pencil.is_dense else FINE_LARGE


def dependence(source: Any) -> tuple[Floats, int]:
    """Combinations of x on which the source's frequencies depend (n_w, n_x), and n_q."""
    if isinstance(source, Model):
        return source.pencil.local_directions[1], source.pencil.n_q
    if isinstance(source, InverseExpansion):
        source = source.expansion
    if isinstance(source, Expansion):
        return source.directions, len(source.q0)
    if not isinstance(source, ReducedModel):
        as_model(source)
    return source.to_program[source.program.dependence.any(axis=0)], source.n_q


def modes_of(source: Any, modes: Sequence[int] | None) -> tuple[int, ...]:
    """The modes to fit. Raises UsageError for one that the source does not have."""
    own = getattr(source, "modes", None) if not isinstance(source, Model) else None
    wanted = mode_numbers((own or (1,)) if modes is None else modes)
    if own is not None and not set(wanted) <= set(own):
        raise UsageError(f"modes {wanted} asked for; the source has {own}")
    return wanted


def question(source: Any, modes: tuple[int, ...]) -> Callable[[Floats], Floats]:
    """x (n, n_x) → f (n, modes[-1] + 1) in Hz of all modes up to those, and of one more.

    Where that one has no mass its f is infinite. AccuracyError where the source gives no number.
    """
    if isinstance(source, Model):
        return partial(_solved, source.pencil, modes[-1])
    columns, n_q = [source.modes.index(m) for m in modes], dependence(source)[1]
    beside = _ritz(source, modes[-1] + 1)

    def ask(x: Floats) -> Floats:
        q, y = x[:, :n_q], x[:, n_q:]
        hz = np.asarray(source.frequencies(q, y))[:, columns]
        if not np.isfinite(hz).all():
            k = int(np.argmin(np.isfinite(hz).all(axis=1)))
            raise AccuracyError(f"the source has no frequency at (q, y) = {shown_numbers(x[k])}")
        every = np.asarray(beside.frequencies(q, y))
        every[:, [m - 1 for m in modes]] = hz
        return every

    return ask


def _solved(pencil: Pencil, last: int, x: Floats) -> Floats:
    """Exact f (n, last + 1) in Hz."""
    try:
        count = min(last + 1, len(pencil.elastic))
        hz = np.sqrt(eigenvalues(pencil, x, count)) * HZ
    except MissingMassError:
        hz = np.sqrt(eigenvalues(pencil, x, last)) * HZ
    if hz.shape[1] > last:
        return hz
    return np.hstack([hz, np.full((len(x), 1), np.inf)])


def _ritz(source: Any, count: int) -> ReducedModel:
    """All modes up to ``count`` as a reduced model has them, that of an expansion beside it."""
    if isinstance(source, InverseExpansion):
        source = source.expansion
    reduced: ReducedModel = source.reduced if isinstance(source, Expansion) else source
    return replace(reduced, modes=tuple(range(1, min(count, reduced.size) + 1)))


def floor_of(source: Any, region: Region, modes: tuple[int, ...], accuracy: float | None) -> float:
    """Relative error in Hz of what the source answers, at the region's ends and centre.

    Of exact solves this is round-off, looked at only where it may matter. Raises AccuracyError
    where it leaves nothing of the accuracy asked for.
    """
    if isinstance(source, Model):
        if accuracy is None or accuracy >= fine(source):
            return 0.0
        floor = rounding_error(source.pencil, region.centre, modes[-1])
    else:
        return known_error(source, region.x(_ends(region)), modes, accuracy)
    return _affordable("round-off", floor, accuracy)


def known_error(source: Any, x: Floats, modes: tuple[int, ...], accuracy: float | None) -> float:
    """The largest of the source's own error estimates at x (n, n_x); see `_affordable`."""
    n_q = dependence(source)[1]
    columns = [source.modes.index(m) for m in modes]
    estimates = source.error_estimate(x[:, :n_q], x[:, n_q:])[:, columns]
    return _affordable("the source itself", float(estimates.max()), accuracy)


def _affordable(what: str, error: float, accuracy: float | None) -> float:
    """The error, unless it is unknown or leaves nothing of an accuracy: then AccuracyError."""
    if not error < np.inf:
        raise AccuracyError(f"{what} may cost any amount: it vouches for no number in the region")
    if accuracy is not None and error > SHARE * accuracy:
        raise AccuracyError(f"{what} may cost {error:.1e}, which leaves nothing of {accuracy:.1e}")
    return error


def _ends(region: Region) -> Ints:
    """Multi-indices of the centre and both ends of each axis: in all combinations, if few."""
    d = region.d
    if d <= FEW_AXES:
        signs = np.array(list(itertools.product((1, 2), repeat=d)))
    else:
        signs = 1 + np.vstack([np.zeros((1, d)), np.eye(d), 1 - np.eye(d), np.ones((1, d))])
    tops = [len(axis.nodes) - 1 for axis in region.axes]
    return np.asarray(np.minimum(np.vstack([np.zeros((1, d)), signs]), tops), dtype=np.intp)
