"""The figures of a run in reading order: what its results have something to show for."""

from __future__ import annotations

from collections.abc import Iterator

from eigassign.output.figures import approximation, curves, mechanism
from eigassign.output.figures.graph import FigurePlan
from eigassign.output.figures.meaning import meaning_figures
from eigassign.study.results import RunResults, along_each


def run_figures(results: RunResults) -> tuple[FigurePlan, ...]:
    """Figures of what was asked, the mechanism, what the answer means, the motion, how exact."""
    return tuple(_figures(results))


def _figures(results: RunResults) -> Iterator[FigurePlan]:
    each = along_each(results)
    for one in each:
        if one.spectrum and one.time_s.size:
            yield curves.overview(one, one.spectrum)
    if any(results.poses.lines):
        yield mechanism.poses(results.case.title, results.poses)
    asked = any(drive.is_asked for drive in results.drives)  # else 0.15 s that nobody asked for
    yield from (curves.statics(one) for one in each if one.statics)
    yield from meaning_figures(results)
    yield from (curves.drives(one) for one in each if asked)
    yield from (curves.coordinates(one) for one in each if one.q.size)
    for k, study in enumerate(results.studies):
        for one in each:
            comparison = one.studies[k].over_time
            if comparison is not None and comparison.exact_hz.size:
                yield approximation.over_time(one, study, comparison)
