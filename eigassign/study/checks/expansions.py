"""How far both expansions are off: exact solves where nothing was expanded, fitted or looked at.

    stated error = 1.25 max |f / f_exact − 1|

at up to 64 corners of the bounds of the design, each at the poses farthest from the expansion
points, and at 128 points of a fixed sequence between the samples and all over the bounds.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eigassign.facts import percent
from eigassign.modal.adaptive_order import MARGIN
from eigassign.modal.model import Model
from eigassign.study.planning import SCATTERED, unseen
from eigassign.study.results import Comparison, frozen
from eigassign.study.scene import Expansions, Scene

Floats = NDArray[np.float64]


def unseen_points(scene: Scene) -> Floats:
    """x (n, n_x) where the scene's expansions are judged; `auto` has looked at other ones."""
    about = np.array([part.q0 for part in scene.expansions.fulls.parts])
    y0, first = scene.expansions.full.y0, 1 + SCATTERED
    return unseen(scene.file, scene.model, scene.trajectory, about, y0, first).x


def compare(
    model: Model,
    expansions: Expansions,
    x: Floats,
    exact_hz: Floats | None = None,
) -> tuple[Comparison, ...]:
    """One comparison for each expanded mode at the points x (n, n_x), arrays (n,) in Hz.

    ``exact_hz`` (n, at least the highest mode) are exact frequencies already known there.
    """
    q, y = np.split(x, [len(model.q_names)], axis=1)
    if exact_hz is None:
        exact_hz = model.frequencies(q, y, max(expansions.modes))
    taylor, linearised = expansions.taylor_hz(q, y), expansions.linearised_hz(q, y)
    return tuple(
        Comparison(frozen(exact_hz[:, mode - 1]), frozen(taylor[:, k]), frozen(linearised[:, k]))
        for k, mode in enumerate(expansions.modes)
    )


def study_expansions(scene: Scene) -> tuple[Comparison, ...]:
    """Both expansions of each mode at `unseen_points`; raises EigassignError where one has none."""
    return compare(scene.model, scene.expansions, unseen_points(scene))


def expansion_lines(scene: Scene, found: tuple[Comparison, ...]) -> tuple[str, ...]:
    """`study_expansions` in words, one line a mode."""
    where = "between the samples and all over the bounds"
    return tuple(
        f"mode {mode}: the full expansion is about {percent(MARGIN * one.worst_taylor)} off at "
        f"worst, the linearised one {percent(MARGIN * one.worst_linearised)}, measured by exact "
        f"solves at {len(one.exact_hz)} poses and designs {where}"
        for mode, one in zip(scene.modes, found, strict=True)
    )
