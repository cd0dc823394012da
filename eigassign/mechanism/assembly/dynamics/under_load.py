"""The stiffness under any loads, in numbers: K_g of `gravity` is linear in them, whatever they are.

A load is a pull a, an acceleration of every dof of every link, with the nodal forces f = m a: the
weight's is the same everywhere, that of a rigid motion −a(t), that of a mode λ B φ. Displacements v
that go with it give what the nodes of each element, spring and link receive,

    r = k v − f,

and the wrenches through joints are sums of these from the tips to the ground. With them K_g is that
of `gravity`: k_σ of the elements, of which everything is a number here, and the motions of second
order of joints, springs and bodies on arms, whose wrenches are variables of their own.

The work of second order of the inertia forces of a body is −½ θᵀ(D − tr D)θ, D = ∫ dF rᵀ about the
node that carries it, with its mass m, first moment m c and second moments E = ½ tr J − J:

    D = a (m c)ᵀ + [α]× E − [ω]×[ω]× E .
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.case.case_file import CaseFile
from eigassign.mechanism.assembly.affine_entries import AffineEntries
from eigassign.mechanism.assembly.build import local_links
from eigassign.mechanism.assembly.congruence import LocalLink, add_stressed
from eigassign.mechanism.assembly.dynamics.velocity_terms import (
    STEP,
    Matrix,
    Pattern,
    StackedElements,
    StackedLinks,
    Values,
    add_terms,
    pattern,
    stacked,
    whole_size,
)
from eigassign.mechanism.assembly.gravity.beam_stress import Numbers, end_forces, stress_terms
from eigassign.mechanism.assembly.gravity.curvature import add_bilinear
from eigassign.mechanism.assembly.gravity.imported import CROSSED, strut_terms
from eigassign.mechanism.assembly.gravity.statics import Statics, passive_rates
from eigassign.mechanism.assembly.gravity.weight import Weight
from eigassign.mechanism.assembly.inside_links import Alike
from eigassign.mechanism.assembly.node_motion import combined
from eigassign.mechanism.assembly.springs import SpringEnds, SpringMotion
from eigassign.mechanism.elements.beam import (
    Shear,
    element_mass,
    element_stiffness,
    fields,
    shear,
)
from eigassign.mechanism.elements.bodies import add_bodies
from eigassign.mechanism.elements.mesh import Entries, LinkMesh, Strand
from eigassign.mechanism.elements.profiles import SHARES, STATIONS
from eigassign.mechanism.elements.sparse_factor import factorise
from eigassign.mechanism.kinematics.forward import Kinematics
from eigassign.mechanism.kinematics.loop_closure import all_moving
from eigassign.mechanism.kinematics.parameters import (
    ModelParameters,
    is_imported,
    link_type,
    node_position,
)
from eigassign.mechanism.kinematics.rotations import DOFS, Objects, multiply, vector
from eigassign.mechanism.kinematics.topology import GROUND, NodeName, split
from eigassign.series.compiler import CompiledArrays, compile_arrays
from eigassign.series.expression import Expression, Recorder, Scalar

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


class Site(NamedTuple):
    """A node that carries bodies, or a rigid link: its link, and its dofs among those of all."""

    link: int
    slots: Ints  # (6,), −1 for what a plane has not
    rigid: bool


class Strut(NamedTuple):
    """A link that is known by its matrices alone: its nodes' dofs among those of all."""

    link: int
    slots: Ints  # (n_nodes, 6)
    mass: float  # of its own, kg; where ρ varies its volume


class End(NamedTuple):
    """A node where joints or springs act: its link (−1: the ground), and its dofs if it deforms."""

    link: int
    slots: Ints

    def same(self, other: End) -> bool:
        """True where both are one node that deforms."""
        shared = self.slots == other.slots
        return bool(self.link == other.link and shared.all() and (self.slots >= 0).any())


