"""Assign the natural frequencies of moving, flexible mechanisms along their trajectory."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from eigassign._version import __version__
from eigassign.errors import CaseError, EigassignError

if TYPE_CHECKING:
    from eigassign.api import (
        Box,
        Case,
        Fit,
        PathFit,
        assign,
        expand,
        fit,
        load_case,
        load_reduced,
        reduce,
        save_reduced,
    )

__all__ = [
    "Box",
    "Case",
    "CaseError",
    "EigassignError",
    "Fit",
    "PathFit",
    "__version__",
    "assign",
    "expand",
    "fit",
    "load_case",
    "load_reduced",
    "reduce",
    "save_reduced",
]


def __getattr__(name: str) -> Any:
    """Import the Python face on first use, so that ``eigassign --help`` is instant."""
    if name in __all__:
        from eigassign import api

        return getattr(api, name)
    raise AttributeError(f"module 'eigassign' has no attribute {name!r}")


def __dir__() -> list[str]:
    """Names for completion: also those of `__getattr__`, which are not loaded yet."""
    return sorted({*globals(), *__all__})
