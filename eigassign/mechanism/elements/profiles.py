"""The values of beams, their sections and materials put together, over each of their elements.

Along a taper the dimensions of the section run linearly. Areas and moments of inertia are then
polynomials of degree 4 at most, given by five of their values, but for the torsion constant of a
rectangle, of which five values are taken in each element. Over an element each value is a sum of
Legendre polynomials, Σ_l c_l P_l(2ξ − 1), of which those up to P_4 count: see `beam`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.elements.sections import SectionValues, section_values
from eigassign.mechanism.kinematics.parameters import ModelParameters
from eigassign.series.expression import Scalar, is_constant, one_atom

Floats = NDArray[np.float64]
TERMS = 5  # Legendre polynomials over an element of a taper
STATIONS, SHARES = legendre.leggauss(TERMS)  # from −1 to 1: where a taper is evaluated
# by what values at the stations give P_0 … P_4, (l, g)
_PROJECTION = (SHARES[:, None] * legendre.legvander(STATIONS, TERMS - 1)).T
_PROJECTION = _PROJECTION * (np.arange(TERMS)[:, None] + 0.5)
# of which shapes what is no polynomial along a taper
NO_POLYNOMIALS = {"rectangle": ("GJ",), "box": ("GJ", "shear_z", "shear_y")}


class BeamValues(NamedTuple):
    """Stiffnesses EA [N], EI_z, EI_y, GJ [N m²], shear κGA [N] or None; ρA, ρI_p, ρI_z, ρI_y.

    Numbers, expressions, or arrays of numbers (n,): one for each of n elements. ``shear_z`` goes
    with EI_z, ``shear_y`` with EI_y.
    """

    EA: Scalar
    EI_z: Scalar
    EI_y: Scalar
    GJ: Scalar
    shear_z: Scalar | None
    shear_y: Scalar | None
    mass: Scalar
    polar: Scalar
    rotary_z: Scalar
    rotary_y: Scalar


Profile: TypeAlias = Sequence[BeamValues]  # over an element: the mean, then P_1 … P_4 if it varies


def field_inertia(beam: BeamValues) -> tuple[Scalar, ...]:
    """Per unit of length what the mass matrix gives to u_x, u_y, u_z, θ_x, θ_y, θ_z.

    ρA three times [kg/m], ρI_p, ρI_y, ρI_z [kg m]; without shear the rotary ones are neglected.
    """
    rotary = (0.0, 0.0) if beam.shear_z is None else (beam.rotary_y, beam.rotary_z)
    return (beam.mass, beam.mass, beam.mass, beam.polar, *rotary)


def beam_values(case: CaseFile, parameters: ModelParameters, beam: Any, section: str) -> BeamValues:
    """Stiffness and mass values of a beam of the case with one section."""

    def number(key: str, value: float) -> Scalar:
        return parameters.number(f"sections.{section}.{key}", value)

    return _values(case, parameters, beam, section_values(case.mechanism.sections[section], number))


def _values(
    case: CaseFile, parameters: ModelParameters, beam: Any, section: SectionValues
) -> BeamValues:
    data = case.mechanism.materials[beam.material]
    path = f"materials.{beam.material}."
    E = parameters.number(path + "youngs_modulus", data.youngs_modulus)
    rho = parameters.number(path + "density", data.density)
    sheared = bool(getattr(beam, "shear", False))
    G = _shear_modulus(case, parameters, beam, E, sheared)
    kappa, kappa_y = section.shear_coefficient, section.shear_coefficient_y
    kGA = G * section.area * kappa if sheared else None
    return BeamValues(
        EA=E * section.area,
        EI_z=E * section.inertia_z,
        EI_y=E * section.inertia_y,
        GJ=G * section.torsion_constant,
        shear_z=kGA,
        shear_y=G * section.area * kappa_y if sheared and kappa_y is not None else kGA,
        mass=rho * section.area,
        polar=rho * section.polar_inertia,
        rotary_z=rho * section.inertia_z,
        rotary_y=rho * section.inertia_y,
    )


def _shear_modulus(
    case: CaseFile, parameters: ModelParameters, beam: Any, E: Scalar, sheared: bool
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


# --- tapers


def beam_profiles(
    case: CaseFile,
    parameters: ModelParameters,
    beam: Any,
    piece: tuple[Scalar, Scalar],
    n: int,
    together: bool,
) -> list[Profile]:
    """Values of n elements over a ``piece`` of a beam, from share to share of its length.

    One profile for all, of arrays (n,) for a taper of numbers if ``together``; or one for each.
    """
    if isinstance(beam.section, str):
        return [[beam_values(case, parameters, beam, beam.section)]]
    start, end = piece

    def at(place: float) -> BeamValues:
        share = start + (end - start) * (0.5 * (1.0 + place))
        return _tapered_values(case, parameters, beam, share)

    weights = _legendre_weights(n)
    table = [_combined(v, weights) for v in zip(*map(at, STATIONS.tolist()), strict=True)]
    for key in NO_POLYNOMIALS.get(case.mechanism.sections[beam.section.start].shape, ()):
        k = BeamValues._fields.index(key)
        if table[k] is not None and (key != "GJ" or case.mechanism.space == "spatial"):
            table[k] = _in_each(key, at, n)
    if together and all(each is None or isinstance(each, np.ndarray) for each in table):
        rows: Any = [[None if each is None else each.T for each in table]]
    else:
        rows = zip(*([None] * n if each is None else each for each in table), strict=True)
    return [
        [BeamValues._make(None if each is None else each[k] for each in row) for k in range(TERMS)]
        for row in rows
    ]


def _stations(n: int) -> Floats:
    """The stations of each of n elements, (n, 5), from −1 to 1 over all of them."""
    return np.asarray((2.0 * np.arange(n)[:, None] + 1.0 + STATIONS) / n - 1.0)


def _legendre_weights(n: int) -> Floats:
    """(n, 5, 5): by what a polynomial's values at `STATIONS` give its P_0 … P_4 over n elements."""
    vandermonde = legendre.legvander(STATIONS, TERMS - 1)
    return _PROJECTION @ (legendre.legvander(_stations(n), TERMS - 1) @ np.linalg.inv(vandermonde))


