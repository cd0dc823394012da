"""The inputs of a run in three lines: links, drives, and what is carried along which trajectory."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from eigassign.case.case_file import CaseFile
from eigassign.case.units import handy
from eigassign.mechanism.kinematics.parameters import link_type
from eigassign.mechanism.trajectory.trajectory import Trajectories

LONG = 220  # characters of a line: what is more is left to the case file


def given(file: CaseFile, path: Trajectories | None) -> tuple[str, ...]:
    """Links with sections and materials; drives; trajectory and bodies, of the case as written."""
    found = (
        f"Links: {'; '.join(_links(file))}",
        f"Drives: {', '.join(_drives(file)) or 'none, nothing moves'}",
        f"Motion: {', '.join(_motion(file, path))}",
    )
    return tuple(line if len(line) <= LONG else _cut(line) for line in found)


def _cut(line: str) -> str:
    """The line to the last whole part that there is room for."""
    return f"{line[:LONG].rpartition('; ' if '; ' in line[:LONG] else ', ')[0]}; …"


def _links(file: CaseFile) -> Iterator[str]:
    """Yield links that are made alike together."""
    alike: dict[str, list[str]] = {}
    links: Mapping[str, Any] = file.mechanism.links
    for name, link in links.items():
        length = getattr(link, "length", None)
        own = name if length is None else f"{name} {handy(length, 'm')}"
        alike.setdefault(_made_of(file, name, link), []).append(own)
    for made, names in alike.items():
        listed = ", ".join(names) if len(names) < 5 else f"{names[0]} and {len(names) - 1} more"
        yield f"{listed}: {made}"


def _made_of(file: CaseFile, name: str, link: Any) -> str:
    kind = link_type(file, name)
    beams = [*link.beams.values()] if kind == "frame" else [link]
    sections = {n for beam in beams for n in section_names(beam)}
    materials = dict.fromkeys(m for beam in beams if (m := getattr(beam, "material", None)))
    said = sorted(sections)[:2]
    said += [f"{len(sections) - 2} more sections"] if len(sections) > 2 else []
    what = [kind] if kind != "beam" else []
    return ", ".join(filter(None, (*what, " and ".join(said), *materials)))


def section_names(beam: Any) -> tuple[str, ...]:
    """The sections of a beam: none, one, or those at its start and end."""
    section = getattr(beam, "section", None)
    if section is None:
        return ()
    return (section,) if isinstance(section, str) else (section.start, section.end)


def _drives(file: CaseFile) -> Iterator[str]:
    """Yield drives that are alike together."""
    alike: dict[str, list[str]] = {}
    for name, unit in zip(file.coordinates, file.coordinate_units, strict=True):
        coordinate = file.coordinates[name]
        stiffness = getattr(coordinate.drive, "stiffness", None)
        per = "N m/rad" if unit == "rad" else "N/m"
        said = coordinate.moves if stiffness is None else handy(stiffness, per, 4)
        alike.setdefault(said, []).append(name)
    return (f"{', '.join(names)} {said}" for said, names in alike.items())


def _motion(file: CaseFile, path: Trajectories | None) -> Iterator[str]:
    if path is None:
        yield "no trajectory"
    else:
        seconds = sum(float(np.ptp(part.trajectory.time_s)) for part in path.parts)
        along = f"{len(path.parts)} trajectories, " if len(path.parts) > 1 else ""
        yield f"{along}{seconds:.3g} s in {len(path.time_s)} samples"
    for name, body in file.mechanism.bodies.items():
        if body.mass:
            yield f"{name} {handy(body.mass, 'kg')} at {body.at}"
    for load in file.loads.values():
        _, name, *what = load.path.split(".")
        amounts = dict.fromkeys(handy(amount, load.unit) for amount in load.along)
        yield f"{' '.join(what).replace('_', ' ')} of {name} {' or '.join(amounts)}"
    gravity = file.mechanism.gravity
    if isinstance(gravity, tuple):
        yield "under its weight"
