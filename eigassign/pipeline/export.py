"""`eigassign export`: a reduced model for other programs, as accurate as is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import MechanismError, UsageError
from eigassign.modal.adaptive.reduced_model import reduce_adaptively
from eigassign.output.exchange.files import ENDINGS
from eigassign.output.exchange.reduced_file import save_reduced
from eigassign.pipeline.queries import pose_and_design
from eigassign.study.built_case import BuiltCase
from eigassign.study.pictures.drawing import spread_samples

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Exported:
    """A reduced model that was written, and its error where that was estimated."""

    files: tuple[Path, ...]
    modes: tuple[int, ...]
    size: int
    points: int
    error_estimate: float  # the largest, relative in Hz
    samples: int  # poses and designs at which it was estimated


def export(
    case: BuiltCase, path: str | Path, modes: Sequence[int] = (1,), accuracy: float = 1e-6
) -> Exported:
    """Write the smallest reduced model found whose error estimate is at most ``accuracy``.

    That is at the poses of the trajectory (without one, at the expansion point), for the initial
    design and the corners of the design's bounds; of many parameters, for designs drawn within
    them. The ending of ``path`` is .npz, .mat, .c or .h5. Raises UsageError for another, CaseError
    and AccuracyError where there is no such model, StorageError where it cannot be written.
    """
    path = Path(path)
    if path.suffix not in (*ENDINGS, ".h5"):
        raise UsageError(f"{path}: a reduced model is a file that ends in .npz, .mat, .c or .h5")
    with case.located():
        x = _samples(case)
        made = reduce_adaptively(case.model().pencil, x, accuracy, modes)
    reduced, files = made.reduced, save_reduced(made.reduced, path, case.file.title, x)
    return Exported(files, reduced.modes, reduced.size, len(reduced.points), made.worst, len(x))


def _samples(case: BuiltCase) -> Floats:
    """(q, y) where the model is to be good, (n, n_x): of other designs at 20 poses each."""
    initial, designs = case.initial_design, _designs(case)
    if case.file.trajectory is None:
        q = pose_and_design(case)[0]
        return case.model().x(np.tile(q, (1 + len(designs), 1)), np.vstack([initial, designs]))
    path = case.trajectory
    chosen = spread_samples(path.q, 20)
    parts = [case.model().x(path.q, initial)]
    for y in designs:
        try:
            q = path.at(y)[0][chosen]
            if case.model().pencil.weight is not None:
                case.model().require_standing(q, y)
        except MechanismError:  # the tip cannot follow its path, or the mechanism falls or buckles
            continue
        parts.append(case.model().x(q, y))
    return np.concatenate(parts)


def _designs(case: BuiltCase) -> Floats:
    """Corners of the bounds, (n, n_y); of over six parameters, drawn ones, as many as six have."""
    columns = case.file.design.parameters.values()
    bounds = np.array([(column.min, column.max) for column in columns]).reshape(-1, 2)
    if len(bounds) <= 6:
        return np.array(list(product(*bounds))).reshape(-1, len(bounds))
    share = np.random.default_rng(0).random((2**6, len(bounds)))
    return np.asarray(bounds[:, 0] + share * np.ptp(bounds, axis=1))
