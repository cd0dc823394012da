"""Is the motion slow? What the velocity terms of eq. (1), which the method neglects, would change.

They are measured at some instants (`modal.slow_motion`), together with the stiffness by the loads
−m a of the motion, which stretch and compress links. Where inner dofs have no directions, that
cannot be done.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.assembly.dynamics.velocity_terms import placeless, velocity_terms
from eigassign.mechanism.trajectory.trajectory import rates
from eigassign.modal.slow_motion import motion_effect
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
MOVED = 0.005  # of a frequency, from which on it is warned of where max_error is larger
INSTANTS, INSTANTS_LARGE = 9, 3
LARGE = 2_000  # degrees of freedom, from which on an instant takes 0.1 s and more
EQUAL = 1e-6  # relative distance below which modes count as this far apart
NEGLECTED = "the neglected velocity terms and forces of the motion change"


@dataclass(frozen=True)
class MotionRow:
    """What the motion changes of a mode's frequency, relative, at the sample where it is most."""

    mode: int
    change: float
    where: str

    @property
    def words(self) -> str:
        """The mode, how much and where."""
        return (
            f"{NEGLECTED} mode {self.mode} by about {100 * abs(self.change):.2g} % at {self.where}"
        )


@dataclass(frozen=True)
class MotionStudy:
    """A row a mode, none where inner dofs have no directions, and the words for all."""

    rows: tuple[MotionRow, ...]
    note: str
    warning: str | None


def study_motion(
    scene: Scene, y: Floats, hz: Floats, asked: Collection[int] = ()
) -> MotionStudy | None:
    """Check the case's timed trajectories for the modes of the scene and those ``asked`` for.

    ``hz`` (n_t, n_modes) are exact frequencies of design y (n_y,). None without a timed trajectory.
    """
    if scene.trajectory is None:
        return None
    parts = [part.trajectory for part in scene.trajectory.parts]
    given = np.flatnonzero(~scene.path.inserted)  # what targets ask between samples is no motion
    ends = np.cumsum([len(part.given.time_s) for part in parts])
    samples = np.split(given, ends[:-1])
    timed = [
        (rates(part.given), own) for part, own in zip(parts, samples, strict=True) if len(own) >= 3
    ]
    if not timed:
        return None
    modes, limit = sorted({*scene.modes, *asked}), min(scene.file.validation.max_error, MOVED)
    gap = gap_along(hz, modes)
    if names := placeless(scene.file):
        why = f"the directions of inner dofs of {', '.join(names)} are not known"
        return MotionStudy((), "", f"the effect of the motion's speed is not known, because {why}")
    model, worst = scene.model, dict[int, tuple[float, int]]()
    terms = velocity_terms(model.poses.case, model.poses.parameters, model.motion)
    for motion, own in timed:
        near = gap[own[motion.samples]]
        count = INSTANTS if model.n_dof < LARGE else INSTANTS_LARGE
        found = motion_effect(
            model.pencil, terms, motion, y, tuple(modes), count, model.under_load, near
        )
        for mode, change in zip(modes, found.change.T, strict=True):
            k = int(np.abs(change).argmax())
            one = float(change[k]), int(own[found.samples[k]])
            worst[mode] = max(worst.get(mode, one), one, key=lambda each: abs(each[0]))
    rows = tuple(MotionRow(n, change, scene.path.where(k)) for n, (change, k) in worst.items())
    most = max(rows, key=lambda row: abs(row.change))
    text = f"{most.words}, with the optimal design"
    if abs(most.change) <= limit:
        return MotionStudy(rows, f"speed of the motion: {text}", None)
    warning = (
        f"the motion is not slow: {text}, over {100 * limit:g} %. The frequencies are those of the "
        "mechanism held still at each pose"
    )
    return MotionStudy(rows, "", warning)


def motion_doubt(
    study: MotionStudy | None, asked: Collection[int], accepted: float
) -> Iterator[str]:
    """Say why no number can be vouched for: the motion changes a mode ``asked`` for by too much."""
    own = [] if study is None else [row for row in study.rows if row.mode in asked]
    worst = max(own, key=lambda row: abs(row.change), default=None)
    if worst is not None and abs(worst.change) > accepted:
        yield f"{worst.words}, and {100 * accepted:.3g} % are accepted"


def gap_along(hz: Floats, wanted: Sequence[int]) -> Floats:
    """g (n_t,), 0 < g ≤ 1: the relative distance of λ of a wanted mode from the next."""
    distance = np.diff(hz**2, axis=1) / hz[:, :-1] ** 2
    beside = [k for k in range(distance.shape[1]) if k + 1 in wanted or k + 2 in wanted]
    return np.asarray(np.maximum(distance[:, beside].min(axis=1, initial=1.0), EQUAL))
