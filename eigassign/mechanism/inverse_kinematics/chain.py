"""Where the tip of a mechanism has to be, and where it is as a function of the mechanism's state.

A path runs through waypoints in the plane or in space as piecewise cubics: a polyline, or a
not-a-knot cubic spline. Its parameter is the cumulative chord length, scaled to 0 ≤ s ≤ 1.

The orientation follows the same parameter s: kept, or one per waypoint. On a straight path the link
turns at a constant rate about a fixed axis from each waypoint to the next; on a spline its angle is
the same cubic spline (planar), or its angular acceleration is continuous (spatial, SciPy's
RotationSpline).

A state z = (q, p) holds the coordinates and, where loops are closed, the passive freedoms. The
links are placed anew with every freedom of every joint as a variable, the passive ones too: so
inverse kinematics closes the loops and reaches the point together, on the branch that it follows.

Shapes: n states, n_q coordinates, n_p passive freedoms, n_e closure equations, d = 2 or 3
components of the tip's position, r = 1 or 3 of its turning.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from math import perm
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import block_diag, solve_banded

from eigassign.arrays import Floats
from eigassign.case.case_file import CaseFile
from eigassign.case.schema.mechanism import ADVANCING, FREEDOMS
from eigassign.case.units import SI
from eigassign.errors import MechanismError, UsageError
from eigassign.mechanism.kinematics.forward import Kinematics, walk
from eigassign.mechanism.kinematics.loop_closure import closure_rows, reference_coordinates
from eigassign.mechanism.kinematics.parameters import ModelParameters, node_position
from eigassign.mechanism.kinematics.topology import Topology, split
from eigassign.series.algebra import Tangents
from eigassign.series.compiler import CompiledArrays, compile_arrays
from eigassign.series.expression import Recorder

WAYPOINTS = "trajectory.waypoints"  # key path in the case file
_SMOOTH = 1e-9  # of the slope: a change of direction nobody sees
_ROUND_OFF = 1e-12  # of the whole: how far outside a parameter is still taken for its end


@dataclass(frozen=True)
class Curve:
    """f(s) = Σ_k c_k (s − s_i)^k on s_i ≤ s ≤ s_{i+1}, with d components: paths, laws, motions."""

    knots: Floats  # (m,) ascending
    coefficients: Floats  # (k, m - 1, d), ascending powers

    def __post_init__(self) -> None:
        for array in (self.knots, self.coefficients):
            array.setflags(write=False)

    def value(self, s: ArrayLike, order: int = 0) -> Floats:
        """f or a derivative of it (n, d) at s (n,), from the right where it jumps.

        Raises UsageError outside the knots: a curve never extrapolates.
        """
        at = np.atleast_1d(np.asarray(s, dtype=np.float64))
        first, last = self.knots[[0, -1]]
        slack = _ROUND_OFF * (last - first)
        if not np.all((at >= first - slack) & (at <= last + slack)):
            raise UsageError(f"a curve is defined for {first:g} <= s <= {last:g} only")
        at = np.clip(at, first, last)
        piece = np.searchsorted(self.knots, at, side="right") - 1
        piece = np.minimum(piece, len(self.knots) - 2)  # the end belongs to the last piece
        return self._sum(piece, (at - self.knots[piece])[:, None], order)

    def corners(self, order: int = 1) -> Floats:
        """The inner knots at which a derivative jumps, by more than round-off."""
        inner = np.arange(len(self.knots) - 2)
        ahead = self._sum(inner, np.diff(self.knots)[inner, None], order)
        behind = self._sum(inner + 1, np.zeros((len(inner), 1)), order)
        size = perm(order, order) * np.abs(self.coefficients[order]).max()
        return np.asarray(self.knots[1:-1][np.abs(behind - ahead).max(axis=1) > _SMOOTH * size])

    def _sum(self, piece: NDArray[np.intp], t: Floats, order: int) -> Floats:
        total = np.zeros((len(piece), self.coefficients.shape[2]))
        for k in range(len(self.coefficients) - 1, order - 1, -1):
            total = total * t + perm(k, order) * self.coefficients[k, piece]
        return total


def through(knots: Floats, values: Floats, kind: str) -> Curve:
    """The curve with ``values`` (m, d) at ``knots`` (m,): straight pieces, or a "spline".

    The spline is twice continuously differentiable, with not-a-knot ends (the third derivative is
    continuous at the second and at the last but one knot); the parabola through three values, the
    line through two.
    """
    h, last = np.diff(knots)[:, None], len(knots) - 1
    chords = np.diff(values, axis=0) / h
    if kind != "spline" or last == 1:
        return Curve(knots, np.stack([values[:-1], chords]))
    if last == 2:  # the slopes of the parabola
        bent = (chords[1] - chords[0]) / h.sum()
        slopes = chords[[0, 0, 1]] + np.array([-h[0], h[0], h[1]]) * bent
    else:  # continuous second derivatives: h_k s_k-1 + 2(h_k-1 + h_k) s_k + h_k-1 s_k+1 = ...
        ends, both = knots[[2, -1]] - knots[[0, -3]], h[:-1] + h[1:]
        band = np.zeros((3, last + 1))
        band[0, 2:], band[1, 1:-1], band[2, :-2] = h[:-1, 0], 2.0 * both[:, 0], h[1:, 0]
        band[1, [0, -1]], band[0, 1], band[2, -2] = h[[1, -2], 0], ends[0], ends[1]
        right = np.zeros(values.shape)
        right[1:-1] = 3.0 * (h[1:] * chords[:-1] + h[:-1] * chords[1:])
        for row, (a, b), d in ((0, (0, 1), ends[0]), (-1, (-1, -2), ends[1])):
            right[row] = ((h[a] + 2.0 * d) * h[b] * chords[a] + h[a] ** 2 * chords[b]) / d
        slopes = solve_banded((1, 1), band, right)
    curl = (slopes[:-1] + slopes[1:] - 2.0 * chords) / h
    return Curve(
        knots, np.stack([values[:-1], slopes[:-1], (chords - slopes[:-1]) / h - curl, curl / h])
    )


def tip_path(waypoints: ArrayLike, kind: str) -> Curve:
    """The path `through` the waypoints (m, d), in m, over 0 ≤ s ≤ 1, its cumulative chord length.

    Raises MechanismError if two consecutive ones of the at least two waypoints coincide.
    """
    points = np.array(waypoints, dtype=np.float64)
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    length = float(chords.sum())
    # 1e-12 of the length is round-off of coordinates, no distance anybody means
    for i in np.flatnonzero(chords <= 1e-12 * length):
        message = f"the same point as the one before it, {points[i].tolist()}; drop one of them"
        raise MechanismError(f"{WAYPOINTS}[{i + 1}]", message)
    knots = np.concatenate([[0.0], np.cumsum(chords)]) / length
    knots[-1] = 1.0
    return through(knots, points, kind)


# --- attitude


class Attitude(NamedTuple):
    """The rotation of the tip's link to the world, R(s) on 0 ≤ s ≤ 1."""

    key: str  # of the case file: angle or orientation
    rotation: Callable[[Floats], Floats]  # s (n,) -> (n, 3, 3)
    # s (n,) and 1 or 2 -> ω in the world, rad per unit of s, or dω/ds, (n, 3)
    spin: Callable[[Floats, int], Floats]
    corners: Floats  # s at which ω jumps


