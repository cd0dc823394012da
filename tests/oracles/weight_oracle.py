"""Vibration under weight: second derivatives of the total potential of a plain frame in space.

`spatial_oracle` gives nodes, elements and linear rows. Here every part has its nonlinear geometry,
with a displacement and a rotation vector for every node in world axes:

* a beam element has a frame that follows its chord and the mean roll of its ends; in it are cubic
  deflections (constant shear strain) and linear strains, with the work ½ ∫ N w'² of the bowing, N
  varying along the element under its own weight, which hangs on the deflected shape;
* bodies and rigid links are carried by rotation matrices; joints close with the rotation matrices
  of their freedoms, which are unknowns; a rider stands on the shape of its beam, the mean of that
  on both its sides;
* springs measure in axes that turn with their first node, which the ground does not.

The internal forces n and the multipliers μ of joints are those of linear statics with every
coordinate held, at the geometry without sag, so that with strains ε(x) and closures c(x)

    Π = n·ε + V + μ·c − τ·q,   ∂Π/∂x = 0,   K_T = K + ∂²Π/∂x²   on the motions that joints allow.

Second derivatives are exact: numbers carry their gradients and Hessians (`Jet`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy import linalg
from spatial_oracle import (
    FREEDOMS,
    Array,
    Builder,
    Pose,
    Tree,
    X,
    Y,
    Z,
    base_of,
    bending,
    body,
    cross,
    dimensions,
    mount,
    null_space,
    point,
    section,
    shaped_element,
    solve_pose,
    split_coordinates,
    turn,
    unit,
)

POINTS, WEIGHTS = np.polynomial.legendre.leggauss(8)
POINTS, WEIGHTS = 0.5 * (POINTS + 1.0), 0.5 * WEIGHTS
ROTATED = np.zeros((3, 3, 3))  # [θ]×, ij by component of θ
ROTATED[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = -1.0
ROTATED[[0, 2, 1], [2, 1, 0], [1, 0, 2]] = 1.0
ROTATED = ROTATED.transpose(0, 1, 2)


# Numbers with first and second derivatives


class Jet:
    """An array v with its gradients g (…, n) and Hessians h (…, n, n) by n unknowns."""

    __array_priority__ = 100.0

    def __init__(self, v: Any, g: Array, h: Array) -> None:
        self.v, self.g, self.h = np.asarray(v, float), g, h

    def __getitem__(self, at: Any) -> Jet:
        return Jet(self.v[at], self.g[at], self.h[at])

    def __add__(self, other: Any) -> Jet:
        if isinstance(other, Jet):
            return Jet(self.v + other.v, self.g + other.g, self.h + other.h)
        return Jet(self.v + other, self.g, self.h)

    def __mul__(self, other: Any) -> Jet:
        if isinstance(other, Jet):
            return product(",->", self, other)
        return Jet(self.v * other, self.g * other, self.h * other)

    def __neg__(self) -> Jet:
        return self * -1.0

    def __sub__(self, other: Any) -> Jet:
        return self + -other

    __radd__, __rmul__ = __add__, __mul__

    def of(self, f: float, slope: float, curve: float) -> Jet:
        """A function of this single number, with its derivatives there."""
        return Jet(f, slope * self.g, slope * self.h + curve * np.outer(self.g, self.g))


def product(spec: str, a: Any, b: Any) -> Jet:
    """An einsum of two arrays of which one at least is a Jet."""
    left, out = spec.split("->")
    p, q = left.split(",")
    if not isinstance(b, Jet):
        a, b, p, q = b, a, q, p
    if not isinstance(a, Jet):
        return Jet(
            np.einsum(f"{p},{q}->{out}", a, b.v),
            np.einsum(f"{p},{q}y->{out}y", a, b.g),
            np.einsum(f"{p},{q}yz->{out}yz", a, b.h),
        )
    mixed = np.einsum(f"{p}y,{q}z->{out}yz", a.g, b.g)
    return Jet(
        np.einsum(f"{p},{q}->{out}", a.v, b.v),
        np.einsum(f"{p}y,{q}->{out}y", a.g, b.v) + np.einsum(f"{p},{q}y->{out}y", a.v, b.g),
        np.einsum(f"{p}yz,{q}->{out}yz", a.h, b.v)
        + np.einsum(f"{p},{q}yz->{out}yz", a.v, b.h)
        + mixed
        + np.swapaxes(mixed, -1, -2),
    )


def unknowns(n: int) -> Jet:
    return Jet(np.zeros(n), np.eye(n), np.zeros((n, n, n)))


def stacked(parts: Sequence[Jet], axis: int = 0) -> Jet:
    return Jet(*(np.stack([getattr(p, k) for p in parts], axis) for k in "vgh"))


def times(A: Any, B: Any) -> Jet:
    """Matrix by matrix."""
    return product("ij,jk->ik", A, B)


def by(A: Any, b: Any) -> Jet:
    """Matrix by vector."""
    return product("ij,j->i", A, b)


def dot(a: Any, b: Any) -> Jet:
    return product("i,i->", a, b)


def along(a: Jet) -> tuple[Jet, Jet]:
    """Length and direction of a vector."""
    square = dot(a, a)
    size = float(np.sqrt(square.v))
    inverse = square.of(1 / size, -0.5 / size**3, 0.75 / size**5)
    return square.of(size, 0.5 / size, -0.25 / size**3), product(",i->i", inverse, a)


def crossed(theta: Jet) -> Jet:
    return product("ijk,k->ij", ROTATED, theta)


def rotated(theta: Jet) -> Jet:
    """The matrix of a rotation vector that is zero in the pose."""
    W = crossed(theta)
    return W + times(W, W) * 0.5 + np.eye(3)


def vector_of(R: Jet) -> Jet:
    """The rotation vector of a matrix that is the unit matrix in the pose."""
    return product("ijk,ij->k", 0.5 * ROTATED, R)


def turned(axis: Array, angle: Jet) -> Jet:
    """Rodrigues' formula."""
    s, c = np.sin(angle.v), np.cos(angle.v)
    W = cross(axis)
    sine, cosine = angle.of(s, c, -s), angle.of(c, -s, -c)
    return product(",ij->ij", sine, W) + product(",ij->ij", cosine * -1.0 + 1.0, W @ W) + np.eye(3)


