"""The stiffness under any loads, in numbers: K_g of `loads` is linear in them, whatever they are.

A load is a pull a, an acceleration of every dof of every link, with the nodal forces f = m a: the
weight's is the same everywhere, that of a rigid motion −a(t), that of a mode λ B φ. Displacements v
that go with it give what the nodes of each element, spring and link receive,

    r = k v − f .

k_σ of the elements follows from r, everything of it a number here. The rest of K_g is the program
of `second_order` and its statics, whose loads are variables behind z.

The inertia forces of the bodies at a node have the arms D = ∫ dF rᵀ about it, with the mass m,
first moment m c and second moments E = ½ tr J − J:

    D = a (m c)ᵀ + [α]× E − [ω]×[ω]× E .
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from eigassign.arrays import Floats, Ints
from eigassign.case.case_file import CaseFile
from eigassign.mechanism.assembly.build import by_name, local_links
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
from eigassign.mechanism.assembly.loads.second_order import (
    CROSSED,
    Numbers,
    add_second_order,
    stress_terms,
)
from eigassign.mechanism.assembly.loads.statics import Loaded, Loads, first_moment
from eigassign.mechanism.assembly.node_motion import combined
from eigassign.mechanism.assembly.pencil import AffineEntries
from eigassign.mechanism.elements.beam import Shear, element_mass, element_stiffness, fields, shear
from eigassign.mechanism.elements.craig_bampton import factorise
from eigassign.mechanism.elements.links import Entries, Strand
from eigassign.mechanism.elements.sections import SHARES, STATIONS, BeamValues, Profile
from eigassign.mechanism.kinematics.forward import Kinematics
from eigassign.mechanism.kinematics.joints import DOFS, Objects, present
from eigassign.mechanism.kinematics.loop_closure import all_moving
from eigassign.mechanism.kinematics.parameters import ModelParameters
from eigassign.mechanism.kinematics.topology import NodeName
from eigassign.series.compiler import CompiledArrays, compile_arrays
from eigassign.series.expression import Recorder


@dataclass(frozen=True, eq=False)
class Beams:
    """The elements of a strand, with their lengths and values, all sheared or none."""

    elements: StackedElements
    h: Numbers  # lengths (n,) in m
    values: Floats  # (n, n_legendre, n_values)
    sheared: bool

    def same(self, other: Beams) -> bool:
        """True where lengths and values are the same."""
        return np.array_equal(self.h, other.h) and np.array_equal(self.values, other.values)

    @cached_property
    def profile(self) -> Profile:
        """The values as arrays (n,)."""
        rows = [BeamValues(*one) for one in np.moveaxis(self.values, 0, -1)]
        return rows if self.sheared else [r._replace(shear_z=None, shear_y=None) for r in rows]

    @cached_property
    def bent(self) -> tuple[Shear, Shear]:
        """The numbers of shear in both planes."""
        return shear(self.profile, self.h)

    @cached_property
    def matrices(self) -> tuple[Floats, Floats]:
        """k and m (n, 12, 12); of numbers all is in one term."""
        each = element_stiffness(self.profile, self.h), element_mass(self.profile, self.h)
        ((_, k),), ((_, m),) = each
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
        mass: Any = np.array([beam.mass for beam in self.profile[:3]])
        heavy = (mass.T @ P.T[: len(mass)])[..., None] * P * SHARES[:, None]
        return np.asarray(np.einsum("ngl,ngij->lnij", heavy * (np.arange(4) + 0.5), N))


@dataclass(frozen=True, eq=False)
class StiffnessUnderLoad:
    """K_g of a mechanism for any loads; built once, evaluated at samples."""

    parameters: ModelParameters
    n_u: int
    kept: tuple[int, ...]
    names: tuple[str, ...]  # of the links
    stack: StackedLinks
    stiffness: Pattern  # k (n_whole, n_whole)
    springs: Pattern  # relative motion of their ends, (6 n_springs, n_dof)
    inner: Ints  # dofs inside reduced links
    slots: Mapping[NodeName, Ints]  # the dofs (6,) of nodes among all, −1 where there is none
    sites: Sequence[NodeName]  # see `Loaded`
    solids: Sequence[str]  # the links that are known by their meshes
    strands: Sequence[tuple[StackedElements, bool]]  # and whether they shear
    told: Sequence[NodeName]  # see `LoopsAtNodes`
    counted: Ints  # of all numbers in `Loads` those that are variables
    curved: Pattern  # K_g but for beams, (n_dof, n_dof)
    at_rest: CompiledArrays  # the numbers of `_Numbers`
    in_load: CompiledArrays  # coefficients of ``curved``, at z and the loads behind it

    def at(self, x: Floats) -> list[LoadedPose]:
        """The mechanism at samples x (n, n_x)."""
        z = self.parameters.z(np.atleast_2d(x))
        poses: list[LoadedPose] = []
        for own, row in zip(z.T, zip(*self.at_rest(z), strict=True), strict=True):
            now = _Numbers._make((row[:5], *row[5:11], row[11:]))
            beams = [
                Beams(elements, h, profile, sheared)
                for (elements, sheared), h, profile in zip(
                    self.strands, now.elements[::2], now.elements[1::2], strict=True
                )
            ]
            if poses:  # most are the same in every pose
                known = zip(beams, poses[0].beams, strict=True)
                beams = [first if one.same(first) else one for one, first in known]
            poses.append(LoadedPose(self, own, now, beams))
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


class _Numbers(NamedTuple):
    """The numbers of a pose."""

    stack: Values  # of `StackedLinks`
    stiffness: Floats
    springs: Floats
    sites: Floats  # (n_sites, 6, 6)
    spring_stiffness: Floats  # (n_springs, 6)
    rotations: Floats  # (n_links, 3, 3)
    densities: Floats  # of solids, kg/m³
    elements: Values  # of each strand lengths, and values


@dataclass(frozen=True, eq=False)
class LoadedPose:
    """A mechanism at one sample: z, and the numbers of `StiffnessUnderLoad`."""

    model: StiffnessUnderLoad
    z: Floats
    numbers: _Numbers
    beams: Sequence[Beams]

    @property
    def stack(self) -> Values:
        """The numbers of `StackedLinks`."""
        return self.numbers.stack

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
        return self._whole(self.model.stack.joined.at(self.stack[0]))

    @cached_property
    def rigid(self) -> Matrix:
        """Ψ N: the motion of all dofs per twist of each link."""
        return self._whole(self.model.stack.spread.at(self.stack[1]))

    def _whole(self, motion: Matrix) -> Matrix:
        basis = self.model.stack.basis
        return motion if basis is None else basis @ motion

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
        acting, model, n = _Acting(self, pull, x, spin), self.model, pull.shape[1]
        loads = np.concatenate([each.reshape(-1, n) for each in acting.loads.each])
        z = np.vstack([np.tile(self.z[:, None], n), loads[model.counted]])
        curved = [model.curved.at(c) for c in model.in_load(z)[0]]
        return Stressed(self.B, acting.elements(), curved)


@dataclass(frozen=True, eq=False)
class _Acting:
    """What acts where under loads, given by their ``pull`` and displacements x."""

    pose: LoadedPose
    pull: Floats
    x: Floats
    spin: Floats | None

    @cached_property
    def forces(self) -> Floats:
        """f (n_whole, n_loads): m a, and what the spin adds of bodies on arms."""
        f, model = np.asarray(self.pose.mass @ self.pull), self.pose.model
        for node, m in zip(model.sites, self.pose.numbers.sites, strict=True):
            there = model.slots[node] >= 0
            f[model.slots[node][there]] += self._turning(node, m)[there, None]
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
    def own(self) -> Floats:
        """The wrenches (n_links, 6, n_loads) of each link's loads about its origin, in its axes."""
        model, found = self.pose.model, np.asarray(self.pose.rigid.T @ self.forces)
        out = np.zeros((len(model.names), 6, found.shape[1]))
        out[:, list(model.kept)] = found.reshape(len(out), len(model.kept), -1)
        return out

    @cached_property
    def carried(self) -> dict[NodeName, tuple[Floats, Floats]]:
        """Of each site its wrench (6, n_loads) and D (3, 3, n_loads)."""
        found, model = {}, self.pose.model
        for node, m in zip(model.sites, self.pose.numbers.sites, strict=True):
            a = _picked(self.pull, model.slots[node])
            turned = _crossed(a[3:].T)
            if self.spin is not None:
                w = _crossed(self._spin(node))
                turned = turned - w @ w
            E = 0.5 * np.trace(m[3:, 3:]) * np.eye(3) - m[3:, 3:]
            D = np.einsum("il,j->ijl", a[:3], first_moment(m)) + (turned @ E).transpose(1, 2, 0)
            found[node] = m @ a + self._turning(node, m)[:, None], D
        return found

    def _turning(self, node: NodeName, m: Floats) -> Floats:
        """The wrench (6,) of a site that only turns: −ω × (ω × m c) and −ω × J ω."""
        if self.spin is None:
            return np.zeros(6)
        w = self._spin(node)
        pull = np.cross(w, np.cross(w, first_moment(m)))
        return -np.concatenate([pull, np.cross(w, m[3:, 3:] @ w)])

    def _spin(self, node: NodeName) -> Floats:
        assert self.spin is not None
        return np.asarray(self.spin[self.pose.model.names.index(node[0])])

    @property
    def loads(self) -> Loads:
        """What acts, an axis of the loads behind."""
        model, now = self.pose.model, self.pose.numbers
        received = np.asarray(self.pose.stiffness @ self.v - self.forces)
        turned = np.zeros((len(model.solids), 6, self.x.shape[1]))
        if self.spin is not None:
            for own, name, rho in zip(turned, model.solids, now.densities, strict=True):
                w = _crossed(self.spin[model.names.index(name)])
                from eigassign.mechanism.elements.solid_stress import PAIRS

                own[:, 0] = [rho * (w @ w)[pair] for pair in PAIRS]
        stretched = np.asarray(self.pose.springs @ self.x).reshape(-1, 6, self.x.shape[1])
        springs = zip(now.spring_stiffness, stretched, strict=True)
        return Loads(
            dict(zip(model.names, self.own, strict=True)),
            {node: wrench for node, (wrench, _) in self.carried.items()},
            {node: D for node, (_, D) in self.carried.items()},
            dict(zip(model.solids, turned, strict=True)),
            {n: k[:, None] * moved for n, (k, moved) in enumerate(springs)},
            {node: _picked(received, model.slots[node]) for node in model.told},
        )

    def elements(self) -> list[tuple[StackedElements, Floats]]:
        """k_σ (n_loads, n, 12, 12) of the elements of each strand."""
        planar, found = len(self.pose.model.kept) == 3, []
        for one in self.pose.beams:
            v, pull = (one.elements.seen(each) for each in (self.v, self.pull))
            k, m = one.matrices
            r = (k @ v - m @ pull).transpose(1, 2, 0)
            load = (one.carried @ pull).transpose(0, 2, 3, 1)
            c, matrices = zip(*stress_terms(r, load, one.h, one.bent, planar), strict=True)
            found.append((one.elements, np.tensordot(np.array(c), np.array(matrices), (0, 0))))
        return found


