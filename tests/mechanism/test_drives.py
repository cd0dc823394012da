"""What drives exert: textbook formulas, d'Alembert on differenced poses, energies, slopes."""

from typing import Any

import load_cases
import numpy as np
import pytest
from chains import bar
from drive_oracle import exerted
from redesigned_arms import extrapolated, five_bar, five_bar_in_joints, six_joints, two_link_lengths
from spatial_cases import CASES, Built, built, linkage, shipped
from spatial_oracle import Tree
from spatial_random import EVERY_LOOP, EVERY_TREE, random_closed, random_open
from weight_comparison import pulled

import eigassign as ea
from eigassign.case import PointTrajectory
from eigassign.mechanism import NamedTrajectory, Trajectories, build_trajectory, drive_forces

G = 9.81
PULL = {"planar": "[3.0, -9.0]", "spatial": "[3.0, -2.0, -9.0]"}
AMOUNT = 0.05  # rad or m that coordinates move


def forces(model: Built, q: Any, rate: Any, push: Any) -> np.ndarray:
    """τ (n, n_q) at some instants, or (n_q,) at one."""
    motion = [np.atleast_2d(np.asarray(each, float)) for each in (q, rate, push)]
    still = [np.zeros((*each.shape, len(model.y))) for each in motion]
    found = drive_forces(model.case, model.numbers, model.motion)
    tau = found.at(motion, still, model.y, False)[0]
    return np.asarray(tau if np.ndim(q) > 1 else tau[0])


def agree(tree: Tree, q: Any, seed: int) -> None:
    """Work in every coordinate is that of the oracle, in a random motion under a random pull."""
    rng = np.random.default_rng(seed)
    n = len(tree["coordinates"])
    if not n:
        return
    for data in tree["coordinates"].values():
        if data.get("drive", "free") not in ("locked", "free"):
            data["drive"]["inertia"] = float(10 ** rng.uniform(-1, 1))
    rate, push = rng.uniform(-3.0, 3.0, n), rng.uniform(-9.0, 9.0, n)
    g = rng.uniform(-10.0, 10.0, 3) * ([1, 1, 0] if tree["mechanism"]["space"] == "planar" else 1)
    model = pulled(tree, g[: 2 if tree["mechanism"]["space"] == "planar" else 3])
    for share in (0.0, 1.0):  # weight alone, and with the motion
        found = model.numbers.relative.T @ forces(model, q, share * rate, share * push)
        expected = exerted(tree, q, share * rate, share * push, g)
        np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max() + 1e-9)


@pytest.mark.parametrize(("seed", "space", "swap"), EVERY_TREE)
def test_random_trees_need_what_the_principle_of_dalembert_says(
    seed: int, space: str, swap: bool
) -> None:
    agree(*random_open(seed, space, swap), seed)


@pytest.mark.parametrize(("seed", "space", "loops", "swap"), EVERY_LOOP)
def test_random_loops_need_what_the_principle_of_dalembert_says(
    seed: int, space: str, loops: int, swap: bool
) -> None:
    tree, q, _ = random_closed(seed, space, loops, swap)
    agree(tree, q, seed)


# --- Textbooks


@pytest.mark.parametrize("drive", ["locked", "free", {"stiffness": 900.0, "inertia": 0.3}])
def test_a_pendulum_is_held_by_its_weight_times_its_lever_and_driven_by_its_inertia(
    drive: Any,
) -> None:
    tree = bar(3, 0.8, 70e9, 2700.0, {"area": 5e-4, "bending_inertia": 2e-12}, "revolute", drive)
    tree["mechanism"]["bodies"] = {"bob": {"at": "bar.end", "mass": 1.5}}
    mass = 0.8 * 5e-4 * 2700.0
    lever, J = mass * 0.4 + 1.5 * 0.8, mass * 0.8**2 / 3 + 1.5 * 0.8**2
    J += drive["inertia"] if isinstance(drive, dict) else 0.0
    found = forces(pulled(tree, [0.0, -G]), [0.3], [2.0], [5.0])
    np.testing.assert_allclose(found, lever * G * np.cos(0.3) + 5.0 * J, rtol=1e-7)
    np.testing.assert_allclose(forces(built(tree), [0.3], [2.0], [5.0]), 5.0 * J, rtol=1e-7)


@pytest.mark.parametrize("absolute", [False, True])
def test_a_two_link_arm_needs_the_torques_of_the_textbook_whatever_its_angles(
    absolute: bool,
) -> None:
    """Point masses m1, m2 at the ends of massless links; τ acts on the joints' relative motion."""
    l1, l2, m1, m2 = 0.6, 0.45, 2.0, 0.7
    light: Tree = {"type": "rigid", "mass": 0.0}
    tree: Tree = linkage(
        {"upper": {**light, "length": l1}, "fore": {**light, "length": l2}},
        {
            "shoulder": {"type": "revolute", "base": "ground", "follower": "upper.start"},
            "elbow": {"type": "revolute", "base": "upper.end", "follower": "fore.start"},
        },
        {
            "q1": {"joint": "shoulder"},
            "q2": {"joint": "elbow", "angle": "absolute" if absolute else "relative"},
        },
        bodies={"b1": {"at": "upper.end", "mass": m1}, "b2": {"at": "fore.end", "mass": m2}},
    )
    (a, b), (da, db), (dda, ddb) = (0.4, 0.9), (1.3, -2.1), (-4.0, 7.0)  # joints
    c, s = np.cos(b), np.sin(b)
    elbow = m2 * l2**2 * (dda + ddb) + m2 * l1 * l2 * (c * dda + s * da**2)
    elbow += m2 * l2 * G * np.cos(a + b)
    shoulder = elbow + (m1 + m2) * l1**2 * dda + (m1 + m2) * l1 * G * np.cos(a)
    shoulder += m2 * l1 * l2 * (c * (dda + ddb) - s * (da + db) ** 2)
    own = np.array([[a, b], [da, db], [dda, ddb]])
    if absolute:
        own[:, 1] += own[:, 0]
    found = forces(pulled(tree, [0.0, -G]), *own)
    np.testing.assert_allclose(found, [shoulder, elbow], rtol=1e-12)


