"""All files of a batch are made of its rows."""

import csv
import json
import os
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

from eigassign.output import CaseOutcome, from_plain, index_page, to_plain, write_files

KEYS = ("body.mass", "kind")
NAMES = ("summary.csv", "summary.json", "junit.xml", "index.html")


def row(k: int) -> CaseOutcome:
    if k == 2:
        return CaseOutcome("c=2", "arm.yaml", "error", 0.1, "no such link", index=2)
    ranges = (("mode 1/2", 180.0 + k, 190.0, 200.0),)
    return CaseOutcome(
        f"c={k}",
        "arm.yaml",
        "ok",
        0.5,
        exact_max_relative=0.01 * k,
        design=(("m1", k / 3),),
        frequencies=ranges,
        values={"body.mass": f"{k} g", "kind": "steel"},
        units={"body.mass": "kg", "m1": "kg"},
        index=k,
    )


def summary(folder: Path) -> list[dict[str, str]]:
    with open(folder / "summary.csv", newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def rows_of(n: int) -> list[CaseOutcome]:
    return [row(k) for k in range(n)]


def page_data(folder: Path) -> dict[str, list]:
    html = (folder / "index.html").read_text("utf-8")
    return json.loads(re.search(r'id="data">(.*?)</script>', html).group(1))


def test_every_file_is_there_and_the_same_rows_give_the_same_bytes(tmp_path):
    made = []
    for name in ("a", "b"):
        folder = tmp_path / name / "batch"
        folder.mkdir(parents=True)
        write_files(folder, rows_of(4), KEYS)
        made.append({file: (folder / file).read_bytes() for file in NAMES})
        assert {path.name for path in folder.iterdir()} == set(NAMES)
    assert made[0] == made[1]


def test_links_of_the_page_are_those_of_folders_whose_names_are_no_text(tmp_path):
    name = os.fsdecode(b"caf\xe9")
    (tmp_path / name).mkdir()
    (tmp_path / name / "results.json").touch()
    write_files(tmp_path, [CaseOutcome("c", "arm.yaml", "ok", 0.5, run_folder=name)])
    assert page_data(tmp_path)["links"] == [["caf%E9/results.json", ""]]


def test_the_page_shows_what_is_not_ok_first_of_all_and_links_what_there_is(tmp_path):
    (tmp_path / "run 1" / "figures").mkdir(parents=True)
    for name in ("report.html", "figures/frequencies.png"):
        (tmp_path / "run 1" / name).touch()
    made = rows_of(6)
    made[1] = CaseOutcome("c=1", "arm.yaml", "ok", 0.5, run_folder="run 1", index=1)
    (tmp_path / "index.html").write_bytes(index_page(made, tmp_path, KEYS, most=3))
    found = page_data(tmp_path)
    assert [each[0] for each in found["rows"]] == ["c=0", "c=1", "c=2"]
    assert found["links"][1] == ["run%201/report.html", "run%201/figures/frequencies.png"]
    assert found["columns"][:3] == [
        ["case", "", "name"], ["verdict", "", "word"], ["body.mass", "kg", "swept"],
    ]  # fmt: skip
    html = (tmp_path / "index.html").read_text("utf-8")
    assert "3 of 6 cases are shown" in html


def test_a_name_is_no_markup_in_the_page(tmp_path):
    hostile = CaseOutcome("</script><b>", "a.yaml", "error", 0.1, "<img onerror=x>")
    write_files(tmp_path, [hostile])
    assert page_data(tmp_path)["rows"][0][0] == "</script><b>"
    assert "<img onerror" not in (tmp_path / "index.html").read_text("utf-8")


# --- The page


def variant(k: int, mass: float, hz: str, **more: Any) -> CaseOutcome:
    digits = f"{k:x}".zfill(10)
    found = CaseOutcome(
        f"mass={mass:.6g},frequency={hz.replace(' ', '')}~{digits}", "cases/arm.yaml", "ok", 1.25,
        initial_max_relative=0.3, exact_max_relative=0.0123456, exact_rms_relative=0.00517,
        mass=2.7123456, price=12.0, design=(("width", 0.0354321), ("gear", 5421.7)),
        frequencies=(("mode 1", 13.45678, 13.5, 13.63),), verdict="reached",
        values={"mechanism.bodies.tool.mass": mass, "targets.0.frequency": hz},
        units={"mechanism.bodies.tool.mass": "kg", "width": "m", "gear": "N m/rad"}, index=k,
    )  # fmt: skip
    return replace(found, **more)


GRID = [variant(4 * k + n, k / 7, f"{12 + n} Hz") for k in range(4) for n in range(4)]
SWEPT = tuple(GRID[0].values)


def page_of(folder: Path, rows: list[CaseOutcome], keys: tuple[str, ...] = SWEPT) -> dict[str, Any]:
    """The data in the page of these rows, by column: its unit, its kind and its cells."""
    write_files(folder, rows, keys)
    data = page_data(folder)
    cells = zip(*data["rows"], strict=True)
    pairs = zip(data["columns"], cells, strict=True)
    return {name: (unit, kind, list(own)) for (name, unit, kind), own in pairs}


def test_numbers_on_the_page_have_few_digits_and_the_units_that_people_use(tmp_path):
    found = page_of(tmp_path, GRID)
    assert {name: (unit, cells[5]) for name, (unit, _, cells) in found.items()} == {
        "case": ("", "6"),
        "tool.mass": ("g", 142.9),
        "targets.0.frequency": ("Hz", 13.0),
        "verdict": ("", "Reached"),
        "worst before": ("%", 30.0),
        "worst error": ("%", 1.23),
        "rms error": ("%", 0.517),
        "total mass": ("kg", 2.712),
        "price": ("", 12.0),
        "width": ("mm", 35.43),
        "gear": ("kN m/rad", 5.422),
        "mode 1, lowest": ("Hz", 13.46),
        "mode 1, highest": ("Hz", 13.63),
        "time": ("s", 1.25),
    }
    hidden = [name for name, (_, kind, _) in found.items() if kind == "hidden"]
    assert hidden == ["mode 1, lowest", "mode 1, highest", "time"]


def test_the_page_says_in_a_sentence_how_many_meet_what_is_asked(tmp_path):
    missed = {"status": "failed", "verdict": "unreachable", "message": "unreachable: mode 1 is off"}
    rows = [*GRID[:2], *(replace(row, **missed, exact_max_relative=0.3) for row in GRID[2:])]
    found = page_of(tmp_path, rows)
    html = (tmp_path / "index.html").read_text("utf-8")
    assert "<h1>Sweep of arm</h1>" in html
    assert "2 of 16 variants meet what is asked." in html
    assert found["verdict"][2][-1] == "Unreachable"
    assert found["message"][2][-1] == "Mode 1 is off"
    assert "failed" not in html.partition('id="data"')[0]
    for rows, said in ((GRID, "All 16 variants meet"), ([GRID[0]], "The variant meets")):
        page_of(tmp_path, rows)
        assert said in (tmp_path / "index.html").read_text("utf-8")


def test_the_page_of_a_thousand_variants_is_at_most_two_megabytes(tmp_path):
    long = {"status": "failed", "verdict": "unreachable", "message": "unreachable: " + "x y " * 800}
    rows = [variant(k, k / 7, "12 Hz", **long) for k in range(1000)]
    page_of(tmp_path, rows)
    assert (tmp_path / "index.html").stat().st_size < 2e6


def test_rows_of_earlier_versions_are_shown_without_the_units_that_they_lack(tmp_path):
    lacks = ("units", "mass", "price", "exact_rms_relative")
    plain = {k: v for k, v in to_plain(GRID[5]).items() if k not in lacks}
    write_files(tmp_path, [from_plain(plain)], SWEPT)
    columns = {name: unit for name, unit, _ in page_data(tmp_path)["columns"]}
    assert columns["width"] == ""
    assert columns["targets.0.frequency"] == "Hz"
    (row,) = summary(tmp_path)
    assert row["design/width"] == "0.0354321"
