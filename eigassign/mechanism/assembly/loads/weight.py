"""The weight as loads that are functions of (q, y), and k_σ of the beams that it stresses.

The pose is held, every coordinate locked, and the elastic unknowns of a coarse mesh follow from

    K_uu u = f,    f = Qᵀ m N (g, 0).

One element for each beam is exact at its nodes, for its shapes solve the equations of statics.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from eigassign.arrays import Floats
from eigassign.mechanism.assembly.congruence import (
    add_links,
    add_stressed,
    inertia,
    pulled,
    scattered,
)
from eigassign.mechanism.assembly.loads.second_order import add_second_order, on_nodes, stress_terms
from eigassign.mechanism.assembly.loads.statics import (
    Loaded,
    Loads,
    first_moment,
    hangs_on_stiffness,
)
from eigassign.mechanism.assembly.node_motion import MotionRow, add_springs
from eigassign.mechanism.assembly.pencil import AffineEntries
from eigassign.mechanism.elements.beam import element_mass, element_stiffness
from eigassign.mechanism.elements.links import Entries, LinkMesh, Strand, Term, summed
from eigassign.mechanism.kinematics.joints import DOFS, Objects, cross, multiply, scaled
from eigassign.mechanism.kinematics.loop_closure import passive_motion
from eigassign.mechanism.kinematics.parameters import link_type
from eigassign.mechanism.kinematics.topology import NodeName
from eigassign.series.expression import Scalar, atom_of, one_atom, parts


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
        v = [self._moved(self.scene.local(node[0], s)) for s in range(len(link.own))]
        out = np.zeros(6, dtype=object)
        for axis, slot in enumerate(slots.tolist()):
            if slot >= 0:
                out[axis] = self.weights[node[0]][slot] * -1.0
                for coefficient, k in link.stiffness:
                    row = k[[slot]].tocoo()
                    for column, value in zip(row.col.tolist(), row.data.tolist(), strict=True):
                        out[axis] = out[axis] + coefficient * value * v[column]
        return out

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
            A[i][j] = A[i][j] + known.recorder.function(atom) * value
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


Acting = dict[int, Objects]  # wrenches in the link's axes by the first slot of the node


def add_weight(
    K: AffineEntries, scene: Loaded, gravity: Floats, coarse: Callable[[], Loaded]
) -> None:
    """K += K_g for gravity g (3,) in m/s².

    ``coarse`` makes the mechanism in as few elements as may be. Raises MechanismError where the
    internal forces are not known.
    """
    placements = scene.motion.placements
    g = {p.link: multiply(p.world_rotation.T, gravity) for p in placements}
    loads = weight_loads(scene, g, coarse)
    found = add_second_order(K, scene, loads)
    for name, link in scene.links.items():
        if scene.whole(name).strands:
            acting: Acting = {}
            for node, wrench in on_nodes(scene, found, loads, name):
                slot = int(scene.nodes.meshes[name].nodes[node][0])
                own = np.array([one_atom(v) for v in wrench])
                acting[slot] = acting.get(slot, np.zeros(6, dtype=object)) + own
            add_stressed(K, link, _stressed(scene, name, g[name], acting), scene.nodes.count)


def weight_loads(scene: Loaded, g: Mapping[str, Objects], coarse: Callable[[], Loaded]) -> Loads:
    """The weight, for gravity g (3,) in the axes of each link."""
    kept, still = list(DOFS[scene.nodes.space]), np.zeros(3, dtype=object)
    on_links = {}
    for name, link in scene.links.items():
        on_links[name] = np.zeros(6, dtype=object)
        on_links[name][kept] = multiply(inertia(link), np.concatenate([g[name], still])[kept])
    hanging = hangs_on_stiffness(scene.case, scene.motion)
    sag = sagging(coarse(), g) if hanging else None
    return Loads(
        on_links,
        {node: multiply(m[:, :3], g[node[0]]) for node, m in scene.sites.items()},
        {node: np.outer(g[node[0]], first_moment(m)) for node, m in scene.sites.items()},
        {},
        {k: sag.in_spring(k) for k in range(len(scene.springs))} if sag else {},
        {node: sag.received(node) for node in scene.settled.nodes} if sag else {},
    )


# --- beams


def _stressed(scene: Loaded, name: str, g: Objects, acting: Acting) -> list[Term]:
    """k_σ of a link of beams from what acts on its nodes, in its local dofs."""
    mesh, reduction = scene.whole(name), scene.nodes.meshes[name].reduction
    out, planar = Entries((mesh.n_local, mesh.n_local)), scene.nodes.space == "planar"
    if link_type(scene.case, name) == "beam":
        _add_row(out, mesh.strands, g, acting, planar)
    else:
        for strand, force in zip(mesh.strands, _end_forces(scene, mesh, g, acting), strict=True):
            _add_row(out, (strand,), g, {int(strand.slots[-1][0]): force}, planar)
    if reduction is None:
        return out.terms()
    T = reduction.basis
    return [Term(c, sparse.csr_array(T.T @ (A @ T))) for c, A in out.terms()]


def _end_forces(scene: Loaded, mesh: LinkMesh, g: Objects, acting: Acting) -> list[Objects]:
    """The wrench on the end of each beam of a frame: K v = f with one node held."""
    ends = [[int(strand.slots[end][0]) for end in (0, -1)] for strand in mesh.strands]
    first = {slot: 6 * k for k, slot in enumerate(dict.fromkeys(s for own in ends for s in own))}
    dofs = [np.concatenate([first[slot] + np.arange(6) for slot in own]) for own in ends]
    beams = [_whole_beam(strand, g) for strand in mesh.strands]
    n = 6 * len(first)
    K, f, v = np.zeros((n, n), dtype=object), *np.zeros((2, n), dtype=object)
    for at, (k_e, f_e) in zip(dofs, beams, strict=True):
        K[np.ix_(at, at)] += k_e
        f[at] += f_e
    for slot, wrench in acting.items():
        f[first[slot] : first[slot] + 6] += wrench
    loose = [k for k in range(6, n) if k % 6 in DOFS[scene.nodes.space]]
    right = np.array([[-value] for value in f[loose]], dtype=object)
    v[loose] = passive_motion(scene.known.recorder, K[np.ix_(loose, loose)], right)[:, 0]
    forces = [(multiply(k_e, v[at]) - f_e)[6:] for at, (k_e, f_e) in zip(dofs, beams, strict=True)]
    return [np.array([one_atom(value) for value in force]) for force in forces]


def _whole_beam(strand: Strand, g: Objects) -> tuple[Objects, Objects]:
    """Stiffness (12, 12) and weight (12,) of a straight beam of one section, in the link's axes."""
    R, still = strand.turned(4), np.zeros(3, dtype=object)
    h = float(np.linalg.norm((strand.points[-1] - strand.points[0]).astype(np.float64)))
    k, m = (
        summed([(c, R.T @ matrix @ R) for c, matrix in terms], 12)
        for terms in (element_stiffness(strand.profiles[0], h), element_mass(strand.profiles[0], h))
    )
    return k, multiply(m, np.concatenate([g, still, g, still]))


