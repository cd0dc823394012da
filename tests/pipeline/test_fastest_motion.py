"""The fastest motion that stands still: against grids and integrations, and what is said of it."""

import csv
import json
from collections.abc import Callable, Iterator
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from calibration import Floats
from scipy.interpolate import CubicSpline
from whole_moves import largest, left, whole_scara

import eigassign as ea
from eigassign.assignment import design_limits
from eigassign.errors import CaseError
from eigassign.mechanism import Moving
from eigassign.modal import Shaper, Sizes, residual_share
from eigassign.pipeline import Options, optimize

CASES = Path(__file__).parents[2] / "cases"
Tree = dict[str, Any]
FINE = Sizes(steps=640, poses=5, loads=25)
TIMES = np.linspace(0.12, 0.4, 100)


def small(law: str = "quintic", *names: str, **residual: Any) -> Tree:
    """The shipped SCARA of one element each, with the motion time and some of its parameters."""
    data: Tree = yaml.safe_load((CASES / "scara.yaml").read_text())
    del data["expansion"], data["validation"]
    for link in data["mechanism"]["links"].values():
        link["elements"] = 1
    data["trajectory"] |= {"samples": 11, "timing": law}
    data["design"] = {name: data["design"][name] for name in (*(names or ("k1",)), "T")}
    target = {"at": "forearm.end", **residual}
    data["targets"] = [{"residual": target, "at_most": target.pop("at_most", "0.5 mm")}]
    return data


def limits(case: ea.Case) -> tuple[Any, Any]:
    """The limit of the residual, and that of a torque."""
    own = list(design_limits(case.file, case.model(), case.trajectory))
    return next(one for one in own if one.is_residual), own[0]


def fastest_of_grid(case: ea.Case, count: int = 12, torque: float = np.inf) -> float:
    """The least of `TIMES` at which some design of a grid keeps the limits."""
    residual, load = limits(case)
    ends, best = case.file.box[:-1], np.inf
    for design in product(*(np.linspace(low, high, count) for low, high in ends)):
        y = np.array([*design, 0.25])
        kept = residual.quantity.along(y, TIMES) <= residual.allowed[1]
        if torque < np.inf:  # without gravity it goes as 1/T²
            kept &= np.abs(load.quantity(y)[0]).max() * (0.25 / TIMES) ** 2 <= torque
        best = min([best, *TIMES[kept][:1]])
    return float(best)


def checked(data: Tree, count: int = 12, torque: float = np.inf) -> Floats:
    """The optimum: no slower than that of the grid, its residual kept with finer steps."""
    case = ea.load_case(data)
    found = ea.assign(case)
    y = np.array(list(found.design.values()))
    assert found.results.assignment.verdict in ("reached", "improved")
    # a basin of the grid's best begins up to a step before it
    assert y[-1] <= fastest_of_grid(case, count, torque) + TIMES[1] - TIMES[0]
    residual, _ = limits(case)
    assert residual.quantity.along(y, y[-1:], FINE)[0] <= residual.allowed[1]
    return y


SLOW = [
    *((law, most, ("k2",)) for law, most in [("quintic", "0.3 mm"), ("trapezoidal", "0.6 mm")]),
    ("cubic", "0.2 mm", ("k2", "h1")),  # starts without a look at the lobes end at 0.20 s, missed
]


@pytest.mark.parametrize(
    ("law", "most", "others"),
    [("quintic", "0.5 mm", ()), ("trapezoidal", "1.5 mm", ())]
    + [pytest.param(*each, marks=pytest.mark.slow) for each in SLOW],
)
def test_no_motion_of_a_grid_is_faster(law: str, most: str, others: tuple[str, ...]) -> None:
    checked(small(law, "k1", *others, at_most=most))


