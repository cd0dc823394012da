"""Nastran's OUTPUT4: matrices column by column, as text or as Fortran's binary records.

A column is its number, its first row and its number of words, then the values. Where the first row
is 0 it consists of strings, each behind one word, 65536 × (its words + 1) + its row, or, where the
number of rows is negative (bigmat), behind two: its words + 1, its row. A column behind the last
one ends the matrix.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import partial

import numpy as np

from eigassign.mechanism.imports import entries
from eigassign.mechanism.imports.entries import Contents, Floats, Matrix, UnfitError

_HEAD = re.compile(
    rb"^ *(\d{1,9}) +(-?\d{1,9}) +(\d+) *([1-4]) *([A-Za-z]\w{0,31}) +"
    rb"(?:1P,)?(\d{1,2})[ED](\d{1,2})\.\d+[ \t]*\r?\n",
    re.MULTILINE,
)
_BIG = 65536  # what the length of a string is multiplied by
_LINE = 80  # characters of a line of whole numbers, of which there are three at most
_MARK = 24  # bytes of the first binary record: four whole numbers and a name


def read_text(data: bytes) -> Contents | None:
    """The matrices of a file of text; None of other files."""
    if not _HEAD.match(data):
        return None
    heads = list(_HEAD.finditer(data))
    ends = [*(head.start() for head in heads[1:]), len(data)]
    pairs = zip(heads, ends, strict=True)
    return Contents(
        {h.group(5).decode().upper(): partial(_of_text, h, data[h.end() : end]) for h, end in pairs}
    )


def _of_text(head: re.Match[bytes], body: bytes) -> Matrix:
    """Lines of whole numbers announce strings, lines with points hold their values."""
    n, rows, kind, most, width = (int(head.group(k)) for k in (1, 2, 4, 6, 7))
    _require_fit(n, rows, kind)
    strings, lines = list[list[int]](), list[bytes]()
    for line in body.split(b"\n"):
        if b"." in line:
            lines.append(line)
            strings[-1][3] += -(-len(line.rstrip()) // width)
        elif numbers := [int(word) for word in line[:_LINE].split()]:
            match numbers:
                case [column, _, _] if column > n:
                    break
                case [column, first, words]:
                    strings += [[column, first, words, 0]] if first else []
                case [words, first]:
                    strings.append([column, first, words - 1, 0])
                case [word]:
                    strings.append([column, word % _BIG, word // _BIG - 1, 0])
    else:
        raise ValueError("no column behind the last one")
    if any(words not in (count, count * kind) for *_, words, count in strings):
        raise ValueError("other values than announced")
    strings = [[column, first, count] for column, first, _, count in strings]
    return _matrix(n, strings, entries.reals(entries.cells(lines, width, most)))


def _require_fit(columns: int, rows: int, kind: int) -> None:
    """Raise UnfitError unless the matrix is real, square and not too large."""
    if kind > 2:
        raise UnfitError(entries.COMPLEX)
    if columns != abs(rows):
        raise UnfitError(f"is not a square matrix: {(abs(rows), columns)}")
    entries.require_few(columns, 0)


def _matrix(n: int, strings: Sequence[Sequence[int]], values: Floats) -> Matrix:
    """The matrix of strings, (column, first row, number of values) each, and all their values."""
    column, first, count = np.array(strings, dtype=np.int64).reshape(-1, 3).T
    inside = np.arange(len(values)) - np.repeat(np.cumsum(count) - count, count)
    rows, columns = np.repeat(first - 1, count) + inside, np.repeat(column - 1, count)
    return Matrix(entries.assembled(n, rows, columns, values, half=True))


# --- Binary


def read_binary(data: bytes) -> Contents | None:
    """The matrices of a binary file of either order of bytes; None of other files."""
    marks = (data[:4], data[4 + _MARK : 8 + _MARK])
    orders = {"<": _MARK.to_bytes(4, "little"), ">": _MARK.to_bytes(4, "big")}
    if (order := next((o for o, mark in orders.items() if marks == (mark, mark)), None)) is None:
        return None
    records, at = list[bytes](), 0
    whole = np.dtype(f"{order}i4")
    while at < len(data):
        size = int(np.frombuffer(data, whole, 1, at)[0])
        if size < 12 or np.frombuffer(data, whole, 1, at + 4 + size)[0] != size:
            raise ValueError("a record without its end")
        records.append(data[at + 4 : at + 4 + size])
        at += size + 8
    matrices, k = {}, 0
    while k < len(records):
        n, rows, _, kind = np.frombuffer(records[k], whole, 4).tolist()
        name = records[k][16:_MARK].decode("ascii", "replace").strip().upper()
        start = k = k + 1
        while np.frombuffer(records[k], whole, 1)[0] <= n:
            k += 1
        matrices[name] = partial(_of_records, n, rows, kind, records[start:k], whole)
        k += 1
    return Contents(matrices)


def _of_records(
    n: int, rows: int, kind: int, records: Sequence[bytes], whole: np.dtype[np.int32]
) -> Matrix:
    _require_fit(n, rows, kind)
    strings, parts = list[tuple[int, int, int]](), list[bytes]()
    for record in records:
        column, first, words = np.frombuffer(record, whole, 3).tolist()
        at, end = 12, 12 + 4 * words
        if not 12 <= end <= len(record):
            raise ValueError("other words than announced")
        while at < end:
            if first and at == 12:
                row, size = first, words
            elif rows < 0:
                size, row = (np.frombuffer(record, whole, 2, at) - [1, 0]).tolist()
                at += 8
            else:
                size, row = divmod(int(np.frombuffer(record, whole, 1, at)[0]) - _BIG, _BIG)
                at += 4
            if size <= 0 or size % kind or at + 4 * size > end:
                raise ValueError("a string beyond its column")
            strings.append((column, row, size // kind))
            parts.append(record[at : at + 4 * size])
            at += 4 * size
    values = np.frombuffer(b"".join(parts), f"{whole.str[0]}f{4 * kind}")
    return _matrix(n, strings, values.astype(np.float64))
