"""The lowest modes and some more, where the mechanism has so many with mass."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import MissingMassError
from eigassign.mechanism.pencil import Pencil
from eigassign.modal.condensation import Modes
from eigassign.modal.exact import modes_at

Floats = NDArray[np.float64]


def lowest_modes(pencil: Pencil, theta: Floats, least: int, extra: int) -> Modes:
    """At least the lowest ``least`` modes, and up to ``extra`` more where so many have mass."""
    count = max(min(least + extra, len(pencil.elastic)), least)
    while True:
        try:
            return modes_at(pencil, theta, count)
        except MissingMassError as error:
            if count == least:
                raise
            count = min(max(error.most, least), count - 1)