def planar_attitude(path: Curve, angle: ArrayLike, kind: str) -> Attitude:
    """Angle θ(s) in rad, from one value that is kept or one per waypoint, full turns counted."""
    from scipy.spatial.transform import Rotation

    knots, axis = path.knots, np.array([0.0, 0.0, 1.0])
    values = np.broadcast_to(np.asarray(angle, dtype=np.float64), knots.shape)[:, None]
    theta = through(knots, values, kind)
    return Attitude(
        "angle",
        lambda s: np.asarray(Rotation.from_rotvec(theta.value(s) * axis).as_matrix()),
        lambda s, order: theta.value(s, order) * axis,
        theta.corners(),
    )


def spatial_attitude(path: Curve, orientation: ArrayLike, kind: str) -> Attitude:
    """Rotation from one triple (rx, ry, rz) that is kept or one per waypoint, R = Rz Ry Rx.

    From one waypoint to the next it turns the shorter way. Raises MechanismError where that is half
    a turn, so that there is no shorter way.
    """
    from scipy.spatial.transform import Rotation, RotationSpline, Slerp

    knots = path.knots
    angles = np.broadcast_to(np.asarray(orientation, dtype=np.float64), (len(knots), 3))
    R = Rotation.from_euler("xyz", angles)
    steps = (R[1:] * R[:-1].inv()).as_rotvec()
    size = np.linalg.norm(steps, axis=1)
    # within 1e-6 rad of half a turn the way round cannot be told
    for k in np.flatnonzero(size > np.pi - 1e-6):
        message = "half a turn from the one before it: say which way by a waypoint in between"
        raise MechanismError(f"trajectory.orientation[{k + 1}]", message)
    steps[size <= 1e-9] = 0.0  # orientations within 1e-9 rad do not differ
    # ω_i of R = exp(ω_i (s − s_i)) R_i
    steady = Curve(knots, (steps / np.diff(knots)[:, None])[None])
    turning: Any = Slerp(knots, R)

    def spin(s: Floats, order: int) -> Floats:
        return steady.value(s, order - 1)

    def smooth_spin(s: Floats, order: int) -> Floats:
        turned = turning(np.atleast_1d(s))  # rates are in the axes of the turned link
        return np.asarray(turned.apply(turning(np.atleast_1d(s), order)))

    def rotation(s: Floats) -> Floats:  # within [0, 1] but for round-off
        return np.asarray(turning(np.clip(np.atleast_1d(s), 0.0, 1.0)).as_matrix())

    if kind == "spline" and len(knots) > 2 and steps.any():
        turning = RotationSpline(knots, R)
        return Attitude("orientation", rotation, smooth_spin, np.zeros(0))
    return Attitude("orientation", rotation, spin, steady.corners(0))