def moved_joint(joint: Tree, c: Jet) -> tuple[Jet, Jet]:
    """Rotation and travel of the follower in base axes; of a rider those beside its place."""
    kind, n, m = joint["type"], c.g.shape[1], mount(joint)
    still = Jet(np.zeros(3), np.zeros((3, n)), np.zeros((3, n, n)))
    plain = Jet(np.eye(3), np.zeros((3, 3, n)), np.zeros((3, 3, n, n)))
    R, d = plain, still
    if kind in ("revolute", "screw"):
        a = unit(joint.get("axis"), Z)
        R = turned(a, c[0])
        if kind == "screw":
            d = product(",i->i", c[0] * (joint["lead"] / (2 * np.pi)), a)
    elif kind == "prismatic":
        d = product(",i->i", c[0], unit(joint.get("axis"), X))
    elif kind == "cylindrical":
        a = unit(joint.get("axis"), Z)
        R, d = turned(a, c[1]), product(",i->i", c[0], a)
    elif kind == "universal":
        a, b = (unit(v, Z) for v in joint["axes"])
        R = times(turned(a, c[0]), turned(b, c[1]))
    elif kind == "spherical":
        R = times(times(turned(X, c[0]), turned(Y, c[1])), turned(Z, c[2]))
    elif kind == "nut":
        return times(turned(X, c[0] * (2 * np.pi / joint["lead"])), m), still
    return times(m, R), by(m, d)


# Parts


Pull = Callable[[float], Array]


