"""Is the motion slow? What the velocity terms of eq. (1), which the method neglects, would change.

Where all joints turn, (5 Ω²/g³ + |Ω̇|/g)/λ_1 bounds the order of the relative change of λ: Ω is the
sum of all joint rates, and g ≤ 1 the relative distance to the next mode, with which modes turn by
Ω/g and mix by C ~ Ω/g. Only where that is not far below the accuracy asked for, the quadratic
eigenproblem with these terms is solved (`modal.slow_motion`). The stiffness by the loads −m a of
the motion, which stretch and compress links, counts as one of them; it is formed in any case.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.case.schema.joints import SLIDING
from eigassign.mechanism.assembly.dynamics.velocity_terms import placeless, velocity_terms
from eigassign.mechanism.trajectory.trajectory import NamedTrajectory, Trajectory, rates
from eigassign.modal.slow_motion import motion_effect, stiffening
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
NEGLIGIBLE = 0.05  # share of what is warned of below which the simple estimate settles it
MOVED = 0.005  # of a frequency, from which on it is warned of where max_error is larger
EQUAL = 1e-6  # relative distance below which modes count as this far apart


@dataclass(frozen=True)
class MotionStudy:
    """Largest relative change of an expanded mode's frequency, and the words for it."""

    change: float
    note: str
    warning: str | None


def study_motion(scene: Scene, y: Floats, hz: Floats) -> MotionStudy | None:
    """Check the case's timed trajectories; ``hz`` (n_t, n_modes) are exact frequencies of y."""
    parts = () if scene.trajectory is None else scene.trajectory.parts
    timed = [part for part in parts if len(part.trajectory.given.time_s) >= 3]
    if not timed:
        return None
    hz = hz[~scene.path.inserted]  # what targets ask between samples does not change the motion
    limit, names = min(scene.file.validation.max_error, MOVED), placeless(scene.file)
    simple = _simple_estimate(scene, timed, hz)
    if simple is not None and simple < NEGLIGIBLE * limit:
        most = simple if names else simple + 2.0 * max(_stiffening(scene, p, y) for p in timed)
        if most < NEGLIGIBLE * limit:
            note = (
                f"slow motion: the neglected velocity terms change λ of the optimal design by "
                f"less than {most:.1g}, relative"
            )
            return MotionStudy(most, note, None)
    if names:
        return _rough_study(simple, names, limit)
    change, name = max((_change(scene, part, y), part.name) for part in timed)
    along = f"trajectory {name!r}" if len(parts) > 1 else "the trajectory"
    along += ", with the optimal design"
    return _motion_study(change, limit, along)


def _rough_study(simple: float | None, names: tuple[str, ...], limit: float) -> MotionStudy:
    """Superelements: their inner dofs have no directions, so only the simple estimate is left."""
    why = f"the directions of inner dofs of {', '.join(names)} are not known"
    if simple is None:
        warning = f"the effect of the motion's speed is not known, because {why}"
        return MotionStudy(np.inf, "", warning)
    change = 0.5 * simple  # of a frequency
    text = f"the neglected velocity terms change a frequency by about {100 * change:.2g} %"
    if change <= limit:
        return MotionStudy(change, f"speed of the motion: {text}, a rough estimate: {why}", None)
    warning = f"the motion may not be slow: {text}, over {100 * limit:g} % (rough: {why})"
    return MotionStudy(change, "", warning)


def _simple_estimate(scene: Scene, parts: list[NamedTrajectory], hz: Floats) -> float | None:
    """The largest (5 Ω²/g³ + |Ω̇|/g)/λ_1 along any trajectory; None where joints translate."""
    if any(joint.type in SLIDING for joint in scene.file.mechanism.joints.values()):
        return None
    lam, gap = float((2.0 * np.pi * hz.min()) ** 2), least_gap(hz, scene.modes)
    return max(_neglected_terms(part.trajectory, gap) for part in parts) / lam


def least_gap(hz: Floats, wanted: Sequence[int]) -> float:
    """g ≤ 1: the least distance of a wanted mode's λ from the next, relative to the lower; > 0."""
    distance = np.diff(hz**2, axis=1) / hz[:, :-1] ** 2
    beside = [k for k in range(distance.shape[1]) if k + 1 in wanted or k + 2 in wanted]
    return max(float(distance[:, beside].min(initial=1.0)), EQUAL)


def _neglected_terms(trajectory: Trajectory, gap: float) -> float:
    """5 Ω²/g³ + |Ω̇|/g at its largest, rad²/s²."""
    motion = rates(trajectory)
    speed = np.abs(motion.rate).sum(axis=1)
    push = np.abs(motion.acceleration).sum(axis=1)
    return float((5.0 * speed**2 / gap**3 + push / gap).max(initial=0.0))


def _change(scene: Scene, part: NamedTrajectory, y: Floats) -> float:
    """The largest relative change of a frequency along one trajectory, velocity terms included."""
    model = scene.model
    terms = velocity_terms(model.poses.case, model.poses.parameters, model.motion)
    motion = rates(part.trajectory)
    loads = model.under_load
    return motion_effect(model.pencil, terms, motion, y, scene.modes, loads=loads).worst


def _stiffening(scene: Scene, part: NamedTrajectory, y: Floats) -> float:
    """What the forces of the motion alone change of a frequency along one trajectory, relative."""
    model, motion = scene.model, rates(part.trajectory)
    return stiffening(model.pencil, model.under_load, motion, y, scene.modes)


def _motion_study(change: float, limit: float, along: str) -> MotionStudy:
    text = (
        "the neglected velocity terms and forces of the motion change a frequency by about "
        f"{100 * change:.2g} %"
    )
    if change <= limit:
        return MotionStudy(change, f"speed of the motion: {text} along {along}", None)
    warning = (
        f"the motion is not slow: {text} along {along}, over {100 * limit:g} %. The frequencies "
        "are those of the mechanism held still at each pose"
    )
    return MotionStudy(change, "", warning)
