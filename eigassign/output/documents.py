"""Rows of facts as JSON, and the schema of that: results.json is a walk over what a run found.

To add a fact to a file, give one of its rows a field: the file, its JSON Schema and its page in the
manual have it then. The same results give the same bytes; numbers are written as ``repr`` writes
them, so that they read back to the last bit.
"""

from __future__ import annotations

import inspect
import json
from collections.abc import Iterator, Mapping
from dataclasses import is_dataclass
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import numpy as np

from eigassign.errors import EigassignError
from eigassign.facts import Fact, hints, written
from eigassign.files import plain
from eigassign.study.results import Origin

_NESTED = (Mapping, list, tuple, str, np.ndarray)


def results_document(value: Any, may_lack: bool = False) -> Any:
    """A row and all below it by the names of its facts; null for what these say may lack."""
    if is_dataclass(value):
        kind: Any = type(value)
        found: dict[str, Any] = {}
        for name, one in written(kind).items():
            inner = getattr(value, name)
            if one.by:
                inner = {getattr(row, one.by): row for row in inner}
            if inner is not None or not one.optional:
                made = results_document(inner, may_lack or one.may_lack)
                found |= made if one.flat else {one.name or name: made}
        return found
    if isinstance(value, Mapping):
        return {key: results_document(inner, may_lack) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return type(value)(results_document(inner, may_lack) for inner in value)
    return plain(value) if may_lack else value


def to_json(results: Origin) -> bytes:
    """A file of results as UTF-8 with a newline at its end.

    Raises EigassignError, naming the field, for a number that is not finite.
    """
    return f"{dumps(results_document(results))}\n".encode()


def dumps(value: Any) -> str:
    """JSON, two spaces a level, a list of numbers on one line; NaN and infinity are refused."""
    return _text(value, "", "")


def _text(value: Any, indent: str, path: str) -> str:
    inner = indent + "  "
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, Mapping):
        pairs = (f"{_leaf(k, path)}: {_text(v, inner, f'{path}.{k}')}" for k, v in value.items())
        return _block("{}", list(pairs), indent)
    if isinstance(value, (list, tuple)) and any(isinstance(v, _NESTED) for v in value):
        items = [_text(v, inner, f"{path}[{i}]") for i, v in enumerate(value)]
        return _block("[]", items, indent)
    return _leaf(value, path)


def _block(brackets: str, items: list[str], indent: str) -> str:
    if not items:
        return brackets
    inside = ",\n".join(f"{indent}  {item}" for item in items)
    return f"{brackets[0]}\n{inside}\n{indent}{brackets[1]}"


def _leaf(value: Any, path: str) -> str:
    try:
        return json.dumps(value, allow_nan=False, ensure_ascii=False)
    except ValueError as error:
        where = path.lstrip(".")
        raise EigassignError(f"results.json: {where} holds a number that is not finite") from error


# --- Their schema

_TYPES = {str: "string", bool: "boolean", int: "integer", float: "number", NoneType: "null"}
NUMBERS = {"type": "array", "items": {"type": ["number", "null", "array"]}}


def schema_of(kind: Any) -> dict[str, Any]:
    """JSON Schema (2020-12) of a file that holds such a row."""
    found = dict[str, Any]()
    root = _schema(kind, False, found)
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
