"""Tip paths of mechanisms with closed loops, against closed-form kinematics."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eigassign import Case
from eigassign.case import parse
from eigassign.errors import CaseError

CASES = Path(__file__).parents[3] / "cases"
DEG = np.pi / 180.0


def shipped(name: str, trajectory: dict[str, Any], edit: tuple[str, str] = ("", "")) -> Case:
    """A shipped case with another trajectory."""
    text = (CASES / f"{name}.yaml").read_text()
    assert edit[0] in text
    text = text.replace(*edit) if edit[0] else text
    moved = f"trajectory: {json.dumps(trajectory)}\n\ndesign:"
    changed = re.sub(r"^trajectory:.*?^design:", moved, text, flags=re.M | re.S)
    return Case(parse(changed.encode(), CASES / f"{name}.yaml"))


def refused(name: str, trajectory: dict[str, Any]) -> str:
    with pytest.raises(CaseError) as error:
        _ = shipped(name, trajectory).trajectory
    return str(error.value)


def circles(a: np.ndarray, ra: float, b: np.ndarray, rb: float, side: float) -> np.ndarray:
    """The intersection of two circles on the given side of the line from a to b."""
    d = np.linalg.norm(b - a, axis=-1, keepdims=True)
    e = (b - a) / d
    along = (d**2 + ra**2 - rb**2) / (2 * d)
    across = side * np.sqrt(ra**2 - along**2)
    return a + along * e + across * np.stack([-e[..., 1], e[..., 0]], axis=-1)


# --- five-bar: two coordinates place the tool ---

CUT = [[0.06, 0.48], [0.1, 0.5], [0.14, 0.48]]


def cranks(tool: np.ndarray) -> np.ndarray:
    """Both crank angles, elbows outwards, by intersecting circles of 0.25 and 0.35 m."""
    left, right = np.zeros(2), np.array([0.2, 0.0])
    e1 = circles(left, 0.25, tool, 0.35, +1.0) - left
    e2 = circles(right, 0.25, tool, 0.35, -1.0) - right
    return np.stack([np.arctan2(e[:, 1], e[:, 0]) for e in (e1, e2)], axis=1)


@pytest.mark.parametrize("path", ["spline", "straight"])
@pytest.mark.parametrize("tip", ["left_arm.end", "right_arm.end"])
def test_a_five_bars_tool_follows_its_path(tip: str, path: str) -> None:
    wish = {"tip": tip, "waypoints": CUT, "path": path, "samples": 60}
    motion = shipped("five_bar", wish).trajectory
    np.testing.assert_allclose(motion.q, cranks(motion.tip), atol=1e-9)
    np.testing.assert_allclose(motion.tip[[0, -1]], np.array(CUT)[[0, -1]], atol=1e-10)
    assert "the solution nearest to mechanism.assembly is taken" in motion.notes[0]


def test_a_start_in_the_loops_saves_the_note() -> None:
    wish = {"tip": "left_arm.end", "waypoints": CUT, "start": [2.2, 1.0]}
    motion = shipped("five_bar", wish).trajectory
    assert motion.notes == ()
    np.testing.assert_allclose(motion.q, cranks(motion.tip), atol=1e-9)


def test_a_point_the_loops_cannot_reach_is_named() -> None:
    message = refused(
        "five_bar",
        {"tip": "left_arm.end", "waypoints": [[0.1, 0.5], [0.1, 0.7]], "timing": "linear"},
    )
    # the tool is at most 0.6 m from both motors: y = √(0.36 − 0.01)
    assert ": trajectory.waypoints[1]: waypoint 2 (0.1, 0.7) m is " in message
    distance = float(message.split(" is ")[1].split(" m out of reach")[0])
    assert distance == pytest.approx(0.7 - np.sqrt(0.35), rel=6e-3)


LONG_CRANK = ("crank: {length: 0.12,", "crank: {length: 0.45,")  # it cannot go round any more
DEAD = np.degrees(
    np.arccos((0.45**2 + 0.5**2 - 0.85**2) / (2 * 0.45 * 0.5))
)  # coupler and follower


def swing(last: float) -> dict[str, Any]:
    """The crank's end from 60 deg to ``last`` and back, each waypoint at a sample."""
    angles = 60 + (last - 60) * (1 - np.abs(np.linspace(-1, 1, 121)))
    points = 0.45 * np.stack([np.cos(angles * DEG), np.sin(angles * DEG)], axis=1)
    return {
        "tip": "crank.end", "waypoints": points.tolist(), "path": "straight",
        "timing": "linear", "samples": 121, "start": ["60 deg"],
    }  # fmt: skip


