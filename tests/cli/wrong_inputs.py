"""Wrong case files: a name, the file's bytes, what must be said, and which command finds it."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

GOOD = Path(__file__).with_name("wrong_inputs_good.yaml").read_text(encoding="utf-8")


@dataclass(frozen=True)
class Wrong:
    """One wrong case file."""

    name: str
    content: bytes
    says: str
    command: str = "check"


def _edited(*changes: tuple[str, str]) -> bytes:
    text = GOOD
    for old, new in changes:
        assert text.count(old) == 1, (old, text.count(old))
        text = text.replace(old, new)
    return text.encode()


def _without(key: str) -> bytes:
    """GOOD without a top-level key and what is below it."""
    lines, skipping = [], False
    for line in GOOD.splitlines(keepends=True):
        skipping = line.startswith(f"{key}:") or (skipping and line[0] in " -")
        lines.append("" if skipping else line)
    return "".join(lines).encode()


def wrong_inputs() -> Iterator[Wrong]:
    """One of each stage that finds them, from bytes to the model; tests/case has all messages."""
    STEEL = "{youngs_modulus: 210 GPa, density: 7850}"
    yield Wrong("binary", bytes(range(256)) * 4, "not UTF-8 text (byte 0x80)")
    yield Wrong(
        "broken YAML",
        _edited(("links:", "links: {")),
        "10:5: not valid YAML: while parsing a flow mapping",
    )
    yield Wrong(
        "no mass that moves",
        _edited((STEEL, "{youngs_modulus: 210 GPa, density: 0}"), ("mass: 0.1", "mass: 0")),
        "moves no mass",
    )
    yield Wrong(
        "an unreachable path",
        _edited(("[0.4, 0.4]", "[4.0, 0.4]")),
        "trajectory.waypoints[1]: waypoint 2 (4, 0.4) m is 3.13 m out of reach",
    )
    yield Wrong(
        "a mode beyond the model",
        _edited(("mode: 1,", "mode: 500,"), ("modes: [1]", "modes: [500]")),
        "the model has 12",
        "optimize",
    )
    yield Wrong(
        "no targets", _without("targets"), "targets: is missing, and optimize needs it", "optimize"
    )
    yield Wrong(
        "no trajectory",
        _without("trajectory"),
        "trajectory: is missing, and optimize needs it",
        "optimize",
    )
    yield Wrong(
        "no design", _without("design"), "design: is missing, and optimize needs it", "optimize"
    )