@dataclass
class Strained:
    """Strains ε by the unknowns ``dofs``, with forces C ε; the multipliers' closures have none."""

    dofs: Array
    strain: Callable[[Jet], Jet]
    stiffness: Array | None
    rows: slice = field(default_factory=lambda: slice(0, 0))


@dataclass
class Beam:
    """An element: axes (columns) and nodes in the world, local stiffness, shapes, ρA by share."""

    dofs: Array
    axes: Array
    chord: Array
    k: Array
    T: Array
    mass: Callable[[float], float]

    @property
    def h(self) -> float:
        return float(np.linalg.norm(self.chord))

    def local(self, x: Jet) -> tuple[Jet, Jet, Jet]:
        """The element's frame (columns), its chord, and its twelve displacements in the frame."""
        chord = x[6:9] - x[0:3] + self.chord
        length, e1 = along(chord)
        ends = [times(rotated(x[k : k + 3]), self.axes) for k in (3, 9)]
        mean = (ends[0][:, 1] + ends[1][:, 1]) * 0.5
        _, e2 = along(mean - product(",i->i", dot(mean, e1), e1))
        e3 = by(crossed(e1), e2)
        frame = stacked([e1, e2, e3], 1)
        turns = [vector_of(product("ji,jk->ik", frame, end)) for end in ends]
        zero = product(",i->i", x[0] * 0.0, np.ones(3))
        stretch = product(",i->i", length + -self.h, X)
        parts = [p[i] for p in (zero, turns[0], stretch, turns[1]) for i in range(3)]
        return frame, chord, stacked(parts)

    def shapes(self, s: float, order: int) -> Array:
        """(2, 12): deflection (0), slope (1) or curvature (2) of both planes."""
        return np.array([plane[1 + order] @ self.T for plane in bending(s, self.h)])

    def weight(self, x: Jet, pull: Pull) -> Jet:
        """−∫ ρA a · (displacement) dx, a the pull at a share s of the length."""
        frame, chord, local = self.local(x)
        total = x[0] * 0.0
        for s, w in zip(POINTS, WEIGHTS, strict=True):
            bent = by(frame[:, 1:], by(self.shapes(s, 0), local))
            at = x[0:3] + chord * s + bent
            total = total - dot(at, pull(s)) * (w * self.h * self.mass(s))
        return total

    def bowing(self, x: Jet, pull: Pull, pulled: float) -> Jet:
        """½ ∫ N w'² dx; ``pulled`` is what the stretch alone gives on the last node."""
        _, _, local = self.local(x)

        def p(s: float) -> float:
            return float(self.axes[:, 0] @ pull(s)) * self.h * self.mass(s)

        last = pulled - sum(w * s * p(s) for s, w in zip(POINTS, WEIGHTS, strict=True))
        total = x[0] * 0.0
        for s, w in zip(POINTS, WEIGHTS, strict=True):
            beyond = [p(s + (1 - s) * t) for t in POINTS]
            N = last + (1 - s) * float(WEIGHTS @ beyond)
            slopes = by(self.shapes(s, 1), local)
            total = total + dot(slopes, slopes) * (0.5 * w * self.h * N)
        return total

    def at_end(self, x: Jet, s: float) -> tuple[Jet, Jet]:
        """∂x/∂s and the change of rotation per length, in world axes, at an end."""
        frame, chord, local = self.local(x)
        slope = by(frame[:, 1:], by(self.shapes(s, 1), local))
        curved = np.zeros((3, 12))
        curved[0, [3, 9]] = [-1 / self.h, 1 / self.h]
        curved[2], curved[1] = self.shapes(s, 2) * [[1], [-1]]
        return chord * (1 / self.h) + slope, by(self.axes, by(curved, local))


