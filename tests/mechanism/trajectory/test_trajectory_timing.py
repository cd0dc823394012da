"""Timing laws s(τ)."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from eigassign.errors import UsageError
from eigassign.mechanism import timing_law

SHARES = (0.05, 1 / 3, 0.5)
LAWS = [
    *map(timing_law, ("linear", "cubic", "quintic")),
    *(timing_law("trapezoidal", share) for share in SHARES),
]
EVERY_LAW = pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
TAU = np.linspace(0.0, 1.0, 41)


@pytest.mark.parametrize(
    ("name", "formula"),
    [
        ("linear", lambda t: t),
        ("cubic", lambda t: 3 * t**2 - 2 * t**3),
        ("quintic", lambda t: 10 * t**3 - 15 * t**4 + 6 * t**5),
    ],
)
def test_laws_are_the_polynomials_of_their_names(name, formula):
    # terms up to 15, hence some 1e-15 of round-off
    np.testing.assert_allclose(timing_law(name).position(TAU), formula(TAU), rtol=0, atol=1e-14)


@EVERY_LAW
def test_laws_run_from_0_to_1_without_turning_back(law):
    s = law.position(TAU)
    assert s[0] == 0.0
    assert s[-1] == 1.0
    assert (np.diff(s) > 0.0).all()


@EVERY_LAW
def test_derivatives_agree_with_central_differences(law):
    h, tau = 1e-4, TAU[1:-1]
    tau = tau[[all(abs(t - end) > h for end in law.ends) for t in tau]]  # no acceleration there
    velocity = (law.position(tau + h) - law.position(tau - h)) / (2 * h)
    acceleration = (law.velocity(tau + h) - law.velocity(tau - h)) / (2 * h)
    # h²/6 times the third derivative, at most 60 (s''') and 360 (s'''' of the quintic)
    np.testing.assert_allclose(law.velocity(tau), velocity, atol=h**2 * 11, rtol=0)
    np.testing.assert_allclose(law.acceleration(tau), acceleration, atol=h**2 * 65, rtol=0)


def test_cubic_rests_at_both_ends_and_quintic_is_not_accelerated_there_either():
    ends = np.array([0.0, 1.0])
    for name in ("cubic", "quintic"):
        assert (timing_law(name).velocity(ends) == 0.0).all()
    assert (timing_law("quintic").acceleration(ends) == 0.0).all()
    assert (timing_law("cubic").acceleration(ends) == [6.0, -6.0]).all()


@pytest.mark.parametrize(("name", "peak"), [("linear", 1.0), ("cubic", 1.5), ("quintic", 1.875)])
def test_the_peak_velocity_is_that_of_the_closed_form(name, peak):
    assert timing_law(name).velocity(TAU).max() == pytest.approx(peak, abs=1e-14)


@EVERY_LAW
def test_the_velocity_is_the_rate_at_which_the_path_is_covered(law):
    gauss, weight = np.polynomial.legendre.leggauss(3)  # exact to degree 5, piece by piece
    ends = [0.0, *law.ends, 1.0]
    covered = 0.0
    for a, b in pairwise(ends):
        covered += 0.5 * (b - a) * weight @ law.velocity(0.5 * (a + b) + 0.5 * (b - a) * gauss)
        assert law.position(b) == pytest.approx(covered, abs=1e-14)


@pytest.mark.parametrize("share", SHARES)
def test_a_trapezoid_accelerates_travels_and_brakes(share):
    law, peak = timing_law("trapezoidal", share), 1 / (1 - share)
    assert law.velocity([0.0, 1.0]) == pytest.approx(0.0, abs=1e-13)
    inside = np.array([0.5 * share, 1 - 0.5 * share])
    assert law.velocity(inside) == pytest.approx(0.5 * peak)
    assert law.velocity(np.linspace(share, 1 - share, 7)) == pytest.approx(peak)
    assert law.acceleration(inside) == pytest.approx(np.array([1, -1]) * peak / share)
    assert law.position(0.5) == pytest.approx(0.5)
    # no jump where the pieces meet: the velocity between two sides moves by the acceleration only
    for end in law.ends:
        for quantity, slope in ((law.position, peak), (law.velocity, peak / share)):
            assert abs(quantity(end) - quantity(end - 1e-9)) <= 1.1e-9 * slope


@pytest.mark.parametrize("share", [0.0, -0.1, 0.51, np.nan])
def test_a_share_that_leaves_no_time_is_refused(share):
    with pytest.raises(UsageError, match="share"):
        timing_law("trapezoidal", share)


@pytest.mark.parametrize("tau", [-1e-9, 1.0 + 1e-9, np.nan, np.inf])
def test_laws_are_not_extrapolated(tau):
    with pytest.raises(UsageError, match="0 <= tau <= 1"):
        timing_law("quintic").position([0.5, tau])


def test_an_unknown_law_is_refused_with_those_there_are():
    with pytest.raises(UsageError, match=r"'septic'.*linear, cubic, quintic, trapezoidal"):
        timing_law("septic")
