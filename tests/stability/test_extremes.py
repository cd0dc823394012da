"""Meshes, masses, stiffnesses, orders and poses at the ends of what there is."""

import itertools

import numpy as np
import pytest
from chains import bar, model_of, two_link
from spatial_cases import linkage
from stress import case, judged, stated

from eigassign import load_case
from eigassign.errors import AccuracyError, UsageError
from eigassign.modal import Model, expand, raise_order, reduce, rounding_error

Q0, Y0 = np.array([1.817, 5.312]), np.array([0.125, 0.125])
ELBOW_AT_1 = [0.0, 1.0]

# --- The modes of one pose alone: tens of percent wrong on the paper's arm, which is measured


def test_without_derivatives_the_basis_loses_a_mode_and_that_is_measured():
    model = load_case("cases/two_link.yaml").model()
    reduced = reduce(model.pencil, Q0, Y0, (1,), 0)
    q = np.array(Q0) + np.column_stack([np.zeros(61), np.linspace(-1.05, 1.05, 61)])
    error = judged(model, reduced, q, [0.0, 0.0])
    assert error.max() > 0.1
    assert stated(model, reduced, q, [0.0, 0.0])[0] >= error.max()


# --- 1000 elements a link: strain energy is a small difference of large numbers


def test_rigid_modes_stay_out_and_the_round_off_is_stated():
    model = case("fine_mesh").model()
    f = model.frequencies(Q0, Y0, 2)[0]
    lost = rounding_error(model.pencil, model.x(Q0, Y0)[0], 2)
    # The mesh of 40 elements a link is converged to 1e-8, its own round-off is as small.
    coarse = model_of(two_link(elements=(40, 40))).frequencies(Q0, Y0, 2)[0]
    assert 1e-6 < lost < 0.05
    # 2e-6: the printed area of the case against the one of the helper
    assert np.abs(f / coarse - 1.0).max() < lost + 2e-6


def test_a_reduced_model_has_it_too_or_is_refused():
    model = case("fine_mesh").model()
    try:
        reduced = reduce(model.pencil, Q0, Y0, (1,), 1)
    except AccuracyError as refusal:
        assert "orthonormal" in str(refusal)  # noqa: PT017
    else:
        lost = rounding_error(model.pencil, model.x(Q0, Y0)[0], 1)
        assert judged(model, reduced, Q0, Y0).max() < lost


@pytest.mark.parametrize("elements", [10, 40, 160])
def test_the_round_off_of_an_exact_solve_stays_below_what_is_stated(elements):
    """Against the same mesh turned as a whole: nothing physical changes, only the rounding."""
    model = model_of(two_link(elements=(elements, elements), angles=("relative", "relative")))
    q = np.column_stack([np.linspace(0.0, 6.0, 7), np.full(7, 1.0)])
    pencil = model.pencil
    f = model.frequencies(q, Y0, 2)
    lost = rounding_error(pencil, model.x(q[0], Y0)[0], 2)
    assert np.abs(f / f[0] - 1.0).max() <= 2.0 * lost


# --- Order up to 20: the coefficients keep their digits, and the sum is known to lose them outside


@pytest.mark.parametrize("order", [12, 16, 20])
def test_near_the_point_a_high_order_is_right_to_round_off(order):
    model = model_of(two_link())
    expansion = expand(model.pencil, Q0, Y0, (1, 2), order=order)
    q = Q0 + np.column_stack([np.zeros(21), np.linspace(-0.1, 0.1, 21)])
    assert judged(model, expansion, q, Y0).max() < 1e-11


def test_the_error_falls_with_the_order_until_round_off():
    """Half-way to the nearest singularity two orders win a digit, down to 1e-11."""
    model = model_of(two_link())
    q = Q0 + np.array([[0.0, 0.2], [0.0, -0.2]])
    errors = [
        judged(model, expand(model.pencil, Q0, Y0, (1,), order=p), q, Y0).max()
        for p in (4, 8, 12, 16, 20)
    ]
    assert all(b < a for a, b in itertools.pairwise(errors[:4]))
    assert errors[-1] < 1e-9


def test_far_away_a_high_order_is_wild_and_says_so():
    model = model_of(two_link())
    expansion = expand(model.pencil, Q0, Y0, (1,), order=20)
    q = Q0 + np.column_stack([np.zeros(41), np.linspace(-1.5, 1.5, 41)])
    assert judged(model, expansion, q, [0.0, 0.0]).max() > 1.0
    assert stated(model, expansion, q, [0.0, 0.0])[0] > 1.0