@pytest.mark.parametrize("short_of_it", [0.0, 1e-5])  # deg: too near to be told from it
def test_a_dead_point_is_refused_by_sample_and_configuration(short_of_it: float) -> None:
    with pytest.raises(CaseError) as error:
        _ = shipped("four_bar", swing(DEAD - short_of_it), LONG_CRANK).trajectory
    message = str(error.value)
    assert re.search(r": waypoint (60|61) \(", message)  # of samples 59 and 60
    assert "the loops are at a dead point" in message
    q = float(re.search(r"m, \S+ = (.*?) deg", message)[1])
    assert q == pytest.approx(DEAD, abs=1.2)
    safe = shipped("four_bar", swing(DEAD - 1.0), LONG_CRANK).trajectory
    assert np.degrees(safe.q.max()) == pytest.approx(DEAD - 1.0)


def test_beyond_a_dead_point_the_loop_cannot_close() -> None:
    with pytest.raises(CaseError) as error:
        _ = shipped("four_bar", swing(DEAD + 5.0), LONG_CRANK).trajectory
    message = str(error.value)
    first = int(np.ceil((DEAD - 60) / (DEAD - 55) * 60))
    assert f": waypoint {first + 1} (" in message
    assert "m out of reach; the tip comes to" in message
    q = float(re.search(r"at \S+ = (.*?) deg", message)[1])
    assert q == pytest.approx(DEAD, abs=0.5)


def test_a_guess_that_no_loop_can_take_is_refused() -> None:
    message = refused(
        "five_bar", {"tip": "left_arm.end", "waypoints": CUT, "start": ["180 deg", "0 deg"]}
    )
    assert "trajectory.start: the mechanism cannot be closed" in message


# --- one coordinate: the tip has one line to move on ---


def equal_chords(curve: Any, first: float, step: float, n: int) -> np.ndarray:
    """Parameters at which the points of a curve are equally far apart (bisection)."""
    u = [first]
    chord = float(np.linalg.norm(curve(first + step) - curve(first)))
    for _ in range(n - 1):
        low, high = u[-1], u[-1] + 3 * step
        for _ in range(80):
            mid = 0.5 * (low + high)
            far = np.linalg.norm(curve(mid) - curve(u[-1])) > chord
            low, high = (low, mid) if far else (mid, high)
        u.append(0.5 * (low + high))
    return np.array(u)


def coupler(angle: float) -> tuple[np.ndarray, np.ndarray]:
    """Both ends of the four-bar's coupler."""
    b = 0.12 * np.array([np.cos(angle), np.sin(angle)])
    return b, circles(b, 0.45, np.array([0.5, 0.0]), 0.4, +1.0)


def coupler_point(angle: float) -> np.ndarray:
    """The tip of a plate on the four-bar's coupler, 0.2 m along it and 0.1 m above."""
    b, c = coupler(angle)
    e = (c - b) / 0.45
    return b + 0.2 * e + 0.1 * np.array([-e[1], e[0]])


