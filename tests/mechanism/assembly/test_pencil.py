"""The affine ERLS pencil K = Bᵀ k B, M = Bᵀ m B: structure, limits, and what drops out."""

from __future__ import annotations

import numpy as np
import pytest
from chains import A_PAPER, bar, model_of, random_chain, two_link
from frame_oracle import frame

from eigassign import load_case
from eigassign.errors import CaseError, MechanismError, UsageError
from eigassign.modal import Model, rounding_error
from eigassign.series import Truncated, on_faces, total_degree

SEEDS = range(0, 60, 4)


def matrices(seed: int) -> tuple[Model, np.ndarray, np.ndarray, np.ndarray]:
    tree, q = random_chain(seed)
    model = model_of(tree)
    return (model, q, *model.matrices(q, []))


@pytest.mark.parametrize("seed", SEEDS)
def test_mass_and_stiffness_are_symmetric_and_of_the_right_definiteness(seed: int) -> None:
    model, _, M, K = matrices(seed)
    np.testing.assert_allclose(M, M.T, atol=1e-15 * np.abs(M).max())
    np.testing.assert_allclose(K, K.T, atol=1e-15 * np.abs(K).max())
    elastic = np.setdiff1d(np.arange(model.n_dof), model.pencil.rigid)
    if len(M):
        np.linalg.cholesky(M)
        np.linalg.cholesky(K[np.ix_(elastic, elastic)])


@pytest.mark.parametrize("seed", range(60))
def test_no_stiffness_acts_on_a_free_coordinate_exactly(seed: int) -> None:
    model, _, _, K = matrices(seed)
    assert not K[model.pencil.rigid].any()  # not small: zero, at every pose
    assert not K[:, model.pencil.rigid].any()


def test_a_held_absolute_angle_on_a_free_one_leaves_the_free_one_without_stiffness() -> None:
    tree = two_link(angles=("absolute", "absolute"), drives=("free", {"stiffness": 300.0}))
    model, q = model_of(tree), np.array([0.3, 1.1])
    lam = (2.0 * np.pi * model.frequencies(q, [0.0, 0.0], 3)[0]) ** 2
    np.testing.assert_allclose(lam, frame(tree, q).eigenvalues(3), rtol=1e-9)


@pytest.mark.parametrize("angle", ["relative", "absolute"])
def test_rigid_motion_has_the_kinetic_energy_of_two_swinging_rods(angle: str) -> None:
    # ½q̇ᵀMq̇ = Σ ½ m v_c² + ½ m L²/12 ω², with point masses; the links move as rigid bodies.
    m1, m2, J, a, b, line = 0.2, 0.7, 1e-3, 0.6, 0.45, 1.9
    tree = two_link(angles=("relative", angle), masses=(m1, m2), tip_inertia=J, design={})
    q, rate = np.array([0.4, 1.7]), np.array([1.3, -0.6])
    M, _ = model_of(tree).matrices(q, [])
    world = q[1] if angle == "absolute" else q.sum()
    w1, w2 = rate[0], rate[1] if angle == "absolute" else rate.sum()
    elbow = a * w1 * np.array([-np.sin(q[0]), np.cos(q[0])])
    swing = w2 * np.array([-np.sin(world), np.cos(world)])
    centre, tip = elbow + 0.5 * b * swing, elbow + b * swing
    energy = 0.5 * (line * a**3 / 3 * w1**2 + m1 * elbow @ elbow + line * b * centre @ centre)
    energy += 0.5 * (line * b**3 / 12 * w2**2 + m2 * tip @ tip + J * w2**2)
    np.testing.assert_allclose(0.5 * rate @ M[-2:, -2:] @ rate, energy, rtol=1e-13)


def test_two_of_three_coordinates_locked_leave_the_rate_of_the_third() -> None:
    # With the elbow locked, an absolute elbow angle's link turns with the shoulder.
    tree = two_link(drives=("free", "locked"), design={})
    q, L = np.array([0.4, 1.7]), 1.9
    M, _ = model_of(tree).matrices(q, [])
    a, b, c = 0.6, 0.45, np.cos(q[1] - q[0])
    about_root = L * a**3 / 3 + L * b**3 / 3 + L * b * a * a + L * b * b * a * c
    np.testing.assert_allclose(M[-1, -1], about_root, rtol=1e-13)


