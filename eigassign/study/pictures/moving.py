"""One mode along the trajectory, for a picture that moves.

At some poses of every trajectory: the rigid links, and what the mode adds at its largest. The sign
of a mode is free; here it is kept from pose to pose, so that neighbours have the same phase.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.mechanism.kinematics.topology import split
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.model import Model, ModeShapes
from eigassign.study.pictures.drawing import AMPLITUDE, extent_of, largest_of, spread_samples
from eigassign.study.results import MovingMode, frozen

Floats = NDArray[np.float64]
FRAMES, FEW_FRAMES = 41, 9  # poses of all trajectories; of each of several or of a large model
MOVING = 4  # trajectories that are shown
POINTS = 24  # of a line


def moving_modes(
    file: CaseFile, model: Model, path: Trajectories, y: Floats, name: str, numbers: Floats
) -> tuple[MovingMode, ...]:
    """The mode ``name`` of design y; ``numbers`` (n_t,) say which it is, NaN where it is not asked.

    Raises what `Model.shapes` raises.
    """
    return tuple(_moving(file, model, path, y, name, numbers))


def _moving(
    file: CaseFile, model: Model, path: Trajectories, y: Floats, name: str, numbers: Floats
) -> Iterator[MovingMode]:
    shown = list(zip(path.parts, path.rows, strict=True))[:MOVING]
    each = FRAMES // len(shown) if model.pencil.is_dense else 0
    frames = max(each, FEW_FRAMES)
    q = path.at(y)[0]
    for part, rows in shown:
        own = rows.start + np.flatnonzero(np.isfinite(numbers[rows]))
        if not len(own):
            continue
        chosen = own[spread_samples(q[own][:, : len(file.coordinates)], frames)]
        modes = numbers[chosen].astype(int) - 1
        found = model.shapes_along(q[chosen], y, int(modes.max()) + 1)
        tip = part.trajectory.tip
        yield _along(file, found, modes, name, part.name, path.time_s[chosen], tip)


def _along(
    file: CaseFile,
    found: Sequence[ModeShapes],
    modes: NDArray[np.intp],
    name: str,
    trajectory: str,
    time_s: Floats,
    tip: Floats | None,
) -> MovingMode:
    d = found[0].strands[0].places.shape[1]
    nodes = _marked(file)
    scales = _scales(found, modes)
    counts = [len(strand.places) for strand in found[0].strands]
    lines = [np.unique(np.linspace(0, n - 1, min(n, POINTS)).round().astype(int)) for n in counts]
    rest = [
        np.stack([one.strands[k].places[points] for one in found]) for k, points in enumerate(lines)
    ]
    own = list(zip(found, modes, scales, strict=True))
    motions = [
        np.stack([s * one.strands[k].motions[m][points] for one, m, s in own])
        for k, points in enumerate(lines)
    ]
    places = [[one.nodes[node].place[:d] for _, _, node in nodes] for one in found]
    moved = [[s * one.nodes[node].motion[m, :d] for _, _, node in nodes] for one, m, s in own]
    return MovingMode(
        name=name,
        trajectory=trajectory,
        time_s=frozen(time_s),
        hz=frozen(np.array([one.frequencies[m] for one, m in zip(found, modes, strict=True)])),
        rest=tuple(map(frozen, rest)),
        motions=tuple(map(frozen, motions)),
        marks=tuple((mark, kind) for mark, kind, _ in nodes),
        mark_places=frozen(np.array(places).reshape(len(found), len(nodes), d)),
        mark_motions=frozen(np.array(moved).reshape(len(found), len(nodes), d)),
        tip_path=tip,
    )


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


def _marked(file: CaseFile) -> list[tuple[str, str, tuple[str, str]]]:
    """Joints and bodies: name, kind and node."""
    joints = file.mechanism.joints.items()
    found: list[tuple[str, str, tuple[str, str]]] = []
    found += [(name, joint.type, split(joint.follower)) for name, joint in joints]
    found += [(name, "body", split(body.at)) for name, body in file.mechanism.bodies.items()]
    return found
