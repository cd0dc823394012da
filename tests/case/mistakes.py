"""A mistake in a case file, where it must be shown and what must be said of it."""

import json
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from small_case import unmarked

from eigassign.case import load
from eigassign.errors import CaseError


class Wrong(NamedTuple):
    name: str
    old: str  # of the small case
    new: str  # with ¦ where the problem must be shown
    path: str
    message: str  # fragment


def problems_of(text: str, path: Path) -> list[tuple[int, int, str, str]]:
    path.write_text(text, encoding="utf-8")
    with pytest.raises(CaseError) as caught:
        load(path)
    return [(p.line, p.column, p.path, p.message) for p in caught.value.problems]


def told_once(text: str, path: Path) -> tuple[str, str]:
    """The key and the message of the only problem of a marked text, which is shown at the mark."""
    plain, (place, *_) = unmarked(text)
    found = problems_of(plain, path)
    assert [each[:2] for each in found] == [place], found
    return found[0][2:]


def tables(name: str) -> dict[str, Any]:
    """The tables of mistakes in ``rules/<name>.json``."""
    return json.loads((Path(__file__).parent / "rules" / f"{name}.json").read_text("utf-8"))
