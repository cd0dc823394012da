"""Residual vibration: closed forms, forces of inertia by differences, and the whole integrated."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from calibration import Floats
from numpy.polynomial import Polynomial
from scipy.integrate import simpson, solve_ivp
from scipy.interpolate import CubicSpline
from scipy.linalg import eigh

import eigassign as ea
from eigassign.errors import MechanismError
from eigassign.mechanism import Moving, inertia_forces, known_motion, shapes, timing_law
from eigassign.modal import FINER, Damping, Move, Sizes, dampings, move

CASES = Path(__file__).parents[2] / "cases"
AXES = ((1.0, 0.0), (0.0, 1.0))


def first(case: ea.Case) -> Any:
    return case.trajectories[0].trajectory


# --- one degree of freedom

HZ, REACH, TURN = 7.0, 0.8, 0.6
STIFFNESS = 3.0 * REACH**2 * (2.0 * np.pi * HZ) ** 2
ARM = """\
title: A rigid arm with a mass at its end, on a drive of 7 Hz
mechanism:
  space: planar
  links: {a: {type: rigid, nodes: {hub: [0, 0], end: [0.8, 0]}}}
  joints: {hub: {type: revolute, base: ground, follower: a.hub}}
  bodies: {m: {at: a.end, mass: 3}}
