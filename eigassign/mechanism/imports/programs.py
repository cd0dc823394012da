"""Matrices, freedoms of rows and nodes of Nastran, Abaqus, CalculiX and Ansys.

Nastran's OUTPUT4 holds matrices column by column, as text or as Fortran's binary records. A column
is its number, its first row and its number of words, then the values. Where the first row is 0 it
consists of strings, each behind one word, 65536 × (its words + 1) + its row, or, where the number
of rows is negative (bigmat), behind two: its words + 1, its row. A column behind the last one ends
the matrix. Its punched matrices:

    DMIG     KAAX     0     6     2     0           8        name, 0, form, type, …, columns
    DMIG*    KAAX              1               1             a column: node, component
    *                          1               1  1.2345678901D+04      rows: node, component, value

Fields are 8 or, in lines with an asterisk, 16 characters wide. Form 6 gives one triangle.

Each kind is told by its first lines:

    1,1, 2,3, 1.5e+05   *MATRIX GENERATE of Abaqus: node, freedom, node, freedom, value
    P-1.1,1, P-1.2,3, 1.5e+05   its FORMAT=LABELS, before each node the instance of its part
    1 6  1.5e+05        .sti and .mas of CalculiX, COORDINATE of Abaqus: row, column, value
    %%MatrixMarket      coordinates behind a header, of Ansys: row, column, value
    12.3                .dof of CalculiX: node.freedom of each row
    7  12  ROTX         .mapping of Ansys: row, node, freedom
    *NODE               input files: node, x, y, z
"""

from __future__ import annotations

import io
import re
from collections import defaultdict
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from eigassign.arrays import Floats
from eigassign.mechanism.imports import entries
from eigassign.mechanism.imports.entries import LABEL, Cells, Contents, Ints, Matrix, UnfitError

# --- OUTPUT4 of Nastran

_HEAD = re.compile(
    rb"^ *(\d{1,9}) +(-?\d{1,9}) +(\d+) *([1-4]) *([A-Za-z]\w{0,31}) +"
    rb"(?:1P,)?(\d{1,2})[ED](\d{1,2})\.\d+[ \t]*\r?\n",
    re.MULTILINE,
)
_BIG = 65536  # what the length of a string is multiplied by
_LINE = 80  # characters of a line of whole numbers, of which there are three at most
_MARK = 24  # bytes of the first binary record: four whole numbers and a name


def read_op4_text(data: bytes) -> Contents | None:
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
    return _of_strings(n, strings, entries.reals(entries.cells(lines, width, most)))


def _require_fit(columns: int, rows: int, kind: int) -> None:
    """Raise UnfitError unless the matrix is real, square and not too large."""
    if kind > 2:
        raise UnfitError(entries.COMPLEX)
    if columns != abs(rows):
        raise UnfitError(f"is not a square matrix: {(abs(rows), columns)}")
    entries.require_few(columns, 0)


def _of_strings(n: int, strings: Sequence[Sequence[int]], values: Floats) -> Matrix:
    """The matrix of strings, (column, first row, number of values) each, and all their values."""
    column, first, count = np.array(strings, dtype=np.int64).reshape(-1, 3).T
    inside = np.arange(len(values)) - np.repeat(np.cumsum(count) - count, count)
    rows, columns = np.repeat(first - 1, count) + inside, np.repeat(column - 1, count)
    return Matrix(entries.assembled(n, rows, columns, values, half=True))


# --- Binary


def read_op4_binary(data: bytes) -> Contents | None:
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
    return _of_strings(n, strings, values.astype(np.float64))


# --- Punched matrices and grid points of Nastran

_LONGER = rb"[^\n]*\n?(?:(?:[*+,]|[ \t]+\S)[^\n]*\n?)*"  # a card goes on in lines without a name
CARD = re.compile(rb"^([A-Z]\w*)" + _LONGER, re.MULTILINE | re.IGNORECASE)
_DMIG = re.compile(rb"^DMIG\*?[ ,\t]*(\w+)" + _LONGER, re.MULTILINE | re.IGNORECASE)
_GRID = re.compile(rb"^GRID(?:\*[^\n]*\n?(?:\*[^\n]*)?|[ ,\t][^\n]*)", re.MULTILINE | re.IGNORECASE)


_GRDSET = re.compile(rb"^GRDSET" + _LONGER, re.MULTILINE | re.IGNORECASE)


