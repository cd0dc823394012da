"""What is expanded and about which points: the case's choices, with every ``auto`` settled.

The accuracy asked for (``expansion.accuracy``) is shared: the series may use half of it, reduced
links a quarter, elements left to auto the rest. Everything is decided by finer computations, at
poses of the trajectory and designs all over their bounds; the reasons are kept as lines of text.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import reduce
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import hadamard

from eigassign.arrays import Bools, Floats, Ints
from eigassign.case.case_file import CaseFile
from eigassign.case.units import shown_point
from eigassign.errors import CaseError, EigassignError, MechanismError, TrajectoryError, UsageError
from eigassign.mechanism.kinematics.loop_closure import kronecker
from eigassign.mechanism.kinematics.parameters import initial_design
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.adaptive_order import raise_order
from eigassign.modal.exact.inertia import UNCERTAIN, count_below
from eigassign.modal.model import Model
from eigassign.modal.taylor.recursion import local_space
from eigassign.modal.under_load import buckling

# --- The expansion of a case: point, design, order and modes

MANY_SAMPLES = 500  # up to which the distance to every other sample counts for the most central


class Plan(NamedTuple):
    """Expansion point x0 = (q0, y0), order p and modes; ``notes`` say what was chosen and why."""

    q0: Floats
    y0: Floats
    order: int  # 0: none meets the accuracy, and there is no expansion
    modes: tuple[int, ...]
    notes: tuple[str, ...]
    more_q: tuple[tuple[float, ...], ...] = ()  # further expansion points along the trajectory


def plan_expansion(
    file: CaseFile,
    model: Model,
    trajectory: Trajectories | None,
    order: int | None = None,
    modes: Sequence[int] | None = None,
    needed: bool = True,
) -> Plan:
    """Settle the expansion; ``order`` and ``modes`` override the file's.

    An automatic order meets the series' share of the accuracy at exact solves between the samples
    and all over the bounds. Where one that is not ``needed`` does not, its order is 0, and a note
    says why. Raises AccuracyError, naming the pose, where one that is needed does not; CaseError at
    the key at fault: modes that the model does not have, an automatic expansion point without a
    trajectory to be central in, an order of which the memory would not suffice; UsageError for such
    an ``order``.
    """
    q0, q_note = _q0(file, model, trajectory)
    y0, y_note = _y0(file, model, q0)
    chosen, modes_note = _modes(file, modes)
    _check_modes(file, model, chosen)
    notes = tuple(filter(None, (q_note, y_note, modes_note)))
    wanted: int | str = file.expansion.order if order is None else order
    if isinstance(wanted, int):
        try:  # the linearised series is made of any order; the full one, see `pipeline.stages`
            local_space(model.pencil, wanted, True, None).space.require_affordable()
        except UsageError as error:
            raise (
                _wrong(file, "expansion.order", str(error)) if order is None else error
            ) from None
        return Plan(q0, y0, wanted, chosen, notes)
    try:
        x = unseen(file, model, trajectory, q0[None], y0)
        accuracy, most = SERIES * asked_accuracy(file), np.inf if needed else GIVEN_UP
        found = raise_order(model.pencil, x, np.append(q0, y0), accuracy, chosen, most=most)
    except EigassignError as error:  # an accuracy that is not met, or a design without a pose
        if needed:
            raise
        why = f"there is no expansion, and so no one-shot design: {error}"
        return Plan(q0, y0, 0, chosen, (*notes, why))
    more_q = tuple(tuple(part.q0.tolist()) for part in found.parts[1:])
    return Plan(q0, y0, found.order, chosen, (*notes, *found.reasons), more_q)


def _q0(file: CaseFile, model: Model, trajectory: Trajectories | None) -> tuple[Floats, str]:
    n, given = len(file.coordinates), file.expansion.q
    of_loads = ", loads in the middle of their ranges" if file.loads else ""
    if given != "auto":
        q0, why = with_middle_loads(file, given), "from the case file"
    elif trajectory is None:
        if n == 0:
            return np.zeros(0), ""
        message = "auto takes a pose of the trajectory, and the case has none: give values"
        raise _wrong(file, "expansion.q", message)
    else:
        poses = trajectory.q.copy()
        poses[:, n:] = 0.0
        k = central_sample(poses @ joint_map(model).T)
        q0 = with_middle_loads(file, trajectory.q[k, :n])
        why = f"{trajectory.where(k)}, the middle of the motion"
    point = shown_point(model.q_names, q0, file.q_units)
    return q0, f"expansion point: {point}, {why}{of_loads}"


def with_middle_loads(file: CaseFile, coordinates: ArrayLike) -> Floats:
    """q of a pose of the coordinates, each load in the middle of its values along trajectories."""
    middle = [0.5 * sum(load.range) for load in file.loads.values()]
    return np.append(np.asarray(coordinates, dtype=np.float64), middle)


def joint_map(model: Model) -> Floats:
    """The matrix from q to the joint coordinates and loads on which a frequency depends."""
    n_q = len(model.q_names)
    return np.asarray(model.pencil.to_program[:n_q, :n_q][model.pencil.active[:n_q]])


def central_sample(points: ArrayLike) -> int:
    """The row k of ``points`` (n, d) that minimises max_l |p_k − p_l|; the first of equals."""
    rows = np.asarray(points, dtype=np.float64)
    if rows.shape[1] == 0:
        return len(rows) // 2
    others = rows[:: 1 + len(rows) // MANY_SAMPLES]
    distances: Iterator[Floats] = (np.square(rows - other).sum(axis=1) for other in others)
    return int(reduce(np.maximum, distances).argmin())


def _y0(file: CaseFile, model: Model, q0: Floats) -> tuple[Floats, str]:
    n_y, given = len(model.y_names), file.expansion.y
    if n_y == 0 and given in ("auto", ()):
        return np.zeros(0), ""
    lower, upper = design_bounds(file)
    y0, why = 0.5 * (lower + upper), "the middle of the bounds"
    if given != "auto":
        y0, why = np.array(given, dtype=np.float64), "from the case file"
    elif model.pencil.weight is not None:
        try:
            model.require_standing(q0, y0)
        except MechanismError as error:
            y0, why = initial_design(file), f"the initial one, because {why} {error.message}"
    point = shown_point(model.y_names, y0, file.design_units)
    return y0, f"expansion design: {point}, {why}"


def _modes(file: CaseFile, override: Sequence[int] | None) -> tuple[tuple[int, ...], str]:
    """Modes to expand, and why these."""
    if override is not None:
        return tuple(sorted({int(mode) for mode in override})), ""
    modes = wanted_modes(file)
    shown = f"expanded modes: {', '.join(map(str, modes))}"
    if (given := file.expansion.modes) != "auto":
        more = set(modes) - set(given)
        return modes, f"{shown}, those of the file and those with a target" if more else ""
    if not target_modes(file):
        return modes, "expanded mode: 1, the lowest, because no target names a mode"
    return modes, f"{shown}, those with a target"


def _check_modes(file: CaseFile, model: Model, modes: Sequence[int]) -> None:
    available = model.n_dof - model.n_rigid
    places = {
        m: place if place.startswith("assignment") else f"{place}.mode"
        for place, each in file.asked
        for m in each.numbers
    }
    for mode in modes:
        if mode > available:
            where = places.get(mode, "expansion.modes")
            message = f"there is no mode {mode}: with these elements the model has {available}"
            raise _wrong(file, where, message)


def _wrong(file: CaseFile, key_path: str, message: str) -> CaseError:
    return CaseError((file.problem(key_path, message),))


ModesAt: TypeAlias = Callable[[Model, Floats], tuple[int, ...]]  # that matter at x (n, n_x)

# --- The accuracy asked for, shared between mesh, reduced links and series

ACCURACY = 1e-3  # where the case asks for auto and names none
SERIES = 0.5
TRUNCATION = 0.25  # where links are reduced; elements left to auto get the rest


def asked_accuracy(file: CaseFile) -> float:
    """``expansion.accuracy``: relative error in frequency."""
    return float(getattr(file.expansion, "accuracy", None) or ACCURACY)


def target_modes(file: CaseFile) -> set[int]:
    """The modes that a target names."""
    return {mode for _, target in file.asked for mode in target.numbers}


def wanted_modes(file: CaseFile) -> tuple[int, ...]:
    """The modes that matter: those with a target, those of the file, or the lowest."""
    given = file.expansion.modes
    named = target_modes(file) | ({int(m) for m in given} if given != "auto" else set())
    return tuple(sorted(named)) or (1,)


def modes_that_matter(file: CaseFile, bands_hz: Floats) -> ModesAt:
    """`wanted_modes`, and at every x the first above each of the edges ``bands_hz`` (k,)."""
    wanted = wanted_modes(file)

    def modes_at(model: Model, x: Floats) -> tuple[int, ...]:
        if not len(bands_hz):
            return wanted
        below = np.unique(count_below(model.pencil, x, bands_hz[None]))
        last = len(model.pencil.elastic)  # of a mesh too coarse for the band
        above = {min(int(k) + 1, last) for k in below if k != UNCERTAIN}  # a mode is at that edge
        return tuple(sorted({*wanted, *above}))

    return modes_at


def automatic_elements(file: CaseFile) -> dict[str, int | None]:
    """Elements of every beam link, None where they are left to auto."""
    beams = {n: getattr(link, "elements", None) for n, link in file.mechanism.links.items()}
    return {name: None if isinstance(n, str) else n for name, n in beams.items() if n is not None}


STANDS = 0.8  # of the load that buckles: nearer no mesh is fine enough


def reduced_to(file: CaseFile) -> dict[str, float | str]:
    """What links are reduced to, of those that are: a frequency in Hz, or ``auto``."""
    wanted = {n: getattr(link, "reduce_to", None) for n, link in file.mechanism.links.items()}
    return {name: f for name, f in wanted.items() if f is not None}


# --- Order and expansion points left to auto

# Coefficients of both expansions after which one that is not needed is given up: 0.1 to 0.3 s
GIVEN_UP = 20_000


def expansion_needed(file: CaseFile) -> bool:
    """True where all that is asked rests on the expansion; a sequential search does without."""
    return file.assignment.method == "one_shot" or not file.has_question


# --- Poses of the trajectory at designs all over their bounds

ENDS = ((False,), (True,))  # all parameters at their lower bounds, all at their upper ones
SAMPLES = 40  # along the trajectory, at each design that a mesh is judged at
SCATTERED = 128  # points between the samples and all over the bounds
MOST_CORNERS = 64  # of the bounds, with so many poses in all


def standing(x: Floats, model: Model) -> Floats:
    """The samples of x (n, n_x) that are `far_from_buckling`; all where none is."""
    kept = far_from_buckling(model, x)
    return x[kept] if kept.any() else x


def far_from_buckling(model: Model, x: Floats) -> Bools:
    """Mask of samples x (n, n_x) with stated weight up to `STANDS` of what buckles or falls."""
    n_q, kept = len(model.q_names), np.ones(len(x), dtype=bool)
    for k, one in enumerate(x if model.pencil.weight is not None else ()):
        try:
            model.require_standing(one[:n_q], one[n_q:])
            kept[k] = buckling(model, one[:n_q], one[n_q:])[0] <= STANDS
        except MechanismError:
            kept[k] = False
    return kept


def at_corners(
    file: CaseFile,
    trajectory: Trajectories | None,
    q0: Floats,
    y0: Floats,
    at_upper: ArrayLike = ENDS,
    samples: int | Ints = SAMPLES,
) -> Floats:
    """x (n, n_x) at y0 and corners of the bounds, a row of ``at_upper`` (k, n_y or 1) each.

    Each at these ``samples`` of the trajectory, or at up to so many.
    """
    lower, upper = design_bounds(file)
    outer = np.where(np.asarray(at_upper, dtype=bool), upper, lower)
    designs = np.unique(np.vstack([y0, outer]), axis=0) if len(y0) else np.zeros((1, 0))
    rows = np.zeros(1, dtype=np.intp)
    if trajectory is not None:
        rows = trajectory.spread(samples) if isinstance(samples, int) else samples
    q = [q0[None] if trajectory is None else poses_at(trajectory, y)[rows] for y in designs]
    return np.hstack([np.concatenate(q), np.repeat(designs, len(rows), axis=0)])


def unseen(
    file: CaseFile,
    model: Model,
    trajectory: Trajectories | None,
    about: Floats,
    y0: Floats,
    first: int = 1,
) -> Floats:
    """x (n, n_x) where answers about poses ``about`` (k, n_q) and y0 are judged: never there.

    At corners of the bounds, at the poses that are farthest from these, and `scattered`.
    """
    at_upper = corners(len(y0), MOST_CORNERS)
    at_upper = np.vstack([at_upper[: MOST_CORNERS - 1], at_upper[MOST_CORNERS - 1 :][-1:]])
    rows = np.zeros(1, dtype=np.intp)
    if trajectory is not None:
        S = joint_map(model)
        rows = farthest(trajectory.q @ S.T, about @ S.T, MOST_CORNERS // len(at_upper))
    outer = at_corners(file, trajectory, about[0], y0, at_upper, rows)
    return np.vstack([outer, scattered(file, trajectory, about[0], SCATTERED, first)])


def nearest_rows(rows: Floats, values: Floats) -> Ints:
    """Of rows (n, k) the nearest (...) to values (..., k), in shares of the columns' ranges."""
    width = np.ptp(rows, axis=0)
    away = (rows - values[..., None, :]) / np.where(width > 0.0, width, 1.0)
    return np.asarray(np.linalg.norm(away, axis=-1).argmin(axis=-1))


