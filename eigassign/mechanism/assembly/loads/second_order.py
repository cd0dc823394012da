"""K_g = Bᵀ k_σ(n) B + Σ_a p_a ∂²w_a/∂x² for any loads: stressed elements, arms, joints, springs.

With the motion of its nodes (d, θ)_a, (d, θ)_b (θ rotation vectors), D = d_b − d_a, h its length, a
frame that follows the chord and the mean roll turns by ρ; in it the ends turn by θ̄. To second order

    ρ_z = D_y/h − D_x D_y/h² − ρ_x ρ_y/2,   ρ_y = −D_z/h + D_x D_z/h² + ρ_x ρ_z/2,
    θ̄ = θ − ρ − ρ × θ/2,   θ̄_ax + θ̄_bx = 0.

The forces N(ξ) along it, T of torsion and the moments M_a, M_b of its ends, the weight p per length
do the work of second order

    Π₂ = ½ ∫ N |w'|² dx + T (θ̄_bx − θ̄_ax)₂ + Σ_ends M · θ̄₂ − ∫ p · (ρ × w̄) dx,

w' the slopes of the deflection, w̄ the deflection from the chord; of p, what lies along the beam is
in N already. k_σ is its Hessian, in the element's dofs and axes as in `beam`: linear in all forces.

What acts on the nodes is in balance with the inertia of the part, or its weight. A part known by
its matrices alone is a strut between its nodes. Its strains are those of the displacements v
against a frame that turns by φ, the rotation that fits the motion of the nodes best (about a line
that they all lie on, their mean turn). To second order the wrenches (F, M) on its nodes at X and
its own weight, M r g on all its dofs, do the work

    Σ [F · (−φ × v + φ × (φ × X)/2) − M · (φ × θ)/2] + vᵀ M r (φ × g) + m g · (φ × (φ × c))/2,

r its translations, c its centre of mass and g = −Σ F/m. What bends between the nodes under the
forces inside is left out, or taken as that of a cubic between two nodes that turn alike, which is
shorter by its arms from the middle: −F · (θ̄ × (θ̄ × (X − X̄)))/6 with θ̄ = θ − φ.

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
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, TypeAlias

import numpy as np
from scipy import sparse

from eigassign.arrays import Floats
from eigassign.case.schema.mechanism import RIDING
from eigassign.mechanism.assembly.congruence import add_stressed
from eigassign.mechanism.assembly.loads.statics import Loaded, Loads, Statics, handed, statics
from eigassign.mechanism.assembly.node_motion import MotionRow, MotionRows, apply, combined
from eigassign.mechanism.assembly.pencil import AffineEntries
from eigassign.mechanism.elements.beam import (
    DEFLECTION,
    LEGENDRE,
    PLANES,
    ElementTerm,
    Shear,
    shares,
    stretched_slopes,
)
from eigassign.mechanism.elements.links import LinkMesh, Term
from eigassign.mechanism.kinematics.forward import walked
from eigassign.mechanism.kinematics.joints import (
    DOFS,
    Objects,
    carried,
    cross,
    multiply,
    present,
    scaled,
    skew,
    some,
)
from eigassign.mechanism.kinematics.parameters import is_imported
from eigassign.mechanism.kinematics.topology import JointEdge, NodeName
from eigassign.series.expression import Scalar, one_atom

Numbers: TypeAlias = Any  # arrays in place of scalars, for many loads and elements
X, Y, Z = range(3)


def _axial_forces(end: Scalar, load: Sequence[Scalar] | Objects, h: Scalar) -> list[Scalar]:
    """Legendre coefficients of N(ξ), N at the end b and those of the load per length along it."""
    axial = [end, *(0.0 for _ in range(len(load) + 1))]
    for degree, p in enumerate(load):  # ∫ P_l dξ from ξ to 1
        share = p * h * (0.5 / (2 * degree + 1))
        axial[degree - 1 if degree else 0] = axial[degree - 1 if degree else 0] + share
        axial[degree + 1] = axial[degree + 1] + share * -1.0
    return axial


def stress_terms(
    r: Numbers, load: Numbers, h: Numbers, bent: tuple[Shear, Shear], planar: bool
) -> list[ElementTerm]:
    """Affine terms of k_σ (12, 12) from what the ends of an element receive, in its axes; h in m.

    r (12,) in N and N m, and the ``load`` per length along it (n_legendre, 3); or both of m loads
    in n elements, with axes (m, n) behind.
    """
    terms: list[ElementTerm] = []
    moments = r[3:6], r[9:]
    for degree, N in enumerate(_axial_forces(r[6], load[:, X], h)):
        for plane, each in zip("z" if planar else "zy", bent, strict=False):
            terms += stretched_slopes(N, each, plane, degree, h) if some(N) else []
    works = [(moments[end][Z], moment_work(end, Z), 0) for end in (0, 1)]
    if not planar:
        works += [(moments[end][Y], moment_work(end, Y), 0) for end in (0, 1)]
        works.append(((r[9] - r[3]) * 0.5, moment_work(1, X) - moment_work(0, X), 0))
        for degree, p in enumerate(load):
            for axis, each in ((Y, bent[1]), (Z, bent[0])):
                works += [
                    (p[axis] * share, load_work(axis, degree, part), 2)
                    for part, share in enumerate(shares(each))
                ]
    return terms + [
        ElementTerm(value * h ** float(power - k), matrix)
        for value, matrices, power in works
        for k, matrix in enumerate(matrices)
        if some(value) and matrix.any()
    ]


@cache
def moment_work(end: int, axis: int) -> Floats:
    """Hessian of θ̄₂ of an end about an axis: what goes with 1, 1/h and 1/h², (3, 12, 12)."""
    D, turns, rho = _motions()
    mean = 0.5 * (turns[0] + turns[1])
    over_square = np.zeros((2, 3, 12, 12))  # D_x D_y and D_x D_z over h²
    over_square[:, 2] = [_product(D[X], D[i])[0] for i in (Y, Z)]
    frame = (
        -0.5 * _crossed(rho, mean, X),  # no mean roll is left
        over_square[1] + 0.5 * _product(rho[X], rho[Z]),
        -over_square[0] - 0.5 * _product(rho[X], rho[Y]),
    )
    return np.asarray(-frame[axis] - 0.5 * _crossed(rho, turns[end], axis))


@cache
def load_work(axis: int, degree: int, part: int) -> Floats:
    """Hessian of −∫ P_l (ρ × w̄)_axis dx/h²: what goes with 1, 1/h and 1/h², (3, 12, 12).

    (ρ × w̄)_y = −ρ_x w̄_z, (ρ × w̄)_z = ρ_x w̄_y; w̄_y = Σ h S θ̄_z, w̄_z = −Σ h S θ̄_y with one part of
    the shapes S of `bending_shapes`.
    """
    _, turns, rho = _motions()
    products = [np.convolve(S, LEGENDRE[degree]) for S in DEFLECTION[part][[1, 3]]]
    means = [float(p @ (1.0 / np.arange(1.0, len(p) + 1.0))) for p in products]
    local = sum(mean * (own[axis] - rho[axis]) for mean, own in zip(means, turns, strict=True))
    return np.asarray(-_product(rho[X], np.asarray(local)))


def _motions() -> tuple[Floats, Floats, Floats]:
    """D, (θ_a, θ_b) and ρ to first order; each a form (2, 12): what goes with 1 and with 1/h."""
    forms = np.zeros((12, 2, 12))
    forms[:, 0] = np.eye(12)
    D, turns = forms[6:9] - forms[:3], np.stack([forms[3:6], forms[9:]])
    rho = np.stack([0.5 * (turns[0, X] + turns[1, X]), -D[Z, ::-1], D[Y, ::-1]])
    return D, turns, rho


def _product(a: Floats, b: Floats) -> Floats:
    """Hessian of a product of forms (2, 12), by powers of 1/h, (3, 12, 12)."""
    out = np.zeros((3, 12, 12))
    for i, j in np.ndindex(2, 2):
        out[i + j] += np.outer(a[i], b[j]) + np.outer(b[j], a[i])
    return out


def _crossed(a: Floats, b: Floats, axis: int) -> Floats:
    """Hessian of (a × b)_axis, (3, 12, 12)."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    return _product(a[i], b[j]) - _product(a[j], b[i])


