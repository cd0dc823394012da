"""The SI unit of every numeric property of a mechanism, by the last key of its path."""

from __future__ import annotations

from collections.abc import Mapping

from eigassign.case import CaseFile

PROPERTY_UNITS = {
    "youngs_modulus": "Pa",
    "density": "kg/m3",
    "area": "m2",
    "bending_inertia": "m4",
    "inertia_y": "m4",
    "inertia_z": "m4",
    "torsion_constant": "m4",
    "polar_inertia": "m4",
    "shear_modulus": "Pa",
    "flange_thickness": "m",
    "web_thickness": "m",
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
    "translational": "N/m",
    "rotational": "N m/rad",
}


def design_units(file: CaseFile) -> tuple[str, ...]:
    """SI unit of each design parameter, in the order of y; empty text for one without a unit."""
    held = dict(zip(file.coordinates, file.coordinate_units, strict=True))
    return tuple(_unit(p.parameter, held) for p in file.design.parameters.values())


def _unit(path: str, coordinates: Mapping[str, str]) -> str:
    group, name, *_ = path.split(".")
    if group == "coordinates" and coordinates[name] == "m":
        return "N/m"
    return PROPERTY_UNITS.get(path.rpartition(".")[2], "")


def coordinate_units(file: CaseFile) -> tuple[str, ...]:
    """SI unit of each coordinate, in the order of q."""
    return file.coordinate_units
