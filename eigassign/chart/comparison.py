"""Every method put the same question, at points that none has seen; what fails there, by name.

Errors do not depend on the machine. Times are the least processor time of repeats, in which all
methods take turns, so that another process disturbs all alike. Failures are told as they were
measured. Modes that meet are found by their shapes, which change places between two points, and
followed to where their frequencies are nearest on the line between these.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec
from itertools import chain, product
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from eigassign._version import __version__
from eigassign.arrays import Floats
from eigassign.case.units import shown_point
from eigassign.chart.methods import NO_KRIGING, Built, list_meshes, list_methods
from eigassign.chart.question import Effort, Points, Subject, asked, build_subject, errors
from eigassign.chart.results import (
    ACCURACY,
    EVALUATIONS,
    Asked,
    BoxRow,
    Chart,
    ChartPoint,
    Finding,
    Front,
    Kind,
    Reach,
    machine,
)
from eigassign.errors import EigassignError
from eigassign.facts import percent
from eigassign.modal.exact.solver import rounding_error
from eigassign.modal.exact.tracking import links
from eigassign.study.built_case import BuiltCase

LEAST_S = 1e-3  # a timed run takes at least so long: a thousand times what the clock resolves
ONCE_S, OFTEN_S = 1.0, 0.1  # a run that takes over so long is not repeated, or three times only


def compare_methods(
    case: BuiltCase,
    effort: Effort,
    accuracy: float = ACCURACY,
    progress: Callable[[str], None] = lambda _: None,
) -> Chart:
    """The chart of a case, without advice. Raises what `build_subject` does."""
    subject, unfollowed = build_subject(case)
    effort, skipped = effort.of_size(subject.model.n_dof), dict[str, str]()
    floor = rounding_error(subject.model.pencil, subject.x0, max(subject.modes))
    progress("solving the test points exactly")
    tests, along = subject.tested(effort), subject.along(subject.initial)
    exact, near = subject.exact(tests.x), _near_modes(subject, tests)
    made = dict[str, tuple[ChartPoint, Built, Callable[[], object]]]()
    judged = ((method, tests, exact) for method in list_methods(subject, effort))
    tasks = chain(judged, list_meshes(subject, effort, tests))
    for k, (method, where, truth) in enumerate(tasks, 1):
        progress(f"{k}: {method.curve}, {method.size}")
        try:
            learnt = subject.learnt(method.learns)
            built = method.build(learnt)
            built.answer(along)  # what cannot be timed is left out
            hz = asked(built.answer, where, truth)
        except (EigassignError, np.linalg.LinAlgError, MemoryError) as error:
            why = "the memory does not suffice" if isinstance(error, MemoryError) else str(error)
            skipped[f"{method.curve}, {method.size}"] = why
            continue
        counts = f"{method.learns} points", f"{len(learnt)} points"  # few samples are no more
        size = built.size or method.size.replace(*counts)
        worst, rms, failed = errors(hz, truth)
        row = ChartPoint(
            f"{method.curve}, {size}", method.curve, size, 0.0, 0.0, 0.0, max(worst, floor), rms,
            failed, method.use,
        )  # fmt: skip
        made.setdefault(row.method, (row, built, partial(method.build, learnt)))
    progress("timing all in turns")
    answers = [partial(built.answer, along) for _, built, _ in made.values()]
    times = _timed([*answers, *(build for *_, build in made.values())], effort.repeats)
    pairs = zip(made.values(), times, times[len(made) :], strict=False)
    points = tuple(
        replace(row, trajectory_s=least, spread_s=median - least, preparation_s=before)
        for (row, *_), (least, median), (before, _) in pairs
    )
    progress("charting boxes")
    ready = {name: built for name, (_, built, _) in made.items()}
    boxes = tuple(study_boxes(subject, effort, ready, floor))
    found = find_failures(subject, near, exact, points, boxes, skipped, accuracy, unfollowed)
    question = Asked(
        subject.modes, subject.model.n_dof, subject.free, len(np.unique(tests.design)), len(tests),
        len(along), accuracy, floor, time.get_clock_info("process_time").resolution,
    )  # fmt: skip
    constant, file = _constant(exact), case.file
    return Chart(
        title=file.title, case_name=file.path.stem, case_sha256=file.sha256,
        reference=file.reference, version=__version__, quick=effort.quick, machine=machine(),
        asked=question, points=points, skipped=tuple(skipped.items()),
        fronts=tuple(front(points, n, accuracy, constant) for n in EVALUATIONS),
        boxes=boxes, reach=tuple(reaches(boxes, accuracy)), findings=tuple(found),
        notes=tuple(_notes(subject)),
        warnings=tuple(map(str, file.warnings)),
    )  # fmt: skip


def _notes(subject: Subject) -> Iterator[str]:
    """What a reader should know of what is not charted."""
    if not find_spec("sklearn"):
        yield NO_KRIGING
    if subject.model.n_dof > SOUGHT_DOF:
        yield f"modes that meet are not sought with over {SOUGHT_DOF} degrees of freedom"


# --- Error against the size of the box: points drawn towards x0, x0 + h (x − x0)

HALF_WIDTHS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
SERIES = tuple(f"{curve}, order {p}" for curve in (Kind.FULL, Kind.LINEAR) for p in (1, 2, 4, 8))
FITS = (f"{Kind.SURFACE}, degree 2", f"{Kind.KRIGING}, 25 points")


def study_boxes(
    subject: Subject, effort: Effort, built: Mapping[str, Built], floor: float
) -> Iterator[BoxRow]:
    """The worst error of each method in each box; none where nothing varies."""
    is_q = np.arange(len(subject.x0)) < len(subject.model.q_names)
    varied = {"q": is_q, "y": ~is_q, "q and y": np.ones_like(is_q)}
    if not (subject.rows and subject.free):
        varied = {k: varied[k] for k in ("q",) * bool(subject.rows) + ("y",) * bool(subject.free)}
    tests = subject.tested(replace(effort, designs=effort.boxes, instants=effort.boxes))
    fits = {f"{m.curve}, {m.size}": m for m in list_methods(subject, effort)}
    ritz = [name for name in built if name.startswith(Kind.RITZ) and " at " not in name]
    kept = {name: one for name, one in built.items() if name in (*SERIES, *ritz[-1:])}
    for (name, mask), h in product(varied.items(), HALF_WIDTHS):
        made, points = dict(kept), _drawn(subject, tests, np.where(mask, h, 0.0))
        for fit in (fits[name] for name in FITS if name in fits):
            with suppress(EigassignError, np.linalg.LinAlgError):
                learnt = _drawn(subject, subject.learnt(fit.learns), np.where(mask, h, 0.0))
                made[f"{fit.curve}, {fit.size}"] = fit.build(learnt)
        exact = subject.exact(points.x)
        for method, one in made.items():
            error = errors(asked(one.answer, points, exact), exact)[0]
            yield BoxRow(method, name, h, max(error, floor))


def _drawn(subject: Subject, points: Points, widths: Floats) -> Points:
    return replace(points, x=subject.x0 + widths * (points.x - subject.x0))


def reaches(rows: Sequence[BoxRow], accuracy: float) -> Iterator[Reach]:
    """Where each method's error passes the accuracy, between boxes by straight lines of logarithms.

    0 where it is above in the smallest box already, 1 where it is below in all.
    """
    for method, varied in dict.fromkeys((r.method, r.varied) for r in rows):
        own = [r for r in rows if (r.method, r.varied) == (method, varied)]
        h, error = np.array([(r.half_width, r.worst_relative) for r in own]).T
        k = int(np.append(~(error <= accuracy), True).argmax())
        reach = 1.0 if k == len(h) else 0.0
        if 0 < k < len(h):
            low, high, wanted = np.log([error[k - 1], error[k], accuracy])
            share = (wanted - low) / (high - low) if np.isfinite(high) else 0.0
            reach = float(h[k - 1] * (h[k] / h[k - 1]) ** share)
        yield Reach(method, varied, reach, float(error[-1]))


# --- Times


def _timed(jobs: Sequence[Callable[[], object]], repeats: int) -> list[tuple[float, float]]:
    """Least and median seconds of each job by turns; short ones run many times at a turn."""
    spent, many = [list[float]() for _ in jobs], [1] * len(jobs)
    for turn in range(repeats):
        for k, job in enumerate(jobs):
            before = min(spent[k], default=0.0)
            if before > ONCE_S or (turn > 2 and before > OFTEN_S):
                continue
            start = time.process_time()
            for _ in range(many[k]):
                job()
            spent[k].append((time.process_time() - start) / many[k])
            many[k] = max(many[k], int(LEAST_S / (spent[k][-1] + 1e-7)))
    return [(min(own), float(np.median(own))) for own in spent]


# --- Which methods no other beats


def front(
    points: Sequence[ChartPoint], evaluations: int, accuracy: float, constant: float = np.inf
) -> Front:
    """The methods within the accuracy that nothing beats in cost and error at once.

    One that is hardly better than the best ``constant`` answers is not among them, nor are meshes,
    whose errors are of another kind.
    """
    rows = [p for p in points if p.curve != Kind.MESH]
    most = min(accuracy, max(0.5 * constant, min((p.worst_relative for p in rows), default=0.0)))
    able = (p for p in rows if p.worst_relative <= most)
    kept, best = list[str](), np.inf
    for p in sorted(able, key=lambda p: (p.cost_s(evaluations), p.worst_relative)):
        if p.worst_relative < best:
            kept, best = [*kept, p.method], p.worst_relative
    return Front(evaluations, tuple(kept))


def _constant(exact: Floats) -> float:
    """The worst relative error of the best constants, one a mode: (max − min)/(max + min)."""
    known = exact[np.isfinite(exact).all(axis=1)]
    high, low = known.max(axis=0, initial=0.0), known.min(axis=0, initial=np.inf)
    return float(((high - low) / (high + low)).max()) if len(known) else 0.0


# --- Failures by name: what fails, where, why, and what serves instead

MEET = 1e-7  # relative distance below which modes cross: nearer, shapes cannot be told apart
LEARNING = (Kind.INTERPOLATED, Kind.SURFACE, Kind.RADIAL, Kind.KRIGING)  # blind between points
NEAR = 0.1  # relative distance up to which modes that change places are told
COINCIDENT = 1e-6  # relative distance below which shapes are arbitrary
SOUGHT, STEP = 5, 1.0 / 32.0  # lines on which a pair's nearest place is sought, and its first steps
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
    "too wide a range for series": "what is left out of the series counts so far from its point",
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


def _near_modes(subject: Subject, tests: Points) -> tuple[Near, ...]:
    """The charted modes that cross or veer with a neighbour between test points or designs."""
    model, last = subject.model, len(subject.model.pencil.elastic)
    count = min(max(subject.modes) + 1, last)
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
    numbers = _numbers_at(subject, a, b, min(count + 1, last))
    for k in set(pairs) - {one.lower - 1 for one in found}:
        crossed = np.flatnonzero(numbers[:, k] > numbers[:, k + 1])
        for i in crossed[:: max(1, len(crossed) // SOUGHT)]:
            s, gap = _nearest(subject, a[i], b[i], k)
            ends = [a[i] + np.clip(s + e, 0.0, 1.0) * (b[i] - a[i]) for e in (-STEP, STEP)]
            swapped = _numbers_at(subject, ends[0][None], ends[1][None], min(k + 3, last))[0]
            if gap < NEAR and swapped[k] > swapped[k + 1]:
                kind = "crossing" if gap < MEET else "veering"
                found.append(Near(kind, k + 1, a[i] + s * (b[i] - a[i]), gap))
    nearest = {one.lower: one for one in sorted(found, key=lambda one: -one.gap)}
    return tuple(nearest[lower] for lower in sorted(nearest))


def _numbers_at(subject: Subject, a: Floats, b: Floats, count: int) -> Floats:
    """Numbers (n, count) at b of the lowest shapes at a; NaN of shapes that are not unique."""
    try:
        (hz, before), (_, after) = (subject.model.modes(*subject.split(x), count) for x in (a, b))
    except EigassignError:  # somewhere there are no modes
        return np.full((len(a), count), np.nan)
    across, sizes = links(subject.model.pencil, b, before, after)
    shares = across**2 / np.einsum("nii->ni", sizes)[:, None, :]
    numbers = np.where(shares.max(axis=1) > SWAPPED, shares.argmax(axis=1), count).astype(float)
    same = np.diff(hz, axis=1) < COINCIDENT * hz[:, :-1]
    numbers[:, :-1][same] = numbers[:, 1:][same] = np.nan
    return numbers


def _nearest(subject: Subject, a: Floats, b: Floats, k: int) -> tuple[float, float]:
    """Where on the line a + s (b − a) modes k + 1 and k + 2 are nearest: s, relative distance."""

    def gap(s: Floats) -> Floats:
        hz = subject.exact(a + np.reshape(s, (-1, 1)) * (b - a), k + 2)
        return np.asarray((hz[:, k + 1] - hz[:, k]) / hz[:, k])

    s = np.arange(0.0, 1.0 + STEP / 2.0, STEP)
    at = s[int(np.nanargmin(gap(s)))]
    ends = max(at - STEP, 0.0), min(at + STEP, 1.0)
    found = minimize_scalar(lambda v: float(gap(v)[0]), bounds=ends, options={"xatol": 1e-12})
    return float(found.x), float(found.fun)


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
        kind = "straight or folded arm" if "of reach" in unfollowed else "path not followed"
        instead = "mend the path; here the case is charted at rest, without motion"
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
        where = shown_point(labels, one.x, units)
        more = {} if series else {"why": "no series is off by more than is wanted"}
        yield finding(one.kind, where, series, modes=modes, gap=one.gap, **more)
        if kinked:
            yield finding("too few samples to see a kink", where, kinked, modes=modes)
    lowest, middle = np.nanmin(exact, axis=0, initial=np.inf), subject.exact(subject.x0[None])[0]
    for mode, low, usual in zip(subject.modes, lowest, middle, strict=True):
        if low < FALLS * usual:
            why = f"mode {mode} falls from {usual:.3g} to {low:.3g} Hz: towards 0 its λ is not "
            why += "smooth on the scale of the bounds"
            failing = [p.method for p in wrong]
            yield finding("a part is decoupled", "at an end of the bounds", failing, why=why)
    diverging = list(_diverging(boxes, accuracy))
    yield from (finding("radius of convergence", *each) for each in diverging)
    decoupled = bool((lowest < FALLS * middle).any())
    able = any(p.curve == Kind.FULL and p not in wrong for p in points)
    if series and not (able or near or diverging or decoupled):
        yield finding("too wide a range for series", "all over the ranges", series)
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
    for varied, h in dict.fromkeys((r.varied, r.half_width) for r in boxes):
        own = [errors[varied, h, method] for method in orders]
        worse = [
            m
            for m, lower, e in zip(orders[1:], own, own[1:], strict=False)
            if e > max(accuracy, 1.1 * lower)
        ]
        if worse and own[-1] > accuracy:
            far = f"from {h:g} of the ranges of {varied} on" if h < 1.0 else f"all over {varied}"
            yield far, worse
            return
