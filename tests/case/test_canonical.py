"""`resolved()`: canonical, complete, SI, and itself a case file with the same content."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from json_schema_reader import reads_back
from small_case import MOTION, TEXT, edited

from eigassign.case import load, parse, read_yaml, to_yaml

CASES = Path(__file__).parents[2] / "cases"
NAMED_LIKE_WORDS = (
    TEXT.replace("upper:", "'true':")
    .replace("upper", "true")
    .replace("tool:", "'null':")
    .replace("tool", "null")
    .replace("rod", "no")
)
VARIANTS = {
    "as it is": TEXT,
    "samples": edited(MOTION, "  q: [[0, 90 deg], [1, 2]]\n  time: [0, 0.3]\n"),
    "many samples": edited(
        MOTION, f"  q: {[[0.1 * k, 1 / 3] for k in range(60)]}\n  duration: 1\n"
    ),
    "points": edited(
        MOTION, "  points: [[0, 90 deg], [1, 2]]\n  times: [0, 0.3 s]\n  samples: 7\n"
    ),
    "trapezoid": edited(
        MOTION, "  points: [[0, 0], [1, 2]]\n  duration: 2\n  timing: trapezoidal\n"
    ),
    "kept angle": edited(MOTION, MOTION + "  angle: 30 deg\n"),
    "angles": edited(MOTION, MOTION + "  angle: [30 deg, 1]\n"),
    "profile": edited("190 Hz", "{time: [0, 0.1, 1], frequency: [150, 160, 1 kHz]}"),
    "point": edited("order: 4", "order: 7, q: [1, 2 deg], y: [3 g, 0.03]"),
    "position": edited("base: ground,", "base: ground, position: [1, -2 mm],"),
    "strange title": edited("title: Arm", r'title: "no: \"#{[ \\ ä 😀 1e3"'),
    "title like a number": edited("title: Arm", "title: '1e3'"),
    "names like words": NAMED_LIKE_WORDS,
    "parameter called mass": edited("  m:", "  mass:").replace("{m: 1}", "{mass: 1}"),
    "limit of the mass": edited("  constraints:", "  mass: {max: 12 kg}\n  constraints:"),
    "limit of a drive": edited("  constraints:", "  torque: {q1: {max: 2 kN m}}\n  constraints:"),
    "reference": edited("title: Arm", "title: Arm\nreference: 'Belotti et al.: 2021'"),
}


@pytest.mark.parametrize("name", VARIANTS)
def test_a_resolved_case_reads_back_equal_and_both_are_as_the_schema_says(name: str) -> None:
    """Of `mass` under `design` the schema knows the limit alone, not a parameter of that name."""
    reads_back(VARIANTS[name], described=name != "parameter called mass")


def test_every_shipped_case_reads_back_equal() -> None:
    for path in sorted(CASES.glob("*.yaml")):
        case = load(path)
        assert parse(case.resolved().encode(), path) == case


def test_a_trajectory_file_is_found_from_any_folder(tmp_path: Path) -> None:
    (tmp_path / "path.csv").write_text("time,q1,q2\n0,0,0\n1,1,1\n")
    (tmp_path / "case.yaml").write_text(edited(MOTION, "  file: path.csv\n"))
    case = load(tmp_path / "case.yaml")
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "resolved.yaml").write_text(case.resolved())
    assert load(tmp_path / "results" / "resolved.yaml", allow_outside=True) == case


def test_defaults_are_written_out_and_units_are_gone() -> None:
    resolved = parse(TEXT.encode(), "case.yaml").resolved()
    assert "rod: {shape: circle, diameter: 0.03}" in resolved
    assert "bar: {shape: bare, area: 0.00070632, bending_inertia: 3.97e-08}" in resolved
    assert "q1: {joint: shoulder, angle: relative, drive: free}" in resolved
    assert "timing: quintic" in resolved
    assert "mm" not in resolved.replace("bending", "")
    assert "position" in resolved.partition("elbow")[0]
    assert "position" not in resolved.partition("elbow")[2]


def test_lines_are_short_enough_to_read() -> None:
    text = VARIANTS["many samples"]
    assert max(map(len, parse(text.encode(), "x").resolved().splitlines())) <= 100


SCALARS = st.text(max_size=30) | st.floats(allow_nan=False, allow_infinity=False) | st.integers()
VALUES = st.recursive(
    SCALARS | st.booleans(),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4)
    ),
    max_leaves=8,
)


def frozen(value: object) -> object:
    if isinstance(value, dict):
        return {key: frozen(inner) for key, inner in value.items()}
    return tuple(map(frozen, value)) if isinstance(value, list) else value


@settings(derandomize=True, deadline=None, max_examples=100)
@given(st.dictionaries(st.text(max_size=8), VALUES, min_size=1, max_size=4))
def test_whatever_is_written_is_read_back(content: dict[str, object]) -> None:
    text = to_yaml(content)
    assert read_yaml(text.encode("utf-8", "replace"), "f").tree == frozen(content)
