from __future__ import annotations

import json
import logging
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from run_cases import TARGET, automatic, case_of, chain, shipped

from eigassign import Case
from eigassign.errors import UsageError
from eigassign.modal import (
    Expansion,
    expansion_arrays,
    expansions_from_arrays,
    flatten,
    pencil_parts,
)
from eigassign.output import Cache
from eigassign.pipeline import Options, affordable_order, expand_plan, expansion_key, solve_case
from eigassign.study import Plan, plan_expansion


def plan_of(case: Case) -> Plan:
    trajectory = case.trajectory if case.file.trajectory is not None else None
    return plan_expansion(case.file, case.model(), trajectory)


def expanded(case: Case, cache: Cache | None) -> tuple[Expansion, Expansion, list[str]]:
    expansions, notes = expand_plan(case.model(), plan_of(case), cache)
    return expansions.full, expansions.linear, notes


def assert_same_bits(one: Expansion, other: Expansion) -> None:
    a, b = expansion_arrays(one), expansion_arrays(other)
    assert list(a) == list(b)
    for name, array in a.items():
        assert array.dtype == b[name].dtype
        assert array.shape == b[name].shape
        assert array.tobytes() == b[name].tobytes(), name


@pytest.mark.parametrize(
    "text",
    [
        shipped(),
        automatic((TARGET, TARGET + "\n  - {mode: 2, frequency: 450 Hz}")),
        chain(3, "{stiffness: 3000}", "absolute"),
    ],
)
def test_a_hit_equals_a_recomputation_bit_for_bit(text: str, tmp_path: Path) -> None:
    case, cache = case_of(tmp_path, text), Cache(tmp_path / "cache")
    fresh = expanded(case, cache)
    known = expanded(case_of(tmp_path, text), cache)
    again = expanded(case_of(tmp_path, text), None)
    assert "the expansion coefficients come from the cache" in known[2]
    assert "the expansion coefficients come from the cache" not in [*fresh[2], *again[2]]
    for k in (0, 1):
        assert_same_bits(fresh[k], known[k])
        assert_same_bits(again[k], known[k])
        np.testing.assert_array_equal(fresh[k].coefficients, known[k].coefficients)
        np.testing.assert_array_equal(fresh[k].indices, known[k].indices)


def test_what_comes_from_the_cache_is_frozen(tmp_path: Path) -> None:
    case, cache = case_of(tmp_path, shipped()), Cache(tmp_path / "cache")
    expanded(case, cache)
    full, linear, _ = expanded(case, cache)
    for expansion in (full, linear):
        named = {name: getattr(expansion, name) for name in ("q0", "y0", "directions")}
        named |= {"indices": expansion.space.indices, "halves": expansion.vector_space.indices}
        named |= dict(enumerate(expansion.vectors))
        named |= {c.modes: c.coefficients for c in expansion.clusters}
        for name, array in named.items():
            assert not array.flags.writeable, name


def test_a_whole_solution_from_the_cache_has_the_same_bits(tmp_path: Path) -> None:
    case = case_of(tmp_path, shipped())
    options = Options(cache_dir=tmp_path / "cache")
    first, second, third = (
        solve_case(case, o) for o in (options, options, Options(use_cache=False))
    )
    for other in (second, third):
        assert first.design == other.design
        np.testing.assert_array_equal(first.predicted_hz, other.predicted_hz)
        np.testing.assert_array_equal(first.exact_hz, other.exact_hz)


@pytest.mark.parametrize("damage", ["truncated", "flipped"])
def test_a_damaged_entry_is_set_aside_and_rebuilt_with_a_warning(
    damage: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    case, cache = case_of(tmp_path, shipped()), Cache(tmp_path / "cache")
    fresh = expanded(case, cache)
    (file,) = (tmp_path / "cache").glob("*.h5")
    data = bytearray(file.read_bytes())
    if damage == "flipped":
        data[-100] ^= 1
    file.write_bytes(data[: len(data) if damage == "flipped" else len(data) // 2])
    with caplog.at_level(logging.WARNING):
        rebuilt = expanded(case, cache)
    assert "set aside" in caplog.text
    assert_same_bits(fresh[0], rebuilt[0])
    assert len(list((tmp_path / "cache").glob("*.damaged"))) == 1
    assert "the expansion coefficients come from the cache" in expanded(case, cache)[2]


@pytest.mark.parametrize("spoiled", ["missing", "wrong shape", "no layout"])
def test_an_intact_entry_with_other_content_is_recomputed_with_a_warning(
    spoiled: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    case, cache = case_of(tmp_path, shipped()), Cache(tmp_path / "cache")
    fresh = expanded(case, cache)
    entry = expansion_key(case.model(), plan_of(case), 4)
    stored = cache.load(entry)
    assert stored is not None
    tree = json.loads(stored["tree"].tobytes())
    full, linear = (part["fields"] for part in tree["content"]["tuple"])
    if spoiled == "missing":
        del full["q0"]
    elif spoiled == "wrong shape":
        linear["directions"] = full["q0"]
    text = np.frombuffer(json.dumps(tree).encode(), dtype=np.uint8)
    flat = {"numbers": np.zeros(3)} if spoiled == "no layout" else {**stored, "tree": text}
    cache.store(entry, flat, {})
    with caplog.at_level(logging.WARNING):
        rebuilt = expanded(case, cache)
    assert "computed anew" in caplog.text
    assert_same_bits(fresh[1], rebuilt[1])


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


def _numbers(parts: object) -> Iterator[np.ndarray]:
    if isinstance(parts, np.ndarray):
        yield parts
    elif isinstance(parts, list):
        for part in parts:
            yield from _numbers(part)


def test_every_array_of_the_pencil_counts(tmp_path: Path) -> None:
    case = case_of(tmp_path, shipped())
    model = case.model()
    plain, plan = key_of(tmp_path, shipped()), plan_of(case)
    pencil = model.pencil
    for name in ("rows", "columns", "to_program", "shift", "rigid", "stiffness", "mass"):
        value = getattr(pencil, name) * 1
        (value.data if name in ("stiffness", "mass") else value.reshape(-1))[-1:] += 1
        other = replace(model, pencil=replace(pencil, **{name: value}))
        assert expansion_key(other, plan, 4) != plain, name
    steps = pencil.program.steps
    for k, step in enumerate(steps):
        changed = replace(step, left=step.left[::-1] + 1)
        program = replace(pencil.program, steps=(*steps[:k], changed, *steps[k + 1 :]))
        other = replace(model, pencil=replace(pencil, program=program))
        assert expansion_key(other, plan, 4) != plain, step.kind
    assert sum(array.size for array in _numbers(pencil_parts(pencil))) > 1000


def test_only_arrays_that_can_be_stored_exactly_are() -> None:
    with pytest.raises(UsageError, match="cannot be stored"):
        flatten({"a": np.zeros(3, dtype=np.float32)})


def test_what_is_no_expansion_is_not_taken_for_one() -> None:
    with pytest.raises(UsageError, match="not expansions"):
        expansions_from_arrays({"q0": np.zeros(2)}, 2)


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
