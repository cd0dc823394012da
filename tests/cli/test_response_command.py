"""`eigassign response` and the key `response`: files, numbers, free speeds, and what is wrong."""

import csv
import json
from pathlib import Path

import h5py
import numpy as np
import pytest

import eigassign as ea
from eigassign.cli import main
from eigassign.modal import Antiresonances, dampings, modal_response, unit_forces

ARM = (Path(__file__).parents[2] / "cases" / "milling_arm.yaml").read_text().split("design:")[0]
ARM = "\n".join(line for line in ARM.splitlines() if not line.startswith("damping"))
ARM = ARM.replace("elements: auto", "elements: 2").replace(", loss_factor: 0.02", "")
TOOL = ["--at", "forearm.end", "--direction", "0, 1", "--from", "40 Hz", "--to", "60 Hz"]
QUICK = ["--figures", "none", "--report", "none", "--quiet"]


def written(folder: Path, text: str) -> str:
    path = folder / "arm.yaml"
    path.write_text(text)
    return str(path)


def rows_of(path: Path) -> list[dict[str, str]]:
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ea.Case]:
    """A run of the command, and its case."""
    folder = tmp_path_factory.mktemp("response")
    case = written(folder, f"{ARM}\ndamping: {{ratio: [1 %, 2 %], modes: [3 %]}}\n")
    more = ["--teeth", "4", "--harmonics", "3", "--out", str(folder / "out"), *QUICK]
    assert main(["response", case, *TOOL, *more]) == 0
    return folder / "out", ea.load_case(case)


def direct(case: ea.Case, hz: np.ndarray, end: int) -> np.ndarray:
    """H (n, k) at the tool, of one end of the damping."""
    model = case.model()
    x = model.x(case.trajectory.q, case.initial_design)
    own = unit_forces(model, {"forearm.end": [[0.0, 1.0]]})
    found = modal_response(model, dampings(model)[end], own, x, 400.0)
    return found.at(np.tile(2.0 * np.pi * hz, (len(x), 1)))


def test_the_map_holds_the_worse_end_of_the_damping(run: tuple[Path, ea.Case]) -> None:
    folder, case = run
    with h5py.File(folder / "response.h5") as file:
        hz, H = file["1/frequency_hz"][:], file["1/response"][:]
    both = np.array([direct(case, hz, end) for end in (0, 1)])
    np.testing.assert_allclose(H, both, rtol=1e-9)
    stiffness = 1.0 / np.abs(both).max(axis=0)
    rows = rows_of(folder / "response.csv")
    least, real = ([float(row[key]) for row in rows] for key in [*rows[0]][1:])
    np.testing.assert_allclose(least, stiffness.min(axis=0), rtol=1e-9)
    np.testing.assert_allclose(real, both.real.min(axis=(0, 1)), rtol=1e-9)
    assert np.diff(np.log(hz)).max() < 0.26 * 0.01  # a quarter of the least ratio
    results = json.loads((folder / "results.json").read_text())["responses"]
    (row,) = results.values()
    assert row["least"] <= stiffness.min() * (1.0 + 1e-9)


@pytest.mark.parametrize("zeta", [0.03, 1e-3, 1e-5, 1e-7])
def test_what_is_least_is_at_no_frequency_of_a_grid(zeta: float, tmp_path: Path) -> None:
    """Against many frequencies about the peaks of every sample."""
    case = ea.load_case(written(tmp_path, f"{ARM}\ndamping: {zeta}\n"))
    at = {"at": "forearm.end", "direction": [0, 1], "lowest": "5 Hz", "highest": "300 Hz"}
    (row,), model = ea.response(case, **at), case.model()
    x = model.x(case.trajectory.q, case.initial_design)
    own = unit_forces(model, {"forearm.end": [[0.0, 1.0]]})
    (damping,) = dampings(model)
    found = modal_response(model, damping, own, x, 2000.0)
    beside = 1.0 + zeta * np.linspace(-2.0, 2.0, 401)
    H = found.at((np.sqrt(found.lam[:, :6, None]) * beside).reshape(len(x), -1))
    assert row.least == pytest.approx(1.0 / np.abs(H).max(), rel=2e-3)
    assert row.real == pytest.approx(H.real.min(), rel=5e-3)


