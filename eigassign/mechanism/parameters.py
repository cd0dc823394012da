"""The numbers of a mechanism: plain floats, or expressions where they are design parameters."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.case import CaseFile
from eigassign.series.expression import Expression, Recorder, Scalar

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Parameters:
    """Variables z = (s, y): joint coordinates s in the order of the case's q, then design y."""

    recorder: Recorder
    coordinates: tuple[str, ...]
    design: tuple[str, ...]
    by_path: dict[str, Expression] = field(default_factory=dict)

    def number(self, path: str, value: float) -> Scalar:
        """The value at a key path of the case: the variable if it is a design parameter."""
        return self.by_path.get(path, value)

    def joint_coordinate(self, index: int) -> Expression:
        """The relative joint coordinate s belonging to coordinate number ``index``."""
        return self.recorder.variable(index)


def parameters(case: CaseFile) -> Parameters:
    """The variables of a case."""
    recorder = Recorder()
    coordinates, design = tuple(case.coordinates), tuple(case.design.parameters)
    by_path = {
        parameter.parameter: recorder.variable(len(coordinates) + k)
        for k, parameter in enumerate(case.design.parameters.values())
    }
    return Parameters(recorder, coordinates, design, by_path)


def initial_design(case: CaseFile) -> Floats:
    """y as the mechanism is written in the file, (n_y,) in SI units."""
    paths = [p.parameter for p in case.design.parameters.values()]
    return np.array([_value(case, path) for path in paths], dtype=np.float64)


def _value(case: CaseFile, path: str) -> float:
    head, name, *fields = path.split(".")
    table: Any = case.coordinates if head == "coordinates" else getattr(case.mechanism, head)
    value = table[name]
    for field_name in fields:
        value = getattr(value, field_name)
    return float(value)
