"""JSON Schema of case files, from the same models that validate them."""

from __future__ import annotations

from typing import Any

from eigassign.case.document import Document


def json_schema() -> dict[str, Any]:
    """JSON Schema (2020-12); quantities are numbers (SI) or text with a unit."""
    schema = Document.model_json_schema()
    definitions = schema["$defs"]
    design = definitions["Design"]
    parameters, constraints = (design["properties"][k] for k in ("parameters", "constraints"))
    design["properties"] = {"constraints": constraints}
    design["additionalProperties"] = parameters["additionalProperties"]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
