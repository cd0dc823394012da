"""The affine ERLS pencil K = Bᵀ k B, M = Bᵀ m B: structure, limits, mass, inertia of drives."""

from math import pi
from pathlib import Path

import numpy as np
import pytest
from chains import A_PAPER, bar, model_of, two_link
from frame_comparison import agree
from small_case import edited
from spatial_oracle import world
from spatial_random import geared, random_closed

from eigassign.case import parse
from eigassign.errors import CaseError, MechanismError, UsageError
from eigassign.modal import rounding_error
from eigassign.series import Truncated, on_faces, total_degree
from eigassign.study import BuiltCase, load_case


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


DESIGNS = {
    "E": ("materials.al.youngs_modulus", 69e9),
    "rho": ("materials.al.density", 1.9 / A_PAPER),
    "area": ("sections.rod.area", A_PAPER),
    "I": ("sections.rod.bending_inertia", 3.97e-8),
    "length": ("links.upper.length", 0.6),
    "mass": ("bodies.elbow_mass.mass", 0.2),
    "inertia": ("bodies.tool_mass.inertia", 2e-3),
    "drive": ("coordinates.q2.drive.stiffness", 400.0),
    "rotor": ("coordinates.q2.drive.inertia", 0.1),
}


@pytest.mark.parametrize("name", DESIGNS)
def test_a_design_parameter_at_its_value_is_the_value_written_in_the_file(name: str) -> None:
    path, value = DESIGNS[name]
    held = ("free", {"stiffness": 400.0, "inertia": 0.1})
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
    np.testing.assert_allclose(lam, world(changed, q).spectrum(4), rtol=1e-9)


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
        np.testing.assert_allclose(lam, world(tree(at), [0.2]).spectrum(3), rtol=1e-9)


def test_matrices_are_for_one_sample() -> None:
    with pytest.raises(UsageError, match="one sample of q and y, not 3"):
        model_of(two_link()).matrices(np.zeros((3, 2)), [0.0, 0.0])


def test_a_link_without_mass_that_moves_freely_is_refused_by_name() -> None:
    tree = two_link(design={})
    tree["mechanism"]["materials"]["al"]["density"] = 0.0
    with pytest.raises(MechanismError, match="moves no mass"):
        model_of(tree).frequencies([0.1, 1.0], [], 1)


def test_a_link_carried_by_itself_is_refused() -> None:
    tree = two_link()
    tree["mechanism"]["joints"]["elbow"]["base"] = "fore.end"
    with pytest.raises(CaseError):
        model_of(tree)


# --- The inertia that a drive reflects through its gear: ½ J ṡ² with the joint's own rate ṡ


@pytest.mark.parametrize("space", ["planar", "spatial"])
@pytest.mark.parametrize("seed", range(8))
def test_random_loops_with_geared_drives_have_the_spectrum_of_the_plain_frame(
    seed: int, space: str
) -> None:
    tree, *poses = random_closed(seed, space)
    agree(geared(tree, seed), tuple(poses))


# --- The mass of a mechanism is what its parts weigh when they are added up by hand


CASES = Path(__file__).parents[3] / "cases"


def gantry(depth: float, m: float) -> float:
    return 7850 * (2 * 0.8 * 0.05 * depth + 1.6 * 0.05 * 0.05) + m


def ball_screw(_servo: float, m: float) -> float:
    return 7850 * 0.6 * pi / 4 * 0.025**2 + m + 1.5


def arm_lengths(upper: float, fore: float, m: float) -> float:
    return 2690.007033 * 7.06317856e-4 * (upper + fore) + m


def superelement_arm(m1: float, m2: float) -> float:
    return 2690.007033 * 7.06317856e-4 * (0.6 + 0.45) + m1 + m2


# a clamped portal with a carriage on it; a loop with a nut; lengths; a part given by its matrices
@pytest.mark.parametrize("by_hand", [gantry, ball_screw, arm_lengths, superelement_arm])
def test_links_and_bodies_add_up(by_hand) -> None:  # type: ignore[no-untyped-def]
    case = load_case(CASES / f"{by_hand.__name__}.yaml")
    model, width = (
        case.model(),
        np.ptp([(p.min, p.max) for p in case.file.design.parameters.values()], axis=1),
    )
    for share in (0.1, 0.2, 0.3):
        y = case.initial_design + share * width
        assert model.mass(y) == pytest.approx(by_hand(*y), rel=1e-9)  # matrices of 10 digits
        step = 1e-5 * np.eye(len(y))
        differences = [(by_hand(*(y + h)) - by_hand(*(y - h))) / 2e-5 for h in step]
        np.testing.assert_allclose(model.total_mass(y)[1], differences, rtol=1e-8, atol=1e-8)


def test_the_slope_is_that_of_a_curved_dependence() -> None:
    text = edited(
        "parameter: bodies.tool.mass, min", "parameter: coordinates.q2.drive.inertia, min"
    )
    text = text.replace("drive: {stiffness: 100}", "drive: {stiffness: 100, inertia: 0.5}")
    text = text.replace("max: 250 g", "max: 1").replace("max: 200 g", "max: 1")
    case = BuiltCase(parse(text.encode(), "case.yaml"))
    model = case.model()
    pipe, bar = pi / 4 * (0.04**2 - 0.036**2), 7.0632e-4
    for d in (0.02, 0.035):
        expected = 2700 * (0.6 * pi / 4 * d**2 + 0.45 * pipe + 0.3 * bar) + 0.1
        assert model.mass([0.7, d]) == pytest.approx(expected, rel=1e-12)
        # what a drive reflects is no mass
        np.testing.assert_allclose(
            model.total_mass(np.array([0.7, d]))[1], [0.0, 2700 * 0.6 * pi / 2 * d], rtol=1e-12
        )
