"""What a case leaves to ``auto``: elements per link, order, expansion points along the trajectory.

The accuracy asked for (``expansion.accuracy``) is shared between what is left to decide. A mesh
left to auto gets half of it, the series the rest. Where the elements are given, nothing can be
done about the mesh: the series then gets all, against exact solves of this very mesh. Reduced
links may use a quarter, of the mesh's half if it has one. Everything is decided from estimates, and
the reasons are kept as lines of text.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from eigassign.case import CaseFile
from eigassign.errors import AccuracyError
from eigassign.mechanism.trajectories import Trajectories
from eigassign.modal.expansion_choice import ExpansionChoice, choose_expansion
from eigassign.modal.mesh_choice import MeshChoice, choose_mesh
from eigassign.modal.model import Model
from eigassign.modal.reduction_choice import ReductionChoice, choose_reduction, few_of
from eigassign.study.chart_follow import suggestions
from eigassign.study.judged_at import JudgedAt, at_corners, at_random, climbed, corners

Floats = NDArray[np.float64]
ACCURACY = 1e-3  # where the case asks for auto and names none
MESH = 0.5  # where a number of elements is left to auto
TRUNCATION = 0.25  # where links are reduced, of the mesh's share if it has one
FEW, MANY = 200, 1000  # poses and designs that an order is chosen at, and confirmed at
RANDOM = 600  # of those that it is confirmed at, beside corners of the box
ADDED = 60  # of the worst of these that are added where it is not


@dataclass(frozen=True)
class OrderChoice:
    """Order, expansion points q and which modes go together, with the reasons."""

    order: int
    q0: Floats  # (n_q,)
    more_q: tuple[tuple[float, ...], ...]
    cluster_gap: float  # relative, in λ
    reasons: tuple[str, ...]


def _highest(found: ExpansionChoice, x: Floats) -> Floats:
    """The largest estimate of all modes at x (n, n_x)."""
    n_q = len(found.expansions[0].q0)
    return np.asarray(found.error_estimate(x[:, :n_q], x[:, n_q:]).max(axis=1))


def asked_accuracy(file: CaseFile) -> float:
    """``expansion.accuracy``: relative error in frequency."""
    return float(getattr(file.expansion, "accuracy", None) or ACCURACY)


def wanted_modes(file: CaseFile) -> tuple[int, ...]:
    """The modes that matter: those with a target, or expanded, or the lowest."""
    given = file.expansion.modes
    if given != "auto":
        return tuple(sorted({int(mode) for mode in given}))
    return tuple(sorted({target.mode for target in file.targets})) or (1,)


def automatic_elements(file: CaseFile) -> dict[str, int | None]:
    """Elements of every beam link, None where they are left to auto."""
    beams = {n: getattr(link, "elements", None) for n, link in file.mechanism.links.items()}
    return {name: None if isinstance(n, str) else n for name, n in beams.items() if n is not None}


def settle_mesh(
    file: CaseFile, build: Callable[[Mapping[str, int]], Model], x: Floats
) -> MeshChoice:
    """The fewest elements that leave the mesh's share of the accuracy at the poses x (n, n_x).

    Raises AccuracyError where no mesh will do.
    """
    accuracy = mesh_share(file) - truncation_share(file)
    return choose_mesh(build, automatic_elements(file), x, accuracy, wanted_modes(file))


def mesh_share(file: CaseFile) -> float:
    """The part of the accuracy asked for that the mesh may use; 0 where it is given."""
    return MESH * asked_accuracy(file) if None in automatic_elements(file).values() else 0.0


def series_share(file: CaseFile) -> float:
    """The part of the accuracy asked for that is left to the series."""
    return asked_accuracy(file) - max(mesh_share(file), truncation_share(file))


def automatic_reduction(file: CaseFile) -> tuple[str, ...]:
    """The links with ``reduce_to: auto``."""
    return tuple(n for n, f in _reduced_to(file).items() if isinstance(f, str))


def _reduced_to(file: CaseFile) -> dict[str, float | str]:
    wanted = {n: getattr(link, "reduce_to", None) for n, link in file.mechanism.links.items()}
    return {name: f for name, f in wanted.items() if f is not None}


def truncation_share(file: CaseFile) -> float:
    """The part of the accuracy asked for that reduced links may use; 0 without any."""
    return TRUNCATION * asked_accuracy(file) if _reduced_to(file) else 0.0


def settle_reduction(
    file: CaseFile,
    names: tuple[str, ...],
    build: Callable[[float | None], Model],
    look: Callable[[Model], Floats],
) -> ReductionChoice:
    """The lowest frequency to which links may be reduced at the poses looked at, if it pays."""
    return choose_reduction(names, build, look, truncation_share(file), wanted_modes(file))


def require_little_truncation(file: CaseFile, model: Model, x: Floats) -> None:
    """Raise AccuracyError where reduced links use more of the accuracy than their share."""
    share, modes = truncation_share(file), wanted_modes(file)
    if model.reduced is None:
        return
    few, n_q = few_of(x), len(model.q_names)
    worst = model.truncation_error(few[:, :n_q], few[:, n_q:], modes).max()
    if worst > share:
        stated = f"{worst:.1e}" if np.isfinite(worst) else "an error that cannot be bounded"
        raise AccuracyError(
            f"the reduced links leave {stated}, of the {asked_accuracy(file):.1e} asked for "
            f"{share:.1e} is theirs: raise reduce_to, or write reduce_to: auto"
        )


def choose_order(
    file: CaseFile,
    model: Model,
    trajectory: Trajectories | None,
    q0: Floats,
    y0: Floats,
    modes: tuple[int, ...],
) -> OrderChoice:
    """The lowest order, with further points only where one cannot do, from error estimates.

    With ``expansion.chart`` the quickest expansion of that chart comes first, if the estimate
    bears it out. Raises AccuracyError, naming the pose, where no order and number of points will
    do, and CaseError where the chart cannot be read.
    """
    at_upper = corners(len(y0))
    few, many = (max(8, rows // (1 + len(at_upper))) for rows in (FEW, MANY))  # samples of each
    seen, every = (at_corners(file, trajectory, q0, y0, at_upper, each) for each in (few, many))
    require_little_truncation(file, model, seen.x)
    if len(y0):
        every = every.with_rows(at_random(file, trajectory, q0, y0, RANDOM), np.arange(RANDOM))
    accuracy, start = series_share(file), np.concatenate([q0, y0])
    followed, said = suggestions(file, q0, y0, modes, accuracy)

    def choice(seen: JudgedAt, begun: ExpansionChoice | None) -> ExpansionChoice:
        return choose_expansion(
            model.pencil, seen.x, accuracy, modes,
            start=start, place=seen.place, suggestions=followed, begun=begun,
        )  # fmt: skip

    found, judged = _confirmed(choice, seen, every, accuracy, file)
    first, *more = (part.q0 for part in found.expansions)
    others = tuple(tuple(float(v) for v in q) for q in more)
    reasons = (*said, *found.reasons, *judged)
    return OrderChoice(found.order, first, others, found.cluster_gap, reasons)


def _confirmed(
    choice: Callable[[JudgedAt, ExpansionChoice | None], ExpansionChoice],
    seen: JudgedAt,
    every: JudgedAt,
    accuracy: float,
    file: CaseFile,
) -> tuple[ExpansionChoice, tuple[str, ...]]:
    """The choice for ``seen`` that holds for ``every``, and what was found there.

    Where it does not, the worst of these are seen too, and at last all of them.
    """
    found = choice(seen, None)
    said: list[str] = []
    for last in (False, False, True):
        every, error = climbed(every, partial(_highest, found), file)
        what = f"at {len(error)} poses and designs in all: error at most {error.max():.1e}"
        beyond = np.flatnonzero(~(error <= accuracy))
        if not len(beyond):
            return found, (*said, what)
        said.append(f"{what}, chosen anew")
        worst = beyond[np.argsort(-error[beyond], kind="stable")[:ADDED]]
        seen = seen.with_rows(every, np.arange(len(error)) if last else worst)
        found = choice(seen, found)
    return found, tuple(said)