# --- An elbow that unfolds over 150°: no one series of mode 2 reaches from end to end


ELBOW = np.deg2rad(np.linspace(20.0, 170.0, 61))
UNFOLDING = np.column_stack([np.zeros(61), ELBOW])
X = np.column_stack([UNFOLDING, np.full(61, 0.1)])
POINT = ([0.0, np.deg2rad(40.0)], [0.1])


@pytest.mark.parametrize("order", [4, 8, 14, 20])
def test_a_polynomial_beyond_its_radius_is_not_believed(order):
    model = case("wide_motion").model()
    expansion = expand(model.pencil, *POINT, (1, 2), order=order)
    error = judged(model, expansion, UNFOLDING, [0.1])
    assert stated(model, expansion, UNFOLDING, [0.1]).max() > 0.05
    near = np.abs(ELBOW - POINT[0][1]) < 0.25
    assert error[near].max() < 1e-3


def test_several_points_reach_over_it():
    model = case("wide_motion").model()
    chosen = raise_order(model.pencil, X, X[30], 1e-3, (1, 2))
    exact = model.frequencies(UNFOLDING, [0.1], 2)
    assert np.abs(chosen.frequencies(UNFOLDING, [0.1]) / exact - 1.0).max() <= 1e-3
    assert len(chosen.parts) > 1
    with pytest.raises(AccuracyError, match=r"off at \(q, y\) = "):
        raise_order(model.pencil, X, X[30], 1e-7, (1, 2), orders=(2,))


def test_one_reduced_model_reaches_over_it():
    model = case("wide_motion").model()
    points = UNFOLDING[[10, 30, 50]]
    found = reduce(model.pencil, points, np.full((3, 1), 0.1), (1, 2), 2)
    assert judged(model, found, UNFOLDING, [0.1]).max() <= 1e-6


# --- Straight and folded, an arm's joint angles have no derivative with respect to its tip


@pytest.mark.parametrize("elbow", [0.0, np.pi])
def test_in_joint_coordinates_the_pose_is_like_any_other(elbow):
    """By symmetry the frequency is even in the elbow angle there: odd coefficients vanish."""
    model = model_of(two_link(angles=("relative", "relative")))
    q0 = [0.3, elbow]
    expansion = expand(model.pencil, q0, Y0, (1, 2), order=6)
    q = np.array(q0) + np.column_stack([np.zeros(9), np.linspace(-0.2, 0.2, 9)])
    assert judged(model, expansion, q, Y0).max() < 1e-4
    odd = expansion.indices[:, 1] % 2 == 1
    scale = np.abs(expansion.coefficients).max()
    assert np.abs(expansion.coefficients[:, odd]).max() < 1e-7 * scale
    reduced = reduce(model.pencil, q0, Y0, (1, 2), 2)
    assert judged(model, reduced, q, Y0).max() < 1e-8


# --- A drive made ever softer: its mode goes to zero frequency, and the forearm hangs free


K = np.concatenate([np.geomspace(1e-6, 100.0, 17), np.linspace(200.0, 1000.0, 9)])[:, None]


def test_far_from_its_point_an_approximation_is_refused_or_covered():
    model = case("decoupled_body").model()
    point = (model.pencil, ELBOW_AT_1, [500.0], (1, 2))
    for found in (*(expand(*point, order=order) for order in (2, 4, 8)), reduce(*point, 3)):
        # of a drive of 1e-6 N m/rad the exact λ itself has lost digits: 4e-10 on one processor
        judged(model, found, ELBOW_AT_1, K, 2e-9)


def test_the_exact_frequency_falls_as_the_root_of_the_stiffness():
    """λ = k/J once the links are stiff beside the drive: a slope of 1/2 over six decades."""
    model = case("decoupled_body").model()
    k = np.geomspace(1e-6, 1.0, 7)
    f = model.frequencies(ELBOW_AT_1, k[:, None], 1)[:, 0]
    slopes = np.diff(np.log(f)) / np.diff(np.log(k))
    np.testing.assert_allclose(slopes, 0.5, atol=5e-4)


def test_no_stiffness_at_all_is_refused_by_name():
    model = case("decoupled_body").model()
    with pytest.raises(UsageError, match=r"drive\.stiffness must be > 0"):
        model.frequencies(ELBOW_AT_1, [0.0], 1)


