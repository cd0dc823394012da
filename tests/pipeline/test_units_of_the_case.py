"""What a case writes in a unit is answered in it everywhere, and in SI in results.json."""

import csv
import io
import json
import math
import random
import re
from pathlib import Path

import numpy as np
import pytest

from eigassign import load_case
from eigassign.case import CaseFile, handy_unit, parse
from eigassign.output import run_tables, sample_files, to_json
from eigassign.pipeline import Options, Result, solve_case

CASE = """
title: An arm in units of its own
mechanism:
  space: planar
  gravity: [0, -9.81]
  materials: {alu: {youngs_modulus: 70 GPa, density: 2.7 g/cm3}}
  sections: {tube: {shape: tube, outer_diameter: 40 mm, thickness: 3 mm}}
  links:
    upper: {length: 24 in, material: alu, section: tube, elements: 2}
    fore: {length: 450 mm, material: alu, section: tube, elements: 2}
  joints:
    shoulder: {type: revolute, base: ground, follower: upper.start}
    elbow: {type: revolute, base: upper.end, follower: fore.start}
  bodies: {tool: {at: fore.end, mass: 900 g}}
coordinates:
  q1: {joint: shoulder, drive: {stiffness: 6 N m/arcmin}}
  q2: {joint: elbow, drive: {stiffness: 2.5 N m/arcmin}}
trajectory:
  tip: fore.end
  waypoints: [[750 mm, 50 mm], [600 mm, 420 mm]]
  branch: {elbow: [0 deg, 180 deg]}
  samples: 7
design:
  d: {parameter: sections.tube.outer_diameter, min: 35 mm, max: 5 cm}
  k: {parameter: coordinates.q2.drive.stiffness, min: 2 N m/arcmin, max: 15 kN m/rad}
  m: {parameter: bodies.tool.mass, min: 0.8, max: 1.2}
  mass: {max: 5000 g}
  torque: {q1: {max: 40 kgf m}}
targets:
  - {mode: 1, frequency: 840 rpm}
  - {stiffness: {at: fore.end, direction: [0, 1]}, at_least: 5 N/mm}
assignment: {starts: 1}
"""
ARCMIN = math.pi / 10_800


def file_of(text: str) -> CaseFile:
    return parse(text.encode(), "case.yaml")


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    place = tmp_path_factory.mktemp("units") / "case.yaml"
    place.write_text(CASE)
    return solve_case(load_case(place), Options(use_cache=False))


def test_tables_are_in_the_units_that_the_case_writes(result: Result) -> None:
    tables = {table.title: table for table in run_tables(result.results)}
    design = tables["Design"]
    unit, lower = (design.columns.index(name) for name in ("unit", "lower"))
    units = {row[0]: row[unit] for row in design.rows}
    assert units == {"d": "mm", "k": "N m/arcmin", "m": "g", "mass": "g"}
    bounds = {row[0]: row[lower : lower + 2] for row in design.rows}
    assert bounds["d"] == ("35", "50")
    assert bounds["k"] == ("2", f"{15e3 * ARCMIN:.4g}")
    slopes = {row[0]: row[2] for row in tables["Sensitivity"].rows}
    (row,) = [r for r in result.results.meaning.sensitivity if r.parameter == "k"][:1]
    assert slopes["k"].endswith(" Hz per N m/arcmin")
    assert float(slopes["k"].split()[0]) == pytest.approx(row.hz_per_unit / ARCMIN, rel=1e-2)
    asked = [row[0] for row in tables["Limits and bands"].rows]
    assert "mass at most 5000 g" in asked
    assert "torque of q1 at most 40 kgf m" in asked
    assert "stiffness of fore.end along [0, 1] at least 5 N/mm" in asked
    assert result.results.targets[0].label == "mode 1 at 840 rpm"
    assert any("d = 42.5 mm, k = " in note for note in result.results.notes)


