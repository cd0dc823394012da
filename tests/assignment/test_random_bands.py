"""Random mechanisms that are to keep out of a band: what is called clear stays clear everywhere.

They have load cases, several trajectories with jumps, profiles finer than the samples, and parts
of trajectories that end between samples. Judged by counting modes at 20 000 instants, q being
linear between samples and the profile between its points.
"""

import json
from typing import Any, NamedTuple

import numpy as np
import pytest
import yaml
from random_assignments import load_text, random_case

import eigassign as ea

MANY = [pytest.param(k, marks=() if k == 2 else pytest.mark.slow) for k in range(300)]
COUNTED = 20_000


class Asked(NamedTuple):
    """A band along one trajectory: where it holds, and its edges as functions of time."""

    name: str
    first: float
    last: float
    time_s: np.ndarray
    middle_hz: np.ndarray
    margin: float


def demanding(seed: int) -> tuple[ea.Case, list[Asked]]:
    """A case of one or two bands, each about what a mode has somewhere."""
    rng = np.random.default_rng([seed, 29])
    data = yaml.safe_load(random_case(seed))
    plain = load_text(random_case(seed))
    data["trajectory"] = [_sampled(part, rng) for part in plain.trajectories]
    if len(data["trajectory"]) == 1 or rng.random() < 0.3:
        data["trajectory"].append({**data["trajectory"][0], "name": "again"})
    bodies = list(data["mechanism"]["bodies"])
    varied = {own["parameter"] for own in data["design"].values() if "parameter" in own}
    masses = [f"bodies.{name}.mass" for name in bodies]
    if free := [path for path in masses if path not in varied]:
        for own in data["trajectory"]:
            own["set"] = {free[0]: float(10 ** rng.uniform(-2, 0.5))}
    data["design"] = dict(list(data["design"].items())[:2])
    data["design"].pop("constraints", None)
    data["targets"], data["assignment"] = [], {"starts": 1, "steps": 3}
    data["expansion"] = {"order": 1, "modes": [1], "q": data["trajectory"][0]["q"][0]}
    case = load_text(json.dumps(data))
    asked: list[Asked] = []
    for _ in range(int(rng.integers(1, 3))):
        target, own = _band(case, rng)
        data["targets"].append(target)
        asked += own
    return load_text(json.dumps(data)), asked


def _sampled(part: Any, rng: np.random.Generator) -> dict[str, Any]:
    """Some samples of a trajectory at uneven times; in half of the cases q jumps once."""
    given = part.trajectory
    few = np.sort(rng.choice(len(given.q), int(rng.integers(5, 30)), replace=False))
    q = given.q[few]
    if rng.random() < 0.5:
        q = np.roll(q, int(rng.integers(len(q))), axis=0)
    time = np.cumsum(rng.uniform(0.2, 1.0, len(q)))
    time = (time - time[0]) / (time[-1] - time[0])
    return {"name": f"m{part.name}", "time": time.tolist(), "q": q.tolist()}


def _band(case: ea.Case, rng: np.random.Generator) -> tuple[dict[str, Any], list[Asked]]:
    """A target, and its band along each trajectory that it holds on."""
    path, y = case.trajectory, case.initial_design
    hz = case.model().frequencies(path.q, y, 2)
    level = float(hz[rng.integers(len(hz)), rng.integers(2)] * rng.uniform(0.9, 1.1))
    margin = float(rng.uniform(0.002, 0.02))
    time, middle = np.array([0.0, 1.0]), np.array([level, level])
    if (form := rng.random()) < 0.3:  # a peak between two samples
        at, width = rng.uniform(0.05, 0.95), 10 ** rng.uniform(-3.5, -1.5)
        time = np.array([0.0, at - width, at, at + width, 1.0])
        middle = level * np.array([1.0, 1.0, rng.choice([0.6, 1.5]), 1.0, 1.0])
    elif form < 0.6:  # finer than the samples
        time = np.linspace(0.0, 1.0, int(rng.integers(20, 60)))
        middle = level * (1.0 + 0.05 * rng.normal(size=len(time)))
    target: dict[str, Any] = {
        "keep_out": {
            "harmonic": 1.0,
            "of": {"time": time.tolist(), "frequency": middle.tolist()},
            "margin": margin,
        }
    }
    names, (first, last) = [part.name for part in path.parts], (0.0, 1.0)
    if (narrow := rng.random()) < 0.6:
        names = [str(rng.choice(names))]
        target["trajectory"] = names[0]
    if narrow < 0.4:  # at times between two samples
        first = float(rng.uniform(0.0, 0.9))
        last = float(first + (1.0 - first) * rng.choice([rng.uniform(1e-3, 1.0), 1e-3]))
        target["during"] = [first, last]
    return target, [Asked(name, first, last, time, middle, margin) for name in names]


def counts(case: ea.Case, y: np.ndarray, asked: Asked) -> np.ndarray:
    """The modes below each edge (2, n) at many instants, the first and last of all."""
    (part,) = (part.trajectory for part in case.trajectory.parts if part.name == asked.name)
    inner = np.random.default_rng(1).uniform(asked.first, asked.last, COUNTED)
    knots = asked.time_s[(asked.time_s > asked.first) & (asked.time_s < asked.last)]
    at = np.concatenate([inner, knots, [asked.first, asked.last]])
    q = part.motion.poses(at)
    middle = np.interp(at, asked.time_s, asked.middle_hz)
    model = case.model()
    available = model.n_dof - model.n_rigid
    count = min(4, available)
    while True:
        hz = model.frequencies(q, y, count)
        if count == available or (hz[:, -1] > 1.1 * middle.max()).all():
            break
        count = min(2 * count, available)
    edges = (middle * (1.0 - asked.margin), middle * (1.0 + asked.margin))
    return np.array([(hz < edge[:, None]).sum(axis=1) for edge in edges])


@pytest.mark.parametrize("seed", MANY)
def test_bands_of_every_form_are_judged_as_counting_at_many_instants_does(seed: int) -> None:
    """None is called clear with a mode inside, none violated that is clear."""
    case, asked = demanding(seed)
    found = ea.assign(case)
    results, y = found.results, np.array(list(found.design.values()))
    row = results.assignment
    below = [counts(case, y, own) for own in asked]
    constant = [bool((own == own[0, 0]).all()) for own in below]
    assert len(row.clearances) == len(asked)
    for said, own in zip(row.clearances, below, strict=True):
        if said.clear:
            assert (own == said.below).all()
    if row.verdict == "reached":
        assert all(said.clear for said in row.clearances)
        assert all(constant)
    for target in results.targets:
        clear, constant = constant[: len(target.along)], constant[len(target.along) :]
        if all(clear):
            assert target.satisfied
