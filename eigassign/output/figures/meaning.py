"""What an answer means: what it hangs on, what it can reach, what deviations do to it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from eigassign.facts import capital, percent
from eigassign.output.figures import graph
from eigassign.output.figures.curves import OPTIMAL, TARGET
from eigassign.output.figures.graph import (
    BarGroup,
    Bars,
    Curve,
    FigurePlan,
    Graph,
    Panel,
    Shade,
)
from eigassign.study.results import (
    RangeRow,
    RunResults,
    SensitivityRow,
    TargetAlong,
    TargetStudy,
)


def meaning_figures(results: RunResults) -> Iterator[FigurePlan]:
    """Sensitivities, reach and tolerance of each target."""
    found = results.meaning
    if any(row.percent_per_percent_largest for row in found.sensitivity):
        yield sensitivities(found.sensitivity)
    reach = {row.label: row for row in found.reach}
    spread = {row.label: row for row in found.tolerance.targets} if found.tolerance else {}
    number = 0
    for target in results.targets:
        shown = reach.get(target.label), spread.get(target.label)
        for along in target.along if any(shown) and target.asked.terms else ():
            number += 1
            yield ranges(results, target, along, shown, number)


def sensitivities(rows: tuple[SensitivityRow, ...], most: int = 10) -> FigurePlan:
    """(y/f) ∂f/∂y of every parameter and target: a group of bars a parameter, one colour a target.

    Of many parameters the ``most`` with the largest shares, in the order of the design.
    """
    largest: dict[str, float] = {}
    for row in rows:
        share = abs(row.percent_per_percent_largest)
        largest[row.parameter] = max(share, largest.get(row.parameter, 0.0))
    chosen = sorted(largest, key=lambda name: -largest[name])[:most]
    names = tuple(name for name in largest if name in chosen)
    groups = []
    for k, label in enumerate(dict.fromkeys(row.label for row in rows)):
        own = {row.parameter: row for row in rows if row.label == label}
        shares = [
            (own[n].percent_per_percent, own[n].percent_per_percent_largest)
            if n in own
            else (np.nan, np.nan)
            for n in names
        ]
        mean, worst = np.array(shares).T
        groups.append(BarGroup(label, graph.SERIES[k % len(graph.SERIES)], mean, worst))
    count = len(largest)
    of_many = "" if count == len(names) else f"; the {len(names)} largest of {count} parameters"
    return FigurePlan(
        "sensitivity",
        "Sensitivity",
        "By how many % a frequency changes at the answer when a parameter changes by 1 %: bars are "
        "means over the samples, whiskers reach to the largest"
        f"{of_many}.",
        "Bars of the relative sensitivity of each target to each parameter.",
        Bars("Sensitivity of the frequencies", "% per %", names, tuple(groups)),
        "depends",
        "Sensitivity",
    )


def ranges(
    results: RunResults,
    target: TargetStudy,
    along: TargetAlong,
    shown: tuple[RangeRow | None, RangeRow | None],
    number: int,
) -> FigurePlan:
    """The answer inside the frequencies of all designs within the bounds, and the tolerances."""
    several = len(results.trajectories) > 1
    place, clock = f" along {along.name!r}" if several else "", along.name if several else ""
    said: list[str] = []
    shades: list[Shade] = []
    for row, colour, label, what, words in (
        (shown[0], graph.GREY, "within the bounds", "All designs", "least error"),
        (shown[1], graph.BLUE, "within the tolerances", "Deviations", "worst error"),
    ):
        if row is not None:
            low, high = row.lowest_hz[along.rows], row.highest_hz[along.rows]
            shades.append(Shade(low, high, colour, label, 0.35))
            said.append(f"{what} {label} ({row.how}): {words} {percent(row.error)}.")
    curves = (
        Curve(target.exact_hz[along.rows], OPTIMAL, "answer"),
        Curve(target.target_hz[along.rows], TARGET, "wanted"),
    )
    edges = tuple(e for shade in shades for e in (shade.low, shade.high) if e is not None)
    panel = Panel(f"{target.asked.axis} [Hz]", (*shades, *curves), 2.4, holds=edges)
    time_s = results.time_s[target.asked.rows][along.rows]
    return FigurePlan(
        f"range_{number}",
        f"{capital(target.label)}: reach and tolerance{place}",
        " ".join(said),
        "The answer's frequency over time inside the range of others.",
        Graph(f"{capital(target.label)}{place}", "time [s]", time_s, (panel,), clock=clock),
        "depends" if shown[0] is not None else "robustness",
    )
