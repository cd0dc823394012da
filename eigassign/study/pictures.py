"""What there is to draw of a mechanism, as plain numbers: poses, and modes as deformed poses.

``n`` counts the poses; d is 2 in a plane and 3 in space; lengths in m.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class JointMark:
    """One joint: ``kind`` is "turning", "sliding" or "fixed"."""

    name: str
    kind: str
    grounded: bool
    driven: bool  # a coordinate moves it
    places: Floats  # (n, d)
    axes: Floats  # (n, d): unit vector along which it slides; along its follower if fixed


@dataclass(frozen=True)
class BodyMark:
    """One body, or rigid link without extent."""

    name: str
    mass: float  # kg
    places: Floats  # (n, d)


@dataclass(frozen=True)
class SpringMark:
    """One spring, between two places or from one to the ground."""

    name: str
    grounded: bool
    turning: bool  # it resists rotation only
    starts: Floats  # (n, d)
    ends: Floats  # (n, d): the starts again if grounded


@dataclass(frozen=True)
class Poses:
    """The mechanism in n poses: ``lines[pose][line]`` is a polyline (n_points, d)."""

    time_s: Floats  # (n,)
    lines: tuple[tuple[Floats, ...], ...]
    link_names: tuple[str, ...]
    line_links: tuple[str, ...] = ()  # per line the link it belongs to
    bodies: tuple[BodyMark, ...] = ()
    tip_path: Floats | None = None  # (…, d), NaN between the end of a trajectory and the next
    of: tuple[str, ...] = ()  # of several trajectories the one that each pose belongs to
    joints: tuple[JointMark, ...] = ()
    springs: tuple[SpringMark, ...] = ()
    # per line: its section's largest radius of gyration at start and end; 0 without a section
    sizes: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class ModePictures:
    """Elastic modes at one pose and design: the rigid links at rest, and one deformed pose a mode.

    The largest displacement of each mode is ``amplitude`` times the mechanism's extent at rest;
    the opposite phase is as far on the other side.
    """

    title: str
    rigid_modes: int
    frequencies_hz: tuple[float, ...]
    q: tuple[tuple[str, float, str], ...]  # name, value, SI unit
    y: tuple[tuple[str, float, str], ...]
    amplitude: float
    rest: Poses  # one pose
    deformed: Poses  # a pose a mode
