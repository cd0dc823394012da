"""`eigassign export`: a reduced model for other programs."""

from __future__ import annotations

import json
import runpy
from pathlib import Path

import numpy as np
import pytest
from commands import TWO_LINK

import eigassign as ea
from eigassign.cli import main

Captured = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def refused(capsys: Captured, *args: object) -> str:
    assert main([str(arg) for arg in args]) == 2
    return capsys.readouterr().err


def test_a_reduced_model_is_exported_as_accurate_as_asked_for(capsys: Captured) -> None:
    asked = ["export", str(TWO_LINK), "arm.npz", "--mode", "1", "--mode", "2", "--accuracy", "1e-8"]
    assert main([*asked, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["files"] == ["arm.npz", "arm_frequencies.py"]
    assert told["modes"] == [1, 2]
    assert told["error_estimate"] <= 1e-8
    reader = runpy.run_path("arm_frequencies.py")
    model = reader["read"]("arm.npz")
    case = ea.load_case(TWO_LINK)
    for q in case.trajectory.q[::30]:
        for y in ([0.0, 0.25], [0.25, 0.0], [0.1, 0.2]):
            exact = case.model().frequencies(q, y, 2)[0]
            np.testing.assert_allclose(reader["frequencies"](model, q, y), exact, rtol=1e-8)


def test_what_eigassign_reads_itself_is_exported_too(capsys: Captured) -> None:
    assert main(["export", str(TWO_LINK), "arm.h5", "--quiet"]) == 0
    first, second = capsys.readouterr().out.splitlines()
    assert first == "arm.h5 written"
    assert "poses and designs" in second
    assert ea.load_reduced("arm.h5").modes == (1,)


def test_a_case_without_trajectory_is_exported_about_its_pose(capsys: Captured) -> None:
    text = TWO_LINK.read_text(encoding="utf-8")
    head, rest = text.split("trajectory:", 1)
    Path("still.yaml").write_text(head + rest[rest.index("\ndesign:") :], encoding="utf-8")
    text = Path("still.yaml").read_text(encoding="utf-8")
    Path("still.yaml").write_text(text[: text.index("\ntargets:")], encoding="utf-8")
    assert main(["export", "still.yaml", "arm.c", "--quiet"]) == 0
    assert "at 5 poses and designs" in capsys.readouterr().out


def test_another_ending_is_refused(capsys: Captured) -> None:
    assert "ends in .npz, .mat, .c or .h5" in refused(capsys, "export", TWO_LINK, "arm.onnx")
    assert "Invalid value for '--accuracy'" in refused(
        capsys, "export", TWO_LINK, "arm.c", "--accuracy", "0"
    )
