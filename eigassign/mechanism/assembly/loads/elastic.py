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
from eigassign.mechanism.assembly.congruence import LocalLink, add_links, pulled, scattered
from eigassign.mechanism.assembly.loads.statics import Loaded
from eigassign.mechanism.assembly.node_motion import MotionRow
from eigassign.mechanism.assembly.springs import add_springs
from eigassign.mechanism.kinematics.rotations import DOFS, Objects
from eigassign.mechanism.kinematics.topology import NodeName
from eigassign.series.expression import Expression, Scalar


@dataclass(frozen=True, eq=False)
class Sagging:
    """The elastic unknowns u of a coarse mesh under weight, and the forces that follow."""

    scene: Loaded
    weights: Mapping[str, Objects]  # m N (g, 0) of each link, (n_local,)
    u: Sequence[Scalar]

    def in_spring(self, k: int) -> Objects:
        """The wrench that a spring puts on its first node, in its axes."""
        spring = self.scene.springs[k]
        rows = zip(spring.stiffness, spring.here, spring.there, strict=True)
        return np.array([(self._moved(there) - self._moved(here)) * k for k, here, there in rows])

    def received(self, node: NodeName) -> Objects:
        """What acts on a node beside the weight, (6,) in its link's axes: k v − m N (g, 0)."""
        link, slots = self.scene.links[node[0]], self.scene.nodes.meshes[node[0]].nodes[node[1]]
        v = [self._local(link, s) for s in range(len(link.own))]
        out = np.zeros(6, dtype=object)
        for axis, slot in enumerate(slots.tolist()):
            if slot >= 0:
                out[axis] = self.weights[node[0]][slot] * -1.0
                for coefficient, k in link.stiffness:
                    row = k[[slot]].tocoo()
                    for column, value in zip(row.col.tolist(), row.data.tolist(), strict=True):
                        out[axis] = out[axis] + coefficient * value * v[column]
        return out

    def _local(self, link: LocalLink, slot: int) -> Scalar:
        own = int(link.own[slot])
        return self.u[own] if own >= 0 else self._moved(dict(link.carried[slot]))

    def _moved(self, row: MotionRow) -> Scalar:
        """Σ c_k u_k; rates of coordinates do not count: they are held."""
        total: Scalar = 0.0
        for unknown, value in row.items():
            if unknown < len(self.u):
                total = total + value * self.u[unknown]
        return total


def sagging(coarse: Loaded, g: Mapping[str, Objects]) -> Sagging:
    """Solve K_uu u = f of a ``coarse`` mechanism; ``g`` (3,) in the axes of each link."""
    nodes, known, K = coarse.nodes, coarse.known, AffineEntries()
    n, kept = nodes.count, list(DOFS[nodes.space])
    add_links(K, AffineEntries(), list(coarse.links.values()), n)
    add_springs(K, coarse.case, known, coarse.motion, nodes)
    A: list[list[Scalar]] = [[0.0] * n for _ in range(n)]
    for i, j, atom, value in zip(*(each.tolist() for each in K.finish(n)), strict=True):
        if i < n and j < n and value != 0.0:
            one = Expression(known.recorder, 0.0, {atom: value}) if atom >= 0 else value
            A[i][j] = A[i][j] + one
    still = np.zeros(3, dtype=object)
    weights = {
        name: pulled(link, np.concatenate([g[name], still])[kept])
        for name, link in coarse.links.items()
    }
    f: list[Scalar] = [0.0] * n
    for name, link in coarse.links.items():
        for unknown, value in scattered(link, weights[name]).items():
            f[unknown] = f[unknown] + value
    u = [row[0] for row in known.recorder.solve(A, [[value] for value in f])] if n else []
    return Sagging(coarse, weights, u)
