"""JSON Schema of case files, from the same models that validate them."""

from __future__ import annotations

from typing import Any

from pydantic.json_schema import GenerateJsonSchema

from eigassign.case.document import Document


class _Quiet(GenerateJsonSchema):
    """Empty mappings as defaults need no mention (and no warning)."""

    ignored_warning_kinds = {"skipped-choice", "non-serializable-default"}  # noqa: RUF012


def json_schema() -> dict[str, Any]:
    """JSON Schema (2020-12); quantities are numbers (SI) or text with a unit."""
    schema = _without_null(Document.model_json_schema(schema_generator=_Quiet))
    definitions = schema["$defs"]
    design = definitions["Design"]
    parameters, constraints = (design["properties"][k] for k in ("parameters", "constraints"))
    design["properties"] = {"constraints": constraints}
    design["additionalProperties"] = parameters["additionalProperties"]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def _without_null(node: Any) -> Any:
    """An optional key is left out of a file, never null."""
    if isinstance(node, list):
        return [_without_null(inner) for inner in node]
    if not isinstance(node, dict):
        return node
    kept = {key: _without_null(inner) for key, inner in node.items()}
    if kept.get("default", 0) is None:
        del kept["default"]
    options = [option for option in kept.get("anyOf", ()) if option != {"type": "null"}]
    if len(options) == 1:
        del kept["anyOf"]
        kept.update(options[0])
    return kept
