"""The case file as the rest of the program sees it: frozen, SI-valued, aware of its lines.

A case's content → canonical YAML 1.2 text that reads back equal.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from eigassign.case.reader import KeyPath, Mark, dotted, resolve
from eigassign.case.schema.document import Document, json_schema
from eigassign.case.schema.joints import JointBase, freedom_of
from eigassign.case.schema.mechanism import Coordinate, Mechanism, Spring
from eigassign.case.schema.parts import Part, keys_of
from eigassign.case.schema.study import Design, Expansion, Target, Validation
from eigassign.case.schema.trajectory import Timed, Trajectory, named_trajectories
from eigassign.errors import Problem

# --- The case file as the rest of the program sees it: frozen, SI-valued, aware of its lines

_STEP = re.compile(r"\[(\d+)\]|([^.\[\]]+)")


@dataclass(frozen=True)
class CaseFile:
    """One validated case. Two are equal when their content is, wherever they were read from.

    ``path`` and ``sha256`` identify the file and its bytes, ``files`` the bytes of those that it
    names; ``warnings`` are plausibility problems that do not keep the case from being run.
    """

    title: str
    reference: str | None
    mechanism: Mechanism
    coordinates: Mapping[str, Coordinate]
    trajectory: Trajectory | tuple[Trajectory, ...] | None
    design: Design
    expansion: Expansion
    targets: tuple[Target, ...]
    validation: Validation
    path: Path = field(compare=False)
    sha256: str = field(compare=False)
    warnings: tuple[Problem, ...] = field(compare=False)
    marks: Mark = field(compare=False, repr=False)
    files: Mapping[str, str] = field(compare=False, default_factory=dict)  # SHA-256 by name

    def problem(self, key_path: str, message: str) -> Problem:
        """Problem at the line and column of ``key_path`` (``mechanism.links.forearm.length``,
        ``targets[0].mode``), or of the nearest key above it that the file has.

        ``key_path`` may start below `mechanism`, as the paths of design parameters do.
        """
        path = undotted(key_path)
        mechanism = self.marks.find(("mechanism",))
        if mechanism.find(path[:1]) is not mechanism:
            path = ("mechanism", *path)  # paths of properties start below `mechanism`
        mark = self.marks.find(path)
        return Problem(str(self.path), mark.line, mark.column, dotted(path), message)

    @property
    def coordinate_units(self) -> tuple[str, ...]:
        """SI unit of each coordinate, in the order of q: rad, or m where its joint slides."""
        joints = self.mechanism.joints
        moved = (freedom_of(joints[c.joint].type, c.component) for c in self.coordinates.values())
        return tuple("m" if freedom == "translation" else "rad" for freedom in moved)

    @property
    def trajectories(self) -> tuple[tuple[str, str, Trajectory], ...]:
        """Key path, name ("1", "2", … where the file gives none) and content of each trajectory."""
        named = named_trajectories(self.trajectory)
        return tuple((dotted(path), name, trajectory) for path, name, trajectory in named)

    def resolved(self) -> str:
        """The case as canonical YAML: SI values, defaults filled in; reads back equal."""

        names = Document.model_fields
        return to_yaml({name: getattr(self, name) for name in names})

    @staticmethod
    def json_schema() -> dict[str, Any]:
        """JSON Schema (2020-12) of case files, for editors and documentation."""
        return json_schema()


def undotted(text: str) -> KeyPath:
    """``"targets[0].mode"`` → ``("targets", 0, "mode")``."""
    return tuple(int(i) if i else name for i, name in _STEP.findall(text))


# --- A case's content → canonical YAML 1.2 text that reads back equal

_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_./-]*")
_WIDTH = 90


def to_yaml(content: Mapping[str, object]) -> str:
    """Block style for what is long, flow style for what fits on a line; None is left out."""
    return "".join(_entry(key, plain(value), 0) for key, value in content.items())


def plain(value: object) -> object:
    """Objects → mappings, lists, numbers and text, in the shape of the file."""
    if isinstance(value, Design):
        apart = {"constraints": value.constraints} if value.constraints else {}
        return plain({**value.parameters, **apart})
    if isinstance(value, Part):
        names = zip(keys_of(type(value)), type(value).model_fields, strict=True)
        fields = {key: getattr(value, name) for key, name in names}
        return plain({key: v for key, v in fields.items() if key not in _superfluous(value)})
    if isinstance(value, Mapping):
        return {key: plain(inner) for key, inner in value.items() if inner is not None}
    if isinstance(value, (tuple, list)):
        return [plain(inner) for inner in value]
    return value


def _superfluous(value: Part) -> set[str]:
    """Keys that say nothing: zero offsets from a link's node, the other space's turn, a share of
    time for a timing law that has none."""
    if isinstance(value, (JointBase, Spring)) and value.orientation is not None:
        keys = {"angle"}
    else:
        keys = set()
    if isinstance(value, JointBase) and value.base != "ground" and not any(value.position or ()):
        keys.add("position")
    if isinstance(value, Timed) and value.timing != "trapezoidal":
        keys.add("acceleration_share")
    return keys


def _entry(key: str, value: object, depth: int) -> str:
    """One ``key: value`` of a block mapping."""
    pad = "  " * depth
    flow = _flow(value)
    fits = len(pad) + len(key) + 2 + len(flow) <= _WIDTH
    if value is None or value in ({}, []):
        return f"{pad}{_word(key)}: {flow}\n" if value is not None else ""
    if isinstance(value, dict) and not (fits and depth):
        inner = "".join(_entry(k, v, depth + 1) for k, v in value.items())
        return f"{pad}{_word(key)}:\n{inner}"
    if isinstance(value, list) and not fits:
        return f"{pad}{_word(key)}:\n" + "".join(_item(v, depth + 1) for v in value)
    return f"{pad}{_word(key)}: {flow}\n"


def _item(value: object, depth: int) -> str:
    """One entry of a block list; of a long mapping the first key stands beside the dash."""
    pad, flow = "  " * depth, _flow(value)
    if not isinstance(value, dict) or len(pad) + 2 + len(flow) <= _WIDTH:
        return f"{pad}- {flow}\n"
    inner = "".join(_entry(k, v, depth + 1) for k, v in value.items())
    return f"{pad}- {inner.removeprefix(pad + '  ')}"


def _flow(value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_word(k)}: {_flow(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_flow(v) for v in value) + "]"
    return _word(value) if isinstance(value, str) else repr(value)


def _word(text: str) -> str:
    """``text`` as it is where YAML reads it back as text, else in double quotes."""
    if _PLAIN.fullmatch(text) and resolve(text) == text:
        return text
    return '"' + "".join(_escaped(c) for c in text) + '"'


def _escaped(c: str) -> str:
    if c in '"\\':
        return "\\" + c
    if c.isprintable():
        return c
    return f"\\U{ord(c):08x}"
