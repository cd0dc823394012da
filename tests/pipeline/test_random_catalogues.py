"""Catalogues of random arms, with prices, bands and limits: the same best as trying them all."""

import itertools
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from eigassign.case import parse
from eigassign.pipeline import solve_case
from eigassign.study import BuiltCase

TEXT = (Path(__file__).parents[2] / "cases" / "two_link.yaml").read_text()
HEAD = TEXT.partition("design: #")[0]
SLACK = 1e-5  # relative, by which modes keep off a band at the samples
LISTS = {
    "m1": ("bodies.elbow_mass.mass", 0.0, 0.5, "kg"),
    "m2": ("bodies.tool_mass.mass", 0.0, 0.5, "kg"),
    "d": ("sections.rod.diameter", 0.02, 0.05, "m"),
    "k1": ("coordinates.q1.drive.stiffness", 2e3, 4e5, "N m/rad"),
    "k2": ("coordinates.q2.drive.stiffness", 1e3, 2e5, "N m/rad"),
}


def random_case(rng: np.random.Generator, most: int) -> BuiltCase:
    """The arm on drives, its targets set about what a combination drawn at random does."""
    samples = int(rng.integers(2, 12))
    head = HEAD.replace("samples: 152", f"samples: {samples}")
    for joint, k in (("{joint: shoulder}", 2e4), ("{joint: elbow, angle: absolute}", 1e4)):
        head = head.replace(joint, f"{joint[:-1]}, drive: {{stiffness: {k}}}}}")
    head = head.replace(
        "rod: {area: 7.06317856e-4, bending_inertia: 3.97e-8}",
        "rod: {shape: circle, diameter: 30 mm}",
    )
    names = list(rng.permutation(list(LISTS))[: rng.integers(2, 6)])
    sizes = {name: int(rng.integers(2, 20)) for name in names}
    while np.prod(list(sizes.values())) > most:
        largest = max(sizes, key=lambda name: sizes[name])
        sizes[largest] -= 1
    design = "design:\n"
    for name in names:
        path, low, high, _ = LISTS[name]
        values = np.sort(rng.uniform(low, high, sizes[name]))
        if low > 0.0:
            values = np.sort(low * (high / low) ** rng.random(sizes[name]))
        given = "values: [" + ", ".join(f"{v:.5g}" for v in values) + "]"
        price = f"{rng.normal(0.3, 1.0) / (high - low):.4g}"
        design += f"  {name}: {{parameter: {path}, {given}, price: {price}}}\n"
    plain = design + "targets:\n  - {mode: 1, at_least: 1 Hz}\n"
    case = BuiltCase(parse((head + plain).encode(), "case.yaml"))
    lower, upper = (np.array([getattr(p, k) for p in case.file.design.parameters.values()])
                    for k in ("min", "max"))  # fmt: skip
    model, q = case.model(), case.trajectory.q
    drawn = lower + rng.random((12, len(lower))) * (upper - lower)
    hz = np.array([model.frequencies(q, y, 4) for y in drawn])
    targets = "targets:\n" + "".join(f"  - {one}\n" for one in random_targets(rng, hz))
    if rng.random() < 0.3:
        design += f"  mass: {{max: {np.quantile([model.mass(y) for y in drawn], 0.6):.6g}}}\n"
    return BuiltCase(parse((head + design + targets).encode(), "case.yaml"))


def random_targets(rng: np.random.Generator, hz: np.ndarray) -> Iterator[str]:
    """One or two of what may be asked, where some of the designs with modes ``hz`` keep it."""
    kinds = rng.permutation(["least", "most", "band", "band", "frequency"])[: rng.integers(1, 3)]
    for kind in dict.fromkeys(kinds):
        mode = int(rng.integers(1, 4))
        own = hz[:, :, mode - 1]
        match kind:
            case "least":
                yield f"{{mode: {mode}, at_least: {np.quantile(own.min(axis=1), 0.6):.6g}}}"
            case "most":
                yield f"{{mode: {mode}, at_most: {np.quantile(own.max(axis=1), 0.4):.6g}}}"
            case "band":
                low = np.quantile(own.max(axis=1), rng.uniform(0.2, 0.8))
                yield f"{{keep_out: [{low:.6g}, {low * rng.uniform(1.02, 1.2):.6g}]}}"
            case "frequency":
                yield f"{{mode: {mode}, frequency: {np.median(own):.6g}}}"


