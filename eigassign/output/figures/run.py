"""The figures of a run in reading order: what its results have something to show for."""

from __future__ import annotations

from collections.abc import Iterator

from eigassign.output.figures import curves, maps, mechanism
from eigassign.output.figures.style import FigurePlan
from eigassign.study.results import RunResults, along_each


def run_figures(results: RunResults) -> tuple[FigurePlan, ...]:
    """Mechanism, coordinates, approximation of each mode, assignments, next modes."""
    return tuple(_figures(results))


def _figures(results: RunResults) -> Iterator[FigurePlan]:
    if any(results.poses.lines):
        yield mechanism.poses(results)
    each = along_each(results)
    yield from (curves.coordinates(one) for one in each if one.q.size)
    for k, study in enumerate(results.studies):
        for one in each:
            comparison = one.studies[k].over_time
            if comparison is not None and comparison.exact_hz.size:
                yield curves.over_time(one, study, comparison)
        loads = results.trajectories[0].loads if results.trajectories else ()
        point = (*results.q_names, *loads)
        yield from maps.approximation(study, study.over_q, study.q0, point, "q")
        names = tuple(row.name for row in results.design)
        yield from maps.approximation(study, study.over_design, study.y0, names, "design")
    for mode in dict.fromkeys(target.mode for target in results.targets):
        for one in each:
            own = (target for target in one.targets if target.mode == mode)
            yield from (curves.assignment(one, target) for target in own if target.target_hz.size)
    for one in each:
        if one.others is not None and one.others.initial_hz.size:
            yield curves.other_modes(one, one.others)
