"""Numbers as people read them: on the console, in the report and in the figures."""

from __future__ import annotations

import math


def capital(text: str) -> str:
    """The text with its first letter as a sentence or a heading has it."""
    return text[:1].upper() + text[1:]


def number(value: float) -> str:
    """Six significant digits: ``0.228713``; no sign on a zero."""
    return f"{value + 0.0:.6g}"


def percent(fraction: float) -> str:
    """Three significant digits: ``1.55 %`` for 0.0155; ``n/a`` where there is no number."""
    if not math.isfinite(fraction):
        return "n/a"
    return f"{100.0 * fraction:#.3g}".rstrip(".") + " %"


def seconds(value: float) -> str:
    """``12.3 ms`` below a second, ``4.56 s`` above."""
    return f"{1000.0 * value:.3g} ms" if abs(value) < 1.0 else f"{value:.3g} s"


def duration(value: float) -> str:
    """Two digits, in the unit that people would take: ``50 s``, ``3.2 min``, ``27 h``."""
    for size, unit in ((86400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if value >= 2.0 * size:
            return f"{value / size:.2g} {unit}"
    return f"{value:.2g} s"


def residual(value: float) -> str:
    """Two digits and a power of ten: ``3.1e-17``."""
    return f"{value:.1e}"