class WeightBuilder(Builder):
    """The frame program's builder, which remembers the nonlinear parts."""

    def __init__(self, tree: Tree, pose: Pose) -> None:
        super().__init__(tree, pose)
        self.beams: list[Beam] = []
        self.strained: list[Strained] = []
        self.hung: list[tuple[int, float, Array]] = []  # node, mass, arm in world axes
        self.spun: list[tuple[int, Array]] = []  # node, inertia about its centre in world axes
        self.driven: list[int] = []

    def beam(
        self, R: Array, data: Tree, shares: tuple[float, float], h: float, a: int, b: int
    ) -> None:
        super().beam(R, data, shares, h, a, b)
        material = self.m["materials"][data["material"]]

        def values(s: float) -> tuple[float, ...]:
            share = shares[0] + (shares[1] - shares[0]) * s
            return section(dimensions(self.m, data["section"], share))

        k, _, T = shaped_element(material, values, h, data.get("shear", False))
        axes = R @ turn(X, data.get("roll", 0.0))
        dofs = np.r_[a : a + 6, b : b + 6]

        def mass(s: float) -> float:
            return float(material["density"] * values(s)[0])

        beam = Beam(dofs, axes, axes[:, 0] * h, k, T, mass)
        self.beams.append(beam)
        self.strained.append(Strained(dofs, lambda x: beam.local(x)[2], k))

    def add_link(self, name: str) -> None:
        link = self.m["links"][name]
        if link.get("type", "beam") == "rigid":
            center = self.pose.R[name] @ point(link.get("center"))
            self.hung.append((self.n, link.get("mass", 0.0), center))
            own = body(0.0, link.get("inertia", 0.0), np.zeros(3), self.pose.R[name])
            self.spun.append((self.n, own[3:, 3:]))
        super().add_link(name)

    def tie(self, follower: int, base: int | None, lever: Array) -> None:
        first = len(self.rows)
        super().tie(follower, base, lever)
        if base is None:
            return
        dofs = np.r_[base : base + 6, follower : follower + 6]

        def closure(x: Jet) -> Jet:
            R = rotated(x[3:6])
            apart = x[6:9] - x[0:3] - by(R, lever) + lever
            turn_apart = vector_of(product("ij,kj->ik", rotated(x[9:12]), R))
            return joined(apart, turn_apart)

        self.strained.append(Strained(dofs, closure, None, slice(first, first + 6)))

    def add_body(self, data: Tree) -> None:
        super().add_body(data)
        R = self.pose.R[data["at"].split(".")[0]]
        at = self.where[data["at"]]
        self.hung.append((at, data.get("mass", 0.0), R @ point(data.get("offset"))))
        self.spun.append((at, body(0.0, data.get("inertia", 0.0), np.zeros(3), R)[3:, 3:]))

    def add_spring(self, data: Tree, planar: bool) -> None:
        super().add_spring(data, planar)
        dofs, _ = self.K[-1]
        moving = [node != "ground" for node in data["between"]]
        R = self.pose.R.get(data["between"][0].split(".")[0], np.eye(3)) @ mount(data)
        here, there = (self.pose.node(self.tree, node) for node in data["between"])
        arm = (there - here) * float(all(moving))
        k = np.zeros(6)
        for key, at in (("translational", 0), ("rotational", 3)):
            given = data.get(key, 0.0)
            for n, axis in enumerate(([0, 1] if at == 0 else [2]) if planar else range(3)):
                k[at + axis] = given[n] if np.ndim(given) else given

        def stretched(x: Jet) -> Jet:
            one, two = (each * float(m) for each, m in zip((x[:6], x[-6:]), moving, strict=True))
            turn_1 = rotated(one[3:6])
            back = product("ji,j->i", turn_1, two[0:3] - one[0:3] + arm) - arm
            twist = vector_of(product("ji,jk->ik", turn_1, rotated(two[3:6])))
            return joined(by(R.T, back), by(R.T, twist))

        self.strained.append(Strained(dofs, stretched, np.diag(k)))

    def add_joint(self, name: str) -> int:
        first, before, ties = len(self.rows), self.n, len(self.strained)
        free = super().add_joint(name)
        del self.strained[ties:]
        joint = self.m["joints"][name]
        base, follower = base_of(name, joint), joint["follower"]
        R_b, R_f = (self.pose.R[n.split(".")[0]] for n in (base, follower))
        driven, _ = split_coordinates(self.tree)
        unlocked, c0 = [], self.pose.values[name]
        for k in range(FREEDOMS[joint["type"]]):
            drive: Any = None
            if (name, k) in driven:
                drive = self.tree["coordinates"][driven[name, k]].get("drive", "free")
            if drive == "locked":
                continue
            if drive is not None:
                self.driven.append(before + len(unlocked))
            unlocked.append(k)
        at = [self.where[follower]] + ([self.where[base]] if base in self.where else [])
        dofs = np.concatenate([np.arange(a, a + 6) for a in at])
        dofs = np.append(dofs, before + np.arange(len(unlocked)))
        rider = joint["type"] in ("carriage", "nut")
        sides = []
        if rider:
            sides = [(b, s) for b in self.beams for s in (0.0, 1.0)
                     if b.dofs[0 if s == 0.0 else 6] == self.where[base]]  # fmt: skip
            for beam, s in sides:
                dofs = np.append(dofs, beam.dofs[6:] if s == 0.0 else beam.dofs[:6])
        x_f, x_b = self.pose.node(self.tree, follower), self.pose.node(self.tree, base)
        start = 6 * len(at)

        def closure(x: Jet) -> Jet:
            n = x.v.size
            pick = np.zeros((len(c0), n))
            pick[unlocked, start + np.arange(len(unlocked))] = 1.0
            c = by(pick, x) + c0
            R, d = moved_joint(joint, c)
            T_b = rotated(x[9:12]) if len(at) > 1 else rotated(x[0:3] * 0.0)
            o_b = x[6:9] + x_b if len(at) > 1 else x[0:3] * 0.0
            if rider:
                travel = c[0] - c0[0]
                ends = []
                for k, (beam, s) in enumerate(sides):
                    other = x[start + len(unlocked) + 6 * k :][:6]
                    own = x[6:12]
                    pair = [own, other] if s == 0.0 else [other, own]
                    ends.append(beam.at_end(chained(*pair), s))
                along_beam = mean([e[0] for e in ends])
                curved = mean([e[1] for e in ends])
                o_b = o_b + product(",i->i", travel, along_beam)
                T_b = times(T_b, rotated(product(",i->i", travel, curved)))
            R_base = times(T_b, R_b)
            o_f = o_b + by(R_base, d + point(joint.get("position")))
            apart = x[0:3] + x_f - o_f
            wanted = times(R_base, R)
            turn_apart = vector_of(product("ij,kj->ik", times(rotated(x[3:6]), R_f), wanted))
            return joined(apart, turn_apart)

        self.strained.append(Strained(dofs, closure, None, slice(first, first + 6)))
        return free


