"""Is the motion slow? How much the neglected velocity terms would move the frequencies.

Along a motion the free vibration obeys M ü + C u̇ + (K + K_v) u = 0 with matrices that vary in time.
With all modes Φ(t) of (K, M), ΦᵀMΦ = I, and u = Φ η it becomes

    η̈ + C_η η̇ + K_η η = 0,   C_η = Φᵀ(C Φ + 2 M Φ̇),   K_η = Λ + Φᵀ(K_v Φ + C Φ̇ + M Φ̈),

where C_η is skew. In a slow motion a vibration in mode k has η_k = exp ∫ s dt, and the others
follow by η_j = −i ω C_jk/(λ_j − λ_k) η_k. To second order in the speed its phase, that of φ_kᵀMu,
turns at

    Ω² = λ + φᵀ(K_v φ + C φ̇ + M φ̈) − λ Σ_j C_jk²/(λ_j − λ) + 5/16 (λ̇/λ)² − λ̈/(4 λ),

the last two because ṡ + s² + W = 0 has Ω² = W + ¾ (Ω̇/Ω)² − ½ Ω̈/Ω. The sum runs over all other
modes, the rigid ones too, and is one solution of the bordered system.

Where near modes mix, Σ_j |η_j|² no longer small, their subspace is followed as a whole and the same
terms are small matrices; as it may leave any of them in any other, their distance counts as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.mechanism.pencil import Pencil
from eigassign.mechanism.rates import Rates
from eigassign.mechanism.velocity import VelocityTerms
from eigassign.modal.clusters import CLUSTER_GAP, whole_clusters
from eigassign.modal.coefficients import pencil_series
from eigassign.modal.moving import IN_TIME, MovingModes, moving_modes, theta_in_time

Floats = NDArray[np.float64]
MIXED = 0.05  # Σ_j |η_j|² from which on a mode is followed together with its near neighbours


@dataclass(frozen=True)
class MotionEffect:
    """Relative change of each mode's frequency (n_instants, n_modes) at ``samples`` of the path."""

    samples: NDArray[np.intp]
    change: Floats

    @property
    def worst(self) -> float:
        """Largest magnitude over instants and modes."""
        return float(np.abs(self.change).max(initial=0.0))


def motion_effect(
    pencil: Pencil,
    terms: VelocityTerms,
    motion: Rates,
    y: Floats,
    wanted: tuple[int, ...],
    instants: int = 15,
) -> MotionEffect:
    """Effect at the fastest instants of a motion at design y."""
    chosen = _fastest(motion, instants)
    found = [
        change_at(pencil, terms, motion.q[k], motion.rate[k], motion.acceleration[k], y, wanted)
        for k in chosen
    ]
    return MotionEffect(motion.samples[chosen], np.array(found).reshape(-1, len(wanted)))


def _fastest(motion: Rates, count: int) -> NDArray[np.intp]:
    """Places spread over the motion and those of largest squared rate or acceleration, in order."""
    n = len(motion.samples)
    effort = np.abs(motion.rate).max(axis=1) ** 2 + np.abs(motion.acceleration).max(axis=1)
    spread = np.linspace(0, n - 1, min(count, n)).round().astype(np.intp)
    top = np.argsort(-effort, kind="stable")[: max(1, count // 3)]
    return np.unique(np.concatenate([spread, top])).astype(np.intp)


def change_at(
    pencil: Pencil,
    terms: VelocityTerms,
    q: Floats,
    rate: Floats,
    acceleration: Floats,
    y: Floats,
    wanted: tuple[int, ...],
) -> Floats:
    """Relative change Ω/ω − 1 of the ``wanted`` modes (n_modes,) for q, q̇ and q̈ (n_q,)."""
    theta = theta_in_time(pencil, q, rate, acceleration, y)
    velocity = terms.at(q, y, rate, acceleration)
    alone = _changes(pencil, theta, velocity, wanted, 0.0)
    mixing = tuple(k for k in wanted if k not in alone)
    together = _changes(pencil, theta, velocity, mixing, CLUSTER_GAP) if mixing else {}
    return np.array([alone.get(k, together.get(k)) for k in wanted], dtype=np.float64)


def _changes(
    pencil: Pencil,
    theta: Floats,
    velocity: tuple[sparse.csr_array, sparse.csr_array],
    wanted: tuple[int, ...],
    gap: float,
) -> dict[int, float]:
    """Of the wanted modes in clusters by ``gap``; at no gap only of those that do not mix."""
    found, groups = whole_clusters(pencil, theta[:, :1], wanted, gap)
    changes: dict[int, float] = {}
    for group in groups:
        part = np.array(group) - 1
        moving = moving_modes(pencil, theta, found.lam[0, part], found.phi[0][:, part])
        moved, mixed = _moved(pencil, theta, moving, *velocity)
        if mixed < MIXED or gap > 0.0:
            changes |= zip(group, _relative(moved, np.sqrt(found.lam[0, part])), strict=True)
    return changes


def _relative(moved: Floats, still: Floats) -> list[float]:
    """Ω/ω − 1, of a cluster with the distance of its modes if that is more."""
    change = moved / still - 1.0
    apart = np.ptp(still) / still
    return [float(v) for v in np.where(np.abs(change) < apart, apart, change)]


def _moved(
    pencil: Pencil,
    theta: Floats,
    moving: MovingModes,
    C: sparse.csr_array,
    K_v: sparse.csr_array,
) -> tuple[Floats, float]:
    """Ω (r,) ascending, and the largest Σ_j |η_j|² over modes j outside the cluster."""
    phi, phi_rate, phi_push = moving.phi
    M = pencil.sparse(pencil.mass @ theta[:, 0])
    c = C @ phi + 2.0 * (M @ phi_rate)
    lam = float(np.trace(moving.lam[0])) / phi.shape[1]
    border = np.ascontiguousarray((M @ phi).T)
    solve = pencil_series(pencil, theta, IN_TIME).factor(lam, border, phi.T)
    z = solve(np.ascontiguousarray(c.T))[0].T  # Σ_j φ_j C_jk / (λ_j − λ)
    mixed = lam * float(np.einsum("ik,ik->k", z, M @ z).max())
    K = moving.lam[0] + phi.T @ (K_v @ phi + C @ phi_rate + M @ phi_push) - lam * c.T @ z
    return _turning(K + _growth(moving, lam), phi.T @ c), mixed


def _growth(moving: MovingModes, lam: float) -> Floats:
    """5/16 (λ̇/λ)² − λ̈/(4 λ): that the amplitude changes moves the phase."""
    _, rate, push = moving.lam
    return np.asarray(0.3125 * rate @ rate / lam**2 - 0.25 * push / lam)


def _turning(K: Floats, C: Floats) -> Floats:
    """|Im s| of s² + s C + K, ascending: one per mode."""
    n = len(K)
    companion = np.block([[np.zeros((n, n)), np.eye(n)], [-K, -C]])
    frequencies = np.sort(np.abs(np.linalg.eigvals(companion).imag))
    return np.asarray(frequencies[::2])
