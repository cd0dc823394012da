"""The beams of a mechanism as numbers: all their elements in a row, and how these move.

For what looks inside elements; nothing is compiled before that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.assembly.congruence import LocalLink
from eigassign.mechanism.assembly.local_motion import motion_matrix, motion_scalars
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.mechanism.elements.mesh import LinkMesh
from eigassign.mechanism.elements.profiles import BeamValues, Profile
from eigassign.mechanism.kinematics.parameters import ModelParameters
from eigassign.series.algebra import Samples
from eigassign.series.compiler import CompiledTable, compile_table
from eigassign.series.expression import Scalar

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


class MeshedLink(NamedTuple):
    """One link of beams: its name, its place among the unknowns, and its mesh with all nodes."""

    name: str
    local: LocalLink
    mesh: LinkMesh


class Alike(NamedTuple):
    """Elements of one kind, sheared or not, tapered or not."""

    elements: Ints  # (n,) which they are in the row of all
    h: Floats  # (n,)
    values: Floats  # (n, n_legendre, n_values)
    sheared: bool

    def profile(self) -> Profile:
        """Their values as arrays (n,)."""
        shear = BeamValues._fields.index("shear")
        rows: Any = np.moveaxis(self.values, 0, -1)
        if not self.sheared:
            rows = [[None if k == shear else v for k, v in enumerate(one)] for one in rows]
        return [BeamValues(*one) for one in rows]

    def different(self) -> tuple[Alike, Ints]:
        """Each that is like no other but once, and which of these every one is."""
        table = np.column_stack([self.h, self.values.reshape(len(self.h), -1)])
        _, first, like = np.unique(table, axis=0, return_index=True, return_inverse=True)
        once = Alike(self.elements[first], self.h[first], self.values[first], self.sheared)
        return once, like.ravel()


@dataclass(frozen=True, eq=False)
class MeshedLinks:
    """The links of a mechanism that consist of beams."""

    links: tuple[MeshedLink, ...]
    space: str
    parameters: ModelParameters
    pencil: Pencil

    def values(self, x: Floats) -> Floats:
        """All scalars at x = (q, y) (n_x,)."""
        z = self.pencil.to_program @ x + self.pencil.shift
        return self._rows.table.evaluate(Samples(), z[:, None])[:, 0]

    @property
    def owners(self) -> Ints:
        """Of each element the link that it belongs to, (n,)."""
        return self._rows.owners

    def elements(self, values: Floats) -> list[Alike]:
        """All elements, kind by kind."""
        places = [values[rows].reshape(-1, 3) for rows in self._rows.points]
        h = np.concatenate([np.linalg.norm(np.diff(X, axis=0), axis=1) for X in places])
        return [
            Alike(which, h[which], values[rows], sheared)
            for (sheared, _), (which, rows) in self._rows.kinds.items()
        ]

    def motion(self, values: Floats, phi: Floats) -> Floats:
        """Both nodes of each element in its axes, (n, 12, count), for vectors (n_dof, count)."""
        out = []
        for link, groups in zip(self.links, self._rows.motions, strict=True):
            carries, twist, rigid = (values[rows] for rows in groups)
            B = motion_matrix(link.local, carries, twist, rigid, self.pencil.n_u, len(phi))
            v = np.asarray(B @ phi)
            if link.local.reduction is not None:
                v = link.local.reduction.basis @ v
            v = np.vstack([v, np.zeros((1, v.shape[1]))])  # what a planar node has not
            for strand in link.mesh.strands:
                assert strand.axes is not None
                nodes = v[np.array(list(strand.slots))]  # (n + 1, 6, count)
                turned = np.concatenate([strand.axes @ nodes[:, :3], strand.axes @ nodes[:, 3:]], 1)
                out.append(np.concatenate([turned[:-1], turned[1:]], axis=1))
        return np.concatenate(out)

    @cached_property
    def _rows(self) -> _Rows:
        """What varies, as one table, and where in it everything is."""
        scalars: list[Scalar] = []

        def put(values: Sequence[Scalar]) -> slice:
            scalars.extend(values)
            return slice(len(scalars) - len(values), len(scalars))

        motions, points = [], []
        owners: list[int] = []
        known: dict[int, Ints] = {}
        kinds: dict[tuple[bool, int], tuple[list[int], list[Ints]]] = {}
        for k, link in enumerate(self.links):
            motions.append(tuple(put(group) for group in motion_scalars(link.local)))
            for strand in link.mesh.strands:
                points.append(put([c for X in strand.points for c in X]))
                for profile in strand.profiles:
                    sheared = profile[0].shear is not None
                    if id(profile) not in known:
                        rows = put([0.0 if v is None else v for each in profile for v in each])
                        known[id(profile)] = np.arange(rows.start, rows.stop).reshape(
                            len(profile), -1
                        )
                    which, values = kinds.setdefault((sheared, len(profile)), ([], []))
                    which.append(len(owners))
                    values.append(known[id(profile)])
                    owners.append(k)
        table = compile_table(self.parameters.recorder, scalars, len(self.pencil.shift))
        stacked = {key: (np.array(a), np.array(b)) for key, (a, b) in kinds.items()}
        return _Rows(table, tuple(motions), tuple(points), stacked, np.array(owners))


class _Rows(NamedTuple):
    table: CompiledTable
    motions: tuple[tuple[slice, ...], ...]  # of each link those of `motion_scalars`
    points: tuple[slice, ...]  # of each strand
    kinds: dict[tuple[bool, int], tuple[Ints, Ints]]  # elements (n,), values (n, n_legendre, 9)
    owners: Ints


def meshed_links(
    parameters: ModelParameters,
    links: Sequence[tuple[str, LocalLink, LinkMesh]],
    space: str,
    pencil: Pencil,
) -> MeshedLinks | None:
    """Those of the links (name, place, mesh) that consist of beams; None without any."""
    found = []
    for name, local, mesh in links:
        whole = mesh if mesh.reduction is None else mesh.reduction.mesh
        if whole.strands:
            found.append(MeshedLink(name, local, whole))
    return MeshedLinks(tuple(found), space, parameters, pencil) if found else None
