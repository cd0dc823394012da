"""The shipped cases: what closed forms know of them, and that each can be followed."""

import math
from pathlib import Path

import numpy as np
import pytest

from eigassign import Case, load_case
from eigassign.assignment import requirements_of
from eigassign.mechanism import with_elements, with_reduction

CASES = Path(__file__).parents[2] / "cases"
SHIPPED = sorted(path.stem for path in CASES.glob("*.yaml"))


def shipped(name: str) -> Case:
    return load_case(CASES / f"{name}.yaml")


def test_the_superelement_arm_is_the_beam_arm_it_was_exported_from() -> None:
    """Whole, to 1e-8; as shipped, reduced, too high by what it states."""
    beam, exported = shipped("two_link"), shipped("superelement_arm")
    beam = Case(with_elements(beam.file, {"forearm": 24}))
    whole = Case(with_reduction(exported.file, {"forearm": None}))
    q = beam.trajectory.q[::50]
    y = np.tile((0.125, 0.05), (len(q), 1))
    found, wanted, reduced = (
        case.model().frequencies(q, y, count=6) for case in (whole, beam, exported)
    )
    np.testing.assert_allclose(found, wanted, rtol=1e-8)
    stated = exported.model().truncation_error(q, y, (1, 2, 3))
    true = (reduced / wanted - 1.0)[:, :3]
    assert exported.model().n_dof < whole.model().n_dof / 3
    assert (true > 0.0).all()
    np.testing.assert_allclose(stated, true, atol=1e-8)
    assert (stated < 1e-3).all()


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_case_can_be_followed_and_its_targets_reached(name: str) -> None:
    case = shipped(name)
    model, q = case.model(), case.trajectory.q
    y = np.tile(case.initial_design, (len(q), 1))
    for one in requirements_of(case.file, case.trajectory):
        if one.followed:  # an antiresonance
            continue
        rows = case.trajectory.rows_of(one.trajectory)
        mode = max(one.modes, default=1)
        target = case.file.targets[int(one.place.removeprefix("targets[").removesuffix("]"))]
        found = model.frequencies(q[rows], y[rows], count=mode)[:, mode - 1]
        assert np.isfinite(found).all()
        wanted = {  # the middle of a band
            "frequency": lambda target: target.frequency,
            "at_least": lambda target: target.at_least,
            "keep_out": lambda target: target.keep_out.harmonic * target.keep_out.of,
        }[one.kind](target)
        near = found.max() if one.kind == "keep_out" else found.mean()
        assert 0.8 < wanted / near < 1.25


def test_a_carriage_in_the_middle_of_a_symmetric_portal_sees_the_same_on_both_sides() -> None:
    case = shipped("gantry")
    left, right = (case.model().frequencies((x,), case.initial_design, 5) for x in (0.4, 1.2))
    np.testing.assert_allclose(left, right, rtol=1e-9)


def test_the_first_mode_of_a_ball_screw_is_that_of_two_masses_and_two_springs() -> None:
    """Table and rotor, measured at the table; the shaft turns as one and is light: within 1 %."""
    case = shipped("ball_screw")
    found = case.model().frequencies((0.3,), case.initial_design, 1)[0, 0]
    E, G, rho, d, x, p = 210e9, 210e9 / 2.6, 7850.0, 0.025, 0.3, 0.01 / (2 * math.pi)
    axial, twist = E * math.pi * d**2 / 4 / x, G * math.pi * d**4 / 32 / x
    shaft = 1 / (1 / axial + p**2 / twist)
    servo = 4000 / p**2
    turning = (6e-4 + rho * math.pi * d**4 / 32 * 0.6) / p**2
    table = 120.0 + rho * math.pi * d**2 / 4 * x / 3  # a third of the bar that stretches
    K = np.array([[shaft, -shaft], [-shaft, shaft + servo]])
    lam = np.linalg.eigvals(K / np.array([[table], [turning]])).real.min()
    assert found == pytest.approx(math.sqrt(lam) / 2 / math.pi, rel=0.01)
