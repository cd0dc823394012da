"""The findings of a run along each of its trajectories alone, for what is shown one by one."""

from __future__ import annotations

from dataclasses import replace

from eigassign.study.findings import (
    Comparison,
    Findings,
    ModeStudy,
    OtherModes,
    TargetStudy,
    TrajectoryRow,
)


def along_each(findings: Findings) -> tuple[Findings, ...]:
    """One for each trajectory, whose name is its ``only``; itself where there is none or one.

    Poses, maps over q and y, design, solver, warnings and notes stay those of the whole run.
    """
    if len(findings.trajectories) < 2:
        return (findings,)
    return tuple(_along(findings, row) for row in findings.trajectories)


def _along(findings: Findings, row: TrajectoryRow) -> Findings:
    rows, others = row.rows, findings.others
    narrow = (_target(target, row.name) for target in findings.targets)
    return replace(
        findings,
        only=row.name,
        time_s=findings.time_s[rows],
        q=findings.q[rows],
        trajectories=(replace(row, rows=slice(0, rows.stop - rows.start)),),
        studies=tuple(_study(study, rows) for study in findings.studies),
        targets=tuple(target for target in narrow if target is not None),
        others=None
        if others is None
        else OtherModes(others.modes, others.initial_hz[rows], others.optimal_hz[rows]),
    )


def _study(study: ModeStudy, rows: slice) -> ModeStudy:
    over = study.over_time
    if over is None:
        return study
    parts = (over.exact_hz, over.taylor_hz, over.linearised_hz)
    return replace(study, over_time=Comparison(*(part[rows] for part in parts)))


def _target(target: TargetStudy, name: str) -> TargetStudy | None:
    """The target along the trajectory of that name; None where it does not hold there."""
    along = next((one for one in target.along if one.name == name), None)
    if along is None:
        return None
    rows = along.rows
    return replace(
        target,
        target_hz=target.target_hz[rows],
        initial_hz=target.initial_hz[rows],
        predicted_hz=target.predicted_hz[rows],
        exact_hz=target.exact_hz[rows],
        initial=along.error.initial,
        predicted=along.error.predicted,
        exact=along.error.exact,
        rows=slice(0, rows.stop - rows.start),
        along=(replace(along, rows=slice(0, rows.stop - rows.start)),),
    )
