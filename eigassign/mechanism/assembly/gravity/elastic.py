"""Forces that hang on stiffnesses: in loops with more conditions than freedoms, and in springs.

The pose is held, every coordinate locked, and the elastic unknowns of a coarse mesh follow from

    K_uu u = f,    f = Qᵀ m N (g, 0).

One element for each beam is exact at its nodes, for its shapes solve the equations of statics.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from eigassign.mechanism.assembly.affine_entries import AffineEntries
from eigassign.mechanism.assembly.congruence import LocalLink, add_links
from eigassign.mechanism.assembly.node_motion import MotionRow, NodeMotions
from eigassign.mechanism.assembly.springs import SpringMotion, resists
from eigassign.mechanism.kinematics.rotations import DOFS, Objects, multiply
from eigassign.mechanism.kinematics.topology import GROUND, NodeName
from eigassign.series.expression import Expression, Recorder, Scalar


@dataclass(frozen=True, eq=False)
class Sagging:
    """The elastic unknowns u of a coarse mesh under weight, and the forces that follow."""

    links: Mapping[str, LocalLink]
    nodes: NodeMotions
    loads: Mapping[str, Objects]  # m N (g, 0) of each link, (n_local,)
    u: Sequence[Scalar]

    def __contains__(self, node: NodeName) -> bool:
        """True of nodes that deform."""
        return node != GROUND and "@origin" not in self.nodes.meshes[node[0]].nodes

    def moved(self, row: MotionRow) -> Scalar:
        """Σ c_k u_k; rates of coordinates do not count: they are held."""
        total: Scalar = 0.0
        for unknown, value in row.items():
            if unknown < len(self.u):
                total = total + value * self.u[unknown]
        return total

    def stretched(self, spring: SpringMotion) -> Objects:
        """The force (F, M) that a spring puts on its first node, in its axes."""
        rows = zip(spring.stiffness, spring.here, spring.there, strict=True)
        return np.array([(self.moved(there) - self.moved(here)) * k for k, here, there in rows])

    def on_node(self, node: NodeName) -> Objects:
        """What acts on a node beside the weight, (6,) in its link's axes: k v − m N (g, 0)."""
        link, slots = self.links[node[0]], self.nodes.meshes[node[0]].nodes[node[1]]
        v = [self._local(link, s) for s in range(len(link.own))]
        out = np.zeros(6, dtype=object)
        for axis, slot in enumerate(slots.tolist()):
            if slot >= 0:
                out[axis] = self.loads[node[0]][slot] * -1.0
                for coefficient, k in link.stiffness:
                    row = k[[slot]].tocoo()
                    for column, value in zip(row.col.tolist(), row.data.tolist(), strict=True):
                        out[axis] = out[axis] + coefficient * value * v[column]
        return out

    def _local(self, link: LocalLink, slot: int) -> Scalar:
        own = int(link.own[slot])
        return self.u[own] if own >= 0 else self.moved(dict(link.carried[slot]))


def sagging(
    links: Mapping[str, LocalLink],
    nodes: NodeMotions,
    springs: Sequence[SpringMotion],
    g: Mapping[str, Objects],
    recorder: Recorder,
) -> Sagging:
    """Solve K_uu u = f for the coarse ``links`` and ``nodes``."""
    n, K = nodes.count, AffineEntries()
    add_links(K, AffineEntries(), list(links.values()), n)
    for spring in springs:
        for k, here, there in zip(spring.stiffness, spring.here, spring.there, strict=True):
            full = {i: there.get(i, 0.0) - here.get(i, 0.0) for i in {*here, *there} if i < n}
            K.add_square(k, list(full.items()) if resists(k) else [])
    A: list[list[Scalar]] = [[0.0] * n for _ in range(n)]
    for i, j, atom, value in zip(*(each.tolist() for each in K.finish(n)), strict=True):
        if i < n and j < n and value != 0.0:
            one = Expression(recorder, 0.0, {atom: value}) if atom >= 0 else value
            A[i][j] = A[i][j] + one
    loads = {name: _loads(link, g[name], nodes.space) for name, link in links.items()}
    f: list[Scalar] = [0.0] * n
    for name, link in links.items():
        for slot, load in enumerate(loads[name].tolist()):
            own = int(link.own[slot])
            for unknown, value in [(own, 1.0)] if own >= 0 else link.carried.get(slot, ()):
                f[unknown] = f[unknown] + load * value
    u = [row[0] for row in recorder.solve(A, [[value] for value in f])] if n else []
    return Sagging(links, nodes, loads, u)


def _loads(link: LocalLink, g: Objects, space: str) -> Objects:
    """m N (g, 0) (n_local,) of a link in its axes."""
    pull = np.concatenate([g, np.zeros(3, dtype=object)])[list(DOFS[space])]
    out = np.zeros(len(link.own), dtype=object)
    for m in link.mass:
        for N in link.rigid:
            product, factor = m.matrix @ N.matrix, m.coefficient * N.coefficient
            values = multiply(product.toarray().astype(object), pull)
            out = out + np.array([value * factor for value in values], dtype=object)
    return out
