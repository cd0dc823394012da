"""Every method put the same question: built, evaluated, timed, compared; meshes; what to choose.

Evaluations are timed in large batches, as a search over designs asks for them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from eigassign._version import __version__
from eigassign.case.case_file import CaseFile
from eigassign.chart.methods import Method, list_methods
from eigassign.chart.question import (
    Bench,
    Effort,
    Question,
    build_bench,
    build_question,
    measure,
    timed,
)
from eigassign.chart.results import (
    Advice,
    Asked,
    Chart,
    ChartPoint,
    Errors,
    Front,
    MeshRow,
    Timing,
    machine,
)
from eigassign.errors import EigassignError
from eigassign.facts import time_in_words
from eigassign.mechanism.assembly.build import refined
from eigassign.study.built_case import build_model
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]


def compare_methods(
    scene: Scene, effort: Effort, accuracies: Sequence[float], progress: Callable[[str], None]
) -> Chart:
    """Time against error of every method; no meshes yet.

    Raises CaseError where the case has no trajectory, or nothing that changes a frequency.
    """
    bench = build_bench(scene, effort)
    progress("solving the points of the question exactly")
    question = build_question(bench)
    charted, skipped = chart_methods(bench, question, progress)
    one, asked, file = float(question.asked.trajectory_samples), question.asked, scene.file
    named = {"one trajectory": one, "1000 trajectories": 1000.0 * one, "online alone": None}
    return Chart(
        title=file.title, case_name=file.path.stem, case_sha256=file.sha256,
        reference=file.reference, version=__version__, quick=effort.quick, machine=machine(),
        asked=asked, points=tuple(charted), skipped=tuple(skipped.items()),
        fronts=tuple(front(charted, name, n, asked.floor_hz) for name, n in named.items()),
        advice=tuple(advise(charted, asked, accuracies)),
        notes=tuple(skipped_notes(skipped)), warnings=scene.warnings,
    )  # fmt: skip


def skipped_notes(skipped: Mapping[str, str]) -> Iterator[str]:
    """A note for each reason, with the methods that it kept from an answer."""
    for why in dict.fromkeys(skipped.values()):
        names = [name for name, own in skipped.items() if own == why]
        yield f"{', '.join(names)} {'has' if len(names) == 1 else 'have'} no answer: {why}"


# --- Measured: what every method costs, and how wrong it is


def chart_methods(
    bench: Bench, question: Question, progress: Callable[[str], None]
) -> tuple[list[ChartPoint], dict[str, str]]:
    """A point for every method, exact solvers first; of those that cannot answer, why.

    After a set-up that takes over ``effort.most_s`` no other of its family is made.
    """
    charted, skipped, ended = list[ChartPoint](), dict[str, str](), dict[str, str]()
    for method in list_methods(bench):
        if method.family not in ended:
            progress(f"charting {method.family}")
        exact = (p.online.median_s for p in charted if p.family.startswith("exact"))
        try:
            if why := ended.setdefault(method.family, ""):
                raise EigassignError(why)
            point, set_up_s = _chart_method(bench, question, method, min(exact, default=0.0))
        except EigassignError as error:
            skipped[method.name] = str(error)
            continue
        charted.append(point)
        if set_up_s > bench.effort.most_s:
            ended[method.family] = f"{method.name} took {time_in_words(set_up_s)} to set up"
    return charted, skipped


def _chart_method(
    bench: Bench, question: Question, method: Method, exact_s: float
) -> tuple[ChartPoint, float]:
    """Set up, evaluated, timed and compared; and the seconds of setting up."""
    asked, effort, solver = question.asked, bench.effort, method.family.startswith("exact")
    points = question.points[: method.parameters.get("points")]
    built, set_up = measure(method.build, effort)
    hz, spent = timed(partial(built.evaluate, points))
    # as many as take 20 ms at the pace of the first answers
    many = int(np.clip(0.02 * len(hz) / (spent + 1e-9), min(300, len(points)), 32768))
    some = points[np.resize(np.arange(len(points)), many)]
    offline = Timing(0.0, 0.0, 0.0, 0) if solver else set_up
    online = measure(partial(built.evaluate, some), effort, many)[1]
    exact, n = question.exact_hz[: len(hz)], asked.random_points
    pays = not solver and online.median_s < exact_s
    point = ChartPoint(
        method=method.name, family=method.family, ours=method.ours, parameters=method.parameters,
        offline=offline, online=online, solves=built.solves, solves_online=float(solver),
        everywhere=errors(hz, exact, asked.floor_hz if solver else 0.0),
        random=errors(hz[:n], exact[:n]),
        trajectory=errors(hz[n:], exact[n:]) if len(hz) > n else None,
        # from so many evaluations: offline + N online < N exact
        break_even=offline.median_s / (exact_s - online.median_s) if pays else None,
        use=method.use, key=method.key,
    )  # fmt: skip
    return point, set_up.median_s


def errors(hz: Floats, exact: Floats, floor_hz: float = 0.0) -> Errors:
    """Worst and root mean square of |f − f_exact|, infinite where a method gives no number.

    An error below ``floor_hz``, the round-off of the exact solves, means nothing.
    """
    off = np.abs(hz - exact)
    failed = ~np.isfinite(off)
    off = np.where(failed, np.inf, off)
    rms, relative = float(np.sqrt(np.mean(np.square(off)))), float((off / exact).max())
    worst = max(float(off.max()), floor_hz)
    return Errors(worst, rms, relative, len(hz), int(failed.any(axis=1).sum()))


# --- Meshes: elements against discretisation error


def chart_meshes(
    file: CaseFile, x: Floats, modes: Sequence[int], effort: Effort
) -> tuple[MeshRow, ...]:
    """One row for each mesh up to ``effort.most_dof``, from coarse to fine, at points x (n, n_x).

    The limit is extrapolated from the two finest, f + (f − f_coarser)/15, for errors fall like h⁴
    where cubic beam elements are halved; the finest row's own error is therefore an estimate. No
    rows where fewer than two meshes differ.
    """
    meshes = {
        counts: (k, finer) for k in sorted(effort.factors) for finer, counts in [refined(file, k)]
    }
    sizes, times, solved = list[tuple[float, int, int]](), list[Timing](), list[Floats]()
    for counts, (factor, finer) in meshes.items():
        model = build_model(finer)
        if not counts or model.n_dof > effort.most_dof:
            break
        q, y = np.split(x, [len(model.q_names)], axis=1)
        hz, spent = measure(partial(model.frequencies, q, y, max(modes)), effort, len(x))
        solved.append(hz[:, np.array(modes) - 1])
        sizes.append((factor, sum(counts), model.n_dof))
        times.append(spent)
    if len(sizes) < 2:
        return ()
    off = np.array(solved) - (limit := solved[-1] + (solved[-1] - solved[-2]) / 15.0)
    worst, relative = (np.abs(e).max(axis=(1, 2)) for e in (off, off / limit))
    with np.errstate(divide="ignore", invalid="ignore"):  # where an error is 0
        slopes = -np.diff(np.log(worst)) / np.diff(np.log([factor for factor, *_ in sizes]))
    orders = [*(float(p) if np.isfinite(p) else None for p in slopes[:-1]), None, None]
    rows = zip(sizes, worst.tolist(), relative.tolist(), orders, times, strict=True)
    return tuple(MeshRow(*size, w, e, order, spent) for size, w, e, order, spent in rows)


# --- Which methods no other beats, and what to choose


def front(
    points: Sequence[ChartPoint], name: str, evaluations: float | None, floor_hz: float
) -> Front:
    """The methods that nothing beats in cost and error at once; errors below the floor are equal.

    A point that equals another in one of the two and is no better in the other is beaten.
    """
    able = [(p.cost_s(evaluations), max(p.everywhere.worst_hz, floor_hz), p.method) for p in points]
    kept, best = list[str](), np.inf
    for _, error, method in sorted(able, key=lambda each: each[:2]):
        if error < best:
            kept, best = [method, *kept], error
    return Front(name, evaluations, tuple(kept))


def advise(
    points: Sequence[ChartPoint], asked: Asked, accuracies: Sequence[float]
) -> Iterator[Advice]:
    """What to write in the case for each accuracy: the lowest order that has it, in words too.

    Nothing is advised below round-off: no method can be seen to be that accurate.
    """
    floor = asked.floor_hz / asked.typical_hz
    keyed = [p for p in points if p.key]
    exact = [time_in_words(p.online.median_s) for p in points if p.family == "exact"][:1]
    for accuracy in accuracies:
        able = [p for p in keyed if p.everywhere.worst_relative <= accuracy][:1]
        if accuracy < floor:
            words = f"nothing is within {_share(accuracy)} of exact: round-off moves even exact "
            yield Advice(accuracy, f"{words}solves by {floor:.1e}", is_below_round_off=True)
        elif not able:
            nearest = min((p.everywhere.worst_relative for p in keyed), default=None)
            off = "" if nearest is None else f", the nearest is {_share(nearest)} off at worst"
            which = "write `method: sequential` under `assignment`, which needs no expansion"
            words = f"{which}: no order that was charted is within {_share(accuracy)} of exact{off}"
            yield Advice(accuracy, words)
        for p in able:
            worst, each = p.everywhere.worst_relative, p.online.median_s
            words = f"write `{p.key}` under `expansion`: {_share(worst)} off at worst, "
            words += f"{time_in_words(each)} a sample"
            words += "".join(f" (an exact solve takes {time})" for time in exact)
            yield Advice(accuracy, words, p.key, p.method, worst, each)


def _share(relative: float) -> str:
    """``0.13 %``; of what is far below as a power of ten."""
    return f"{100.0 * relative:.2g} %" if relative >= 1e-6 or not relative else f"{relative:.1e}"