coordinates: {q: {joint: hub}}
trajectory: {points: [[0.2], [0.8]], duration: 0.3 s, samples: 21}
targets: [{mode: 1, at_least: 1 Hz}]
"""


def arm(law: str = "quintic", drive: Any = None) -> ea.Case:
    tree = yaml.safe_load(ARM)
    tree["coordinates"]["q"]["drive"] = drive or {"stiffness": STIFFNESS}
    tree["trajectory"]["timing"] = law
    return ea.load_case(tree)


def of_arm(case: ea.Case, zeta: float = 0.0) -> Move:
    return move(case.model(), first(case), {"a.end": AXES}, Damping((zeta,)))


def duhamel(law: str, T: float, zeta: float) -> float:
    """The largest |x| REACH from the stop on, ẍ + 2ζω ẋ + ω²x = −q̈, x = Re Z exp(st) there.

    ∫ p(t) exp(−st) dt = −exp(−st) Σ_k p⁽ᵏ⁾/s^(k+1) over each piece, and blows by q̇.
    """
    w = 2.0 * np.pi * HZ
    s = w * (-zeta + 1j * np.sqrt(1.0 - zeta**2))
    curve, total = timing_law(law), 0.0j
    for k, (a, b) in enumerate(pairwise(curve.knots * T)):
        place = Polynomial(curve.coefficients[:, k, 0] * TURN)(Polynomial([-a / T, 1.0 / T]))
        push = place.deriv(2)
        for t, sign in ((a, 1.0), (b, -1.0)):
            each = sum(push.deriv(j)(t) / s ** (j + 1) for j in range(push.degree() + 1))
            blow = place.deriv()(t) if law == "linear" else 0.0
            total -= sign * np.exp(s * (T - t)) * (each + blow)
    Z = total / (1j * s.imag)
    # where ẋ = Re(s Z exp(st)) = 0, and at the stop itself
    t = (np.pi / 2 - np.angle(s * Z)) % np.pi / s.imag
    return float(max(abs((Z * np.exp(s * each)).real) for each in (0.0, t))) * REACH


@pytest.mark.parametrize("zeta", [0.0, 0.05])
@pytest.mark.parametrize("law", ["quintic", "cubic", "trapezoidal", "linear"])
def test_one_mode_is_duhamels_integral(law: str, zeta: float) -> None:
    durations = np.linspace(0.1, 0.9, 23)
    found = of_arm(arm(law), zeta).at([]).residuals(durations)[:, 0]
    exact = np.array([duhamel(law, T, zeta) for T in durations])
    # 1e-9 before and behind a break is 1e-7 of what jumps there
    np.testing.assert_allclose(found, exact, rtol=0.0, atol=1e-6 * exact.max())


@pytest.mark.parametrize(
    ("law", "periods"),
    [("trapezoidal", (1.5, 3.0)), ("cubic", (1.4302967,)), ("quintic", (1.834566,))],
)
def test_no_vibration_is_left_between_the_lobes(law: str, periods: tuple[float, ...]) -> None:
    """x = ωT/2: sin(x/3) sin(2x/3) = 0 of two pulses; tan x = x; tan x = 3x/(3 − x²)."""
    found = of_arm(arm(law)).at([]).residuals(np.array(periods) / HZ)
    assert found.max() < 1e-6 * duhamel(law, 1.0 / HZ, 0.0)


def test_a_command_in_two_halves_half_a_period_apart_leaves_nothing() -> None:
    """A motion that is known at times only, with its jumps of q̈ twice; whole it leaves 9 mm."""
    case, delay = arm("trapezoidal"), 0.5 / HZ
    own = first(case)
    tau = np.array([0.0, 0.1, 0.2, 0.3])
    time_s = np.repeat(np.union1d(tau, tau + delay), 2)
    beside = time_s + np.tile([-1e-12, 1e-12], len(time_s) // 2)
    halves = []
    for start in (0.0, delay):
        t = np.clip(beside - start, 0.0, 0.3)
        moving = own.motion.moving(t)
        rests = (t == 0.0) | (t == 0.3)
        still = [np.where(rests[:, None], 0.0, each) for each in moving[1:]]
        halves.append([moving.q, *still])
    whole = Moving(*(0.5 * (a + b) for a, b in zip(*halves, strict=True)))
    ends = slice(1, -1)
    shaped = known_motion(time_s[ends], Moving(*(each[ends] for each in whole)))
    ran = replace(own, time_s=np.unique(time_s), q=shaped.poses(np.unique(time_s)), known=shaped)
    left = move(case.model(), ran, {"a.end": AXES}).at([]).residuals(0.3 + delay)[0, 0]
    assert left < 1e-5 * of_arm(case).at([]).residuals(0.3)[0, 0]


def test_a_motion_that_is_known_at_times_is_the_quintic_through_them() -> None:
    own = first(arm()).motion
    time_s, between = np.array([0.0, 0.07, 0.3]), np.linspace(0.0, 0.3, 9)
    again = known_motion(time_s, own.moving(time_s)).moving(between)
    for found, exact in zip(again, own.moving(between), strict=True):
        np.testing.assert_allclose(found, exact, rtol=0.0, atol=1e-12 * np.abs(exact).max())


def test_a_drive_that_loses_vibrates_by_half_of_its_loss_factor() -> None:
    case = arm(drive={"stiffness": STIFFNESS, "loss_factor": 0.1})
    (damping,) = dampings(case.model())
    found = move(case.model(), first(case), {"a.end": AXES}, damping).at([]).residuals(0.2)[0, 0]
    assert found == pytest.approx(duhamel("quintic", 0.2, 0.05), rel=1e-6)


def test_a_slow_move_leaves_the_tip_where_the_forces_hold_it() -> None:
    """x = −K⁻¹f in 10 s, but for what vibrates, 9e-5 of the largest; with one mode of each pose."""
    case, slow = scara(), 0.25 / 10.0
    own, model, y = of_scara(case), case.model(), case.initial_design
    tau, error = own.at(y, Sizes(modes=1)).errors(10.0)
    for k in np.searchsorted(tau, (0.2, 0.37, 0.8)):
        q, rate, push = first(case).motion.moving(0.25 * tau[k : k + 1])
        f = own.inertia.at(q, y, slow * rate, slow**2 * push)[0]
        x = -np.linalg.solve(model.matrices(q, y)[1], f)[:, None]
        tip = shapes(model.poses, model.x(q, y), x[None])[0].nodes["forearm", "end"]
        np.testing.assert_allclose(error[0, k], tip.motion[0, :2], atol=3e-4 * np.abs(error).max())


def test_a_blow_is_a_short_push() -> None:
    """Of 1e-4 of the move, ωδ/2 = 2e-3 of a turn late."""
    case = scara()
    (start, end), T = first(case).q[[0, -1]], 0.25
    found = []
    for d in (0.0, 1e-4 * T):
        v = (end - start) / (T - d)
        time_s = np.array([0.0, d, d, T - d, T - d, T] if d else [0.0, T])
        q = [start, start + v * d / 2, start + v * d / 2, end - v * d / 2, end - v * d / 2, end]
        a = v / d if d else 0.0 * v
        push = [a, a, 0.0 * a, 0.0 * a, -a, -a]
        rate = [0.0 * v, v, v, v, v, 0.0 * v] if d else [v, v]
        keep = slice(None) if d else slice(None, None, 5)
        known = Moving(np.array(q[keep]), np.array(rate), np.array(push[keep]))
        ran = replace(first(case), known=known_motion(time_s, known))
        own = of_scara(case, ran).at(case.initial_design)
        found.append(own.residuals(DURATIONS)[:, 0])
    np.testing.assert_allclose(*found, rtol=0.0, atol=5e-3 * found[0].max())


def test_a_free_coordinate_is_refused() -> None:
    with pytest.raises(MechanismError, match="is free"):
        of_arm(arm(drive="free"))


def test_the_error_of_the_tip_is_that_of_an_integration() -> None:
    """And what counts in the last fifth of the move is the largest of it there or after."""
    case, w, zeta, T = arm(), 2.0 * np.pi * HZ, 0.02, 0.3
    reduced, moving = of_arm(case, zeta).at([]), first(case).motion.moving
    tau, error = reduced.errors(T)
    ways = np.linalg.norm(error[0], axis=1)

    def rates(t: float, x: Floats) -> list[float]:
        push = moving(np.array([t])).acceleration[0, 0]
        return [x[1], -2.0 * zeta * w * x[1] - w**2 * x[0] - push]

    ran = solve_ivp(rates, (0.0, T), [0.0, 0.0], t_eval=tau * T, rtol=1e-11, atol=1e-14)
    # by differences over 1e-9 where it starts
    np.testing.assert_allclose(ways, np.abs(ran.y[0]) * REACH, rtol=0.0, atol=1e-8 * ways.max())
    assert reduced.residuals(T, last=0.2)[0, 0] == ways[tau >= 0.8].max()


# --- forces of inertia, by differences of where matter is


class Matter:
    """Points with masses along beams and of bodies; in a plane angles turn bodies."""

    def __init__(self, case: ea.Case, y: Floats, driven: Floats | float = 0.0) -> None:
        self.model, self.y, self.driven = case.model(), y, driven
        self.per_length = per_length(case)
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

    def off(self, tau: float) -> float:
        """How far f is from that, by the energy of what it bends, relative to the largest."""
        own = inertia_forces(self.model.poses.case, self.model.poses.parameters, self.model.motion)
        q, rate, push = self.moving(np.array([tau * self.T]), self.y)
        difference = own.at(q, self.y, rate, push)[0] - (f := self.force(tau))
        K = self.model.matrices(q, self.y)[1]
        size = [each @ np.linalg.solve(K, each) for each in (difference, f)]
        return float(np.sqrt(size[0] / size[1]))


def per_length(case: ea.Case) -> dict[str, float]:
    """Of each beam, kg/m."""
    own, found = case.file.mechanism, {}
    for name, link in own.links.items():
        if link.type == "beam":
            at: Any = own.sections[link.section]
            high, wide = (at.height, at.width) if at.shape != "tube" else 2 * [at.outer_diameter]
            hollow = 2.0 * getattr(at, "thickness", 0.5 * high)
            area = high * wide - (high - hollow) * (wide - hollow)
            area *= np.pi / 4.0 if at.shape == "tube" else 1.0
            found[name] = area * own.materials[link.material].density
    return found


def arm_6r() -> ea.Case:
    """Of thin steel tubes, 1.37 kg/m, in fine meshes, with points for all that is rigid."""
    tree = yaml.safe_load((CASES / "arm_6r.yaml").read_text())
    own = tree["mechanism"]
    own["sections"] = {"thin": {"shape": "tube", "outer_diameter": 0.03, "thickness": 0.002}}
    for link in own["links"].values():
        for key in ("mass", "inertia", "center"):
            link.pop(key, None)
        if "elements" in link:
            link |= {"elements": 8, "section": "thin", "material": "steel", "shear": False}
    ends = [[-0.6, 0.7, -1.2, 0.0, -0.8, 0.0], [0.6, 0.2, -0.5, 0.9, 0.4, 1.2]]
    tree["trajectory"]["points"] = ends
    points = {"hand.end": 5.0, "elbow_housing.start": 6.0, "wrist.end": 2.0}
    own["bodies"] = {f"m{k}": {"at": at, "mass": m} for k, (at, m) in enumerate(points.items())}
    return held(tree)


def held(tree: dict[str, Any]) -> ea.Case:
    """All drives by springs, and nothing designed."""
    for own in tree["coordinates"].values():
        own["drive"] = {"stiffness": 8e4}
    return ea.load_case({k: tree[k] for k in tree if k not in ("design", "expansion")})


def four_bar() -> ea.Case:
    tree = yaml.safe_load((CASES / "four_bar.yaml").read_text())
    tree["mechanism"]["bodies"] = {"load": {"at": "coupler.end", "mass": 2.0, "inertia": 0.01}}
    tree["trajectory"] = {"points": [[1.2], [2.8]], "duration": 0.4, "samples": 21}
    return held(tree)


@pytest.mark.parametrize("case", [arm_6r, four_bar])
def test_forces_of_inertia_are_what_matter_in_motion_needs(case: Callable[[], ea.Case]) -> None:
    """2.5e-5 in space, 5.6e-5 of four elements; turning sections do 1.5e-4 of tubes of 60 mm."""
    matter = Matter(case(), np.zeros(0))
    assert max(matter.off(tau) for tau in (0.2, 0.55, 0.7)) < 5e-5


def test_what_slow_modes_do_is_theirs_in_however_many_steps() -> None:
    """The camera's arm has two, and others at 30 times their frequencies, which steps would ring.

    64 steps err by 1e-3, and by 3e-3 where in each step slow ones lose what fast ones have of them.
    """
    case = ea.load_case(CASES / "camera_arm.yaml")
    y = np.array([0.5 * (p.min + p.max) for p in case.file.design.parameters.values()])
    own, durations = move(case.model(), first(case), {"forearm.end": AXES}), (1.0, 1.5, 2.0)
    few, many = (own.at(y, Sizes(steps=n)).residuals(durations) for n in (64, 1024))
    np.testing.assert_allclose(few, many, rtol=0.0, atol=2e-3 * many.max())


# --- the whole mechanism, integrated

DURATIONS = np.array([0.15, 0.165, 0.18, 0.195, 0.21, 0.225, 0.24])
ZETA, STEPS = 0.01, 2400  # (ωh)²/12 · ωT = 7e-4 of a turn by the trapezoidal rule
REFLECTED = np.array([4e-5 * 80**2, 2e-5 * 50**2])


def scara() -> ea.Case:
    return ea.load_case(Path(__file__).with_name("scara.yaml"))


def of_scara(case: ea.Case, ran: Any = None) -> Move:
    return move(case.model(), ran or first(case), {"forearm.end": AXES}, Damping((ZETA,)))


def integrated(y: Floats, durations: Floats) -> Floats:
    """The largest way of the tip after the stop: M ẍ + Cẋ + Kx = −f by Newmark, all dofs."""
    matter = Matter(scara(), y, REFLECTED)
    model, tau, few = matter.model, np.linspace(0.0, 1.0, STEPS + 1), np.linspace(0.002, 0.998, 61)
    # beyond 0.002 the quintic runs out as it began: 2e-4 of f
    f = CubicSpline(few, [matter.force(each) * matter.T**2 for each in few])(tau)
    T, n = durations[:, None], model.n_dof
    h = T / STEPS
    x, v = np.zeros((2, len(T), n))
    a = -np.linalg.solve(model.matrices(matter.moving(np.zeros(1)).q, y)[0], f[0]) / T**2
    for k, q in enumerate(matter.moving(tau * matter.T).q[1:], 1):
        M, K = model.matrices(q, y)
        lam, phi = eigh(K, M)
        C = (M @ phi) * (2.0 * ZETA * np.sqrt(lam)) @ (M @ phi).T
        x, v = x + h * v + 0.25 * h**2 * a, v + 0.5 * h * a
        A = M + 0.5 * h[..., None] * C + 0.25 * h[..., None] ** 2 * K
        a = np.linalg.solve(A, (-f[k] / T**2 - v @ C - x @ K)[..., None])[..., 0]
        x, v = x + 0.25 * h**2 * a, v + 0.5 * h * a
    omega = np.sqrt(lam)
    s = omega * (-ZETA + 1j * np.sqrt(1.0 - ZETA**2))
    eta, rate = x @ M @ phi, v @ M @ phi
    Z = eta - 1j * (rate + ZETA * omega * eta) / s.imag
    tip = shapes(model.poses, model.x(q, y), phi[None])[0].nodes["forearm", "end"].motion[:, :2]
    waves = np.exp(s[:, None] * np.linspace(0.0, 0.3, 6001))
    ways = (np.einsum("ti,id->tdi", Z, tip) @ waves).real
    return np.asarray(np.linalg.norm(ways, axis=1).max(axis=1))


SOME = [(25e3, 12e3), (45e3, 12e3)]
OTHERS = [(35e3, 12e3), (25e3, 24e3), (35e3, 24e3), (45e3, 24e3)]


@pytest.mark.parametrize(
    ("k1", "k2"), SOME + [pytest.param(*each, marks=pytest.mark.slow) for each in OTHERS]
)
def test_a_scara_vibrates_as_the_whole_of_it_integrated(k1: float, k2: float) -> None:
    own, y = of_scara(scara()), np.array([k1, k2, 0.06])
    found, exact = own.at(y).residuals(DURATIONS)[:, 0], integrated(y, DURATIONS)
    # 7e-4 of the largest at all six designs, the trapezoidal rule's own
    np.testing.assert_allclose(found, exact, rtol=0.0, atol=1.5e-3 * exact.max())
    finer = own.at(y, FINER).residuals(DURATIONS)[:, 0]
    np.testing.assert_allclose(found, finer, rtol=0.0, atol=1e-3 * exact.max())  # 5e-4
