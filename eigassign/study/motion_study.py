"""Is the motion slow? What the velocity terms of eq. (1), which the method neglects, would change.

Where the links only turn, (5 Ω²/g³ + |Ω̇|/g)/λ_1 with the sum Ω of all joint rates bounds the order
of the relative change of λ: g ≤ 1 is the relative distance to the next mode, with which modes turn
by Ω/g and mix by C ~ Ω/g. Where that is far below the accuracy asked for, nothing more is computed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.rates import rates
from eigassign.mechanism.trajectories import NamedTrajectory
from eigassign.mechanism.trajectory import Trajectory
from eigassign.mechanism.velocity import placeless, velocity_terms
from eigassign.modal.motion import motion_effect
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
NEGLIGIBLE = 0.05  # share of validation.max_error below which the simple estimate settles it
EQUAL = 1e-6  # distance of modes that are taken for equal
SHIFTS = ("prismatic", "cylindrical", "screw", "carriage", "nut")  # joints that also translate


@dataclass(frozen=True)
class MotionStudy:
    """Largest relative change of an expanded mode's frequency, and the words for it."""

    change: float
    note: str
    warning: str | None


def study_motion(scene: Scene, hz: Floats) -> MotionStudy | None:
    """Check the case's timed trajectories; ``hz`` (n_t, n_modes) are their exact frequencies."""
    parts = () if scene.trajectory is None else scene.trajectory.parts
    timed = [part for part in parts if len(part.trajectory.time_s) >= 3]
    if not timed:
        return None
    limit = scene.file.validation.max_error
    simple = _simple_estimate(scene, timed, hz)
    if simple is not None and simple < NEGLIGIBLE * limit:
        note = f"slow motion: the neglected velocity terms change λ by less than about {simple:.1g}"
        return MotionStudy(simple, note, None)
    if names := placeless(scene.file):
        return _roughly(simple, names, limit)
    change, name = max((_effect(scene, part), part.name) for part in timed)
    along = f"trajectory {name!r}" if len(parts) > 1 else "the trajectory"
    return _stated(change, limit, along)


def _roughly(simple: float | None, names: tuple[str, ...], limit: float) -> MotionStudy:
    """Superelements: their inner dofs have no directions, so only the simple estimate is left."""
    why = f"the inner dofs of {', '.join(names)} have no directions"
    if simple is None:
        warning = f"what the neglected velocity terms change is not known: {why}"
        return MotionStudy(np.inf, "", warning)
    change = 0.5 * simple  # of a frequency
    text = f"the neglected velocity terms change a frequency by about {100 * change:.2g} %"
    if change <= limit:
        return MotionStudy(change, f"speed of the motion: {text}, roughly, for {why}", None)
    warning = (
        f"the motion may not be slow: {text}, roughly, for {why}; over the {100 * limit:g} % of "
        "validation.max_error"
    )
    return MotionStudy(change, "", warning)


def _simple_estimate(scene: Scene, parts: list[NamedTrajectory], hz: Floats) -> float | None:
    """The largest (5 Ω²/g³ + |Ω̇|/g)/λ_1 along any trajectory; None where joints translate."""
    if any(joint.type in SHIFTS for joint in scene.file.mechanism.joints.values()):
        return None
    lam, gap = float((2.0 * np.pi * hz.min()) ** 2), _nearest(hz, scene.expansions.modes)
    return max(_haste(part.trajectory, gap) for part in parts) / lam


def _nearest(hz: Floats, wanted: Sequence[int]) -> float:
    """g ≤ 1: the least distance of a wanted mode's λ from the next, relative to the lower; > 0."""
    distance = np.diff(hz**2, axis=1) / hz[:, :-1] ** 2
    beside = [k for k in range(distance.shape[1]) if k + 1 in wanted or k + 2 in wanted]
    return max(float(distance[:, beside].min(initial=1.0)), EQUAL)


def _haste(trajectory: Trajectory, gap: float) -> float:
    """5 Ω²/g³ + |Ω̇|/g at its largest, rad²/s²."""
    motion = rates(trajectory)
    speed = np.abs(motion.rate).sum(axis=1)
    push = np.abs(motion.acceleration).sum(axis=1)
    return float((5.0 * speed**2 / gap**3 + push / gap).max(initial=0.0))


def _effect(scene: Scene, part: NamedTrajectory) -> float:
    model = scene.model
    terms = velocity_terms(scene.file, model.poses.parameters, model.motion)
    modes = tuple(scene.expansions.modes)
    return motion_effect(model.pencil, terms, rates(part.trajectory), scene.initial, modes).worst


def _stated(change: float, limit: float, along: str) -> MotionStudy:
    text = f"the neglected velocity terms change a frequency by about {100 * change:.2g} %"
    if change <= limit:
        return MotionStudy(change, f"speed of the motion: {text} along {along}", None)
    warning = (
        f"the motion is not slow: {text} along {along}, over the {100 * limit:g} % of "
        "validation.max_error; the frequencies are those of the mechanism held still at each pose"
    )
    return MotionStudy(change, "", warning)