def _picked(values: Floats, slots: Ints) -> Floats:
    """Rows of values (n, n_loads) at slots (6,), zero where there is none."""
    return np.where((slots >= 0)[:, None], values[slots], 0.0)


def _crossed(a: Floats) -> Floats:
    """[a]× (…, 3, 3) of vectors (…, 3)."""
    return np.asarray(np.einsum("...i,kij->...kj", a, CROSSED))


# --- built once


def variable_loads(scene: Loaded) -> Loads:
    """Loads that are variables behind z; zeros for what a plane has not."""
    recorder, first = scene.known.recorder, itertools.count(scene.known.count)
    kept = DOFS[scene.nodes.space]

    def wrench() -> Objects:
        found = [recorder.variable(next(first)) if d in kept else 0.0 for d in range(6)]
        return np.array(found, dtype=object)

    def moments() -> Objects:
        found = [recorder.variable(next(first)) for _ in range(9)]
        return np.array(found, dtype=object).reshape(3, 3)

    return Loads(
        {name: wrench() for name in scene.links},
        {node: wrench() for node in scene.sites},
        {node: moments() for node in scene.sites},
        {name: wrench() for name in scene.solids},
        {k: wrench() for k in range(len(scene.springs))},
        {node: wrench() for node in scene.settled.nodes},
    )


