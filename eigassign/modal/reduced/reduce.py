"""Building the reduced model: basis, projection, and where a region is given its compression."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import AccuracyError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.arguments import mode_numbers, samples, whole_within
from eigassign.modal.projection import project
from eigassign.modal.reduced.basis import RitzBasis, ritz_basis, widened
from eigassign.modal.reduced.compression import ACCURACY, compressed, half_widths
from eigassign.modal.reduced.error_estimate import error_terms
from eigassign.modal.reduced.model import ReducedModel

Floats = NDArray[np.float64]


def reduce(
    pencil: Pencil,
    q0: ArrayLike,
    y0: ArrayLike,
    modes: Sequence[int] = (1,),
    half_order: int = 2,
    guard: bool = True,
    given: Floats | None = None,
    span: tuple[ArrayLike, ArrayLike] | None = None,
    accuracy: float = ACCURACY,
) -> ReducedModel:
    """Reduced model from the Taylor vectors of ``modes`` to order m at one or several points.

    q0 (n_q,) or (n_points, n_q), y0 likewise. ``guard=False`` leaves out all vectors but those of
    ``modes`` and the modes below them as they are: smaller, but its estimate refuses far sooner.
    ``given`` are Taylor vectors (n_dof, N) of ``modes`` at the one point that are known already.
    ``span``, half-widths (n_q,) and (n_y,) of boxes around the points, keeps of the basis only what
    moves a frequency by more than ``accuracy`` (relative) in them: see `compression`.
    Raises UsageError for impossible arguments, AccuracyError where no basis can be made.
    """
    wanted = mode_numbers(modes)
    half_order = whole_within(half_order, "half_order", 0, 10)
    n_y = pencil.to_program.shape[1] - pencil.n_q
    points = samples(q0, y0, pencil.n_q, n_y)
    widths = None if span is None else half_widths(span, pencil.n_q, n_y, accuracy)
    basis = ritz_basis(pencil, points, wanted, half_order, guard, given)
    whole = _projected(basis, half_order, guard)
    return whole if widths is None else compressed(basis, whole, widths, accuracy)


def _projected(basis: RitzBasis, half_order: int, widen: bool) -> ReducedModel:
    """The pencil on the basis; what only the error estimate needs waits until it is asked for.

    ``widen`` where refused answers are compared with a wider model.
    """
    pencil, k = basis.pencil, basis.V.shape[1]
    # Terms are large and cancel, so their round-off counts: the mean with their transposes.
    stiffness, mass = (0.5 * (A + A.transpose(0, 2, 1)) for A in project(pencil, basis.wide))
    k_terms, m_terms = (np.flatnonzero(np.diff(w.indptr)) for w in pencil.by_term)
    return ReducedModel(
        modes=basis.modes,
        n_q=pencil.n_q,
        n_loads=pencil.n_loads,
        n_y=basis.points.shape[1] - pencil.n_q,
        half_order=half_order,
        points=basis.points,
        program=pencil.program,
        to_program=pencil.to_program,
        shift=pencil.shift,
        stiffness_terms=k_terms,
        stiffness=stiffness[k_terms, :k, :k],
        mass_terms=m_terms,
        mass=mass[m_terms],
        certified=partial(error_terms, basis),
        widened=partial(_wider, basis, half_order) if widen else None,
    )


def _wider(basis: RitzBasis, half_order: int) -> ReducedModel | None:
    """The model on a widened basis; None where there is none."""
    try:
        more = widened(basis)
    except AccuracyError:
        return None
    return None if more is None else _projected(more, half_order, False)
