"""K_g = Bᵀ k_σ(n) B + Σ_a p_a ∂²w_a/∂x² for any loads, but for the elements of beams.

A node that turns by θ (a rotation vector) moves what is rigidly attached at r by θ × (θ × r)/2 to
second order. Through a joint with lever t, whose follower moves by t₁ and turns by ψ₁ against the
base node in its axes, the follower goes

    w₂ = θ × (θ × t)/2 + θ × t₁,    ψ = θ × ψ₁/2 + ½ Σ_{i<j} A_i × A_j δ_i δ_j

with A_i, δ_i the axes and motions of its own turns in their order. F, M are what it carries. What
rides on a beam goes δ (u' − θ × e_x) farther and turns by δ θ', the beam's strains where it stands.

Arms, joints, springs and parts known by their matrices: all is linear in the wrenches n, p, and so
is one constant matrix for each of them, whether it is a function of (q, y) or a variable.
"""

from __future__ import annotations

import itertools

import numpy as np

from eigassign.case.schema.joints import RIDING
from eigassign.mechanism.assembly.congruence import add_stressed
from eigassign.mechanism.assembly.loads.statics import Loaded, Loads, Statics, handed, statics
from eigassign.mechanism.assembly.loads.stress import imported_terms
from eigassign.mechanism.assembly.node_motion import (
    MotionRow,
    MotionRows,
    apply,
    combined,
)
from eigassign.mechanism.assembly.pencil import AffineEntries
from eigassign.mechanism.elements.beam import PLANES, Shear, shares
from eigassign.mechanism.kinematics.forward import walked
from eigassign.mechanism.kinematics.parameters import is_imported
from eigassign.mechanism.kinematics.rotations import (
    Objects,
    carried,
    cross,
    multiply,
    present,
    scaled,
    skew,
    some,
)
from eigassign.mechanism.kinematics.topology import JointEdge, NodeName
from eigassign.series.expression import Scalar


def add_arms(target: AffineEntries, turn: MotionRows, D: Objects) -> None:
    """Hessian of −½ θᵀ(D − tr D)θ, D = Σ F rᵀ of forces on arms; ``turn`` are the rows of θ."""
    work = D * -0.5 + np.diag([(D[0, 0] + D[1, 1] + D[2, 2]) * 0.5] * 3)
    add_bilinear(target, work, turn, turn)


def add_joint(
    target: AffineEntries,
    base: MotionRows,
    own: MotionRows,
    freedoms: Objects,
    lever: Objects,
    wrench: Objects,
) -> None:
    """Hessian of −F · w₂ − M · ψ₂ of a joint: rows of its base node, six, and of its motions δ.

    ``freedoms`` is A (6, k) in the base's axes, the wrench what the follower puts on the base node.
    """
    F = wrench[:3]
    M = wrench[3:] - cross(lever, F)  # about the follower's node
    add_arms(target, base[3:], np.outer(F, lever))
    # −F · (θ × t₁) = θᵀ [F]× t₁, with t₁ and ψ₁ = A δ
    add_bilinear(target, multiply(skew(F), freedoms[:3]), base[3:], own)
    add_bilinear(target, multiply(skew(M), freedoms[3:]) * 0.5, base[3:], own)
    for i, j in itertools.combinations(range(len(own)), 2):
        turned = multiply(skew(freedoms[3:, i]), freedoms[3:, j])
        work = multiply(M[None], turned)[0] * -0.5
        add_bilinear(target, np.array([[work]], dtype=object), [own[i]], [own[j]])


def end_strains(h: Scalar, bent: tuple[Shear, Shear], end: int) -> Objects:
    """Strains (6, 12) at the end 0 or 1 of a beam element, of its dofs and in its axes.

    The stretch, two shear angles and the rates of turning, (u' − θ × e_x, θ'); with the symbols of
    `Shear` −6 h γ = Φ/(1+Φ) (t + r b)ᵀ d and h² κ = bᵀ d + (tᵀ d + 6 h γ) τ, τ = ∓1.
    """
    out, over = np.zeros((6, 12), dtype=object), h**-1.0
    for row in (0, 3):
        out[row, row], out[row, row + 6] = over * -1.0, over
    b, t, tau = (0.0, -1.0, 0.0, 1.0), (6.0, 3.0, -6.0, 3.0), (-1.0, 1.0)[end]
    for (w, theta, sign), each in zip(PLANES, bent, strict=True):
        _, phi, skew = [*shares(each), 0.0, 0.0][:3]
        for k, dof in enumerate((w, theta, w + 6, theta + 6)):
            d = h * sign if k % 2 else 1.0
            sheared = (phi * t[k] + skew * b[k]) * d  # −6 h γ
            out[w, dof] = sheared * over * (-1.0 / 6.0)
            out[theta, dof] = ((b[k] + t[k] * tau) * d - sheared * tau) * over * over * sign
    return out


def add_spring(
    target: AffineEntries, here: MotionRows, there: MotionRows, arm: Objects, force: Objects
) -> None:
    """Hessian of (F, M) · what a spring stretches by to second order, in its axes.

    With D the motion of its second node against the first, θ₁, θ₂ their turns and d the arm:
    −θ₁ × D + θ₁ × (θ₁ × d)/2 and −θ₁ × θ₂/2. ``here`` are the rows of the first node itself.
    """
    F, M = force[:3], force[3:]
    apart = [combined(b, a, -1.0) for a, b in zip(here[:3], there[:3], strict=True)]
    add_arms(target, here[3:], np.outer(F, arm) * -1.0)
    add_bilinear(target, skew(F), here[3:], apart)  # −F · (θ × D) = θᵀ [F]× D
    add_bilinear(target, skew(M) * 0.5, here[3:], there[3:])


def add_bilinear(target: AffineEntries, work: Objects, left: MotionRows, right: MotionRows) -> None:
    """Hessian of aᵀ C b, a and b the motions of two sets of rows."""
    for i, j in zip(*np.nonzero(present(work)), strict=True):
        a, b = list(left[i].items()), list(right[j].items())
        if a and b:
            target.add_product(work[i, j], a, b)


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
