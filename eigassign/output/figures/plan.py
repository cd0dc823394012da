"""Which figures a run shows, what is written below each, and their PNG files.

``plan`` says it without drawing anything; ``render`` draws. The drawing modules, and with them
matplotlib, are imported only then.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from eigassign.output.formats import percent
from eigassign.study.results import (
    Comparison,
    DesignMap,
    ModeStudy,
    OtherModes,
    RunResults,
    TargetStudy,
    along_each,
)

if TYPE_CHECKING:
    from eigassign.output.figures.ink import Sheet


@dataclass(frozen=True)
class FigurePlan:
    """One figure: file name without folder, heading, caption, alternative text, how to draw."""

    file: str
    heading: str
    caption: str
    alt: str
    draw: Callable[[], Sheet]


def render(plans: Sequence[FigurePlan]) -> dict[str, bytes]:
    """PNG files by file name; the same results give the same bytes.

    While one figure is drawn, a thread compresses the one before.
    """
    from eigassign.output.figures import ink
    from eigassign.output.figures.lettering import DPI
    from eigassign.output.figures.png import encode

    with ink.settings(), ThreadPoolExecutor(max_workers=1) as pool:
        files = {p.file: pool.submit(encode, p.draw().pixels(), DPI) for p in plans}
    return {name: future.result() for name, future in files.items()}


def plan(results: RunResults) -> tuple[FigurePlan, ...]:
    """The figures that these results have something to show for, in reading order."""
    return tuple(_plans(results))


def _plans(results: RunResults) -> Iterator[FigurePlan]:
    if any(lines for lines in results.poses.lines):
        yield _mechanism(results)
    each = along_each(results)
    yield from (_joints(one) for one in each if one.q.size)
    for k, study in enumerate(results.studies):
        for one in each:
            comparison = one.studies[k].over_time
            if comparison is not None and comparison.exact_hz.size:
                yield _over_time(one, study, comparison)
        yield from _over(study, study.over_q, study.q0, results.q_names, "q")
        names = tuple(row.name for row in results.design)
        yield from _over(study, study.over_design, study.y0, names, "design")
    for mode in dict.fromkeys(target.mode for target in results.targets):
        for one in each:
            own = (target for target in one.targets if target.mode == mode)
            yield from (_assignment(one, target) for target in own if target.target_hz.size)
    for one in each:
        if one.others is not None and one.others.initial_hz.size:
            yield _others(one, one.others)


def _mechanism(results: RunResults) -> FigurePlan:
    def draw() -> Sheet:
        from eigassign.output.figures import mechanism as poses

        return poses.mechanism(results)

    links = ", ".join(results.poses.link_names)
    return FigurePlan(
        "mechanism.png",
        "Mechanism",
        f"The links ({links}) in {len(results.poses.lines)} poses, and the path of the tip.",
        f"Line drawing of the mechanism with links {links} in several poses.",
        draw,
    )


def _suffix(results: RunResults) -> str:
    """What tells the files of several trajectories apart."""
    return f"_{results.only}" if results.only is not None else ""


def _of(results: RunResults) -> str:
    """The same for headings."""
    return f", {results.along}" if results.only is not None else ""


def _joints(results: RunResults) -> FigurePlan:
    def draw() -> Sheet:
        from eigassign.output.figures import curves

        return curves.joints(results)

    names = ", ".join(results.q_names)
    return FigurePlan(
        f"coordinates{_suffix(results)}.png",
        f"Coordinates{_of(results)}",
        f"The coordinates {names} along {results.along} of {results.time_s.size} samples.",
        f"Curves of {names} over time.",
        draw,
    )


def _over_time(results: RunResults, study: ModeStudy, comparison: Comparison) -> FigurePlan:
    def draw() -> Sheet:
        from eigassign.output.figures import curves

        return curves.over_time(results, study, comparison)

    return FigurePlan(
        f"approximation_mode_{study.mode}_time{_suffix(results)}.png",
        f"Mode {study.mode}: expansion along {results.along}",
        "Exact, Taylor and linearised frequency at the initial design. " + _worst(comparison),
        f"Frequency of mode {study.mode} over time and the errors of both expansions.",
        draw,
    )


def _worst(comparison: Comparison) -> str:
    return (
        f"Worst error {percent(comparison.worst_taylor)} for the full expansion, "
        f"{percent(comparison.worst_linearised)} for the partially linearised one."
    )


def _over(
    study: ModeStudy,
    over: DesignMap | None,
    around: NDArray[np.float64],
    names: tuple[str, ...],
    kind: str,
) -> Iterator[FigurePlan]:
    if over is None or not over.axes or min(axis.size for axis in over.axes) < 2:
        return
    point = np.array([around[names.index(n)] for n in over.names if n in names])
    shown = " and ".join(over.names)

    def draw() -> Sheet:
        if len(over.axes) == 1:
            from eigassign.output.figures import curves

            return curves.over_one(study, over, point)
        from eigassign.output.figures import maps

        return maps.over_two(study, over, point)

    yield FigurePlan(
        f"approximation_mode_{study.mode}_{kind}.png",
        f"Mode {study.mode}: expansion over {shown}",
        f"All else at the expansion point. {_worst(over.values)}",
        f"Exact frequency of mode {study.mode} and expansion errors over {shown}.",
        draw,
    )


def _assignment(results: RunResults, target: TargetStudy) -> FigurePlan:
    def draw() -> Sheet:
        from eigassign.output.figures import curves

        return curves.assignment(results, target)

    return FigurePlan(
        f"assignment_mode_{target.mode}{_suffix(results)}.png",
        f"Mode {target.mode}: original, optimal and target frequency{_of(results)}",
        f"Worst distance to the target {percent(target.initial.max_relative)} before and "
        f"{percent(target.exact.max_relative)} after, "
        f"where the expansion predicted {percent(target.predicted.max_relative)}.",
        f"Frequency of mode {target.mode} over time before and after, with its target.",
        draw,
    )


def _others(results: RunResults, others: OtherModes) -> FigurePlan:
    def draw() -> Sheet:
        from eigassign.output.figures import curves

        return curves.others(results, others)

    modes = ", ".join(map(str, others.modes))
    return FigurePlan(
        f"other_modes{_suffix(results)}.png",
        f"Next modes{_of(results)}",
        f"Exact frequencies of modes {modes}, which were not assigned, before and after.",
        f"Frequencies of modes {modes} over time before and after.",
        draw,
    )
