"""Links from inside, as numbers: how the dofs of a reduced link move, and the elements of beams.

For the bounds of what reduced links and meshes leave out; nothing is compiled before these.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.mechanism.assembly.congruence import LocalLink, motion_matrix, motion_scalars
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.mechanism.elements.mesh import LinkMesh, total
from eigassign.mechanism.elements.profiles import BeamValues, Profile
from eigassign.mechanism.kinematics.parameters import ModelParameters
from eigassign.series.algebra import Samples
from eigassign.series.compiler import CompiledTable, compile_table
from eigassign.series.expression import Scalar

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


@dataclass
class _ScalarRows:
    """Scalars on their way to one table; each group is told its rows in it."""

    scalars: list[Scalar] = field(default_factory=list)

    def put(self, group: Sequence[Scalar]) -> slice:
        """The rows of a group."""
        self.scalars.extend(group)
        return slice(len(self.scalars) - len(group), len(self.scalars))

    def table(self, parameters: ModelParameters) -> CompiledTable:
        return compile_table(parameters.recorder, self.scalars, parameters.count)


def _values(table: CompiledTable, pencil: Pencil, x: Floats) -> Floats:
    """Scalars of a table at x = (q, y) (n_x,)."""
    z = pencil.to_program @ x + pencil.shift
    return table.evaluate(Samples(), z[:, None])[:, 0]


def _motion(
    link: LocalLink, rows: Sequence[slice], values: Floats, pencil: Pencil
) -> sparse.csr_array:
    """B of a link in its (reduced) local dofs, (n_local, n_dof)."""
    carries, twist, rigid = (values[group] for group in rows)
    return motion_matrix(link, carries, twist, rigid, pencil.n_u, pencil.n_dof)


# --- reduced links


class _ReducedRows(NamedTuple):
    motion: tuple[slice, ...]  # those of `motion_scalars`
    stiffness: slice
    mass: slice


@dataclass(frozen=True, eq=False)
class ReducedLinks:
    """The reduced links of a mechanism, each with its motion and its whole matrices."""

    links: tuple[LocalLink, ...]
    rows: tuple[_ReducedRows, ...]
    table: CompiledTable
    pencil: Pencil

    def values(self, x: Floats) -> Floats:
        """The values of all scalars at x = (q, y) (n_x,)."""
        return _values(self.table, self.pencil, x)

    def motion(self, k: int, values: Floats) -> sparse.csr_array:
        """B of link k in its reduced local dofs, (n_reduced, n_dof)."""
        return _motion(self.links[k], self.rows[k].motion, values, self.pencil)

    def matrices(self, k: int, values: Floats) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Stiffness and mass of the whole link k, with all its dofs."""
        reduction, rows = self.links[k].reduction, self.rows[k]
        assert reduction is not None
        mesh = reduction.mesh
        return total(mesh.stiffness, values[rows.stiffness]), total(mesh.mass, values[rows.mass])


def reduced_links(
    parameters: ModelParameters, links: Sequence[LocalLink], pencil: Pencil
) -> ReducedLinks | None:
    """The links of a mechanism that are reduced; None where none is."""
    reduced = tuple(link for link in links if link.reduction is not None)
    if not reduced:
        return None
    scalars, rows = _ScalarRows(), []
    for link in reduced:
        mesh = link.reduction.mesh  # type: ignore[union-attr]
        motion = tuple(scalars.put(group) for group in motion_scalars(link))
        matrices = (
            scalars.put([t.coefficient for t in terms]) for terms in (mesh.stiffness, mesh.mass)
        )
        rows.append(_ReducedRows(motion, *matrices))
    return ReducedLinks(reduced, tuple(rows), scalars.table(parameters), pencil)


# --- the elements of beams


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
        """The different ones among them, and which of these every one is."""
        table = np.column_stack([self.h, self.values.reshape(len(self.h), -1)])
        _, first, like = np.unique(table, axis=0, return_index=True, return_inverse=True)
        once = Alike(self.elements[first], self.h[first], self.values[first], self.sheared)
        return once, like.ravel()


@dataclass(frozen=True, eq=False)
class MeshedLinks:
    """The links of a mechanism that consist of beams: their elements in a row, link by link."""

    links: tuple[MeshedLink, ...]
    space: str
    parameters: ModelParameters
    pencil: Pencil

    def values(self, x: Floats) -> Floats:
        """The values of all scalars at x = (q, y) (n_x,)."""
        return _values(self._rows.table, self.pencil, x)

    @property
    def owners(self) -> Ints:
        """The link that each element belongs to, (n,)."""
        return self._rows.owners

    def elements(self, values: Floats) -> list[Alike]:
        """The elements, kind by kind."""
        places = [values[rows].reshape(-1, 3) for rows in self._rows.points]
        h = np.concatenate([np.linalg.norm(np.diff(X, axis=0), axis=1) for X in places])
        return [
            Alike(which, h[which], values[rows], sheared)
            for (sheared, _), (which, rows) in self._rows.kinds.items()
        ]

    def motion(self, values: Floats, phi: Floats) -> Floats:
        """The motion of both nodes of each element in its axes, (n, 12, count), for vectors
        (n_dof, count).
        """
        out = []
        for link, rows in zip(self.links, self._rows.motions, strict=True):
            v = np.asarray(_motion(link.local, rows, values, self.pencil) @ phi)
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
    def _rows(self) -> _MeshRows:
        """The table of all that varies, and where in it everything is."""
        scalars = _ScalarRows()
        motions, points = [], []
        owners: list[int] = []
        known: dict[int, Ints] = {}
        kinds: dict[tuple[bool, int], tuple[list[int], list[Ints]]] = {}
        for k, link in enumerate(self.links):
            motions.append(tuple(scalars.put(group) for group in motion_scalars(link.local)))
            for strand in link.mesh.strands:
                points.append(scalars.put([c for X in strand.points for c in X]))
                for profile in strand.profiles:
                    if id(profile) not in known:
                        entries = [0.0 if v is None else v for each in profile for v in each]
                        rows = scalars.put(entries)
                        places = np.arange(rows.start, rows.stop)
                        known[id(profile)] = places.reshape(len(profile), -1)
                    sheared = profile[0].shear is not None
                    which, values = kinds.setdefault((sheared, len(profile)), ([], []))
                    which.append(len(owners))
                    values.append(known[id(profile)])
                    owners.append(k)
        stacked = {key: (np.array(a), np.array(b)) for key, (a, b) in kinds.items()}
        table = scalars.table(self.parameters)
        return _MeshRows(table, tuple(motions), tuple(points), stacked, np.array(owners))


class _MeshRows(NamedTuple):
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
    """The links (name, place, mesh) that consist of beams; None without any."""
    found = []
    for name, local, mesh in links:
        whole = mesh if mesh.reduction is None else mesh.reduction.mesh
        if whole.strands:
            found.append(MeshedLink(name, local, whole))
    return MeshedLinks(tuple(found), space, parameters, pencil) if found else None
