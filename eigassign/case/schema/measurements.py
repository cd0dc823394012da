"""The key `measurements`: frequencies that were measured, listed or in a CSV file."""

from __future__ import annotations

from typing import Annotated, Self, TypeAlias

from pydantic import Field, model_validator

from eigassign.case.schema.design import Tolerance
from eigassign.case.schema.parts import File, OneOrList, Part, wrong
from eigassign.case.schema.targets import Frequency, Mode
from eigassign.case.schema.trajectory import TIME, Coordinates

MOST = 10_000  # measurements of one case


class Measurement(Part):
    """A measured frequency.

    Keys:
        time: of the trajectory when it was measured; between samples q is linear in time
        q: instead of the time: one value of each coordinate
        trajectory: name of the trajectory, where there are several
        mode: its number, counted from the lowest elastic one
        frequency: what was measured
        deviation: its standard deviation; a share is one of the frequency
    """

    time: Annotated[float, TIME] | None = None
    q: Coordinates | None = None
    trajectory: str | None = None
    mode: Mode
    frequency: Frequency
    deviation: Tolerance

    @model_validator(mode="after")
    def _has_one_pose(self) -> Self:
        if (self.time is None) == (self.q is None):
            raise wrong("give either time or q, and not both")
        return self


class MeasurementFile(Part):
    """Measurements in a CSV file.

    Keys:
        file: relative to the case file; columns of the same names, and one for each coordinate
            instead of `q`
        deviation: of rows for which the file gives none
    """

    file: File
    deviation: Tolerance | None = None


Measurements: TypeAlias = OneOrList[
    MeasurementFile,
    Annotated[tuple[Measurement, ...], Field(min_length=1, max_length=MOST)],
]
