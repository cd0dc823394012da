"""What the weight and forces do: to frequencies, and to nodes.

Of modes K φ = λ M φ, φᵀMφ = 1, one m/s² along an axis of the ground changes λ by

    φᵀ K_g[g] φ + 2 u₀ᵀ K_g[p] φ,   K u₀ = Bᵀ m g with the coordinates held,   p = λ m B φ :

the stress, and the sag u₀. The second is φᵀ(∂K/∂x·u₀ − λ ∂M/∂x·u₀)φ without assembling anything
anew, for the third derivative of the potential is symmetric: the forces inside that u₀ meets while
the mode moves are those that the mode meets while u₀ bends it. Both are linear in g.

Weight mixes modes: with the small matrix C of all modes up to a few above those asked for, mode k
changes by |C_kk| + Σ_j min(|C_kj|, g C_kj²/|λ_j − λ_k|) at most, g = 9.81 m/s²; of sag only modes
count that are near.

Of gravity that is stated a finer computation tells the sag: `sag_changes` assembles the mechanism
anew as it is bent, of second order in g by stress, geometry and loops that close elsewhere.

Between two forces l and r that is lᵀ K⁻¹ r: of a unit force at a node against itself the compliance
along it, of one against the weight the sag along it. With u_l and u_r what gives way under each,

    ∂(lᵀ K⁻¹ r)/∂x = ∂lᵀ/∂x u_r + u_lᵀ ∂r/∂x − u_lᵀ ∂K/∂x u_r ,

from one factorisation of K a sample; of a large pencil from one for all samples.

Each element keeps what statics say of it in its own axes, its stretch and the turn of one end
against the other, and is set on the one before it, with rotations of any size. So nodes lie at
other places of their link and are turned in it, joints, bodies and springs with them (`Moved`), and
loops close anew.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from eigassign.arrays import Bools, Floats, Ints
from eigassign.case.schema.mechanism import RIDING, Assembly
from eigassign.case.schema.parts import FrozenDict
from eigassign.errors import LIMP, MechanismError
from eigassign.mechanism.assembly.build import (
    build_pencil,
    erls_motion,
    local_links,
    with_reduction,
)
from eigassign.mechanism.assembly.dynamics.under_load import Beams, LoadedPose
from eigassign.mechanism.assembly.mode_shapes import shapes
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.mechanism.elements.craig_bampton import factorise
from eigassign.mechanism.elements.links import BentElement, LinkMesh, Strand, bent_link
from eigassign.mechanism.elements.sections import Profile, each_element
from eigassign.mechanism.forces import Forces, forces
from eigassign.mechanism.kinematics.forward import LinkFrames
from eigassign.mechanism.kinematics.joints import X
from eigassign.mechanism.kinematics.parameters import Moved, is_imported
from eigassign.mechanism.kinematics.topology import NodeName
from eigassign.modal.arguments import chunks, solve_blocks
from eigassign.modal.exact.inertia import buckling_share
from eigassign.modal.exact.large import solve_large_statics
from eigassign.modal.exact.solver import lowest_modes, works_changed
from eigassign.modal.mesh_error import standing_frequencies
from eigassign.modal.model import Model

STANDARD_GRAVITY = 9.81  # m/s²
NEIGHBOURS = 3  # modes above those asked for that weight may mix with them
# of λ: stress mixes all modes, which is of second order where they are far from each other; of sag,
# which is stated to first order, that of near ones counts alone
FAR = (np.inf, 0.1)
# Struts are off by so many times what bends as a cubic changes most. Of 19 castings and directions,
# two loads each, as struts against K_σ, three modes, 36 of 38 largest errors are covered; the
# others, of an L loaded across its plane, are 2.5 times as large
STRUTS = 2.5
UNLOADED = 0.02  # of the buckling load, up to which struts are not doubted
# What is assembled is off by a tenth of itself, or by this share of the largest change of a mode:
# with either, at the largest weight that is not warned of, a corotational program has 4 of 105
# random chains, loops and bent arms with a mode above what is told, up to 2 times
MARGIN, SHARED = 1.1, 0.03


@dataclass(frozen=True, eq=False)
class WeightChanges:
    """∂λ/λ per 1 m/s² along each axis of the ground, (n_samples, n_modes, n_axes)."""

    stress: Floats  # by the forces inside
    sag: Floats  # by the geometry that bends
    stress_mixing: Floats  # what other modes add to either at most, by mixing
    sag_mixing: Floats


def weight_changes(model: Model, q: ArrayLike, y: ArrayLike, modes: Sequence[int]) -> WeightChanges:
    """What one more m/s² would change of the ``modes`` (from 1) at samples q, y."""
    x = model.x(q, y)
    found = [
        _changes(model, pose, model.pencil.theta(own[None]), modes)
        for own, pose in zip(x, model.under_load.at(x), strict=True)
    ]
    each = np.array(found).reshape(len(x), 4, len(modes), -1)
    return WeightChanges(*each.swapaxes(0, 1))


def _changes(model: Model, pose: LoadedPose, theta: Floats, modes: Sequence[int]) -> Floats:
    """Stress, sag and what mixing adds to them, (4, n_modes, n_axes), at one pose."""
    found = lowest_modes(model.pencil, theta, max(modes), NEIGHBOURS)
    lam, phi = found.lam[0], found.phi[0]
    weight = pose.weight()
    pull = np.hstack([weight, lam * np.asarray(pose.B @ phi)])
    n, axes = model.under_load.n_u, weight.shape[1]
    u = pose.displaced(weight)
    moved = np.hstack([u, pose.displaced(pull[:, axes:], phi[n:])])
    works = pose.stressed(pull, moved).works(np.hstack([u, phi]))
    stress = works[:axes, axes:, axes:]
    mixed = works[axes:, :axes, axes:].transpose(1, 0, 2)
    by_axis = np.array([stress, mixed + mixed.transpose(0, 2, 1)])  # (2, axes, r, r)
    own = by_axis.diagonal(axis1=2, axis2=3).swapaxes(1, 2) / lam[:, None]  # (2, r, axes)
    k = np.array(modes) - 1
    mixing = [[_mixing(C, lam, one, far) for one in k] for C, far in zip(by_axis, FAR, strict=True)]
    return np.concatenate([own[:, k], np.array(mixing)])


def _mixing(C: Floats, lam: Floats, k: int, far: float) -> Floats:
    """∂λ/λ that others less than ``far`` λ_k away can add to mode k at most."""
    apart = np.abs(lam - lam[k])
    others = (np.arange(len(lam)) != k) & (apart <= far * lam[k])
    apart, c = apart[others] / STANDARD_GRAVITY, np.abs(C[..., k, others])
    mixed = c * np.divide(c, np.maximum(c, apart), out=np.zeros_like(c), where=c > 0.0)
    return np.asarray(mixed.sum(axis=-1) / lam[k])


def sag_changes(
    model: Model, q: ArrayLike, y: ArrayLike, modes: Sequence[int], g: ArrayLike
) -> Floats | None:
    """By how much sag under g (n_axes,) changes frequencies, relative, (n_samples, n_modes).

    About: against the mechanism assembled as it is bent by u = (1 − K_T⁻¹ K_g) u₀. Infinite where
    that buckles. None where it is not known: of riders, imported parts, springs whose axes turn on
    the ground and redundant loops, and where other coordinates than before swing freely.
    """
    x, weight = model.x(q, y), model.pencil.weight
    if weight is None or not _bends_as_known(model):
        return None
    n, highest, theta = model.under_load.n_u, max(modes), model.pencil.theta(x)
    hz = standing_frequencies(model.refined(1.0).pencil, x, highest)
    bent, down = np.full(hz.shape, np.nan), np.asarray(g, dtype=np.float64)
    for k, pose in enumerate(model.under_load.at(x)):
        u = pose.displaced(pose.weight() @ down[:, None])[:, 0]
        if n:
            K_T, K_g = (
                model.pencil.sparse(each @ theta[:, k])[:n]
                for each in (model.pencil.stiffness, weight.stiffness)
            )
            u[:n] -= factorise(K_T[:, :n]).solve(K_g @ u)
        try:
            pencil = sagged(model.poses, model.meshes, pose, x[k], u)
        except MechanismError:
            return None
        if len(pencil.rigid) != model.n_rigid:
            return None
        bent[k] = standing_frequencies(pencil, x[k : k + 1], highest)[0]
    each = np.abs(bent / hz - 1.0)[:, np.array(modes) - 1]
    change = np.maximum(MARGIN * each, each + SHARED * each.max(axis=1, keepdims=True))
    return np.where(np.isfinite(change), change, np.inf)


def _bends_as_known(model: Model) -> bool:
    """True where beams and rigid links alone are joined by what `sagged` knows to turn."""
    case, tree = model.poses.case, model.motion.tree
    planar, mechanism = case.mechanism.space == "planar", case.mechanism
    return not (
        any(joint.type in RIDING for joint in mechanism.joints.values())
        or any(is_imported(case, name) for name in mechanism.links)
        or any(spring.between[1] == "ground" for spring in mechanism.springs.values())
        or (3 if planar else 6) * len(tree.loops) != len(tree.passive)
    )


def sag_of_nodes(
    model: Model, q: ArrayLike, y: ArrayLike, g: ArrayLike
) -> tuple[tuple[str, ...], Floats]:
    """Names link.node, and by how much the weight moves and turns them, (n_samples, n_nodes, 6).

    In ground axes, in m and rad, all coordinates held; ``g`` (n_axes,) in m/s² is the gravity.
    """
    x, weight = model.x(q, y), np.asarray(g, dtype=np.float64)[:, None]
    u = np.array([p.displaced(p.weight() @ weight) for p in model.under_load.at(x)])
    found = [one.nodes for one in shapes(model.poses, x, u)]
    named = [node for node in found[0] if not node[1].startswith("@")]
    moved = [[nodes[node].motion[0] for node in named] for nodes in found]
    return tuple(".".join(node) for node in named), np.array(moved)


def buckling(model: Model, q: ArrayLike, y: ArrayLike) -> Floats:
    """The stated weight over that at which the mechanism buckles, P/P_cr (n_samples,).

    1/κ of the least κ > 0 at which K_0 + κ K_g has no stiffness left, drives with their stiffness;
    0 where there is none, as without gravity. Coordinates that hang swing as they hang.
    """
    theta = model.pencil.theta(model.x(q, y))
    return np.array([buckling_share(model.pencil, each) for each in theta.T])


def strut_error(model: Model, q: ArrayLike, y: ArrayLike, modes: Sequence[int]) -> float | None:
    """By how much imported matrices, which are struts under weight, may put frequencies off, about.

    Relative, the largest of the ``modes`` at samples q, y, 1 where they may buckle; None where
    there are none, or they are not loaded.
    """
    x, bent = model.x(q, y), model.bent
    if bent is None:
        return None
    share = max(buckling_share(one, t) for one in (model.pencil, bent) for t in one.theta(x).T)
    if share < UNLOADED:
        return None
    hz = [standing_frequencies(one, x, max(modes)) for one in (model.pencil, bent)]
    off = STRUTS * np.abs(hz[1] / hz[0] - 1.0)[:, np.array(modes) - 1].max()
    return float(min(off, 1.0)) if np.isfinite(off) else 1.0


# Of the largest entry of a force: what is less is round-off of a motion that no free joint makes
STILL = 1e-9


@dataclass(frozen=True, eq=False)
class Flexibility:
    """lᵀ K⁻¹ r of pairs of forces, ``left`` and ``right`` (m,) among all; K that of a pencil."""

    pencil: Pencil
    forces: Forces
    left: Ints
    right: Ints
    held: bool = False  # brakes hold what is rigid in the pencil

    def at(self, x: Floats, wanted: Bools) -> tuple[Floats, Floats]:
        """The values (n, m) at samples x (n, n_x), and slopes (n, m, n_x) in those ``wanted``.

        Infinite where a free joint gives way. Raises MechanismError where K is not definite.
        """
        parts = (self._at(some, wanted) for some in solve_blocks(x, self.pencil.n_dof))
        values, slopes = map(np.concatenate, zip(*parts, strict=True))
        return values, slopes

    def _at(self, x: Floats, wanted: Bools) -> tuple[Floats, Floats]:
        pencil, theta = self.pencil, self.pencil.theta(x)
        along = np.flatnonzero(wanted & ~np.bool_(self.forces.is_fixed(wanted)))
        given = self.forces.at(x, along)
        f = np.zeros((len(x), pencil.n_dof, len(given)))
        for k, (places, (own, _)) in enumerate(zip(self.forces.unknowns, given, strict=True)):
            f[:, places, k] = own
        size = np.abs(f).max(axis=1, initial=0.0)
        loose = np.abs(f[:, pencil.rigid]).max(axis=1, initial=0.0) > STILL * size
        loose &= not self.held
        u = displaced(pencil, theta, f)
        left, right = u[..., self.left], u[..., self.right]
        values = np.einsum("nim,nim->nm", f[..., self.left], right)
        slopes = -works_changed(pencil, x, left, right, np.zeros(values.shape), wanted)
        for m, (j, k) in enumerate(zip(self.left, self.right, strict=True)):
            for force, moved in ((j, right), (k, left)):
                by_x = given[force][1]
                own = np.einsum("dnk,nk->nd", by_x, moved[:, self.forces.unknowns[force], m])
                slopes[:, m, along] += own
        values[loose[:, self.left] | loose[:, self.right]] = np.inf
        return values, slopes


def displaced(pencil: Pencil, theta: Floats, f: Floats) -> Floats:
    """u (n, n_dof, m) with K_E u_E = f_E at θ (n_theta, n) for f (n, n_dof, m), 0 where free."""
    if not pencil.is_dense:
        return solve_large_statics(pencil, theta, f)
    u, E = np.zeros(f.shape), pencil.elastic
    for part in chunks(np.arange(len(f)), pencil.n_dof**2):
        K = pencil.stiffness_matrices(theta[:, part])[:, E[:, None], E]
        try:
            if pencil.weight is not None:  # else K cannot be indefinite
                np.linalg.cholesky(K)
            u[np.ix_(part, E)] = np.linalg.solve(K, f[np.ix_(part, E)])
        except np.linalg.LinAlgError as error:
            raise MechanismError("mechanism", LIMP) from error
    return u


def compliances(
    model: Model, nodes: Mapping[str, Sequence[Sequence[float]]], finer: bool = False
) -> Flexibility:
    """The way of each node along each of its directions per force along it, m/N; drives hold.

    ``finer``: of a mesh of twice the elements.
    """
    model = model.refined() if finer else model
    found = forces(model.poses.case, model.poses.parameters, model.motion, nodes)
    each = np.arange(len(found.unknowns))
    return Flexibility(model.pencil, found, each, each)


def sags(model: Model, node: str, finer: bool = False) -> Flexibility:
    """The way of a node along each axis under the weight, m; all coordinates held, K without K_g.

    As `under_load.sag_of_nodes` has it: the pose that the trajectory asks for is where the drives
    hold the mechanism, the weight bends links and passive joints.
    """
    model = model.refined() if finer else model
    case, pencil = model.poses.case, model.pencil
    assert pencil.weight is not None
    axes = np.eye(2 if case.mechanism.space == "planar" else 3)
    found = forces(case, model.poses.parameters, model.motion, {node: axes.tolist()}, weight=True)
    held = replace(
        pencil,
        stiffness=pencil.weight.without,
        rigid=np.arange(pencil.n_u, pencil.n_dof),
        weight=None,
    )
    left = np.arange(len(axes))
    return Flexibility(held, found, left, np.full(len(axes), len(axes)), held=True)


Nodes = dict[int, tuple[Floats, Floats]]  # place (3,) and turn (3, 3) by a node's first slot


def sagged(
    frames: LinkFrames, meshes: Mapping[str, LinkMesh], pose: LoadedPose, x: Floats, u: Floats
) -> Pencil:
    """K and M of the mechanism bent by u (n_dof,), for the sample x (n_x,) of the ``pose`` alone.

    ``meshes`` are those of the links, of which beams are left whole. Raises MechanismError where
    loops do not close.
    """
    v, beams = np.asarray(pose.strained @ u), iter(pose.beams)
    moved, bent = dict[NodeName, Moved](), dict[str, tuple[Nodes, list[_Element]]]()
    parts = {name: mesh for name, mesh in meshes.items() if not mesh.whole.strands}
    for name, mesh in meshes.items():
        if name not in parts:
            pairs = [(strand, next(beams)) for strand in mesh.whole.strands]
            start = np.array(mesh.whole.strands[0].points[0], dtype=np.float64)
            before, after = (
                [e for strand, own in pairs for e in _elements(strand, own, way)]
                for way in (0.0 * v, v)
            )
            straight, nodes = _set(start, before), _set(start, after)
            bent[name] = nodes, after
            for key, slots in mesh.whole.nodes.items():
                (p, _), (q, R) = straight[int(slots[0])], nodes[int(slots[0])]
                moved[name, key] = Moved(q - p, R)
    case, numbers = frames.case, replace(frames.parameters, moved=moved)
    passive = frames.values(x, [np.array(frames.motion.passive, dtype=object)])[0][0].tolist()
    guess: dict[str, tuple[float, ...]] = {}
    for freedom, value in zip(frames.motion.tree.passive, passive, strict=True):
        guess[freedom.joint] = (*guess.get(freedom.joint, ()), value)
    at = FrozenDict(dict(zip(case.coordinates, x.tolist(), strict=False)))
    assembly = Assembly.model_construct(at=at, guess=FrozenDict(guess))
    update = {"assembly": assembly if guess else None}
    case = replace(case, mechanism=case.mechanism.model_copy(update=update))
    case = with_reduction(case, dict.fromkeys(bent))
    for name, (nodes, elements) in bent.items():
        number = {slot: k for k, slot in enumerate(nodes)}
        named = {key: number[int(s[0])] for key, s in meshes[name].whole.nodes.items()}
        rows = [e.between(nodes, number) for e in elements]
        places = np.array([p for p, _ in nodes.values()])
        parts[name] = bent_link(case, numbers, name, places, named, rows)
    motion = erls_motion(case, numbers)
    return build_pencil(case, numbers, motion, local_links(case, numbers, motion, parts))


class _Element(NamedTuple):
    """An element between nodes, in its axes (rows): from end to end, and how these are turned."""

    ends: tuple[int, int]
    axes: Floats
    step: Floats
    turn: Floats
    profile: Profile

    def between(self, nodes: Nodes, number: Mapping[int, int]) -> BentElement:
        """What it is where the nodes are now: along its chord, its y the mean of both ends'."""
        (p, R), (q, S) = (nodes[slot] for slot in self.ends)
        h = float(np.linalg.norm(q - p))
        along, y = (q - p) / h, (R + S) @ self.axes[1]
        y = y - (along @ y) * along
        y = y / np.linalg.norm(y)
        ends = number[self.ends[0]], number[self.ends[1]]
        return BentElement(ends, np.array([along, y, np.cross(along, y)]), h, self.profile)


