"""Every method put the same question: built, evaluated, timed, and compared.

Evaluations are timed in large batches, as a search over designs asks for them: point by point, and
of fits by whole trajectories, which they answer in one product of matrices.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from eigassign._version import __version__
from eigassign.chart.advice import advise, front
from eigassign.chart.methods import Method, list_methods, most_solves
from eigassign.chart.question import (
    SEED,
    Points,
    Question,
    build_features,
    build_question,
    exact_frequencies,
)
from eigassign.chart.results import Asked, Chart, ChartPoint, Errors, Request, Timing
from eigassign.chart.surrogates import surrogate_families
from eigassign.chart.timing import Effort, machine, measure, time_in_words, timed
from eigassign.errors import EigassignError
from eigassign.modal.exact.roundoff import rounding_error
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
NOTHING = Timing(0.0, 0.0, 0.0, 0)


def compare_methods(
    scene: Scene, effort: Effort, request: Request, progress: Callable[[str], None]
) -> Chart:
    """Time against error of every method; no meshes and designs yet.

    Raises CaseError where the case has no trajectory, or nothing that changes a frequency.
    """
    features, model, modes = build_features(scene), scene.model, scene.expansions.modes
    solve_s, samples = _solve_cost(scene), len(features.q)
    question = build_question(scene, features, effort, solve_s)
    points = question.points
    progress(f"solving {len(points)} points exactly")
    exact_hz = exact_frequencies(scene, points)
    ends = (np.concatenate([points.q[k], points.y[k]]) for k in (0, -1))
    floor = max(rounding_error(model.pencil, x, max(modes)) for x in ends)
    asked = Asked(
        modes=modes,
        n_dof=model.n_dof,
        features=features.names,
        random_points=question.n_random,
        designs=len(question.runs),
        samples_per_design=len(points[question.runs[0]]),
        trajectory_samples=samples,
        evaluations=request.evaluations or float(samples),
        seed=SEED,
        typical_hz=float(np.median(exact_hz)),
        floor_hz=floor * float(exact_hz.max()),
    )
    listed = list_methods(scene, features, effort, request.accuracies, solve_s)
    charted, skipped = chart_methods(listed, question, exact_hz, asked, effort, progress)
    counts = {"one trajectory": float(samples), "1000 trajectories": 1000.0 * samples}
    wanted = [request.evaluations] if request.evaluations else list(counts.values())
    if request.evaluations:
        counts[f"{request.evaluations:g} evaluations"] = request.evaluations
    named = {**counts, "online alone": None}.items()
    fronts = tuple(front(charted, name, n, asked.floor_hz) for name, n in named)
    notes = list(skipped_notes(skipped))
    most, d = most_solves(effort, solve_s), len(features.names)
    if most < max([*effort.training, *(k**d for k in effort.nodes)]):
        notes.append(f"no grid or surrogate is trained on over {most} exact solves")
    if "Kriging" not in [family for family, *_ in surrogate_families()]:
        notes.append("no Kriging: it is charted where scikit-learn is installed")
    return Chart(
        title=scene.file.title,
        case_name=scene.file.path.stem,
        case_sha256=scene.file.sha256,
        reference=scene.file.reference,
        version=__version__,
        quick=effort.quick,
        machine=machine(),
        asked=asked,
        points=tuple(charted),
        skipped=tuple(skipped.items()),
        fronts=fronts,
        advice=tuple(advise(charted, asked, request, wanted, skipped)),
        notes=tuple(notes),
        warnings=scene.warnings,
    )


def _solve_cost(scene: Scene) -> float:
    """Seconds of one exact solve, roughly: to decide how many can be afforded."""
    q = scene.path.q[: 1 if scene.model.n_dof > 1000 else 16]
    some = Points(q, np.tile(scene.initial, (len(q), 1)), q)
    exact_frequencies(scene, some[:1])
    return max(timed(lambda: exact_frequencies(scene, some))[1] / len(q), 1e-6)


def skipped_notes(skipped: Mapping[str, str]) -> Iterator[str]:
    """A note for each reason, with the methods that it kept from an answer."""
    for why in dict.fromkeys(skipped.values()):
        names = [name for name, own in skipped.items() if own == why]
        yield f"{', '.join(names)} {'has' if len(names) == 1 else 'have'} no answer: {why}"


def chart_methods(
    listed: Iterable[Method],
    question: Question,
    exact_hz: Floats,
    asked: Asked,
    effort: Effort,
    progress: Callable[[str], None],
) -> tuple[list[ChartPoint], dict[str, str]]:
    """A point for every method; of those that cannot answer, why.

    After a set-up that takes over ``effort.most_s`` no other of its family is made.
    """
    charted, skipped = list[ChartPoint](), dict[str, str]()
    families = dict[str, str]()  # why no other is made, or nothing
    for method in listed:
        if method.family not in families:
            progress(f"charting {method.family}")
        try:
            if why := families.setdefault(method.family, ""):
                raise EigassignError(why)
            point, set_up_s = _chart_method(method, question, exact_hz, asked, effort)
        except EigassignError as error:
            skipped[method.name] = str(error)
            continue
        charted.append(point)
        if set_up_s > effort.most_s:
            families[method.family] = f"{method.name} took {time_in_words(set_up_s)} to set up"
    solvers = [p for p in charted if p.family.startswith("exact")]
    exact_s = min(p.online.median_s for p in solvers)
    for k, p in enumerate(charted):  # from so many evaluations: offline + N online < N exact
        if p not in solvers and p.online.median_s < exact_s:
            count = p.offline.median_s / (exact_s - p.online.median_s)
            charted[k] = replace(p, break_even=count)
    return charted, skipped


def _chart_method(
    method: Method, question: Question, exact_hz: Floats, asked: Asked, effort: Effort
) -> tuple[ChartPoint, float]:
    """Set up, evaluated, timed and compared; and the seconds of setting up."""
    points, n, first, samples = question.points, question.n_random, 0, asked.trajectory_samples
    parts, solver = [points[: method.most]], method.family.startswith("exact")
    if method.per_design:
        parts, first, n = [points[run] for run in question.runs], n, 0
    one, set_up = measure(lambda: method.build(parts[0].y[0]), effort)
    made = [one, *(method.build(part.y[0]) for part in parts[1:])]
    pairs = list(zip(made, parts, strict=True))
    hz, spent = timed(lambda: np.vstack([each.evaluate(part) for each, part in pairs]))
    some = parts[0]
    if not method.most:  # as many as take 20 ms at the pace of the first answers, 32768 at most
        many = max(300, int(min(0.02 * len(hz) / (spent + 1e-9), 32768)))
        some = some[np.resize(np.arange(len(some)), many)]
    job, count = partial(one.evaluate, some), len(some)
    if one.along is not None:
        y = points.y[[run.start for run in question.runs]]
        y = y[np.resize(np.arange(len(y)), 1 + 32768 // samples)]
        job, count = partial(one.along, y), len(y) * samples
    online = measure(job, effort)[1].times(1.0 / count)
    exact, solves = exact_hz[first : first + len(hz)], sum(each.solves for each in made)
    everywhere, offline, solves_online, note = errors(hz, exact), set_up, 0.0, ""
    if solver:  # an error below round-off means nothing
        everywhere = replace(everywhere, worst_hz=max(everywhere.worst_hz, asked.floor_hz))
        offline, solves, solves_online = NOTHING, 0, 1.0
    if method.per_design:
        offline, solves, solves_online = NOTHING, 0, solves / (samples * len(parts))
        online = online.plus(set_up.times(1.0 / samples))
        note = "set up anew for every design: answers the runs along the trajectory only"
    point = ChartPoint(
        method=method.name,
        family=method.family,
        ours=method.ours,
        parameters=method.parameters,
        offline=offline,
        online=online,
        solves=solves,
        solves_online=solves_online,
        everywhere=everywhere,
        random=errors(hz[:n], exact[:n]) if n else None,
        trajectory=errors(hz[n:], exact[n:]) if len(hz) > n else None,
        break_even=None,
        note=note,
        use=method.use,
        at_once=samples if method.per_design else 1,
        estimate=max((each.estimate for each in made if each.estimate is not None), default=None),
    )
    return point, set_up.median_s


def errors(hz: Floats, exact: Floats) -> Errors:
    """Worst and root mean square of |f − f_exact|, infinite where a method gives no number."""
    off = np.abs(hz - exact)
    failed = ~np.isfinite(off)
    off = np.where(failed, np.inf, off)
    rms, relative = float(np.sqrt(np.mean(np.square(off)))), float((off / exact).max())
    return Errors(float(off.max()), rms, relative, len(hz), int(failed.any(axis=1).sum()))
