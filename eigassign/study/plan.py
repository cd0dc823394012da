"""What is expanded, about which point and why: the case's wishes with every "auto" settled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.case import CaseFile
from eigassign.errors import CaseError
from eigassign.mechanism.trajectories import Trajectories
from eigassign.modal.clusters import CLUSTER_GAP
from eigassign.modal.model import Model
from eigassign.study.choices import choose_order

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
