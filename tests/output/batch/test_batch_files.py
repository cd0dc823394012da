"""All files of a batch are made in one pass, of the rows' lines."""

from __future__ import annotations

import csv
import json
import os
import re
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from eigassign.output import (
    CaseOutcome,
    Columns,
    Index,
    to_line,
    write_files,
)

KEYS = ("body.mass", "kind")
NAMES = ("summary.csv", "summary.json", "junit.xml", "index.html", "columns.h5", "columns.csv")


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
        index=k,
    )


def lines(n: int) -> list[str]:
    return [to_line(row(k)) for k in range(n)]


def page_data(folder: Path) -> dict[str, list]:
    html = (folder / "index.html").read_text("utf-8")
    return json.loads(re.search(r'id="data">(.*?)</script>', html).group(1))


def test_every_file_is_there_and_the_same_rows_give_the_same_bytes(tmp_path):
    made = []
    for name in ("a", "b"):
        folder = tmp_path / name / "batch"
        folder.mkdir(parents=True)
        write_files(folder, lines(4), 4, KEYS, columns=True)
        made.append({file: (folder / file).read_bytes() for file in NAMES})
        assert {path.name for path in folder.iterdir()} == set(NAMES)
    assert made[0] == made[1]


def test_columns_hold_every_number_in_si_and_nan_where_there_is_none(tmp_path):
    made = Columns(tmp_path / "columns.h5", 8, rows=3)  # several pieces
    for k in range(8):
        made.add(row(k))
    made.end()
    with h5py.File(tmp_path / "columns.h5") as found:
        mass, lowest = found["values/body.mass"][:], found["frequencies/mode 1|2/lowest_hz"][:]
        assert found["message"].asstr()[2] == "no such link"
        assert list(found["values/kind (text)"].asstr()[1:4]) == ["steel", "", "steel"]
        assert found["design/m1"][7] == 7 / 3
    there = np.arange(8) != 2
    np.testing.assert_array_equal(mass[there], [0.0, 0.001, 0.003, 0.004, 0.005, 0.006, 0.007])
    np.testing.assert_array_equal(lowest[there], 180.0 + np.arange(8)[there])
    assert np.isnan(mass[2])
    assert np.isnan(lowest[2])


def test_the_columns_as_csv_are_those_of_the_file(tmp_path):
    write_files(tmp_path, lines(5), 5, KEYS, columns=True)
    with open(tmp_path / "columns.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    with h5py.File(tmp_path / "columns.h5") as found:
        for name in ("seconds", "design/m1", "values/body.mass"):
            read = [float(each[name] or "nan") for each in rows]
            np.testing.assert_array_equal(read, found[name][:])
    assert [each["status"] for each in rows] == ["ok", "ok", "error", "ok", "ok"]


def test_columns_write_out_what_hdf5_cannot_hold(tmp_path):
    names = ("", ".", "..", "a\0b", "\ud800", "\udce9", "x" * 10**5, "a/../b", "/")
    rows = [replace(row(0), message=f"a\0{n}", design=((n, 1.0),), values={n: n}) for n in names]
    write_files(tmp_path, map(to_line, rows), len(names), names, columns=True)
    with h5py.File(tmp_path / "columns.h5") as found:
        assert found["message"].asstr()[4:6].tolist() == [r"a\x00\ud800", r"a\x00\udce9"]
        assert all(np.nansum(column[:]) == 1.0 for column in found["design"].values())
        assert len(found["design"]) == len(found["values"]) == len(names)
    assert len((tmp_path / "columns.csv").read_text().splitlines()) == 1 + len(names)


def test_links_of_the_page_are_those_of_folders_whose_names_are_no_text(tmp_path):
    name = os.fsdecode(b"caf\xe9")
    (tmp_path / name).mkdir()
    (tmp_path / name / "results.json").touch()
    made = to_line(CaseOutcome("c", "arm.yaml", "ok", 0.5, run_folder=name))
    write_files(tmp_path, [made], 1)
    assert page_data(tmp_path)["rows"][0][0] == ["caf%E9/results.json", ""]


@pytest.mark.parametrize("n", [0, 1])
def test_a_shard_may_be_empty(tmp_path, n):
    write_files(tmp_path, lines(n), n, KEYS, columns=True)
    assert len((tmp_path / "columns.csv").read_text().splitlines()) == 1 + n
    assert len((tmp_path / "summary.csv").read_text().splitlines()) == 1 + n


def test_the_page_shows_what_is_not_ok_first_of_all_and_links_what_there_is(tmp_path):
    (tmp_path / "run 1" / "figures").mkdir(parents=True)
    for name in ("report.html", "figures/frequencies.png"):
        (tmp_path / "run 1" / name).touch()
    made = lines(6)
    made[1] = to_line(CaseOutcome("c=1", "arm.yaml", "ok", 0.5, run_folder="run 1", index=1))
    index = Index(most=3)
    for k, line in enumerate(made):
        index.add("error" if k == 2 else "ok", line)
    (tmp_path / "index.html").write_bytes(index.page(tmp_path, "batch", KEYS))
    found = page_data(tmp_path)
    assert [each[1] for each in found["rows"]] == ["c=0", "c=1", "c=2"]
    assert found["rows"][1][0] == ["run%201/report.html", "run%201/figures/frequencies.png"]
    assert found["columns"][:2] == ["case", "body.mass"]
    html = (tmp_path / "index.html").read_text("utf-8")
    assert "3 of them are shown" in html


def test_a_name_is_no_markup_in_the_page(tmp_path):
    hostile = CaseOutcome("</script><b>", "a.yaml", "error", 0.1, "<img onerror=x>")
    write_files(tmp_path, [to_line(hostile)], 1)
    assert page_data(tmp_path)["rows"][0][1] == "</script><b>"
    assert "<img onerror" not in (tmp_path / "index.html").read_text("utf-8")


def test_columns_of_a_batch_that_has_folders_now_do_not_stay(tmp_path):
    write_files(tmp_path, lines(4), 4, KEYS, columns=True)
    write_files(tmp_path, lines(4), 4, KEYS)
    assert not [*tmp_path.glob("columns.*")]
