"""A case runs within its limits, and gives the same numbers wherever it runs."""

import errno
import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import scipy.sparse.linalg

from eigassign.batch import Batch, CaseOptions, plan_of, run, run_case, this_machine
from eigassign.errors import StorageError
from eigassign.output import CaseOutcome

SMALL = Path(__file__).parents[2] / "benchmarks" / "small_arm.yaml"
MASS = "mechanism.bodies.tool.mass"


@pytest.fixture
def options(tmp_path: Path) -> CaseOptions:
    return CaseOptions(str(tmp_path / "out"), use_cache=False, reports="none")


def same(outcome: CaseOutcome) -> CaseOutcome:
    """But for its time."""
    return replace(outcome, seconds=0.0)


def numbers(folder: Path) -> dict[str, object]:
    """Of results.json, but for times."""
    found = json.loads((folder / "results.json").read_text())
    assert found.pop("timing_s")
    return found


def test_an_outcome_has_units_and_what_a_design_weighs_and_how_far_off_it_is(
    options: CaseOptions, tmp_path: Path
) -> None:
    case = tmp_path / "arm.yaml"
    driven = "q2: {joint: elbow, drive: {stiffness: 2e4}}"
    case.write_text(SMALL.read_text().replace("q2: {joint: elbow}", driven))
    swept = {
        MASS: ("0.1", "kg"),
        "mechanism.sections.rod.diameter": ("21 mm", "m"),
        "coordinates.q2.drive.stiffness": ("3e4", "N m/rad"),
        "trajectory.duration": ("2", "s"),
        "targets.0.frequency": ("90", "Hz"),
        "validation.max_error": ("0.6", ""),
    }
    settings = [f"{key}={value}" for key, (value, _) in swept.items()]
    plan = plan_of([case], [*settings, "title=x", "expansion.order=2"])
    found = run_case(plan[0], options)
    bare = {"title": "", "expansion.order": ""}
    assert found.units == {key: unit for key, (_, unit) in swept.items()} | bare | {
        "m": "kg",
        "peak torque of q1": "N m",
        "peak torque of q2": "N m",
    }
    results = json.loads((tmp_path / "out" / plan[0].name / "results.json").read_text())
    assert found.mass == results["mass"]["optimal"]
    assert found.exact_rms_relative == results["error"]["exact"]["rms_relative"]
    assert found.price is None


def test_a_case_gives_the_same_numbers_in_any_order(options: CaseOptions, tmp_path: Path) -> None:
    plan = plan_of([SMALL], [f"{MASS}=0.1,0.3"])
    first = [run_case(plan[k], options) for k in (0, 1)]
    there = replace(options, out=str(tmp_path / "there"))
    again = [run_case(plan[k], there) for k in (1, 0)][::-1]
    assert [*map(same, first)] == [*map(same, again)]
    for found in first:
        assert numbers(tmp_path / "out" / found.run_folder) == numbers(
            tmp_path / "there" / found.name
        )
    resolved = (tmp_path / "out" / "mass=0.3" / "case.yaml").read_text()
    assert "mass: 0.3" in resolved
    assert f"variant: {MASS} = 0.3" in (tmp_path / "out" / "mass=0.3" / "log.txt").read_text()


def test_a_case_that_was_changed_since_the_batch_began_does_not_run(
    options: CaseOptions, tmp_path: Path
) -> None:
    file = tmp_path / "arm.yaml"
    file.write_text(SMALL.read_text())
    variant = plan_of([file])[0]
    file.write_text(SMALL.read_text().replace("180 Hz", "181 Hz"))
    found = run_case(variant, options)
    assert found.status == "error"
    assert "changed since the batch began" in found.message


def test_a_run_that_lost_its_record_is_moved_aside_and_a_folder_of_the_user_s_is_left_alone(
    options: CaseOptions, tmp_path: Path
) -> None:
    variant, out = plan_of([SMALL])[0], tmp_path / "out"
    for k, damage in enumerate((Path.unlink, lambda path: path.write_bytes(b"{")), 1):
        assert run_case(variant, options).status == "ok"
        damage(out / variant.name / "run.json")
        assert run_case(variant, options).status == "ok"
        assert (out / f"{variant.name}.{k}" / "results.json").exists()
    shutil.rmtree(out)
    (out / variant.name).mkdir(parents=True)
    (out / variant.name / "thesis.tex").write_text("mine")
    found = run_case(variant, options)
    assert (found.status, "it was left alone" in found.message) == ("error", True)
    assert [path.name for path in out.iterdir()] == [variant.name]


def test_a_case_without_an_answer_is_done_too(options: CaseOptions, tmp_path: Path) -> None:
    file = tmp_path / "arm.yaml"
    heavy = "max: 1}\n  constraints: {heavy: {terms: {m: 1}, min: 3}}"
    file.write_text(SMALL.read_text().replace("max: 1}", heavy))
    batch = Batch(plan_of([file]), tmp_path / "out", options)
    place, heard = this_machine(1), list[str]()
    for names in (["arm"], []):
        heard.clear()
        (row,) = run(batch, place, lambda _total, _done: None, lambda row: heard.append(row.name))
        assert (row.status, heard) == ("failed", names)


def test_a_full_disk_ends_the_batch(
    options: CaseOptions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_given: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    batch = Batch(plan_of([SMALL]), tmp_path / "out", options)
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(StorageError, match="No space left on device"):
        run(batch, this_machine(1), lambda _total, _done: None, lambda _row: None)


def test_a_bug_in_one_case_is_an_outcome_and_not_an_end(options: CaseOptions) -> None:
    found = run_case(plan_of([SMALL])[0], replace(options, cache_dir=5, use_cache=True))
    assert found.status == "error"
    assert found.message.startswith("internal error: TypeError")


def test_memory_that_runs_out_inside_a_factorisation_is_no_limp_link(
    options: CaseOptions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def without_memory(*_given: object, **_options: object) -> None:  # SciPy 1.17, by RLIMIT_AS
        raise RuntimeError(
            "SUPERLU_MALLOC fails for buf in intCalloc() at line 173 in file memory.c"
        )

    file = tmp_path / "large.yaml"
    file.write_text(SMALL.read_text().replace("elements: 2", "elements: 300"))
    monkeypatch.setattr(scipy.sparse.linalg, "splu", without_memory)
    found = run_case(plan_of([file])[0], options)
    assert (found.status, found.message) == ("error", "out of memory")
