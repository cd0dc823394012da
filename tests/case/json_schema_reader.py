"""As much of JSON Schema as that of case files uses, written down once more, independently."""

import re
from typing import Any

from eigassign.case import CaseFile, json_schema, parse, read_yaml

SCHEMA = json_schema()


def reads_back(text: str, described: bool = True) -> CaseFile:
    """The case of a text; resolved it is the same case, and both are as the schema says."""
    case = parse(text.encode(), "case.yaml")
    resolved = case.resolved()
    again = parse(resolved.encode(), "case.yaml")
    assert (again, hash(again), again.resolved()) == (case, hash(case), resolved)
    assert (again.design.parameters, again.design.catalogues) == (
        case.design.parameters,
        case.design.catalogues,
    )
    assert {w.path for w in again.warnings} == {w.path for w in case.warnings}
    for written in (text, resolved):
        assert accepts(SCHEMA, read_yaml(written.encode(), "f").tree) == described
    return case


def accepts(schema: dict[str, Any], value: Any) -> bool:
    """Whether ``value``, as read from YAML, is what ``schema`` describes."""
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
    kind = schema.get("type", "object" if "required" in schema else None)
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
    known, others = schema.get("properties", {}), schema.get("additionalProperties", {})
    if any(key not in value for key in schema.get("required", ())):
        return False
    return all(
        accepts(known[key], inner)
        if key in known
        else others is not False and accepts(others, inner)
        for key, inner in value.items()
    )