def test_a_torque_bounds_the_motion_from_the_other_side() -> None:
    data = small()
    data["design"]["torque"] = {"q1": {"max": "150 N m"}}
    y = checked(data, torque=150.0)
    _, load = limits(ea.load_case(data))
    values, slopes = load.quantity(y)
    assert y[-1] > 0.2  # 0.195 s without it
    assert np.abs(values).max() == pytest.approx(150.0, rel=2e-3)
    given = load.quantity(np.array([y[0], 0.25]))[0]  # at the duration of the file
    np.testing.assert_allclose(values, given * (0.25 / y[-1]) ** 2, rtol=1e-12, atol=1e-9)
    h = np.array([0.0, 1e-5])  # of 1/T² differences err by 2 (h/T)² = 5e-9
    beside = (load.quantity(y + h)[0] - load.quantity(y - h)[0]) / 2e-5
    np.testing.assert_allclose(slopes[:, -1], beside, atol=1e-7 * np.abs(beside).max())


def test_a_residual_is_a_limit_beside_wanted_frequencies() -> None:
    """The motion time is given: softer or stiffer drives than those of 21 Hz leave less."""
    data = small(at_most="0.6 mm")
    del data["design"]["T"], data["assignment"]
    data["targets"].append({"mode": 1, "frequency": "21 Hz"})
    case = ea.load_case(data)
    found = ea.assign(case)
    residual, q = limits(case)[0], case.trajectory.q
    grid = np.linspace(15e3, 45e3, 121)[:, None]
    hz = np.array([case.model().frequencies(q, np.tile(k, (len(q), 1)), 1)[:, 0] for k in grid])
    missed = np.sqrt(np.mean((hz / 21.0 - 1.0) ** 2, axis=1))
    kept = np.array([residual.quantity(k)[0] for k in grid]) <= residual.allowed[1]
    assert not kept[missed.argmin()]
    assert found.results.error.exact.rms_relative <= missed[kept].min() * (1.0 + 1e-6)
    (row,) = found.results.moves
    assert row.duration == 0.25
    assert row.residual <= row.limit


def test_a_direction_takes_its_own_part_of_the_way() -> None:
    y, times = np.array([30e3, 0.25]), np.array([0.15, 0.2, 0.25])
    case = ea.load_case(small(direction=[0.6, 0.8]))
    way = np.einsum("tdi,d->ti", left(whole_scara(case, y), times), (0.6, 0.8))
    found = limits(case)[0].quantity.along(y, times)
    # both integrations err by 1e-3 of the largest; along the others 1.3 to 1.7 times as much
    np.testing.assert_allclose(found, np.abs(way).max(axis=1), atol=2e-3 * found.max())


def test_the_last_part_of_the_motion_counts_where_it_is_asked_for() -> None:
    data = small(last="10 %")
    data["assignment"], data["design"] = {"objective": "lightest"}, {"k1": data["design"]["k1"]}
    data["targets"][0]["at_most"] = "8 mm"
    (row,) = ea.assign(ea.load_case(data)).results.moves
    late = row.time_s >= 0.9 * row.duration
    assert row.residual == pytest.approx(row.error[late].max(), rel=1e-6)
    assert row.residual > 1.1 * row.error[row.time_s >= row.duration].max()


def test_of_a_range_of_damping_the_worst_end_counts() -> None:
    y = np.array([30e3, 0.25])

    def along(damping: Any) -> Any:
        case = ea.load_case(small() | {"damping": damping})
        return limits(case)[0].quantity.along(y, TIMES)

    low, high = along("1 %"), along("6 %")
    assert (low > high).any()
    assert (low < high).any()  # in a valley
    np.testing.assert_array_equal(along(["1 %", "6 %"]), np.maximum(low, high))


# --- what is written, and what shapers leave


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("fastest") / "case.yaml"
    path.write_text(yaml.safe_dump(small(), sort_keys=False))
    out = path.parent / "run"
    optimize(path, Options(out=out, use_cache=False, figures=(), report="none"))
    return out


