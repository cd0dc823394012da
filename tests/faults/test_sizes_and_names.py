"""A case may ask for ten million variants, and be called anything: both are answered."""

import csv
import json
import os
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest
from beam import TEXT
from fuzz_worker import CASES, Worker
from memory import within

from eigassign.cli import main

LENGTH = "mechanism.links.arm.length: {min: 0.4, max: 0.6"
MASS = "mechanism.bodies.tool.mass: {min: 0, max: 1"
SWEEPS = {
    "grid": f"parameters: {{{LENGTH}, count: 3000}}, {MASS}, count: 3000}}}}",
    "range": f"parameters: {{{LENGTH}, count: 100000}}}}",
    "list": f"sample: list, parameters: {{{LENGTH}, count: 100000}}, {MASS}, count: 100000}}}}",
}
NAMES = (
    *(b"plain", b"\xff\xfe", b"lat\xe9n", b"a\nb", b"a\x1b[2Jb", b"CON", b"aux", b"nul.x"),
    *(b"trail ", b"trail.", b"Case", b"case", b"x" * 250, "ü".encode() * 120),
)


@pytest.fixture(scope="module")
def worker() -> Iterator[Worker]:
    with Worker() as running:
        yield running


@pytest.mark.parametrize("name", SWEEPS)
def test_sweeps_of_millions_are_checked_within_limits(name: str, worker: Worker) -> None:
    outcome = worker.run("check", f"{TEXT}sweep: {{{SWEEPS[name]}}}\n")
    assert (outcome.code, outcome.faults()) == (0, []), outcome.err
    assert "000 variants" in outcome.out
    assert "the first 100 of them valid: eigassign batch" in outcome.out


@pytest.mark.parametrize("samples", [10_000, 100_000])
def test_many_samples_are_checked_within_limits(samples: int, worker: Worker) -> None:
    steps = ", ".join(f"[{k}]" for k in range(2))
    motion = f"trajectory: {{points: [{steps}], duration: 1 s, samples: {samples}}}"
    before = "trajectory: {q: [[0], [1]], time: [0, 1]}"
    assert before in TEXT
    outcome = worker.run("check", TEXT.replace(before, motion))
    assert (outcome.code, outcome.faults()) == (0, []), outcome.err
    assert f"{samples} samples" in outcome.out


def lattice(bays: int) -> str:
    """The beam as a boom of two chords with laces, five beams a bay."""
    chords = [
        (f"{r}{k}", [0.5 * k / bays, y])
        for r, y in (("l", -0.01), ("u", 0.01))
        for k in range(1, bays)
    ]
    nodes = {"start": [0, 0], **dict(chords), "end": [0.5, 0]}
    pairs = [(f"l{k}", f"u{k}") for k in range(1, bays)]
    pairs += [
        pair
        for k in range(1, bays - 1)
        for pair in ((f"l{k}", f"u{k + 1}"), (f"u{k}", f"l{k + 1}"))
    ]
    for r in "lu":
        along = ["start", *(f"{r}{k}" for k in range(1, bays)), "end"]
        pairs += pairwise(along)
    beams = {
        f"{a}_{b}": {"from": a, "to": b, "material": "steel", "section": "rod"} for a, b in pairs
    }
    link = json.dumps({"type": "frame", "nodes": nodes, "beams": beams})
    before = "{length: 0.5, material: steel, section: rod, elements: 2}"
    assert before in TEXT
    return TEXT.replace(before, link)


@pytest.mark.slow
def test_a_lattice_of_three_thousand_members_is_checked_within_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("boom.yaml").write_text(lattice(600))
    assert Path("boom.yaml").read_text().count('"from"') == 2995
    with within(1000.0):
        assert main(["check", "boom.yaml"]) == 0
    assert "degrees of freedom" in capsys.readouterr().out


@pytest.mark.slow
def test_bands_at_thousands_of_samples_take_memory_as_their_samples(worker: Worker) -> None:
    text = (CASES / "milling_column.yaml").read_text()
    assert "samples: 41\n" in text
    limits = "assignment: {starts: 1, steps: 2, seconds: 1}\n"
    outcome = worker.run("optimize", text.replace("samples: 41\n", "samples: 4100\n") + limits)
    assert outcome.code in (0, 1), outcome.err  # whether a second is enough is not what is asked
    # 170 MB; a square matrix of all residuals would take more than 800
    assert outcome.megabytes < 400, outcome.megabytes


@pytest.mark.skipif(os.name != "posix", reason="other systems have no such names")
def test_a_batch_of_files_that_may_be_called_anything(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("cases").mkdir()
    try:
        for name in NAMES:
            Path(os.fsdecode(b"cases/" + name + b".yaml")).write_text(TEXT)
    except OSError:
        pytest.skip("this file system does not have all of these names")
    batch = ["batch", "cases", "--out", "out", "--jobs", "1", "--reports", "none"]
    assert main(batch) == 0
    out, err = capsys.readouterr()
    assert all(c.isprintable() or c == "\n" for c in out + err)
    with open("out/summary.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    folders = {row["run_folder"] for row in rows}
    assert len(folders) == len(rows) == len(NAMES)
    assert len({folder.casefold() for folder in folders}) == len(NAMES)
    assert all(Path("out", folder, "results.json").exists() for folder in folders)
    assert Path("out/index.html").exists()
    assert main([*batch, "--dry-run"]) == 0
    assert f"0 cases would run, {len(NAMES)} are done" in capsys.readouterr().out
