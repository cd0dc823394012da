"""The Python functions: a case with its model, and the functions notebooks use (docs/python.md)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from numpy.typing import ArrayLike

from eigassign.modal import expansion as modal_expansion
from eigassign.modal.expansion import Expansion
from eigassign.modal.fit.fit import Fit, PathFit, fit
from eigassign.modal.fit.region import Box
from eigassign.modal.model import Model, as_model
from eigassign.modal.reduced import compression
from eigassign.modal.reduced import reduce as modal_reduced
from eigassign.modal.reduced.model import ReducedModel
from eigassign.output import reduced_file
from eigassign.pipeline.run import Result, solve_case
from eigassign.pipeline.update import Updated, update_case
from eigassign.series.multi_index import LowerSet
from eigassign.study.built_case import Case, load_case

__all__ = [
    "Box",
    "Case",
    "Fit",
    "PathFit",
    "assign",
    "expand",
    "fit",
    "load_case",
    "load_reduced",
    "reduce",
    "save_reduced",
    "update",
]


def expand(
    model: Model,
    q0: ArrayLike,
    y0: ArrayLike,
    modes: Sequence[int] = (1,),
    order: int = 4,
    linear_in_y: bool = False,
    space: LowerSet | None = None,
    vector_order: int | None = None,
) -> Expansion:
    """Taylor expansion of the eigenvalues of ``modes`` about (q0, y0), eqs. (4)-(9).

    See :func:`eigassign.modal.expansion.expand`.
    """
    return modal_expansion.expand(
        as_model(model).pencil, q0, y0, modes, order, linear_in_y, space, vector_order
    )


def reduce(
    model: Model,
    q0: ArrayLike,
    y0: ArrayLike,
    modes: Sequence[int] = (1,),
    half_order: int = 2,
    span: tuple[ArrayLike, ArrayLike] | None = None,
    accuracy: float = compression.ACCURACY,
) -> ReducedModel:
    """Reduced model on the Taylor vectors at one or several expansion points, with its own error.

    ``span``, half-widths of q (n_q,) and y (n_y,) about the points, makes it as small as changes
    no frequency in there by more than ``accuracy`` (relative). See
    :func:`eigassign.modal.reduced.reduce.reduce`.
    """
    return modal_reduced.reduce(
        as_model(model).pencil, q0, y0, modes, half_order, span=span, accuracy=accuracy
    )


def assign(case: Case) -> Result:
    """The whole job of ``eigassign optimize``, without writing anything."""
    return solve_case(case)


def update(case: Case) -> Updated:
    """The whole job of ``eigassign update``, without writing anything.

    ``.design`` and ``.intervals`` by name, ``.results`` with all the rest, ``.case`` with the
    values found. Raises CaseError for what the case lacks and for wrong measurements.
    """
    return update_case(case)


def save_reduced(reduced: ReducedModel, path: str | Path) -> None:
    """Keep a reduced model in an HDF5 file, for use without its mechanism."""
    reduced_file.save_reduced(reduced, path)


def load_reduced(path: str | Path) -> ReducedModel:
    """Read a reduced model, checked before use; raises StorageError for a damaged file."""
    return reduced_file.load_reduced(path)