def shapers(folder: Path) -> Iterator[tuple[str, Floats, Floats]]:
    """Name, amplitudes and times by `shapers.csv`."""
    with open(folder / "shapers.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    for name in dict.fromkeys(row["shaper"] for row in rows):
        own = [row for row in rows if row["shaper"] == name]
        yield name, *(np.array([float(r[key]) for r in own]) for key in ("amplitude", "time [s]"))


def test_a_run_says_what_the_move_leaves_and_what_controllers_take(folder: Path) -> None:
    results = json.loads((folder / "results.json").read_text())
    row = results["moves"]["residual vibration of forearm.end"]
    assert row["duration"] == results["design"]["T"]["optimal"]
    assert 0.998 * row["limit"] < row["residual"] <= row["limit"] == 5e-4 < row["before"]
    assert row["confirmed"] == pytest.approx(row["residual"], rel=2e-3)
    aim = results["assignment"]["aim"]
    assert (aim["initial"], aim["optimal"], aim["unit"]) == (0.25, row["duration"], "s")
    told = {one["name"]: one for one in row["shapers"]}
    assert {name for name, *_ in shapers(folder)} == told.keys() - {"zv over time"}
    for name, A, t in shapers(folder):
        assert (A.sum(), t[-1]) == (pytest.approx(1.0, abs=1e-12), told[name]["delay"])
    lines, hz = (folder / "shapers.txt").read_text(), float(told["mzv"]["hz"])
    assert "[input_shaper]\nshaper_type_x: mzv\nshaper_freq_x: " in lines
    (said,) = (line for line in lines.splitlines() if line.startswith('M593 P"mzv" F'))
    assert float(said.split()[2][1:]) == pytest.approx(hz, rel=1e-3)
    assert f"\n; mzv: {1e3 * told['mzv']['delay']:.3g} ms longer, leaves " in lines


def test_shapers_leave_what_an_integration_of_their_commands_says(folder: Path) -> None:
    results = json.loads((folder / "results.json").read_text())
    (row,) = results["moves"].values()
    told = {one["name"]: one["residual"] for one in row["shapers"]}
    case, T = ea.load_case(folder / "case.yaml"), row["duration"]
    start, end = case.trajectory.q[[0, -1]]
    y = np.array([one["optimal"] for one in results["design"].values()])
    times, *q = np.genfromtxt(folder / "zv_over_time_1.csv", delimiter=",", skip_header=1).T
    curve, matter = CubicSpline(times, np.deg2rad(q), axis=1), whole_scara(case, y)
    matter.moving, matter.T = lambda t, _: Moving(curve(t).T, *[np.zeros((0, 2))] * 2), times[-1]
    exact = largest(matter, times[-1:], 201)[0]
    assert told["zv over time"] == pytest.approx(exact, rel=5e-2)
    assert told["zv over time"] < 0.3 * min(told["zv"], row["residual"])
    for name, A, t in [*shapers(folder)][:3]:  # zv, mzv, zv*zv

        def command(time_s: Floats, _: Floats, A: Floats = A, t: Floats = t) -> Moving:
            tau = np.clip((time_s[:, None] - t) / T, 0.0, 1.0)
            share = (tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2)) @ A
            return Moving(start + share[:, None] * (end - start), *[np.zeros((0, 2))] * 2)

        matter = whole_scara(case, y)
        matter.moving, matter.T = command, T + t[-1]
        # 2e-3: the spline through 201 forces, over the corners of their third derivative
        exact = largest(matter, np.array([matter.T]), 201)[0]
        assert told[name] == pytest.approx(exact, rel=1e-2), name


ONE = """
title: One mode
mechanism:
  space: planar
  links: {a: {type: rigid, nodes: {hub: [0, 0], end: [0.8, 0]}}}
  joints: {hub: {type: revolute, base: ground, follower: a.hub}}
  bodies: {m: {at: a.end, mass: 3}}
coordinates: {q: {joint: hub, drive: {stiffness: 4 kN m/rad}}} # 7.3 Hz
trajectory: {points: [[0.2], [0.8]], duration: 0.2, samples: 11}
design: {m: {parameter: bodies.m.mass, min: 3, max: 4}}
targets: [{residual: {at: a.end}, at_most: 1}]
assignment: {objective: lightest}
"""


