"""`eigassign animate`."""

from __future__ import annotations

from pathlib import Path

import pytest
from commands import TWO_LINK
from PIL import Image

from eigassign.cli import main

PICK = TWO_LINK.with_name("pick_and_place.yaml")
Captured = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def refused(capsys: Captured, *args: object) -> str:
    assert main([str(arg) for arg in args]) == 2
    return capsys.readouterr().err


def test_a_mode_is_animated_where_it_is_asked_for(capsys: Captured) -> None:
    assert main(["animate", str(TWO_LINK), "new/second.png", "--mode", "2", "--q", "1.8 5.3"]) == 0
    assert capsys.readouterr().out == "new/second.png written\n"
    with Image.open("new/second.png") as image:
        assert (image.format, image.is_animated) == ("PNG", True)  # type: ignore[attr-defined]


def test_the_motion_goes_to_the_results(capsys: Captured) -> None:
    assert main(["animate", str(PICK), "--trajectory", "pick", "--quiet"]) == 0
    captured = capsys.readouterr()
    assert captured.out.replace("\\", "/") == "results/pick_and_place_motion.gif written\n"
    assert captured.err == ""
    with Image.open("results/pick_and_place_motion.gif") as image:
        assert image.format == "GIF"


def test_what_cannot_be_animated_is_refused(capsys: Captured) -> None:
    assert "ends in .gif or .png" in refused(capsys, "animate", TWO_LINK, "arm.mp4")
    assert "no trajectory 'x'" in refused(capsys, "animate", PICK, "a.gif", "--trajectory", "x")
    assert "q and y are of a mode" in refused(capsys, "animate", TWO_LINK, "a.gif", "--q", "1 2")
    assert "expected 2 (q1, q2)" in refused(
        capsys, "animate", TWO_LINK, "a.gif", "--mode", "1", "--q", "1"
    )
    assert not Path("a.gif").exists()
