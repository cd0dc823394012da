"""Several bands in several load cases: no number of modes below them is missed that is better.

Random mechanisms are asked to keep out of one to three bands that some random design is clear of,
some of them along one trajectory or in a part of it, some beside a wanted frequency, a limit of the
mass or prices. The answer is compared with the best of a thousand random designs that are clear.
"""

import json
from typing import Any, NamedTuple

import numpy as np
import pytest
import yaml
from random_assignments import load_text, random_case

import eigassign as ea

Floats = np.ndarray
FEASIBLE, MOST_DRAWN, CHUNK = 1_000, 20_000, 250
BETWEEN = 4  # instants between two samples at which the best random design is looked at too


class Band(NamedTuple):
    """A band on the trajectories named, from a first to a last share of their time."""

    names: list[str]
    first: float
    last: float
    low: float
    high: float


class Problem(NamedTuple):
    """A case with its bands, and what is made small."""

    case: ea.Case
    bands: list[Band]
    prices: Floats | None
    wanted: tuple[int, float] | None  # mode and Hz, on all trajectories
    heaviest: float


def several_bands(seed: int) -> Problem:
    """Two to eight parameters, one to three load cases, one to three bands; always the same."""
    rng = np.random.default_rng([seed, 31])
    while True:
        problem = _drawn_problem(int(rng.integers(1_000_000)), rng)
        if problem is not None and not are_clear(problem, problem.case.initial_design[None]).all():
            return problem


def _drawn_problem(seed: int, rng: np.random.Generator) -> Problem | None:
    data = yaml.safe_load(random_case(seed))
    plain = load_text(random_case(seed))
    data["design"].pop("constraints", None)
    bodies = list(data["mechanism"]["bodies"])[:1]
    loaded = [f"bodies.{name}.mass" for name in bodies]
    chosen = [own for own in data["design"].items() if own[1]["parameter"] not in loaded]
    data["design"] = dict(chosen[: int(rng.integers(2, 9))])
    if len(chosen) < 2:
        return None
    q = plain.trajectory.q
    few = q[np.linspace(0, len(q) - 1, int(rng.integers(5, 10))).astype(int)]
    loads = [float(10 ** rng.uniform(-1.5, 0.6)) for _ in range(int(rng.choice([1, 2, 3, 3])))]
    loads = loads if bodies else loads[:1]
    data["trajectory"] = [
        {"name": f"load{k}", "q": few.tolist(), "duration": 1.0}
        | {"set": dict.fromkeys(loaded, load)}
        for k, load in enumerate(loads)
    ]
    data["expansion"] = {"order": 1, "modes": [1], "q": few[0].tolist()}
    data["targets"], data["assignment"] = [{"mode": 1, "at_least": 1e-3}], {}
    case = load_text(json.dumps(data))
    clear = _random_designs(case, rng, 1)[0]
    hz = case.model().frequencies(case.trajectory.q, clear, 4)
    bands: list[Band] = []
    data["targets"] = []
    for _ in range(int(rng.choice([1, 2, 2, 3, 3]))):
        own = _band(case, hz, rng)
        if own is None:
            return None
        bands.append(own)
        target: dict[str, Any] = {"keep_out": [own.low, own.high]}
        if len(own.names) < len(loads):
            target["trajectory"] = own.names[0]
        if (own.first, own.last) != (0.0, 1.0):
            target["during"] = [own.first, own.last]
        data["targets"].append(target)
    form, prices, wanted, heaviest = rng.random(), None, None, np.inf
    if form < 0.2:
        wanted = int(rng.integers(1, 3)), float(np.median(hz[:, 0]) * rng.uniform(0.8, 1.6))
        data["targets"].append({"mode": wanted[0], "frequency": wanted[1]})
    elif form < 0.4:
        width = [own["max"] - own["min"] for own in data["design"].values()]
        prices = rng.uniform(0.2, 2.0, len(width)) / width * rng.choice([-1, 1, 1], len(width))
        for own, price in zip(data["design"].values(), prices, strict=True):
            own["price"] = float(price)
    elif form < 0.6:
        heaviest = float(1.02 * case.model().mass(clear))
        data["design"]["mass"] = {"max": heaviest}
    return Problem(load_text(json.dumps(data)), bands, prices, wanted, heaviest)


