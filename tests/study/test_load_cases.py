"""Trajectories that differ in the mechanism: what holds along each is what its own file says."""

import numpy as np
import pytest
from load_cases import INERTIA, LOADED, MASS, alone, arm, case

import eigassign as ea
from eigassign.case import parse
from eigassign.mechanism import rates, velocity_terms
from eigassign.modal import NearestExpansion, motion_effect
from eigassign.study import plan_expansion

Y = [0.1, 0.05]
SETS = {
    "masses": LOADED,
    "a drive": (
        {"coordinates.q1.drive.stiffness": 1e4},
        {"coordinates.q1.drive.inertia": 2.0},
        {"coordinates.q1.drive.stiffness": 9e4},
    ),
    "material and section": (
        {"materials.al.youngs_modulus": 55e9},
        {"sections.rod.bending_inertia": 5e-8, MASS: 1.0},
        {},
    ),
    "lengths": ({"links.fore.length": 0.6}, {"links.upper.length": 0.5}, {MASS: 2.0}),
}
# Round-off of a lowest eigenvalue where a stiff element stands beside a soft drive
DIGITS = 1e-11


@pytest.mark.parametrize("which", SETS)
def test_exact_frequencies_are_those_of_files_with_the_property_written_in(which: str) -> None:
    tree = arm(*SETS[which])
    whole = case(tree)
    model = whole.model()
    for k, part in enumerate(whole.trajectories):
        one = case(alone(tree, k))
        own = one.model().frequencies(one.trajectory.q, Y, 4)
        np.testing.assert_allclose(
            model.frequencies(part.trajectory.q, Y, 4), own, rtol=DIGITS, err_msg=part.name
        )


@pytest.mark.parametrize("which", SETS)
def test_a_reduced_model_serves_all_loads(which: str) -> None:
    whole = case(arm(*SETS[which]))
    model, q = whole.model(), whole.trajectory.q
    reduced = ea.reduce(model, q[[3, 15, 22]], [Y] * 3, modes=(1, 2))
    exact = model.frequencies(q, Y, 2)
    error = np.abs(reduced.frequencies(q, Y) / exact - 1.0)
    assert error.max() < 1e-5


def test_a_load_enters_the_series_to_full_order_even_where_the_design_does_not() -> None:
    model = case(arm(*LOADED)).model()
    q0, far = np.array([0.5, 1.6, 1.0, 2e-3]), np.array([0.5, 1.6, 1.3, 2e-3])
    errors = []
    for order in (2, 4, 6):
        linear = ea.expand(model, q0, Y, (1,), order, linear_in_y=True)
        errors.append(
            abs(linear.frequencies(far, Y)[0, 0] / model.frequencies(far, Y, 1)[0, 0] - 1)
        )
    assert errors[1] < 0.1 * errors[0]
    assert errors[2] < 0.1 * errors[1]


def test_coordinates_follow_a_length_of_the_design_beside_one_that_trajectories_set() -> None:
    design = {"a": {"parameter": "links.upper.length", "min": 0.5, "max": 0.7}}
    tree = arm({"links.fore.length": 0.5}, {"links.fore.length": 0.4}, design=design)
    for motion in tree["trajectory"]:
        for key in ("points", "duration", "samples"):
            motion.pop(key)
        motion |= {"tip": "fore.end", "waypoints": [[0.7, 0.2], [0.6, 0.4]], "samples": 7}
        motion["branch"] = {"elbow": [0.0, 3.0]}
    whole, y = case(tree), np.array([0.64])
    q, slopes = whole.trajectory.at(y)
    tip = whole.model().poses.position(whole.model().x(q, y), "fore", "end")[:, :2]
    np.testing.assert_allclose(tip, whole.trajectory.tip, atol=1e-9)
    up, down = (whole.trajectory.at(y + h)[0] for h in (1e-6, -1e-6))
    np.testing.assert_allclose(slopes[:, :, 0], (up - down) / 2e-6, atol=1e-7)
    assert not slopes[:, 2:].any()


