"""Arms of any size, treated as large ones: sparse algebra for a handful of unknowns."""

from dataclasses import replace
from typing import Any

import numpy as np
from chains import model_of, two_link

from eigassign.mechanism import Pencil
from eigassign.modal import Model

HELD = {"stiffness": 2e3}
Q0, Y0 = np.array([1.817, 5.312]), np.array([0.125, 0.125])
DRIVES = [("free", "free"), ("locked", "locked"), ("locked", HELD), (HELD, "free"), (HELD, HELD)]


def arm(drives: tuple[Any, Any] = ("free", "free"), elements: tuple[int, int] = (9, 7)) -> Model:
    return model_of(two_link(elements, drives=drives))


def large(pencil: Pencil, limit: int = 0) -> Pencil:
    """The same pencil with dense algebra up to ``limit`` unknowns only."""
    return replace(pencil, dense_limit=limit)


def large_model(model: Model, limit: int = 0) -> Model:
    return replace(model, pencil=large(model.pencil, limit))