def test_modes_have_their_constants_in_units(run: tuple[Path, ea.Case]) -> None:
    folder, case = run
    rows, model = rows_of(folder / "modes.csv"), case.model()
    n = len(case.trajectory.q)
    assert len(rows) % n == 0
    heads = list(rows[0])
    place = "forearm.end along [0, 1]"
    assert heads[-3:] == [f"{place} constant [1/sqrt(kg)]", f"{place} modal mass [kg]",
                          f"{place} modal stiffness [N/m]"]  # fmt: skip
    count = len(rows) // n
    hz = model.frequencies(case.trajectory.q, case.initial_design, count)
    of = lambda key: np.array([float(row[key]) for row in rows]).reshape(n, count)  # noqa: E731
    np.testing.assert_allclose(of("frequency [Hz]"), hz, rtol=1e-9)
    np.testing.assert_allclose(of("damping ratio least [1]")[:, :2], [[0.03, 0.01]] * n)
    np.testing.assert_allclose(of("damping ratio most [1]")[:, :2], [[0.03, 0.02]] * n)
    b, mass, stiffness = (of(key) for key in heads[-3:])
    np.testing.assert_allclose(mass * b**2, 1.0)
    np.testing.assert_allclose(stiffness, mass * (2.0 * np.pi * hz) ** 2, rtol=1e-9)
    assert (of("tracked") == of("mode")).all()  # modes of this arm do not cross


def test_free_speeds_meet_no_mode_and_others_do(run: tuple[Path, ea.Case]) -> None:
    folder, case = run
    (row,) = json.loads((folder / "results.json").read_text())["responses"].values()
    free = [(one["lowest"], one["highest"]) for one in row["free_speeds"]]
    hz = case.model().frequencies(case.trajectory.q, case.initial_design, 10)
    zeta = np.array([0.03, *[0.02] * 9])
    low, high = (hz * (1.0 - zeta)).min(axis=0), (hz * (1.0 + zeta)).max(axis=0)
    for rpm in np.linspace(600.5, 899.5, 400):
        passing = rpm / 60.0 * 4.0 * np.arange(1, 4)[:, None]
        meets = bool(((low < passing) & (passing < high)).any())
        assert meets != any(a <= rpm <= b for a, b in free), rpm


def test_loss_factors_of_two_per_cent_give_what_direct_solves_gave(tmp_path: Path) -> None:
    """9.925 N/µm at 50 Hz as built, 11.22 with the softest drives: K (1 + iη) − ω²M, solved."""
    text = ARM.replace("poissons_ratio: 0.3}", "poissons_ratio: 0.3, loss_factor: 0.02}")
    text = text.replace("motor_inertia", "loss_factor: 0.02, motor_inertia")
    at, k1 = {"at": "forearm.end", "direction": [0, 1]}, "k1: {parameter: coordinates.q1.drive"
    design = f"\ndesign:\n  {k1}.stiffness, min: 1.2e6, max: 3.2e6}}\n" + (
        "  k2: {parameter: coordinates.q2.drive.stiffness, min: 0.6e6, max: 1.6e6}\n"
    )
    case = ea.load_case(written(tmp_path, text + design))
    (row,) = ea.response(case, **at, lowest="50 Hz", highest="50 Hz")
    assert row.stiffness.shape == (25, 1)
    assert row.stiffness.min() == pytest.approx(9.9255e6, rel=1e-3)
    out = ["--y", "1.2e6, 0.6e6", "--out", str(tmp_path / "out"), *QUICK]
    assert main(["response", str(tmp_path / "arm.yaml"), *TOOL, *out]) == 0
    rows = rows_of(tmp_path / "out" / "response.csv")
    near = min(rows, key=lambda row: abs(float(next(iter(row.values()))) - 50.0))
    assert float([*near.values()][1]) == pytest.approx(11.223e6, rel=0.01)


def test_optimize_draws_what_the_case_asks_for(tmp_path: Path) -> None:
    """Two responses, one of them from node to node, beside those of the initial design."""
    text = ARM + (
        "\ndamping: 1 %\nresponse:\n  - {at: forearm.end, direction: [0, 1], from: 5, to: 60}\n"
        "  - {at: forearm.end, direction: [0, 1], seen: {at: upper_arm.end, direction: [1, 0]}, "
        "from: 5, to: 100}\ndesign:\n  k1: {parameter: coordinates.q1.drive.stiffness, min: 1.2e6, "
        "max: 3.2e6}\ntargets: [{mode: 1, frequency: 16}]\n"
    )
    case, out = written(tmp_path, text), tmp_path / "out"
    assert main(["optimize", case, "--out", str(out), "--study", "none"]) in (0, 1)
    names = {path.name for path in (out / "figures").iterdir()}
    assert {f"response_{k}{end}.png" for k in (1, 2) for end in ("", "_map")} <= names
    assert "Dynamic stiffness" in (out / "report.html").read_text()
    results = json.loads((out / "results.json").read_text())["responses"]
    assert [row["mesh"] is None for row in results.values()] == [False, True]
    assert all(row["before"] != row["least"] for row in results.values())
    again = ea.load_case(str(out / "case.yaml"))
    assert again.file.responses == ea.load_case(case).file.responses


