"""What is expanded, about which point and why: the case's wishes with every "auto" settled.

What a case leaves to ``auto``: elements per link, order, expansion points along the trajectory.

The accuracy asked for (``expansion.accuracy``) is shared between what is left to decide. A mesh
left to auto gets half of it, the series the rest. Where the elements are given, nothing can be
done about the mesh: the series then gets all, against exact solves of this very mesh. Reduced
links may use a quarter, of the mesh's half if it has one. Everything is decided from estimates, and
the reasons are kept as lines of text.

Where what is left to ``auto`` is judged: poses of the trajectory at designs all over the box.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.case import CaseFile
from eigassign.errors import AccuracyError, CaseError
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.adaptive.mesh import MeshChoice, choose_mesh
from eigassign.modal.adaptive.order import ExpansionChoice, choose_expansion
from eigassign.modal.adaptive.reduction import ReductionChoice, choose_reduction, few_of
from eigassign.modal.exact.clusters import CLUSTER_GAP
from eigassign.modal.model import Model

# --- What is expanded, about which point and why: the case's wishes with every "auto" settled

Floats = NDArray[np.float64]
_SHOWN = 8
_MANY = 500  # samples up to which every distance between two of them counts


@dataclass(frozen=True)
class Plan:
    """Expansion point x0 = (q0, y0), order p and modes; ``notes`` say what was chosen and why."""

    q0: Floats
    y0: Floats
    order: int
    modes: tuple[int, ...]
    notes: tuple[str, ...]
    more_q: tuple[tuple[float, ...], ...] = ()  # further expansion points along the trajectory
    cluster_gap: float = CLUSTER_GAP  # modes closer than this (relative in λ) go together


def plan_expansion(
    file: CaseFile,
    model: Model,
    trajectory: Trajectories | None,
    order: int | None = None,
    modes: Sequence[int] | None = None,
) -> Plan:
    """Settle the expansion; ``order`` and ``modes`` override the file's.

    Raises CaseError at the key at fault: lengths that differ from the model's, modes it does not
    have, an automatic expansion point without a trajectory to be central in.
    """
    q0, q_note = _q0(file, model, trajectory)
    y0, y_note = _y0(file, model)
    chosen, modes_note = _modes(file, modes)
    _check_modes(file, model, chosen)
    notes = [q_note, y_note, modes_note, *_outside(file, q0, y0, model, trajectory)]
    wanted: int | str = file.expansion.order if order is None else order
    if isinstance(wanted, int):
        return Plan(q0, y0, wanted, chosen, tuple(note for note in notes if note))
    found = choose_order(file, model, trajectory, q0, y0, chosen)
    if not np.array_equal(found.q0, q0):
        notes[0] = f"expansion point: {shown_point(model.q_names, found.q0)}, the chart's first"
    said = tuple(note for note in (*notes, *found.reasons) if note)
    return Plan(found.q0, y0, found.order, chosen, said, found.more_q, found.cluster_gap)


def _q0(file: CaseFile, model: Model, trajectory: Trajectories | None) -> tuple[Floats, str]:
    n_q, given = len(model.q_names), file.expansion.q
    if given != "auto":
        q0 = np.array(given, dtype=np.float64)
        if len(q0) != n_q:
            raise _wrong(file, "expansion.q", f"{len(q0)} values for {n_q} coordinates")
        return q0, f"expansion point: {shown_point(model.q_names, q0)}, as the case asks"
    if trajectory is None:
        if n_q == 0:
            return np.zeros(0), ""
        message = "auto needs a trajectory to be central in, and the case has none: give values"
        raise _wrong(file, "expansion.q", message)
    k = central_sample(trajectory.q @ joint_map(model).T)
    point = shown_point(model.q_names, trajectory.q[k])
    why = "the most central: its farthest other sample is nearer than any other's"
    return trajectory.q[k], f"expansion point: {point}, {trajectory.where(k)}, {why}"


def joint_map(model: Model) -> Floats:
    """From q to the relative joint coordinates on which a frequency depends, (n_s, n_q)."""
    n_q = len(model.q_names)
    return np.asarray(model.pencil.to_program[:n_q, :n_q][model.pencil.active[:n_q]])


def central_sample(points: ArrayLike) -> int:
    """The row k of ``points`` (n, d) that minimises max_l |p_k − p_l|; the first of equals."""
    rows = np.asarray(points, dtype=np.float64)
    if rows.shape[1] == 0:
        return len(rows) // 2
    others = rows[:: 1 + len(rows) // _MANY]  # a very long trajectory is seen at every n-th sample
    farthest = np.zeros(len(rows))
    for other in others:
        distance: Floats = np.square(rows - other).sum(axis=1)
        np.maximum(farthest, distance, out=farthest)
    return int(np.argmin(farthest))


def _y0(file: CaseFile, model: Model) -> tuple[Floats, str]:
    n_y, given = len(model.y_names), file.expansion.y
    if n_y == 0 and given in ("auto", ()):
        return np.zeros(0), ""
    if given != "auto":
        y0 = np.array(given, dtype=np.float64)
        if len(y0) != n_y:
            raise _wrong(file, "expansion.y", f"{len(y0)} values for {n_y} design parameters")
        return y0, f"expansion design: {shown_point(model.y_names, y0)}, as the case asks"
    y0 = np.array([0.5 * (p.min + p.max) for p in file.design.parameters.values()])
    return y0, f"expansion design: {shown_point(model.y_names, y0)}, the middle of the bounds"


def _modes(file: CaseFile, override: Sequence[int] | None) -> tuple[tuple[int, ...], str]:
    """Modes to expand; that they hold those with a target is the case file's own rule."""
    given = file.expansion.modes if override is None else override
    if given != "auto":
        return tuple(sorted({int(mode) for mode in given})), ""
    targets = sorted({target.mode for target in file.targets})
    if not targets:
        return (1,), "expanded mode: 1, the lowest, for there is no target"
    return tuple(targets), f"expanded modes: {', '.join(map(str, targets))}, those with a target"


