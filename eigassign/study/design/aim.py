"""What an objective that is no error has come to: the mass, the least frequency, the least room.

Each before and after, as it is found between the samples too (`clearance`); of a robust design the
least in all scenarios, but the mass as it is without deviations.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.exact.design_problem import ON
from eigassign.assignment.requirements.gap import ModeGap
from eigassign.assignment.requirements.requirement import Requirement
from eigassign.study.checks.mesh import raised_by
from eigassign.study.design.clearance import WITHIN, least_room, lowest_room
from eigassign.study.design.one_shot import cost
from eigassign.study.design.search.optimum import Found
from eigassign.study.design.search.variants import lacking
from eigassign.study.results import AimRow
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]


def aim_row(
    scene: Scene, found: Found, wanted: Sequence[Requirement], of_model: Mapping[int, float]
) -> AimRow | None:
    """What is light, high or wide before and after; None where the objective is an error.

    ``of_model`` is how much too high mesh and reduced links put modes at most, relative.
    """
    aim, kept = scene.file.assignment.named_objective, ""
    designs = scene.initial, found.best.y
    if [one for one in (*wanted, *scene.limits) if not one.is_aim]:
        missed = found.best.seen.violation
        met = missed <= ON and all(row.clear for row in found.clearances)
        kept = ", all limits kept" if met else ", not all limits kept"
    if aim == "lightest":
        before, after = map(scene.model.mass, designs)
        row = AimRow("as light as can be", before, after, "kg")
        return _in_words(row, f"lightest design found: {row.after}", kept)
    if (paid := cost(scene, found.best.y)) is not None:
        one = "1 Hz" if aim == "highest" else "1 % of room"
        kept += f"; its price, {paid:.4g}, counts against it, 1 as {one}"
    if aim == "highest":
        (asked,) = (one for one in wanted if one.is_aim)
        before, after = (_least(found, asked, y) for y in designs)
        row, where = AimRow(asked.label, before, after, "Hz"), ""
        if asked.trajectory:
            where = f" along {asked.trajectory!r}"
        if (too_high := of_model[asked.mode]) > WITHIN:
            kept += f"; mesh and reduced links raise it {raised_by(too_high)}"
        return _in_words(row, f"mode {asked.mode} is at least {row.after}{where}", kept)
    if aim == "widest":
        before, after = (min(_rooms(found, wanted, y)) for y in designs)
        row = AimRow("bands and gaps as wide as can be", before, after, "")
        return _in_words(row, f"nearest band or gap: {row.after} room", kept)
    return None


def _in_words(row: AimRow, reached: str, kept: str) -> AimRow:
    return replace(row, words=f"{reached} (initially {row.before}){kept}")


def _least(found: Found, asked: Requirement, y: Floats) -> float:
    """The least of a curve, or the least room of a gap, of a design and of its scenarios."""
    model, path = found.task.scene.model, found.task.scene.path
    each = ((path.at(one)[0], one) for one in found.task.designs(y))
    return min(lowest_room(model, asked, *own).room for own in each)


def _rooms(found: Found, wanted: Sequence[Requirement], y: Floats) -> Iterator[float]:
    """Yield the room at every gap and band, relative; of the answer's bands as it was checked."""
    model, path = found.task.scene.model, found.task.scene.path
    yield from (_least(found, gap, y) for gap in wanted if isinstance(gap, ModeGap))
    if not np.array_equal(y, found.best.y):
        yield from (-float(errors.min()) for errors in lacking(found.task, y))
        return
    for one in found.task.designs(y):
        q = path.at(one)[0]
        for band, row in zip(found.task.bands, found.clearances, strict=True):
            yield least_room(model, band, row, q[band.rows], one)
