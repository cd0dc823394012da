"""The case file as the rest of the program sees it: frozen, SI-valued, aware of its lines."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from eigassign.case.document import Document
from eigassign.case.freedoms import freedom_of
from eigassign.case.mechanism_parts import Coordinate, Mechanism
from eigassign.case.study_parts import Design, Expansion, Target, Validation
from eigassign.case.trajectory_list import named_trajectories
from eigassign.case.trajectory_parts import Trajectory
from eigassign.case.yaml_reader import KeyPath, Mark, dotted
from eigassign.errors import Problem

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
        from eigassign.case.resolved import to_yaml

        names = Document.model_fields
        return to_yaml({name: getattr(self, name) for name in names})

    @property
    def subject_sha256(self) -> str:
        """SHA-256 of mechanism, coordinates, trajectory and bounds, whatever is asked of them."""
        from eigassign.case.subject import subject_sha256

        told = ("mechanism", "coordinates", "trajectory")
        content = {name: getattr(self, name) for name in told}
        return subject_sha256(content, self.design, self.files, self.path.parent)

    def expansion_line(self, **changes: object) -> str:
        """``expansion: {…}`` for a case file: what this one says below that key, and ``changes``.

        What nobody asks for is left out.
        """
        from eigassign.case.resolved import flow

        keys = self.expansion.model_copy(update=changes)
        fields = type(keys).model_fields
        asked = [n for n in fields if n in changes or getattr(keys, n) != fields[n].default]
        said = {name: getattr(keys, name) for name in asked}
        return f"expansion: {flow(said)}"

    @staticmethod
    def json_schema() -> dict[str, Any]:
        """JSON Schema (2020-12) of case files, for editors and documentation."""
        from eigassign.case.json_schema import json_schema

        return json_schema()


def undotted(text: str) -> KeyPath:
    """``"targets[0].mode"`` → ``("targets", 0, "mode")``."""
    return tuple(int(i) if i else name for i, name in _STEP.findall(text))