def _check_modes(file: CaseFile, model: Model, modes: Sequence[int]) -> None:
    available = model.n_dof - model.n_rigid
    places = {t.mode: f"targets[{k}].mode" for k, t in enumerate(file.targets)}
    for mode in modes:
        if mode > available:
            where = places.get(mode, "expansion.modes")
            message = f"mode {mode} asked for; with these elements the model has 1 to {available}"
            raise _wrong(file, where, message)


def _outside(
    file: CaseFile, q0: Floats, y0: Floats, model: Model, trajectory: Trajectories | None
) -> list[str]:
    """Notes on an expansion point that lies outside what it is meant to stand for."""
    notes = [
        f"the expansion design has {name} = {value:g} outside its bounds {p.min:g} … {p.max:g}"
        for (name, p), value in zip(file.design.parameters.items(), y0, strict=True)
        if not p.min <= value <= p.max
    ]
    if trajectory is not None:
        s, s0 = trajectory.q @ joint_map(model).T, joint_map(model) @ q0
        reach = np.ptp(s, axis=0)
        if np.any((s0 < s.min(axis=0) - reach) | (s0 > s.max(axis=0) + reach)):
            notes.append("the expansion point is farther from the trajectory than that travels")
    return notes


def shown_point(names: Sequence[str], values: Floats) -> str:
    """``"q1 = 1.817, q2 = 5.312"``; of many the first."""
    shown = [f"{n} = {v:.6g}" for n, v in zip(names, values, strict=True)]
    rest = f" and {len(shown) - _SHOWN} more" if len(shown) > _SHOWN else ""
    return (", ".join(shown[:_SHOWN]) or "none") + rest


def _wrong(file: CaseFile, key_path: str, message: str) -> CaseError:
    return CaseError((file.problem(key_path, message),))


# --- What a case leaves to ``auto``: elements per link, order, expansion points along the traje

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

    Raises AccuracyError, naming the pose, where no order and number of points will do.
    """
    at_upper = corners(len(y0))
    few, many = (max(8, rows // (1 + len(at_upper))) for rows in (FEW, MANY))  # samples of each
    seen, every = (at_corners(file, trajectory, q0, y0, at_upper, each) for each in (few, many))
    require_little_truncation(file, model, seen.x)
    if len(y0):
        every = every.with_rows(at_random(file, trajectory, q0, y0, RANDOM), np.arange(RANDOM))
    accuracy, start = series_share(file), np.concatenate([q0, y0])

    def choice(seen: JudgedAt, begun: ExpansionChoice | None) -> ExpansionChoice:
        return choose_expansion(
            model.pencil,
            seen.x,
            accuracy,
            modes,
            start=start,
            place=seen.place,
            begun=begun,
        )

    found, judged = _confirmed(choice, seen, every, accuracy, file)
    first, *more = (part.q0 for part in found.expansions)
    others = tuple(tuple(float(v) for v in q) for q in more)
    reasons = (*found.reasons, *judged)
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


# --- Where what is left to ``auto`` is judged: poses of the trajectory at designs all over the

Ints = NDArray[np.intp]
ENDS = ((False,), (True,))  # all parameters at their lower bounds, all at their upper ones
SAMPLES = 40  # along the trajectory, at each design that a mesh is judged at
SEED = 20211
CLIMBERS = 8  # poses and designs from which worse designs are looked for
MASKS = (1, 2, 4, 8, 15, 7, 11, 13, 14, 3, 5, 6, 9, 10, 12)  # of the Walsh functions in 4 bits


@dataclass(frozen=True, eq=False)
class JudgedAt:
    """x (n, n_x), and which of the trajectory's samples each row is at."""

    x: Floats
    samples: Ints
    trajectory: Trajectories | None

    def place(self, row: int) -> str:
        """A row in words: the sample, whatever the design."""
        if self.trajectory is None:
            return "the expansion point"
        return self.trajectory.sample(int(self.samples[row]))

    def with_rows(self, other: JudgedAt, rows: Ints) -> JudgedAt:
        """Some rows of another one at the end."""
        x, samples = np.vstack([self.x, other.x[rows]]), other.samples[rows]
        return replace(self, x=x, samples=np.append(self.samples, samples))


