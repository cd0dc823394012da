"""A mechanism in motion as points with masses, and the whole of it integrated in time."""

from typing import Any

import numpy as np
from calibration import Floats
from scipy.integrate import simpson
from scipy.interpolate import CubicSpline
from scipy.linalg import eigh

import eigassign as ea
from eigassign.mechanism import inertia_forces, shapes

ZETA, STEPS = 0.01, 2400  # (ωh)²/12 · ωT = 7e-4 of a turn by the trapezoidal rule
REFLECTED = np.array([4e-5 * 80**2, 2e-5 * 50**2])


def first(case: ea.Case) -> Any:
    return case.trajectories[0].trajectory


class Matter:
    """Points with masses along beams and of bodies; in a plane angles turn bodies."""

    def __init__(
        self, case: ea.Case, y: Floats, per_length: dict[str, float], driven: Floats | float = 0.0
    ) -> None:
        self.model, self.y, self.per_length, self.driven = case.model(), y, per_length, driven
        self.bodies = list(case.file.mechanism.bodies.values())
        self.planar = case.file.mechanism.space == "planar"
        self.moving, self.T = first(case).motion.moving, float(first(case).time_s[-1])

    def seen(self, q: Floats, phi: Floats) -> tuple[list[Floats], list[Floats], list[float]]:
        """Of all masses places (d,) and motions (count, d), and how much they are."""
        found = shapes(self.model.poses, self.model.x(q, self.y), phi[None])[0]
        places, motions, masses = [], [], []
        for strand in found.strands:
            at = np.linalg.norm(strand.places - strand.places[0], axis=1)
            masses += list(simpson(np.eye(len(at)), x=at) * self.per_length.get(strand.link, 0.0))
            places += list(strand.places)
            motions += list(strand.motions.swapaxes(0, 1))
        for body in self.bodies:
            link, node = body.at.split(".")
            own, d = found.nodes[link, node], 2 if self.planar else 3
            masses.append(body.mass)
            places.append(own.place[:d])
            motions.append(own.motion[:, :d])
            if self.planar:  # its turning is one more place
                line = next(strand.places for strand in found.strands if strand.link == link)
                masses.append(body.inertia or 0.0)
                places.append(np.array([np.arctan2(*(line[-1] - line[0])[::-1]), 0.0]))
                motions.append(np.stack([own.motion[:, 5], 0.0 * own.motion[:, 5]], axis=1))
        return places, motions, masses

    def force(self, tau: float) -> Floats:
        """Σ motionᵀ m place¨, by differences over 1e-3 T: 1e-5 of what goes like sin(3 t/T)."""
        h, n = 1e-3 * self.T, self.model.n_dof
        q = self.moving(tau * self.T + h * np.array([-1.0, 0.0, 1.0]), self.y).q
        before, here, after = (self.seen(each, np.eye(n)) for each in q)
        f = np.zeros(n)
        for a, b, c, motion, mass in zip(before[0], here[0], after[0], *here[1:], strict=True):
            f += mass * (motion @ (a - 2.0 * b + c)) / h**2
        f[self.model.pencil.n_u :] += self.driven * (q[0] - 2.0 * q[1] + q[2]) / h**2
        return f

    def velocity(self, tau: float) -> Floats:
        """2 Σ m motion (motion˙)ᵀ: Coriolis forces of what moves on a pose that changes."""
        h, n = 1e-3 * self.T, self.model.n_dof
        q = self.moving(tau * self.T + h * np.array([-1.0, 0.0, 1.0]), self.y).q
        before, here, after = (self.seen(each, np.eye(n)) for each in q)
        C = np.zeros((n, n))
        for a, motion, c, mass in zip(before[1], here[1], after[1], here[2], strict=True):
            C += mass * motion @ (c - a).T / h
        return C

    def off(self, tau: float) -> float:
        """How far f is from that, by the energy of what it bends, relative to the largest."""
        own = inertia_forces(self.model.poses.case, self.model.poses.parameters, self.model.motion)
        q, rate, push = self.moving(np.array([tau * self.T]), self.y)
        difference = own.at(q, self.y, rate, push)[0] - (f := self.force(tau))
        K = self.model.matrices(q, self.y)[1]
        size = [each @ np.linalg.solve(K, each) for each in (difference, f)]
        return float(np.sqrt(size[0] / size[1]))


def box(width: float, height: float, t: float) -> float:
    return 2700.0 * (width * height - (width - 2.0 * t) * (height - 2.0 * t))


def whole_scara(case: ea.Case, y: Floats, height: float = 0.06) -> Matter:
    lines = {"upper_arm": box(0.08, height, 0.004), "forearm": box(0.06, 0.045, 0.003)}
    return Matter(case, y, lines, REFLECTED)


def left(matter: Matter, durations: Floats, forces: int = 61) -> Floats:
    """The way of the tip after the stop, (n_T, 2, n_t): M ẍ + Cẋ + Kx = −f by Newmark, all dofs."""
    model, y, tau = matter.model, matter.y, np.linspace(0.0, 1.0, STEPS + 1)
    few = np.linspace(0.002, 0.998, forces)
    # beyond 0.002 the quintic runs out as it began: 2e-4 of f
    f = CubicSpline(few, [matter.force(each) * matter.T**2 for each in few])(tau)
    turning = CubicSpline(few, [matter.velocity(each) * matter.T for each in few])(tau)
    T, n = durations[:, None], model.n_dof
    h = T / STEPS
    x, v = np.zeros((2, len(T), n))
    a = -np.linalg.solve(model.matrices(matter.moving(np.zeros(1), y).q, y)[0], f[0]) / T**2
    for k, q in enumerate(matter.moving(tau * matter.T, y).q[1:], 1):
        M, K = model.matrices(q, y)
        lam, phi = eigh(K, M)
        C = (M @ phi) * (2.0 * ZETA * np.sqrt(lam)) @ (M @ phi).T
        x, v = x + h * v + 0.25 * h**2 * a, v + 0.5 * h * a
        C = C + turning[k] / T[..., None]
        A = M + 0.5 * h[..., None] * C + 0.25 * h[..., None] ** 2 * K
        a = np.linalg.solve(A, (-f[k] / T**2 - x @ K)[..., None] - C @ v[..., None])[..., 0]
        x, v = x + 0.25 * h**2 * a, v + 0.5 * h * a
    omega = np.sqrt(lam)
    s = omega * (-ZETA + 1j * np.sqrt(1.0 - ZETA**2))
    eta, rate = x @ M @ phi, v @ M @ phi
    Z = eta - 1j * (rate + ZETA * omega * eta) / s.imag
    tip = shapes(model.poses, model.x(q, y), phi[None])[0].nodes["forearm", "end"].motion[:, :2]
    waves = np.exp(s[:, None] * np.linspace(0.0, 0.3, 6001))
    return np.asarray((np.einsum("ti,id->tdi", Z, tip) @ waves).real)


def largest(matter: Matter, durations: Floats, forces: int = 61) -> Floats:
    return np.asarray(np.linalg.norm(left(matter, durations, forces), axis=1).max(axis=1))