def _band(case: ea.Case, hz: Floats, rng: np.random.Generator) -> Band | None:
    """A band that the frequencies (n, 4) of some design are clear of."""
    parts = case.trajectory.parts
    names = [part.name for part in parts]
    first, last = 0.0, 1.0
    if (narrow := rng.random()) < 0.3:
        names = [str(rng.choice(names))]
        if narrow < 0.15:
            first, last = sorted(rng.uniform(0.0, 1.0, 2).tolist())
    level = float(np.exp(rng.uniform(*np.log([0.8 * hz[:, 0].min(), 1.05 * hz[:, 2].max()]))))
    low, high = 0.0, np.inf
    for part, rows in zip(parts, case.trajectory.rows, strict=True):
        if part.name in names:
            time = part.trajectory.time_s
            inside = (time >= first - 0.25) & (time <= last + 0.25)
            found = hz[rows][inside]
            if len({int(k) for k in (found < level).sum(axis=1)}) > 1:
                return None
            low = max(low, float(np.max(found[found < level], initial=0.5 * level)))
            high = min(high, float(np.min(found[found > level], initial=2.0 * level)))
    if high < 1.01 * low:
        return None
    middle, half = np.sqrt(low * high), 0.5 * np.log(high / low) * rng.uniform(0.3, 0.9)
    edges = middle * np.exp(-half), middle * np.exp(half)
    return Band(names, first, last, float(edges[0]), float(edges[1]))


def _bounds(case: ea.Case) -> tuple[Floats, Floats]:
    columns = case.file.design.parameters.values()
    return np.array([one.min for one in columns]), np.array([one.max for one in columns])


def _random_designs(case: ea.Case, rng: np.random.Generator, count: int) -> Floats:
    """Designs (count, n_y), uniform, or in the logarithm over more than a decade."""
    low, high = _bounds(case)
    u, far = rng.random((count, len(low))), (low > 0.0) & (high > 10.0 * low)
    base = np.where(far, low, 1.0)
    return np.where(far, base * (np.where(far, high, 1.0) / base) ** u, low + u * (high - low))


def are_clear(problem: Problem, designs: Floats, between: int = 0) -> Floats:
    """Which designs (m, n_y) keep all limits at the samples; or ``between`` too, of fine meshes."""
    case, model = problem.case, problem.case.model()
    names, at, q = [], [], []
    for part in case.trajectory.parts:
        time = part.trajectory.time_s
        count = (len(time) - 1) * (between + 1) + 1
        ends = [end for own in problem.bands for end in (own.first, own.last)]
        own_at = np.union1d(np.linspace(time[0], time[-1], count), ends)
        at.append(own_at)
        names += [part.name] * len(own_at)
        q.append(part.trajectory.motion.poses(own_at))
    instants, poses = np.concatenate(at), np.concatenate(q)
    top = max(own.high for own in problem.bands)
    clear = np.array([model.mass(y) <= problem.heaviest * (1.0 + 1e-9) for y in designs])
    hz = _frequencies(case, poses, designs[clear], top)
    for own in problem.bands:
        inside = (instants >= own.first) & (instants <= own.last)
        for name in own.names:
            rows = np.flatnonzero(inside & (np.array(names) == name))
            below, upper = ((hz[:, rows] < edge).sum(axis=2) for edge in (own.low, own.high))
            good = (np.ptp(below, axis=1) == 0) & (below == upper).all(axis=1)
            if between:
                each = zip(designs[clear], below[:, 0], strict=True)
                fine = [_above_of_fine_mesh(model, poses[rows], y, k, own.high) for y, k in each]
                good &= np.array(fine, dtype=bool)
            clear[clear], hz = good, hz[good]
    return clear