def joined(a: Jet, b: Jet) -> Jet:
    return Jet(*(np.concatenate([getattr(a, k), getattr(b, k)]) for k in "vgh"))


chained = joined


def mean(parts: Sequence[Jet]) -> Jet:
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total * (1.0 / len(parts))


@dataclass
class Weighed:
    """K, K_g and M on the motions that the joints allow, and where they come from."""

    K: Array
    K_g: Array
    M: Array
    T: Array  # (n, n_motions), over all unknowns
    builder: WeightBuilder
    sag: Array
    n_free: int
    pull: Array  # of the weight on the motions, which the drives hold
    weight: float  # the most that it pulls at any

    def spectrum(self, count: int, share: float = 1.0, rigid: bool = True) -> Array:
        """The lowest λ of K + share K_g; negative ones are poses that fall.

        Motions R on which neither K nor the weight works may be coupled to others by K_g. What that
        does in second order of gravity is left out, for sag would be of the same: to first order
        other modes feel Pᵀ K_g P with P = I − R (RᵀMR)⁻¹ RᵀM. Where no motion is ``rigid`` in every
        pose, this is left out.
        """
        if not rigid:
            return lowest(self.K + share * self.K_g, self.M, count)
        least = 1e-6 * (np.trace(self.K) or 1.0) / np.trace(self.M)
        size = np.sqrt(np.diag(self.K) + least * np.diag(self.M))
        R = null_space(self.K / np.outer(size, size)) / size[:, None]
        works = np.vstack([R.T @ self.K_g, self.pull]) @ R
        scale = np.abs(R.T) @ np.abs(self.K_g) @ np.abs(R)
        scale = np.append(scale.max(axis=1, initial=0.0), self.weight * np.abs(R).max(initial=0.0))
        turns = np.linalg.svd(works / np.maximum(scale, 1e-300)[:, None])
        R = R @ turns.Vh[int((turns.S > 1e-9).sum()) :].T
        P = np.eye(len(R)) - R @ np.linalg.solve(R.T @ self.M @ R, R.T @ self.M)
        return lowest(self.K + share * P.T @ self.K_g @ P, self.M, count)


