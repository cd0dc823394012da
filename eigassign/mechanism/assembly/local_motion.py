"""The motion of a link's nodes in its own axes, v = B(q, y) [u; q̇] of eq. (1), as numbers.

For what looks at single links: mode shapes, velocity terms, and what a reduction leaves out.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.mechanism.assembly.congruence import LocalLink
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.mechanism.elements.mesh import total
from eigassign.mechanism.kinematics.parameters import ModelParameters
from eigassign.series.algebra import Samples
from eigassign.series.compiler import CompiledTable, compile_table
from eigassign.series.expression import Scalar

Floats = NDArray[np.float64]


def motion_scalars(link: LocalLink) -> list[list[Scalar]]:
    """What varies in a link's B: carried nodes, twist, rigid motion of the nodes."""
    return [
        [carry for masters in link.carried.values() for _, carry in masters],
        list(link.twist.ravel()),
        [t.coefficient for t in link.rigid],
    ]


def motion_matrix(
    link: LocalLink, carries: Floats, twist: Floats, rigid: Floats, n_u: int, n_dof: int
) -> sparse.csr_array:
    """B (n_local, n_dof) from the values of `motion_scalars`: own unknowns, carried ones, N T."""
    own = np.flatnonzero(link.own >= 0)
    rows, columns, data = [own], [link.own[own]], [np.ones(len(own))]
    pairs = [(slot, unknown) for slot, masters in link.carried.items() for unknown, _ in masters]
    if pairs:
        slots, unknowns = (np.array(p) for p in zip(*pairs, strict=True))
        rows, columns = [*rows, slots], [*columns, unknowns]
        data.append(carries)
    shape = (len(link.own), n_dof)
    entries = (np.concatenate(data), (np.concatenate(rows), np.concatenate(columns)))
    B = sparse.csr_array(entries, shape=shape)
    if link.twist.shape[1]:
        N, T = total(link.rigid, rigid), twist.reshape(link.twist.shape)
        wide = sparse.csr_array((shape[0], n_u))
        B = B + sparse.hstack([wide, sparse.csr_array(N @ T)], format="csr")
    return B


@dataclass(frozen=True, eq=False)
class ReducedLinks:
    """The reduced links of a mechanism, each with its motion and its whole matrices."""

    links: tuple[LocalLink, ...]
    table: CompiledTable
    cuts: tuple[int, ...]  # of the table's rows: three groups for the motion, two for k and m
    pencil: Pencil

    def values(self, x: Floats) -> Floats:
        """All scalars at x = (q, y) (n_x,)."""
        z = self.pencil.to_program @ x + self.pencil.shift
        return self.table.evaluate(Samples(), z[:, None])[:, 0]

    def motion(self, k: int, values: Floats) -> sparse.csr_array:
        """B of link k in its reduced local dofs, (n_reduced, n_dof)."""
        carries, twist, rigid = (self._group(values, 5 * k + j) for j in range(3))
        n_u, n_dof = self.pencil.n_u, self.pencil.n_dof
        return motion_matrix(self.links[k], carries, twist, rigid, n_u, n_dof)

    def matrices(self, k: int, values: Floats) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Stiffness and mass of the whole link k, with all its dofs."""
        reduction = self.links[k].reduction
        assert reduction is not None
        stiffness, mass = (self._group(values, 5 * k + j) for j in (3, 4))
        return total(reduction.mesh.stiffness, stiffness), total(reduction.mesh.mass, mass)

    def _group(self, values: Floats, j: int) -> Floats:
        return np.asarray(values[self.cuts[j] : self.cuts[j + 1]])


def reduced_links(
    parameters: ModelParameters, links: Sequence[LocalLink], pencil: Pencil
) -> ReducedLinks | None:
    """Those links of a mechanism that are reduced; None where none is."""
    reduced = tuple(link for link in links if link.reduction is not None)
    if not reduced:
        return None
    groups: list[list[Scalar]] = []
    for link in reduced:
        mesh = link.reduction.mesh  # type: ignore[union-attr]
        groups += motion_scalars(link)
        groups += [[t.coefficient for t in terms] for terms in (mesh.stiffness, mesh.mass)]
    scalars = list(itertools.chain.from_iterable(groups))
    return ReducedLinks(
        links=reduced,
        table=compile_table(parameters.recorder, scalars, len(pencil.shift)),
        cuts=tuple(np.cumsum([0, *(len(g) for g in groups)]).tolist()),
        pencil=pencil,
    )
