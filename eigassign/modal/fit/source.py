"""What a fit asks for frequencies: a model's exact solves, a reduced model or an expansion.

Each has an error of its own, of exact solves their round-off, which is part of the fit's estimate.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import AccuracyError, MissingMassError, UsageError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.arguments import mode_numbers, shown_numbers
from eigassign.modal.exact.solver import eigenvalues
from eigassign.modal.expansion import Expansion, InverseExpansion
from eigassign.modal.model import Model, as_model
from eigassign.modal.reduced.model import ReducedModel

Floats = NDArray[np.float64]
FINE, FINE_LARGE = 1e-8, 1e-6  # accuracies below which round-off is looked at
SHARE = 0.5  # of the accuracy that the source itself may use


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
    if isinstance(source, Model):
        wanted, last = mode_numbers((1,) if modes is None else modes), len(source.pencil.elastic)
        if wanted[-1] > last:
            raise UsageError(
                f"mode {wanted[-1]} cannot be fitted: the model has 1 to {last} elastic ones; ask "
                "for one of those, or refine its mesh"
            )
        return wanted
    own = getattr(source, "modes", None)
    wanted = mode_numbers((own or (1,)) if modes is None else modes)
    if own is not None and not set(wanted) <= set(own):
        raise UsageError(f"modes {wanted} asked for; the source has {own}")
    return wanted


def question(source: Any, modes: tuple[int, ...]) -> Callable[[Floats], Floats]:
    """x (n, n_x) → f (n, modes[-1] + 1) in Hz of all modes up to those, and of one more.

    Where that one has no mass its f is infinite. AccuracyError where the source gives no number.
    """
    if isinstance(source, Model):
        return lambda x: _solved(source.pencil, modes[-1], x)
    columns, n_q = [source.modes.index(m) for m in modes], dependence(source)[1]
    expansion = source.expansion if isinstance(source, InverseExpansion) else source
    reduced = expansion.reduced if isinstance(expansion, Expansion) else expansion
    beside = replace(reduced, modes=tuple(range(1, min(modes[-1] + 1, reduced.size) + 1)))

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
        lam = eigenvalues(pencil, x, min(last + 1, len(pencil.elastic)))
    except MissingMassError:
        lam = eigenvalues(pencil, x, last)
    missing = last + 1 - lam.shape[1]
    return np.pad(np.sqrt(lam) * (0.5 / np.pi), ((0, 0), (0, missing)), constant_values=np.inf)


def own_error(source: Any, x: Floats, modes: tuple[int, ...], accuracy: float | None) -> float:
    """The largest error that the source, no model, states at x (n, n_x); see `affordable`."""
    n_q = dependence(source)[1]
    columns = [source.modes.index(m) for m in modes]
    estimates = source.error_estimate(x[:, :n_q], x[:, n_q:])[:, columns]
    return affordable("the source itself", float(estimates.max()), accuracy)


def affordable(what: str, error: float, accuracy: float | None) -> float:
    """The error, unless it is unknown or leaves nothing of an accuracy: then AccuracyError."""
    if not error < np.inf:
        raise AccuracyError(f"{what} may cost any amount: it vouches for no number in the region")
    if accuracy is not None and error > SHARE * accuracy:
        raise AccuracyError(f"{what} may cost {error:.1e}, which leaves nothing of {accuracy:.1e}")
    return error
