"""Any arm treated as a large one: every limit up to which algebra is dense set to nothing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from chains import model_of, two_link
from rungs import treat_as_large

from eigassign.mechanism.assembly import pencil as pencil_module
from eigassign.modal import Model

HELD = {"stiffness": 2e3}
Q0, Y0 = np.array([1.817, 5.312]), np.array([0.125, 0.125])
DRIVES = [("free", "free"), ("locked", "locked"), ("locked", HELD), (HELD, "free"), (HELD, HELD)]


def arm(drives: tuple[Any, Any] = ("free", "free"), elements: tuple[int, int] = (9, 7)) -> Model:
    return model_of(two_link(elements, drives=drives))


def sparsely(patch: pytest.MonkeyPatch, job: Callable[[], Any]) -> Any:
    """The job with every size counted as large."""
    with patch.context() as inside:
        treat_as_large(inside)
        inside.setattr(pencil_module, "STACK_LIMIT", 0)
        inside.setattr(pencil_module, "TINY_STACK", 0)
        return job()
