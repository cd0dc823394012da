"""Links from inside, as numbers: how the dofs of a reduced link move, and the elements of beams.

For the bounds of what reduced links and meshes leave out; nothing is compiled before these.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.mechanism.assembly.congruence import LocalLink, motion_matrix, motion_scalars
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.mechanism.elements.mesh import LinkMesh, element_motion
from eigassign.mechanism.elements.profiles import BeamValues, Profile
from eigassign.mechanism.kinematics.parameters import ModelParameters
from eigassign.mechanism.kinematics.rotations import Objects
from eigassign.series.compiler import CompiledArrays

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


# --- reduced links


@dataclass(frozen=True, eq=False)
class ReducedLinks:
    """The reduced links of a mechanism, each with its motion and its whole matrices."""

    links: tuple[LocalLink, ...]
    table: CompiledArrays  # five for each link: `motion_scalars`, coefficients of k and of m
    parameters: ModelParameters
    pencil: Pencil

    @property
    def imported(self) -> ReducedLinks | None:
        """Those without beams inside: no weight bends what they leave out. None where none is."""
        own = [each for each in self.links if each.reduction and not each.reduction.mesh.strands]
        return reduced_links(self.parameters, own, self.pencil)

    def values(self, x: Floats) -> list[Floats]:
        """The values of all scalars at x = (q, y) (n_x,)."""
        return [each[0] for each in self.table(self.parameters.z(x[None]))]

    def motion(self, k: int, values: Sequence[Floats]) -> sparse.csr_array:
        """B of link k in its reduced local dofs, (n_reduced, n_dof)."""
        own = values[5 * k : 5 * k + 3]
        return motion_matrix(self.links[k], own, self.pencil.n_u, self.pencil.n_dof)

    def coefficients(self, k: int, values: Sequence[Floats]) -> tuple[Floats, Floats]:
        """Those of stiffness and mass of the whole link k, with all its dofs; 0 of other dofs.

        Only terms that enter its interior count.
        """
        return values[5 * k + 3] * self._inside[k][0], values[5 * k + 4] * self._inside[k][1]

    @cached_property
    def _inside(self) -> list[tuple[Floats, Floats]]:
        """1 for each term of stiffness and mass of a link that enters its interior, 0 for others"""
        found = []
        for link in self.links:
            reduction = link.reduction
            assert reduction is not None
            i, mesh = reduction.interior, reduction.mesh
            both = (mesh.stiffness, mesh.mass)
            each = [[float(t.matrix[i].nnz > 0) for t in terms] for terms in both]
            found.append((np.array(each[0]), np.array(each[1])))
        return found


def reduced_links(
    parameters: ModelParameters, links: Sequence[LocalLink], pencil: Pencil
) -> ReducedLinks | None:
    """The links of a mechanism that are reduced; None where none is."""
    reduced = tuple(link for link in links if link.reduction is not None)
    if not reduced:
        return None
    arrays: list[Objects] = []
    for link in reduced:
        mesh = link.reduction.mesh  # type: ignore[union-attr]
        arrays += motion_scalars(link)
        for terms in (mesh.stiffness, mesh.mass):
            arrays.append(np.array([t.coefficient for t in terms], dtype=object))
    return ReducedLinks(reduced, parameters.compiled(*arrays), parameters, pencil)


# --- solids


class SolidLink(NamedTuple):
    """A solid: its place among the unknowns, and its mesh with all dofs."""

    name: str
    local: LocalLink
    mesh: LinkMesh


@dataclass(frozen=True, eq=False)
class SolidLinks:
    """The solids of a mechanism."""

    links: tuple[SolidLink, ...]
    parameters: ModelParameters
    pencil: Pencil

    def lost(self, x: Floats, z: Floats) -> Floats:
        """2 × the energy that their meshes lack in motions z (n_dof, count) at x (n_x,), about.

        (n_links, count, count)
        """
        values = [each[0] for each in self._table(self.parameters.z(x[None]))]
        found = []
        for k, link in enumerate(self.links):
            B = motion_matrix(link.local, values[4 * k : 4 * k + 3], self.pencil.n_u, len(z))
            v, gram = np.asarray(B @ z), self._grams[k]
            energy = link.mesh.lost.energy(v) if gram is None else v.T @ gram @ v  # type: ignore
            found.append(values[4 * k + 3][0] * energy)
        return np.array(found)

    @cached_property
    def _grams(self) -> list[Floats | None]:
        """The same of all motions of reduced links, for coefficients of 1."""
        made = []
        for link in self.links:
            reduction = link.local.reduction
            made.append(None if reduction is None else link.mesh.lost.energy(reduction.basis))  # type: ignore
        return made

    @cached_property
    def _table(self) -> CompiledArrays:
        """`motion_scalars` of each link, and the coefficient."""
        arrays: list[Objects] = []
        for link in self.links:
            assert link.mesh.lost is not None
            coefficient = np.array([link.mesh.lost.coefficient], dtype=object)
            arrays += [*motion_scalars(link.local), coefficient]
        return self.parameters.compiled(*arrays)


def solid_links(
    parameters: ModelParameters, links: Sequence[tuple[str, LocalLink, LinkMesh]], pencil: Pencil
) -> SolidLinks | None:
    """The links (name, place, mesh) that are solids; None without any."""
    found = []
    for name, local, mesh in links:
        whole = mesh if mesh.reduction is None else mesh.reduction.mesh
        if whole.lost is not None:
            found.append(SolidLink(name, local, whole))
    return SolidLinks(tuple(found), parameters, pencil) if found else None


# --- the elements of beams


class MeshedLink(NamedTuple):
    """One link of beams: its name, its place among the unknowns, and its mesh with all nodes."""

    name: str
    local: LocalLink
    mesh: LinkMesh
    used: Ints  # the local dofs of nodes that something else is attached to


class Alike(NamedTuple):
    """Elements of one kind, sheared or not, tapered or not."""

    elements: Ints  # (n,) which they are in the row of all
    h: Floats  # (n,)
    values: Floats  # (n, n_legendre, n_values)
    sheared: bool

    def profile(self) -> Profile:
        """Their values as arrays (n,)."""
        rows = [BeamValues(*one) for one in np.moveaxis(self.values, 0, -1)]
        return rows if self.sheared else [r._replace(shear_z=None, shear_y=None) for r in rows]

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

    def values(self, x: Floats) -> list[Floats]:
        """The values of all scalars at x = (q, y) (n_x,)."""
        return [each[0] for each in self._table(self.parameters.z(x[None]))]

    @cached_property
    def owners(self) -> Ints:
        """The link that each element belongs to, (n,)."""
        count = [sum(len(strand.profiles) for strand in link.mesh.strands) for link in self.links]
        return np.repeat(np.arange(len(count)), count)

    @cached_property
    def free(self) -> Ints:
        """The end of each element that is attached to nothing: the first (1), the last (2), 0."""
        out = []
        for link in self.links:
            rows = [np.array(list(strand.slots)) for strand in link.mesh.strands]
            ends = np.concatenate([np.stack([row[:-1], row[1:]], axis=1) for row in rows])
            ends[ends < 0] = link.mesh.n_local  # what a planar node has not
            shared = np.bincount(ends.ravel(), minlength=link.mesh.n_local + 1) > 1
            shared[link.used] = True
            shared[-1] = False
            alone = ~shared[ends].any(axis=2)
            out.append(np.where(alone[:, 1], 2, alone[:, 0].astype(np.intp)))
        return np.concatenate(out)

    def elements(self, values: Sequence[Floats]) -> list[Alike]:
        """The elements, kind by kind."""
        places = values[3 * len(self.links) : -len(self._kinds)]
        h = np.concatenate([np.linalg.norm(np.diff(X, axis=0), axis=1) for X in places])
        return [
            Alike(kind.elements, h[kind.elements], found[kind.profile], kind.sheared)
            for kind, found in zip(self._kinds, values[-len(self._kinds) :], strict=True)
        ]

    def motion(self, values: Sequence[Floats], phi: Floats) -> Floats:
        """The motion of both nodes of each element in its axes, (n, 12, count), for vectors
        (n_dof, count).
        """
        out = []
        for k, link in enumerate(self.links):
            own, n_u = values[3 * k : 3 * k + 3], self.pencil.n_u
            v = np.asarray(motion_matrix(link.local, own, n_u, self.pencil.n_dof) @ phi)
            if link.local.reduction is not None:
                v = link.local.reduction.basis @ v
            v = np.vstack([v, np.zeros((1, v.shape[1]))])  # what a planar node has not
            for strand in link.mesh.strands:
                assert strand.axes is not None
                out.append(element_motion(v[np.array(list(strand.slots))], strand.axes))
        return np.concatenate(out)

    @cached_property
    def _table(self) -> CompiledArrays:
        """`motion_scalars` of each link, points of each strand, different values of each kind."""
        motions = [array for link in self.links for array in motion_scalars(link.local)]
        points = [
            np.array(list(strand.points), dtype=object)
            for link in self.links
            for strand in link.mesh.strands
        ]
        return self.parameters.compiled(*motions, *points, *(kind.values for kind in self._kinds))

    @cached_property
    def _kinds(self) -> list[_Kind]:
        strands = [strand for link in self.links for strand in link.mesh.strands]
        row = [profile for strand in strands for profile in strand.profiles]
        kinds: dict[tuple[bool, int], list[int]] = {}
        for k, profile in enumerate(row):
            kinds.setdefault((profile[0].shear_z is not None, len(profile)), []).append(k)
        found = []
        for (sheared, _), which in kinds.items():
            different = {id(row[k]): row[k] for k in which}
            place = {key: n for n, key in enumerate(different)}
            values = [
                [[0.0 if v is None else v for v in each] for each in profile]
                for profile in different.values()
            ]
            like = np.array([place[id(row[k])] for k in which])
            found.append(_Kind(sheared, np.array(which), like, np.array(values, dtype=object)))
        return found


class _Kind(NamedTuple):
    """Elements of one kind, as `Alike`, and their different values.

    Those are (n_different, n_legendre, 10).
    """

    sheared: bool
    elements: Ints
    profile: Ints  # (n,) which of the different ones each has
    values: Objects


def meshed_links(
    parameters: ModelParameters,
    links: Sequence[tuple[str, LocalLink, LinkMesh, Collection[str]]],
    space: str,
    pencil: Pencil,
) -> MeshedLinks | None:
    """The links (name, place, mesh, used nodes) that consist of beams; None without any."""
    found = []
    for name, local, mesh, nodes in links:
        whole = mesh if mesh.reduction is None else mesh.reduction.mesh
        if whole.strands:
            # what travels along a link is attached to no node of it, "", and may be anywhere
            taken = [whole.nodes[node] for node in whole.nodes if node in nodes or "" in nodes]
            used = np.concatenate(taken)
            found.append(MeshedLink(name, local, whole, used))
    return MeshedLinks(tuple(found), space, parameters, pencil) if found else None