def test_an_absolute_rate_beyond_a_locked_joint_is_that_of_its_link_in_the_world() -> None:
    tree = two_link(drives=("free", "locked"), angles=("absolute", "absolute"), design={})
    rod = {"length": 0.3, "material": "al", "section": "rod", "elements": 2}
    tree["mechanism"]["links"]["hand"] = rod
    wrist = {"type": "revolute", "base": "fore.end", "follower": "hand.start"}
    tree["mechanism"]["joints"]["wrist"] = wrist
    tree["coordinates"]["q3"] = {"joint": "wrist", "angle": "absolute"}
    q, line, a, b, c = np.array([0.4, 1.7, -0.5]), 1.9, 0.6, 0.45, 0.3
    M, _ = model_of(tree).matrices(q, [])
    # q̇1 = 1, q̇3 = 0: the locked pair turns about the ground, the hand only travels with the wrist
    bend = np.cos(q[1] - q[0])
    wrist_squared = a * a + b * b + 2 * a * b * bend
    pair = line * (a**3 / 3 + b**3 / 3 + b * a * a + b * b * a * bend)
    np.testing.assert_allclose(M[-2, -2], pair + line * c * wrist_squared, rtol=1e-13)
    np.testing.assert_allclose(M[-1, -1], line * c**3 / 3, rtol=1e-13)


def test_a_stiff_drive_tends_to_a_locked_joint_and_a_soft_one_to_a_free_joint() -> None:
    q, y = [0.7, 2.0], [0.1, 0.1]

    def lowest(drive: object, count: int = 4) -> np.ndarray:
        return model_of(two_link(drives=(drive, drive))).frequencies(q, y, count)[0]

    np.testing.assert_allclose(lowest({"stiffness": 1e9}), lowest("locked"), rtol=1e-4)
    soft = lowest({"stiffness": 1e-3}, 6)
    np.testing.assert_allclose(soft[2:], lowest("free"), rtol=1e-5)
    assert soft[1] < 0.2  # two pendulums on springs of 1e-3 N m/rad: far below 1 Hz


def test_the_error_of_a_stiff_drive_falls_like_its_compliance() -> None:
    q, y = [0.7, 2.0], [0.1, 0.1]
    locked = model_of(two_link(drives=("locked", "locked"))).frequencies(q, y, 2)[0]
    errors = []
    for k in (1e7, 1e8):
        drive = {"stiffness": k}
        held = model_of(two_link(drives=(drive, drive))).frequencies(q, y, 2)[0]
        errors.append(locked - held)
    np.testing.assert_allclose(errors[0] / errors[1], 10.0, rtol=2e-2)


def test_the_shoulder_angle_of_a_planar_arm_drops_out_by_structure() -> None:
    model = model_of(two_link())
    assert model.pencil.active.tolist() == [False, True, True, True]
    q, y = np.array([[0.0, 1.0], [2.0, 3.0], [-1.0, 0.0]]), [0.0, 0.1]
    theta = model.pencil.theta(np.column_stack([q, np.tile(y, (3, 1))]))
    np.testing.assert_array_equal(theta, np.broadcast_to(theta[:, :1], theta.shape))
    # equal matrices; a sample's place in the batch may round its eigenvalues differently
    digits = rounding_error(model.pencil, np.array([*q[0], *y]), 3)
    f = model.frequencies(q, y, 3)
    np.testing.assert_allclose(f[1:], np.broadcast_to(f[:1], (2, 3)), rtol=2 * digits)


