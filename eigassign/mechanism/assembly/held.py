"""A node is held along a direction: the pencil whose modes are the antiresonances of its response.

With b·x the velocity of a node along n, x = [u; q̇], a force there moves it by H = bᵀ(K − λM)⁻¹b,
which vanishes at the eigenvalues of

    K φ = λ M φ   within   b(q, y)·φ = 0,

K and M without one unknown. The displacements of one node in its link's axes enter b as n·R u, and
in axes of the ground of which n is the first, v = N R u, its part is v_1 alone. So u = (N R)ᵀ v and
v_1 = −(what else is in b), at every pose. Of a node that hangs on no other that deforms, as on
rigid links, the two unknowns that move it most are turned likewise: of b_p x_p + b_r x_r = ρ v_1
with ρ² = b_p² + b_r², v_1 = −(what else is in b)/ρ.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from eigassign.arrays import Floats
from eigassign.case.case_file import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.assembly.node_motion import (
    MotionRow,
    NodeMotions,
    SpringEnds,
    along,
    combined,
)
from eigassign.mechanism.assembly.pencil import AffineEntries, Entries
from eigassign.mechanism.kinematics.forward import Kinematics
from eigassign.mechanism.kinematics.loop_closure import reference
from eigassign.mechanism.kinematics.parameters import ModelParameters
from eigassign.mechanism.kinematics.topology import split
from eigassign.series.expression import Scalar

SAME = 1e-9  # coefficients that differ by less are equal


class Held(NamedTuple):
    """A node ``link.node`` that does not move along a direction (2 or 3,) of the ground."""

    node: str
    direction: tuple[float, ...]

    def __str__(self) -> str:
        return f"{self.node} along [{', '.join(f'{each:g}' for each in self.direction)}]"


class Substitution(NamedTuple):
    """Unknowns as rows over those that stay; ``gone`` is the one that does not."""

    rows: Mapping[int, MotionRow]
    gone: int

    def entries(self, own: Entries, parameters: ModelParameters) -> Entries:
        """The entries of PᵀAP for x = P x' from those of a symmetric A."""
        i, j, atoms, values = own
        changed = [*self.rows]
        touched = np.isin(i, changed) | np.isin(j, changed)
        upper, sums = touched & (i <= j), AffineEntries()
        for row, column, atom, value in zip(*(each[upper].tolist() for each in own), strict=True):
            sums.add(row, column, parameters.recorder.function(atom) * value)
        target = AffineEntries(summed=True)
        for (row, column), value in sums.sums.items():
            for a, left in self._row(row):
                for b, right in self._row(column):
                    product = value * (left * right)
                    target.add(a, b, product)
                    if row != column:
                        target.add(b, a, product)
        parts = [(i[~touched], j[~touched], atoms[~touched], values[~touched]), target.finish(0)]
        i, j, atoms, values = (np.concatenate(each) for each in zip(*parts, strict=True))
        return i - (i > self.gone), j - (j > self.gone), atoms, values

    def _row(self, unknown: int) -> list[tuple[int, Scalar]]:
        return list(self.rows.get(unknown, {unknown: 1.0}).items())


def require_held(case: CaseFile, motion: Kinematics, what: str) -> None:
    """Raise MechanismError where nothing resists a coordinate."""
    for k in motion.rigid:
        name = list(case.coordinates)[motion.columns[k]]
        message = f"is free, and {what} needs what holds it: give it a drive stiffness, or lock it"
        raise MechanismError(f"coordinates.{name}", message)


def substitution(
    held: Held, case: CaseFile, parameters: ModelParameters, motion: Kinematics, nodes: NodeMotions
) -> Substitution:
    """The unknowns of a mechanism of which a node is held.

    Raises MechanismError where a coordinate is free, and where the node cannot move that way.
    """
    require_held(case, motion, f"the response of {held}")
    ends = SpringEnds(case, parameters, motion, nodes.rows, nodes.count)
    n = np.array(held.direction) / np.linalg.norm(held.direction)
    axes = np.vstack([n, np.linalg.svd(n[None])[2][1:]])  # N
    b = along(ends.in_world(split(held.node)), n)
    z = reference(case, parameters)
    k = np.arange(len(z))
    beside = z + 0.01 * np.sin(1.0 + k) * (k < len(case.coordinates))

    def numbers(*rows: MotionRow) -> list[Floats]:
        arrays = (np.array([*row.values()], dtype=object) for row in rows)
        return parameters.compiled(*arrays)(np.array([z, beside]).T)

    for link, mesh in nodes.meshes.items():
        for name, slots in mesh.nodes.items() if "@origin" not in mesh.nodes else ():
            own = nodes.own[link][slots[: len(n)]]
            if (own < 0).any() or not b.keys() & set(own.tolist()):
                continue
            moved = ends.in_world((link, name))
            turned = [{k: along(moved, axis).get(k, 0.0) for k in own.tolist()} for axis in axes]
            first, here = numbers(turned[0], {k: b.get(k, 0.0) for k in own.tolist()})
            if np.abs(first - here).max() < SAME:
                return _turned(b, own.tolist(), turned)
    size = np.abs(numbers(b)[0]).max(axis=0) if b else np.zeros(1)
    if size.max() <= SAME:
        raise MechanismError("mechanism", f"nothing gives way at {held}")
    most = [[*b][k] for k in np.argsort(-size, kind="stable")[:2].tolist()]
    p, r = b[most[0]], b[most[-1]] if len(most) > 1 else 0.0
    by = (p * p + r * r) ** -0.5
    both = [{most[0]: p * by, most[-1]: r * by}, {most[0]: r * by * -1.0, most[-1]: p * by}]
    return _turned(b, most, both, by)


def _turned(
    b: MotionRow, places: list[int], axes: list[MotionRow], by: Scalar = 1.0
) -> Substitution:
    """What is turned into ``axes``, the first of them along b: v_1 is minus the rest of b."""
    rest = {k: value * by * -1.0 for k, value in b.items() if k not in places}
    rows = {}
    for k in places:
        rows[k] = combined({}, rest, axes[0][k])
        for place, axis in zip(places[1:], axes[1:], strict=False):
            rows[k] = combined(rows[k], {place: 1.0}, axis[k])
    return Substitution(rows, places[0])
