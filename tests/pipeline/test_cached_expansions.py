"""What comes from the cache is what would be computed, bit for bit, and only what takes long."""

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy as np
import pytest
from run_cases import ONE_SHOT, SHIPPED, TARGET, automatic, case_of, chain, shipped
from scipy import sparse

from eigassign import Case
from eigassign.modal import Expansion, tree_arrays
from eigassign.output import Cache
from eigassign.pipeline import Options, affordable_order, expand_plan, expansion_key, solve_case
from eigassign.study import Plan, plan_expansion

FROM_CACHE = "the expansion coefficients come from the cache"


def plan_of(case: Case) -> Plan:
    trajectory = case.trajectory if case.file.trajectory is not None else None
    return plan_expansion(case.file, case.model(), trajectory)


def expanded(case: Case, cache: Cache | None) -> tuple[Expansion, Expansion, list[str]]:
    expansions, notes = expand_plan(case.model(), plan_of(case), cache)
    return expansions.full, expansions.linear, notes


def assert_same_bits(one: Expansion, other: Expansion) -> None:
    a, b = (tree_arrays(expansion) for expansion in (one, other))
    assert {k: v.tobytes() for k, v in a.items()} == {k: v.tobytes() for k, v in b.items()}


@pytest.mark.parametrize(
    "text",
    [
        shipped(),
        automatic((TARGET, TARGET + "\n  - {mode: 2, frequency: 450 Hz}")),
        chain(3, "{stiffness: 3000}", "absolute"),
        (SHIPPED.parent / "four_bar.yaml").read_text("utf-8"),  # loops
    ],
)
def test_a_hit_equals_a_recomputation_bit_for_bit(text: str, tmp_path: Path) -> None:
    case, cache = case_of(tmp_path, text), Cache(tmp_path / "cache")
    fresh = expanded(case, cache)
    known = expanded(case_of(tmp_path, text), cache)
    again = expanded(case_of(tmp_path, text), None)
    assert FROM_CACHE in known[2]
    assert FROM_CACHE not in [*fresh[2], *again[2]]
    for k in (0, 1):
        assert_same_bits(fresh[k], known[k])
        assert_same_bits(again[k], known[k])
        np.testing.assert_array_equal(fresh[k].coefficients, known[k].coefficients)
        np.testing.assert_array_equal(fresh[k].indices, known[k].indices)


LARGE = (
    *(("samples: 152", "samples: 3"), ("order: 4", "order: 20")),
    ("modes: [1]", f"modes: {list(range(1, 15))}"),
)  # 0.6 s


@pytest.mark.parametrize(
    ("rule", "small", "large"),
    [("always", 1, 1), ("auto", 0, 1), (None, 0, 1), ("never", 0, 0)],
)
def test_what_is_cached_follows_the_rule_and_the_size(
    rule: str | None,
    small: int,
    large: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("EIGASSIGN_CACHE", raising=False)
    if rule is not None:
        monkeypatch.setenv("EIGASSIGN_CACHE", rule)
    for name, text, count in (("small", shipped(), small), ("large", shipped(*LARGE), large)):
        case = case_of(tmp_path, text + ONE_SHOT)
        solve_case(case, Options(cache_dir=tmp_path / name, study="none"))
        assert len(list((tmp_path / name).glob("*.h5"))) == count, name


CHANGES = {
    "a density": ("density: 2690.007033", "density: 2690.007034"),
    "a length": ("length: 0.45", "length: 0.4500000001"),
    "a mesh": ("elements: 3", "elements: 4"),
    "a body": ("forearm.end, mass: 0}", "forearm.end, inertia: 1e-9}"),
    "a drive": ("{joint: shoulder}", "{joint: shoulder, drive: locked}"),
    "an angle's meaning": (", angle: absolute", ""),
    "a parameter": ("bodies.tool_mass.mass", "bodies.tool_mass.inertia"),
    "the point in q": ("[1.817, 5.312]", "[1.817, 5.3120000001]"),
    "the point in y": ("[0.125, 0.125]", "[0.125, 0.1250000001]"),
    "the order": ("order: 4", "order: 3"),
    "the modes": ("modes: [1]", "modes: [1, 2]"),
}
SAME = {
    "a title": ("title: Two-link", "title: The two-link"),
    "a unit": ("max: 250 g", "max: 0.25"),
    "a target": ("190 Hz", "191 Hz"),
    "a bound": ("elbow_mass.mass, min: 0, max: 250", "elbow_mass.mass, min: 0, max: 240"),
    "the trajectory": ("samples: 152", "samples: 77"),
    "the tolerance": ("max_error: 2 %", "max_error: 3 %"),
}


def key_of(folder: Path, text: str) -> str:
    case = case_of(folder, text)
    plan = plan_of(case)
    return expansion_key(case.model(), plan, affordable_order(case.model(), plan.order))


@pytest.mark.parametrize("change", CHANGES)
def test_whatever_changes_a_number_changes_the_key(change: str, tmp_path: Path) -> None:
    changed = shipped(CHANGES[change])
    if change == "a parameter":
        changed = changed.replace("max: 250 g}\n\n", "max: 0.25}\n\n")
    assert key_of(tmp_path, changed) != key_of(tmp_path, shipped())


@pytest.mark.parametrize("change", SAME)
def test_what_changes_no_coefficient_keeps_the_key(change: str, tmp_path: Path) -> None:
    assert key_of(tmp_path, shipped(SAME[change])) == key_of(tmp_path, shipped())


def _arrays(thing: object) -> Iterator[np.ndarray]:
    """All arrays that count, to be changed in place."""
    if isinstance(thing, np.ndarray):
        yield thing
    elif sparse.issparse(thing):
        yield thing.data
    elif isinstance(thing, tuple):
        for part in thing:
            yield from _arrays(part)
    elif is_dataclass(thing):
        for field in fields(thing):
            if field.name not in ("rails", "limits"):
                yield from _arrays(getattr(thing, field.name))


def test_every_array_of_the_pencil_counts(tmp_path: Path) -> None:
    case = case_of(tmp_path, shipped())
    model, plan = case.model(), plan_of(case)
    plain, count = expansion_key(model, plan, 4), 0
    for array in _arrays(model.pencil):
        if array.size:
            array.setflags(write=True)
            flat, old = array.reshape(-1), array.flat[-1]
            flat[-1] = not old if array.dtype == bool else old + 1
            assert expansion_key(model, plan, 4) != plain, array
            flat[-1], count = old, count + 1
    assert count > 20
    assert expansion_key(model, plan, 4) == plain


def test_a_set_too_large_is_taken_to_a_lower_order_and_said_so(tmp_path: Path) -> None:
    bodies = "".join(f"    e{i}: {{at: l{i % 3}.end, mass: 0.01}}\n" for i in range(30))
    designed = "  e{0}: {{parameter: bodies.e{0}.mass, min: 0, max: 20 g}}\n"
    design = "".join(designed.format(i) for i in range(30))
    text = chain(3).replace("coordinates:", bodies + "coordinates:")
    case = case_of(tmp_path, text.replace("trajectory:", design + "trajectory:"))
    expansions, notes = expand_plan(case.model(), plan_of(case), None)
    assert (expansions.order, expansions.full_order) == (4, 3)
    assert expansions.linear.order == 4
    assert expansions.full.order == 3
    assert any("stops at order 3" in note for note in notes)