def stiffness_under_load(
    case: CaseFile, parameters: ModelParameters, motion: Kinematics
) -> StiffnessUnderLoad:
    """Collect what K_g hangs on for any loads."""
    links, nodes = local_links(case, parameters, motion)
    known, named = parameters.with_passive(motion.passive), by_name(motion, links)
    scene = Loaded(case, known, motion, named, nodes)
    moving = all_moving(case, parameters, motion)
    stack, _ = stacked(named, nodes, moving, motion)
    sizes = [whole_size(link) for link in links]
    first = dict(zip(named, np.cumsum([0, *sizes[:-1]]).tolist(), strict=True))
    loads, K = variable_loads(scene), AffineEntries(summed=True)
    asked = np.concatenate([np.zeros(0, dtype=object), *(each.ravel() for each in loads.each)])
    counted = np.flatnonzero(present(asked))
    add_second_order(K, scene, loads)
    curved = _collected(K, nodes.count, parameters.recorder, stack.joined.shape[1])
    stiffness = Entries(stack.masses.shape)
    for name in named:
        add_terms(stiffness, scene.whole(name).stiffness, first[name], first[name])
    reduced = [(first[name], link.reduction) for name, link in named.items()]
    inner = [start + one.interior for start, one in reduced if one is not None]
    patterns = pattern(stiffness), pattern(_relative(scene, curved.shape[0]))
    strands = [(name, strand) for name in named for strand in scene.whole(name).strands]
    sheared = [strand.profiles[0][0].shear_z is not None for _, strand in strands]
    elements = [StackedElements.of(strand, first[name], sum(sizes)) for name, strand in strands]
    return StiffnessUnderLoad(
        parameters=parameters,
        n_u=nodes.count,
        kept=DOFS[nodes.space],
        names=tuple(named),
        stack=stack,
        stiffness=patterns[0],
        springs=patterns[1],
        inner=np.concatenate([np.zeros(0, dtype=np.intp), *inner]),
        slots={
            (name, node): np.where(own >= 0, own + first[name], -1)
            for name in named
            for node, own in scene.whole(name).nodes.items()
        },
        sites=tuple(scene.sites),
        solids=tuple(scene.solids),
        strands=list(zip(elements, sheared, strict=True)),
        told=scene.settled.nodes,
        counted=counted,
        curved=curved,
        at_rest=parameters.compiled(*stack.scalars, *_scalars(scene, patterns, strands)),
        in_load=compile_arrays(
            parameters.recorder,
            [np.array(curved.coefficients, dtype=object)],
            parameters.count + len(counted),
        ),
    )