def _elements(strand: Strand, own: Beams, v: Floats) -> Iterator[_Element]:
    """The elements of a strand with what the displacements v (n_whole,) do to each."""
    d = own.elements.seen(v[:, None])[..., 0]
    axes = np.array(strand.axes, dtype=np.float64)
    ends = pairwise(int(slots[0]) for slots in strand.slots)
    profiles = each_element(own.profile, len(d))
    for pair, h, each, profile in zip(ends, own.h, d, profiles, strict=True):
        step = h * X + each[6:9] - each[:3] - np.cross(each[3:6], h * X)
        turn = expm(np.cross(np.eye(3), each[9:] - each[3:6]))
        yield _Element(pair, axes, step, turn, profile)


def _set(start: Floats, elements: Sequence[_Element]) -> Nodes:
    """The nodes of elements set on one another, from the first one's start on."""
    found, waiting = {elements[0].ends[0]: (start, np.eye(3))}, list(elements)
    while waiting:
        e = waiting.pop(next(k for k, e in enumerate(waiting) if found.keys() & set(e.ends)))
        a, b = e.ends
        if b not in found:
            p, R = found[a]
            found[b] = p + R @ e.axes.T @ e.step, R @ e.axes.T @ e.turn @ e.axes
        elif a not in found:
            q, S = found[b]
            R = S @ e.axes.T @ e.turn.T @ e.axes
            found[a] = q - R @ e.axes.T @ e.step, R
    return found
