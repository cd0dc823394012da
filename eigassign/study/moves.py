"""What a move leaves: the error of the tip over time, residuals by motion time, input shapers.

Shapers are designed for the modes that the move excites, each over the range of frequency that it
passes, ± 5 %, as what the model does not know. What a shaper leaves is integrated along the path as
the command that it shapes goes, whose modes change with the pose.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.requirements.quantity import LimitedQuantity
from eigassign.assignment.requirements.residual import Residual
from eigassign.errors import UsageError
from eigassign.mechanism.trajectory.motion import Motion, Moving, known_motion, sampled_motion
from eigassign.mechanism.trajectory.trajectory import Trajectory
from eigassign.modal import shapers as input_shapers
from eigassign.modal.residual_vibration import FINER, Move, ReducedMove
from eigassign.study.results import MoveRow, ShaperRow
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
TIMES = 301  # motion times that residuals are drawn at
SPAN = 0.5, 2.0  # times the motion time, where the design has no bounds of it
NAMES = "zv", "zvd", "mzv", "ei", "3hump_ei"
SPREAD = 0.05  # of frequencies, that shapers allow for
MOST = 2  # modes that one shaper each is made for
FINE = 800  # instants of a shaped command, beside its corners
BESIDE = 1e-9  # of a move: sides of a corner
CHANGES = 0.02  # of a frequency along the path: one number for it is little to say
AFTER = 6.0  # periods of the slowest mode that are shown after the stop


def study_moves(scene: Scene, y: Floats) -> Iterator[MoveRow]:
    """Each limit of residual vibration, of design y (n_y,) beside the initial one."""
    for one in scene.residuals:
        yield _row(scene, one, y)


def _row(scene: Scene, limit: LimitedQuantity, y: Floats) -> MoveRow:
    own: Residual = limit.quantity
    T, before = own.duration(y), own.duration(scene.initial)
    low, high = SPAN[0] * min(T, before), SPAN[1] * max(T, before)
    if own.column is not None:
        low, high = (float(end[own.column]) for end in scene.bounds)
    times, at = np.linspace(low, high, TIMES), np.array([T])
    k = int(np.argmax([one.residuals(at)[0, 0] for one in own.solved(y)]))  # the worst damping
    move, solved = own.moves[k], own.solved(y)[k]
    time_s, error = _trace(solved, T)
    modes = _modes(solved, T)
    made = [*_made(modes)]
    rows = [_shaped(move, one, y, T) for one in made]
    lines = [line for one, row in zip(made, rows, strict=True) for line in _lines(one, row)]
    command = _along(move, modes, y, T)
    if command is not None:
        rows.append(_over_time(move, modes[0], y, T, *command))
    rows.sort(key=lambda row: row.delay)
    return MoveRow(
        name=limit.noun,
        unit=limit.unit,
        duration=T,
        residual=float(own.along(y, at)[0]),
        before=float(own.along(scene.initial, np.array([before]))[0]),
        limit=limit.allowed[1],
        confirmed=float(own.along(y, at, FINER)[0]),
        shapers=tuple(rows),
        time_s=time_s,
        error=error,
        times=times,
        lobes=own.along(y, times),
        lobes_before=own.along(scene.initial, times),
        command=command,
        lines="\n".join(lines),
        impulses=tuple((one.name, one.amplitudes, one.times_s) for one in made),
    )


def _trace(solved: ReducedMove, T: float) -> tuple[Floats, Floats]:
    """Times (n,) and how far the node is from where it should be, during the move and after it."""
    at = np.array([T])
    (tau, during), free = solved.errors(at), solved.free(at)
    slowest = min(np.abs(free.s[free.seen()]), default=2.0 * np.pi / T)
    after = np.linspace(0.0, AFTER * 2.0 * np.pi / slowest, FINE)
    ways = np.vstack([during[0], free.at(after)[0].T])
    time_s = np.concatenate([T * tau, T + after])
    return time_s, ways[:, 0] if ways.shape[1] == 1 else np.linalg.norm(ways, axis=1)


def _modes(solved: ReducedMove, T: float) -> tuple[input_shapers.ModeOnPath, ...]:
    """The modes that the move excites, by the largest that they leave of times about T."""
    free = solved.free(T * np.linspace(0.8, 1.25, 60))
    weights = np.abs(free.Z).max(axis=0) * np.linalg.norm(free.tip, axis=0)
    if not weights.any():
        return ()
    found = input_shapers.excited_modes(solved.omega / (2.0 * np.pi), solved.zeta, weights)
    return tuple(sorted(found, key=lambda mode: -float(mode.weight.max()))[:MOST])


def _made(modes: tuple[input_shapers.ModeOnPath, ...]) -> Iterator[input_shapers.Shaper]:
    if modes:
        most = max(float(mode.zeta.max()) for mode in modes)
        names = [name for name in NAMES if most < input_shapers.SHAPERS[name]]
        yield from (design.shaper for design in input_shapers.best_designs(modes, names, SPREAD))


def _shaped(move: Move, shaper: input_shapers.Shaper, y: Floats, T: float) -> ShaperRow:
    """What a shaper leaves of the move, integrated along its own command."""
    motion, first = move.trajectory.motion, float(move.trajectory.time_s[0])
    stretch = float(np.ptp(move.trajectory.time_s)) / T

    def command(t: Floats) -> Moving:
        found = motion.moving(first + stretch * np.asarray(t), y)
        return Moving(found.q, stretch * found.rate, stretch**2 * found.acceleration)

    whole, total = input_shapers.shaped(shaper, command, T)
    corners = [0.0, T, *((np.asarray(motion.breaks_s) - first) / stretch)]
    every = np.unique(np.round(np.add.outer(shaper.times_s, corners).ravel(), 12))
    inner = every[(every > 0.0) & (every < total)]
    times = np.sort(np.concatenate([np.linspace(0.0, total, FINE), inner, inner]))
    sides = np.where(np.diff(times, prepend=-1.0) == 0.0, BESIDE, 0.0) * total
    sides -= np.where(np.diff(times, append=total + 1.0) == 0.0, BESIDE, 0.0) * total
    known = known_motion(times, Moving(*whole(np.clip(times + sides, 0.0, total))))
    left = _left(move, known, y, total)
    hz = " and ".join(f"{f:.4g}" for f in shaper.hz)
    return ShaperRow(shaper.name, hz, float(np.mean(shaper.zeta)), shaper.delay, left)


def _along(
    move: Move, modes: tuple[input_shapers.ModeOnPath, ...], y: Floats, T: float
) -> tuple[Floats, Floats] | None:
    """Times and q of a ZV that changes with the frequency along the path, unless that is one."""
    if not modes or np.ptp(modes[0].hz) <= CHANGES * modes[0].hz.min():
        return None
    t = np.linspace(0.0, T, len(modes[0].hz))
    first, last = move.trajectory.time_s[[0, -1]]
    own = np.linspace(float(first), float(last), len(t))
    q = move.trajectory.motion.poses(own, y)
    return input_shapers.shaped_along(t, q, modes[0].hz, modes[0].zeta)


def _over_time(
    move: Move, mode: input_shapers.ModeOnPath, y: Floats, T: float, times: Floats, q: Floats
) -> ShaperRow:
    left = _left(move, sampled_motion(times, q), y, float(times[-1]))
    hz = "{:.4g} … {:.4g}".format(*mode.hz_range)
    return ShaperRow("zv over time", hz, float(mode.zeta.mean()), float(times[-1]) - T, left)


def _left(move: Move, motion: Motion, y: Floats, total: float) -> float:
    ends = np.array([0.0, total])
    other = replace(move, trajectory=Trajectory(ends, motion.poses(ends), known=motion))
    return float(other.at(y).residuals(ends[1:])[0, 0])


def _lines(shaper: input_shapers.Shaper, row: ShaperRow) -> Iterator[str]:
    """Yield what controllers take of a shaper; nothing of what none of them knows."""
    said = f"{row.name}: {1e3 * row.delay:.3g} ms longer, leaves {1e3 * row.residual:.3g} mm"
    with suppress(UsageError):
        yield f"# {said}\n{input_shapers.klipper_lines(shaper)}"
    with suppress(UsageError):
        yield f"; {said}\n{input_shapers.reprap_line(shaper)}\n"
