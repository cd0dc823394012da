"""What a case asks for as requirements: targets at the samples of its trajectories, and limits.

A requirement is at all samples, those of one trajectory, or a part of it. What is asked between
samples counts: the first and the last time of a part, the points of a profile that is not linear
from sample to sample, and where drives are limited the jumps of q̈, become instants of the
trajectory (`with_instants`). From one of all these to the next the edges are linear in time.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import ArrayLike

from eigassign.arrays import Floats
from eigassign.assignment.program import frozen
from eigassign.assignment.requirements.kinds import KINDS, asked_of, terms_of
from eigassign.assignment.requirements.quantity import (
    LimitedQuantity,
    Placed,
    quantity_limits,
    static_limits,
)
from eigassign.assignment.requirements.requirement import Requirement
from eigassign.assignment.requirements.residual import residual_limits
from eigassign.case.case_file import CaseFile
from eigassign.case.reader import dotted
from eigassign.case.schema.targets import (
    AnyMode,
    AnyTarget,
    FrequencyProfile,
    NamedMode,
    ResidualTarget,
    StaticTarget,
)
from eigassign.errors import CaseError
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.model import Model

_Curve = float | FrequencyProfile
_SLACK = 1e-9  # of the duration: rounding of a time grid, far below a step
_LINEAR = 1e-12  # relative: a point of a profile this near to a straight line is on it


def requirements_of(file: CaseFile, path: Trajectories) -> tuple[Requirement, ...]:
    """The requirements of the mode to be highest, if any, and of all targets, one for each mode.

    Raises CaseError where a profile ends before a trajectory does, a part of a trajectory has no
    sample, or a file cannot be read.
    """
    return tuple(
        one
        for place, target in file.asked
        if target.kind in KINDS
        for one in _of_target(file, place, target, path)
    )


def followed_modes(file: CaseFile) -> tuple[NamedMode, ...]:
    """What targets name but by a mode's number, each once, in the order of the file.

    Modes that are followed by their shape, and antiresonances.
    """
    return tuple(dict.fromkeys(mode for target in file.targets for mode in target.followed))


def design_limits(
    file: CaseFile, model: Model, path: Trajectories | None
) -> tuple[LimitedQuantity, ...]:
    """The limits of quantities of the design, those of drives along whole trajectories.

    Raises CaseError where a part of a trajectory has no sample, MechanismError where a node is
    rigid, or nothing holds it.
    """
    limits = list(quantity_limits(file, model, path))
    if path is not None:
        limits += static_limits(file, model, path, list(_static(file, path)))
        limits += residual_limits(file, model, path)
    return tuple(limits)


def _static(file: CaseFile, path: Trajectories) -> Iterator[Placed]:
    for k, target in enumerate(file.targets):
        if isinstance(target, StaticTarget) and not isinstance(target, ResidualTarget):
            rows = _rows(file, f"targets[{k}]", target, path)
            yield k, target, rows, tuple(_along(path, rows)), _where(target)


def with_instants(file: CaseFile, path: Trajectories) -> Trajectories:
    """The trajectories with the instants between samples that targets ask something of."""
    times: list[list[float]] = [[] for _ in path.parts]
    for target in file.targets:
        profiles = [c for _, c in target.frequencies if isinstance(c, FrequencyProfile)]
        for part, found in zip(path.parts, times, strict=True):
            if target.trajectory in (None, part.name):
                found += _instants(part.trajectory.time_s, target.during, profiles)
    if file.design.torque:
        for part, found in zip(path.parts, times, strict=True):
            breaks, near = part.trajectory.motion.breaks_s, _SLACK * np.ptp(part.trajectory.time_s)
            found += [t for t in breaks if np.abs(part.trajectory.time_s - t).min() > near]
    return path.with_instants(times)


def _instants(
    time_s: Floats, during: tuple[float, float] | None, curves: Iterable[FrequencyProfile]
) -> Iterator[float]:
    """Yield the ends of a part, and the points of curves that are not linear between samples."""
    slack = _SLACK * float(np.ptp(time_s))
    first, last = time_s[0], time_s[-1]
    if during is not None:
        first, last = max(first, during[0]), min(last, during[1])
        ends = (end for end in (first, last) if np.abs(time_s - end).min() > slack)
        yield from ends if first < last else ()
    inside = time_s[(time_s > first) & (time_s < last)]
    at = np.unique([first, *inside, last])
    for profile in curves if first < last else ():
        hz, times = np.asarray(profile.frequency), np.asarray(profile.time)
        own = (times > first) & (times < last)
        chord = np.interp(times[own], at, np.interp(at, times, hz))
        off = np.abs(chord - hz[own]) > _LINEAR * hz[own]
        interval = np.searchsorted(at, times[own])
        yield from times[own][np.isin(interval, interval[off])]


def trapezoidal_weights(time_s: ArrayLike) -> Floats:
    """Weights (n_t,) in s with ``∫ g dt ≈ weights @ g`` by the trapezoidal rule.

    The weight of sample k is (t_{k+1} − t_{k−1})/2, one-sided at both ends; samples need not be
    evenly spaced. A single sample has weight 1: the integral becomes the value there.
    """
    time = np.asarray(time_s, dtype=np.float64)
    if time.size == 1:
        return frozen([1.0])
    steps = np.diff(time)
    return frozen(0.5 * (np.append(steps, 0.0) + np.append(0.0, steps)))


def time_weights(path: Trajectories, rows: slice | None = None) -> Floats:
    """ω (n,) in s of the integral over these rows, or all, of every trajectory for itself.

    By the trapezoidal rule, with the weight of each.
    """
    rows = slice(0, len(path.q)) if rows is None else rows
    parts, time_s = {part.name: part.weight for part in path.parts}, path.time_s[rows]
    along = _along(path, rows)
    return np.concatenate([parts[name] * trapezoidal_weights(time_s[own]) for name, own in along])


def _of_target(
    file: CaseFile, place: str, target: AnyTarget, path: Trajectories
) -> Iterator[Requirement]:
    rows = _rows(file, place, target, path)
    along = tuple(_along(path, rows))
    sampled = (
        _sampled(file, curve, f"{place}.{dotted(keys)}", rows, path)
        for keys, curve in target.frequencies
    )
    words, *edges = asked_of(target, *sampled)
    lower, upper = (np.broadcast_to(edge, rows.stop - rows.start) for edge in edges)
    own = followed_modes(file)
    for named in target.named:
        followed = tuple(mode for mode in named if not isinstance(mode, int))
        modes = tuple(m if isinstance(m, int) else own.index(m) - len(own) for m in named)
        terms = terms_of(target, modes)
        yield KINDS[target.kind](
            label=f"{_who(named)} {words}{_where(target)}",
            place=place,
            modes=tuple(mode for mode in modes if mode > 0 or not terms),
            terms=terms,
            rows=rows,
            lower=lower,
            upper=upper,
            along=along,
            weight=target.weight,
            trajectory=target.trajectory,
            seconds=None if target.during is None else time_weights(path, rows),
            followed=tuple(sorted(followed, key=own.index)),
        )


def _who(modes: tuple[AnyMode, ...]) -> str:
    if not modes:
        return "every mode"
    if not all(isinstance(mode, int) for mode in modes):
        return " and ".join(f"mode {m}" if isinstance(m, int) else m.name for m in modes)
    *first, last = map(str, modes)
    return f"modes {', '.join(first)} and {last}" if first else f"mode {last}"


def _where(target: AnyTarget) -> str:
    where = f" along {target.trajectory!r}" if target.trajectory else ""
    return where + (" from {:g} to {:g} s".format(*target.during) if target.during else "")


def _rows(file: CaseFile, place: str, target: AnyTarget, path: Trajectories) -> slice:
    rows = path.rows_of(target.trajectory)
    if target.during is None:
        return rows
    time_s, (first, last) = path.time_s[rows], target.during
    slack = _SLACK * float(np.ptp(time_s))
    inside = np.flatnonzero((time_s >= first - slack) & (time_s <= last + slack))
    if not len(inside):
        message = f"no sample of the trajectory is between {first:g} and {last:g} s"
        raise CaseError((file.problem(f"{place}.during", message),))
    return slice(rows.start + int(inside[0]), rows.start + int(inside[-1]) + 1)


def _along(path: Trajectories, rows: slice) -> Iterator[tuple[str, slice]]:
    """Yield the trajectories that have some of these rows, each with its part of them."""
    for part, own in zip(path.parts, path.rows, strict=True):
        first, last = max(own.start, rows.start), min(own.stop, rows.stop)
        if first < last:
            yield part.name, slice(first - rows.start, last - rows.start)


def _sampled(file: CaseFile, curve: _Curve, key: str, rows: slice, path: Trajectories) -> Floats:
    """Frequencies (n,) in Hz at ``rows``, by each one's time; linear between points, not beyond."""
    if not isinstance(curve, FrequencyProfile):
        return np.full(rows.stop - rows.start, float(curve))
    found, knots = [], np.array(curve.time)
    slack = 1e-12 * np.abs(knots).max()  # rounding of a time grid's end
    for name, own in _along(path, rows):
        time = path.time_s[rows][own]
        if not knots[0] - slack <= time[0] <= time[-1] <= knots[-1] + slack:
            which = f" (trajectory {name!r})" if path.several else ""
            message = (
                f"target time: {knots[0]:g} … {knots[-1]:g} s does not cover the trajectory's "
                f"{time[0]:g} … {time[-1]:g} s{which}"
            )
            raise CaseError((file.problem(key, message),))
        found.append(np.interp(time, knots, curve.frequency))
    return np.concatenate(found)
