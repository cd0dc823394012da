"""The JSON Schema describes the same files as the reader accepts."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any

from small_case import TEXT

from eigassign.case import CaseFile, json_schema
from eigassign.case.reader import read_yaml
from eigassign.case.schema.document import Document

SCHEMA = json_schema()


def nodes(node: Any) -> Iterator[dict[str, Any]]:
    if isinstance(node, dict):
        yield node
    for inner in (
        node.values() if isinstance(node, dict) else node if isinstance(node, list) else ()
    ):
        yield from nodes(inner)


def accepts(schema: dict[str, Any], value: Any) -> bool:
    """As much of JSON Schema as the schema uses, written down once more, independently."""
    if "$ref" in schema:
        return accepts(SCHEMA["$defs"][schema["$ref"].rpartition("/")[2]], value)
    for key in ("anyOf", "oneOf"):
        if key in schema and sum(accepts(option, value) for option in schema[key]) < 1:
            return False
    if "const" in schema and value != schema["const"]:
        return False
    if "enum" in schema and value not in schema["enum"]:
        return False
    return _typed(schema, value)


def _typed(schema: dict[str, Any], value: Any) -> bool:
    kinds = {"object": dict, "array": tuple, "string": str, "number": (int, float), "integer": int}
    kind = schema.get("type")
    if kind == "boolean" or isinstance(value, bool):
        return kind == "boolean" and isinstance(value, bool)
    if kind and not isinstance(value, kinds[kind]):
        return False
    if kind == "object":
        return _object(schema, value)
    if kind == "array":
        short = not schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", 10**9)
        each = schema.get("prefixItems") or [schema.get("items", {})] * len(value)
        return not short and len(each) == len(value) and all(map(accepts, each, value))
    if kind == "string":
        return re.search(schema.get("pattern", ""), value) is not None
    low, high = schema.get("minimum", -1e99), schema.get("maximum", 1e99)
    above = schema.get("exclusiveMinimum", -1e99)
    below = schema.get("exclusiveMaximum", 1e99)
    return kind is None or (low <= value <= high and above < value < below)


def _object(schema: dict[str, Any], value: dict[str, Any]) -> bool:
    known, others = schema.get("properties", {}), schema.get("additionalProperties", True)
    if any(key not in value for key in schema.get("required", ())):
        return False
    return all(
        accepts(known[key], inner) if key in known else others and accepts(others, inner)
        for key, inner in value.items()
    )


def test_it_has_exactly_the_top_keys_of_the_file() -> None:
    assert set(SCHEMA["properties"]) == set(Document.model_fields)
    assert SCHEMA["required"] == ["title", "mechanism"]
    assert SCHEMA["additionalProperties"] is False


def test_it_is_json_and_every_reference_in_it_exists() -> None:
    json.dumps(SCHEMA, allow_nan=False)
    references = [node["$ref"] for node in nodes(SCHEMA) if "$ref" in node]
    assert {r.rpartition("/")[2] for r in references} <= set(SCHEMA["$defs"])
    assert len(references) > 10


def test_it_never_allows_null() -> None:
    assert not [node for node in nodes(SCHEMA) if node.get("type") == "null"]


def test_it_accepts_the_small_case_with_units_and_without() -> None:
    tree = read_yaml(TEXT.encode(), "f").tree
    assert accepts(SCHEMA, tree)
    resolved = CaseFile.resolved(parsed()).encode()
    assert accepts(SCHEMA, read_yaml(resolved, "f").tree)


def parsed() -> CaseFile:
    from eigassign.case import parse

    return parse(TEXT.encode(), "case.yaml")


def test_it_refuses_what_the_reader_refuses() -> None:
    for old, new in [
        ("length: 0.45", "length: -1"),
        ("length: 0.45", "length: long"),
        ("length: 0.45", "lenght: 0.45"),
        ("elements: 3", "elements: 0"),
        ("shape: circle", "shape: triangle"),
        ("type: fixed", "type: welded"),
        ("order: 4", "order: 40"),
        ("min: 20 mm, ", ""),
        ("title: Arm\n", ""),
        ("{mode: 1, frequency: 190 Hz}", "{mode: 1}"),
        ("waypoints: [[0.3, 0.1], [0.2, 0.2]]", "waypoints: [[0.3], [0.2, 0.2]]"),
    ]:
        tree = read_yaml(TEXT.replace(old, new).encode(), "f").tree
        assert not accepts(SCHEMA, tree), new
