"""Dimensions that a design may move past one another: refused wherever in its bounds they could.

Each condition is linear in dimensions that vary independently, so the worst corner of the bounds
decides for all of them; along a taper the conditions hold between ends at which they hold.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from eigassign.case.section_parts import IProfileSection, Section, TubeSection
from eigassign.case.yaml_reader import Finding

Ranges = Mapping[str, tuple[float, float]]  # SI, by path of the parameter


def infeasible(mechanism: Any, parameters: Mapping[str, Any]) -> Iterator[Finding]:
    """Design parameters whose bounds hold sections that cannot exist, each at its bound."""
    ranges = {p.parameter: (p.min, p.max) for p in parameters.values()}
    names = {p.parameter: name for name, p in parameters.items()}
    for path, bound, message in impossible(mechanism.sections, ranges):
        yield ("design", names[path], bound), f"at this bound {message}"


def impossible(sections: Mapping[str, Section], ranges: Ranges) -> Iterator[tuple[str, str, str]]:
    """(path, "min" or "max", what is wrong there) of parameters that can break a section."""
    for name, section in sections.items():
        for small, factor, large, may_meet in _conditions(section):
            low, high = f"sections.{name}.{small}", f"sections.{name}.{large}"
            a = ranges.get(low, (0.0, getattr(section, small)))[1] * factor
            b = ranges.get(high, (getattr(section, large), 0.0))[0]
            if a > b or (a == b and not may_meet):
                path, bound = (low, "max") if low in ranges else (high, "min")
                if path in ranges:
                    yield path, bound, _words(name, small, factor, large, a / factor, b, may_meet)


def _conditions(section: Section) -> tuple[tuple[str, float, str, bool], ...]:
    """(small, factor, large, whether factor × small may equal large)."""
    if isinstance(section, TubeSection):
        if section.inner_diameter is not None:
            return (("inner_diameter", 1.0, "outer_diameter", False),)
        return (("thickness", 2.0, "outer_diameter", True),)
    if isinstance(section, IProfileSection):
        return (
            ("flange_thickness", 2.0, "height", False),
            ("web_thickness", 1.0, "width", True),
        )
    return ()


def _words(
    name: str, small: str, factor: float, large: str, a: float, b: float, may_meet: bool
) -> str:
    share = large if factor == 1.0 else f"half of {large}"
    rule = "at most" if may_meet else "less than"
    return (
        f"section {name!r} cannot exist: {small} {a:g} m must be {rule} {share}, "
        f"which can be {b / factor:g} m; narrow the bounds"
    )
