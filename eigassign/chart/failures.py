"""Failures by name: what makes methods fail in a case, where, why, and what serves instead.

Whatever is told was measured. Modes that meet are found by their shapes, which change places
between two points, and followed to where their frequencies are nearest on the line between these.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from eigassign.chart.question import Points, Subject
from eigassign.chart.results import BoxRow, ChartPoint, Finding, Kind
from eigassign.errors import EigassignError
from eigassign.facts import percent
from eigassign.modal.exact.tracking import links
from eigassign.study.planning import shown_point

Floats = NDArray[np.float64]
MEET = 1e-7  # relative distance below which modes cross: nearer, shapes cannot be told apart
LEARNING = (Kind.INTERPOLATED, Kind.SURFACE, Kind.RADIAL, Kind.KRIGING)  # blind between points
SWAPPED = 0.5  # share of a shape that the other mode has beyond
FALLS = 1e-2  # of the frequency in the middle: a part that is lower is decoupled
SOUGHT_DOF = 2000  # up to which modes that meet are sought
WHY = {
    "crossing": "a mode by number has a kink there and no derivative: a series goes on along the "
    "other mode",
    "veering": "the two turn into each other within a range as small as their distance: beyond it "
    "no series of one of them converges",
    "repeated modes": "their shapes are not unique: they are expanded together",
    "too few samples to see a kink": "they see nothing between the points they learn from",
    "radius of convergence": "a higher order is worse than a lower one: beyond it terms grow",
    "singular": "the mechanism has no modes there: a dead point, or a part that nothing holds",
    "basis without the mode": "its shape at other poses or designs is not among the vectors, and "
    "no residual shows it",
}


@dataclass(frozen=True)
class Near:
    """Modes ``lower`` and the next one, and where they are nearest; of all places where x is x0."""

    kind: str  # crossing, veering or repeated modes
    lower: int
    x: Floats
    gap: float


def near_modes(subject: Subject, tests: Points) -> tuple[Near, ...]:
    """The charted modes that cross or veer with a neighbour between test points or designs."""
    model, highest = subject.model, max(subject.modes)
    count = min(highest + 1, len(model.pencil.elastic))
    lowest = subject.exact(tests.x, count)
    gaps = np.diff(lowest, axis=1) / lowest[:, :-1]
    pairs = [k for k in range(count - 1) if {k + 1, k + 2}.intersection(subject.modes)]
    found = [
        Near("repeated modes", k + 1, subject.x0, float(np.nanmax(gaps[:, k])))
        for k in pairs
        if np.isfinite(gaps[:, k]).any() and np.nanmedian(gaps[:, k]) < MEET
    ]
    if model.n_dof > SOUGHT_DOF or not (subject.rows or subject.free):
        return tuple(found)
    part = np.searchsorted([own.start for own in subject.rows], tests.place, side="right")
    beside = (np.diff(tests.design) == 0) & (np.diff(part) == 0) & bool(subject.rows)
    designs, n_q = tests.x[np.unique(tests.design, return_index=True)[1]], len(model.q_names)
    designs[:, :n_q] = subject.x0[:n_q]
    a = np.vstack([tests.x[:-1][beside], np.tile(designs[:1], (len(designs) - 1, 1))])
    b = np.vstack([tests.x[1:][beside], designs[1:]])
    try:
        (hz_a, phi_a), (hz_b, phi_b) = (model.modes(*subject.split(x), count) for x in (a, b))
    except EigassignError:  # somewhere there are no modes
        return tuple(found)
    across, sizes = links(model.pencil, b, phi_a, phi_b)
    shares = across**2 / np.einsum("nii->ni", sizes)[:, None, :]
    for k in set(pairs) - {one.lower - 1 for one in found}:
        swapped = np.minimum(shares[:, k + 1, k], shares[:, k, k + 1]) > SWAPPED
        nearer = np.minimum(hz_a[:, k + 1] - hz_a[:, k], hz_b[:, k + 1] - hz_b[:, k])
        some = sorted(np.flatnonzero(swapped), key=lambda i: float(nearer[i]))[:3]
        if some:
            gap, x = min((_nearest(subject, a[i], b[i], k) for i in some), key=lambda each: each[0])
            found.append(Near("crossing" if gap < MEET else "veering", k + 1, x, gap))
    return tuple(found)


def _nearest(subject: Subject, a: Floats, b: Floats, k: int) -> tuple[float, Floats]:
    """The smallest relative distance of modes k + 1 and k + 2 on the line from a to b; where."""

    def gap(s: Floats) -> Floats:
        hz = subject.exact(a + np.reshape(s, (-1, 1)) * (b - a), k + 2)
        return np.asarray((hz[:, k + 1] - hz[:, k]) / hz[:, k])

    s = np.linspace(0.0, 1.0, 33)
    at = s[int(np.nanargmin(gap(s)))]
    ends = max(at - s[1], 0.0), min(at + s[1], 1.0)
    found = minimize_scalar(lambda v: float(gap(v)[0]), bounds=ends, options={"xatol": 1e-12})
    return float(found.fun), a + found.x * (b - a)


def find_failures(
    subject: Subject,
    near: Sequence[Near],
    exact: Floats,
    points: Sequence[ChartPoint],
    boxes: Sequence[BoxRow],
    skipped: Mapping[str, str],
    accuracy: float,
    unfollowed: str,
) -> Iterator[Finding]:
    """A finding for each thing at which methods fail in this case."""
    serves, wrong = _serves(points, accuracy), [p for p in points if p.worst_relative > accuracy]

    def finding(kind: str, where: str, failing: Sequence[str], **more: Any) -> Finding:
        given = {"why": WHY.get(kind, ""), "instead": serves, **more}
        return Finding(kind, where, _some(failing) or "none by more than is wanted", **given)

    if unfollowed:
        kind, instead = "straight or folded arm", "keep it within reach; here it is charted at rest"
        yield finding(kind, "along the path", ["all"], why=unfollowed, instead=instead)
    series = [p.method for p in wrong if p.curve in (Kind.FULL, Kind.LINEAR)]
    kinked = [p.method for p in wrong if p.curve in LEARNING]
    for one in near:
        modes = (one.lower, one.lower + 1)
        if one.kind == "repeated modes":
            yield finding(one.kind, "everywhere", [], modes=modes, gap=one.gap)
            continue
        file, model = subject.file, subject.model
        labels, units = (*model.q_names, *model.y_names), (*file.q_units, *file.design_units)
        where = shown_point(labels, one.x, units, file.in_degrees)
        yield finding(one.kind, where, series, modes=modes, gap=one.gap)
        if kinked:
            yield finding("too few samples to see a kink", where, kinked, modes=modes)
    lowest, middle = np.nanmin(exact, axis=0, initial=np.inf), subject.exact(subject.x0[None])[0]
    for mode, low, usual in zip(subject.modes, lowest, middle, strict=True):
        if low < FALLS * usual:
            why = f"mode {mode} falls from {usual:.3g} to {low:.3g} Hz: towards 0 its λ is not "
            why += "smooth on the scale of the bounds"
            failing = [p.method for p in wrong]
            yield finding("a part is decoupled", "at an end of the bounds", failing, why=why)
    yield from (finding("radius of convergence", *each) for each in _diverging(boxes, accuracy))
    about_one = [p for p in points if p.curve == Kind.RITZ and " at " not in p.size]
    if lost := [p.method for p in about_one[-1:] if p in wrong]:
        yield finding("basis without the mode", "all over the ranges", lost)
    if nowhere := int((~np.isfinite(exact).all(axis=1)).sum()):
        where = f"{nowhere} of {len(exact)} test points"
        yield finding("singular", where, ["all"], instead="narrow the bounds or the motion")
    for why in dict.fromkeys(skipped.values()):
        kind = "out of memory" if "memory" in why or "coefficients" in why else "refused"
        names = [name for name, own in skipped.items() if own == why]
        yield finding(kind, "in the preparation", names, why=why)


def _serves(points: Sequence[ChartPoint], accuracy: float) -> str:
    """The most accurate method that costs less than exact solves in a hundred trajectories."""
    exact_s = min(p.cost_s(100) for p in points if p.curve == Kind.EXACT)
    others = (p for p in points if p.curve not in (Kind.MESH, Kind.EXACT, Kind.SCIPY))
    able = [p for p in others if p.worst_relative <= accuracy and p.cost_s(100) < exact_s]
    best = min(able, key=lambda p: p.worst_relative, default=None)
    cheaper = "" if best is None else f", or {best.method}, {percent(best.worst_relative)} off"
    return f"exact solves{cheaper}"


def _some(names: Sequence[str]) -> str:
    """Names of methods, those of one curve together: ``Taylor: order 1 to order 8``."""
    kinds: dict[str, list[str]] = {}
    for name in names:
        curve, _, size = name.rpartition(", ")
        kinds.setdefault(curve, []).append(size)
    shown = {k: own if len(own) < 3 else [f"{own[0]} to {own[-1]}"] for k, own in kinds.items()}
    return "; ".join(f"{k}: {', '.join(own)}".strip(": ") for k, own in shown.items())


def _diverging(boxes: Sequence[BoxRow], accuracy: float) -> Iterator[tuple[str, list[str]]]:
    """Series of which a higher order is worse than a lower one, and worse than is wanted."""
    errors = {(r.varied, r.half_width, r.method): r.worst_relative for r in boxes}
    orders = [*dict.fromkeys(r.method for r in boxes if r.method.startswith(f"{Kind.FULL}, order"))]
    for varied, h in dict.fromkeys((r.varied, r.half_width) for r in boxes) if orders[1:] else ():
        lower, higher = (errors[varied, h, method] for method in orders[-2:])
        if higher > accuracy and not higher < lower:
            far = f"from {h:g} of the ranges of {varied} on" if h < 1.0 else f"all over {varied}"
            yield far, orders[-1:]
            return
