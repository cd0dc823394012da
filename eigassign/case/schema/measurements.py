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
    """A measured frequency (Hz) of a mode, and its standard deviation: `0.5 %` of it, or in Hz.

    It was measured at a `time` (s) of a trajectory, or at `q`; `trajectory` names the trajectory.
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
    """Measurements in a CSV file; `deviation` is that of rows for which the file gives none."""

    file: File
    deviation: Tolerance | None = None


Measurements: TypeAlias = OneOrList[
    MeasurementFile,
    Annotated[tuple[Measurement, ...], Field(min_length=1, max_length=MOST)],
]
