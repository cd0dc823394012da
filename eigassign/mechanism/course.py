"""When the tip has to be where, and turned how: a path, an attitude and a timing law together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eigassign.mechanism.attitudes import Attitude
from eigassign.mechanism.paths import Floats, Path


@dataclass(frozen=True)
class Target:
    """Where n tips should be: ``point`` (n, d) in m, and ``rotation`` (n, 3, 3) where asked for."""

    point: Floats
    rotation: Floats | None = None


@dataclass(frozen=True)
class Course:
    """Sample k is due at path parameter ``s[k]`` and time ``time_s[k]``."""

    path: Path
    s: Floats  # (n,) not decreasing, from 0 to 1
    time_s: Floats  # (n,)
    attitude: Attitude | None = None

    def target(self, s: Floats) -> Target:
        """Where the tip should be at parameters s (n,)."""
        rotation = None if self.attitude is None else self.attitude.rotation(np.atleast_1d(s))
        return Target(self.path.point(s), rotation)

    def rates(self, s: float) -> tuple[Floats, Floats]:
        """dp/ds (1, d) in m and ω (1, 3) in rad, per unit of s, from the right at a corner."""
        at = np.array([s])
        spin = np.zeros((1, 3)) if self.attitude is None else self.attitude.rate(at)
        return self.path.derivative(at), spin

    def corners(self) -> Floats:
        """Parameters inside (0, 1) at which either rate jumps."""
        turns = np.zeros(0) if self.attitude is None else self.attitude.corners
        return np.union1d(self.path.corners(), turns)

    @property
    def size(self) -> float:
        """m: how far from the origin, or how long, the path is."""
        points = self.path.point(self.path.knots)
        return max(self.path.chord_length, float(np.linalg.norm(points, axis=1).max()))

    def label(self, k: int) -> str:
        """Sample, time and point in words."""
        point = ", ".join(f"{x:.6g}" for x in self.path.point(self.s[k])[0])
        return f"sample {k} (t = {self.time_s[k]:.6g} s, point ({point}) m)"