# --- path, attitude and times together


class TipTarget(NamedTuple):
    """The target of n tips: ``point`` (n, d) in m, and ``rotation`` (n, 3, 3) where asked for."""

    point: Floats
    rotation: Floats | None = None


class Course(NamedTuple):
    """Sample k is due at path parameter ``s[k]`` and time ``time_s[k]``."""

    path: Curve
    s: Floats  # (n,) not decreasing, from 0 to 1
    time_s: Floats  # (n,)
    attitude: Attitude | None = None

    def target(self, s: Floats) -> TipTarget:
        """The target at parameters s (n,)."""
        rotation = None if self.attitude is None else self.attitude.rotation(np.atleast_1d(s))
        return TipTarget(self.path.value(s), rotation)

    def rates(self, s: ArrayLike, order: int = 1) -> tuple[Floats, Floats]:
        """dp/ds (n, d) in m and ω (n, 3) in rad, per unit of s, from the right at a corner.

        Of ``order`` 2 their derivatives d²p/ds² and dω/ds.
        """
        at = np.atleast_1d(np.asarray(s, dtype=np.float64))
        still = np.zeros((len(at), 3))
        spin = still if self.attitude is None else self.attitude.spin(at, order)
        return self.path.value(at, order), spin

    def corners(self) -> Floats:
        """Parameters inside (0, 1) at which either rate jumps."""
        turns = np.zeros(0) if self.attitude is None else self.attitude.corners
        return np.union1d(self.path.corners(), turns)

    @property
    def size(self) -> float:
        """m: how far from the origin, or how long, the path is."""
        points = self.path.value(self.path.knots)
        length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        return max(length, float(np.linalg.norm(points, axis=1).max()))

    def waypoint(self, k: int) -> int | None:
        """The waypoint (from 0) that sample k is due at, None between two."""
        near = np.flatnonzero(np.abs(self.path.knots - self.s[k]) < _ROUND_OFF)
        return int(near[0]) if len(near) else None

    def label(self, k: int) -> str:
        """Sample, time and point in words, or the waypoint."""
        point = ", ".join(f"{x:.6g}" for x in self.path.value(self.s[k])[0])
        if (i := self.waypoint(k)) is not None:
            return f"waypoint {i + 1} ({point}) m"
        i = int(np.searchsorted(self.path.knots, self.s[k]))
        sample = f"sample {k} (t = {self.time_s[k]:.6g} s, point ({point}) m)"
        return f"between waypoints {i} and {i + 1}, {sample}"


Bools = NDArray[np.bool_]


class TipEvaluation(NamedTuple):
    """The tip at n states, and how far the loops are from closed there."""

    point: Floats  # (n, d) m
    rotation: Floats | None  # (n, 3, 3) to the world; None where it was not asked for
    jacobian: Floats  # (n, d or d + r, n_q + n_p): m and rad per unit of z
    gap: Floats  # F (n, n_e), in m and, for turning, sines
    closure: Floats  # ∂F/∂z (n, n_e, n_q + n_p)


class LoopAssembly(NamedTuple):
    """The assembly of a chain's loops."""

    reference: Floats  # q (n_q,) at which the assembly is chosen
    passive: Callable[[Floats], Floats]  # q (n, n_q) -> p (n, n_p); raises SingularityError
    turning: Bools  # (n_e,) which closure equations are sines of angles