def test_csv_files_are_in_these_units_and_results_json_in_si(result: Result) -> None:
    files = {name: data.decode() for name, data in sample_files(result.results).items()}
    heads = {name: next(csv.reader(io.StringIO(text))) for name, text in files.items()}
    assert heads["trajectory.csv"] == [
        "time [s]",
        "q1 [deg]",
        "q2 [deg]",
        "tip x [mm]",
        "tip y [mm]",
    ]
    assert "q1 torque exact [kgf m]" in heads["drives.csv"]
    assert heads["statics.csv"][-1].endswith("exact [N/mm]")
    rows = np.loadtxt(io.StringIO(files["trajectory.csv"]), delimiter=",", skiprows=1)
    assert np.radians(rows[:, 1:3]) == pytest.approx(result.results.q, rel=1e-14)
    kept = json.loads(to_json(result.results))
    assert (kept["design"]["k"]["unit"], kept["design"]["k"]["upper"]) == ("N m/rad", 15e3)
    assert kept["design"]["d"]["lower"] == 0.035
    assert kept["mass"]["upper"] == 5.0
    assert kept["drives"]["q1"]["limit"] == pytest.approx(40 * 9.80665)
    assert file_of(file_of(CASE).resolved()) == file_of(CASE)


def test_a_trajectory_file_reads_back(result: Result, tmp_path: Path) -> None:
    for name in ("trajectory.csv", "frequencies.csv", "drives.csv"):
        (tmp_path / name).write_bytes(sample_files(result.results)[name])
        start, end = CASE.index("trajectory:"), CASE.index("design:")
        place = tmp_path / "again.yaml"
        place.write_text(f"{CASE[:start]}trajectory: {{file: {name}}}\n{CASE[end:]}")
        q = load_case(place).trajectory.q
        assert q == pytest.approx(result.results.q, rel=1e-14, abs=1e-15)


UNITS = {
    "sections.tube.outer_diameter": (["mm", "cm", "in", "um", "m"], 0.03, 0.06),
    "links.upper.length": (["mm", "cm", "in", "km", "m"], 0.5, 0.7),
    "materials.alu.youngs_modulus": (["GPa", "N/mm2", "kgf/mm2", "Pa"], 6e10, 8e10),
    "materials.alu.density": (["g/cm3", "t/m3", "kg m^-3"], 2500.0, 2900.0),
    "bodies.tool.mass": (["g", "t", "kg"], 0.5, 2.0),
    "coordinates.q1.drive.stiffness": (["N m/arcmin", "N m/deg", "kgf cm/arcmin"], 1e4, 4e4),
    "joints.elbow.position.0": (["mm", "in", "cm"], -0.02, 0.02),
    "joints.elbow.angle": (["deg", "arcmin", "mrad", "rad"], 0.1, 1.0),
}
SIZES = {
    **{"mm": 1e-3, "cm": 1e-2, "in": 0.0254, "um": 1e-6, "m": 1.0, "km": 1e3, "g": 1e-3, "t": 1e3},
    **{"kg": 1.0, "GPa": 1e9, "N/mm2": 1e6, "kgf/mm2": 9806650.0, "Pa": 1.0, "g/cm3": 1e3},
    **{"t/m3": 1e3, "kg m^-3": 1.0, "N m/arcmin": 1 / ARCMIN, "N m/deg": 180 / math.pi},
    **{"kgf cm/arcmin": 0.0980665 / ARCMIN, "deg": math.pi / 180, "arcmin": ARCMIN},
    **{"mrad": 1e-3, "rad": 1.0},
}


@pytest.mark.parametrize("seed", range(8))
def test_random_units_of_all_properties_are_answered_as_written(seed: int) -> None:
    draw, design, wanted = random.Random(seed), "", dict[str, str]()
    for k, (path, (units, low, high)) in enumerate(UNITS.items()):
        first, second = draw.choice(units), draw.choice(units)
        ends = [f"{value / SIZES[u]!r} {u}" for value, u in ((low, first), (high, second))]
        bare = draw.random() < 0.3
        design += (
            f"  y{k}: {{parameter: {path}, min: {low if bare else ends[0]}, max: {ends[1]}}}\n"
        )
        wanted[f"y{k}"] = second if bare else first
    file = file_of(re.sub(r"(?s)  d: .*?(?=  mass:)", lambda _: design, CASE))
    pairs = zip(file.design.parameters, file.design_units, strict=True)
    found = {name: handy_unit(unit)[0] for name, unit in pairs}
    assert found == wanted
    for (_, low, high), column in zip(UNITS.values(), file.design.parameters.values(), strict=True):
        assert (column.min, column.max) == pytest.approx((low, high), rel=1e-12)
    assert file_of(file.resolved()) == file