def test_a_stiff_axis_on_a_soft_one_vibrates_as_on_one_that_is_locked() -> None:
    """Its mode of 260 Hz is 36 times the lowest; forces along the arm do not turn it."""
    tree, left_over = yaml.safe_load(ONE), []
    tree["mechanism"]["links"]["b"] = {"type": "rigid", "nodes": {"end": [0, 0]}}
    slide = {"type": "prismatic", "base": "a.end", "follower": "b.end"}
    tree["mechanism"]["joints"]["slide"], tree["mechanism"]["bodies"]["m"]["at"] = slide, "b.end"
    tree["coordinates"]["s"] = {"joint": "slide", "drive": {"stiffness": 8e6}}
    tree["trajectory"] = {"points": [[0, 0], [0, 0.3]], "duration": 0.1, "timing": "cubic"}
    tree["targets"][0]["residual"] = {"at": "b.end", "direction": [1, 0]}
    for drive in (tree["coordinates"]["q"]["drive"], "locked"):
        tree["coordinates"]["q"]["drive"] = drive
        quantity = limits(ea.load_case(tree))[0].quantity
        left_over.append(quantity.along(np.array([3.0]), np.linspace(0.02, 0.2, 19)))
    np.testing.assert_allclose(*left_over, atol=1e-4 * left_over[1].max())


def test_of_a_constant_frequency_shapers_leave_their_share() -> None:
    """Of one mode without damping it is V, whatever the motion: the integration errs by 1e-6."""
    (row,) = ea.assign(ea.load_case(yaml.safe_load(ONE))).results.moves
    hz = np.sqrt(4e3 / (3.0 * 0.8**2)) / (2.0 * np.pi)
    told = {one.name: one.residual for one in row.shapers}
    assert len(told) == 5
    for name, A, t in row.impulses:
        V = residual_share(Shaper(name, A, t, (hz,), (0.0,)), hz)
        assert told[name] == pytest.approx(row.residual * V, abs=1e-6 * row.residual)


ONE_ONLY = r"design\.T\.parameter: .* one trajectory with a duration"
REFUSED: list[tuple[Callable[[Tree], Any], str]] = [
    (lambda d: d["coordinates"]["q2"].pop("drive"), r"coordinates\.q2: is free"),
    (lambda d: d["design"].pop("T"), "assignment.objective: fastest needs a design parameter"),
    (lambda d: d["trajectory"].update(times=[0, d["trajectory"].pop("duration")]), ONE_ONLY),
    (lambda d: d.update(trajectory=[{**d["trajectory"], "name": n} for n in "ab"]), ONE_ONLY),
    (lambda d: d["targets"][0].pop("at_most"), r"targets\[0\]\.at_most: required key is missing"),
    (lambda d: d["targets"][0]["residual"].update(at="x"), r"residual\.at: unknown link 'x'"),
    (lambda d: d["targets"][0]["residual"].update(last=2), r"residual\.last: must be < 1"),
    (lambda d: d["targets"][0]["residual"].update(direction=""), r"direction: expected 'any', or"),
]


@pytest.mark.parametrize(("change", "said"), REFUSED)
def test_what_cannot_be_meant_is_refused(change: Callable[[Tree], Any], said: str) -> None:
    data = small()
    change(data)
    with pytest.raises(CaseError, match=said):
        ea.assign(ea.load_case(data))


def test_a_part_whose_inner_directions_are_not_known_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(CASES)
    data: Tree = yaml.safe_load((CASES / "superelement_arm.yaml").read_text())
    data["targets"] = [{"residual": {"at": "forearm.end"}, "at_most": "1 mm"}]
    for own in data["coordinates"].values():
        own["drive"] = {"stiffness": 1e5}
    with pytest.raises(CaseError, match=r"links\.forearm: has inner dofs of unknown direction"):
        ea.assign(ea.load_case(data))
