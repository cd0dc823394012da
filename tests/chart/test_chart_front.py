"""Fronts follow from the numbers alone; the same chart has the same errors; failures have names."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from charts import CASES, SMALL, charted, found, rows_of
from scipy.interpolate import RBFInterpolator

from eigassign import load_case
from eigassign.chart import EVALUATIONS, ChartPoint, build_subject, compare_methods, errors, front


def row(name: str, preparation: float, each: float, worst: float, curve: str = "") -> ChartPoint:
    return ChartPoint(name, curve, "", preparation, each, 0.0, worst, worst, None, 0)


def test_no_member_is_beaten_and_every_other_is_beaten_or_too_wrong_or_a_mesh() -> None:
    random = np.random.default_rng(0)
    for accuracy in np.repeat([0.0, 2.0, 5.0, np.inf], 10):
        numbers = random.integers(0, 8, (25, 3)).astype(float)
        numbers[0, 2] = np.inf  # no number somewhere
        points = [row(str(k), *numbers[k], "mesh" * (k == 1)) for k in range(25)]
        cost, error = np.array([(p.cost_s(4), p.worst_relative) for p in points]).T
        assert cost == pytest.approx(numbers[:, 1] + numbers[:, 0] / 4)
        kept = [int(name) for name in front(points, 4, accuracy).methods]
        for k in range(25):
            no_worse = (cost <= cost[k]) & (error <= error[k]) & (np.arange(25) != 1)
            beaten = (no_worse & ((cost < cost[k]) | (error < error[k]))).any()
            if k in kept:
                assert not beaten
                assert error[k] <= accuracy
                assert k > 1
            else:
                equal = any(cost[j] == cost[k] and error[j] == error[k] for j in kept)
                assert beaten or equal or error[k] > accuracy or k == 1
        assert list(cost[kept]) == sorted(cost[kept])


def test_constant_answers_and_what_is_hardly_better_are_on_no_front() -> None:
    """Where anything is accurate enough, the cheapest are still left out."""
    chart = charted("stress/mode_swaps", 0.99)
    subject = build_subject(load_case(CASES / "stress/mode_swaps.yaml"))[0]
    exact = subject.exact(subject.tested(SMALL).x)
    low, high = exact.min(), exact.max()
    best = 2.0 * low * high / (low + high)  # of all constants
    worst = errors(np.full_like(exact, best), exact)[0]
    assert worst == pytest.approx((high - low) / (high + low))
    points = (*chart.points, row("constant", 0.0, 0.0, worst))
    for one in chart.fronts:
        assert front(points, one.evaluations, 0.99, worst) == one
        assert all(p.worst_relative <= worst / 2 for p in points if p.method in one.methods)
    assert any(worst / 2 < p.worst_relative <= 0.99 for p in chart.points)


@pytest.mark.parametrize("name", ["mode_swaps", "veering", "exact_crossing"])
def test_a_method_that_misses_a_kink_is_named_and_on_no_front(name: str) -> None:
    chart = charted(f"stress/{name}")
    learn = ("interpolation", "response", "radial")
    missing = [p for p in chart.points if p.curve.startswith(learn) and p.worst_relative > 1e-2]
    assert missing
    told = found(chart, "too few samples to see a kink").methods
    for p in missing:
        assert p.curve in told
        assert not any(p.method in one.methods for one in chart.fronts)
    assert [one.evaluations for one in chart.fronts] == list(EVALUATIONS)


def test_radial_basis_functions_are_as_wrong_as_scipys_between_the_samples() -> None:
    """Not the 6e-16 that they are at the nine samples of a motion over a kink."""
    case = load_case(CASES / "stress/mode_swaps.yaml")
    q = case.trajectory.q
    everywhere = np.linspace(q[0], q[-1], 2000)
    hz, dense = (case.model().frequencies(at, [], 1) for at in (q, everywhere))
    worst = np.abs(RBFInterpolator(q, hz)(everywhere) / dense - 1.0).max()
    (charted_row,) = rows_of(charted("stress/mode_swaps"), "radial basis functions").values()
    assert worst > 5e-3
    assert 0.9 * worst < charted_row.worst_relative <= worst


def test_the_same_chart_twice_has_the_same_methods_and_errors_to_the_last_digit() -> None:
    once = charted("stress/wide_motion")
    again = compare_methods(load_case(CASES / "stress/wide_motion.yaml"), SMALL)

    def timeless(p: ChartPoint) -> ChartPoint:
        return replace(p, preparation_s=0.0, trajectory_s=0.0, spread_s=0.0)

    assert [*map(timeless, once.points)] == [*map(timeless, again.points)]
    assert (once.boxes, once.reach) == (again.boxes, again.reach)
    assert [f.kind for f in once.findings] == [f.kind for f in again.findings]


# --- Failures by name

KINDS = {
    "../two_link": set[str](),
    "mode_swaps": {"crossing", "too few samples to see a kink"},
    "veering": {"veering", "too few samples to see a kink"},
    "exact_crossing": {"crossing", "too few samples to see a kink"},
    "straight_arm": {"straight or folded arm"},
    "wide_motion": {"radius of convergence"},
    "decoupled_body": {"a part is decoupled"},
    "repeated_modes": {"repeated modes"},
}


@pytest.mark.parametrize("name", KINDS)
def test_cases_of_one_trouble_have_its_name_and_no_other(name: str) -> None:
    findings = charted(f"stress/{name}").findings
    assert {each.kind for each in findings} == KINDS[name]
    assert all(each.where and each.methods and each.why and each.instead for each in findings)


def test_modes_that_meet_are_told_with_place_and_gap() -> None:
    swap = found(charted("stress/mode_swaps"), "crossing")
    assert (swap.modes, swap.where) == ((1, 2), "q = 150.735 deg")
    assert abs(swap.gap) < 1e-7
    model = load_case(CASES / "stress/mode_swaps.yaml").model()
    assert np.ptp(model.frequencies(np.radians([150.735]), [], 2)) < 1e-3
    assert found(charted("stress/exact_crossing"), "crossing").where == "E = 70 GPa"
    modulus = np.linspace(69e9, 71e9, 2001)[:, None]
    hz = load_case(CASES / "stress/veering.yaml").model().frequencies([], modulus, 2)
    gap = hz[:, 1] / hz[:, 0] - 1.0
    near = found(charted("stress/veering"), "veering")
    assert near.gap == pytest.approx(gap.min(), rel=1e-4)
    assert near.gap == pytest.approx(9.8e-4, rel=1e-3)
    told = float(near.where.removeprefix("E = ").removesuffix(" GPa"))
    assert told == pytest.approx(modulus[gap.argmin(), 0] / 1e9, abs=1e-3)
    assert near.modes == found(charted("stress/repeated_modes"), "repeated modes").modes == (1, 2)


THREE = """title: Three cantilevers
mechanism:
  space: planar
  materials:
    a: {youngs_modulus: 70 GPa, density: 2700}
    b: {youngs_modulus: 62 GPa, density: 2700}
    c: {youngs_modulus: 62.3 GPa, density: 2700}
  sections: {rod: {area: 3e-4, bending_inertia: 8e-9}}
  links:
    la: {length: 0.5, material: a, section: rod, elements: 2}
    lb: {length: 0.5, material: b, section: rod, elements: 2}
    lc: {length: 0.5, material: c, section: rod, elements: 2}
  joints:
    ja: {type: fixed, base: ground, follower: la.start}
    jb: {type: fixed, base: ground, follower: lb.start, position: [0, 0.1]}
    jc: {type: fixed, base: ground, follower: lc.start, position: [0, 0.2]}