# --- Energy, slopes, and rates along trajectories


@pytest.mark.parametrize("name", ["arm_3r", "five_bar", "slider_crank", "two_link"])
def test_what_drives_put_in_is_what_the_mechanism_gains(name: str) -> None:
    """∫ τ ṡ dt = ΔT, T of the pencil; under weight nothing is gained on the way round."""
    model = shipped(name)
    start = ea.load_case(CASES / f"{name}.yaml").trajectory.q[3]
    assert len(model.motion.columns) == len(start)
    weighed = shipped(
        name, ("  space:", f"  gravity: {PULL[model.case.mechanism.space]}\n  space:")
    )
    x, weights = np.polynomial.legendre.leggauss(24)

    def energy(t: float) -> float:
        _, M = model.pencil.matrices(model.pencil.theta(model.x(start + AMOUNT * np.sin(t))))
        rate = np.full(len(start), AMOUNT * np.cos(t))
        corner = slice(model.pencil.n_u, None)
        return float(rate @ M[0, corner, corner] @ rate) / 2.0

    def work(of: Built, end: float) -> float:
        t = (x[:, None] + 1.0) * end / 2.0 * np.ones(len(start))
        rate = AMOUNT * np.cos(t)
        tau = forces(of, start + AMOUNT * np.sin(t), rate, -AMOUNT * np.sin(t))
        return float(weights * end / 2.0 @ np.sum(tau * (rate @ of.numbers.relative.T), axis=1))

    gain = energy(1.2) - energy(0.0)
    assert work(model, 1.2) == pytest.approx(gain, abs=1e-9 * abs(energy(0.0)))
    assert abs(work(weighed, np.pi) - work(model, np.pi)) < 1e-9 * energy(0.0) / AMOUNT**2


def drives_of(case: ea.Case) -> Any:
    model = case.model()
    return drive_forces(model.poses.case, model.poses.parameters, model.motion)


CASES_OF_DESIGN = {
    "lengths": two_link_lengths,
    "six joints": six_joints,
    "a loop that its path leads": five_bar,
    "a loop that its lengths change": five_bar_in_joints,
    "a carriage": lambda: ea.load_case(CASES / "gantry.yaml"),
    "loads": lambda: load_cases.case(load_cases.arm(*load_cases.LOADED)),
}


@pytest.mark.parametrize("kind", CASES_OF_DESIGN)
def test_slopes_in_the_design_are_those_of_differences(kind: str) -> None:
    case = CASES_OF_DESIGN[kind]()
    found, y = drives_of(case), case.initial_design
    _, tau, slopes = found.along(case.trajectory, y, slopes=True)
    expected = extrapolated(lambda at: found.along(case.trajectory, at)[1], y, 1e-3)
    np.testing.assert_allclose(slopes, expected, atol=1e-6 * np.abs(expected).max())
    np.testing.assert_allclose(found.along(case.trajectory, y)[1], tau, rtol=1e-13)


def test_loads_are_those_of_each_trajectory_by_itself() -> None:
    tree = load_cases.arm(*load_cases.LOADED)
    case = load_cases.case(tree)
    samples, tau, _ = drives_of(case).along(case.trajectory, case.initial_design)
    for k, rows in enumerate(case.trajectory.rows):
        own = load_cases.case(load_cases.alone(tree, k))
        alone = drives_of(own).along(own.trajectory, own.initial_design)[1]
        at = (samples >= rows.start) & (samples < rows.stop)
        np.testing.assert_allclose(tau[at], alone, rtol=1e-12)


def test_both_sides_of_a_corner_count() -> None:
    keys = {"points": ((0.0,), (1.0,), (-1.0,)), "times": (0.0, 1.0, 3.0), "timing": "linear"}
    points = PointTrajectory(**keys, samples=4)
    motion = build_trajectory(points, ["q1"], lambda *_: pytest.fail("points need no chain"))
    path = Trajectories((NamedTrajectory("a", motion),))
    tree = bar(2, 0.8, 70e9, 2700.0, {"area": 5e-4, "bending_inertia": 2e-12}, "revolute")
    model = pulled(tree, [0.0, -G])
    found = drive_forces(model.case, model.numbers, model.motion)
    samples, tau, _ = found.along(path, model.y)
    assert samples.tolist() == [0, 1, 1, 2, 3]
    np.testing.assert_allclose(tau[0], forces(model, [0.0], [1.0], [0.0]), rtol=1e-9)
    np.testing.assert_allclose(tau[1], forces(model, [1.0], [1.0], [0.0]), rtol=1e-6)
    np.testing.assert_allclose(tau[2], forces(model, [1.0], [-1.0], [0.0]), rtol=1e-6)
