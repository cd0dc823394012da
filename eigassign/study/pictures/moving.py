"""Modes along trajectories, for a picture that moves.

At some poses of every trajectory: the rigid links, and the modes at their largest. The sign of a
mode is free; here it is kept from pose to pose, so that neighbours have the same phase.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.model import Model, ModeShapes
from eigassign.study.pictures.drawing import (
    AMPLITUDE,
    displaced,
    extent_of,
    largest_of,
    spread_samples,
)
from eigassign.study.results import Motion, MovingMode

Floats = NDArray[np.float64]
FRAMES, FEW_FRAMES = 41, 9  # poses of all trajectories; of each of several or of a large model
MOVING = 4  # trajectories that are shown
POINTS = 12  # of a line


def motions(
    file: CaseFile, model: Model, path: Trajectories, y: Floats, numbers: Mapping[str, Floats]
) -> Iterator[Motion]:
    """Yield modes of design y by name along each trajectory; ``numbers`` (n_t,) say which each is.

    Raises what `Model.shapes` raises.
    """
    shown = list(zip(path.parts, path.rows, strict=True))[:MOVING]
    each, q = FRAMES // len(shown) if model.pencil.is_dense else 0, path.at(y)[0]
    for part, rows in shown:
        few = spread_samples(q[rows][:, : len(file.coordinates)], max(each, FEW_FRAMES))
        chosen = rows.start + np.array(few)
        which = {name: numbers[name][chosen].astype(int) - 1 for name in numbers}
        count = 1 + int(max(modes.max() for modes in which.values()))
        found, x = model.shapes_along(q[chosen], y, count), model.x(q[chosen], y)
        rest = replace(
            displaced(file, model, x, found, np.zeros((len(x), count)), POINTS),
            time_s=path.time_s[chosen],
            tip_path=part.trajectory.tip,
        )
        yield Motion(part.name, rest, tuple(_modes(file, model, x, found, which)))


def _modes(
    file: CaseFile,
    model: Model,
    x: Floats,
    found: Sequence[ModeShapes],
    which: Mapping[str, NDArray[np.intp]],
) -> Iterator[MovingMode]:
    for name, modes in which.items():
        hz = np.array([one.frequencies[m] for one, m in zip(found, modes, strict=True)])
        factors = np.zeros((len(found), found[0].frequencies.size))
        factors[np.arange(len(found)), modes] = _scales(found, modes)
        yield MovingMode(name, hz, displaced(file, model, x, found, factors, POINTS))


def _scales(found: Sequence[ModeShapes], modes: NDArray[np.intp]) -> Floats:
    """The factor of each pose that makes the largest displacements alike, signs following on."""
    size = AMPLITUDE * max(extent_of(one) for one in found)
    scales = np.array(
        [size / largest_of(one)[mode] for one, mode in zip(found, modes, strict=True)]
    )
    before: Floats | None = None
    for k, (one, mode) in enumerate(zip(found, modes, strict=True)):
        now = np.concatenate([strand.motions[mode].ravel() for strand in one.strands])
        if before is not None and now @ before < 0.0:
            scales[k] *= -1.0
        before = np.sign(scales[k]) * now
    return scales
