"""Is the motion slow? How much the neglected velocity terms would move the frequencies.

Along a motion the free vibration obeys M ü + C u̇ + (K + K_v) u = 0 with matrices that vary in time.
With all modes Φ(t) of (K, M), ΦᵀMΦ = I, and u = Φ η it becomes

    η̈ + C_η η̇ + K_η η = 0,   C_η = Φᵀ(C Φ + 2 M Φ̇),   K_η = Λ + Φᵀ(K_v Φ + C Φ̇ + M Φ̈),

where C_η is skew. With K_v counts the stiffness K_g of the loads −m a of the rigid motion, which is
of the same order in the speed: they stretch and compress the links. In a slow motion a vibration in
mode k has η_k = exp ∫ s dt, and the others follow by η_j = −i ω C_jk/(λ_j − λ_k) η_k. To second
order in the speed its phase, that of φ_kᵀMu, turns at

    Ω² = λ + φᵀ(K_v φ + C φ̇ + M φ̈) − λ Σ_j C_jk²/(λ_j − λ) + 5/16 (λ̇/λ)² − λ̈/(4 λ),

the last two because ṡ + s² + W = 0 has Ω² = W + ¾ (Ω̇/Ω)² − ½ Ω̈/Ω. The sum runs over all other
modes, the rigid ones too, and is one solution of the bordered system.

Modes that are near are followed as a subspace whose basis does not turn in itself. In it the small
problem s² + s C_η + K_η is solved, with the sum over all modes outside. Modes turn in that basis by

    W_jk = Λ̇_jk/(λ_k − λ_j),   so that C_η becomes C_η + 2 W and K_η becomes K_η + C_η W + W²,

as far as a vibration follows them: where modes veer faster than they beat, it does not, and keeps
its shape. What is left then is in `_following`; it goes from the square of the speed in slow
motions to the root of it in fast ones.

Φ(t) and Λ(t) with two derivatives in time come from the recursion in one variable, t. Its invariant
subspace X(t), K X = M X Λ_X with Φ0ᵀ M0 X = I, becomes mass-normalised as

    Φ = X N^(−1/2),   Λ = N^(1/2) Λ_X N^(−1/2),   N = XᵀMX,

in which Λ is symmetric and ΦᵀMΦ̇ at t = 0 too: the modes of a cluster do not turn into each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import sparse

from eigassign.arrays import Floats, Ints
from eigassign.mechanism.assembly.dynamics.under_load import StiffnessUnderLoad
from eigassign.mechanism.assembly.dynamics.velocity_terms import VelocityTerms
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.mechanism.trajectory.trajectory import Rates
from eigassign.modal.exact.dense import Modes
from eigassign.modal.exact.solver import (
    CLUSTER_GAP,
    LEAST_GAP,
    clusters,
    lowest_modes,
    whole_clusters,
)
from eigassign.modal.taylor.bordered import Solve
from eigassign.modal.taylor.rayleigh import inverse_root, quadratics
from eigassign.modal.taylor.recursion import expand_subspace
from eigassign.series.algebra import matrix_product
from eigassign.series.multi_index import lower_set, total_degree

# Relative distance in λ below which modes are followed together. Where two veered seven periods
# apart, the change was 35 % above the phase by integration from 0.3 on if each is followed alone,
# and 10 % from 0.5 on.
NEAR = 0.5
ABOVE = 4  # modes above the wanted ones among which near ones are sought


class MotionEffect(NamedTuple):
    """Relative change of each mode's frequency (n_instants, n_modes) at ``samples`` of the path."""

    samples: Ints
    change: Floats


