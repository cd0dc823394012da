"""Sampled motions for tests, and the linear equations of a motion integrated in time."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from scipy.interpolate import CubicSpline
from scipy.linalg import eigh
from spatial_cases import Built

from eigassign.mechanism import Trajectory, rates, velocity_terms
from eigassign.modal import modes

ROOT = np.sqrt(15.0)
GAUSS = np.array([0.5 - ROOT / 10, 0.5, 0.5 + ROOT / 10])
STAGES = np.array(
    [
        [5 / 36, 2 / 9 - ROOT / 15, 5 / 36 - ROOT / 30],
        [5 / 36 + ROOT / 24, 2 / 9, 5 / 36 - ROOT / 24],
        [5 / 36 + ROOT / 30, 2 / 9 + ROOT / 15, 5 / 36],
    ]
)
WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18


def timed(time_s: np.ndarray, q: np.ndarray) -> Any:
    """The rates of plain samples."""
    return rates(Trajectory(np.array(time_s, float), np.array(q, float)))


class RestToRest:
    """q = start + move (35τ⁴ − 84τ⁵ + 70τ⁶ − 20τ⁷), and M, C, K and K_v for a duration of 1 s.

    Velocity, acceleration and jerk vanish at both ends; C goes as 1/T, K_v as 1/T², with ``loads``
    that of the forces of the motion. In a basis V (n_dof, r) of ``kept`` modes of nine poses, or of
    all unknowns.
    """

    law = np.poly1d([-20.0, 70.0, -84.0, 35.0, 0.0, 0.0, 0.0, 0.0])

    def __init__(
        self,
        model: Built,
        start: list[float],
        move: list[float],
        n: int = 48,
        kept: int = 0,
        loads: Any = None,
    ) -> None:
        self.model, self.start, self.move = model, np.array(start), np.array(move)
        terms = velocity_terms(model.case, model.numbers, model.motion)
        self.V = V = self._basis(kept) if kept else np.eye(model.pencil.n_dof)
        self.shape = (V.shape[1],) * 2
        x = np.cos(np.pi * (np.arange(n) + 0.5) / n)
        rows = []
        for tau in (x + 1.0) * 0.5:
            q, rate, push = self.at(tau)
            K, M = model.pencil.matrices(model.pencil.theta(model.x(q)))
            C, K_v = terms.at(q, model.y, rate, push)
            if loads is not None:
                K_v = K_v + loads.in_motion(q[None], model.y, rate[None], push[None])[0]
            rows.append([V.T @ A @ V for A in (M[0], C, K[0], K_v)])
        self.series = np.linalg.solve(chebyshev.chebvander(x, n - 1), np.reshape(rows, (n, -1)))

    def _basis(self, kept: int) -> np.ndarray:
        """The lowest modes of nine poses and all rigid ones, M-orthonormal at none of them."""
        pencil = self.model.pencil
        phi = modes(pencil, self.x(np.linspace(0.0, 1.0, 9)), kept).phi
        rigid = np.eye(pencil.n_dof)[:, pencil.n_u :]
        V = np.hstack([rigid, *(each / np.linalg.norm(each, axis=0) for each in phi)])
        U, sizes, _ = np.linalg.svd(V, full_matrices=False)
        return np.asarray(U[:, sizes > 1e-6 * sizes[0]])

    def still(self, tau: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        """ω (n, count) and φ (n, r, count) of the elastic modes in the basis."""
        M, _, K = self.matrices(tau, np.inf)
        n_rigid = self.model.pencil.n_dof - self.model.n_elastic
        pairs = [
            eigh(k, m, subset_by_index=(0, n_rigid + count - 1)) for k, m in zip(K, M, strict=True)
        ]
        lam, phi = (np.array(each)[..., n_rigid:] for each in zip(*pairs, strict=True))
        return np.sqrt(lam), phi

    def at(self, tau: float, duration: float = 1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, q̇ and q̈ at τ = t / T."""
        place, rate, push = (p(tau) for p in (self.law, self.law.deriv(), self.law.deriv(2)))
        move = self.move
        return self.start + move * place, move * rate / duration, move * push / duration**2

    def x(self, tau: np.ndarray) -> np.ndarray:
        return self.model.x(self.start + np.multiply.outer(self.law(tau), self.move))

    def matrices(self, tau: np.ndarray, duration: float) -> list[np.ndarray]:
        """M, C and K + K_v at several τ, by Chebyshev interpolation."""
        basis = chebyshev.chebvander(2.0 * tau - 1.0, len(self.series) - 1)
        M, C, K, K_v = np.moveaxis((basis @ self.series).reshape(-1, 4, *self.shape), 1, 0)
        return [M, C / duration, K + K_v / duration**2]


class Phase(NamedTuple):
    """What a vibration that starts in one mode does: its phase φᵀMu, and ω of that mode."""

    total: float  # rad beyond ∫ ω dt
    beyond: Callable[[np.ndarray], np.ndarray]  # phase rate less ω, rad/s, at times


def integrated(motion: RestToRest, duration: float, mode: int, per_period: int = 24) -> Phase:
    """M ü + C u̇ + (K + K_v) u = 0 by Gauss' method of sixth order, from u = φ, u̇ = i ω φ."""
    omega, phi = (each[0, ..., -1] for each in motion.still(np.zeros(1), mode))
    n = int(duration * omega / (2 * np.pi) * per_period)
    tau = np.linspace(0.0, 1.0, n + 1)
    states = _states(motion, tau, duration, np.concatenate([phi, 1j * omega * phi]))
    along, phi_t = (each[..., -1] for each in motion.still(tau, mode))
    M = motion.matrices(tau, duration)[0]
    seen = np.einsum("ki,kij,kj->k", phi_t, M, states[:, : len(phi)])
    turns = np.sign(np.einsum("ki,kij,kj->k", phi_t[:-1], M[1:], phi_t[1:]))
    angle = np.unwrap(np.angle(seen * np.concatenate([[1.0], np.cumprod(turns)])))
    still = CubicSpline(tau * duration, along)
    turning = CubicSpline(tau * duration, angle).derivative()
    total = angle[-1] - angle[0] - still.integrate(0.0, duration)
    return Phase(float(total), lambda t: turning(t) - still(t))


def _states(motion: RestToRest, tau: np.ndarray, duration: float, start: np.ndarray) -> np.ndarray:
    """[u; u̇] at all times, each step by its propagator I + h Σ b_i k_i."""
    h, size, states = (tau[1] - tau[0]) * duration, len(start), [start]
    eye = np.eye(size)
    for begin in range(0, len(tau) - 1, 200):
        at = (tau[begin:-1][:200, None] + (tau[1] - tau[0]) * GAUSS).ravel()
        M, C, K = motion.matrices(at, duration)
        A = np.zeros((len(at), size, size))
        A[:, : size // 2, size // 2 :] = np.eye(size // 2)
        A[:, size // 2 :] = -np.linalg.solve(M, np.concatenate([K, C], axis=2))
        A = A.reshape(-1, 3, size, size)
        mixed = np.einsum("ij,kiab->kiajb", STAGES, A).reshape(len(A), 3 * size, 3 * size)
        slopes = np.linalg.solve(np.eye(3 * size) - h * mixed, A.reshape(len(A), 3 * size, size))
        slopes = slopes.reshape(len(A), 3, size, size)
        for P in eye + h * np.einsum("i,kiab->kab", WEIGHTS, slopes):
            states.append(P @ states[-1])
    return np.array(states)
