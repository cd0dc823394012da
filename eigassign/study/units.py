"""The SI unit of every numeric property of a mechanism, by the last key of its path."""

from __future__ import annotations

from eigassign.case import CaseFile

PROPERTY_UNITS = {
    "youngs_modulus": "Pa",
    "density": "kg/m3",
    "area": "m2",
    "bending_inertia": "m4",
    "diameter": "m",
    "outer_diameter": "m",
    "inner_diameter": "m",
    "thickness": "m",
    "width": "m",
    "height": "m",
    "length": "m",
    "mass": "kg",
    "inertia": "kg m2",
    "stiffness": "N m/rad",
}


def design_units(file: CaseFile) -> tuple[str, ...]:
    """SI unit of each design parameter, in the order of y; empty text for one without a unit."""
    paths = (p.parameter for p in file.design.parameters.values())
    return tuple(PROPERTY_UNITS.get(path.rpartition(".")[2], "") for path in paths)


def coordinate_units(file: CaseFile) -> tuple[str, ...]:
    """SI unit of each coordinate, in the order of q: all joints revolve."""
    return ("rad",) * len(file.coordinates)