@dataclass(frozen=True, eq=False)
class Beams:
    """The elements of a strand, with their lengths and values."""

    elements: StackedElements
    alike: Alike

    def same(self, other: Beams) -> bool:
        """True where lengths and values are the same."""
        one, two = self.alike, other.alike
        return np.array_equal(one.h, two.h) and np.array_equal(one.values, two.values)

    @property
    def h(self) -> Numbers:
        """Lengths (n,) in m."""
        return self.alike.h

    @cached_property
    def bent(self) -> tuple[Shear, Shear]:
        """The numbers of shear in both planes."""
        return shear(self.alike.profile(), self.h)

    @cached_property
    def matrices(self) -> tuple[Floats, Floats]:
        """k and m (n, 12, 12); of numbers all is in one term."""
        profile = self.alike.profile()
        ((_, k),), ((_, m),) = element_stiffness(profile, self.h), element_mass(profile, self.h)
        return k, m

    @cached_property
    def carried(self) -> Floats:
        """The load per length by degree, of pulls on the dofs, (4, n, 3, 12).

        Between the ends a pull takes the shapes that mass has, cubic ones; degree 3 is the last
        for which N(ξ) is known. Five points integrate all that counts.
        """
        bent: Any = self.bent
        phi = np.array([[np.zeros_like(self.h) + v for v in each] for each in bent])
        xi = np.tile(0.5 * (1.0 + STATIONS), (len(self.h), 1))
        N = fields(xi, self.h[:, None], phi.transpose(2, 0, 1)[:, None])[..., :3, :]
        P = np.polynomial.legendre.legvander(STATIONS, 3)
        mass: Any = np.array([beam.mass for beam in self.alike.profile()[:3]])
        heavy = (mass.T @ P.T[: len(mass)])[..., None] * P * SHARES[:, None]
        return np.asarray(np.einsum("ngl,ngij->lnij", heavy * (np.arange(4) + 0.5), N))


@dataclass(frozen=True, eq=False)
class StiffnessUnderLoad:
    """K_g of a mechanism for any loads; built once, evaluated at samples."""

    parameters: ModelParameters
    n_u: int
    kept: tuple[int, ...]
    stack: StackedLinks
    stiffness: Pattern  # k (n_whole, n_whole)
    inner: Ints  # dofs inside reduced links
    springs: Pattern  # relative motion of their ends, (6 n_springs, n_dof)
    bodies: Pattern  # (6 n_sites, 6 n_sites)
    elements: Sequence[tuple[StackedElements, bool]]  # of each strand, and whether they shear
    sites: Sequence[Site]
    struts: Sequence[Strut]
    edges: Sequence[tuple[End, End]]  # base and follower of the tree's joints, then of loops
    n_elastic: int  # loops whose follower deforms
    ends: Sequence[tuple[End, End]]  # of springs
    beyond: Floats  # (n_links, n_links): 1 for the links that hang on a tree joint
    curved: Pattern  # of second order beside elements, (n_dof, n_dof)
    at_rest: CompiledArrays
    in_load: CompiledArrays  # coefficients of ``curved``, at z and the wrenches behind it

    def at(self, x: Floats) -> list[LoadedPose]:
        """The mechanism at samples x (n, n_x)."""
        z = self.parameters.z(np.atleast_2d(x))
        rows = zip(*self.at_rest(z), strict=True)
        poses: list[LoadedPose] = []
        for own, row in zip(z.T, rows, strict=True):
            beams = [
                Beams(elements, Alike(np.arange(len(h)), h, profile, sheared))
                for (elements, sheared), h, profile in zip(
                    self.elements, row[14::2], row[15::2], strict=True
                )
            ]
            if poses:  # most are the same in every pose
                known = zip(beams, poses[0].beams, strict=True)
                beams = [first if one.same(first) else one for one, first in known]
            poses.append(LoadedPose(self, own, list(row), beams))
        return poses

    def in_motion(
        self, q: Floats, y: Floats, rate: Floats, acceleration: Floats
    ) -> list[sparse.csr_array]:
        """K_g (n_dof, n_dof) of the loads −m a of the rigid motion, for q, q̇, q̈ (n, n_q).

        With the twists t of the links a = N ṫ + ω̃ N t, ṫ by central differences.
        """
        poses = self.at(np.hstack([q, np.tile(y, (len(q), 1))]))
        each = zip(poses, q, rate, acceleration, strict=True)
        return [self._moving(pose, own, v, a, y) for pose, own, v, a in each]

    def _moving(
        self, here: LoadedPose, q: Floats, rate: Floats, acceleration: Floats, y: Floats
    ) -> sparse.csr_array:
        h = STEP * self.stack.time_scale(here.stack, rate, acceleration)
        ends = self.at(
            np.array([np.append(q + t * (rate + 0.5 * t * acceleration), y) for t in (-h, h)])
        )
        n, kept = self.stack.rates.shape[1], list(self.kept)
        before, twists, after = (
            self.stack.twists(pose.stack, (rate + t * acceleration)[:n])
            for pose, t in zip((ends[0], here, ends[1]), (-h, 0.0, h), strict=True)
        )
        push, speed = (
            np.asarray(here.rigid @ each[:, kept].reshape(-1, 1))
            for each in ((after - before) * (0.5 / h), twists)
        )
        pull = -(push + self.stack.turned(here.stack, rate[:n], speed))
        spin = twists[:, 3:]
        return here.stressed(pull, here.displaced(pull, spin=spin), spin).matrices()[0]