def _combined(values: tuple[Scalar | None, ...], weights: Floats) -> Any:
    """Σ_j weights_nlj value_j, (n, 5): an array of numbers, or rows of expressions."""
    given = [value for value in values if value is not None]
    if not given:
        return None
    if all(is_constant(value) for value in given):
        return weights @ np.array(given)
    atoms = [one_atom(value) for value in given]
    return [
        [sum((v * w for v, w in zip(atoms, row, strict=True)), 0.0) for row in rows]
        for rows in weights.tolist()
    ]


def _in_each(key: str, at: Callable[[float], BeamValues], n: int) -> Any:
    """A value over each of n elements, (n, 5) as of `_combined`, from stations in each."""
    weights = _PROJECTION[None]
    rows = [
        _combined(tuple(getattr(at(t), key) for t in row), weights)[0]
        for row in _stations(n).tolist()
    ]
    return np.array(rows) if all(isinstance(row, np.ndarray) for row in rows) else rows


def _tapered_values(
    case: CaseFile, parameters: ModelParameters, link: Any, share: Scalar
) -> BeamValues:
    """Values at a share of the length, the sections' dimensions running linearly."""
    a, b = case.mechanism.sections[link.section.start], case.mechanism.sections[link.section.end]

    def number(key: str, value: float) -> Scalar:
        low = parameters.number(f"sections.{link.section.start}.{key}", value)
        high = parameters.number(f"sections.{link.section.end}.{key}", getattr(b, key))
        return low + (high - low) * share

    return _values(case, parameters, link, section_values(a, number))


def each_element(profile: Profile, n: int) -> list[Profile]:
    """The profiles of n elements, from one of all whose values may be arrays (n,)."""

    def of(values: BeamValues, k: int) -> BeamValues:
        rows: Any = values
        return BeamValues(*(v[k] if isinstance(v, np.ndarray) else v for v in rows))

    if not any(isinstance(value, np.ndarray) for value in profile[0]):
        return [profile] * n
    return [[of(values, k) for values in profile] for k in range(n)]
