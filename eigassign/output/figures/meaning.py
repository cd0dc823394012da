"""What an answer means: what it hangs on, and what it can reach."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from eigassign.facts import capital, percent
from eigassign.output.figures import graph
from eigassign.output.figures.curves import LEVEL, OPTIMAL, TARGET
from eigassign.output.figures.graph import (
    Curve,
    FigurePlan,
    Graph,
    Look,
    Mark,
    Panel,
    Rule,
    Shade,
    segments,
)
from eigassign.study.results import (
    RangeRow,
    RunResults,
    SensitivityRow,
    TargetAlong,
    TargetStudy,
)


def meaning_figures(results: RunResults) -> Iterator[FigurePlan]:
    """Sensitivities, and the reach of each target."""
    found = results.meaning
    if any(row.percent_per_percent_largest for row in found.sensitivity):
        yield sensitivities(found.sensitivity)
    reach = {row.label: row for row in found.reach}
    number = 0
    for target in results.targets:
        shown = reach.get(target.label)
        if shown is None or not target.asked.terms:
            continue
        for along in target.along:
            number += 1
            yield ranges(results, target, along, shown, number)


def sensitivities(rows: tuple[SensitivityRow, ...], most: int = 10) -> FigurePlan:
    """(y/f) ∂f/∂y of every parameter and target: a group of lines a parameter, a colour a target.

    Of many parameters the ``most`` with the largest shares, in the order of the design.
    """
    largest: dict[str, float] = {}
    for row in rows:
        share = abs(row.percent_per_percent_largest)
        largest[row.parameter] = max(share, largest.get(row.parameter, 0.0))
    chosen = sorted(largest, key=lambda name: -largest[name])[:most]
    names = tuple(name for name in largest if name in chosen)
    labels = list(dict.fromkeys(row.label for row in rows))
    marks: list[Mark] = [Rule(0.0, LEVEL, upright=True)]
    for k, label in enumerate(labels):
        own = [row for row in rows if row.label == label and row.parameter in names]
        at = (0.4 - 0.8 * (k + 0.5) / len(labels)) - np.array(
            [names.index(r.parameter) for r in own]
        )
        mean = np.array([row.percent_per_percent for row in own])
        worst = np.array([row.percent_per_percent_largest for row in own])
        look = graph.series(k)
        colour = replace(look, dash="solid", width=2.2)
        dot = Look(look.colour, 0.0, marker="o", size=5.0)
        marks += [
            segments(at, mean, worst, LEVEL, lying=True),
            segments(at, np.zeros(at.size), mean, colour, lying=True),
            Curve(at, dot, label, mean, names=tuple(f"{row.parameter}, {label}" for row in own)),
        ]
    low, high = graph.bounds([m.x for m in marks if isinstance(m, Curve) and m.x is not None])
    room = 0.05 * (high - low)
    tall = float(np.clip(0.16 * len(names) * (len(labels) + 1), 1.2, 6.0))
    ends = (np.array([0.5, 0.5 - len(names)]),)
    panel = Panel("", tuple(marks), tall, holds=ends, names=names)
    count = len(largest)
    of_many = "" if count == len(names) else f"; the {len(names)} largest of {count} parameters"
    return FigurePlan(
        "sensitivity",
        "Sensitivity",
        "By how many % a frequency changes at the answer when a parameter changes by 1 %: dots are "
        f"means over the samples, thin lines reach to the largest{of_many}.",
        "Lines as long as the relative sensitivity of each target to each parameter.",
        Graph(
            "Sensitivity of the frequencies", "% per %", np.zeros(0), (panel,),
            x_limits=(low - room, high + room),
        ),
        "depends",
        "Sensitivity",
    )  # fmt: skip


def ranges(
    results: RunResults,
    target: TargetStudy,
    along: TargetAlong,
    row: RangeRow,
    number: int,
) -> FigurePlan:
    """The answer inside the frequencies of all designs within the bounds."""
    several = len(results.trajectories) > 1
    place, clock = f" along {along.name!r}" if several else "", along.name if several else ""
    low, high = row.lowest_hz[along.rows], row.highest_hz[along.rows]
    curves = (
        Curve(target.exact_hz[along.rows], OPTIMAL, "answer"),
        Curve(target.asked.hz[along.rows], TARGET, "wanted"),
    )
    shade = Shade(low, high, graph.GREY, "within the bounds", 0.35)
    panel = Panel(f"{target.asked.axis} [Hz]", (shade, *curves), 2.4, holds=(low, high))
    time_s = results.time_s[target.asked.rows][along.rows]
    return FigurePlan(
        f"range_{number}",
        f"{capital(target.label)}: reach{place}",
        f"All designs within the bounds ({row.how}): least error {percent(row.error)}.",
        "The answer's frequency over time inside the range of others.",
        Graph(f"{capital(target.label)}{place}", "time [s]", time_s, (panel,), clock=clock),
        "depends",
    )