def lowest(K: Array, M: Array, count: int) -> Array:
    """The lowest λ of a pencil whose M may be singular; K may be indefinite."""
    least = np.trace(np.abs(K)) / np.trace(M) * 1e-6
    size = np.sqrt(np.abs(np.diag(K)) + least * np.abs(np.diag(M)))
    K, M = K / np.outer(size, size), M / np.outer(size, size)
    ratio = np.trace(np.abs(K)) / np.trace(M)
    for shift in (0.0, *np.geomspace(1e-6, 1e3, 10) * ratio):
        if linalg.eigvalsh(K + shift * M).min() > 1e-13:
            break
    for _ in range(2):  # the second time near the modes asked for, which are then most accurate
        lam = 1.0 / np.sort(linalg.eigvalsh(M, K + shift * M))[::-1][:count] - shift
        shift = max(shift, float(np.abs(lam).max()))
    return lam


def weigh(tree: Tree, q: Any, gravity: Any, pose: Pose | None = None) -> Weighed:
    """The mechanism at q under ``gravity`` in m/s²."""
    pose = solve_pose(tree, np.atleast_1d(np.asarray(q, float))) if pose is None else pose
    b, g = WeightBuilder(tree, pose), point(np.asarray(gravity).tolist())
    n_free, out = b.fill()
    (K, M), rows = b.dense(), b.dense_rows()
    keep = np.setdiff1d(np.arange(b.n), out)
    slope, curve = np.zeros(b.n), np.zeros((b.n, b.n))

    def add(dofs: Array, value: Jet) -> None:
        slope[dofs] += value.g
        curve[np.ix_(dofs, dofs)] += value.h

    for node, mass, arm in b.hung:
        x = unknowns(6)
        add(np.arange(node, node + 6), dot(x[0:3] + by(rotated(x[3:6]), arm), g * -mass))
    for beam in b.beams:
        add(beam.dofs, beam.weight(unknowns(12), lambda _: g))
    weight = np.abs(slope)
    sag, forces = statics(K, rows, -slope, np.setdiff1d(keep, b.driven))
    for part in b.strained:
        strain = part.strain(unknowns(len(part.dofs)))
        assert np.abs(strain.v).max() < 1e-8
        if part.stiffness is None:
            assert np.abs(rows[part.rows][:, part.dofs] - strain.g).max() < 1e-6
            add(part.dofs, dot(strain, forces[part.rows]))
        else:
            add(part.dofs, dot(strain, part.stiffness @ (strain.g @ sag[part.dofs])))
    for beam in b.beams:
        x = unknowns(12)
        pulled = float((beam.k @ (beam.local(x)[2].g @ sag[beam.dofs]))[6])
        add(beam.dofs, beam.bowing(x, lambda _: g, pulled))
    held = np.setdiff1d(keep, b.driven)
    assert np.abs(slope[held]).max() < 1e-6 * max(np.abs(forces).max(initial=0.0), 1.0)
    small = null_space(rows[:, keep])
    T = np.zeros((b.n, small.shape[1]))
    T[keep] = small
    return Weighed(
        T.T @ K @ T,
        T.T @ curve @ T,
        T.T @ M @ T,
        T,
        b,
        sag,
        n_free,
        T.T @ slope,
        float((np.abs(T.T) @ weight).max()),
    )


