"""What to write for which question, with the consequence measured; several cases side by side."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from eigassign._version import __version__
from eigassign.chart.methods import CURVES, EXACT, FULL, LINEAR, MESH
from eigassign.chart.results import (
    EVALUATIONS,
    Advice,
    Cell,
    Chart,
    ChartPoint,
    Matrix,
    OrderRow,
    Reach,
    machine,
)
from eigassign.facts import percent, time_in_words

ALIKE = 1.25  # times that differ by less are alike: a busy machine's spread
ALIKE_DESIGNS = 1e-4  # of the bounds: the search ends within 1e-6
EQUAL = 100  # trajectories over which preparations are spread where cases are compared


def advised(chart: Chart, orders: Sequence[OrderRow] = ()) -> Chart:
    """The chart with what to write; ``orders`` is what `optimize` makes of each order."""
    return replace(chart, orders=tuple(orders), advice=tuple(_advise(chart, orders)))


def headline(chart: Chart) -> str:
    """How good the paper's method is here, how far it goes, and what to write, in sentences."""
    kinds = dict.fromkeys(f.kind for f in chart.findings)
    said = ", ".join(kind for kind in kinds if kind not in ("refused", "out of memory"))
    lines = [f"Found: {said}."] if said else []
    paper = {p.size: p.worst_relative for p in chart.points if p.curve == LINEAR}
    if paper:
        size = "order 4" if "order 4" in paper else next(reversed(paper))
        line = f"The paper's method (series linearised in y, {size}) is {percent(paper[size])} off"
        line += " at worst"
        if min(paper.values()) > 0.5 * paper[size] > 0.01 * chart.asked.accuracy:
            line += ", and more orders do not help"
        reach = [r for r in chart.reach if r.method == f"{LINEAR}, {size}"]
        far = "; ".join(_far(r, chart.asked.varied) for r in reach if r.half_width < 1.0)
        lines.append(
            line
            + (f"; it is within {percent(chart.asked.accuracy)} up to {far}." * bool(far) or ".")
        )
    lines += [f"{one.words[:1].upper()}{one.words[1:]}." for one in chart.advice if one.key]
    return " ".join(lines)


def _far(reach: Reach, names: Sequence[str]) -> str:
    """``0.87 of the bounds of m1, m2``."""
    shown = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
    of = {"q": "the motion", "y": f"the bounds of {shown}", "q and y": "motion and bounds together"}
    return f"{reach.half_width:.2g} of {of[reach.varied]}"


def _advise(chart: Chart, orders: Sequence[OrderRow]) -> Iterator[Advice]:
    accuracy, wanted = chart.asked.accuracy, percent(chart.asked.accuracy)
    if orders:
        moved = max((row.moved for row in orders if row.moved is not None), default=0.0)
        shots = ", ".join(percent(o.one_shot) for o in orders if o.one_shot is not None)
        names = ", ".join(str(row.order) for row in orders)
        same = f"to {moved:.0e} of the bounds" if moved > 1e-12 else "to the last digit"
        words = f"nothing: the design is the same {same} for orders {names}, since the search "
        words += "solves exactly"
        if moved > ALIKE_DESIGNS:
            words = (
                f"the order counts: the design differs by up to {moved:.1g} of the bounds among "
            )
            words += f"orders {names}"
        words += f"; the one shot is off by {shots}" if shots else ""
        yield Advice("a design (`optimize`)", words)
    able = [p for p in chart.points if p.worst_relative <= accuracy]
    full = [p for p in able if p.curve == FULL][:1]
    series = any(p.curve == FULL for p in chart.points)
    for p in full:
        key = p.size.replace("order ", "order: ")
        words = f"write `{key}` under `expansion`: {percent(p.worst_relative)} off at worst"
        yield Advice("the series (`expand`)", words, key)
    if series and not full:
        words = f"solve exactly: no series that was charted is within {wanted}"
        yield Advice("the series (`expand`)", words)
    offered, n = [p for p in able if p.use and p.curve != MESH], EVALUATIONS[-1]
    least = min((p.cost_s(n) for p in offered), default=0.0)
    for p in [p for p in offered if p.cost_s(n) <= ALIKE * least][:1]:  # the simplest of the cheap
        words = f"{p.method}, {percent(p.worst_relative)} off, {time_in_words(p.trajectory_s)} a "
        yield Advice("thousands of evaluations elsewhere", f"{words}trajectory: `{p.use}`")
    for p in [p for p in able if p.curve == MESH and p.use][:1]:
        words = f"write `{p.use}` for every link: {percent(p.worst_relative)} from the finest mesh"
        yield Advice("the mesh", words, p.use)


def build_matrix(
    charts: Mapping[str, Chart], refused: Mapping[str, str], accuracy: float, seconds: float
) -> Matrix:
    """Scenes × methods: errors at equal cost, that of exact solves, and costs at equal accuracy."""
    cells = [Cell(name, k, *_cell(chart, k)) for name, chart in charts.items() for k in CURVES]
    return Matrix(
        version=__version__, accuracy=accuracy, evaluations=EQUAL, machine=machine(),
        cases=tuple(charts), cells=tuple(cells), refused=tuple(refused.items()),
        findings={name: chart.findings for name, chart in charts.items()}, seconds=seconds,
        notes=tuple(dict.fromkeys(note for chart in charts.values() for note in chart.notes)),
    )  # fmt: skip


def _cell(chart: Chart, curve: str) -> tuple[float | None, float | None]:
    own = [p for p in chart.points if p.curve == curve]
    exact_s = min(p.cost_s(EQUAL) for p in chart.points if p.curve == EXACT)

    def cost(p: ChartPoint) -> float:
        return p.cost_s(EQUAL) / exact_s

    cheap = [p.worst_relative for p in own if cost(p) <= ALIKE]
    right = [cost(p) for p in own if p.worst_relative <= chart.asked.accuracy]
    return min(cheap, default=None), min(right, default=None)
