"""The paper's one shot may ask for lengths that cannot follow the tip path: it is only a start."""

from pathlib import Path

from run_cases import UNCACHED, written

from eigassign import load_case
from eigassign.pipeline import solve_case

LENGTHS = Path(__file__).parents[2] / "cases" / "arm_lengths.yaml"


WIDE = """
design:
  upper: {parameter: links.upper_arm.length, min: 400 mm, max: 800 mm}
  fore: {parameter: links.forearm.length, min: 300 mm, max: 800 mm}
expansion: {order: 4, q: [1.817, 5.312]}
targets: [{mode: 1, frequency: 260 Hz}]
"""


def test_a_one_shot_that_cannot_follow_the_path_ends_nothing(tmp_path: Path) -> None:
    text = LENGTHS.read_text()
    text = text[: text.index("\ndesign:")] + WIDE
    for old, new in (("samples: 101", "samples: 31"), ("270 deg", "359 deg")):
        assert old in text
        text = text.replace(old, new)
    results = solve_case(load_case(written(tmp_path, text)), UNCACHED).results
    assert results.error.one_shot is None
    assert results.assignment.verdict == "reached"
    assert any("no errors of the one-shot design" in note for note in results.notes)
