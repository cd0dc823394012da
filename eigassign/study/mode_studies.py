"""The expansions of a run compared with exact frequencies, over time, over y and over q."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import zip_longest

import numpy as np
from numpy.typing import NDArray

from eigassign.modal.sizes import DENSE_LIMIT
from eigassign.study.approximation import AXES, COARSE, Grid, compare, grid_over, map_over
from eigassign.study.findings import Comparison, ModeStudy
from eigassign.study.plan import joint_map
from eigassign.study.scene import Scene
from eigassign.study.units import coordinate_units, design_units

Floats = NDArray[np.float64]


def study_modes(scene: Scene, initial_hz: Floats | None = None) -> tuple[ModeStudy, ...]:
    """One study for each expanded mode; ``initial_hz`` (n_t, modes) exact on the trajectory."""
    model, expansions = scene.model, scene.expansions
    over_time: tuple[Comparison, ...] = ()
    if scene.trajectory is not None:
        x = model.x(scene.trajectory.q, scene.initial)
        over_time = compare(model, expansions, x, initial_hz)
    over_design = map_over(model, expansions, design_grid(scene))
    over_q = map_over(model, expansions, q_grid(scene))
    x0 = (expansions.full.q0, expansions.full.y0)
    parts = zip_longest(expansions.modes, over_time, over_design, over_q)
    return tuple(ModeStudy(m, expansions.order, *x0, time, y, q) for m, time, y, q in parts)


def _counts(scene: Scene) -> Mapping[int, int]:
    return AXES if scene.model.n_dof <= DENSE_LIMIT else COARSE


def design_grid(scene: Scene) -> Grid | None:
    """Over the bounds of the first two design parameters, at q0."""
    names, n_q, (lower, upper) = scene.model.y_names, len(scene.q0), scene.bounds
    return grid_over(
        range(n_q, n_q + len(names)),
        names,
        design_units(scene.file),
        lower,
        upper,
        scene.expansions.full.x0,
        _counts(scene),
    )


def q_grid(scene: Scene) -> Grid | None:
    """Over the range that the joint angles travel, at y0, for the first two that matter.

    A joint angle s_i = Σ_k S_ik q_k on which frequencies depend is moved by the last coordinate in
    its row of S, the others staying at q0; so an arm turning as a whole is not mapped.
    """
    S, q0 = joint_map(scene.model), scene.q0
    if scene.trajectory is None or not len(S):
        return None
    travelled, s0 = scene.trajectory.q @ S.T, S @ q0
    moved = [int(np.flatnonzero(row)[-1]) for row in S]
    ends = np.array([travelled.min(axis=0), travelled.max(axis=0)]) - s0
    ends = np.array([np.minimum(ends[0], 0.0), np.maximum(ends[1], 0.0)])  # q0 is always inside
    lower, upper = np.sort(ends / S[range(len(S)), moved], axis=0) + q0[moved]
    names, units = scene.model.q_names, coordinate_units(scene.file)
    return grid_over(
        moved,
        [names[k] for k in moved],
        [units[k] for k in moved],
        lower,
        upper,
        scene.expansions.full.x0,
        _counts(scene),
    )
