"""Short reprs: an object with its numbers in one line, whatever arrays it holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

LONGEST = 300  # characters of a whole repr: four lines of a terminal
_FEW = 6  # numbers that are written out


class Brief:
    """Base of dataclasses with ``repr=False``: arrays by their shape, parts by their class."""

    __slots__ = ()

    def __repr__(self) -> str:
        shown = (f"{f.name}={_short(getattr(self, f.name))}" for f in fields(self) if f.repr)  # type: ignore[arg-type]
        return cut(f"{type(self).__name__}({', '.join(shown)})")


def cut(text: str, longest: int = LONGEST) -> str:
    """``text`` in at most ``longest`` characters."""
    return text if len(text) <= longest else f"{text[: longest - 2]}…)"


def named(names: tuple[str, ...]) -> str:
    """``(q1, q2)``; of many the first."""
    first = ", ".join(names[:_FEW])
    return f"({first}, … {len(names)} in all)" if len(names) > _FEW else f"({first})"


def counted(count: int, what: str) -> str:
    """``1 solve``, ``7 solves``."""
    return f"{count} {what}{'' if count == 1 else 's'}"


def of_modes(modes: tuple[int, ...]) -> str:
    """``mode 1``, ``modes (1, 2)``."""
    return f"mode {modes[0]}" if len(modes) == 1 else f"modes {modes}"


def _short(value: Any) -> str:
    if hasattr(value, "shape"):
        if getattr(value, "size", _FEW + 1) <= _FEW and value.ndim == 1:
            return f"[{', '.join(f'{x + 0:.6g}' for x in value.tolist())}]"
        return f"{type(value).__name__}{tuple(value.shape)}"
    if is_dataclass(value) or hasattr(value, "_fields"):
        return f"{type(value).__name__}(…)"
    if isinstance(value, tuple):
        parts = [_short(part) for part in value[:2]]
        more = [f"… {len(value)} in all"] if len(value) > 2 else []
        return f"({', '.join(parts + more)}{',' if len(value) == 1 else ''})"
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key}: …' for key in list(value)[:_FEW])}}}"
    return cut(repr(value), 60)
