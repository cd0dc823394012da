"""Parameters in which every frequency is monotone: masses lower it, stiffnesses raise it.

K and M are K_0 + Σ k_i A_i and M_0 + Σ m_j B_j in stiffnesses k of springs and drives and moduli of
materials, and in masses, inertias and densities m, A_i and B_j positive semidefinite at every pose.
By the min-max principle every λ grows with each k and falls with each m, so that over a box of them
the least and largest frequency are those of two corners: two exact solves a pose. With gravity
masses are weights, too, and springs and links share the load: of neither anything is known then.
Nor of inertias where a coordinate is free: elastic modes move it along the more the less inertia it
has, and what the weight does along that way is in K (see `apart_from_rigid`).
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile

Floats = NDArray[np.float64]
MOMENTS = (
    "inertia",
    "motor_inertia",
    "ratio",
)  # what gives a body or a rotor its moment of inertia
MOST_SIDES = 6  # of a box with at most 64 corners, as many as a tolerance study draws


def effects(file: CaseFile) -> Floats:
    """+1 for each parameter (n_y,) that raises every frequency, −1 that lowers it, 0 unknown."""
    return np.array([_common(file, column.factors) for column in file.design.parameters.values()])


def _common(file: CaseFile, factors: Mapping[str, float]) -> float:
    """The effect of all properties of a parameter, where it is the same; else unknown."""
    found = {np.sign(factor) * _effect(file, path) for path, factor in factors.items()}
    return found.pop() if len(found) == 1 else 0.0


def _effect(file: CaseFile, path: str) -> float:
    weighs = isinstance(file.mechanism.gravity, tuple)
    loose = weighs and any(c.moves == "free" for c in file.coordinates.values())
    group, name, *rest = path.split(".")
    if weighs and (group in ("springs", "materials") or rest == ["mass"]):  # loads change, too
        return 0.0
    if loose and rest[-1] in MOMENTS:
        return 0.0
    match group, ".".join(rest):
        case ("bodies" | "links", "mass") | ("materials", "density"):
            return -1.0
        case "bodies" | "links" | "coordinates", _ if rest[-1] in MOMENTS:
            return -1.0
        case ("springs", "translational" | "rotational") | ("coordinates", "drive.stiffness"):
            return 1.0
        case "materials", "youngs_modulus":  # with a G of its own a shear beam's M changes
            return float(file.mechanism.materials[name].shear_modulus is None)
    return 0.0


def corners(file: CaseFile, y: Floats, lower: Floats, upper: Floats) -> tuple[Floats, Floats]:
    """The designs of lowest and of highest frequencies in the box, each (n_y,).

    Parameters in which the frequencies are not known to be monotone stay as in ``y``.
    """
    effect = effects(file)
    softest = np.where(effect > 0.0, lower, np.where(effect < 0.0, upper, y))
    stiffest = np.where(effect > 0.0, upper, np.where(effect < 0.0, lower, y))
    return softest, stiffest


def box_corners(n: int) -> Floats:
    """The corners of a box of n sides 0 to 1; of more than six those along a face or an edge."""
    if n <= MOST_SIDES:
        return np.array(list(itertools.product((0.0, 1.0), repeat=n)))
    return np.concatenate([np.tri(n), 1.0 - np.tri(n), np.eye(n), 1.0 - np.eye(n)])