def at_corners(
    file: CaseFile,
    trajectory: Trajectories | None,
    q0: Floats,
    y0: Floats,
    at_upper: ArrayLike = ENDS,
    samples: int = SAMPLES,
) -> JudgedAt:
    """At y0 and corners of the box, one for each row of ``at_upper`` (k, n_y or 1).

    At up to so many ``samples`` each.
    """
    lower, upper = _bounds(file)
    outer = np.where(np.asarray(at_upper, dtype=bool), upper, lower)
    designs = np.unique(np.vstack([y0, outer]), axis=0) if len(y0) else np.zeros((1, 0))
    picked = np.zeros(1, dtype=np.intp) if trajectory is None else trajectory.spread(samples)
    rows, which = np.tile(picked, len(designs)), np.repeat(np.arange(len(designs)), len(picked))
    return _judged(trajectory, q0, rows, designs[which])


def at_random(
    file: CaseFile, trajectory: Trajectories | None, q0: Floats, y0: Floats, count: int
) -> JudgedAt:
    """At random samples, half with designs anywhere in the box, half with corners of it."""
    lower, upper = _bounds(file)
    random = np.random.default_rng(SEED)
    share = random.random((count, len(y0)))
    share[count // 2 :] = share[count // 2 :] > 0.5
    rows = random.integers(0, 1 if trajectory is None else len(trajectory.q), count)
    return _judged(trajectory, q0, rows, lower + share * (upper - lower))


def climbed(
    seen: JudgedAt, error: Callable[[Floats], Floats], file: CaseFile
) -> tuple[JudgedAt, Floats]:
    """``seen`` and its errors (n,), with designs like those of the largest errors but worse.

    From these, parameter after parameter goes to the bound at which the error is larger, if it is.
    """
    errors = error(seen.x)
    top = np.argsort(-errors, kind="stable")[:CLIMBERS]
    lower, upper = _bounds(file)
    x, most = seen.x[top], errors[top]
    for j in range(len(lower)):
        column = x.shape[1] - len(lower) + j
        tried = np.repeat(x[None], 2, axis=0)
        tried[0, :, column], tried[1, :, column] = lower[j], upper[j]
        higher = error(tried.reshape(-1, x.shape[1])).reshape(2, -1)
        best = higher.argmax(axis=0)
        better = higher.max(axis=0) > most
        x = np.where(better[:, None], tried[best, np.arange(len(x))], x)
        most = np.maximum(most, higher.max(axis=0))
    new = replace(
        seen, x=np.vstack([seen.x, x]), samples=np.append(seen.samples, seen.samples[top])
    )
    return new, np.append(errors, most)


def _judged(trajectory: Trajectories | None, q0: Floats, rows: Ints, y: Floats) -> JudgedAt:
    q = np.repeat(q0[None], len(rows), axis=0) if trajectory is None else trajectory.q[rows]
    return JudgedAt(np.hstack([q, y]), rows, trajectory)


def _bounds(file: CaseFile) -> tuple[Floats, Floats]:
    parameters = file.design.parameters.values()
    return np.array([p.min for p in parameters]), np.array([p.max for p in parameters])


def corners(n: int) -> NDArray[np.bool_]:
    """Corners of a box in n parameters, (k, n), True at the upper bound: that is where series err.

    All of up to 16; of more the Walsh functions w_j(r) = parity of r & `MASKS`_j, r = 0…15, in
    which any two of 15 parameters take all four combinations, and all at their upper bounds.
    """
    if n <= 4:
        return np.asarray((np.arange(2**n)[:, None] >> np.arange(n)) % 2 == 1)
    shared = np.arange(16)[:, None] & np.array(MASKS)[np.arange(n) % len(MASKS)]
    walsh = np.asarray(np.bitwise_count(shared) % 2 == 1)
    return np.vstack([walsh, np.ones((1, n), dtype=bool)])