# --- Parts that know nothing of each other: a mode without a vector in the basis comes down


TINES = 12
TIP = np.linspace(0.0, 0.1, 21)[:, None]  # kg


def comb() -> Model:
    """Cantilevers of 0.25 m / 1.06^k on the ground that know nothing of each other; y at a tip."""
    names = [f"t{k}" for k in range(TINES)]
    bar = {"material": "al", "section": "flat", "elements": 3}
    tree = linkage(
        {name: {**bar, "length": 0.25 / 1.06**k} for k, name in enumerate(names)},
        {name: {"type": "fixed", "base": "ground", "follower": f"{name}.start"} for name in names},
        sections={"flat": {"shape": "rectangle", "width": 0.02, "height": 0.004}},
        materials={"al": {"youngs_modulus": 70e9, "density": 2700.0}},
        bodies={"tip": {"at": f"{names[-1]}.end", "mass": 0.0}},
    ) | {"design": {"y": {"parameter": "bodies.tip.mass", "min": 0.0, "max": 1.0}}}
    return model_of(tree)


@pytest.mark.parametrize("start", [0.0, 0.005])
def test_a_cantilever_that_a_mass_brings_down_is_not_overlooked(start):
    """Of twelve the last one is the stiffest; with 100 g on its tip it has the lowest mode."""
    model = comb()
    exact = model.frequencies([], TIP, 1)[:, 0]
    assert exact[0] == pytest.approx(52.65, abs=0.01)
    assert exact[-1] == pytest.approx(48.25, abs=0.01)
    for approximation in (
        reduce(model.pencil, [], [start], (1,), 2),
        expand(model.pencil, [], [start], (1,), 4),
    ):
        error = judged(model, approximation, [], TIP)
        assert error[exact > 0.999 * exact[0]].max() < 1e-9
        assert error.max() > 0.05
        assert stated(model, approximation, [], TIP)[0] > 0.05


def test_a_second_point_brings_it_into_the_basis():
    model = comb()
    reduced = reduce(model.pencil, np.zeros((2, 0)), TIP[[0, -1]], (1,), 2)
    assert judged(model, reduced, [], TIP).max() < 1e-9


# --- A mass ratio of 1e8: 0.3 g a metre of link carries up to 40 kg


def test_a_cantilever_of_almost_no_mass_is_a_spring_with_a_mass():
    """f = √(3EI/(L³m))/2π; the link's own mass changes it by less than its share, 1e-8."""
    tree = bar(4, 0.5, 70e9, 1e-4, {"area": 3e-4, "bending_inertia": 8e-9})
    tree["mechanism"]["bodies"] = {"load": {"at": "bar.end", "mass": 1.5}}
    f = model_of(tree).frequencies([], [], 1)[0, 0]
    assert f == pytest.approx(np.sqrt(3 * 70e9 * 8e-9 / 0.5**3 / 1.5) / (2 * np.pi), rel=1e-7)


# --- A link ten orders of magnitude stiffer than its neighbour is practically rigid


POSE = [0.2, 0.9]


def test_it_behaves_like_the_soft_link_clamped_to_the_ground():
    """To 1e-7, far above what the 1e-10 of flexibility left and round-off may do."""
    found = case("stiffness_ratio").model().frequencies(POSE, [2e9], 3)
    tree = bar(4, 0.5, 2e9, 1200.0, {"shape": "rectangle", "width": 0.02, "height": 0.015})
    np.testing.assert_allclose(found, model_of(tree).frequencies([], [], 3), rtol=1e-7)


@pytest.mark.parametrize(
    ("name", "q", "at", "ends", "most"),
    [
        ("massless_link", ELBOW_AT_1, 20.0, (5.0, 40.0), 1e-7),
        ("stiffness_ratio", POSE, 2e9, (1e9, 4e9), 1e-6),
    ],
)
def test_of_nearly_massless_and_nearly_rigid_links_both_know_their_errors(name, q, at, ends, most):
    model, y = case(name).model(), np.linspace(*ends, 15)[:, None]
    expansion = expand(model.pencil, q, [at], (1, 2), order=6)
    reduced = reduce(model.pencil, q, [at], (1, 2), 2)
    judged(model, expansion, q, y)
    assert judged(model, reduced, q, y).max() < most
    turned = np.array(q) + np.column_stack([np.zeros(9), np.linspace(-1.0, 1.0, 9)])
    judged(model, reduced, turned, [at])