def _add_row(
    out: Entries, strands: Sequence[Strand], g: Objects, acting: Acting, planar: bool
) -> None:
    """k_σ of strands one after the other, the forces of their elements summed from the end."""
    still = np.zeros(6, dtype=object)
    beyond, g = still, np.array([one_atom(v) for v in g])  # about the last node, link's axes
    for strand, k in [(s, k) for s in strands for k in range(len(s.profiles))][::-1]:
        turn, R, h = strand.turned(1), strand.turned(4), strand.lengths[k]
        own = multiply(turn, g)
        p = np.array([scaled(own, beam.mass) for beam in strand.profiles[k][:3]], dtype=object)
        beyond = beyond + acting.get(int(strand.slots[k + 1][0]), still)
        r, beyond = _through_element(beyond, turn, p, h)
        dofs = np.append(strand.slots[k], strand.slots[k + 1])
        for whole, matrix in stress_terms(r, p, h, strand.shear[k], planar):
            turned = R.T @ matrix @ R
            i, j = np.nonzero(np.abs(turned) > 1e-14 * np.abs(turned).max())
            kept = (dofs[i] >= 0) & (dofs[j] >= 0)
            place = dofs[i][kept], dofs[j][kept]
            for atom, factor in parts(whole):
                out.add(atom_of(whole, atom) * factor, *place, turned[i, j][kept])


def _through_element(
    beyond: Objects, turn: Floats, p: Objects, h: Scalar
) -> tuple[Objects, Objects]:
    """What the ends of an element receive (12,), and the wrench about its first node of all."""
    F, M = multiply(turn, beyond[:3]), multiply(turn, beyond[3:])
    # ∫ ξ P_l dξ = 1/2, 1/6 for l = 0, 1
    first = p[0] * 0.5 + (p[1] * (1.0 / 6.0) if len(p) > 1 else 0.0)
    along = np.array([1.0, 0.0, 0.0], dtype=object)
    F_a = F + scaled(p[0], h)
    M_a = M + scaled(cross(along, F), h) + scaled(cross(along, first), h * h)
    total = np.concatenate([multiply(turn.T, F_a), multiply(turn.T, M_a)])
    return np.concatenate([F_a * -1.0, M_a * -1.0, F, M]), total
