"""Rows of facts as JSON: results.json is a walk over what a run found.

To add a fact to a file, give one of its rows a field: the file, its JSON Schema and its page in the
manual have it then. The same results give the same bytes; numbers are written as ``repr`` writes
them, so that they read back to the last bit.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import is_dataclass
from typing import Any

import numpy as np

from eigassign.errors import EigassignError
from eigassign.facts import written
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
