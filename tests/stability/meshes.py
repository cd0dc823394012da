"""Random meshes, given and chosen, judged at all corners of their design boxes against finer ones.

Planar and spatial trees and loops with tapers, frames, shear and riders; see `calibration.draw` and
`wide_draws`. The truth is the same mechanism with eight times the elements.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
from calibration import Drawn, draw
from wide_draws import FAMILIES

from eigassign.case import CaseFile
from eigassign.errors import AccuracyError, EigassignError
from eigassign.mechanism import refined, with_elements
from eigassign.modal import Model
from eigassign.study import automatic_elements, build_model, settle_model

FINER = 8.0
DRAWS = (draw, *FAMILIES.values())
ACCURACIES = (1e-2, 1e-3, 1e-4)
ROUND_OFF = 1e-8  # relative in frequency, of the two meshes


@dataclass(frozen=True)
class Judged:
    """Modes of one mesh at all corners: true relative errors and those stated, (n, n_modes)."""

    seed: int
    true: np.ndarray
    stated: np.ndarray
    promised: float | None = None  # of a mesh that was chosen: the share of the accuracy it has
    refused: str | None = None  # why there is no mesh


def mesh(seed: int) -> Judged | None:
    """The mesh of one random mechanism; every other one leaves its elements to auto."""
    drawn = DRAWS[seed // 2 % len(DRAWS)](seed, 1)
    if drawn is None or drawn.model.meshed is None:
        return None
    file, model, promised = drawn.model.poses.case, drawn.model, None
    free = [name for name, n in automatic_elements(file).items() if n is not None]
    if seed % 2 and free:
        accuracy = ACCURACIES[seed % 3]
        promised = 0.5 * accuracy
        try:
            settled = settle_model(_left_to_auto(file, free, drawn.q0, accuracy))
        except AccuracyError as error:
            return Judged(seed, np.zeros((0, 1)), np.zeros((0, 1)), promised, str(error))
        file, model = settled.file, settled.model
    return _at_all_corners(seed, file, model, drawn, promised)


def _left_to_auto(file: CaseFile, free: list[str], q0: np.ndarray, accuracy: float) -> CaseFile:
    expansion = file.expansion.model_copy(update={"q": tuple(q0.tolist()), "accuracy": accuracy})
    auto: dict[str, object] = dict.fromkeys(free, "auto")
    return replace(with_elements(file, auto), expansion=expansion)  # type: ignore[arg-type]


def _at_all_corners(
    seed: int, file: CaseFile, model: Model, drawn: Drawn, promised: float | None
) -> Judged | None:
    modes = (1,) if promised is not None else drawn.modes
    fine = build_model(refined(file, FINER)[0])
    ends = [(p.min, p.max) for p in file.design.parameters.values()]
    true, stated = [], []
    for corner in itertools.product(*ends):
        try:
            exact = fine.frequencies(drawn.q0, corner, max(modes))[0]
            hz = model.frequencies(drawn.q0, corner, max(modes))[0]
        except EigassignError:  # a loop that does not close there
            continue
        pick = np.array(modes) - 1
        true.append(hz[pick] / exact[pick] - 1.0)
        stated.append(model.discretisation_error(drawn.q0, corner, modes)[0])
    return Judged(seed, np.array(true), np.array(stated), promised) if true else None