ON_A_LINE = 1e-6  # of the nodes' second moment, about an axis that they do not turn about
BENT = 1.0 / 3.0
AXES = np.eye(3)
# (a × b)_k = Σ CROSSED_kij a_i b_j
CROSSED = np.cross(AXES[:, None], AXES[None]).transpose(2, 0, 1)


def imported_terms(
    mesh: LinkMesh,
    wrenches: Sequence[tuple[str, Objects]],
    spin: Objects | None,
    space: str,
    bent: bool = False,
) -> list[Term]:
    """Affine terms of k_σ (n_local, n_local) of a mesh from what acts on its nodes.

    ``spin`` (6,) is of solids, ρ ω̃ ω̃: xx, yy, zz, xy, xz, yz.
    """
    found: dict[str, Objects] = {}
    for name, wrench in wrenches:
        found[name] = found.get(name, np.zeros(6, dtype=object)) + wrench
    if mesh.whole.stressed is None:
        return _strut_terms(mesh, found, space, bent)
    still = np.zeros(6, dtype=object)
    each = [found.get(name, still) for name in mesh.whole.nodes]
    loads = np.concatenate([*each, still if spin is None else spin])
    acting = [k for k, load in enumerate(loads) if some(load)]
    basis = None if mesh.reduction is None else mesh.reduction.basis
    matrices = mesh.whole.stressed(acting, basis) if acting else []
    return [Term(one_atom(loads[k]), A) for k, A in zip(acting, matrices, strict=True)]