def brute_force(case: BuiltCase) -> list[tuple[float, tuple[float, ...]]]:
    """Objective and design of all combinations that meet all limits, the best first."""
    file, model, q = case.file, case.model(), case.trajectory.q
    columns = list(file.design.parameters.values())
    every = list(itertools.product(*(own.rows for own in file.design.catalogues)))
    designs = np.array([[v for row in rows for v in row] for rows in every])
    hz = model.frequencies(np.tile(q, (len(every), 1)), np.repeat(designs, len(q), axis=0), 5)
    hz = hz.reshape(len(every), len(q), 5)
    weights = np.convolve(np.diff(case.trajectory.time_s), [0.5, 0.5])
    price = (designs - case.initial_design) @ [c.price or 0.0 for c in columns]
    good = np.ones(len(every), dtype=bool)
    goals = [target for target in file.targets if target.kind == "frequency"]
    objective = price / 1e4 if goals else price
    for target in file.targets:
        if target.kind == "keep_out":
            low, high = target.keep_out
            below = (hz[:, 0] < low).sum(axis=1)
            under = np.where(np.arange(5) < below[:, None], hz.max(axis=1), 0.0).max(axis=1)
            over = np.where(np.arange(5) >= below[:, None], hz.min(axis=1), np.inf).min(axis=1)
            good &= (under <= low * (1.0 - SLACK)) & (over >= high * (1.0 + SLACK))
            continue
        own = hz[:, :, target.mode - 1]
        if target.kind == "at_least":
            good &= own.min(axis=1) >= target.at_least
        elif target.kind == "at_most":
            good &= own.max(axis=1) <= target.at_most
        else:
            error = own / target.frequency - 1.0
            objective = objective + error**2 @ weights / weights.sum() / len(goals)
    if file.design.mass is not None:
        good &= np.array([model.mass(y) for y in designs]) <= file.design.mass.max
    order = [k for k in np.argsort(objective, kind="stable") if good[k]]
    return [(float(objective[k]), tuple(designs[k])) for k in order]


def compared(case: BuiltCase) -> tuple[str, float, float]:
    """The verdict's kind, F of the answer and of the best of all."""
    row = solve_case(case).results.assignment
    best = next((F for F, y in brute_force(case) if is_clear(case, y)), np.inf)
    clear = all(one.clear for one in row.clearances)
    found = row.objective_optimal if row.catalogue.best[0].violation <= 1e-9 and clear else np.inf
    return row.optimality.kind, found, best


def is_clear(case: BuiltCase, y: tuple[float, ...]) -> bool:
    """True where no mode is in a band at 1000 instants of the motion either."""
    (path,) = (part.trajectory for part in case.trajectory.parts)
    q = path.motion.poses(np.linspace(path.time_s[0], path.time_s[-1], 1000))
    hz = case.model().frequencies(q, np.array(y), 5)
    bands = [target.keep_out for target in case.file.targets if target.kind == "keep_out"]
    return not any(((hz > low) & (hz < high)).any() for low, high in bands)


def agree(found: float, best: float) -> bool:
    return found == best or abs(found - best) <= 1e-7 * abs(best)


def test_the_best_of_random_catalogues_is_that_of_brute_force() -> None:
    for seed in (1, 3, 108):
        kind, found, best = compared(random_case(np.random.default_rng(seed), 120))
        assert kind == "proved"
        assert agree(found, best)