def test_a_four_bars_coupler_point_follows_its_curve() -> None:
    q = equal_chords(coupler_point, 80 * DEG, 2 * DEG, 30)
    plate = (
        "    coupler: {length: 0.45, material: steel, section: coupler_bar, elements: 4}",
        """\
    coupler:
      type: frame
      nodes: {start: [0, 0], end: [0.45, 0], tracer: [0.2, 0.1]}
      beams:
        bar: {from: start, to: end, material: steel, section: coupler_bar, elements: 4}
        left: {from: start, to: tracer, material: steel, section: coupler_bar, elements: 1}
        right: {from: tracer, to: end, material: steel, section: coupler_bar, elements: 1}
""",
    )
    wish = {
        "tip": "coupler.tracer",
        "waypoints": [coupler_point(a).tolist() for a in q],
        "path": "straight",
        "timing": "linear",
        "samples": 30,
        "start": ["70 deg"],
    }
    motion = shipped("four_bar", wish, plate).trajectory
    np.testing.assert_allclose(motion.q[:, 0], q, atol=1e-8)


def test_a_point_beside_the_coupler_curve_is_refused_with_advice() -> None:
    points = [coupler(a)[1].tolist() for a in (80 * DEG, 120 * DEG)]
    message = refused("four_bar", {"tip": "coupler.end", "waypoints": points})
    assert "m out of reach" in message
    assert "move 1 of the 2 components" in message
    assert "give points or samples of the coordinates instead" in message


def test_a_slider_is_placed_by_its_crank() -> None:
    wish = {"tip": "slider.start", "waypoints": [[0.56, 0.0], [0.42, 0.0]], "samples": 40}
    motion = shipped("slider_crank", wish).trajectory
    x = motion.tip[:, 0]
    cosine = (0.15**2 + x**2 - 0.45**2) / (2 * 0.15 * x)
    np.testing.assert_allclose(motion.q[:, 0], np.arccos(cosine), atol=1e-9)


@pytest.mark.parametrize(
    ("name", "tip", "points", "q"),
    [
        ("gantry", "carriage.start", [[0.4, 0.8], [1.2, 0.8]], [0.4, 1.2]),
        ("ball_screw", "table.nut_seat", [[0.15, 0, 0], [0.45, 0, 0]], [0.15, 0.45]),
    ],
)
def test_what_slides_is_placed_in_metres(name: str, tip: str, points: Any, q: list[float]) -> None:
    motion = shipped(name, {"tip": tip, "waypoints": points}).trajectory
    np.testing.assert_allclose(motion.q[[0, -1], 0], q, atol=1e-12)


# --- what a design parameter moves ---


def length_as_design(name: str, link: str, wish: dict[str, Any]) -> Case:
    text = shipped(name, wish).file.resolved()
    design = f"design:\n  long: {{parameter: links.{link}.length, min: 0.01, max: 2}}\n\n"
    text = re.sub(r"^design:.*?(?=^expansion:)", design, text, flags=re.M | re.S)
    text = re.sub(r"^expansion:.*", "", text, flags=re.M | re.S)
    return Case(parse(text.encode(), CASES / f"{name}.yaml"))


def test_a_length_that_only_turns_the_tip_is_refused_where_it_cannot_be_turned_back() -> None:
    crank = [0.12 * np.array([np.cos(a), np.sin(a)]) for a in (1.0, 1.1)]
    wish = {"tip": "coupler.start", "waypoints": [p.tolist() for p in crank], "start": [1.0]}
    for angle in ({"angle": 0.3}, {}):  # the crank cannot keep an angle, nor go along a chord
        with pytest.raises(CaseError, match=r"cannot be reached|m out of reach"):
            _ = length_as_design("four_bar", "follower", wish | angle).trajectory


def test_a_length_that_cannot_move_the_tip_is_allowed() -> None:
    wish = {"tip": "left_crank.end", "waypoints": [[0.0, 0.25], [0.25, 0.0]]}
    case = length_as_design("five_bar", "right_arm", wish)
    with pytest.raises(CaseError, match="right_motor not at all"):
        _ = case.trajectory
