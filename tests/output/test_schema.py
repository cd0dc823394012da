"""Files of results are as their JSON Schema says, and every fact in that has words."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from synthetic_results import as_limit, make_results, studied

import eigassign as ea
from eigassign.cli import main, results_schema
from eigassign.output import CaseOutcome, to_json, write_files
from eigassign.study import ErrorRow, RunResults

CASES = Path(__file__).parents[2] / "cases"
FILES = ("run", "update", "batch", "chart", "charts")
TYPES = {
    "string": str, "boolean": bool, "integer": int, "number": (int, float), "array": list,
    "object": dict, "null": type(None),
}  # fmt: skip


def wrong(
    value: Any, node: dict[str, Any], schema: dict[str, Any], path: str = ""
) -> Iterator[str]:
    """Where a value is not as the schema says: the keywords that ours have, by their definition."""
    if "$ref" in node:
        yield from wrong(value, schema["$defs"][node["$ref"].rpartition("/")[2]], schema, path)
    if "anyOf" in node:
        found = [[*wrong(value, one, schema, path)] for one in node["anyOf"]]
        yield from min(found, key=len)
    if "enum" in node and value not in node["enum"]:
        yield f"{path}: {value!r}"
    names = node.get("type", [*TYPES])
    kinds = [TYPES[name] for name in ([names] if isinstance(names, str) else names)]
    is_kind = any(isinstance(value, kind) for kind in kinds)
    if not is_kind or (isinstance(value, bool) and bool not in kinds):
        yield f"{path}: {value!r} is no {names}"
        return
    if isinstance(value, dict):
        known = node.get("properties", {})
        yield from (
            f"{path}.{key} is missing" for key in node.get("required", ()) if key not in value
        )
        for key, inner in value.items():
            own = known.get(key, node.get("additionalProperties"))
            if own is None and known:
                yield f"{path}.{key} is not in the schema"
            yield from wrong(inner, own or {}, schema, f"{path}.{key}")
    elif isinstance(value, list):
        each = node.get("prefixItems") or [node.get("items", {})] * len(value)
        if len(each) != len(value):
            yield f"{path}: {len(value)} entries"
        for k, (inner, own) in enumerate(zip(value, each, strict=False)):
            yield from wrong(inner, own, schema, f"{path}[{k}]")


def mistakes(text: str | bytes, left_by: str) -> list[str]:
    schema = json.loads(json.dumps(results_schema(left_by)))
    return [*wrong(json.loads(text), schema, schema)]


@pytest.mark.parametrize("left_by", FILES)
def test_every_fact_has_words_and_a_type(left_by: str) -> None:
    schema = results_schema(left_by)
    for name, row in schema["$defs"].items():
        assert row["description"], name
        for key, fact in row["properties"].items():
            assert fact["description"], f"{name}.{key}"
            assert {"type", "$ref", "anyOf", "enum"} & set(fact) or fact.keys() == {"description"}


def every_kind() -> Iterator[RunResults]:
    results = make_results(n_targets=2, parts=(100, 52))
    (target, other) = results.targets
    endless = np.full(target.asked.lower.size, np.inf)
    limit = as_limit(target, "at_least", target.asked.lower, endless)
    lost = replace(other.error, predicted=ErrorRow(np.inf, np.inf))
    yield results
    yield studied(replace(results, targets=(limit, replace(other, error=lost))))
    yield make_results(n_t=0, n_y=0)


@pytest.mark.parametrize("results", [*every_kind()], ids=["goals", "limits", "nothing"])
def test_results_are_as_their_schema_says(results: RunResults) -> None:
    assert mistakes(to_json(results), "run") == []


@pytest.mark.parametrize(
    "name",
    [
        "two_link",
        pytest.param("milling_column", marks=pytest.mark.slow),  # bands
        pytest.param("scissor_lift", marks=pytest.mark.slow),  # catalogues
        pytest.param("five_bar", marks=pytest.mark.slow),  # two trajectories
    ],
)
def test_results_of_shipped_cases_are_as_their_schema_says(name: str) -> None:
    result = ea.assign(ea.load_case(CASES / f"{name}.yaml"))
    assert mistakes(to_json(result.results), "run") == []


def test_an_update_is_as_its_schema_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    main(["update", str(CASES / "arm_update.yaml"), "--figures", "none", "--report", "none"])
    text = (tmp_path / "results" / "arm_update_update" / "results.json").read_text()
    assert mistakes(text, "update") == []


def test_a_summary_is_as_its_schema_says(tmp_path: Path) -> None:
    ranges = (("mode 1", 1.0, 2.0, 3.0),)
    row = CaseOutcome("arm", "arm.yaml", "ok", 1.0, design=(("m", 1.0),), frequencies=ranges)
    write_files(tmp_path, [row, replace(row, name="b", seconds=2.0)])
    assert mistakes((tmp_path / "summary.json").read_text(), "batch") == []


def test_the_command_prints_the_schema_of_each_file(capsys: pytest.CaptureFixture[str]) -> None:
    for left_by in FILES:
        assert main(["schema", left_by]) == 0
        assert json.loads(capsys.readouterr().out) == results_schema(left_by)


def test_what_is_not_as_a_schema_says_is_found() -> None:
    found = json.loads(to_json(make_results()))
    found["price"] = "dear"
    found["targets"][0]["error"].pop("exact")
    found["more"] = 1
    said = mistakes(json.dumps(found), "run")
    assert len(said) == 3
    assert any("dear" in one for one in said)
