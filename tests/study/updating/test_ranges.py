"""Frequencies known to lie in ranges: all parameters that explain them, against a grid of all."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eigassign.case import from_mapping, parse, read_yaml
from eigassign.errors import CaseError
from eigassign.pipeline import update_case
from eigassign.study import BuiltCase

CASES = Path(__file__).parents[3] / "cases"
NAMES = ("two_link", "palletiser", "four_bar", "slider_crank", "five_bar", "gantry", "arm_3r")
KINDS = ("mass", "youngs_modulus", "density", "stiffness")
TEXT = (CASES / "arm_update.yaml").read_text().replace("elements: 6", "elements: 2")
POSES = ([0.0, 0.35], [0.5, 1.2], [1.0, 2.0])


def ranged(text: str, ranges: np.ndarray) -> BuiltCase:
    """A case with ranges (n_p, n_modes, 2) in Hz measured at `POSES`."""
    own = [
        f"  - {{q: {q}, mode: {k}, frequency: [{low!r}, {high!r}]}}\n"
        for q, row in zip(POSES, ranges.tolist(), strict=True)
        for k, (low, high) in enumerate(row, 1)
    ]
    text = text.replace("measurements: {file: arm_update.csv}", "measurements:\n" + "".join(own))
    return BuiltCase(parse(text.encode(), CASES / "case.yaml"))


TRUTH = np.array([52.6e3, 17.8e3, 1.83])


def arm_ranges(width: float = 0.01) -> np.ndarray:
    """Ranges (n_p, 2, 2) in Hz of a share about the frequencies of `TRUTH`."""
    model = BuiltCase(parse(TEXT.encode(), CASES / "case.yaml")).model()
    return model.frequencies(POSES, TRUTH, 2)[..., None] * [1.0 - width, 1.0 + width]


def random_case(name: str, seed: int) -> tuple[BuiltCase, np.ndarray]:
    """Two properties of a shipped mechanism with wide bounds, and the ranges (n_p, 2, 2) in Hz."""
    rng, path = np.random.default_rng(seed), CASES / f"{name}.yaml"
    tree: dict[str, Any] = dict(read_yaml(path.read_bytes(), str(path)).tree)
    tree = {key: tree[key] for key in ("title", "mechanism", "coordinates", "trajectory")}
    tree["mechanism"] = {"gravity": "none", **tree["mechanism"]}
    every = from_mapping(tree, path).with_every_property(places=False).design.parameters
    own = [p for p in every if p.split(".")[-1] in KINDS and every[p].min > 0.0]
    paths = [str(p) for p in rng.permutation(own)[:2]]
    at = np.array([every[p].min for p in paths])
    lower, upper = at * rng.uniform(0.5, 0.8, 2), at * rng.uniform(1.25, 2.0, 2)
    tree["design"] = {
        f"p{k}": {"parameter": p, "min": float(lower[k]), "max": float(upper[k])}
        for k, p in enumerate(paths)
    }
    plain = BuiltCase(from_mapping(tree, path))
    q = plain.trajectory.q[:: -(-len(plain.trajectory.q) // 3)]
    hz = plain.model().frequencies(q, lower + rng.uniform(0.2, 0.8, 2) * (upper - lower), 2)
    width = 10.0 ** rng.uniform(-2.5, -1.5, hz.shape)
    middle = hz * (1.0 + rng.uniform(-0.9, 0.9, hz.shape) * width)
    ranges = np.stack([middle * (1.0 - width), middle * (1.0 + width)], axis=-1)
    tree["measurements"] = [
        {"q": pose.tolist(), "mode": k, "frequency": own.tolist()}
        for pose, row in zip(q, ranges, strict=True)
        for k, own in enumerate(row, 1)
    ]
    return BuiltCase(from_mapping(tree, path)), ranges


def ranges_are_those_of_a_grid(name: str, seed: int, n: int) -> None:
    case, ranges = random_case(name, seed)
    results = update_case(case).results
    rows, columns = results.parameters, [*case.file.design.parameters.values()]
    q = np.array([one.q for one in results.measurements[::2]])
    low, high = (np.array([getattr(p, end) for p in columns]) for end in ("min", "max"))
    grid = np.stack(np.meshgrid(*np.linspace(low, high, n).T), axis=-1).reshape(-1, 2)
    explains, model = np.ones(len(grid), dtype=bool), case.model()
    for pose, own in zip(q, ranges, strict=True):
        hz = model.frequencies(np.tile(pose, (explains.sum(), 1)), grid[explains], 2)
        explains[explains] = ((hz >= own[:, 0]) & (hz <= own[:, 1])).all(axis=1)
    assert results.verdict == "fitted"
    step = (high - low) / (n - 1)
    inner = np.array([[row.low, row.high] for row in rows]).T
    outer = np.array([[row.outer_low, row.outer_high] for row in rows]).T
    slack = 1e-6 * (high - low)  # the exact solves of the two are rounded otherwise
    beyond = np.array([inner[0] - outer[0], outer[1] - inner[1]])
    assert (beyond >= -slack).all()
    assert (beyond <= 0.011 * np.ptp(inner, axis=0) + slack).all()  # boxes end at 1 %
    assert explains.any()
    least, most = grid[explains].min(axis=0), grid[explains].max(axis=0)
    assert (outer[0] - slack <= least).all()
    assert (most <= outer[1] + slack).all()
    assert (inner[0] <= least + step).all()
    assert (inner[1] >= most - step).all()


@pytest.mark.parametrize(("name", "seed"), [("two_link", 7), ("slider_crank", 17)])
def test_no_explaining_design_lies_outside_the_outer_ranges(name: str, seed: int) -> None:
    ranges_are_those_of_a_grid(name, seed, 100)


@pytest.mark.slow  # a minute each at most
@pytest.mark.parametrize("seed", range(20))
def test_ranges_of_random_mechanisms_are_those_of_a_grid(seed: int) -> None:
    ranges_are_those_of_a_grid(NAMES[seed % len(NAMES)], seed, 300)


def test_an_update_by_ranges_leaves_them_in_the_case() -> None:
    found = update_case(ranged(TEXT, arm_ranges()))
    results = found.results
    assert results.headline.startswith("Explained: designs lie in all 6 ranges. k1 from ")
    assert (results.fit, results.minima) == (None, ())
    left = parse(found.case.file.resolved().encode(), "case.yaml").uncertain
    assert left is not None
    for row, true in zip(results.parameters, TRUTH, strict=True):
        own = left.entries[row.name]
        assert row.outer_low is not None
        assert row.lower <= row.outer_low <= row.low <= true <= row.high <= row.outer_high
        assert (own.min, own.max) == (row.outer_low, row.outer_high)
        assert (own.value, own.standard_deviation) == (row.value, None)


def test_ranges_that_contradict_are_said_so_with_the_measurement_that_is_missed() -> None:
    ranges = arm_ranges()
    ranges[1, 0] *= 1.1
    found = update_case(ranged(TEXT, ranges))
    assert found.results.verdict == "poor_fit"
    said = "NOT EXPLAINED: no design within the bounds (proved) lies in all 6 ranges; the nearest"
    assert found.results.headline.startswith(f"{said} misses ")
    assert "measurements[2], mode 1, by " in found.results.headline  # one of those missed most
    assert found.case.file.uncertain is None


@pytest.mark.parametrize(
    "other",
    [
        "l: {parameter: links.forearm.length, min: 0.6, max: 0.64}",
        "l: {parameter: sections.tube.inner_diameter, min: 50 mm, max: 54 mm}",
    ],
)
def test_what_does_not_raise_or_lower_every_frequency_has_no_outer_range(other: str) -> None:
    line = "k2: {parameter: coordinates.q2.drive.stiffness, min: 14 kN m/rad, max: 22 kN m/rad}"
    text = TEXT.replace(line, other).replace("stiffness: 15 kN", "stiffness: 17.8 kN")
    found = update_case(ranged(text[: text.index("expansion:")], arm_ranges()))
    assert found.results.headline.startswith("NOT IDENTIFIED: l may be anything within the bounds")
    for row in found.results.parameters:
        assert (row.outer_low, row.outer_high) == (None, None)
        assert row.low < row.value < row.high
        own = found.case.file.uncertain.entries[row.name]
        assert (own.min, own.max) == (row.low, row.high)
    assert any("no range is known that no value lies outside of" in n for n in found.results.notes)


@pytest.mark.parametrize(
    ("second", "message"),
    [
        ("frequency: 33 Hz, deviation: 0.1 Hz", "do not go together: give one kind"),
        ("frequency: [33 Hz, 32 Hz]", "is not below the second"),
        ("frequency: [32 Hz, 33 Hz], deviation: 0.1 Hz", "a range has none: leave it out"),
        ("frequency: 33 Hz", "missing: give one, or a range such as"),
        ("frequency: [33 Hz]", "entry 2 is missing"),
    ],
)
def test_ranges_in_the_case_that_are_none_are_refused(second: str, message: str) -> None:
    own = "[{q: [0, 1], mode: 1, frequency: [9.9 Hz, 10 Hz]}, {q: [0, 1], mode: 2, " + second + "}]"
    text = TEXT.replace("{file: arm_update.csv}", own)
    with pytest.raises(CaseError, match=message) as error:
        update_case(BuiltCase(parse(text.encode(), "c.yaml")))
    assert error.value.problems[0].path.startswith("measurements[1]")