def _scalars(
    scene: Loaded, patterns: Sequence[Pattern], strands: Sequence[tuple[str, Strand]]
) -> Iterator[Objects]:
    """The scalars of `_Numbers` behind those of the stack, in their order."""
    yield from (np.array(each.coefficients, dtype=object) for each in patterns)
    yield np.array(list(scene.sites.values()), dtype=object).reshape(-1, 6, 6)
    yield np.array([one.stiffness for one in scene.springs], dtype=object).reshape(-1, 6)
    yield np.array([p.world_rotation for p in scene.motion.placements])
    yield np.array(list(scene.solids.values()), dtype=object)
    for _, strand in strands:
        values = [[[0.0 if v is None else v for v in b] for b in each] for each in strand.profiles]
        yield np.array(strand.lengths, dtype=object)
        yield np.array(values, dtype=object)


def _relative(scene: Loaded, n_dof: int) -> Entries:
    """The motion of the second end of each spring against the first, but for rigid ones."""
    out = Entries((6 * len(scene.springs), n_dof))
    rigid = {scene.nodes.count + k for k in scene.motion.rigid}
    for k, spring in enumerate(scene.springs):
        for row, (here, there) in enumerate(zip(spring.here, spring.there, strict=True), 6 * k):
            apart = {i: c for i, c in combined(there, here, -1.0).items() if i not in rigid}
            own = np.array(list(apart), dtype=np.intp)
            out.add_scalars(list(apart.values()), np.full(len(own), row), own)
    return out


def _collected(K: AffineEntries, n_u: int, recorder: Recorder, n_dof: int) -> Pattern:
    """The entries of an affine matrix as a pattern."""
    rows, columns, atoms, factors = K.finish(n_u)
    order, out = np.argsort(atoms, kind="stable"), Entries((n_dof, n_dof))
    cuts = np.flatnonzero(np.diff(atoms[order])) + 1
    for own in np.split(order, cuts) if len(order) else ():
        out.add(recorder.function(int(atoms[own[0]])), rows[own], columns[own], factors[own])
    return pattern(out)