def _above_of_fine_mesh(model: Any, q: Floats, y: Floats, below: int, high: float) -> bool:
    """Whether the mode above a band is above it by as much as the mesh may raise it."""
    if below >= model.n_dof - model.n_rigid:
        return False
    raised = model.discretisation_error(q, y, (below + 1,)).max()
    return bool(model.frequencies(q, y, below + 1)[:, below].min() > (1.0 + raised) * high)


def _frequencies(case: ea.Case, q: Floats, designs: Floats, beyond: float) -> Floats:
    """All frequencies (m, n, count) below one of designs (m, n_y) at poses (n, n_q)."""
    model = case.model()
    available, count = model.n_dof - model.n_rigid, 4
    each = np.tile(q, (len(designs), 1)), np.repeat(designs, len(q), axis=0)
    while len(designs):
        hz = model.frequencies(*each, min(count, available))
        if count >= available or hz[:, -1].min() > beyond:
            return np.asarray(hz.reshape(len(designs), len(q), -1))
        count *= 2
    return np.zeros((0, len(q), 1))


def objective(problem: Problem, y: Floats) -> float:
    """The merit as the results state it: squared errors, price, or squared change of the design."""
    case = problem.case
    low, high = _bounds(case)
    if problem.wanted is not None:
        mode, wanted = problem.wanted
        poses, weights = [], []
        for part in case.trajectory.parts:  # ends of bands between samples are samples, too
            time = part.trajectory.time_s
            own = [band for band in problem.bands if part.name in band.names]
            ends = [end for band in own for end in (band.first, band.last)]
            at = np.union1d(time, np.clip(ends, time[0], time[-1])) if ends else time
            poses.append(part.trajectory.motion.poses(at))
            weights.append(_trapezoidal(at))
        hz = case.model().frequencies(np.concatenate(poses), y, mode)[:, mode - 1]
        weights = np.concatenate(weights)
        return float(weights @ (hz / wanted - 1.0) ** 2 / weights.sum())
    if problem.prices is not None:
        return float(problem.prices @ (y - case.initial_design))
    return float((((y - case.initial_design) / (high - low)) ** 2).sum())


def _trapezoidal(time: Floats) -> Floats:
    half = 0.5 * np.diff(time)
    return np.append(half, 0.0) + np.append(0.0, half)


def best_random(problem: Problem, seed: int) -> tuple[float, int]:
    """The least objective of a thousand random designs that are clear, and how many they were."""
    rng = np.random.default_rng([seed, 37])
    found: list[tuple[float, Floats]] = []
    for _ in range(MOST_DRAWN // CHUNK):
        designs = _random_designs(problem.case, rng, CHUNK)
        found += [(objective(problem, y), y) for y in designs[are_clear(problem, designs)]]
        if len(found) >= FEASIBLE:
            break
    for value, y in sorted(found, key=lambda one: one[0]):
        if are_clear(problem, y[None], BETWEEN).all():
            return value, len(found)
    return np.inf, len(found)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(24))
def test_no_random_design_that_is_clear_of_several_bands_is_better(seed: int) -> None:
    """To 2 %; and what is called reached is clear between the samples too."""
    problem = several_bands(seed)
    found = ea.assign(problem.case)
    row, y = found.results.assignment, np.array(list(found.design.values()))
    assert row is not None
    best, count = best_random(problem, seed)
    if count < 100:
        pytest.skip(f"only {count} of the random designs are clear: none to compare with")
    if row.verdict == "reached":
        assert are_clear(problem, y[None], BETWEEN).all()
    assert row.objective_optimal == pytest.approx(objective(problem, y), rel=1e-6, abs=1e-12)
    assert row.objective_optimal <= best + 0.02 * abs(best)
