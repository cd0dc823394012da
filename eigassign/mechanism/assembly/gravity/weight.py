"""All terms of K_g, added to the entries of K: beams, arms and joints under weight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from eigassign.case.case_file import CaseFile
from eigassign.case.schema.joints import RIDING
from eigassign.mechanism.assembly.affine_entries import AffineEntries
from eigassign.mechanism.assembly.congruence import LocalLink, add_stressed
from eigassign.mechanism.assembly.gravity.beam_stress import (
    ElementForces,
    axial_forces,
    stress_terms,
)
from eigassign.mechanism.assembly.gravity.curvature import (
    add_arm,
    add_joint,
    add_spring,
    end_strains,
)
from eigassign.mechanism.assembly.gravity.imported import strut_terms
from eigassign.mechanism.assembly.gravity.statics import Statics, handed, statics
from eigassign.mechanism.assembly.node_motion import (
    MotionRow,
    MotionRows,
    NodeMotions,
    apply,
    combined,
)
from eigassign.mechanism.assembly.springs import SpringEnds
from eigassign.mechanism.elements.beam import ElementTerm, element_mass, element_stiffness
from eigassign.mechanism.elements.mesh import Entries, LinkMesh, Strand, Term
from eigassign.mechanism.kinematics.forward import Kinematics, shifted, walked
from eigassign.mechanism.kinematics.loop_closure import passive_motion
from eigassign.mechanism.kinematics.parameters import ModelParameters, link_type, node_position
from eigassign.mechanism.kinematics.rotations import (
    DOFS,
    Floats,
    Objects,
    carried,
    cross,
    multiply,
    present,
    scaled,
    some,
)
from eigassign.mechanism.kinematics.topology import GROUND, JointEdge, NodeName, split
from eigassign.series.expression import Scalar, atom_of, one_atom, parts


def add_weight(
    K: AffineEntries,
    case: CaseFile,
    parameters: ModelParameters,
    motion: Kinematics,
    links: Sequence[LocalLink],
    nodes: NodeMotions,
    gravity: Floats,
    coarse: tuple[Sequence[LocalLink], NodeMotions] | None,
) -> None:
    """K += K_g for gravity g (3,) in m/s²; ``coarse`` as in `statics`.

    Raises MechanismError where the internal forces are not known.
    """
    known = parameters.with_passive(motion.passive)
    local = {p.link: link for p, link in zip(motion.placements, links, strict=True)}
    few = None
    if coarse is not None:
        few = {p.link: c for p, c in zip(motion.placements, coarse[0], strict=True)}, coarse[1]
    found = statics(case, parameters, motion, local, gravity, few)
    weight = Weight(K, case, known, motion, local, nodes, found)
    for name, link in local.items():
        terms = weight.stressed(name)
        if terms:
            add_stressed(K, link, terms, nodes.count)
        weight.add_arms(name)
    for edge in (*motion.tree.edges, *motion.tree.loops):
        weight.add_joint(edge)
    weight.add_springs()


@dataclass(frozen=True, eq=False)
class Weight:
    """The weight of a mechanism and the motions on which it works."""

    K: AffineEntries
    case: CaseFile
    parameters: ModelParameters  # passive freedoms known
    motion: Kinematics
    links: Mapping[str, LocalLink]
    nodes: NodeMotions
    statics: Statics

    # --- motions

    def rows(self, node: NodeName) -> MotionRows:
        """The whole motion of a node in its link's axes: elastic rows and columns of N T."""
        if node == GROUND:
            return [{} for _ in range(6)]
        rigid = shifted(self.motion.placement(node[0]).twist, self._place(node))
        rows = [dict(row) for row in self.nodes.rows(node)]
        for a, k in zip(*np.nonzero(present(rigid)), strict=True):
            rows[a][self.nodes.count + int(k)] = rigid[a, k]
        return rows

    def _place(self, node: NodeName) -> Objects:
        if node[1] == "@origin":
            return np.zeros(3, dtype=object)
        return node_position(self.case, self.parameters, self.motion.tree, node)

    # --- arms

    def add_arms(self, link: str) -> None:
        """What hangs on a link beside its nodes: its bodies, and of a rigid one all there is."""
        g = self.statics.g[link]
        rigid = "@origin" in self.nodes.meshes[link].nodes
        for key, body in self.case.mechanism.bodies.items():
            at = split(body.at)
            if at[0] == link:
                arm = self.parameters.vector(f"bodies.{key}.offset", body.offset)
                mass = self.parameters.number(f"bodies.{key}.mass", body.mass)
                if rigid:
                    arm, at = arm + self._place(at), (link, "@origin")
                add_arm(self.K, self.rows(at)[3:], scaled(g, mass), arm)
        if not rigid:
            return
        data: Any = self.case.mechanism.links[link]
        turn = self.rows((link, "@origin"))[3:]
        mass = self.parameters.number(f"links.{link}.mass", data.mass)
        center = self.parameters.vector(f"links.{link}.center", data.center)
        add_arm(self.K, turn, scaled(g, mass), center)
        for node, wrench in self.statics.on_nodes[link]:
            add_arm(self.K, turn, wrench[:3], self._place((link, node)))

    # --- joints

    def add_joint(self, edge: JointEdge) -> None:
        """What a joint's follower does to second order, as the file has it."""
        written, wrench = edge.written, self.statics.through[edge.joint]
        own = self.motion.tree.of_joint(edge.joint)
        values = [self.parameters.freedom(k) for k in own]
        joint = walked(self.case, self.parameters, edge.joint, False, values)
        if edge.turned:
            back = joint.rotation
            wrench = handed(wrench * -1.0, back, joint.translation)
        freedoms = np.concatenate(np.split(joint.freedoms, 2), axis=1)
        turned = np.concatenate(np.split(multiply(joint.rotation, freedoms), 2, axis=1))
        rows = [self._own_motion(k) for k in own]
        add_joint(self.K, self.rows(written.base), rows, turned, joint.translation, wrench)
        if self.case.mechanism.joints[edge.joint].type in RIDING and rows[0]:
            work = self._strained(written.base, wrench)
            self.K.add_product(-1.0, list(work.items()), list(rows[0].items()))

    def _strained(self, node: NodeName, wrench: Objects) -> MotionRow:
        """F · (u' − θ × e_x) + M · θ' at a node within a beam, the mean of both its sides."""
        name, mesh = node[0], self.nodes.meshes[node[0]]
        (strand,) = mesh.strands
        k = next(k for k, slots in enumerate(strand.slots) if slots[0] == mesh.nodes[node[1]][0])
        axes = _axes(strand)
        turn = np.asarray(np.kron(np.eye(2), axes), dtype=np.float64)
        twice = np.asarray(np.kron(np.eye(2), turn), dtype=np.float64)
        work: MotionRow = {}
        for first, end in ((k - 1, 1), (k, 0)):
            h = multiply(axes, strand.points[first + 1] - strand.points[first])[0]
            strains = end_strains(h, strand.shear[first], end)
            shares = multiply(scaled(multiply(turn, wrench), 0.5)[None], strains)
            shares = multiply(shares, twice)[0]
            slots = np.append(strand.slots[first], strand.slots[first + 1]).tolist()
            for slot, share in zip(slots, shares.tolist(), strict=True):
                if slot >= 0 and some(share):
                    work = combined(work, self._local(name, slot), share)
        return work

    def _local(self, name: str, slot: int) -> MotionRow:
        """The elastic motion of one dof of a link."""
        link = self.links[name]
        own = int(link.own[slot])
        return {own: 1.0} if own >= 0 else dict(link.carried[slot])

    def _own_motion(self, freedom: int) -> MotionRow:
        """The motion of one freedom of a joint, elastic and with the coordinates."""
        named = self.motion.tree.freedoms[freedom]
        row = dict(self.nodes.passive.get((named.joint, named.component), {}))
        for k, rate in enumerate(self.motion.rates[freedom]):
            if some(rate):
                row[self.nodes.count + k] = rate
        return row

    # --- springs

    def add_springs(self) -> None:
        """What the forces of springs do to second order."""
        count, eye = self.nodes.count, np.eye(3).astype(object)
        ends = SpringEnds(self.case, self.parameters, self.motion, self.nodes.rows, count).each()
        for spring, (_, force) in zip(ends, self.statics.springs, strict=True):
            arm = multiply(spring.rotation.T, spring.arm)
            here = apply(carried(eye, arm * -1.0), spring.here)
            add_spring(self.K, here, spring.there, arm, force)

    # --- beams

    def stressed(self, name: str) -> list[Term]:
        """k_σ of a link from the forces inside it, in its local dofs."""
        mesh = self.nodes.meshes[name]
        whole = mesh if mesh.reduction is None else mesh.reduction.mesh
        match link_type(self.case, name):
            case "rigid":
                return []
            case "beam":
                terms = self._beam(name, whole)
            case "frame":
                terms = self._frame(name, whole)
            case _:
                own = scaled(self.statics.g[name], whole.mass[0].coefficient)
                return strut_terms(mesh, self._on_nodes(name), own, self.nodes.space)
        if mesh.reduction is None:
            return terms
        T = mesh.reduction.basis
        return [Term(c, sparse.csr_array(T.T @ (A @ T))) for c, A in terms]

    def _beam(self, name: str, mesh: LinkMesh) -> list[Term]:
        (strand,) = mesh.strands
        out = Entries((mesh.n_local, mesh.n_local))
        first = {int(slots[0]): k for k, slots in enumerate(strand.slots)}
        acting = [np.zeros(6, dtype=object) for _ in strand.slots]
        for node, wrench in self._on_nodes(name):
            acting[first[int(mesh.nodes[node][0])]] += wrench
        self._add_strand(out, name, strand, acting)
        return out.terms()

    def _frame(self, name: str, mesh: LinkMesh) -> list[Term]:
        """The beams of a frame, each with the force at its end: K v = f with one node held."""
        n, kept = len(mesh.strands[0].slots[0]), list(DOFS[self.nodes.space])
        order: dict[int, int] = {}
        for strand in mesh.strands:
            for slots in (strand.slots[0], strand.slots[-1]):
                order.setdefault(int(slots[0]), len(order))
        K = np.zeros((n * len(order), n * len(order)), dtype=object)
        f = np.zeros(n * len(order), dtype=object)
        beams = []
        for strand in mesh.strands:
            at = [order[int(strand.slots[end][0])] for end in (0, -1)]
            dofs = np.concatenate([np.arange(6 * k, 6 * k + 6) for k in at])
            k_e, f_e = _whole_beam(strand, self.statics.g[name])
            K[np.ix_(dofs, dofs)] += k_e
            f[dofs] += f_e
            beams.append((dofs, k_e, f_e))
        for node, wrench in self._on_nodes(name):
            k = order[int(mesh.nodes[node][0])]
            f[6 * k : 6 * k + 6] += wrench
        loose = [6 * k + d for k in range(1, len(order)) for d in kept]
        v = np.zeros(len(f), dtype=object)
        right = np.array([[-value] for value in f[loose]], dtype=object)
        v[loose] = passive_motion(self.parameters.recorder, K[np.ix_(loose, loose)], right)[:, 0]
        out = Entries((mesh.n_local, mesh.n_local))
        for strand, (dofs, k_e, f_e) in zip(mesh.strands, beams, strict=True):
            acting = [np.zeros(6, dtype=object) for _ in strand.slots]
            force = (multiply(k_e, v[dofs]) - f_e)[6:]
            acting[-1] = np.array([one_atom(value) for value in force])
            self._add_strand(out, name, strand, acting)
        return out.terms()

    def _add_strand(
        self, out: Entries, name: str, strand: Strand, acting: Sequence[Objects]
    ) -> None:
        """k_σ of a row of elements for what acts on its nodes, in the link's axes."""
        turn, planar = _axes(strand), self.nodes.space == "planar"
        R, beyond = _of_element(turn), np.zeros(6, dtype=object)  # about the last node
        g = multiply(turn, np.array([one_atom(v) for v in self.statics.g[name]]))
        for k in range(len(strand.profiles) - 1, -1, -1):
            h = strand.lengths[k]
            p = np.array([scaled(g, beam.mass) for beam in strand.profiles[k][:3]], dtype=object)
            forces, beyond = _through_element(beyond + acting[k + 1], turn, p, h)
            dofs = np.append(strand.slots[k], strand.slots[k + 1])
            for whole, matrix in stress_terms(forces, h, strand.shear[k], planar):
                turned = R.T @ matrix @ R
                i, j = np.nonzero(np.abs(turned) > 1e-14 * np.abs(turned).max())
                kept = (dofs[i] >= 0) & (dofs[j] >= 0)
                place = dofs[i][kept], dofs[j][kept]
                for atom, factor in parts(whole):
                    out.add(atom_of(whole, atom) * factor, *place, turned[i, j][kept])

    def _on_nodes(self, name: str) -> list[tuple[str, Objects]]:
        """Wrenches on the nodes of a link, the bodies' weight among them, in its axes."""
        acting = [
            (node, np.array([one_atom(v) for v in wrench]))
            for node, wrench in self.statics.on_nodes[name]
        ]
        for key, body in self.case.mechanism.bodies.items():
            link, node = split(body.at)
            if link == name:
                mass = self.parameters.number(f"bodies.{key}.mass", body.mass)
                F = scaled(self.statics.g[name], mass)
                arm = self.parameters.vector(f"bodies.{key}.offset", body.offset)
                acting.append((node, np.concatenate([F, cross(arm, F)])))
        return acting