def as_listed(file: CaseFile, x: Floats) -> Floats:
    """x (n, n_x) with the nearest listed values: what is not listed may be no mechanism."""
    x, n_y = x.copy(), len(file.design.parameters)
    for own in file.design.catalogues:
        rows, columns = np.array(own.rows), np.array(own.columns) - n_y
        x[:, columns] = rows[nearest_rows(rows, x[:, columns])]
    return x


def farthest(points: Floats, about: Floats, count: int) -> Ints:
    """Rows of ``points`` (n, d): each is the farthest from ``about`` (k, d) and those before it."""
    width = np.ptp(points, axis=0)
    width = np.where(width > 0.0, width, 1.0)
    away = np.min([np.square((points - each) / width).sum(axis=1) for each in about], axis=0)
    rows: list[int] = []
    while len(rows) < min(count, len(points)):
        rows.append(int(np.argmax(away)))
        beside = np.square((points - points[rows[-1]]) / width).sum(axis=1)
        away = np.minimum(away, beside)
    return np.array(rows, dtype=np.intp)


def scattered(
    file: CaseFile, trajectory: Trajectories | None, q0: Floats, count: int, first: int = 1
) -> Floats:
    """Points ``first``, … of a fixed sequence (`kronecker`) between samples and within the bounds.

    x (count, n_x). SciPy's sequences would do as well, at half a second for their import.
    """
    lower, upper = design_bounds(file)
    u = kronecker(first + count, 1 + len(lower))[first:]
    y = lower + u[:, 1:] * (upper - lower)
    if trajectory is None:
        return np.hstack([np.tile(q0, (count, 1)), y])
    own = (range(r.start, max(r.stop - 1, r.start + 1)) for r in trajectory.rows)
    starts = np.concatenate([*own])
    k, share = np.divmod(u[:, 0] * len(starts), 1.0)
    start, q = starts[k.astype(int)], trajectory.q
    lasts = np.array([r.stop - 1 for r in trajectory.rows])
    end = np.minimum(start + 1, lasts[np.searchsorted(lasts, start)])
    between = q[start] + share[:, None] * (q[end] - q[start])
    return np.hstack([between, y])


def poses_at(trajectory: Trajectories, y: Floats) -> Floats:
    """q (n, n_q) at design y; at the initial one where y cannot follow the path of its tip."""
    try:
        return trajectory.at(y)[0]
    except TrajectoryError:
        return trajectory.q


def design_bounds(file: CaseFile) -> tuple[Floats, Floats]:
    """The least and greatest y, (n_y,) each, in SI units."""
    parameters = file.design.parameters.values()
    return np.array([p.min for p in parameters]), np.array([p.max for p in parameters])


def corners(n: int, most: int = 16) -> Bools:
    """Corners of a box in n parameters, (k, n), True at the upper bound: that is where series err.

    All of up to ``most``, 16 or 64. Of more, columns 15, 14, … 1 of the Hadamard matrix of order
    16, in which any two of 15 parameters take all four combinations and any three of the first
    eight all eight; and all parameters at their upper bounds. With 64 likewise.
    """
    if 2**n <= most:
        return np.asarray((np.arange(2**n)[:, None] >> np.arange(n)) % 2 == 1)
    upper = hadamard(most)[:, most - 1 - np.arange(n) % (most - 1)] < 0
    return np.vstack([upper, np.ones((1, n), dtype=bool)])
