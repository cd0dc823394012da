"""Residual vibration: closed forms, forces of inertia by differences, and the whole integrated."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calibration import Floats
from numpy.polynomial import Polynomial
from scipy.integrate import solve_ivp
from whole_moves import ZETA, Matter, first, largest, whole_scara

import eigassign as ea
from eigassign.errors import MechanismError
from eigassign.mechanism import Moving, known_motion, shapes, timing_law
from eigassign.modal import FINER, Damping, Move, Sizes, dampings, move

AXES = ((1.0, 0.0), (0.0, 1.0))


# --- one degree of freedom

HZ, REACH, TURN = 7.0, 0.8, 0.6


def arm(law: str = "quintic", duration: float = 0.3, drive: Any = None) -> ea.Case:
    """A rigid arm with a mass at its end, on a drive of 7 Hz."""
    inertia = 3.0 * REACH**2
    return ea.load_case(
        {
            "title": "one",
            "mechanism": {
                "space": "planar",
                "links": {"a": {"type": "rigid", "nodes": {"hub": [0, 0], "end": [REACH, 0]}}},
                "joints": {"hub": {"type": "revolute", "base": "ground", "follower": "a.hub"}},
                "bodies": {"m": {"at": "a.end", "mass": 3.0}},
            },
            "coordinates": {
                "q": {
                    "joint": "hub",
                    "drive": drive or {"stiffness": inertia * (2.0 * np.pi * HZ) ** 2},
                }
            },
            "trajectory": {
                "points": [[0.2], [0.2 + TURN]],
                "duration": duration,
                "samples": 21,
                "timing": law,
            },
            "targets": [{"mode": 1, "at_least": 1.0}],
        }
    )


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
    case, delay = arm("trapezoidal", 0.3), 0.5 / HZ
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
    stiffness = 3.0 * REACH**2 * (2.0 * np.pi * HZ) ** 2
    case = arm(drive={"stiffness": stiffness, "loss_factor": 0.1})
    (damping,) = dampings(case.model())
    found = move(case.model(), first(case), {"a.end": AXES}, damping).at([]).residuals(0.2)[0, 0]
    assert found == pytest.approx(duhamel("quintic", 0.2, 0.05), rel=1e-6)


def test_a_slow_move_leaves_the_tip_where_the_forces_hold_it() -> None:
    """x = −K⁻¹f in 10 s, but for what vibrates, 9e-5 of the largest; with one mode of each pose."""
    case, y, slow = scara(), np.array([25e3, 12e3, 0.06]), 0.25 / 10.0
    own, model = (
        move(case.model(), first(case), {"forearm.end": AXES}, Damping((ZETA,))),
        case.model(),
    )
    tau, error = own.at(y, Sizes(modes=1)).errors(10.0)
    for k in np.searchsorted(tau, (0.2, 0.37, 0.8)):
        q, rate, push = first(case).motion.moving(0.25 * tau[k : k + 1])
        f = own.inertia.at(q, y, slow * rate, slow**2 * push)[0]
        x = -np.linalg.solve(model.matrices(q, y)[1], f)[:, None]
        tip = shapes(model.poses, model.x(q, y), x[None])[0].nodes["forearm", "end"]
        np.testing.assert_allclose(error[0, k], tip.motion[0, :2], atol=3e-4 * np.abs(error).max())


def test_a_blow_is_a_short_push() -> None:
    """Of 1e-4 of the move, ωδ/2 = 2e-3 of a turn late."""
    case, y = scara(), np.array([25e3, 12e3, 0.06])
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
        own = move(case.model(), ran, {"forearm.end": AXES}, Damping((ZETA,)))
        found.append(own.at(y).residuals(DURATIONS)[:, 0])
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
        return [
            x[1],
            -2.0 * zeta * w * x[1] - w**2 * x[0] - moving(np.array([t])).acceleration[0, 0],
        ]

    ran = solve_ivp(rates, (0.0, T), [0.0, 0.0], t_eval=tau * T, rtol=1e-11, atol=1e-14)
    # by differences over 1e-9 where it starts
    np.testing.assert_allclose(ways, np.abs(ran.y[0]) * REACH, rtol=0.0, atol=1e-8 * ways.max())
    assert reduced.residuals(T, last=0.2)[0, 0] == ways[tau >= 0.8].max()


# --- forces of inertia, by differences of where matter is


def beams(space: str, links: dict[str, Any], joints: dict[str, Any], **more: Any) -> ea.Case:
    """Steel tubes of 60 and 56 mm, 2.84 kg/m, point to point in 0.4 s, all drives held."""
    names = [name for name, joint in joints.items() if joint.pop("driven", True)]
    section = {"shape": "tube", "outer_diameter": 0.06, "thickness": 0.002}
    tubes = {"material": "steel", "section": "tube", "elements": 6}
    steel = {"youngs_modulus": 2.1e11, "density": 7800.0, "shear_modulus": 8e10}
    points = {"points": more.pop("points"), "duration": 0.4, "samples": 21}
    return ea.load_case(
        {
            "title": space,
            "mechanism": {
                "space": space,
                "materials": {"steel": steel},
                "sections": {"tube": section},
                "links": {
                    n: own if "type" in own else {**tubes, **own} for n, own in links.items()
                },
                "joints": joints,
                **more,
            },
            "coordinates": {n: {"joint": n, "drive": {"stiffness": 8e4}} for n in names},
            "trajectory": points,
            "targets": [{"mode": 1, "at_least": 1.0}],
        }
    )


TUBE = 7800.0 * np.pi / 4.0 * (0.06**2 - 0.056**2)


def spatial_arm() -> ea.Case:
    joints = {
        "yaw": {"type": "revolute", "axis": [0, 0, 1], "base": "ground", "follower": "post.start"},
        "lift": {"type": "revolute", "axis": [0, 1, 0], "base": "post.end", "follower": "a.start"},
        "roll": {"type": "revolute", "axis": [0, 0, 1], "base": "a.end", "follower": "b.start"},
    }
    joints["wrist"] = {**joints["lift"], "base": "b.end", "follower": "hand.start"}
    hand = {"type": "rigid", "nodes": {"start": [0, 0, 0], "tool": [0.2, 0.1, 0.05]}}
    links = {"post": {"length": 0.5}, "a": {"length": 0.7}, "b": {"length": 0.5}, "hand": hand}
    bodies = {"load": {"at": "hand.tool", "mass": 4.0}, "motor": {"at": "a.end", "mass": 2.0}}
    points = [[0.0, 0.3, 0.2, 0.0], [1.4, -0.6, 1.5, 2.0]]
    return beams("spatial", links, joints, bodies=bodies, points=points)


def four_bar() -> ea.Case:
    joints = {
        "A": {"type": "revolute", "base": "ground", "follower": "crank.start"},
        "B": {"type": "revolute", "base": "crank.end", "follower": "rod.start", "driven": False},
        "D": {
            "type": "revolute",
            "base": "ground",
            "follower": "lever.start",
            "position": [0.5, 0],
            "driven": False,
        },
        "C": {"type": "revolute", "base": "rod.end", "follower": "lever.end", "driven": False},
    }
    links = {"crank": {"length": 0.12}, "rod": {"length": 0.45}, "lever": {"length": 0.4}}
    bodies = {"load": {"at": "rod.end", "mass": 2.0, "inertia": 0.01}}
    guess = {"A": 0.5, "B": 0.3, "D": 1.8, "C": 1.0}
    assembly = {"at": {"A": 0.5}, "guess": {k: guess[k] for k in "BDC"}}
    return beams("planar", links, joints, bodies=bodies, points=[[1.2], [2.8]], assembly=assembly)


@pytest.mark.parametrize("case", [spatial_arm, four_bar])
def test_forces_of_inertia_are_what_matter_in_motion_needs(case: Callable[[], ea.Case]) -> None:
    """In space six elements of a beam err by 1/36 of a share of what they carry: 1.4e-4."""
    own = case()
    tubes = [n for n, link in own.file.mechanism.links.items() if link.type != "rigid"]
    matter = Matter(own, np.zeros(0), dict.fromkeys(tubes, TUBE))
    assert max(matter.off(tau) for tau in (0.2, 0.5, 0.7)) < 3e-4


def test_what_slow_modes_do_is_theirs_in_however_many_steps() -> None:
    """The camera's arm has two, and others at 30 times their frequencies, which steps would ring.

    256 steps err by 1.3e-4, and by 3e-4 where in each slow ones lose what fast ones have of them.
    """
    case = ea.load_case(Path(__file__).parents[2] / "cases" / "camera_arm.yaml")
    y = np.array([0.5 * (p.min + p.max) for p in case.file.design.parameters.values()])
    own, durations = move(case.model(), first(case), {"forearm.end": AXES}), (1.0, 1.5, 2.0)
    few, many = (own.at(y, Sizes(4, 10.0, steps=n)).residuals(durations) for n in (256, 1024))
    np.testing.assert_allclose(few, many, rtol=0.0, atol=2e-4 * many.max())


# --- the whole mechanism, integrated

DURATIONS = np.array([0.15, 0.165, 0.18, 0.195, 0.21, 0.225, 0.24])


def scara() -> ea.Case:
    return ea.load_case(Path(__file__).with_name("scara.yaml"))


SOME = [(25e3, 12e3), (45e3, 12e3)]
OTHERS = [(35e3, 12e3), (25e3, 24e3), (35e3, 24e3), (45e3, 24e3)]


@pytest.mark.parametrize(
    ("k1", "k2"), SOME + [pytest.param(*each, marks=pytest.mark.slow) for each in OTHERS]
)
def test_a_scara_vibrates_as_the_whole_of_it_integrated(k1: float, k2: float) -> None:
    case, y = scara(), np.array([k1, k2, 0.06])
    own = move(case.model(), first(case), {"forearm.end": AXES}, Damping((ZETA,)))
    found, exact = own.at(y).residuals(DURATIONS)[:, 0], largest(whole_scara(case, y), DURATIONS)
    # 7e-4 of the largest at all six designs, the trapezoidal rule's own
    np.testing.assert_allclose(found, exact, rtol=0.0, atol=1.5e-3 * exact.max())
    finer = own.at(y, FINER).residuals(DURATIONS)[:, 0]
    np.testing.assert_allclose(found, finer, rtol=0.0, atol=1e-3 * exact.max())  # 5e-4
