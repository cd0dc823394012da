"""JSON Schemas of the files of results, from the facts of their rows."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import is_dataclass
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import numpy as np

from eigassign.chart.results import ChartDocument
from eigassign.facts import hints, written
from eigassign.output.batch.summary import SummaryDocument
from eigassign.output.documents import RunDocument
from eigassign.output.reports.update import UpdateDocument

FILES = {  # by what leaves them
    "run": RunDocument,
    "update": UpdateDocument,
    "batch": SummaryDocument,
    "chart": ChartDocument,
}
_TYPES = {str: "string", bool: "boolean", int: "integer", float: "number", NoneType: "null"}
NUMBERS = {"type": "array", "items": {"type": ["number", "null", "array"]}}


def results_schema(left_by: str) -> dict[str, Any]:
    """JSON Schema (2020-12) of the file that a run, an update, a batch or a chart leaves."""
    found = dict[str, Any]()
    root = _schema(FILES[left_by], False, found)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **root, "$defs": found}


def _schema(kind: Any, may_lack: bool, found: dict[str, Any]) -> dict[str, Any]:
    """The schema of a type; those of rows go into ``found``."""
    kind = getattr(get_origin(kind), "__value__", kind)  # NDArray names a type, from NumPy 2.5 on
    origin, inner = get_origin(kind) or kind, get_args(kind)
    if origin is Annotated:
        return _schema(inner[0], may_lack, found)
    if origin in (Union, UnionType):
        return {"anyOf": [_schema(one, may_lack, found) for one in inner]}
    if is_dataclass(origin):
        return _row(origin, may_lack, found)
    if origin is Literal:
        return {"enum": list(inner)}
    if origin is np.ndarray:
        return NUMBERS
    if origin in _TYPES:
        name = _TYPES[origin]
        return {"type": [name, "null"] if may_lack and origin is float else name}
    if origin is Any:
        return {}
    if issubclass(origin, Mapping):
        return {"type": "object", "additionalProperties": _schema(inner[1], may_lack, found)}
    items = [_schema(one, may_lack, found) for one in inner if one is not ...]
    return {"type": "array", **({"items": items[0]} if len(items) == 1 else {"prefixItems": items})}


def _row(row: Any, may_lack: bool, found: dict[str, Any]) -> dict[str, Any]:
    """The reference to a row; one whose numbers may lack has a schema of its own."""
    name = f"{row.__name__.removesuffix('Document')}{'WithGaps' if may_lack else ''}"
    if name not in found:
        properties = found[name] = dict[str, Any](description=inspect.cleandoc(row.__doc__))
        facts = written(row).items()
        properties["type"] = "object"
        properties["properties"] = {
            one.name or field: {
                "description": one.words or (one.name or field).replace("_", " "),
                **({"unit": one.unit} if one.unit else {}),
                **_schema(hints(row)[field], may_lack or one.may_lack, found),
            }
            for field, one in facts
        }
        properties["required"] = [one.name or field for field, one in facts if not one.optional]
    return {"$ref": f"#/$defs/{name}"}
