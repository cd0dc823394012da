"""Residual vibration of a move: what a prescribed motion q(t) leaves of the tip's error.

The drives are held by their stiffness or locked; x = [u; deflections of held drives] obeys

    M(q) ẍ + (C + D) ẋ + K(q) x = −f(q, q̇, q̈),      D = M Φ diag(2ζω) ΦᵀM,

f being the forces of inertia of the rigid motion (`mechanism.assembly.dynamics.inertia_forces`), C
Ṁ and the gyroscopic terms (`velocity_terms`), by which a vibration keeps its momentum as the pose
changes, Φ and ω the modes of the pose and ζ as the case states it, of loss factors φᵀK_lossφ/2λ.
K_v is left out, which without what the forces stress is wrong. Nothing vibrates before the motion;
where q̇ jumps, M Δẋ = −f(q, 0, Δq̇).

One basis V for the whole path, modes of some poses and what f does at rest at others, makes of it
few equations. In τ = t/T, dots being derivatives in τ, f = f_0(τ)/T², so that one preparation
serves all durations T of the same path and law. What f does at rest is apart,

    x = z − w/T²,   w = K_r⁻¹ f_0,
    M_r z̈ + (C_r + T D_r) ż + T² K_r z = (M_r ẅ + (C_r + T D_r) ẇ)/T²,

w by splines between the breaks of the motion. z is in the p slowest modes of each pose, others
follow at rest: in steps that are long beside their periods, each step would ring them. Over a step
of τ the pose rests, as it is in its middle, the modes z = Φ η part, and each is solved exactly. The
next step takes over η and η̇: of all modes by R = Φ₊ᵀ M₊ Φ = exp(hA), of slow ones s beside fast
ones f by exp(hA_ss) = R_ss − R_sf R_fs/2. At both ends of a step C changes η̇ by exp(−h ΦᵀC_rΦ/2).
That errs by the square of the step.

After the stop the pose rests, so that each mode vibrates freely, for good, with Z_i from η and η̇:

    d(t) = Re Σ_i b·φ_i Z_i exp(s_i t),   s_i = (−ζ_i + i√(1 − ζ_i²)) ω_i .
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline
from scipy.linalg import expm

from eigassign.mechanism.assembly.dynamics.inertia_forces import InertiaForces, inertia_forces
from eigassign.mechanism.assembly.dynamics.velocity_terms import VelocityTerms, velocity_terms
from eigassign.mechanism.forces import Forces
from eigassign.mechanism.trajectory.trajectory import Trajectory
from eigassign.modal.exact.dense import inverse_factor
from eigassign.modal.exact.solver import lowest_modes
from eigassign.modal.model import Model
from eigassign.modal.response import Damping, unit_forces
from eigassign.modal.taylor.rayleigh import project
from eigassign.modal.under_load import displaced

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Complex = NDArray[np.complex128]
BESIDE = 1e-9  # of the duration: a break is looked at this much before and behind it
SAME = 1e-9  # of the largest: what a vector of the basis has that no other has, squared
LEAST_STEPS = 4  # between breaks, of a spline
LEAST_TERMS = 4  # instants of C between breaks
JUMP = 1e-6  # of the largest q̇: less is no blow
PERIODS = 20  # of the lowest mode that are looked at
PER_PERIOD = 40  # instants in one of the highest
BETWEEN = 20  # instants between two of these, beside the largest
UNSEEN = 5e-4  # of all that vibrates: modes that are left out of the search, from the highest on
NUMBERS = 2_000_000  # looked at together: 16 MB


class Sizes(NamedTuple):
    """How finely a move is solved.

    Against 25 modes in 2048 steps a SCARA errs by 1e-4 of its largest residual, a palletiser by
    1e-3, a luffing boom by 1 %, of which four modes within ten times the lowest miss 20 %. Modes
    whose periods are short beside a step ring: 256 steps err by 1.3 % for one of 962 Hz.
    """

    modes: int = 8  # of each pose in the basis, and at most of those that are followed
    span: float = 40.0  # times the lowest frequency: modes beyond it follow at rest
    poses: int = 3
    loads: int = 9  # instants of f at rest, and of C
    steps: int = 512


SIZES = Sizes()
FINER = Sizes(16, 80.0, poses=5, loads=17, steps=1024)  # that answers are looked at with


@dataclass(frozen=True, eq=False)
class Move:
    """A motion of a mechanism, with nodes that are watched; built once, solved for designs."""

    model: Model
    trajectory: Trajectory  # from rest to rest
    inertia: InertiaForces
    terms: VelocityTerms
    tips: Forces
    groups: tuple[slice, ...]  # of the forces, of each node
    damping: Damping

    def at(self, y: ArrayLike, sizes: Sizes = SIZES) -> ReducedMove:
        """The move of a design y (n_y,), SI.

        Raises TrajectoryError where the design cannot follow its path, UsageError for a wrong
        shape, and MechanismError where a pose has no modes.
        """
        own = np.asarray(y, dtype=np.float64)
        edges, blown = self._edges(sizes.steps)
        V, n = self._basis(own, sizes), len(edges)
        middle = np.append(0.5 * (edges[:-1] + edges[1:]), 1.0)
        x = self._x(own, np.concatenate([middle, edges]))
        K, M = self._projected(V, x)
        omega, phi, inverse, turn = _slow_modes(K[:n], M[:n], sizes)
        push = -self._blows(own, edges[blown]) @ V
        blows = np.zeros((n, V.shape[1]))
        blows[blown] = np.linalg.solve(M[n:][blown], push[..., None])[..., 0]
        still, steps = self._at_rest(own, edges, blown, V, K[n:])
        h, C = np.diff(edges)[:, None, None], self._velocities(own, edges, blown, V, sizes.loads)
        half = np.tile(np.eye(phi.shape[2]), (n, 1, 1))  # over half a step; none after the stop
        C = np.swapaxes(phi[:-1], 1, 2) @ C
        half[:-1] = expm(-0.5 * h * (C @ phi[:-1]))
        force = np.einsum("nrs,nks->nkr", inverse[:-1], still[:, 1:])
        rates = np.stack([still[:, 1], still[:, 1] + 0.5 * h[:, 0] * still[:, 2:].sum(axis=1)], 1)
        force[:, 1:] += np.einsum("nrs,nks->nkr", C, rates)
        steps = np.einsum("nrs,nks->nkr", inverse, steps)
        steps[:, 1] = np.einsum("nrs,ns->nr", half, steps[:, 1])
        return ReducedMove(
            groups=self.groups,
            edges=edges,
            omega=omega,
            zeta=self._ratios(x[:n], V, phi, omega),
            phi=phi,
            turn=np.stack([turn, half[1:] @ turn @ half[:-1]], axis=1),
            still=still,
            force=force,
            steps=steps,
            blows=np.einsum("nrs,nst,nt->nr", half, inverse, blows),
            tip=self._tips(x[n:]) @ V,
        )

    def _at_rest(
        self, y: Floats, edges: Floats, breaks: Ints, V: Floats, K: Floats
    ) -> tuple[Floats, Floats]:
        """w = K_r⁻¹ f_0 along the path by splines between breaks.

        w, ẇ, ẅ where a step begins and ẅ where it ends, (n, 4, r), and by how much w and ẇ jump
        where one begins, and at the stop, (n + 1, 2, r).
        """
        n, r = K.shape[:2]
        still, steps = np.zeros((n - 1, 4, r)), np.zeros((n, 2, r))
        for first, last in pairwise(breaks.tolist()):
            tau = edges[first : last + 1]
            f = self._forces(y, np.clip(tau, tau[0] + BESIDE, tau[-1] - BESIDE)) @ V
            w = np.linalg.solve(K[first : last + 1], f[..., None])[..., 0]
            curve = CubicSpline(tau, w)
            rate, push = curve(tau, 1), curve(tau, 2)
            still[first:last] = np.stack([w[:-1], rate[:-1], push[:-1], push[1:]], axis=1)
            steps[first] += w[0], rate[0]
            steps[last] -= w[-1], rate[-1]
        return still, steps

    def _velocities(self, y: Floats, edges: Floats, breaks: Ints, V: Floats, count: int) -> Floats:
        """C_r in the middle of each step (n, r, r), by splines between breaks."""
        found = []
        for first, last in pairwise(breaks.tolist()):
            start, end = edges[first] + BESIDE, edges[last] - BESIDE
            tau = np.linspace(start, end, max(round((end - start) * count), LEAST_TERMS) + 1)
            each = zip(*self._moving(y, tau), strict=True)
            C = [V.T @ (self.terms.at(q, y, rate, push)[0] @ V) for q, rate, push in each]
            own = edges[first : last + 1]
            found.append(CubicSpline(tau, C)(0.5 * (own[:-1] + own[1:])))
        return np.concatenate(found)

    def _edges(self, steps: int) -> tuple[Floats, Ints]:
        """τ of the ends of all steps (n,), and which of them are breaks or ends of the motion."""
        first, T = self._span
        tau = (np.asarray(self.trajectory.motion.breaks_s) - first) / T
        ends = np.concatenate([[0.0], tau[(tau > BESIDE) & (tau < 1.0 - BESIDE)], [1.0]])
        counts = np.maximum(np.ceil(np.diff(ends) * steps - 1e-6).astype(int), LEAST_STEPS)
        breaks = np.cumsum([0, *counts])
        return np.interp(np.arange(breaks[-1] + 1), breaks, ends), breaks

    def _moving(self, y: Floats, tau: Floats) -> tuple[Floats, Floats, Floats]:
        """q and its derivatives in τ, (n, n_q) each."""
        first, T = self._span
        q, rate, push = self.trajectory.motion.moving(first + T * tau, y)
        return q, T * rate, T * T * push

    @property
    def _span(self) -> tuple[float, float]:
        """When it starts, and its duration, s."""
        return float(self.trajectory.time_s[0]), float(np.ptp(self.trajectory.time_s))

    def _x(self, y: Floats, tau: Floats) -> Floats:
        return self.model.x(self._moving(y, tau)[0], y)

    def _forces(self, y: Floats, tau: Floats) -> Floats:
        """f_0 (n, n_dof)."""
        q, rate, push = self._moving(y, tau)
        return self.inertia.at(q, y, rate, push)

    def _blows(self, y: Floats, tau: Floats) -> Floats:
        """f(q, 0, Δq̇) (n, n_dof) where q̇ may jump: first and last from rest and to rest."""
        q, before, _ = self._moving(y, np.maximum(tau - BESIDE, 0.0))
        after = self._moving(y, np.minimum(tau + BESIDE, 1.0))[1]
        size = max(np.abs(before).max(), np.abs(after).max())
        before[0], after[-1] = 0.0, 0.0
        jump = after - before
        jump[np.abs(jump) < JUMP * size] = 0.0
        return self.inertia.at(q, y, np.zeros_like(q), jump)

    def _basis(self, y: Floats, sizes: Sizes) -> Floats:
        """V (n_dof, r), with VᵀMV = I in the middle of the path."""
        pencil = self.model.pencil
        theta = pencil.theta(self._x(y, np.linspace(0.0, 1.0, sizes.poses)))
        phi = lowest_modes(pencil, theta, 1, sizes.modes - 1).phi
        tau = (np.arange(sizes.loads) + 0.5) / sizes.loads
        f = self._forces(y, tau)[..., None]
        still = displaced(pencil, pencil.theta(self._x(y, tau)), f)
        W = np.concatenate([*phi, *still], axis=1)
        M = self._projected(W, self._x(y, np.array([0.5])))[1][0]
        size = np.sqrt(np.diag(M))
        own = size > 0.0
        W, M = W[:, own] / size[own], M[np.ix_(own, own)] / np.outer(size[own], size[own])
        s, U = np.linalg.eigh(M)
        kept = s > SAME * s[-1]
        return np.asarray(W @ (U[:, kept] / np.sqrt(s[kept])))

    def _projected(self, V: Floats, x: Floats) -> tuple[Floats, Floats]:
        """K_r and M_r (n, r, r) at x (n, n_x)."""
        theta = self.model.pencil.theta(x).T
        K, M = (np.tensordot(theta, terms, 1) for terms in project(self.model.pencil, V))
        return K, M

    def _ratios(self, x: Floats, V: Floats, phi: Floats, omega: Floats) -> Floats:
        """ζ (n, p)."""
        loss, r = self.damping.loss, phi.shape[2]
        if loss is None:
            return np.tile(self.damping.zeta(r), (len(x), 1))
        lost = np.tensordot(loss.theta(x).T, project(loss, V)[0], 1)
        return np.asarray(0.5 * (phi * (lost @ phi)).sum(axis=1) / omega**2)

    def _tips(self, x: Floats) -> Floats:
        """b (n, m, n_dof) of every node and direction."""
        b = np.zeros((len(x), len(self.tips.unknowns), self.model.n_dof))
        known = zip(self.tips.unknowns, self.tips.at(x, np.arange(0)), strict=True)
        for k, (places, (values, _)) in enumerate(known):
            b[:, k, places] = values
        return b


def _slow_modes(K: Floats, M: Floats, sizes: Sizes) -> tuple[Floats, Floats, Floats, Floats]:
    """ω (n, p), Φ (n, r, p), ΦᵀM of the slow modes; exp(hA_ss) from each pose to the next."""
    inverse = inverse_factor(K)
    mu, v = np.linalg.eigh(inverse @ M @ np.swapaxes(inverse, 1, 2))
    z, mu = (np.swapaxes(inverse, 1, 2) @ v)[:, :, ::-1], mu[:, ::-1]  # zᵀKz = 1
    omega = 1.0 / np.sqrt(mu)
    phi = z * omega[:, None]
    inverse = np.swapaxes(phi, 1, 2) @ M  # Φ⁻¹
    p = min(int((omega <= sizes.span * omega[:, :1]).any(axis=0).sum()), sizes.modes)
    R = inverse[1:] @ phi[:-1]
    turn = R[:, :p, :p] - 0.5 * R[:, :p, p:] @ R[:, p:, :p]
    return omega[:, :p], phi[..., :p], inverse[:, :p], turn


def move(
    model: Model,
    trajectory: Trajectory,
    nodes: Mapping[str, Sequence[Sequence[float]]],
    damping: Damping = Damping(),  # noqa: B008
) -> Move:
    """The motion of a trajectory, and nodes ``link.node`` whose way is watched.

    Each along its directions of the ground, which are unit vectors square to each other: what
    counts is the length of its way among them. Raises MechanismError where a coordinate is free,
    and for superelements and solids.
    """
    tips = unit_forces(model, nodes)
    ends = np.cumsum([0, *map(len, nodes.values())]).tolist()
    groups = tuple(slice(a, b) for a, b in pairwise(ends))
    of = model.poses.case, model.poses.parameters, model.motion
    return Move(model, trajectory, inertia_forces(*of), velocity_terms(*of), tips, groups, damping)


# --- of one design, in its modes


class Free(NamedTuple):
    """Free vibration after the stop, d(t) = Re Σ_i tip_mi Z_i exp(s_i t), t from the stop."""

    Z: Complex  # (n_T, p)
    s: Complex  # (p,) in 1/s
    tip: Floats  # (m, p)

    def at(self, t: Floats) -> Floats:
        """d (n_T, m, n_t) at times (n_t,)."""
        waves = np.exp(self.s[:, None] * t)
        return np.asarray(((self.Z[:, None] * self.tip) @ waves).real)

    def seen(self) -> NDArray[np.bool_]:
        """The modes (p,) that count: all but the highest, as far as these are `UNSEEN`."""
        tall = np.abs(self.Z) * np.linalg.norm(self.tip, axis=0)
        above = np.cumsum(tall[:, ::-1], axis=1)[:, ::-1]  # of a mode and all higher ones
        return np.asarray((above > UNSEEN * above[:, :1]).any(axis=0))

    def largest(self) -> Floats:
        """The largest |d| (n_T,) over time."""
        omega = np.abs(self.s[self.seen()])
        if not len(omega):
            return np.zeros(len(self.Z))
        step = 2.0 * np.pi / (PER_PERIOD * omega.max())
        t = np.arange(0.0, PERIODS * 2.0 * np.pi / omega.min() + step, step)
        rows = max(1, NUMBERS // (len(t) * len(self.tip)))
        parts = [self._replace(Z=self.Z[i : i + rows]) for i in range(0, len(self.Z), rows)]
        return np.concatenate([part._largest(t, step) for part in parts])

    def _largest(self, t: Floats, step: float) -> Floats:
        """By squares at times t, at finer ones beside the largest, and a parabola through three."""
        first = t[(self.at(t) ** 2).sum(axis=1).argmax(axis=1)]
        near = np.maximum(first[:, None] + np.linspace(-step, step, 2 * BETWEEN + 1), 0.0)
        waves = np.exp(self.s[:, None] * near[:, None])  # (n_T, p, n)
        squares = (((self.Z[:, None] * self.tip) @ waves).real ** 2).sum(axis=1)
        rows, k = np.arange(len(squares)), squares.argmax(axis=1)
        a, b, c = (squares[rows, np.clip(k + i, 0, 2 * BETWEEN)] for i in (-1, 0, 1))
        inner = (a < b) & (c < b)
        more = np.divide((a - c) ** 2, 8.0 * (2.0 * b - a - c), out=np.zeros_like(b), where=inner)
        return np.asarray(np.sqrt(b + more))


_BY_STEPS = "edges", "omega", "zeta", "phi", "still", "force", "tip"


@dataclass(frozen=True, eq=False)
class ReducedMove:
    """The move of one design over n steps, in p modes of each; last those of the end pose.

    r is the number of vectors in V, m that of directions of all nodes.
    """

    groups: tuple[slice, ...]
    edges: Floats  # τ (n + 1,)
    omega: Floats  # (n + 1, p) in rad/s
    zeta: Floats
    phi: Floats  # (n + 1, r, p)
    turn: Floats  # (n, 2, p, p) of η and of η̇ from the modes of a step to those of the next
    still: Floats  # (n, 4, r): w, ẇ and ẅ where a step begins, ẅ where it ends
    force: Floats  # (n, 3, p): ẇ, ẅ and ẅ of these in the modes
    steps: Floats  # (n + 1, 2, p): by how much w and ẇ jump, in the modes, after half a step of C
    blows: Floats  # (n + 1, p): by how much η̇ jumps with q̇, the same
    tip: Floats  # (n + 1, m, r): Vᵀb where a step begins

    def residuals(self, durations: ArrayLike, last: ArrayLike = 0.0) -> Floats:
        """The largest way (n_T, n_nodes) in m of each node from the stop on, for durations in s.

        With ``last`` (n_T,) also in that share of the move before the stop.
        """
        T = np.atleast_1d(np.asarray(durations, dtype=np.float64))
        free, near = self.free(T), np.asarray(last, dtype=np.float64)
        found = np.array([free._replace(tip=free.tip[own]).largest() for own in self.groups])
        if near.any():
            tau, error = self.errors(T, float(near.max()))
            there = tau >= 1.0 - np.broadcast_to(near, T.shape)[:, None]
            ways = (np.linalg.norm(error[..., own], axis=2) for own in self.groups)
            found = np.maximum(found, [(way * there).max(axis=1) for way in ways])
        return found.T

    def errors(self, durations: ArrayLike, last: float = 1.0) -> tuple[Floats, Floats]:
        """τ (n_t,), and the error of the tips while they move, (n_T, n_t, m) in m by directions.

        In the steps of the ``last`` share of the move.
        """
        T, first = np.atleast_1d(np.asarray(durations, dtype=np.float64)), 1.0 - last
        free, k = self.free(T), max(int(np.searchsorted(self.edges, first, "right")) - 1, 0)
        some = {name: getattr(self, name)[k:] for name in _BY_STEPS}
        return replace(self, **some)._errors(T, free, self._states(T)[k:])

    def _errors(self, T: Floats, free: Free, states: Floats) -> tuple[Floats, Floats]:
        h = np.diff(self.edges)[:, None]
        highest = np.abs(free.s[free.seen()]).max(initial=0.0)
        parts = 1 + int(PER_PERIOD * h.max() * T.max() * highest / (2.0 * np.pi))
        shares, found = np.arange(parts) / parts, []
        w, rate, push, _ = np.moveaxis(self.still, 1, 0)
        for share in shares:
            sigma = h * share
            P, offset = self._stepped(T, sigma)
            eta = (P[:, :, 0] * states[:-1]).sum(axis=2) + offset[:, :, 0]
            still = w + (rate + 0.5 * push * sigma) * sigma
            x = eta @ np.swapaxes(self.phi[:-1], 1, 2) - still[:, None] / T[:, None] ** 2
            tip = self.tip[:-1] + share * np.diff(self.tip, axis=0)
            found.append(x @ np.swapaxes(tip, 1, 2))  # (n, n_T, m)
        tau = np.append((self.edges[:-1, None] + h * shares).ravel(), 1.0)
        error = np.stack(found, axis=1).reshape(len(tau) - 1, len(T), -1)
        stopped = free.at(np.zeros(1))[..., 0]
        return tau, np.concatenate([error, stopped[None]]).swapaxes(0, 1)

    def free(self, T: Floats) -> Free:
        """The vibration from the stop on, after durations T (n_T,)."""
        eta, rate = np.moveaxis(self._states(T)[-1], 1, 0)
        omega, zeta = self.omega[-1], self.zeta[-1]
        s = omega * (-zeta + 1j * np.sqrt(1.0 - zeta**2))
        Z = eta - 1j * (rate / T[:, None] + zeta * omega * eta) / s.imag
        return Free(Z, s, self.tip[-1] @ self.phi[-1])

    def _states(self, T: Floats) -> Floats:
        """η and η̇ of z, (n + 1, n_T, 2, p), where each step begins, after its jump and half C."""
        P, offset = self._stepped(T, np.diff(self.edges)[:, None])
        states = self.steps[:, None] / T[:, None, None] ** 2
        states[:, :, 1] += self.blows[:, None]
        for k, turn in enumerate(self.turn):
            moved = (P[k] * states[k, :, None]).sum(axis=2) + offset[k]
            states[k + 1] += np.einsum("krs,nks->nkr", turn, moved)
        return states

    def _stepped(self, T: Floats, sigma: Floats) -> tuple[Floats, Floats]:
        """P (n, n_T, 2, 2, p) and c (n, n_T, 2, p): [η, η̇] becomes P [η, η̇] + c over σ (n, 1).

        η̈ + 2ζv η̇ + v²η = g_0 + g_1 σ + g_2 σ², v = ωT, has a solution a + bσ + cσ².
        """
        v, zeta = self.omega[:-1, None] * T[:, None], self.zeta[:-1, None]
        rate, push, end = np.moveaxis(self.force, 1, 0)[:, :, None] / T[:, None] ** 2
        bend = (end - push) / np.diff(self.edges)[:, None, None]
        c = zeta * bend / v
        b = (bend + 2.0 * zeta * v * (push - 2.0 * c)) / v**2
        a = (push + 2.0 * zeta * v * (rate - b) - 2.0 * c) / v**2
        t, root = sigma[..., None], v * np.sqrt(1.0 - zeta**2)
        fall = np.exp(-zeta * v * t)
        C, S = fall * np.cos(root * t), fall * np.sin(root * t) / root
        P = np.array([[C + zeta * v * S, S], [-(v**2) * S, C - zeta * v * S]])
        P = np.moveaxis(P, (0, 1), (2, 3))
        start = np.stack(np.broadcast_arrays(a, b), axis=2)
        end = np.stack([a + (b + c * t) * t, b + 2.0 * c * t], axis=2)
        return P, end - (P * start[:, :, None]).sum(axis=3)