WRONG = [
    (["--at", "forearm.ende", *TOOL[2:]], "forearm.ende"),
    (["--at", "forearm.end", "--direction", "0, 1"], "from: required key is missing"),
    ([*TOOL[:2], "--direction", "1", *TOOL[4:]], "direction"),
    ([*TOOL[:4], "--from", "60 Hz", "--to", "40 Hz"], "lowest frequency comes first"),
    ([*TOOL, "--harmonics", "2"], "give teeth"),
    ([*TOOL[:4], "--from", "40 m", "--to", "60 Hz"], "from"),
    ([], "response"),
]


@pytest.mark.parametrize(("given", "told"), WRONG)
def test_what_is_wrong_is_named(
    given: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = written(tmp_path, f"{ARM}\ndamping: 1 %\n")
    assert main(["response", case, *given, "--out", str(tmp_path / "out")]) == 2
    assert told in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (("drive: {stiffness: 1.8 MN m/rad", "drive: {inertia: 1"), "q1"),
        (("response: {at: forearm.end", "response: {at: forearm.none"), "forearm.none"),
        (("from: 40", "form: 40"), "did you mean 'from'"),
    ],
)
def test_wrong_cases_are_named_with_their_lines(
    change: tuple[str, str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (
        ARM + "\ndamping: 1 %\nresponse: {at: forearm.end, direction: [0, 1], from: 40, to: 60}\n"
    )
    assert change[0] in text
    text = text.replace(*change).replace(
        "inertia: 1, motor_inertia: 5e-3, ratio: 150", "inertia: 1"
    )
    assert main(["response", written(tmp_path, text), "--out", str(tmp_path / "out")]) == 2
    assert told in capsys.readouterr().err


def test_where_nothing_gives_way_that_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A response at a pivot on the ground."""
    case = written(tmp_path, f"{ARM}\ndamping: 1 %\n")
    given = ["--at", "upper_arm.start", *TOOL[2:], "--out", str(tmp_path / "out")]
    assert main(["response", case, *given]) == 2
    assert "nothing gives way: upper_arm.start" in capsys.readouterr().err


def test_without_damping_that_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case = written(tmp_path, ARM)
    more = [*QUICK[:-1], "--out", str(tmp_path / "out")]
    assert main(["response", case, *TOOL, *more]) == 0
    assert "no damping is stated" in capsys.readouterr().err


def test_a_mode_that_is_not_seen_leaves_a_stiffness(tmp_path: Path) -> None:
    """The first axis of a gantry, without damping, swings across the force on the second."""
    links = "carriage: {type: rigid, mass: 8}, tool: {type: rigid, mass: 2}"
    joints = "x: {type: prismatic, base: ground, follower: carriage.origin}, y: {type: prismatic, "
    joints += "base: carriage.origin, follower: tool.origin, axis: [0, 1]}"
    links = links.replace("mass: 8", "mass: 8, nodes: {origin: [0, 0]}")
    links = links.replace("mass: 2", "mass: 2, nodes: {origin: [0, 0]}")
    text = f"title: gantry\nmechanism: {{space: planar, gravity: none, links: {{{links}}}, "
    text += f"joints: {{{joints}}}}}\ncoordinates:\n  x: {{joint: x, drive: {{stiffness: 1e5}}}}\n"
    text += "  y: {joint: y, drive: {stiffness: 1e5}}\n"
    text += "trajectory: {q: [[0, 0], [1, 1]], time: [0, 1]}\n"
    case, at = ea.load_case(written(tmp_path, text)), {"at": "tool.origin", "lowest": "1 Hz"}
    (row,) = ea.response(case, **at, direction=[0, 1], highest="17 Hz")  # x at 15.9, y at 35.6 Hz
    assert row.least == pytest.approx(1e5 * (1.0 - (34.0 * np.pi) ** 2 * 2.0 / 1e5), rel=1e-9)
    assert ea.response(case, **at, direction=[1, 0], highest="17 Hz")[0].least == 0.0


def test_what_a_spring_holds_is_held(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """The screw of the feed axis has no drive; without its servo nothing holds it."""
    cases = Path(__file__).parents[2] / "cases"
    case = ea.load_case(cases / "ball_screw.yaml")
    at = {"at": "table.nut_seat", "direction": [1, 0, 0]}
    (row,) = ea.response(case, **at, lowest="50 Hz", highest="50 Hz")
    assert 1e6 < row.least < 1e9
    seen = Antiresonances.of(case.model(), *at.values())
    assert seen.frequencies(case.trajectory.q[0], case.initial_design, 1) > 50.0
    free = (cases / "two_link.yaml").read_text().split("targets:")[0]
    for asked in (
        "targets: [{antiresonance: {at: forearm.end, direction: [0, 1]}, at_least: 5}]",
        "response: {at: forearm.end, direction: [0, 1], from: 5, to: 60}\n"
        "targets: [{mode: 1, at_least: 5}]",
    ):
        for command in ("check", "optimize"):
            assert main([command, written(tmp_path, f"{free}\n{asked}\n")]) == 2
            assert "coordinates.q1: is free, and" in capsys.readouterr().err