@pytest.mark.parametrize("seed", SEEDS)
def test_turning_the_whole_mechanism_changes_no_frequency(seed: int) -> None:
    tree, q = random_chain(seed)
    model = model_of(tree)
    for joint in tree["mechanism"]["joints"].values():
        if joint["base"] == "ground":
            joint["angle"] = joint.get("angle", 0.0) + 0.9
            joint["position"] = [5.0, -3.0]
    absolute = [c["angle"] == "absolute" for c in tree["coordinates"].values()]
    turned = model_of(tree)
    count = min(4, model.n_dof - model.n_rigid)
    f = model.frequencies(q, [], count)
    np.testing.assert_allclose(
        turned.frequencies(q + 0.9 * np.array(absolute), [], count), f, rtol=1e-10
    )


def test_the_coefficient_functions_are_as_few_as_a_planar_elbow_needs() -> None:
    assert model_of(two_link()).pencil.n_theta == 13
    assert model_of(two_link((40, 30))).pencil.n_theta == 13


@pytest.mark.parametrize("name", ["two_link", "five_bar", "arm_6r", "ball_screw"])
def test_coefficients_are_left_out_only_where_they_are_zero(name) -> None:
    """Zero exactly, for sums of products with zeros round nothing; the others to round-off only.

    A smaller set multiplies series in another order, so the last bits of the others may differ.
    """
    case = load_case(f"cases/{name}.yaml")
    pencil, y = case.model().pencil, case.initial_design
    space = total_degree(pencil.to_program.shape[1], 3)
    x0 = np.concatenate([case.trajectory.q[3], y])
    used = pencil.program.faces @ (pencil.to_program != 0.0)
    kept = on_faces(space, used.tobytes())[1]
    left_out = np.delete(np.arange(len(space)), kept)

    z = np.zeros((len(pencil.shift), len(space)))
    z[:, 0] = pencil.to_program @ x0 + pencil.shift
    z[:, space.units] = pencil.to_program
    every = pencil.program.run(Truncated(space), z)
    some = pencil.theta_series(space, x0, pencil.to_program)[1:]
    assert len(left_out)
    np.testing.assert_array_equal(every[:, left_out], 0.0)
    np.testing.assert_array_equal(some[:, left_out], 0.0)
    size = np.abs(every).max(axis=1, keepdims=True)
    assert (np.abs(some - every) <= 100 * np.finfo(float).eps * size).all()  # some 100 roundings


def test_affine_matrices_are_the_sum_of_their_terms() -> None:
    model = model_of(two_link())
    theta = model.pencil.theta(model.x([0.2, 1.4], [0.1, 0.2]))
    M, K = model.matrices([0.2, 1.4], [0.1, 0.2])
    dense = model.pencil.sparse(model.pencil.mass @ theta[:, 0]).toarray()
    np.testing.assert_allclose(dense, M, rtol=1e-15)
    terms = model.pencil.stiffness.toarray()
    by_hand = np.zeros_like(K)
    by_hand[model.pencil.rows, model.pencil.columns] = terms @ theta[:, 0]
    np.testing.assert_allclose(by_hand, K, rtol=1e-14, atol=1e-14 * np.abs(K).max())


DESIGNS = {
    "E": ("materials.al.youngs_modulus", 69e9),
    "rho": ("materials.al.density", 1.9 / A_PAPER),
    "area": ("sections.rod.area", A_PAPER),
    "I": ("sections.rod.bending_inertia", 3.97e-8),
    "length": ("links.upper.length", 0.6),
    "mass": ("bodies.elbow_mass.mass", 0.2),
    "inertia": ("bodies.tool_mass.inertia", 2e-3),
    "drive": ("coordinates.q2.drive.stiffness", 400.0),
}


