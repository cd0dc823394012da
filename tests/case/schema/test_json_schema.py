"""The JSON Schema describes the same files as the reader accepts."""

import json
from collections.abc import Iterator
from dataclasses import fields
from typing import Any

from json_schema_reader import SCHEMA, accepts
from small_case import TEXT

from eigassign.case import CaseFile, read_yaml


def nodes(node: Any) -> Iterator[dict[str, Any]]:
    if isinstance(node, dict):
        yield node
    for inner in (
        node.values() if isinstance(node, dict) else node if isinstance(node, list) else ()
    ):
        yield from nodes(inner)


def test_it_has_exactly_the_top_keys_of_the_file() -> None:
    keys = {field.name for field in fields(CaseFile) if field.name in SCHEMA["properties"]}
    assert set(SCHEMA["properties"]) == keys
    assert len(keys) == 16
    assert SCHEMA["required"] == ["title", "mechanism"]
    assert SCHEMA["additionalProperties"] is False


def test_it_is_json_and_every_reference_in_it_exists() -> None:
    json.dumps(SCHEMA, allow_nan=False)
    references = [node["$ref"] for node in nodes(SCHEMA) if "$ref" in node]
    assert {r.rpartition("/")[2] for r in references} <= set(SCHEMA["$defs"])
    assert len(references) > 10


def test_it_never_allows_null() -> None:
    assert not [node for node in nodes(SCHEMA) if node.get("type") == "null"]


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
