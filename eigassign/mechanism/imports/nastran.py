"""Nastran's punched matrices, DMIG, and grid points of bulk data.

    DMIG     KAAX     0     6     2     0           8        name, 0, form, type, …, columns
    DMIG*    KAAX              1               1             a column: node, component
    *                          1               1  1.2345678901D+04      rows: node, component, value

Fields are 8 or, in lines with an asterisk, 16 characters wide. Form 6 gives one triangle.
"""

from __future__ import annotations

import re
from collections import defaultdict
from functools import partial

import numpy as np

from eigassign.mechanism.imports import entries
from eigassign.mechanism.imports.entries import LABEL, Cells, Contents, Floats, Matrix, UnfitError

_LONGER = rb"[^\n]*\n?(?:(?:[*+,]|[ \t]+\S)[^\n]*\n?)*"  # a card goes on in lines without a name
CARD = re.compile(rb"^([A-Z]\w*)" + _LONGER, re.MULTILINE | re.IGNORECASE)
_DMIG = re.compile(rb"^DMIG\*?[ ,\t]*(\w+)" + _LONGER, re.MULTILINE | re.IGNORECASE)
_GRID = re.compile(rb"^GRID(?:\*[^\n]*\n?(?:\*[^\n]*)?|[ ,\t][^\n]*)", re.MULTILINE | re.IGNORECASE)


def read_bulk(data: bytes) -> Contents | None:
    """The matrices of DMIG cards and the places of grid points; None where neither is."""
    cards = defaultdict[str, list[bytes]](list)
    for card in _DMIG.finditer(data):
        cards[card.group(1).decode("ascii", "replace").upper()].append(card.group())
    matrices = {name: partial(_matrix, group) for name, group in cards.items()}
    places = entries.places_of(_grid(card.group()) for card in _GRID.finditer(data))
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


def _grid(card: bytes) -> tuple[int, Floats]:
    """Number and place; NaN where the place or the freedoms are in a system of their own."""
    fields = fields_of(card)
    node, system, *_ = entries.wholes(fields[:2]).tolist()
    own = system or (entries.wholes(fields[5:6])[0] if len(fields) > 5 else 0)
    place = entries.reals(np.where(np.char.strip(fields[2:5]) == b"", b"0.", fields[2:5]))
    return node, np.full(3, np.nan) if own else place
