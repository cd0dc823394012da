"""Is the motion slow? What the velocity terms of eq. (1), which the method neglects, would change.

Where the links only turn, (5 Ω² + |Ω̇|)/λ_1 with the sum Ω of all joint rates bounds the order of
the relative change of λ; where that is far below the accuracy asked for, nothing more is computed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.trajectories import NamedTrajectory
from eigassign.mechanism.trajectory import Trajectory
from eigassign.mechanism.velocity import placeless, velocity_terms
from eigassign.modal.motion import motion_effect
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
NEGLIGIBLE = 0.05  # share of validation.max_error below which the simple estimate settles it
SHIFTS = ("prismatic", "cylindrical", "screw", "carriage", "nut")  # joints that also translate


@dataclass(frozen=True)
class MotionStudy:
    """Largest relative change of an expanded mode's frequency, and the words for it."""

    change: float
    note: str
    warning: str | None


def study_motion(scene: Scene, lam: float) -> MotionStudy | None:
    """Check the case's own timed trajectory; ``lam`` is its lowest exact λ, rad²/s²."""
    parts = () if scene.trajectory is None else scene.trajectory.parts
    timed = [part for part in parts if len(part.trajectory.time_s) >= 3]
    if not timed:
        return None
    limit = scene.file.validation.max_error
    simple = _simple_estimate(scene, timed, lam)
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


def _simple_estimate(scene: Scene, parts: list[NamedTrajectory], lam: float) -> float | None:
    """The largest (5 Ω² + |Ω̇|)/λ_1 along any of the trajectories; None where joints translate."""
    if any(joint.type in SHIFTS for joint in scene.file.mechanism.joints.values()):
        return None
    return max(_haste(part.trajectory) for part in parts) / lam


def _haste(trajectory: Trajectory) -> float:
    """5 Ω² + |Ω̇| at its largest, rad²/s²."""
    time_s, q = trajectory.time_s, trajectory.q
    rate = np.gradient(q, time_s, axis=0, edge_order=2)
    speed = np.abs(rate).sum(axis=1)
    push = np.abs(np.gradient(rate, time_s, axis=0, edge_order=2)).sum(axis=1)
    return float((5.0 * speed**2 + push).max(initial=0.0))


def _effect(scene: Scene, part: NamedTrajectory) -> float:
    model = scene.model
    terms = velocity_terms(scene.file, model.poses.parameters, model.motion)
    path, modes = part.trajectory, scene.expansions.modes
    return motion_effect(
        model.pencil, terms, path.time_s, path.q, scene.initial, tuple(modes)
    ).worst


def _stated(change: float, limit: float, along: str) -> MotionStudy:
    text = f"the neglected velocity terms change a frequency by about {100 * change:.2g} %"
    if change <= limit:
        return MotionStudy(change, f"speed of the motion: {text} along {along}", None)
    warning = (
        f"the motion is not slow: {text} along {along}, over the {100 * limit:g} % of "
        "validation.max_error; the frequencies are those of the mechanism held still at each pose"
    )
    return MotionStudy(change, "", warning)