def read_bulk(data: bytes) -> Contents | None:
    """The matrices of DMIG cards and the places of grid points; None where neither is."""
    cards = defaultdict[str, list[bytes]](list)
    for card in _DMIG.finditer(data):
        cards[card.group(1).decode("ascii", "replace").upper()].append(card.group())
    matrices = {name: partial(_matrix, group) for name, group in cards.items()}
    others = (fields_of(card.group()) for card in _GRDSET.finditer(data))
    moved = any(entries.wholes(np.append(f, [b""] * 6)[[1, 5]]).any() for f in others)
    places = entries.places_of(_grid(card.group(), moved) for card in _GRID.finditer(data))
    return Contents(matrices, places) if matrices or places else None


def fields_of(card: bytes) -> Cells:
    """The fields of a card behind its name, those that the last line leaves out too."""
    lines = (card.expandtabs(8) if b"\t" in card else card).rstrip().split(b"\n")
    if b"," in card:
        rows = [[cell.strip() for cell in line.split(b",", 9)[1:9]] for line in lines]
        return np.array([cell for row in rows for cell in (row + [b""] * 8)[:8]], dtype="S72")
    width = 16 if b"*" in lines[0][:8] else 8
    whole = b"".join(line.rstrip().ljust(72)[8:72] for line in lines if len(line) > 8)
    return np.frombuffer(whole, f"S{width}")