def _strut_terms(
    mesh: LinkMesh, wrenches: Mapping[str, Objects], space: str, bent: bool
) -> list[Term]:
    moved, of_nodes = _node_motions(mesh)
    kept = [d - 3 for d in DOFS[space] if d >= 3]
    phi = _rotation([(X.astype(float), moved[name]) for name, X in mesh.positions.items()], kept)
    Mr, first, m = _momentum(mesh, space)
    middle = np.mean([X.astype(float) for X in mesh.positions.values()], axis=0)
    out: list[Term] = []

    def add(coefficient: Scalar, columns: Floats) -> None:
        if some(coefficient) and columns.any():
            matrix = sparse.csr_array(columns) @ of_nodes.T
            out.append(Term(coefficient, sparse.csr_array(matrix + matrix.T)))

    for name, wrench in wrenches.items():
        v, theta = moved[name][:3], moved[name][3:]
        X = mesh.positions[name].astype(float)
        for axis in range(3):
            lever = _turned_twice(phi, X - first / m, axis) - _mixed(axis, phi, v)
            if bent:
                lever -= BENT * _turned_twice(theta - phi, X - middle, axis)
            turned = Mr.T @ (CROSSED[:, :, axis] @ phi) / m
            add(wrench[axis], of_nodes @ lever - turned)
            add(wrench[3 + axis], of_nodes @ (-0.5 * _mixed(axis, phi, theta)))
    return out


def _mixed(axis: int, a: Floats, b: Floats) -> Floats:
    """(a × b)_axis of two rows of forms (3, n), as (n, n)."""
    return np.asarray(a.T @ CROSSED[axis] @ b)


def _turned_twice(phi: Floats, X: Floats, axis: int) -> Floats:
    """(φ × (φ × X))_axis/2 = (φ_axis X·φ − X_axis φ·φ)/2."""
    return np.asarray(0.5 * (np.outer(phi[axis], X @ phi) - X[axis] * (phi.T @ phi)))


def _node_motions(mesh: LinkMesh) -> tuple[dict[str, Floats], sparse.csr_array]:
    """The motion (6, n) of each node in the n dofs of all nodes, and these among all dofs."""
    own = np.concatenate([slots[slots >= 0] for slots in mesh.nodes.values()])
    of_nodes = sparse.csr_array(
        (np.ones(len(own)), (own, np.arange(len(own)))), (mesh.n_local, len(own))
    )
    return {name: 1.0 * (slots[:, None] == own) for name, slots in mesh.nodes.items()}, of_nodes


def _rotation(nodes: Sequence[tuple[Floats, Floats]], kept: Sequence[int]) -> Floats:
    """φ (3, n): least squares of the displacements, about a line the mean of the turns."""
    places, motions = np.array([X for X, _ in nodes]), np.array([v for _, v in nodes])
    arms = places - places.mean(axis=0)
    moment = sum((arm @ arm) * AXES - np.outer(arm, arm) for arm in arms)
    values, axes = np.linalg.eigh(np.asarray(moment)[np.ix_(kept, kept)])
    whole = AXES[kept].T @ axes
    swept = np.einsum("kij,ai,ajn->kn", CROSSED, arms, motions[:, :3])
    turns = motions[:, 3:].mean(axis=0)
    far = values > ON_A_LINE * max(values.max(initial=0.0), np.square(places).max(initial=0.0))
    each = [
        axis @ swept / value if seen else axis @ turns
        for axis, value, seen in zip(whole.T, values, far, strict=True)
    ]
    return np.asarray(whole @ np.array(each))


def _momentum(mesh: LinkMesh, space: str) -> tuple[Floats, Floats, float]:
    """(M r)ᵀ (3, n_local) of the part, m c (3,) and m, without bodies; no mass, no weight."""
    whole, kept = mesh.whole, list(DOFS[space])
    N = np.zeros((whole.n_local, 6))
    N[:, kept] = sum(term.matrix.toarray() for term in whole.rigid)
    Mr = np.asarray(whole.mass[0].matrix @ N[:, :3])
    B, m = N[:, 3:].T @ Mr, float(N[:, 0] @ Mr[:, 0])  # θ · (m c × a)
    if mesh.reduction is not None:
        Mr = mesh.reduction.basis.T @ Mr
    return Mr.T, np.array([B[2, 1], -B[2, 0], -B[0, 1]]), m or 1.0


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
    joint = walked(scene.case, scene.known, scene.motion.tree, edge.joint)
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
