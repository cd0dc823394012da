"""Stiffness and mass values of the beams of a case: its sections and materials put together."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.case import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.beam import BeamValues
from eigassign.mechanism.parameters import Parameters
from eigassign.mechanism.sections import SectionValues, section_values
from eigassign.series.expression import Scalar

Floats = NDArray[np.float64]


def beam_values(case: CaseFile, parameters: Parameters, beam: Any, section: str) -> BeamValues:
    """Stiffness and mass values of a beam of the case with one section."""

    def number(key: str, value: float) -> Scalar:
        return parameters.number(f"sections.{section}.{key}", value)

    _refuse_square(case, section)
    return _values(case, parameters, beam, section_values(case.mechanism.sections[section], number))


def _refuse_square(case: CaseFile, section: str) -> None:
    """The torsion constant of a rectangle knows its longer side: a design must not swap them."""
    data = case.mechanism.sections[section]
    if data.shape != "rectangle" or case.mechanism.space == "planar":
        return
    ranges = {
        p.parameter: (p.min, p.max) for p in case.design.parameters.values() if hasattr(p, "min")
    }
    low_w, high_w = ranges.get(f"sections.{section}.width", (data.width, data.width))
    low_h, high_h = ranges.get(f"sections.{section}.height", (data.height, data.height))
    if low_w < high_h and low_h < high_w and (low_w, low_h) != (high_w, high_h):
        raise MechanismError(
            f"mechanism.sections.{section}",
            "the bounds of its design let width and height change places, which the torsion "
            "constant does not follow: keep one side the longer",
        )


def _values(
    case: CaseFile, parameters: Parameters, beam: Any, section: SectionValues
) -> BeamValues:
    data = case.mechanism.materials[beam.material]
    path = f"materials.{beam.material}."
    E = parameters.number(path + "youngs_modulus", data.youngs_modulus)
    rho = parameters.number(path + "density", data.density)
    sheared = bool(getattr(beam, "shear", False))
    G = _shear_modulus(case, parameters, beam, E, sheared)
    return BeamValues(
        EA=E * section.area,
        EI_z=E * section.inertia_z,
        EI_y=E * section.inertia_y,
        GJ=G * section.torsion_constant,
        shear=G * section.area * section.shear_coefficient if sheared else None,
        mass=rho * section.area,
        polar=rho * section.polar_inertia,
        rotary_z=rho * section.inertia_z,
        rotary_y=rho * section.inertia_y,
    )


def _shear_modulus(
    case: CaseFile, parameters: Parameters, beam: Any, E: Scalar, sheared: bool
) -> Scalar:
    """G = E/(2(1 + ν)), or as given; not needed by planar beams without shear."""
    data: Any = case.mechanism.materials[beam.material]
    path = f"materials.{beam.material}."
    if getattr(data, "shear_modulus", None) is not None:
        return parameters.number(path + "shear_modulus", data.shear_modulus)
    if getattr(data, "poissons_ratio", None) is not None:
        nu = parameters.number(path + "poissons_ratio", data.poissons_ratio)
        return E / ((nu + 1.0) * 2.0)
    if case.mechanism.space == "planar" and not sheared:
        return 0.0
    message = "needs poissons_ratio or shear_modulus for torsion or shear"
    raise MechanismError(f"mechanism.materials.{beam.material}", message)


def tapered_values(
    case: CaseFile, parameters: Parameters, link: Any, share: Scalar | Floats
) -> BeamValues:
    """Values at a share of the length, the sections' dimensions running linearly.

    At many shares at once, arrays, where no design parameter is in them: see `is_settled`.
    """
    a, b = case.mechanism.sections[link.section.start], case.mechanism.sections[link.section.end]

    def number(key: str, value: float) -> Scalar:
        low = parameters.number(f"sections.{link.section.start}.{key}", value)
        high = parameters.number(f"sections.{link.section.end}.{key}", getattr(b, key))
        return low + (high - low) * share  # type: ignore[operator, return-value]

    return _values(case, parameters, link, section_values(a, number))


def is_settled(parameters: Parameters, link: Any) -> bool:
    """Whether no design parameter touches the sections and the material of a tapered beam."""
    owners = (
        f"sections.{link.section.start}.",
        f"sections.{link.section.end}.",
        f"materials.{link.material}.",
    )
    return not any(path.startswith(owners) for path in parameters.by_path)
