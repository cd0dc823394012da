"""The face of a package: the names it shows to everyone outside, each loaded at its first use."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def face(
    package: str, names: Mapping[str, str]
) -> tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]:
    """``__all__``, ``__getattr__`` and ``__dir__`` of a package, by PEP 562.

    ``names`` has for each module below the package the names it gives, separated by spaces. Modules
    of ours import each other directly; whoever is outside, tests and benchmarks too, needs no
    module's name. Raises AttributeError for a name that no module gives.
    """
    homes = {
        name: f"{package}.{module}" for module, given in names.items() for name in given.split()
    }

    def load(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(homes[name]), name)

    return sorted(homes), load, lambda: sorted(homes)
