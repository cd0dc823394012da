"""Run results that no mechanics produced: shapes, names and magnitudes of every kind to draw."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment import KINDS, ActiveLimit, StepRecord
from eigassign.study import (
    AssignmentRow,
    CaseRow,
    Comparison,
    DesignRow,
    DrawnBody,
    DrawnJoint,
    DrawnPoses,
    DrawnSpring,
    ErrorRow,
    ErrorSummary,
    LocalOptimum,
    Meaning,
    ModeRow,
    ModeStudy,
    OptimalityRow,
    RangeRow,
    RunResults,
    SensitivityRow,
    SolverRow,
    TargetAlong,
    TargetStudy,
    TrajectoryRow,
)

Floats = NDArray[np.float64]


def make_results(
    *,
    n_t: int = 152,
    n_q: int = 2,
    n_y: int = 2,
    n_links: int = 2,
    n_targets: int = 1,
    scale_hz: float = 1.0,
    scale_m: float = 1.0,
    title: str = "Two-link pick-and-place manipulator",
    prefix: str = "",
    varies: bool = True,
    spatial: bool = False,
    parts: tuple[int, ...] | None = None,
) -> RunResults:
    time = np.linspace(0.0, 1.0, n_t) if n_t > 1 else np.zeros(n_t)
    names = tuple(f"{prefix}q{i + 1}" for i in range(n_q))
    q = _joint_motion(time, n_q)
    studies = tuple(_study(i + 1, time, n_y, n_q, scale_hz, varies) for i in range(1))
    parts = (n_t,) if parts is None else parts
    targets = tuple(_target(i + 1, time, scale_hz, parts) for i in range(n_targets if n_t else 0))
    return RunResults(
        case=CaseRow(
            "two_link",
            title,
            None,
            "Belotti et al., Appl. Sci. 11 (2021) 11558",
            "0123456789abcdef" * 4,
            {},
        ),
        version="0.1.0",
        q_names=names,
        q_units=tuple("m" if i % 4 == 3 else "rad" for i in range(n_q)),
        time_s=time,
        q=q,
        trajectories=_trajectories(time, parts) if n_t else (),
        poses=_poses(time, n_links, scale_m, prefix, spatial),
        studies=studies,
        design=tuple(_design_row(i, prefix) for i in range(n_y)),
        targets=targets,
        other_modes=_others(time, n_targets, scale_hz) if n_t else (),
        spectrum=_spectrum(targets, _others(time, n_targets, scale_hz)) if targets else (),
        solver=SolverRow("solved", 25, 3.1e-17, 2.2e-14, 1.5e-16) if n_y else None,
        assignment=_assignment(n_y, prefix) if targets else None,
        warnings=("section 'rod': <area> & inertia look odd",),
        notes=("order 4: asked for", "q1 dropped: no frequency depends on it"),
        timing_s={"model": 0.004, "expansion": 0.0061, "assignment": 0.0123, "exact": 0.05},
    )


def _slices(parts: tuple[int, ...]) -> list[slice]:
    ends = np.cumsum([0, *parts])
    return [slice(int(a), int(b)) for a, b in pairwise(ends)]


def _trajectories(time: Floats, parts: tuple[int, ...]) -> tuple[TrajectoryRow, ...]:
    return tuple(
        TrajectoryRow(
            f"part{k}" if len(parts) > 1 else "1", rows, float(np.ptp(time[rows])), 1.0, None
        )
        for k, rows in enumerate(_slices(parts))
    )


def _joint_motion(time: Floats, n_q: int) -> Floats:
    blend = 10 * time**3 - 15 * time**4 + 6 * time**5
    starts, travels = 1.1 + 1.3 * np.arange(n_q), 0.8 * np.cos(np.arange(n_q))
    return starts + np.outer(blend, travels) + 0.1 * np.outer(np.sin(5 * blend), np.ones(n_q))


def _poses(time: Floats, n_links: int, scale: float, prefix: str, spatial: bool) -> DrawnPoses:
    if time.size == 0 or n_links == 0:
        return DrawnPoses(np.zeros(0), (), ())
    chosen = np.unique(np.linspace(0, time.size - 1, 6).round().astype(int))
    every = [_chain(_joint_motion(time[[k]], n_links)[0], scale, spatial) for k in range(time.size)]
    lines = tuple(every[k] for k in chosen)
    ends = [
        np.array([pose[link][end] for pose in lines]) for link, end in ((0, 0), (0, -1), (-1, -1))
    ]
    sideways = np.zeros_like(ends[0])
    sideways[:, 0] = 1.0
    names = tuple(f"{prefix}link_{i + 1}" for i in range(n_links))
    return DrawnPoses(
        time_s=time[chosen],
        lines=lines,
        link_names=names,
        line_links=names,
        bodies=tuple(
            DrawnBody(f"{prefix}{name}", mass, at)
            for name, mass, at in (("elbow_mass", 0.0, ends[1]), ("tool_mass", 0.25, ends[2]))
        ),
        tip_path=np.array([pose[-1][-1] for pose in every]),
        joints=(
            DrawnJoint("shoulder", "turning", True, True, ends[0], sideways),
            DrawnJoint("elbow", "sliding", False, False, ends[1], sideways),
            DrawnJoint("wrist", "fixed", False, False, ends[2], sideways),
        ),
        springs=(
            DrawnSpring("gear", True, True, ends[0], ends[0]),
            DrawnSpring("stay", False, False, ends[0], ends[2]),
        ),
        depths=((2e-2 * scale, 1e-2 * scale),) * n_links,
    )


def _chain(angles: Floats, scale: float, spatial: bool) -> tuple[Floats, ...]:
    point, links = np.zeros(3 if spatial else 2), []
    for number, angle in enumerate(angles):
        direction = np.array([np.cos(angle), np.sin(angle), 0.3 * np.sin(2 * angle)])
        end = point + scale * 0.6 / (1 + 0.3 * number) * direction[: point.size]
        links.append(np.linspace(point, end, 3))
        point = end
    return tuple(links)


def _compare(shift: Floats, other: Floats, scale: float, varies: bool) -> Comparison:
    exact = scale * (200.0 - 9.0 * shift + 4.0 * shift**2) * (1.0 + 0.02 * other)
    if not varies:
        exact = np.full(shift.shape, 190.0 * scale)
        return Comparison(exact, exact, exact)
    return Comparison(
        exact, exact * (1 + 9e-4 * shift**4), exact * (1 + 0.016 * shift**2 - 0.004 * shift)
    )


def _study(mode: int, time: Floats, n_y: int, n_q: int, scale: float, varies: bool) -> ModeStudy:
    angle = 2.0 * np.pi * time
    over_time = _compare(np.sin(angle), np.cos(angle), scale, varies) if time.size else None
    return ModeStudy(
        mode=mode,
        order=4,
        q0=np.linspace(1.8, 5.3, n_q),
        y0=np.full(n_y, 0.125),
        over_time=over_time,
    )


def _target(mode: int, time: Floats, scale: float, parts: tuple[int, ...]) -> TargetStudy:
    wave = np.sin(3.0 * time)
    target = np.full(time.size, 190.0 * scale * mode)
    exact = target * (1.01 - 0.02 * wave)
    curves = {
        "initial": target * (1.06 - 0.05 * wave),
        "one_shot": target * (1.02 - 0.03 * wave),
        "predicted": exact * (1.0 + 1e-3 * wave),
        "exact": exact,
    }

    def errors(rows: slice) -> ErrorSummary:
        found = {k: _error(hz[rows] / target[rows] - 1.0) for k, hz in curves.items()}
        return ErrorSummary(**found)

    whole = slice(0, time.size)
    rows_of = {f"part{k}" if len(parts) > 1 else "1": rows for k, rows in enumerate(_slices(parts))}
    asked = KINDS["frequency"](
        label=f"mode {mode} at {190.0 * scale * mode:g} Hz",
        place=f"targets[{mode - 1}]",
        modes=(mode,),
        terms=((mode, 1.0),),
        rows=whole,
        lower=target,
        upper=target,
        along=tuple(rows_of.items()),
    )
    return TargetStudy(
        asked=asked,
        time_s=time,
        **{f"{name}_hz": hz for name, hz in curves.items()},
        error=errors(whole),
        satisfied=True,
        weight_s=max(1.0, time.size),
        along=tuple(TargetAlong(name, rows, errors(rows)) for name, rows in rows_of.items()),
    )


def as_limit(target: TargetStudy, kind: str, lower_hz: Floats, upper_hz: Floats) -> TargetStudy:
    """The target of mode 1 as a limit: at_least, at_most, keep_out, gap."""
    below = np.maximum(1.0 - target.exact_hz / lower_hz, 0.0)
    above = np.maximum(target.exact_hz / upper_hz - 1.0, 0.0)
    violated = np.minimum(below, above) if kind == "keep_out" else np.maximum(below, above)
    error = ErrorSummary(target.error.initial, _error(violated), one_shot=target.error.one_shot)
    along = tuple(replace(one, error=error) for one in target.along)
    terms = {"gap": ((2, 1.0), (1, -1.0)), "keep_out": ()}.get(kind, ((1, 1.0),))
    asked = KINDS[kind](
        label=f"mode 1 {kind}", place="targets[0]", modes=(1,), terms=terms,
        rows=target.asked.rows, lower=lower_hz, upper=upper_hz, along=target.asked.along,
    )  # fmt: skip
    return replace(
        target, asked=asked, predicted_hz=None, error=error, satisfied=False, along=along
    )


def studied(results: RunResults) -> RunResults:
    """The same with all that can be said of what its answer means."""
    names = [row.name for row in results.design]
    sensitivity = tuple(
        SensitivityRow(name, "kg", target.label, ("kg", 1.0), -30.0, -35.0, share, 1.3 * share)
        for k, name in enumerate(names)
        for target in results.targets
        for share in [0.3 - 0.4 * (k / len(names)) - 0.05 * target.asked.mode]
    )

    def around(share: float) -> tuple[RangeRow, ...]:
        return tuple(
            RangeRow(
                t.label, t.exact_hz * (1 - share * wide), t.exact_hz * (1 + share), "proved", share
            )
            for t in results.targets
            for wide in [np.linspace(1.0, 0.05, t.exact_hz.size)]
        )

    meaning = Meaning(
        sensitivity=sensitivity,
        reach=around(0.2),
    )
    return replace(results, meaning=meaning)


def _assignment(n_y: int, prefix: str) -> AssignmentRow:
    designs = [np.full(n_y, at) for at in (0.1, 0.2, 0.21)]
    values = (4e-3, 1e-4, 9e-5)
    steps = tuple(
        StepRecord(y, value, 0.0, 0.3, 0.0, taken)
        for y, value, taken in zip(designs, values, (True, False, True), strict=True)
    )
    return AssignmentRow(
        method="sequential",
        objective="least_squares",
        objective_initial=3e-3,
        objective_optimal=9e-5,
        optimality=OptimalityRow("local", 3e-9, None, "the best of 2 optima from 3 starts"),
        verdict="reached",
        reason="every target is met",
        steps=steps,
        starts=3,
        local_optima=(
            LocalOptimum(designs[2], 9e-5, 0.0),
            LocalOptimum(designs[0], 4e-4, 0.0),
        ),
        exact_solves=608,
        ended="first-order optimal",
        finished=True,
        active=(ActiveLimit(f"{prefix}m2", "bound", "lower", 0.01),) if n_y > 1 else (),
        one_shot=np.full(n_y, 0.2),
        max_error=0.02,
        clearances=(),
        model_error=3e-4,
    )


def _error(relative: Floats) -> ErrorRow:
    return ErrorRow(float(np.abs(relative).max()), float(np.sqrt(np.mean(relative**2))))


def _others(time: Floats, n_targets: int, scale: float) -> tuple[ModeRow, ...]:
    rows = []
    for k, (level, wave, share) in enumerate(
        zip((490.0, 720.0, 1100.0), (1.0, -0.4, 0.3), (0.93, 0.97, 0.99), strict=True)
    ):
        initial = scale * level * (1.0 + 0.05 * wave * np.sin(4 * time))
        rows.append(ModeRow(n_targets + 1 + k, initial, initial * share))
    return tuple(rows)


def _spectrum(targets: tuple[TargetStudy, ...], others: tuple[ModeRow, ...]) -> tuple[ModeRow, ...]:
    own = (ModeRow(k, t.initial_hz, t.exact_hz) for k, t in enumerate(targets, 1))
    return (*own, others[0])


def _design_row(index: int, prefix: str) -> DesignRow:
    return DesignRow(
        name=f"{prefix}m{index + 1}",
        parameter=f"bodies.{prefix}mass_{index + 1}.mass",
        unit="kg",
        initial=0.0,
        optimal=0.2287 if index == 0 else 0.0,
        lower=0.0,
        upper=0.25,
    )
