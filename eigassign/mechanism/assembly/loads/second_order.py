"""K_g = Bᵀ k_σ(n) B + Σ_a p_a ∂²w_a/∂x² for any loads, but for the elements of beams.

Arms, joints, springs and parts known by their matrices: all is linear in the wrenches n, p, and so
is one constant matrix for each of them, whether it is a function of (q, y) or a variable.
"""

from __future__ import annotations

import numpy as np

from eigassign.case.schema.joints import RIDING
from eigassign.mechanism.assembly.affine_entries import AffineEntries
from eigassign.mechanism.assembly.congruence import add_stressed
from eigassign.mechanism.assembly.loads.curvature import (
    add_arms,
    add_joint,
    add_spring,
    end_strains,
)
from eigassign.mechanism.assembly.loads.imported import imported_terms
from eigassign.mechanism.assembly.loads.statics import Loaded, Loads, Statics, handed, statics
from eigassign.mechanism.assembly.node_motion import (
    MotionRow,
    apply,
    combined,
)
from eigassign.mechanism.kinematics.forward import walked
from eigassign.mechanism.kinematics.parameters import is_imported
from eigassign.mechanism.kinematics.rotations import (
    Objects,
    carried,
    multiply,
    scaled,
    some,
)
from eigassign.mechanism.kinematics.topology import JointEdge, NodeName


def add_second_order(K: AffineEntries, scene: Loaded, loads: Loads) -> Statics:
    """K += K_g for the loads, all but that of beams; the statics, for these.

    Raises MechanismError where the internal forces are not known.
    """
    found = statics(scene, loads)
    for name, link in scene.links.items():
        if is_imported(scene.case, name):
            mesh, wrenches = scene.nodes.meshes[name], on_nodes(scene, found, loads, name)
            spin, space = loads.in_solids.get(name), scene.nodes.space
            terms = imported_terms(mesh, wrenches, spin, space, scene.bent)
            add_stressed(K, link, terms, scene.nodes.count)
        for node in scene.sites_of(name):
            D = loads.arms[node]
            if scene.is_rigid(name):
                for own, wrench in found.on_nodes[name]:
                    D = D + np.outer(wrench[:3], scene.place((name, own)))
            add_arms(K, scene.rows(node)[3:], D)
    for edge in (*scene.motion.tree.edges, *scene.motion.tree.loops):
        _add_joint(K, scene, edge, found.through[edge.joint])
    for k, spring in enumerate(scene.springs):
        arm = multiply(spring.rotation.T, spring.arm)
        here = apply(carried(np.eye(3).astype(object), arm * -1.0), spring.here)
        add_spring(K, here, spring.there, arm, loads.in_springs[k])
    return found


def on_nodes(scene: Loaded, found: Statics, loads: Loads, name: str) -> list[tuple[str, Objects]]:
    """Wrenches on the nodes of a link, those of bodies among them, in its axes."""
    bodies = [(node[1], loads.on_sites[node]) for node in scene.sites_of(name)]
    return [*found.on_nodes[name], *bodies]


def _add_joint(K: AffineEntries, scene: Loaded, edge: JointEdge, wrench: Objects) -> None:
    """What a joint's follower does to second order, as the file has it."""
    written, own = edge.written, scene.motion.tree.of_joint(edge.joint)
    values = [scene.known.freedom(k) for k in own]
    joint = walked(scene.case, scene.known, edge.joint, False, values)
    if edge.turned:
        wrench = handed(wrench * -1.0, joint.rotation, joint.translation)
    freedoms = np.concatenate(np.split(joint.freedoms, 2), axis=1)
    turned = np.concatenate(np.split(multiply(joint.rotation, freedoms), 2, axis=1))
    rows = [scene.freedom(k) for k in own]
    add_joint(K, scene.rows(written.base), rows, turned, joint.translation, wrench)
    if scene.case.mechanism.joints[edge.joint].type in RIDING and rows[0]:
        work = _strained(scene, written.base, wrench)
        K.add_product(-1.0, list(work.items()), list(rows[0].items()))


def _strained(scene: Loaded, node: NodeName, wrench: Objects) -> MotionRow:
    """F · (u' − θ × e_x) + M · θ' at a node within a beam, the mean of both its sides."""
    name, mesh = node[0], scene.nodes.meshes[node[0]]
    (strand,) = mesh.strands
    k = next(k for k, slots in enumerate(strand.slots) if slots[0] == mesh.nodes[node[1]][0])
    turn = strand.turned(2)
    work: MotionRow = {}
    for first, end in ((k - 1, 1), (k, 0)):
        strains = end_strains(strand.lengths[first], strand.shear[first], end)
        shares = multiply(scaled(multiply(turn, wrench), 0.5)[None], strains)
        shares = multiply(shares, strand.turned(4))[0]
        slots = np.append(strand.slots[first], strand.slots[first + 1]).tolist()
        for slot, share in zip(slots, shares.tolist(), strict=True):
            if slot >= 0 and some(share):
                work = combined(work, scene.local(name, slot), share)
    return work
