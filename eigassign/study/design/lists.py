"""Lists that parameters take their values from, and what a design costs.

A list has rows; each row sets the columns of the design y that the list owns: one for a list of
values, several for a list of sections. A row of every list is a combination; the other columns stay
continuous.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.program import Floats
from eigassign.case.case_file import CaseFile
from eigassign.study.planning import nearest_rows
from eigassign.study.results import DesignRow
from eigassign.study.scene import Scene

Rows = tuple[int, ...]  # one row of every list: a combination
Ints = NDArray[np.intp]
KEEP = 5  # the combinations that are told of


class ListedValues(NamedTuple):
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
        return nearest_rows(self.rows, y[..., list(self.columns)])

    def label(self, y: Floats) -> str:
        """The name of the choice that a design (n_y,) holds; empty where it holds none."""
        held = np.equal(self.rows, y[list(self.columns)]).all(axis=1)
        return self.labels[held.argmax()] if held.any() else ""

    def price(self, y: Floats) -> Floats | float:
        """The prices (...) of the rows nearest to designs (..., n_y)."""
        return np.array(self.prices)[self.nearest(y)] if self.prices else 0.0


def with_rows(listed: Sequence[ListedValues], rows: Ints, y: Floats) -> Floats:
    """Designs (n, n_y): y (n_y,) with the columns of each combination of rows (n, n_lists)."""
    designs = np.tile(y, (len(rows), 1))
    for own, at in zip(listed, rows.T, strict=True):
        designs[:, own.columns] = own.rows[at]
    return designs


def every_combination(allowed: Sequence[Ints]) -> Ints:
    """All combinations (n, n_lists); the last list varies first. There is one of no lists."""
    each = list(itertools.product(*allowed))
    return np.array(each, dtype=np.intp).reshape(len(each), len(allowed))


def catalogues(file: CaseFile) -> tuple[ListedValues, ...]:
    """The case's catalogues, as the assignment takes them: prices are of F."""
    unit = price_of_one(file)
    return tuple(
        ListedValues(
            own.name,
            own.columns,
            np.array(own.rows),
            own.choices,
            tuple(price / unit for price in own.prices),
        )
        for own in file.design.catalogues
    )


def price_of_one(file: CaseFile) -> float:
    """The price that is F = 1; 1 is as 1 %² of errors, 1 % of the worst or of room, 1 Hz."""
    aim = file.assignment.objective
    if aim == "widest":
        return 1e2
    if not any(target.is_goal for target in file.targets):
        return 1.0
    return 1e2 if aim == "worst_case" else 1e4


def design_rows(scene: Scene, optimal: Floats) -> tuple[DesignRow, ...]:
    """One row for each design parameter, in the order of the file."""
    listed, units, initial = catalogues(scene.file), scene.file.design_units, scene.initial
    chosen = {k: label for own in listed if (label := own.label(optimal)) for k in own.columns}
    unit = price_of_one(scene.file)
    whole = {own.columns[0]: unit * float(own.price(optimal)) for own in listed if own.prices}
    return tuple(
        DesignRow(
            name,
            p.said,
            units[k],
            float(initial[k]),
            float(optimal[k]),
            p.min,
            p.max,
            chosen.get(k),
            p.price,
            whole.get(k),
        )
        for k, (name, p) in enumerate(scene.file.design.parameters.items())
    )


def cost(scene: Scene, y: Floats) -> float | None:
    """The price of a design (n_y,), of choices and of its change; None where nothing has one."""
    costs = [row.cost for row in design_rows(scene, y) if row.cost is not None]
    if (limits := scene.file.design.mass) is not None and limits.price is not None:
        costs.append(limits.price * (scene.model.mass(y) - scene.model.mass(scene.initial)))
    return sum(costs) if costs else None