@dataclass(frozen=True)
class TipChain:
    """One node (the tip) of a mechanism, seen from the ground.

    ``kinds`` of the coordinates, then of the passive freedoms: "turn" (rad, a full turn leads
    back), "screw" (rad, it does not) or "slide" (m).
    """

    evaluate: Callable[..., TipEvaluation]  # of z (n, n_q + n_p), and by_design: by y too
    joints: tuple[str, ...]  # of the coordinates, in their order
    relative_map: tuple[Floats, Floats]  # A (n_q, n_q), b (n_q,): joint coordinates A q + b
    kinds: tuple[str, ...]
    turned_by: tuple[int, ...] = ()  # the components of a rotation vector that a tip can have
    assembly: LoopAssembly | None = None
    y: Floats = field(default_factory=lambda: np.zeros(0))  # the design (n_y,) that it is of
    tables: TipTables | None = None  # how it changes with the design; None: not at all

    @property
    def n_q(self) -> int:
        """Number of coordinates."""
        return len(self.joints)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the coordinates, of their joints where no case is known."""
        return self.joints if self.tables is None else tuple(self.tables.case.coordinates)

    @property
    def units(self) -> tuple[str, ...]:
        """The SI units of the coordinates, and what they are answered in."""
        if self.tables is not None:
            return self.tables.case.coordinate_units
        return tuple("m" if k == "slide" else SI("rad", "deg") for k in self.kinds[: self.n_q])

    @property
    def y_names(self) -> tuple[str, ...]:
        """The names of the design parameters (n_y,)."""
        return () if self.tables is None else self.tables.parameters.design

    def of_kind(self, kind: str) -> Bools:
        """Mask of the entries of a state that are of this kind, (n_q + n_p,)."""
        return np.array([k == kind for k in self.kinds], dtype=bool)


class Reduced(NamedTuple):
    """A tip evaluation with the passive freedoms eliminated: loops closed to first order."""

    J: Floats  # (n, m, n_q): task components per u of the coordinates
    drift: Floats  # (n, m): what closing the loops adds
    closing: Floats  # (n, n_p): what closes them
    following: Floats  # (n, n_p, n_q): how the passive freedoms follow


def reduced(seen: TipEvaluation, n_q: int) -> Reduced:
    """Passive freedoms from ∂F/∂p δp = −F and ∂F/∂p ∂p/∂q = −∂F/∂q, least squares if redundant."""
    J = seen.jacobian
    n, m, n_z = J.shape
    if n_z == n_q:
        none = np.zeros((n, 0))
        return Reduced(J, np.zeros((n, m)), none, np.zeros((n, 0, n_q)))
    wanted = -np.concatenate([seen.gap[:, :, None], seen.closure[:, :, :n_q]], axis=2)
    solved = _solved(seen.closure[:, :, n_q:], wanted)
    closing, following = solved[:, :, 0], solved[:, :, 1:]
    J_p = J[:, :, n_q:]
    drift = np.einsum("nmp,np->nm", J_p, closing)
    return Reduced(J[:, :, :n_q] + J_p @ following, drift, closing, following)


def _solved(A: Floats, B: Floats) -> Floats:
    if A.shape[1] == A.shape[2]:
        try:
            return np.asarray(np.linalg.solve(A, B))
        except np.linalg.LinAlgError:  # exactly singular somewhere
            pass
    return np.asarray(np.linalg.pinv(A, rcond=1e-12) @ B)


# --- the chain of a tip, built from the kinematics of its case


def tip_chain(
    case: CaseFile,
    parameters: ModelParameters,
    motion: Kinematics,
    tip: str,
    y: Floats,
    oriented: bool = False,
    loads: Floats | None = None,
) -> TipChain:
    """The chain that carries the node ``tip`` ("link.node") at design y, turned if oriented.

    ``loads`` (n_loads,) are what the trajectory sets, where there are any.
    """
    turns = (2,) if case.mechanism.space == "planar" else (0, 1, 2)
    set_ = np.zeros(0) if loads is None else loads
    return TipTables(case, parameters, motion, tip, turns if oriented else (), set_).chain(y)


@dataclass(frozen=True, eq=False)
class TipTables:
    """The chain's scalars over z and y, compiled once, and evaluated for all states together.

    The links are placed anew with open loops: passive freedoms are variables, closure is an
    equation to be met, and every freedom moves by itself.
    """

    case: CaseFile
    parameters: ModelParameters
    motion: Kinematics
    tip: str
    turns: tuple[int, ...]
    loads: Floats  # (n_loads,)

    def chain(self, y: Floats) -> TipChain:
        """The chain at design y (n_y,)."""
        assembly = None
        if self.motion.passive:  # the branch of the model itself
            gaps, sines = (2, 1) if self.case.mechanism.space == "planar" else (3, 3)
            turning = ([False] * gaps + [True] * sines) * len(self.motion.tree.loops)
            assembly = LoopAssembly(
                reference_coordinates(self.case),
                lambda q: self._passive(self._variables(q, y))[0],
                np.array(turning),
            )
        return TipChain(
            evaluate=partial(self.evaluate, y=y),
            joints=tuple(c.joint for c in self.case.coordinates.values()),
            relative_map=self.motion.coordinates[:2],
            kinds=_kinds(self.case, self.motion.tree),
            turned_by=self.turns,
            assembly=assembly,
            y=y,
            tables=self,
        )

    @cached_property
    def _passive(self) -> CompiledArrays:
        return self.parameters.compiled(np.array(self.motion.passive, dtype=object))

    @cached_property
    def _table(self) -> CompiledArrays:
        """Place (d,), rotation (9,) or nothing, and F (n_e,)."""
        case, tree = self.case, self.motion.tree
        variables = self.parameters.rerecorded(Recorder(), len(tree.passive))
        moving = walk(case, variables, tree, self.motion.coordinates)
        link, node = split(self.tip)
        X = node_position(case, variables, tree, (link, node))
        rotation, place = moving.placement(link).at(X)
        planar = case.mechanism.space == "planar"
        F = closure_rows(moving, planar)[0] if tree.passive else []
        arrays = place[: 2 if planar else 3], rotation[: 3 if self.turns else 0].ravel()
        return compile_arrays(
            variables.recorder,
            (*arrays, np.array(F, dtype=object)),
            variables.count + len(tree.passive),
        )

    def evaluate(self, z: Floats, y: Floats, by_design: bool = False) -> TipEvaluation:
        """The tip at states z (n, n_z) and design y, with derivatives ``by_design`` behind q."""
        to_z, n_q, n = self.parameters.to_z, len(self.motion.coordinates.offset), len(z)
        columns = [*range(n_q), *(range(n_q + len(self.loads), len(to_z)) if by_design else ())]
        moves = block_diag(to_z[:, columns], np.eye(z.shape[1] - n_q))
        variables = np.hstack([self._variables(z, y), np.repeat(moves, n, axis=1)])
        found = self._table(variables, Tangents(n, moves.shape[1]))
        place, turned, F = (each.reshape(len(each) // n, n, *each.shape[1:]) for each in found)
        J, R = place[1:], None
        if self.turns:
            R, *turning = turned.reshape(-1, n, 3, 3)
            W = np.einsum("knij,nlj->ilkn", turning, R)  # Ṙ Rᵀ = [ω]×
            spin = [(W[2, 1], W[0, 2], W[1, 0])[k] for k in self.turns]
            J = np.concatenate([J, np.stack(spin, axis=2)], axis=2)
        jacobian, closure = (np.moveaxis(each, 0, 2) for each in (J, F[1:]))
        return TipEvaluation(place[0], R, jacobian, F[0], closure)

    def _variables(self, z: Floats, y: Floats) -> Floats:
        """The joint coordinates, loads, y and p as rows."""
        q, p = np.split(z, [len(self.motion.coordinates.offset)], axis=1)
        given = np.broadcast_to(np.append(self.loads, y), (len(z), len(self.loads) + len(y)))
        return np.concatenate([self.parameters.z(np.hstack([q, given])), p.T])


def _kinds(case: CaseFile, tree: Topology) -> tuple[str, ...]:
    """The kind of each freedom; where a loop is closed over a screw, no turn leads back."""
    types = [case.mechanism.joints[f.joint].type for f in tree.freedoms]
    advancing = any(j.type in ADVANCING for j in case.mechanism.joints.values())
    kinds = []
    for freedom, kind in zip(tree.freedoms, types, strict=True):
        slides = FREEDOMS[kind][freedom.component] == "translation"
        turn = "screw" if kind == "screw" or (tree.loops and advancing) else "turn"
        kinds.append("slide" if slides else turn)
    return tuple(kinds)
