"""What a case leaves to ``auto``: elements per link, order, expansion points along the trajectory.

The accuracy asked for (``expansion.accuracy``) is shared: half of it for the mesh, half for the
approximation. Everything is decided from estimates, and the reasons are kept as lines of text.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from eigassign.case import CaseFile
from eigassign.mechanism.trajectories import Trajectories
from eigassign.modal.expansion_choice import choose_expansion
from eigassign.modal.mesh_choice import MeshChoice, choose_mesh
from eigassign.modal.model import Model

Floats = NDArray[np.float64]
ACCURACY = 1e-3  # where the case asks for auto and names none
SHARE = 0.5
SAMPLES = 40  # along the trajectory, at each design that is looked at


@dataclass(frozen=True)
class OrderChoice:
    """Order and further expansion points q, with the reasons."""

    order: int
    more_q: tuple[tuple[float, ...], ...]
    reasons: tuple[str, ...]


def asked_accuracy(file: CaseFile) -> float:
    """``expansion.accuracy``: relative error in frequency."""
    return float(getattr(file.expansion, "accuracy", None) or ACCURACY)


def wanted_modes(file: CaseFile) -> tuple[int, ...]:
    """The modes that matter: those with a target, or expanded, or the lowest."""
    given = file.expansion.modes
    if given != "auto":
        return tuple(sorted({int(mode) for mode in given}))
    return tuple(sorted({target.mode for target in file.targets})) or (1,)


def automatic_elements(file: CaseFile) -> dict[str, int | None]:
    """Elements of every beam link, None where they are left to auto."""
    beams = {n: getattr(link, "elements", None) for n, link in file.mechanism.links.items()}
    return {name: None if isinstance(n, str) else n for name, n in beams.items() if n is not None}


def settle_mesh(
    file: CaseFile, build: Callable[[Mapping[str, int]], Model], x: Floats
) -> MeshChoice:
    """The fewest elements that leave half the accuracy asked for at the poses x (n, n_x).

    Raises AccuracyError where no mesh will do.
    """
    accuracy = SHARE * asked_accuracy(file)
    return choose_mesh(build, automatic_elements(file), x, accuracy, wanted_modes(file))


def choose_order(
    file: CaseFile,
    model: Model,
    trajectory: Trajectories | None,
    q0: Floats,
    y0: Floats,
    modes: tuple[int, ...],
) -> OrderChoice:
    """The lowest order, with further points only where one cannot do, from error estimates.

    Raises AccuracyError, naming the pose, where no order and number of points will do.
    """
    x = looked_at(file, model, trajectory, q0, y0)
    start = np.concatenate([q0, y0])
    accuracy = SHARE * asked_accuracy(file)
    found = choose_expansion(
        model.pencil, x, accuracy, modes, start=start, place=partial(_place, trajectory)
    )
    points = [part.q0 for part in found.expansions[1:]]
    more = tuple(tuple(float(v) for v in q) for q in points if not np.allclose(q, q0))
    return OrderChoice(found.order, more, found.reasons)


def looked_at(
    file: CaseFile, model: Model, trajectory: Trajectories | None, q0: Floats, y0: Floats
) -> Floats:
    """Poses (n, n_x) that the answer must hold at: the trajectory at designs all over the box."""
    q = q0[None] if trajectory is None else trajectory.q[trajectory.spread(SAMPLES)]
    parameters = file.design.parameters.values()
    lower = np.array([p.min for p in parameters])
    upper = np.array([p.max for p in parameters])
    designs = np.unique(np.array([y0, lower, upper]), axis=0) if len(y0) else np.zeros((1, 0))
    return np.vstack([np.hstack([q, np.broadcast_to(y, (len(q), len(y)))]) for y in designs])


def _place(trajectory: Trajectories | None, row: int) -> str:
    """Row of what `looked_at` gives, in words: the sample, whatever the design."""
    if trajectory is None:
        return "the expansion point"
    samples = trajectory.spread(SAMPLES)
    return trajectory.sample(int(samples[row % len(samples)]))