@dataclass(frozen=True, eq=False)
class Stressed:
    """K_g for loads: k_σ (n_loads, n, 12, 12) of elements, and what is of second order."""

    B: Matrix
    elements: Sequence[tuple[StackedElements, Floats]]
    curved: Sequence[Matrix]

    def works(self, X: Floats) -> Floats:
        """Xᵀ K_g X (n_loads, n, n) for vectors X (n_dof, n)."""
        works = np.array([X.T @ (each @ X) for each in self.curved])
        for elements, k in self.elements:
            w = elements.seen(np.asarray(self.B @ X))
            works += np.tensordot(k @ w, w, ([1, 2], [0, 1]))
        return works

    def matrices(self) -> list[sparse.csr_array]:
        """K_g (n_dof, n_dof) for each load."""
        n, found = self.B.shape[0], []
        for load, curved in enumerate(self.curved):
            k = sum((e.assembled(k[load]) for e, k in self.elements), sparse.csr_array((n, n)))
            found.append(sparse.csr_array(self.B.T @ (k @ self.B) + curved))
        return found


@dataclass(frozen=True, eq=False)
class LoadedPose:
    """A mechanism at one sample: z, and the numbers of `StiffnessUnderLoad`."""

    model: StiffnessUnderLoad
    z: Floats
    values: Sequence[Floats]
    beams: Sequence[Beams]

    # --- numbers of the pose

    @cached_property
    def numbers(self) -> _Numbers:
        """What is not of the stack."""
        return _Numbers(*self.values[5:14])

    @property
    def stack(self) -> Values:
        """The numbers of `StackedLinks`."""
        return self.values[:5]

    @cached_property
    def B(self) -> Matrix:
        """The motion (n_whole, n_dof) of all dofs of all links."""
        return self.model.stack.motion(self.stack)

    @cached_property
    def mass(self) -> Matrix:
        """m (n_whole, n_whole)."""
        return self.model.stack.mass(self.stack)

    @cached_property
    def strained(self) -> Matrix:
        """The elastic part Ψ U of B."""
        links = self.model.stack
        U = links.joined.at(self.stack[0])
        return U if links.basis is None else links.basis @ U

    @cached_property
    def rigid(self) -> Matrix:
        """Ψ N: the motion of all dofs per twist of each link."""
        links = self.model.stack
        N = links.spread.at(self.stack[1])
        return N if links.basis is None else links.basis @ N

    @cached_property
    def stiffness(self) -> Matrix:
        """k (n_whole, n_whole)."""
        return self.model.stiffness.at(self.numbers.stiffness)

    @cached_property
    def springs(self) -> Matrix:
        """The motion of the second end of each spring against the first, (6 n_springs, n_dof)."""
        return self.model.springs.at(self.numbers.springs)

    @cached_property
    def held_stiffness(self) -> sparse.csc_array:
        """K (n_u, n_dof) of the rows whose coordinates are held, without any load."""
        n, S = self.model.n_u, sparse.csr_array(self.springs)
        Q = sparse.csr_array(self.strained)
        weighted = sparse.diags_array(self.numbers.spring_stiffness.ravel()) @ S
        whole = Q.T @ (sparse.csr_array(self.stiffness) @ Q) + S.T @ weighted
        return sparse.csc_array(sparse.csc_array(whole)[:n])

    def frame(self, link: int) -> tuple[Floats, Floats]:
        """Rotation and origin of a link in the world, −1 the ground's."""
        now = self.numbers
        return (np.eye(3), np.zeros(3)) if link < 0 else (now.rotations[link], now.origins[link])

    # --- loads

    def weight(self) -> Floats:
        """The pull (n_whole, n_axes) of 1 m/s² along each axis of the ground."""
        kept = self.model.kept
        axes = sum(d < 3 for d in kept)
        R = self.numbers.rotations
        a = np.zeros((len(R), 6, axes))
        a[:, :3] = R.transpose(0, 2, 1)[:, :, :axes]
        return np.asarray(self.rigid @ a[:, list(kept)].reshape(-1, axes))

    def displaced(
        self, pull: Floats, moved: Floats | None = None, spin: Floats | None = None
    ) -> Floats:
        """Displacements [u; q] (n_dof, n_loads) under a pull, the coordinates held at ``moved``."""
        n, K = self.model.n_u, self.held_stiffness
        x = np.zeros((self.B.shape[1], pull.shape[1]))
        x[n:] = 0.0 if moved is None else moved
        f = (self.B.T @ _Acting(self, pull, x, spin).forces)[:n] - K[:, n:] @ x[n:]
        if n:
            x[:n] = factorise(sparse.csc_array(K[:, :n])).solve(np.ascontiguousarray(f))
        return x

    def stressed(self, pull: Floats, x: Floats, spin: Floats | None = None) -> Stressed:
        """K_g for a ``pull`` (n_whole, n_loads) with the displacements x (n_dof, n_loads) under it.

        ``spin`` (n_links, 3) is ω of each link where the pull is that of a motion.
        """
        acting = _Acting(self, pull, x, spin)
        model = self.model
        z = np.vstack([np.tile(self.z[:, None], pull.shape[1]), acting.inputs()])
        curved = [model.curved.at(c) for c in model.in_load(z)[0]]
        return Stressed(self.B, acting.elements(), curved)


