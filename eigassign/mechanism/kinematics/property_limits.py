"""What the properties that vary may be: no mass below zero, no wall thicker than its tube.

Bounds of a design say where an answer may be; these limits say what a mechanism can have at all,
whoever asks. Each is linear in x = (q, y), rows · x + offset ≥ 0, or > 0.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.errors import UsageError

Floats = NDArray[np.float64]
ROUND_OFF = 1e-6  # of the bounds: round-off, and the steps of difference quotients


@dataclass(frozen=True, eq=False)
class PropertyLimits:
    """Limits of the loads and design parameters of a case. Immutable."""

    rows: Floats  # (n_limits, n_x)
    offset: Floats  # (n_limits,)
    slack: Floats  # (n_limits,): round-off
    strict: NDArray[np.bool_]  # (n_limits,): whether the limit itself is impossible
    words: tuple[str, ...]  # what must be
    names: tuple[str, ...]  # of the entries of x
    units: tuple[str, ...]  # SI

    def require(self, x: Floats) -> None:
        """Raise UsageError for the first of samples x (n, n_x) that no mechanism can have."""
        room = x @ self.rows.T + self.offset
        wrong = (room < -self.slack) | (self.strict & (room <= 0.0))
        if not wrong.any():
            return
        k = int(wrong.any(axis=1).argmax())
        limit = int(wrong[k].argmax())
        own = np.flatnonzero(self.rows[limit])
        given = " and ".join(f"{self.names[j]} = {x[k, j]:g} {self.units[j]}".strip() for j in own)
        where = f" (sample {k})" if len(x) > 1 else ""
        raise UsageError(f"no mechanism has {given}{where}: {self.words[limit]}")


def property_limits(case: CaseFile) -> PropertyLimits | None:
    """The limits of a case; None where nothing varies that has any."""
    n_q = len(case.coordinates)
    names = (*case.coordinates, *case.loads, *case.design.parameters)
    rows: list[Floats] = []
    found: list[tuple[float, bool, str]] = []
    for terms, offset, strict, words in (*_own(case), *_of_sections(case)):
        row = np.zeros(len(names))
        for path, factor in terms:
            for k, own in case.varied[path]:
                row[n_q + k] += factor * own
        rows.append(row)
        found.append((offset, strict, words))
    if not rows:
        return None
    reach = np.zeros(len(names))
    reach[n_q:] = [max(abs(low), abs(high)) for low, high in case.box]
    return PropertyLimits(
        rows=np.array(rows),
        offset=np.array([each[0] for each in found]),
        slack=ROUND_OFF * np.abs(np.array(rows)) @ reach,
        strict=np.array([each[1] for each in found]),
        words=tuple(each[2] for each in found),
        names=names,
        units=(*case.q_units, *case.design_units),
    )


_Limit = tuple[list[tuple[str, float]], float, bool, str]  # terms by path, offset, strict, words


def _own(case: CaseFile) -> Iterator[_Limit]:
    """Limits of each property by itself."""
    for path, kind in zip(case.varied, case.quantities(case.varied), strict=True):
        unit = f" {kind.dimension.si}" if kind.dimension and kind.dimension.si else ""
        for sign, limit, factor, strict in (
            (">", kind.above, 1.0, True),
            (">=", kind.at_least, 1.0, False),
            ("<", kind.below, -1.0, True),
            ("<=", kind.at_most, -1.0, False),
        ):
            if limit is not None:
                words = f"{path} must be {sign} {limit:g}{unit}"
                yield [(path, factor)], -factor * limit, strict, words


def _of_sections(case: CaseFile) -> Iterator[_Limit]:
    """Limits between two dimensions of a section of which one varies, at least."""
    for name, section in case.mechanism.sections.items():
        for limit in section.limits():
            terms, offset = [], 0.0
            for key, factor in ((limit.large, 1.0), (limit.small, -float(limit.factor))):
                path = f"sections.{name}.{key}"
                if path in case.varied:
                    terms.append((path, factor))
                else:
                    offset += factor * getattr(section, key)
            if terms:
                words = f"section {name!r} {limit.beyond}, for {limit.small} {limit}"
                yield terms, offset, not limit.may_meet, words