def sag_slopes(found: Weighed, count: int) -> tuple[Array, Array]:
    """The lowest elastic λ, and by how much the sag of the weight changes them to first order.

    Of V(x) − λ T(x) with closures c(x): with n, μ the forces and multipliers in a mode φ, p = λ m φ
    its inertia forces, w the places of matter, 2 uᵀ (n·ε'' + μ·c'' − p·w'') φ, u the sag.
    """
    b = found.builder
    (K, M), rows = b.dense(), b.dense_rows()
    shift = np.trace(found.K) / np.trace(found.M) * 1e-6
    mu, z = linalg.eigh(found.M, found.K + shift * found.M)
    order = np.argsort(-mu)[found.n_free : found.n_free + count]
    lam, slopes = 1.0 / mu[order] - shift, []
    kept = np.abs(found.T).max(axis=1) > 0.0
    for each, mode in zip(lam, (found.T @ z[:, order]).T, strict=True):
        phi, curve = mode / np.sqrt(mode @ M @ mode), np.zeros_like(K)

        def add(dofs: Array, value: Jet, curve: Array = curve) -> None:
            curve[np.ix_(dofs, dofs)] += value.h

        left = (each * M @ phi - K @ phi)[kept]
        forces = np.linalg.lstsq(rows[:, kept].T, left, rcond=1e-12)[0]
        for part in b.strained:
            strain = part.strain(unknowns(len(part.dofs)))
            inside = forces[part.rows]
            if part.stiffness is not None:
                inside = part.stiffness @ (strain.g @ phi[part.dofs])
            add(part.dofs, dot(strain, inside))
        for node, mass, arm in b.hung:
            v, x = phi[node : node + 6], unknowns(6)
            pull = v[:3] + np.cross(v[3:], arm)
            at = x[0:3] + by(rotated(x[3:6]), arm)
            add(np.arange(node, node + 6), dot(at, -each * mass * pull))
        for node, J in b.spun:
            dofs, second = np.arange(node, node + 6), 0.5 * np.trace(J) * np.eye(3) - J
            work = -each * cross(phi[node + 3 : node + 6]) @ second
            add(dofs, product("ij,ij->", rotated(unknowns(6)[3:6]), work))
        for beam in b.beams:
            x, v = unknowns(12), phi[beam.dofs]
            local = beam.local(x)[2].g @ v

            def pulled(
                s: float, v: Array = v, beam: Beam = beam, local: Array = local, lam: float = each
            ) -> Array:
                bent = beam.axes[:, 1:] @ (beam.shapes(s, 0) @ local)
                return np.asarray(lam * ((1 - s) * v[:3] + s * v[6:9] + bent))

            add(beam.dofs, beam.weight(x, pulled))
            add(beam.dofs, beam.bowing(x, pulled, float((beam.k @ local)[6])))
        slopes.append(2.0 * found.sag @ curve @ phi)
    return lam, np.array(slopes)


def statics(K: Array, rows: Array, f: Array, held: Array) -> tuple[Array, Array]:
    """Displacements, and multipliers of the rows: K u + rowsᵀ μ = f on the unknowns ``held``."""
    T = null_space(rows[:, held])
    A = T.T @ K[np.ix_(held, held)] @ T
    u = np.zeros(len(f))
    if A.size:
        size = 1.0 / np.sqrt(np.maximum(np.diag(A), 1e-12 * np.diag(A).max()))
        scaled = A * np.outer(size, size)
        u[held] = T @ (size * np.linalg.lstsq(scaled, size * (T.T @ f[held]), rcond=1e-13)[0])
    left = (f - K @ u)[held]
    return u, np.linalg.lstsq(rows[:, held].T, left, rcond=1e-12)[0]
