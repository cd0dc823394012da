"""JSON Schemas of the files of results, from the facts of their rows."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from dataclasses import is_dataclass
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import numpy as np

from eigassign.chart.results import Chart
from eigassign.facts import Fact, hints, written
from eigassign.output.batch.summary import SummaryDocument
from eigassign.study.results import RunResults
from eigassign.study.updating.fit import UpdateResults

FILES = {  # by what leaves them
    "run": RunResults,
    "update": UpdateResults,
    "batch": SummaryDocument,
    "chart": Chart,
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
        facts = list(_facts(row, may_lack))
        properties["type"] = "object"
        properties["properties"] = {
            name: {
                "description": one.words or name.replace("_", " "),
                **({"unit": one.unit} if one.unit else {}),
                **_schema(kind, lacks, found),
            }
            for name, one, kind, lacks in facts
        }
        properties["required"] = [name for name, one, *_ in facts if not one.optional]
    return {"$ref": f"#/$defs/{name}"}


def _facts(row: Any, may_lack: bool) -> Iterator[tuple[str, Fact, Any, bool]]:
    """Name, words, type and whether numbers may lack of each fact of a row, of flat ones theirs."""
    for field, one in written(row).items():
        kind, lacks = hints(row)[field], may_lack or one.may_lack
        if one.flat:
            yield from _facts(get_args(kind)[0], lacks)
            continue
        if one.by:
            kind = Mapping[str, get_args(get_args(kind)[0])[0]]  # type: ignore[misc]
        yield one.name or field, one, kind, lacks