def motion_effect(
    pencil: Pencil,
    terms: VelocityTerms,
    motion: Rates,
    y: Floats,
    wanted: tuple[int, ...],
    instants: int = 9,
    loads: StiffnessUnderLoad | None = None,
    gap: Floats | float = 1.0,
) -> MotionEffect:
    """Effect at the fastest instants of a motion at design y, with ``loads`` that of its forces.

    ``gap`` (m,) is how near the modes are at each instant: those where they are near come first. In
    the shipped cases the worst of nine is within 17 % of that of 45, of three within a factor of 3.
    """
    n = len(motion.samples)
    effort = np.abs(motion.rate).max(axis=1) ** 2 + np.abs(motion.acceleration).max(axis=1)
    spread = np.linspace(0, n - 1, min(instants, n)).round().astype(np.intp)
    top = [
        np.argsort(-e, kind="stable")[: max(1, instants // 3)] for e in (effort, effort / gap**3)
    ]
    at = np.unique(np.concatenate([spread, *top])).astype(np.intp)
    own = motion.q[at], motion.rate[at], motion.acceleration[at]
    return MotionEffect(motion.samples[at], change_at(pencil, terms, *own, y, wanted, loads))


def change_at(
    pencil: Pencil,
    terms: VelocityTerms,
    q: Floats,
    rate: Floats,
    acceleration: Floats,
    y: Floats,
    wanted: tuple[int, ...],
    loads: StiffnessUnderLoad | None = None,
) -> Floats:
    """Relative changes Ω/ω − 1 (n, n_modes) of the ``wanted`` modes for q, q̇ and q̈ (n, n_q)."""
    forces = None if loads is None else loads.in_motion(q, y, rate, acceleration)
    found = []
    for k in range(len(q)):
        theta = theta_in_time(pencil, q[k], rate[k], acceleration[k], y)
        C, K_v = terms.at(q[k], y, rate[k], acceleration[k])
        velocity = C, K_v if forces is None else K_v + forces[k]
        still, groups = _near_modes(pencil, theta[:, :1], wanted)
        changes: dict[int, float] = {}
        for group in groups:
            part = np.array(group) - 1
            lam = still.lam[0, part]
            moving = moving_modes(pencil, theta, lam, still.phi[0][:, part])
            moved = _frequencies(*_small_problem(pencil, theta, moving, *velocity))
            changes |= zip(group, (moved / np.sqrt(lam) - 1.0).tolist(), strict=True)
        found.append([changes[mode] for mode in wanted])
    return np.array(found).reshape(-1, len(wanted))


def _near_modes(
    pencil: Pencil, theta: Floats, wanted: tuple[int, ...]
) -> tuple[Modes, tuple[tuple[int, ...], ...]]:
    """Groups of modes that are followed together, cut above the wanted ones where it is widest."""
    top, found = max(wanted), lowest_modes(pencil, theta, max(wanted), ABOVE)
    lam = found.lam[0]
    above = np.diff(lam[top - 1 :]) / lam[top:]
    if above.max(initial=1.0) < CLUSTER_GAP:
        return whole_clusters(pencil, theta, wanted, CLUSTER_GAP)
    cut = top + int(above.argmax()) if len(above) else top
    return found, clusters(lam[:cut], wanted, NEAR)


def _small_problem(
    pencil: Pencil,
    theta: Floats,
    moving: MovingModes,
    C: sparse.csr_array,
    K_v: sparse.csr_array,
) -> tuple[Floats, Floats]:
    """K_η and C_η (r, r) of modes that are followed together, all others eliminated."""
    phi, phi_rate, phi_push = moving.phi
    M = pencil.sparse(pencil.mass @ theta[:, 0])
    c = C @ phi + 2.0 * (M @ phi_rate)
    lam, solved = np.diag(moving.lam[0]), zip(moving.solvers, c.T, strict=True)
    z = [solve(column[None].copy())[0][0] for solve, column in solved]  # Σ_j φ_j C_jk / (λ_j − λ_k)
    others = lam * (c.T @ np.array(z).T)
    own, W = phi.T @ c, _turning(moving)
    K = moving.lam[0] + phi.T @ (K_v @ phi + C @ phi_rate + M @ phi_push) + own @ W + W @ W
    _, rate, push = moving.lam  # that the amplitude changes moves the phase
    rate, push = np.diag(rate) / lam, np.diag(push + 2.0 * rate @ W) / lam
    return K - 0.5 * (others + others.T) + np.diag(0.3125 * rate**2 - 0.25 * push), own + 2.0 * W


def _frequencies(K: Floats, C: Floats) -> Floats:
    """|Im s| of s² + s C + K, ascending: one per mode."""
    n = len(K)
    companion = np.block([[np.zeros((n, n)), np.eye(n)], [-K, -C]])
    frequencies = np.sort(np.abs(np.linalg.eigvals(companion).imag))
    return np.asarray(frequencies[::2])


# --- Near modes that veer

SIGMA_X, SIGMA_Y = np.array([[0, 1], [1, 0]]), np.array([[0, -1j], [1j, 0]])
SIGMA_Z = np.array([[1, 0], [0, -1]])
FOLLOWED = 8.0  # of ‖(x, γ)‖: from there on `_following` is 1 to 15/8⁴, 0.4 %


def _turning(moving: MovingModes) -> Floats:
    """W (r, r), skew: how fast modes turn into each other, as far as a vibration follows.

    With D the distance of two modes in rad/s and F of `_following` the frequencies part by
    e = W² F/D more, as they do where s² + 2 s W turns steadily by √(e (e + D)).
    """
    lam, rate, _ = moving.lam
    omega = np.sqrt(np.diag(lam))
    W = np.zeros_like(lam)
    for j, k in zip(*np.triu_indices(len(lam), 1), strict=True):
        apart = omega[k] - omega[j]
        mixing = rate[j, k] / np.sqrt(omega[j] * omega[k])
        parting = 0.5 * (rate[k, k] / omega[k] - rate[j, j] / omega[j])
        if mixing == 0.0 or apart <= LEAST_GAP * omega[k]:
            continue
        scale = apart / np.hypot(mixing, parting) ** 1.5
        turn = rate[j, k] / (omega[k] ** 2 - omega[j] ** 2)
        e = turn**2 / apart * _following(abs(parting) * scale, abs(mixing) * scale)
        W[j, k] = np.sign(turn) * np.sqrt(e * (e + apart))
    return np.asarray(W - W.T)


def _following(x: float, gamma: float) -> float:
    """F: the part of θ̇²/D by which a veering moves the phase of a mode, 1 where that is slow.

    Landau and Zener: ȧ = −i H a, 2 H = [[x, γ], [γ, −x]] with x the time before modes are nearest,
    in 1/√α where they approach at α rad/s², and γ√α their least distance. Integrated from x + 12
    before, where a vibration follows the lower mode, v; w is the upper one, D² = x² + γ². The phase
    of vᵀa turns by θ̇ Im(wᵀa/vᵀa), θ̇ = γ/(2 D²).
    """
    apart = float(np.hypot(x, gamma))
    if apart > FOLLOWED:
        return 1.0
    ends, h = np.linspace(-x - 12.0, -x, 1025, retstep=True)
    s = 0.5 * (ends[1:] + ends[:-1])[:, None, None]
    D = np.hypot(s, gamma)
    angle, H = 0.5 * h * D, (s * SIGMA_Z + gamma * SIGMA_X) / D
    steps = np.cos(angle) * np.eye(2) - 1j * np.sin(angle) * H
    while len(steps) > 1:
        steps = steps[1::2] @ steps[::2]
    start, end = (t * SIGMA_Z + gamma * SIGMA_X for t in ends[[0, -1]])
    turning = gamma / (ends[0] ** 2 + gamma**2) * SIGMA_Y
    w_and_v = np.linalg.eigh(end)[1][:, ::-1]
    a = steps[0] @ np.linalg.eigh(start + turning)[1][:, 0]
    upper, lower = w_and_v.T @ a
    return float(abs((upper / lower).imag) * 2.0 * apart**3 / gamma)


# --- Modes along a motion, with two derivatives in time

IN_TIME = total_degree(1, 2)
IN_TWO = lower_set([[0, 0], [1, 0], [0, 1], [2, 0]])  # t and t² as variables of their own


@dataclass(frozen=True, eq=False)
class MovingModes:
    """Modes (n_dof, r) that are followed together: value, rate and acceleration at one instant."""

    phi: Floats  # (3, n_dof, r): Φ, Φ̇, Φ̈
    lam: Floats  # (3, r, r): Λ, Λ̇, Λ̈
    solvers: Sequence[Solve]  # the bordered system of each


def theta_in_time(
    pencil: Pencil, q: Floats, rate: Floats, acceleration: Floats, y: Floats
) -> Floats:
    """θ, θ̇ and θ̈/2 (n_theta, 3) along q + q̇ t + q̈ t²/2."""
    directions = pencil.to_program[:, : len(q)] @ np.stack([rate, 0.5 * acceleration], axis=1)
    theta = pencil.theta_series(IN_TWO, np.concatenate([q, y]), directions)
    one, t, apart, squared = IN_TWO.find(np.array([[0, 0], [1, 0], [0, 1], [2, 0]]))
    return np.stack([theta[:, one], theta[:, t], theta[:, apart] + theta[:, squared]], axis=1)


def moving_modes(pencil: Pencil, theta: Floats, lam: Floats, phi: Floats) -> MovingModes:
    """The motion of λ (r,) and Φ (n_dof, r), mass-normalised, for θ of `theta_in_time`."""
    found = expand_subspace(pencil, theta, IN_TIME, lam, phi)
    X, L = (np.moveaxis(series, 0, 2) for series in (found.vectors, found.values))
    N = quadratics(pencil, theta, IN_TIME, IN_TIME, found.vectors)[1]
    down = inverse_root(IN_TIME, N)
    up = matrix_product(IN_TIME, N, down)
    Lambda = matrix_product(IN_TIME, matrix_product(IN_TIME, up, L), down)
    phi_t, lam_t = (
        np.moveaxis(series * [1.0, 1.0, 2.0], 2, 0)
        for series in (matrix_product(IN_TIME, X, down), Lambda)
    )
    return MovingModes(phi_t, lam_t, found.solvers)
