"""Is the motion slow? How much the neglected velocity terms would move the frequencies.

At an instant of the motion the free vibration obeys (s² M + s C + K + K_v) φ = 0. Projected on the
lowest modes of (K, M) this is a small quadratic eigenproblem; the shift of |Im s| against √λ is the
effect of C(q, q̇) and K_v that eq. (1) leaves out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.pencil import Pencil
from eigassign.mechanism.velocity import VelocityTerms
from eigassign.modal.exact import modes

Floats = NDArray[np.float64]
NEIGHBOURS = 6  # modes above the highest wanted one in the projection


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
    time_s: Floats,
    q: Floats,
    y: Floats,
    wanted: tuple[int, ...],
    instants: int = 15,
) -> MotionEffect:
    """Effect at the fastest instants of a trajectory q (n_t, n_q) at design y."""
    if len(time_s) < 3:
        return MotionEffect(np.zeros(0, dtype=np.intp), np.zeros((0, len(wanted))))
    rate = np.gradient(q, time_s, axis=0, edge_order=2)
    acceleration = np.gradient(rate, time_s, axis=0, edge_order=2)
    chosen = _fastest(rate, acceleration, instants)
    change = [_change(pencil, terms, q[k], y, rate[k], acceleration[k], wanted) for k in chosen]
    return MotionEffect(chosen, np.array(change).reshape(-1, len(wanted)))


def _fastest(rate: Floats, acceleration: Floats, count: int) -> NDArray[np.intp]:
    """Samples with the largest squared rate or acceleration, in order of time."""
    effort = np.abs(rate).max(axis=1) ** 2 + np.abs(acceleration).max(axis=1)
    spread = np.linspace(0, len(rate) - 1, min(count, len(rate))).round().astype(np.intp)
    top = np.argsort(-effort, kind="stable")[: max(1, count // 3)]
    return np.unique(np.concatenate([spread, top])).astype(np.intp)


def _change(
    pencil: Pencil,
    terms: VelocityTerms,
    q: Floats,
    y: Floats,
    rate: Floats,
    acceleration: Floats,
    wanted: tuple[int, ...],
) -> Floats:
    count = min(max(wanted) + NEIGHBOURS, len(pencil.elastic))
    found = modes(pencil, np.concatenate([q, y])[None], count)
    phi, lam = found.phi[0], found.lam[0]
    C, K_v = terms.at(q, y, rate, acceleration)
    moved = _quadratic(np.diag(lam) + phi.T @ (K_v @ phi), phi.T @ (C @ phi))
    still = np.sqrt(lam)
    return np.array([moved[k - 1] / still[k - 1] - 1.0 for k in wanted])


def _quadratic(K: Floats, C: Floats) -> Floats:
    """|Im s| of s² + s C + K, ascending: one per mode."""
    n = len(K)
    companion = np.block([[np.zeros((n, n)), np.eye(n)], [-K, -C]])
    frequencies = np.sort(np.abs(np.linalg.eigvals(companion).imag))
    return np.asarray(frequencies[::2])
