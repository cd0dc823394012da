"""Parameters that take listed values only.

A list has rows; each row sets the columns of the design y that the list owns: one for a list of
values, several for a list of sections. A row of every list is a combination; the other columns stay
continuous.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import prod

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.inputs import Floats

Rows = tuple[int, ...]  # one row of every list: a combination
Ints = NDArray[np.intp]
KEEP = 5  # the combinations that are told of


@dataclass(frozen=True)
class ListedValues:
    """Listed values of some columns of y: row r sets y[columns] = rows[r], (n_rows, n_columns).

    ``prices`` (n_rows,): what a whole row costs, of F; none where its columns have prices, if any.
    """

    name: str
    columns: tuple[int, ...]
    rows: Floats
    labels: tuple[str, ...] = ()
    prices: tuple[float, ...] = ()

    @property
    def distinct(self) -> Ints:
        """The first of all rows that are equal, in the order of the list."""
        return np.sort(np.unique(self.rows, axis=0, return_index=True)[1])

    def nearest(self, y: Floats) -> Ints:
        """The rows (...) nearest to designs (..., n_y), in shares of the columns' ranges."""
        width = np.ptp(self.rows, axis=0)
        unit = np.where(width > 0.0, width, 1.0)
        away = (self.rows - y[..., None, list(self.columns)]) / unit
        return np.asarray(np.linalg.norm(away, axis=-1).argmin(axis=-1))

    def price(self, y: Floats) -> Floats | float:
        """The prices (...) of the rows nearest to designs (..., n_y)."""
        return np.array(self.prices)[self.nearest(y)] if self.prices else 0.0


def with_rows(listed: Sequence[ListedValues], rows: Ints, y: Floats) -> Floats:
    """Designs (n, n_y): y (n_y,) with the columns of each combination of rows (n, n_lists)."""
    designs = np.tile(y, (len(rows), 1))
    for own, at in zip(listed, rows.T, strict=True):
        designs[:, own.columns] = own.rows[at]
    return designs


def every_combination(allowed: Sequence[Ints], at_once: int) -> Iterator[Ints]:
    """Yield all combinations (n, n_lists), so many at a time; the last list varies first."""
    if not allowed:  # there is one, of nothing
        yield np.zeros((1, 0), dtype=np.intp)
        return
    sizes = tuple(map(len, allowed))
    for start in range(0, prod(sizes), at_once):
        places = np.arange(start, min(start + at_once, prod(sizes)))
        each = zip(allowed, np.unravel_index(places, sizes), strict=True)
        yield np.stack([np.asarray(rows)[at] for rows, at in each], axis=1)