def _matrix(cards: list[bytes]) -> Matrix:
    """The cards of one matrix: a header, and a card for each column."""
    headers = [card for card in cards if entries.wholes(fields_of(card)[1:2])[0] == 0]
    if len(headers) != 1:
        raise UnfitError(f"has {len(headers)} headers of the matrix, expected one")
    form, kind = entries.wholes(fields_of(headers[0])[2:4]).tolist()
    if kind in (3, 4):
        raise UnfitError(entries.COMPLEX)
    if form not in (1, 6):
        raise UnfitError("is not a square matrix: its form is neither 1 nor 6")
    rows, columns, values = [], [], []
    total = 0
    for card in cards:
        if card is headers[0]:
            continue
        fields = fields_of(card)
        node, freedom = entries.wholes(fields[1:3]).tolist()
        groups = fields[4 : 4 + (len(fields) - 4) // 4 * 4].reshape(-1, 4)
        groups = groups[np.char.strip(groups[:, 0]) != b""]
        at = entries.wholes(groups[:, 0]) * LABEL + entries.wholes(groups[:, 1])
        rows.append(at)
        columns.append(np.full(len(at), node * LABEL + freedom))
        values.append(entries.reals(np.ascontiguousarray(groups[:, 2])))
        entries.require_few(0, total := total + len(at))
    if not rows:
        raise ValueError("no columns")
    whole = [np.concatenate(each) for each in (rows, columns)]
    return entries.labelled(whole[0], whole[1], np.concatenate(values), form == 6)


def _grid(card: bytes, moved: bool) -> tuple[int, Floats]:
    """Number and place; NaN where the place or the freedoms are in a system of their own."""
    fields = fields_of(card)
    node, system, *_ = entries.wholes(fields[:2]).tolist()
    own = moved or system or (entries.wholes(fields[5:6])[0] if len(fields) > 5 else 0)
    place = entries.reals(np.where(np.char.strip(fields[2:5]) == b"", b"0.", fields[2:5]))
    return node, np.full(3, np.nan) if own else place


_NUMBER = rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_LONGEST = 1000  # bytes of a line of an entry
_COMMENTS = rb"\A(?:[ \t]*(?:\*[^\n]*)?\r?\n)*"
_NEXT = rb"[ \t]*[, \t][ \t]*"
_ENTRY = re.compile(
    _COMMENTS + rb"[ \t]*-?\d+((?:" + _NEXT + rb"-?\d+){1,3})" + _NEXT + _NUMBER + rb"\s"
)
_INSTANCE = re.compile(rb"([A-Z][\w-]*)\.(?=\d+[ \t]*,)", re.IGNORECASE)  # before a node's number
_LABELS = re.compile(_COMMENTS + rb"[ \t]*" + _INSTANCE.pattern, re.IGNORECASE)
_BANNER = re.compile(
    rb"%%MatrixMarket\s+matrix\s+coordinate\s+(?:real|double|integer)\s+(general|symmetric)\s*?\n"
    rb"(?:[ \t]*(?:%[^\n]*)?\n)*[ \t]*(\d{1,9})[ \t]+(\d{1,9})[ \t]+(\d{1,15})\s*?\n",
    re.IGNORECASE,
)
_DOFS = re.compile(rb"\A(?:[ \t]*\d+\.\d{1,2}[ \t]*\r?\n)+\Z")
_FREEDOMS = (b"UX", b"UY", b"UZ", b"ROTX", b"ROTY", b"ROTZ")
_MAPPED = re.compile(rb"^[ \t]*(\d+)[ \t]+(\d+)[ \t]+(U[XYZ]|ROT[XYZ])[ \t]*\r?$", re.MULTILINE)
_NODES = re.compile(rb"^\*NODE\b(?! *(?:FILE|PRINT|OUTPUT))[^\n]*\n([^*]*)", re.M | re.I)


_MOVED = re.compile(
    rb"^\*(SYSTEM|INCLUDE|NCOPY|NGEN|NFILL|NMAP|TRANSFORM|NODE\b[^\n]*SYSTEM *= *[CS])\b",
    re.MULTILINE | re.IGNORECASE,
)


def read_entries(data: bytes) -> Contents | None:
    """The one matrix of a list of entries, whose nodes are named or its rows counted from 1."""
    if _LABELS.match(data):
        if len(set(_INSTANCE.findall(data))) > 1:
            raise UnfitError("has rows of several part instances: write them of one part")
        data = _INSTANCE.sub(b"", data)
    entry = _ENTRY.match(data)
    places = 1 + len(entry.group(1).replace(b",", b" ").split()) if entry else 0

    def matrix() -> Matrix:
        *at, values = _listed(data, places)
        if places == 4:
            return entries.labelled(at[0] * LABEL + at[1], at[2] * LABEL + at[3], values, True)
        n = int(max(at[0].max(), at[1].max()))
        return Matrix(entries.assembled(n, at[0] - 1, at[1] - 1, values, True), grows=True)

    return Contents({"": matrix}) if places in (2, 4) else None


def _listed(data: bytes, places: int) -> list[Any]:
    """The columns of lines of so many whole numbers and a value."""
    kinds = [*((f"i{k}", np.int64) for k in range(places)), ("value", np.float64)]
    # of lines that are too long a piece, which has too many columns or too few
    lines = iter(partial(io.BytesIO(data.replace(b",", b" ")).readline, _LONGEST), b"")
    read = np.loadtxt(lines, dtype=kinds, comments=["*", "%"], ndmin=1)
    return [read[name] for name, _ in kinds]


def read_matrix_market(data: bytes) -> Contents | None:
    """The one matrix of a Matrix Market file; None of other files."""
    if not data[:20].lower().startswith(b"%%matrixmarket"):
        return None

    def matrix() -> Matrix:
        banner = _BANNER.match(data)
        if banner is None:
            raise UnfitError("is no matrix of real numbers by coordinates, general or symmetric")
        n, columns, given = (int(word) for word in banner.groups()[1:])
        entries.require_few(n, given)
        row, column, values = _listed(data[banner.end() :], 2)
        if n != columns or len(values) != given:
            raise ValueError("other entries than announced")
        half = banner.group(1).lower() == b"symmetric"
        return Matrix(entries.assembled(n, row - 1, column - 1, values, half))

    return Contents({"": matrix})


def read_labels(data: bytes) -> Contents | None:
    """The labels of the rows of a matrix, in their order; None of other files."""
    if _DOFS.match(data):
        pairs = [word.split(b".") for word in data.split()]
        return Contents(labels=_distinct([LABEL * int(n) + int(k) for n, k in pairs]))
    found = [(int(r), int(n), _FREEDOMS.index(k) + 1) for r, n, k in _MAPPED.findall(data)]
    if [row for row, *_ in found] != list(range(1, len(found) + 1)):
        raise ValueError("rows that are missing")
    labels = _distinct([LABEL * node + freedom for _, node, freedom in found])
    return Contents(labels=labels) if found else None


def _distinct(labels: list[int]) -> Ints:
    if len(set(labels)) < len(labels):
        raise UnfitError("gives a freedom of a node to two rows")
    return np.array(labels)


def read_nodes(data: bytes) -> Contents | None:
    """The places of nodes; those of assemblies of instances are not known."""
    blocks = list(_NODES.finditer(data))
    if blocks and re.search(rb"^\*INSTANCE\b", data, re.M | re.I):
        raise UnfitError("moves parts (*INSTANCE): write an input file without parts, or a CSV")
    if blocks and (moved := _MOVED.search(data)):
        word = moved.group(1).decode().upper()
        raise UnfitError(
            f"has *{word}, which is not read: write nodes out, in the axes of the part"
        )
    lines = (line.replace(b",", b" ").split() for b in blocks for line in b.group(1).split(b"\n"))
    places = entries.places_of(
        (int(words[0]), np.array([*map(float, words[1:4]), *[0.0] * (4 - len(words))]))
        for words in lines
        if words
    )
    return Contents(places=places) if blocks else None