def _whole_beam(strand: Strand, g: Objects) -> tuple[Objects, Objects]:
    """Stiffness (12, 12) and weight (12,) of a straight beam of one section, in the link's axes."""
    R = _of_element(_axes(strand))
    h = float(np.linalg.norm((strand.points[-1] - strand.points[0]).astype(np.float64)))
    k, m = (
        _summed(terms, R)
        for terms in (element_stiffness(strand.profiles[0], h), element_mass(strand.profiles[0], h))
    )
    still = np.zeros(3, dtype=object)
    return k, multiply(m, np.concatenate([g, still, g, still]))


def _axes(strand: Strand) -> Floats:
    """(3, 3): the axes of a row of elements, which a mesh has always."""
    return np.asarray(strand.axes, dtype=np.float64)


def _of_element(turn: Floats) -> Floats:
    """The turn of all twelve dofs."""
    return np.asarray(np.kron(np.eye(4, dtype=np.float64), turn), dtype=np.float64)


def _summed(terms: Sequence[ElementTerm], R: Floats) -> Objects:
    out = np.zeros((12, 12), dtype=object)
    for coefficient, matrix in terms:
        turned = R.T @ matrix @ R
        for i, j in zip(*np.nonzero(turned), strict=True):
            out[i, j] = out[i, j] + coefficient * float(turned[i, j])
    return out


def _through_element(
    beyond: Objects, turn: Floats, p: Objects, h: Scalar
) -> tuple[ElementForces, Objects]:
    """The forces in an element, and the wrench about its first node of it and all beyond.

    ``beyond`` is about its last node in the link's axes, p (n_legendre, 3) its weight per length in
    its own.
    """
    F, M = multiply(turn, beyond[:3]), multiply(turn, beyond[3:])
    weight = scaled(p[0], h)
    # ∫ ξ P_l dξ = 1/2, 1/6 for l = 0, 1
    first = p[0] * 0.5 + (p[1] * (1.0 / 6.0) if len(p) > 1 else 0.0)
    along = np.array([1.0, 0.0, 0.0], dtype=object)
    M_a = M + scaled(cross(along, F), h) + scaled(cross(along, first), h * h)
    forces = ElementForces(
        axial_forces(F[0], p[:, 0], h), M[0], np.array([M_a * -1.0, M], dtype=object), p
    )
    total = np.concatenate([multiply(turn.T, F + weight), multiply(turn.T, M_a)])
    return forces, total