def test_links_reduced_over_loads_keep_within_their_bound() -> None:
    tree = arm({"sections.rod.bending_inertia": 6e-8}, {"materials.al.density": 4e3}, {MASS: 3.0})
    whole = case(tree).model()
    for link in tree["mechanism"]["links"].values():
        link["reduce_to"] = 1500.0
    small = case(tree)
    model, q = small.model(), small.trajectory.q
    assert model.n_dof < whole.n_dof
    lost = model.frequencies(q, Y, 2) / whole.frequencies(q, Y, 2) - 1.0
    bound = model.truncation_error(q, Y, (1, 2))
    assert (lost >= -DIGITS).all()
    assert (lost <= bound + DIGITS).all()
    assert bound.max() < 1e-3


@pytest.mark.parametrize("given", [[0.5, 1.6], "auto"])
def test_the_expansion_point_has_the_middle_of_the_loads(given: object) -> None:
    whole = case(arm(*LOADED, expansion={"q": given}))
    plan = plan_expansion(whole.file, whole.model(), whole.trajectory)
    assert plan.q0[2:].tolist() == [1.5, 3e-3]
    assert any("loads in the middle of their ranges" in note for note in plan.notes)
    poses = whole.trajectory.q[:, :2].tolist()
    assert plan.q0[:2].tolist() == given or plan.q0[:2].tolist() in poses


def test_several_units_of_loads_do_not_move_the_nearest_expansion_point() -> None:
    """Of two points of one pose the one with the nearer load is nearest, whatever its unit."""
    tree = arm({"materials.al.youngs_modulus": 60e9}, {"materials.al.youngs_modulus": 80e9})
    model = case(tree).model()
    pose, other = [0.5, 1.6], [0.5, 2.3]
    parts = [ea.expand(model, [*at, 70e9], Y, (1,), 2) for at in (pose, other)]
    q = np.array([[0.5, 1.7, 80e9], [0.5, 2.2, 60e9]])
    assert NearestExpansion(tuple(parts)).owner(q).tolist() == [0, 1]


def test_a_single_trajectory_may_set_properties_too() -> None:
    tree = arm(*LOADED)
    one = {**tree, "trajectory": {k: v for k, v in tree["trajectory"][0].items() if k != "name"}}
    whole = case(one)
    q = whole.trajectory.q
    assert q[0, 2:].tolist() == [3.0, 5e-3]
    own = case(alone(tree, 0))
    np.testing.assert_allclose(
        whole.model().frequencies(q, Y, 3),
        own.model().frequencies(own.trajectory.q, Y, 3),
        rtol=DIGITS,
    )


def test_what_is_set_comes_out_of_the_file_as_it_went_in() -> None:
    file = case(arm({MASS: "3 kg"}, {INERTIA: "20 kg cm2"})).file
    assert file.loads[MASS].along == (3.0, 0.5)
    assert file.loads[INERTIA].along == (1e-3, 2e-3)
    assert (file.q_units, file.loads[INERTIA].range) == (
        ("rad", "rad", "kg", "kg m2"),
        (1e-3, 2e-3),
    )
    again = parse(file.resolved().encode(), "load_cases.yaml")
    assert again == file
    assert again.loads == file.loads
    assert " set:" not in case(arm({}, {})).file.resolved()


def test_velocity_terms_are_those_of_each_trajectorys_own_mechanism() -> None:
    tree = arm(*LOADED)
    whole = case(tree)
    for k, part in enumerate(whole.trajectories):
        one = case(alone(tree, k))
        effects = []
        for each, motion in ((whole, part.trajectory), (one, one.trajectory.parts[0].trajectory)):
            model = each.model()
            terms = velocity_terms(each.file, model.poses.parameters, model.motion)
            moving = rates(motion)
            effects.append(
                motion_effect(model.pencil, terms, moving, np.array(Y), (1, 2), 4).change
            )
        np.testing.assert_allclose(*effects, rtol=1e-5, atol=1e-9)
