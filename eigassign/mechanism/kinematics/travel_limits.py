"""How far carriages and nuts may travel: the mesh that moves with them must not fold up.

A rider at s splits its beam of length L into two segments of equal elements. Beyond the ends there
is no beam; near them elements become so short that their stiffness, as h⁻³, drowns the rest in
round-off: no element may be shorter than L/10⁴ (or a tenth of its share, in finer meshes).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.case.schema.joints import RIDING
from eigassign.errors import TravelError
from eigassign.mechanism.kinematics.parameters import ModelParameters, length, station
from eigassign.mechanism.kinematics.topology import Topology
from eigassign.series.compiler import CompiledArrays

Floats = NDArray[np.float64]
Label = Callable[[int], str]


@dataclass(frozen=True, eq=False)
class Rails:
    """The place of every rider and the length of its beam, as functions of z = (s, y)."""

    joints: tuple[str, ...]
    links: tuple[str, ...]
    margins: Floats  # (n_riders, 2): of the length, at start and end
    table: CompiledArrays  # station and length of every rider, (n_riders, 2)
    names: tuple[str, ...]  # of the coordinates

    def require(self, z: Floats, x: Floats, label: Label = "sample {}".format) -> None:
        """Raise TravelError for the first sample at which a rider leaves its range.

        z (n_z, n_samples), and x (n_samples, n_x) to name the pose by; ``label`` names sample k of
        several, counted from 0.
        """
        s, L = self.table(z)[0].T
        low, high = self.margins[:, :1] * L, L * (1.0 - self.margins[:, 1:])
        outside = ~((s >= low) & (s <= high))
        if outside.any():
            k = int(np.flatnonzero(outside.any(axis=0))[0])
            rider = int(np.flatnonzero(outside[:, k])[0])
            raise self._refusal(rider, k, s[rider, k], (low[rider, k], high[rider, k]), x, label)

    def _refusal(
        self, rider: int, k: int, s: float, allowed: tuple[float, float], x: Floats, label: Label
    ) -> TravelError:
        pose = ", ".join(f"{n} = {v:.6g}" for n, v in zip(self.names, x[k], strict=False))
        where = f"in the pose {pose}" + (f" ({label(k)})" if len(x) > 1 else "")
        message = (
            f"stands at {s:.6g} m of {self.links[rider]!r} {where}: it can travel from "
            f"{allowed[0]:.4g} m to {allowed[1]:.6g} m. Lengthen the link, or travel less far"
        )
        return TravelError(f"mechanism.joints.{self.joints[rider]}", message, k)


def rails(case: CaseFile, parameters: ModelParameters, tree: Topology) -> Rails | None:
    """The ranges of a mechanism; None where nothing rides."""
    riders = [(joint, link) for link in case.mechanism.links for joint in tree.riders(link)]
    if not riders:
        return None
    scalars = [
        [station(parameters, tree, joint) for joint, _ in riders],
        [length(case, parameters, link) for _, link in riders],
    ]
    return Rails(
        tuple(joint for joint, _ in riders),
        tuple(link for _, link in riders),
        np.array([_margins(case, link) for _, link in riders]),
        parameters.compiled(np.array(scalars, dtype=object).T),
        parameters.coordinates,
    )


def _margins(case: CaseFile, link: str) -> tuple[float, float]:
    data: Any = case.mechanism.links[link]
    n = data.elements
    first = max(1, n // 2)
    # 1e-4 of the beam's length, or a tenth of an element's share of it
    shortest = min(1e-4, 0.1 / n)
    return first * shortest, max(1, n - first) * shortest


def resting_pose(case: CaseFile) -> Floats:
    """q = 0 with every carriage and nut in the middle of its beam: a pose to try a model at."""
    joints: Any = case.mechanism.joints
    links: Any = case.mechanism.links
    riding = [joints[c.joint] for c in case.coordinates.values()]
    return np.array([0.5 * links[j.base].length if j.type in RIDING else 0.0 for j in riding])