@pytest.mark.parametrize("name", DESIGNS)
def test_a_design_parameter_at_its_value_is_the_value_written_in_the_file(name: str) -> None:
    path, value = DESIGNS[name]
    held = ("free", {"stiffness": 400.0})
    design = {"p": {"parameter": path, "min": 0.1 * value, "max": 10.0 * value}}
    plain = model_of(two_link(drives=held, masses=(0.2, 0.1), tip_inertia=2e-3, design={}))
    model = model_of(two_link(drives=held, masses=(0.2, 0.1), tip_inertia=2e-3, design=design))
    q = [0.3, 1.9]
    np.testing.assert_allclose(
        model.frequencies(q, [value], 4), plain.frequencies(q, [], 4), rtol=1e-11
    )
    changed = two_link(drives=held, masses=(0.2, 0.1), tip_inertia=2e-3, design={})
    node = changed if path.startswith("coordinates") else changed["mechanism"]
    *parents, leaf = path.split(".")
    for key in parents:
        node = node[key]
    node[leaf] = 1.7 * value
    lam = (2.0 * np.pi * model.frequencies(q, [1.7 * value], 4)[0]) ** 2
    np.testing.assert_allclose(lam, frame(changed, np.array(q)).eigenvalues(4), rtol=1e-9)


@pytest.mark.parametrize(
    ("section", "field", "value", "fixed"),
    [
        ("circle", "diameter", 0.02, {}),
        ("tube", "outer_diameter", 0.03, {"inner_diameter": 0.02}),
        ("tube", "inner_diameter", 0.02, {"outer_diameter": 0.03}),
        ("tube", "thickness", 0.004, {"outer_diameter": 0.03}),
        ("tube", "outer_diameter", 0.03, {"thickness": 0.004}),
        ("rectangle", "width", 0.03, {"height": 0.01}),
        ("rectangle", "height", 0.01, {"width": 0.03}),
        ("box", "thickness", 0.001, {"width": 0.03, "height": 0.02}),
        ("box", "width", 0.015, {"thickness": 0.002, "height": 0.02}),
    ],
)
def test_every_measure_of_a_section_can_be_designed(
    section: str, field: str, value: float, fixed: dict[str, float]
) -> None:
    def tree(at: float) -> dict[str, object]:
        shape = {"shape": section, field: at, **fixed}
        return bar(3, 0.7, 70e9, 2700.0, shape, "revolute", {"stiffness": 2e3})

    designed = tree(value)
    box = {"parameter": f"sections.s.{field}", "min": 0.9 * value, "max": 1.1 * value}
    designed["design"] = {"p": box}
    model = model_of(designed)
    for at in (0.9 * value, 1.1 * value):
        lam = (2.0 * np.pi * model.frequencies([0.2], [at], 3)[0]) ** 2
        np.testing.assert_allclose(lam, frame(tree(at), np.array([0.2])).eigenvalues(3), rtol=1e-9)


def test_matrices_are_for_one_sample() -> None:
    with pytest.raises(UsageError, match="one sample of q and y, not 3"):
        model_of(two_link()).matrices(np.zeros((3, 2)), [0.0, 0.0])


def test_a_link_without_mass_that_moves_freely_is_refused_by_name() -> None:
    tree = two_link(design={})
    tree["mechanism"]["materials"]["al"]["density"] = 0.0
    with pytest.raises(MechanismError, match="moves no mass"):
        model_of(tree).frequencies([0.1, 1.0], [], 1)


def test_a_massless_arm_with_point_masses_has_only_the_modes_of_its_masses() -> None:
    tree = two_link(masses=(0.5, 0.5), design={})
    tree["mechanism"]["materials"]["al"]["density"] = 0.0
    model = model_of(tree)
    lam = (2.0 * np.pi * model.frequencies([0.3, 1.9], [], 2)[0]) ** 2
    # two masses move in the plane, less two rigid motions: two elastic modes
    M, K = model.matrices([0.3, 1.9], [])
    shift = 1e3
    mu = np.linalg.eigvals(np.linalg.solve(K + shift * M, M)).real
    np.testing.assert_allclose(np.sort(1 / np.sort(mu)[::-1][2:4] - shift), lam, rtol=1e-6)
    with pytest.raises(MechanismError, match="only 2 modes whose mass is more"):
        model.frequencies([0.3, 1.9], [], 8)


def test_a_link_carried_by_itself_is_refused() -> None:
    tree = two_link()
    tree["mechanism"]["joints"]["elbow"]["base"] = "fore.end"
    with pytest.raises(CaseError):
        model_of(tree)
