"""A small valid case file, and edits of it in which ``¦`` marks where a problem is expected."""

from pathlib import Path

from eigassign.case import CaseFile, parse

TEXT = Path(__file__).with_name("small_case.yaml").read_text(encoding="utf-8")
MOTION = """\
  tip: hand.end
  waypoints: [[0.3, 0.1], [0.2, 0.2]]
  branch: {elbow: [10 deg, 170 deg]}
"""


def read(text: str) -> CaseFile:
    return parse(text.encode(), "case.yaml")


def edited(old: str, new: str) -> str:
    """``TEXT`` with its only ``old`` replaced by ``new``."""
    assert TEXT.count(old) == 1, f"{old!r} stands {TEXT.count(old)} times in the small case"
    return TEXT.replace(old, new)


def unmarked(text: str) -> tuple[str, list[tuple[int, int]]]:
    """``text`` without its ``¦`` marks, and the (1-based) line and column of each."""
    places = []
    while (i := text.find("¦")) >= 0:
        before = text[:i]
        places.append((before.count("\n") + 1, len(before.rpartition("\n")[2]) + 1))
        text = before + text[i + 1 :]
    return text, places
