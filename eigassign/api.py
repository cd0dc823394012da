"""The Python functions: a case with its model, and the functions notebooks use (docs/python.md)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from eigassign.errors import EigassignError, UsageError
from eigassign.modal import expansion as modal_expansion
from eigassign.modal import reduced as modal_reduced
from eigassign.modal.arguments import whole_within
from eigassign.modal.expansion import Expansion
from eigassign.modal.model import Model, as_model
from eigassign.modal.reduced import ReducedModel
from eigassign.output.figures.mechanism import mode_figures
from eigassign.output.reports.notebook import drawn, html
from eigassign.pipeline import queries
from eigassign.pipeline.run import Options, Result, respond, responding, solve_case
from eigassign.pipeline.stages import silent
from eigassign.pipeline.studies import Updated, update_case
from eigassign.pipeline.urdf import urdf_mapping as urdf_mapping
from eigassign.process import one_thread
from eigassign.series.multi_index import LowerSet
from eigassign.study import built_case
from eigassign.study import pictures as drawing
from eigassign.study.results import ResponseRow

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Case(built_case.BuiltCase):
    """A validated case with what is built from it, each part once and when it is asked for.

    ``model()`` is the mechanism: ``.frequencies(q, y)`` in Hz at q (n, n_q) in rad or m and y
    (n_y,) in SI units, by K φ = λ M φ, eq. (1). ``trajectory.q`` (n, n_q) at ``.time_s`` (n,) in s,
    of several trajectories one after the other; ``trajectories`` each by itself;
    ``initial_design`` y as written; ``file`` what the file says. ``plot()`` and ``plot_mode()``
    draw it. These raise CaseError, with its lines, for a mechanism that cannot be modelled or
    cannot follow its trajectory. Made by ``load_case``.
    """

    def _repr_html_(self) -> str:
        try:
            return html([repr(self)], plan=queries.picture(self))
        except EigassignError as error:
            return html([repr(self), str(error)])

    def plot(self) -> Figure:
        """The mechanism in poses along its trajectory, the first in colour.

        A matplotlib figure, which a notebook shows; ``.savefig("arm.pdf")`` keeps it. Raises
        CaseError for a mechanism that cannot be modelled or follow its trajectory.
        """
        return drawn(queries.picture(self))

    def plot_mode(
        self, mode: int = 1, q: Sequence[float] | None = None, y: Sequence[float] | None = None
    ) -> Figure:
        """The shape of the ``mode``-th elastic mode, from 1, over the mechanism at rest.

        At q (n_q,) in rad or m and y (n_y,) in SI units; without them at the expansion point or
        where the trajectory starts, and for the design as written. Raises UsageError for wrong
        lengths and for more modes than there are.
        """
        if mode < 1:
            raise UsageError(f"modes are numbered from 1, got {mode}")
        at = queries.pose_and_design(self, q, y)
        with self.located():
            pictures = drawing.draw_modes(self.file, self.model(), *at, mode)
        return drawn(mode_figures(pictures)[mode - 1])


@one_thread
def load_case(given: str | Path | Mapping[str, Any], allow_outside: bool = False) -> Case:
    """Read and validate a case file, or a mapping with the same keys and values.

    Values are numbers in SI units or text with a unit, ``0.03`` or ``"30 mm"``; arrays count as
    lists. ``allow_outside``: the case may name files that do not lie below its own folder (of a
    mapping the current one). Raises CaseError with every problem found, UsageError where there is
    no such file.
    """
    return Case(built_case.load_case(given, allow_outside).file)


@one_thread
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
    """Taylor expansion of the eigenvalues of ``modes`` about (q0, y0), eqs. (4)-(9) of the paper.

        λ(q, y) ≈ Σ_γ λ_γ (x − x0)^γ,  x = (q, y),  over all |γ| ≤ ``order``

    q0 (n_q,) in rad or m, y0 (n_y,) in SI units; ``modes`` counts elastic modes from 1.
    ``linear_in_y`` keeps the terms of at most first order in y, eq. (9); ``space`` chooses the set
    of γ itself; ``vector_order`` is how far the eigenvectors are expanded (what λ needs if None).
    ``.frequencies(q, y)`` (n, n_modes) are in Hz, ``.indices``, ``.coefficients`` are γ and λ_γ in
    rad²/s²; ``model.frequencies`` at a few places measures the error. Raises UsageError for wrong
    shapes, orders and modes.
    """
    return modal_expansion.expand(
        as_model(model).pencil, q0, y0, modes, order, linear_in_y, space, vector_order
    )


@one_thread
def reduce(
    model: Model,
    q0: ArrayLike,
    y0: ArrayLike,
    modes: Sequence[int] = (1,),
    half_order: int = 2,
) -> ReducedModel:
    """Reduced model on the Taylor vectors at one or several expansion points.

        K̂(q, y) = Vᵀ K(q, y) V,  M̂ likewise,  V = [φ_γ : |γ| ≤ ``half_order``]

    q0 (n_q,) or (n_points, n_q) in rad or m, y0 likewise in SI units; ``modes`` counts elastic
    modes from 1. ``.frequencies(q, y)`` (n, n_modes) are in Hz; how far they are off only
    ``model.frequencies`` at a few places says. Raises UsageError for impossible arguments,
    AccuracyError where no basis can be made.
    """
    half_order = whole_within(half_order, "half_order", 1, 10)
    return modal_reduced.reduce(as_model(model).pencil, q0, y0, modes, half_order)


@one_thread
def response(case: Case, **keys: Any) -> tuple[ResponseRow, ...]:
    """What ``eigassign response`` computes, nothing written: a row for each response.

    H of a node along a direction, of the design as written: ``keys`` are those of `response` in
    case files, ``at="arm.end", direction=[0, 1], lowest="40 Hz", highest="60 Hz"``; without them
    the case's own. ``.frequency_hz`` (k,), ``.stiffness`` 1/|H| (n, k) in N/m at the samples,
    ``.least_real`` (k,) in m/N, ``.modes_hz`` (n, r), ``.constants`` b·φ (n, r, m) in 1/√kg.
    Raises UsageError for wrong keys, CaseError where a coordinate is free.
    """
    given = {{"lowest": "from", "highest": "to"}.get(key, key): each for key, each in keys.items()}
    return respond(responding(case, given)).responses


@one_thread
def assign(case: Case, progress: Callable[[str], None] = silent) -> Result:
    """The whole job of ``eigassign optimize``, without writing anything.

        min over y of Σ w (f(t)/f_d(t) − 1)² / Σ w  within the bounds, limits and bands of the case

    (or its largest term: ``assignment.objective``), judged by exact eigenvalues; the paper's one
    shot, the quadratic program of eqs. (13)-(14), is where it starts or all there is of it.
    ``.design`` by name in SI units, ``.exact_hz`` (n_t,), ``.results`` with all the rest;
    ``.results.shortcoming`` says why this is no answer to build on, None if it is. ``progress`` is
    called with what the command writes on stderr: ``print``. Raises CaseError for what the case
    lacks, InfeasibleError for limits that contradict each other, AccuracyError for numbers that
    cannot be vouched for.
    """
    return solve_case(_loaded(case), Options(progress=progress))


@one_thread
def update(case: Case, progress: Callable[[str], None] = silent) -> Updated:
    """The whole job of ``eigassign update``, without writing anything.

        min over y of Σ ((f(q, y) − f_measured) / σ)²

    ``.design`` and its 95 % ``.intervals`` by name in SI units, ``.results`` with all the rest,
    ``.case`` with the values found; ``progress`` as of `assign`. Raises CaseError for what the
    case lacks and for wrong measurements.
    """
    found = update_case(_loaded(case), Options(progress=progress))
    return replace(found, case=Case(found.case.file))


def _loaded(case: object) -> built_case.BuiltCase:
    """Raises UsageError for what is none, such as the name of its file."""
    if not isinstance(case, built_case.BuiltCase):
        raise UsageError(f"expected a case, got {type(case).__name__}: ea.load_case(...) makes one")
    return case
