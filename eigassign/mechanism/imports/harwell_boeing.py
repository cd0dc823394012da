"""Harwell–Boeing files: a compressed matrix by columns in text of fixed width.

Four lines of a header say how many lines the pointers, rows and values take, which kind of matrix
it is, and in which Fortran formats they stand; a fifth is there for right-hand sides.
"""

from __future__ import annotations

import re

import numpy as np

from eigassign.mechanism.imports import entries
from eigassign.mechanism.imports.entries import Cells, Contents, Matrix, UnfitError

_HEAD = re.compile(
    rb"\A[^\n]*\n(?P<lines>[ \t]*\d+(?:[ \t]+\d+){3,4})[ \t]*\r?\n"
    rb"[ \t]*(?P<kind>[RCP][SUHZR][AE])[ \t]+(?P<sizes>\d+(?:[ \t]+\d+){2,3})[ \t]*\r?\n"
    rb"(?P<formats>[^\n]*)\n",
    re.IGNORECASE,
)
_LONGEST = 100  # bytes of a number and the blanks before it
_FORMAT = re.compile(rb"\( *(?:\d*P *,? *)?(\d{0,3}) *[IEDFG] *(\d{1,3})[^)]*\)", re.IGNORECASE)


def read_harwell_boeing(data: bytes) -> Contents | None:
    """Its one matrix; None of files without such a header."""
    head = _HEAD.match(data)
    return Contents({"": lambda: _matrix(data, head)}) if head else None


def _matrix(data: bytes, head: re.Match[bytes]) -> Matrix:
    formats = [(int(most or 1), int(width)) for most, width in _FORMAT.findall(head["formats"])]
    if len(formats) < 3:
        raise ValueError("no formats")
    field, symmetry, form = list(head["kind"].decode().upper())
    if field == "C":
        raise UnfitError(entries.COMPLEX)
    if field == "P":
        raise UnfitError("is a pattern: it has places but no values")
    if symmetry not in "SU" or form != "A":
        raise UnfitError("is not an assembled symmetric matrix: export one of type RSA or RUA")
    rows, columns, count = (int(word) for word in head["sizes"].split()[:3])
    if rows != columns:
        raise UnfitError(f"is not a square matrix: {(rows, columns)}")
    entries.require_few(rows, count)
    counts = [int(word) for word in head["lines"].split()]
    start = head.end()
    if len(counts) > 4 and counts[4]:  # a line about right-hand sides
        start = data.index(b"\n", start) + 1
    lines = data[start:].split(b"\n")
    found, sizes = list[Cells](), (columns + 1, count, count)
    for height, (most, width), size in zip(counts[1:4], formats, sizes, strict=False):
        whole = b" ".join(lines[:height])
        words = whole.split() if len(whole) < _LONGEST * size else []
        # SciPy announces columns that are wider than those it writes, all apart by blanks
        apart = len(words) == size
        found.append(np.array(words) if apart else entries.cells(lines[:height], width, most))
        lines = lines[height:]
        if len(found[-1]) != size:
            raise ValueError("it ends before its matrix does")
    pointers, row = entries.wholes(found[0]) - 1, entries.wholes(found[1]) - 1
    per_column = np.diff(pointers)
    if pointers[0] != 0 or pointers[-1] != count or (per_column < 0).any():
        raise ValueError("columns that run backwards")
    column = np.repeat(np.arange(columns), per_column)
    return Matrix(entries.assembled(rows, row, column, entries.reals(found[2]), symmetry == "S"))