class _Numbers(NamedTuple):
    """The numbers of a pose behind those of its stack."""

    stiffness: Floats
    springs: Floats
    bodies: Floats
    spring_stiffness: Floats  # (n_springs, 6)
    spring_frames: Floats  # (n_springs, 3, 4): rotation, and the place in the world
    rotations: Floats  # (n_links, 3, 3)
    origins: Floats  # (n_links, 3)
    places: Floats  # (n_ends, 3) of the ends of joints, then of springs, in their links
    gaps: Floats  # (n_rows, n_passive), twists of links (6 n_links, n_passive) below


@dataclass(frozen=True, eq=False)
class _Acting:
    """What acts where under loads, given by their ``pull`` and displacements x."""

    pose: LoadedPose
    pull: Floats
    x: Floats
    spin: Floats | None

    @cached_property
    def on_sites(self) -> list[tuple[Floats, Floats]]:
        """Of the bodies of each site the wrenches (6, n_loads) about its node, and D."""
        found, masses = [], _dense(self.pose.model.bodies.at(self.pose.numbers.bodies))
        for k, site in enumerate(self.pose.model.sites):
            m = masses[6 * k : 6 * k + 6, 6 * k : 6 * k + 6]
            first, J = np.array([m[1, 5], -m[0, 5], m[0, 4]]), m[3:, 3:]
            pull = _picked(self.pull, site.slots)
            wrench, turned = m @ pull, _crossed(pull[3:].T)
            if self.spin is not None:
                w = _crossed(self.spin[site.link])
                wrench[:3, 0] -= w @ w @ first
                wrench[3:, 0] -= w @ J @ self.spin[site.link]
                turned = turned - w @ w
            E = 0.5 * np.trace(J) * np.eye(3) - J
            found.append((wrench, np.einsum("il,j->lij", pull[:3], first) + turned @ E))
        return found

    @cached_property
    def forces(self) -> Floats:
        """f (n_whole, n_loads): m a, and what the spin adds of bodies on arms."""
        f, model = np.asarray(self.pose.mass @ self.pull), self.pose.model
        if self.spin is not None:
            still = replace(self, spin=None).on_sites
            for site, (wrench, _), (part, _) in zip(model.sites, self.on_sites, still, strict=True):
                there = site.slots >= 0
                f[site.slots[there]] += (wrench - part)[there]
        return f

    @cached_property
    def v(self) -> Floats:
        """Elastic displacements (n_whole, n_loads), those inside reduced links as in statics."""
        v, k = np.asarray(self.pose.strained @ self.x), self.pose.stiffness
        inner = self.pose.model.inner
        if len(inner):
            left = (self.forces - k @ v)[inner]
            v[inner] += factorise(sparse.csc_array(k)[inner][:, inner]).solve(left)
        return v

    @cached_property
    def received(self) -> Floats:
        """r = k v − f (n_whole, n_loads): what nodes receive from joints and springs."""
        return np.asarray(self.pose.stiffness @ self.v - self.forces)

    @cached_property
    def own(self) -> Floats:
        """The wrenches (n_links, 6, n_loads) of each link's loads about its origin, in its axes."""
        model = self.pose.model
        found = np.asarray(self.pose.rigid.T @ self.forces)
        out = np.zeros((len(self.pose.numbers.rotations), 6, found.shape[1]))
        out[:, list(model.kept)] = found.reshape(len(out), len(model.kept), -1)
        return out

    @cached_property
    def in_springs(self) -> Floats:
        """The wrenches (n_springs, 6, n_loads) on their first ends, in their axes."""
        k, moved = self.pose.numbers.spring_stiffness, np.asarray(self.pose.springs @ self.x)
        return np.asarray(k[..., None] * moved.reshape(*k.shape, self.x.shape[1]))

    @cached_property
    def through(self) -> tuple[Floats, Floats]:
        """What followers put on their bases, (n_edges, 6, n_loads) in the axes of these and about
        the nodes there; and Σ F rᵀ (n_links, n_loads, 3, 3) of what acts on each link's nodes.
        """
        model, now = self.pose.model, self.pose.numbers
        n_tree, n_loads = len(now.rotations), self.x.shape[1]
        flat = [end for pair in (*model.edges, *model.ends) for end in pair]
        placed = list(zip(flat, now.places, strict=True))
        ends = list(zip(placed[::2], placed[1::2], strict=True))
        joints, springs = ends[: len(model.edges)], ends[len(model.edges) :]
        total = np.zeros((n_tree + 1, 6, n_loads))  # in the world, about its origin
        for link, wrench in enumerate(self.own):
            total[link] = self._in_world(link, np.zeros(3), wrench)
        moments = np.zeros((n_tree + 1, n_loads, 3, 3))

        def act(on: tuple[End, Floats], wrench: Floats) -> Floats:
            total[on[0].link] += wrench
            own = self._in_link(on[0].link, on[1], wrench)
            moments[on[0].link] += np.einsum("il,j->lij", own[:3], on[1])
            return own

        pulled = []
        for (start, end), R, force in zip(springs, now.spring_frames, self.in_springs, strict=True):
            turned = np.concatenate([R[:, :3] @ force[:3], R[:, :3] @ force[3:]])
            wrench = _about_origin(turned, R[:, 3])
            pulled += [(start[0], wrench), (end[0], -wrench)]
            act(start, wrench)
            act(end, -wrench)
        through = [np.zeros((6, n_loads))] * n_tree
        loops = joints[n_tree : n_tree + model.n_elastic]
        for (base, follower), wrench in zip(loops, self._closing(total, pulled), strict=True):
            act(follower, wrench)
            through.append(act(base, -wrench))
        rest, kept = joints[n_tree + model.n_elastic :], list(model.kept)
        if rest:
            twists = now.gaps[len(kept) * len(rest) :].reshape(n_tree, 6, -1)
            gaps = now.gaps[: len(kept) * len(rest)]
            local = [self._in_link(k, np.zeros(3), total[k]) for k in range(n_tree)]
            G = np.einsum("kip,kil->pl", twists, np.array(local))
            found = np.linalg.lstsq(gaps.T, -G, rcond=None)[0].reshape(len(rest), len(kept), -1)
            for (base, follower), part in zip(rest, found, strict=True):
                wrench = np.zeros((6, n_loads))
                wrench[kept] = part
                wrench = self._in_world(follower[0].link, follower[1], wrench)
                act(follower, wrench)
                through.append(act(base, -wrench))
        hung = np.einsum("ek,kil->eil", model.beyond, total[:-1])
        for k, (base, follower) in enumerate(joints[:n_tree]):
            through[k] = act(base, hung[k])
            act(follower, -hung[k])
        return np.array(through), moments[:-1]

    def _closing(self, total: Floats, pulled: Sequence[tuple[End, Floats]]) -> Floats:
        """The wrenches (n_elastic, 6, n_loads) on followers of the loops that close at nodes that
        deform, in the world: all that acts on such a node adds up to what it receives.

        Beside ``total``, that of each link and its springs, and what these have ``pulled``.
        """
        model, n_loads = self.pose.model, self.x.shape[1]
        n_tree = len(model.beyond)
        tree, loops = model.edges[:n_tree], model.edges[n_tree:][: model.n_elastic]
        on_links = np.zeros((len(total), len(loops)))
        for k, (base, follower) in enumerate(loops):
            on_links[follower.link, k] += 1.0
            on_links[base.link, k] -= 1.0
        A, b = [np.zeros((0, len(loops)))], [np.zeros((0, 6 * n_loads))]
        places = self.pose.numbers.places[2 * n_tree :]
        nodes = zip([end for pair in loops for end in pair], places, strict=False)
        for node, place in nodes:
            if not node.same(node):
                continue
            hung = np.array([node.same(base) - node.same(own) for base, own in tree])
            closed = np.array([node.same(own) - node.same(base) for base, own in loops])
            here = self._in_world(node.link, place, _picked(self.received, node.slots))
            here = here - np.einsum("e,ek,kil->il", hung, model.beyond, total[:-1])
            here = here - sum(wrench * node.same(end) for end, wrench in pulled)
            A.append((closed + hung @ model.beyond @ on_links[:-1])[None])
            b.append(here.reshape(1, -1))
        found = np.linalg.lstsq(np.concatenate(A), np.concatenate(b), rcond=None)[0]
        return np.asarray(found.reshape(len(loops), 6, n_loads))

    def _in_world(self, link: int, place: Floats, wrench: Floats) -> Floats:
        """A wrench (6, n_loads) about a place of a link, about the world's origin."""
        R, o = self.pose.frame(link)
        turned = np.concatenate([R @ wrench[:3], R @ wrench[3:]])
        return _about_origin(turned, o + R @ place)

    def _in_link(self, link: int, place: Floats, wrench: Floats) -> Floats:
        """The opposite."""
        R, o = self.pose.frame(link)
        there = _about_origin(wrench, -(o + R @ place))
        return np.concatenate([R.T @ there[:3], R.T @ there[3:]])

    def inputs(self) -> Floats:
        """The variables behind z, (n, n_loads)."""
        model, (through, moments) = self.pose.model, self.through
        n_loads = self.x.shape[1]
        parts = [through, self.in_springs]
        for site, (_, D) in zip(model.sites, self.on_sites, strict=True):
            D = D + moments[site.link] if site.rigid else D
            trace = np.trace(D, axis1=1, axis2=2)[:, None, None] * np.eye(3)
            parts.append(0.5 * (trace - D).reshape(n_loads, 9).T)
        for strut in model.struts:
            here = [_picked(self.received, slots) for slots in strut.slots]
            left = self.own[strut.link][:3]
            for site, (wrench, _) in zip(model.sites, self.on_sites, strict=True):
                for k, slots in enumerate(strut.slots):
                    if np.array_equal(site.slots, slots):
                        here[k], left = here[k] + wrench, left - wrench[:3]
            parts += [*here, left / strut.mass if strut.mass > 0.0 else 0.0 * left]
        return np.concatenate([part.reshape(part.size // n_loads, n_loads) for part in parts])

    def elements(self) -> list[tuple[StackedElements, Floats]]:
        """k_σ (n_loads, n, 12, 12) of the elements of each strand."""
        planar, found = len(self.pose.model.kept) == 3, []
        for one in self.pose.beams:
            v, pull = (one.elements.seen(each) for each in (self.v, self.pull))
            k, m = one.matrices
            r = (k @ v - m @ pull).transpose(1, 2, 0)
            forces = end_forces(r, (one.carried @ pull).transpose(0, 2, 3, 1), one.h)
            c, matrices = zip(*stress_terms(forces, one.h, one.bent, planar), strict=True)
            found.append((one.elements, np.tensordot(np.array(c), np.array(matrices), (0, 0))))
        return found


def _dense(A: Matrix) -> Floats:
    return A if isinstance(A, np.ndarray) else A.toarray()


def _picked(values: Floats, slots: Ints) -> Floats:
    """Rows of values (n, n_loads) at slots (6,), zero where there is none."""
    return np.where((slots >= 0)[:, None], values[slots], 0.0)


def _crossed(a: Floats) -> Floats:
    """[a]× (…, 3, 3) of vectors (…, 3)."""
    return np.asarray(np.einsum("...i,kij->...kj", a, CROSSED))


def _about_origin(wrench: Floats, place: Floats) -> Floats:
    """A wrench (6, n_loads) at a place, in the same axes about the origin: M + X × F."""
    return np.concatenate([wrench[:3], wrench[3:] + _crossed(place) @ wrench[:3]])


# --- built once


def stiffness_under_load(
    case: CaseFile, parameters: ModelParameters, motion: Kinematics
) -> StiffnessUnderLoad:
    """Collect what K_g hangs on for any loads, the wrenches as variables behind z."""
    links, nodes = local_links(case, parameters, motion)
    known = parameters.with_passive(motion.passive)
    names = [p.link for p in motion.placements]
    tree, kept = motion.tree, DOFS[nodes.space]
    stack, _ = stacked(
        list(zip(names, links, strict=True)), nodes, all_moving(case, parameters, motion), motion
    )
    sizes = [whole_size(link) for link in links]
    first = dict(zip(names, np.cumsum([0, *sizes[:-1]]).tolist(), strict=True))
    meshes = {n: m if m.reduction is None else m.reduction.mesh for n, m in nodes.meshes.items()}

    def slots(node: NodeName) -> Ints:
        own = meshes[node[0]].nodes if node != GROUND else {}
        found = own.get("@origin", own.get(node[1]))
        return np.full(6, -1) if found is None else np.where(found >= 0, found + first[node[0]], -1)

    def place(node: NodeName) -> Objects:
        return vector([0.0]) if node == GROUND else node_position(case, known, tree, node)

    def end(node: NodeName) -> End:
        if node == GROUND:
            return End(-1, slots(node))
        deforms = "@origin" not in meshes[node[0]].nodes
        return End(names.index(node[0]), slots(node if deforms else GROUND))

    edges = [*tree.edges, *tree.loops]
    springs = list(SpringEnds(case, known, motion, nodes.rows, nodes.count).each())
    ends = [(one.base, one.follower) for one in edges] + [(one.start, one.end) for one in springs]
    inputs = _Inputs(parameters, kept)
    through = {edge.joint: inputs.wrench() for edge in edges}
    forced = [(spring, inputs.wrench()) for spring in springs]
    K, local = AffineEntries(summed=True), dict(zip(names, links, strict=True))
    weight = Weight(K, case, known, motion, local, nodes, Statics({}, {}, through, forced))
    for edge in edges:
        weight.add_joint(edge)
    weight.add_springs()
    sites, bodies = _sites(case, known, names, local, meshes)
    for link, node in sites:
        turn = weight.rows((link, node))[3:]
        add_bilinear(K, inputs.block(), turn, turn)
    struts = []
    for name in names:
        if is_imported(case, name):
            mesh = nodes.meshes[name]
            wrenches = [(node, inputs.wrench()) for node in mesh.nodes]
            terms = strut_terms(mesh, wrenches, inputs.wrench(3), nodes.space)
            add_stressed(K, local[name], terms, nodes.count)
            at = np.array([slots((name, node)) for node in mesh.nodes])
            struts.append(Strut(names.index(name), at, _own_mass(meshes[name])))
    curved = _collected(K, nodes.count, parameters.recorder, stack.joined.shape[1])
    strands = [
        (StackedElements.of(strand, first[n], sum(sizes)), strand)
        for n in names
        for strand in meshes[n].strands
    ]
    stiffness = Entries(stack.masses.shape)
    relative = Entries((6 * len(springs), curved.shape[0]))
    for name in names:
        add_terms(stiffness, meshes[name].stiffness, first[name], first[name])
    rigid = {nodes.count + k for k in motion.rigid}
    for k, spring in enumerate(springs):
        for row, (here, there) in enumerate(zip(spring.here, spring.there, strict=True), 6 * k):
            apart = {i: c for i, c in combined(there, here, -1.0).items() if i not in rigid}
            own = np.array(list(apart), dtype=np.intp)
            relative.add_scalars(list(apart.values()), np.full(len(own), row), own)
    patterns = (pattern(stiffness), pattern(relative), pattern(bodies))
    arrays = [*stack.scalars, *(np.array(each.coefficients, dtype=object) for each in patterns)]
    arrays += [
        np.array([spring.stiffness for spring in springs], dtype=object).reshape(-1, 6),
        np.array([_frame(motion, case, known, spring) for spring in springs]).reshape(-1, 3, 4),
        np.array([p.world_rotation for p in motion.placements]),
        np.array([p.world_origin for p in motion.placements]),
        np.array([place(node) for pair in ends for node in pair]),
        _rigid_loops(case, known, motion),
    ]
    for _, strand in strands:
        arrays += list(_element_scalars(strand))
    inner = [
        first[n] + link.reduction.interior
        for n, link in local.items()
        if link.reduction is not None
    ]
    return StiffnessUnderLoad(
        parameters=parameters,
        n_u=nodes.count,
        kept=kept,
        stack=stack,
        stiffness=patterns[0],
        inner=np.concatenate([np.zeros(0, dtype=np.intp), *inner]),
        springs=patterns[1],
        bodies=patterns[2],
        elements=[(each, strand.profiles[0][0].shear_z is not None) for each, strand in strands],
        sites=[
            Site(names.index(n), slots((n, node)), link_type(case, n) == "rigid")
            for n, node in sites
        ],
        struts=struts,
        edges=[(end(edge.base), end(edge.follower)) for edge in edges],
        n_elastic=tree.n_elastic,
        ends=[(end(spring.start), end(spring.end)) for spring in springs],
        beyond=_beyond(motion, names),
        curved=curved,
        at_rest=parameters.compiled(*arrays),
        in_load=compile_arrays(
            parameters.recorder,
            [np.array(curved.coefficients, dtype=object)],
            parameters.count + inputs.count,
        ),
    )


@dataclass
class _Inputs:
    """Variables behind z: the loads that everything is linear in."""

    parameters: ModelParameters
    kept: Sequence[int]
    count: int = 0

    def wrench(self, size: int = 6) -> Objects:
        """Variables for a force and moment, zeros for what a plane has not."""
        first, self.count = self.parameters.count + self.count, self.count + size
        variable = self.parameters.recorder.variable
        found = [variable(first + d) if d in self.kept else 0.0 for d in range(size)]
        return np.array(found, dtype=object)

    def block(self) -> Objects:
        """Variables (3, 3), of which those count that turn with something."""
        first, self.count = self.parameters.count + self.count, self.count + 9
        found = [self.parameters.recorder.variable(first + d) for d in range(9)]
        return np.array(found, dtype=object).reshape(3, 3)


def _sites(
    case: CaseFile,
    known: ModelParameters,
    names: Sequence[str],
    local: Mapping[str, LocalLink],
    meshes: Mapping[str, LinkMesh],
) -> tuple[list[NodeName], Entries]:
    """The nodes that carry bodies and the origins of rigid links, with their masses (6 n, 6 n)."""
    found: list[NodeName] = []
    for name in names:
        at = [split(body.at) for body in case.mechanism.bodies.values()]
        rigid = "@origin" in meshes[name].nodes
        found += [(name, "@origin")] if rigid else dict.fromkeys(n for n in at if n[0] == name)
    masses = Entries((6 * len(found), 6 * len(found)))
    for name in names:
        own = {node: 6 * k + np.arange(6) for k, (link, node) in enumerate(found) if link == name}
        if "@origin" not in own:
            add_bodies(case, known, name, masses, own)
        for c, m in local[name].mass if "@origin" in own else ():
            A, kept = m.tocoo(), own["@origin"][list(DOFS[case.mechanism.space])]
            masses.add(c, kept[A.row], kept[A.col], A.data)
    return found, masses


def _own_mass(mesh: LinkMesh) -> float:
    """Mass of a part that is known by its matrices, without bodies; where ρ varies its volume."""
    along = np.sum([t.matrix.toarray()[:, 0] for t in mesh.rigid], axis=0)
    return float(along @ (mesh.mass[0].matrix @ along))


def _collected(K: AffineEntries, n_u: int, recorder: Recorder, n_dof: int) -> Pattern:
    """The entries of an affine matrix as a pattern."""
    rows, columns, atoms, factors = K.finish(n_u)
    order, out = np.argsort(atoms, kind="stable"), Entries((n_dof, n_dof))
    cuts = np.flatnonzero(np.diff(atoms[order])) + 1
    for own in np.split(order, cuts) if len(order) else ():
        atom = int(atoms[own[0]])
        scalar: Scalar = Expression(recorder, 0.0, {atom: 1.0}) if atom >= 0 else 1.0
        out.add(scalar, rows[own], columns[own], factors[own])
    return pattern(out)


def _frame(
    motion: Kinematics, case: CaseFile, known: ModelParameters, spring: SpringMotion
) -> Objects:
    """Rotation and, beside it, the place in the world of a spring."""
    X = node_position(case, known, motion.tree, spring.start)
    place = motion.placement(spring.start[0]).at(X)[1] + spring.arm
    return np.concatenate([spring.rotation, place[:, None]], axis=1)


def _beyond(motion: Kinematics, names: Sequence[str]) -> Floats:
    """(n_links, n_links): 1 for the links that the joint of each link carries."""
    out = np.eye(len(names))
    for k in range(len(names) - 1, -1, -1):
        base = motion.placements[k].base
        if base is not None:
            out[names.index(base.link)] += out[k]
    return out


def _rigid_loops(case: CaseFile, known: ModelParameters, motion: Kinematics) -> Objects:
    """Rates per passive freedom: gaps of loops between rigid links, then twists of all links."""
    rest = motion.tree.loops[motion.tree.n_elastic :]
    if not rest:
        return np.zeros((0, 0), dtype=object)
    found, kept = passive_rates(case, known, motion), list(DOFS[case.mechanism.space])
    gaps = [loop.twist_gap[kept] for loop in found.loops if loop.edge in rest]
    return np.concatenate([*gaps, *(p.twist for p in found.placements)])


def _element_scalars(strand: Strand) -> tuple[Objects, Objects]:
    """Lengths (n,) and values (n, n_legendre, 9) of the elements of a strand."""
    assert strand.axes is not None
    along = [b - a for a, b in itertools.pairwise(strand.points)]
    h = [multiply(np.asarray(strand.axes[:1]), each)[0] for each in along]
    values = [[[0.0 if v is None else v for v in b] for b in each] for each in strand.profiles]
    return np.array(h, dtype=object), np.array(values, dtype=object)
