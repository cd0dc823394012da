"""How far riders may travel on their beams, and what properties that vary may be.

A rider at s splits its beam of length L into two segments of equal elements. Beyond the ends there
is no beam; near them elements become so short that their stiffness, as h⁻³, drowns the rest in
round-off: no element may be shorter than L/10⁴ (or a tenth of its share, in finer meshes).

Bounds of a design say where an answer may be; these limits say what a mechanism can have at all,
whoever asks. Each is linear in x = (q, y), rows · x + offset ≥ 0, or > 0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.case.schema.joints import RIDING
from eigassign.errors import TravelError, UsageError
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


ROUND_OFF = 1e-6  # of the bounds: round-off, and the steps of difference quotients


@dataclass(frozen=True, eq=False)
class PropertyLimits:
    """Limits of the loads and design parameters of a case. Immutable."""

    rows: Floats  # (n_limits, n_x)
    offset: Floats  # (n_limits,)
    slack: Floats  # (n_limits,): round-off
    strict: NDArray[np.bool_]  # (n_limits,): whether the limit itself is impossible
    words: tuple[str, ...]  # what must be
    names: tuple[str, ...]  # of the entries of x
    units: tuple[str, ...]  # SI

    def require(self, x: Floats) -> None:
        """Raise UsageError for the first of samples x (n, n_x) that no mechanism can have."""
        room = x @ self.rows.T + self.offset
        wrong = (room < -self.slack) | (self.strict & (room <= 0.0))
        if not wrong.any():
            return
        k = int(wrong.any(axis=1).argmax())
        limit = int(wrong[k].argmax())
        own = np.flatnonzero(self.rows[limit])
        given = " and ".join(f"{self.names[j]} = {x[k, j]:g} {self.units[j]}".strip() for j in own)
        where = f" (sample {k})" if len(x) > 1 else ""
        raise UsageError(f"no mechanism has {given}{where}: {self.words[limit]}")


def property_limits(case: CaseFile) -> PropertyLimits | None:
    """The limits of a case; None where nothing varies that has any."""
    n_q = len(case.coordinates)
    names = (*case.coordinates, *case.loads, *case.design.parameters)
    rows: list[Floats] = []
    found: list[tuple[float, bool, str]] = []
    for terms, offset, strict, words in (*_own(case), *_of_sections(case)):
        row = np.zeros(len(names))
        for path, factor in terms:
            for k, own in case.varied[path]:
                row[n_q + k] += factor * own
        rows.append(row)
        found.append((offset, strict, words))
    if not rows:
        return None
    reach = np.zeros(len(names))
    reach[n_q:] = [max(abs(low), abs(high)) for low, high in case.box]
    return PropertyLimits(
        rows=np.array(rows),
        offset=np.array([each[0] for each in found]),
        slack=ROUND_OFF * np.abs(np.array(rows)) @ reach,
        strict=np.array([each[1] for each in found]),
        words=tuple(each[2] for each in found),
        names=names,
        units=(*case.q_units, *case.design_units),
    )


_Limit = tuple[list[tuple[str, float]], float, bool, str]  # terms by path, offset, strict, words


def _own(case: CaseFile) -> Iterator[_Limit]:
    """Limits of each property by itself."""
    for path, kind in zip(case.varied, case.quantities(case.varied), strict=True):
        unit = f" {kind.dimension.si}" if kind.dimension and kind.dimension.si else ""
        for sign, limit, factor, strict in (
            (">", kind.above, 1.0, True),
            (">=", kind.at_least, 1.0, False),
            ("<", kind.below, -1.0, True),
            ("<=", kind.at_most, -1.0, False),
        ):
            if limit is not None:
                words = f"{path} must be {sign} {limit:g}{unit}"
                yield [(path, factor)], -factor * limit, strict, words


def _of_sections(case: CaseFile) -> Iterator[_Limit]:
    """Limits between two dimensions of a section of which one varies, at least."""
    for name, section in case.mechanism.sections.items():
        for limit in section.limits():
            terms, offset = [], 0.0
            for key, factor in ((limit.large, 1.0), (limit.small, -float(limit.factor))):
                path = f"sections.{name}.{key}"
                if path in case.varied:
                    terms.append((path, factor))
                else:
                    offset += factor * getattr(section, key)
            if terms:
                words = f"section {name!r} {limit.beyond}, for {limit.small} {limit}"
                yield terms, offset, not limit.may_meet, words