coordinates: {}
design: {E: {parameter: materials.a.youngs_modulus, min: 60 GPa, max: 80 GPa}}
"""
ROUND_ARM = """title: Round arm in space
mechanism:
  space: spatial
  materials: {m: {youngs_modulus: 69 GPa, density: 2700, poissons_ratio: 0.33}}
  sections: {rod: {shape: circle, diameter: 25 mm}}
  links:
    a: {length: 0.5, material: m, section: rod, elements: 2}
    b: {length: 0.4, material: m, section: rod, elements: 2}
  joints:
    j1: {type: fixed, base: ground, follower: a.start}
    j2: {type: revolute, base: a.end, follower: b.start, axis: [0, 1, 0]}
coordinates: {q: {joint: j2, drive: locked}}
trajectory: {points: [[-90 deg], [90 deg]], duration: 1 s, samples: 41}
design: {d: {parameter: sections.rod.diameter, min: 24 mm, max: 26 mm}}
"""


def test_a_mode_that_passes_two_others_at_once_is_found(tmp_path: Path) -> None:
    """On the way from 60 to 80 GPa the first becomes the third."""
    (tmp_path / "three.yaml").write_text(THREE)
    crossing = found(charted(tmp_path / "three.yaml"), "crossing")
    assert (crossing.modes, crossing.where) == ((1, 2), "E = 62 GPa")


def test_modes_that_touch_and_part_again_do_not_cross(tmp_path: Path) -> None:
    """With a straight arm of round section both planes of bending are alike."""
    (tmp_path / "round.yaml").write_text(ROUND_ARM)
    kinds = {each.kind for each in charted(tmp_path / "round.yaml").findings}
    assert not kinds & {"crossing", "veering", "too few samples to see a kink"}
