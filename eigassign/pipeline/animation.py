"""`eigassign animate`: the mechanism along its trajectory, or one of its modes, as one file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from eigassign.errors import StorageError, UsageError
from eigassign.output.figures import motion
from eigassign.output.store.atomic import replace_synced
from eigassign.pipeline.queries import pose_and_design
from eigassign.study.built_case import BuiltCase
from eigassign.study.pictures import drawing


def animate(
    case: BuiltCase,
    path: str | Path,
    mode: int | None = None,
    q: Sequence[float] | str | None = None,
    y: Sequence[float] | str | None = None,
    trajectory: str | None = None,
) -> None:
    """Write a GIF or animated PNG, by the ending of ``path``.

    Along the (first) trajectory, or that of this name, at the design as written; with ``mode``,
    from 1, one period of that mode at q and y, as numbers in SI units or text with units. Raises
    UsageError for another ending and for what the case has not, StorageError where ``path`` cannot
    be written.
    """
    path = Path(path)
    kind = path.suffix.lower().removeprefix(".")
    if kind not in ("gif", "png"):
        raise UsageError(f"{path}: an animation is a file that ends in .gif or .png")
    if mode is None:
        if q is not None or y is not None:
            raise UsageError("q and y are of a mode: say which, or leave them out")
        moving = _along(case, trajectory)
    else:
        if mode < 1 or trajectory is not None:
            raise UsageError("modes are numbered from 1, and swing at one pose, q, alone")
        at = pose_and_design(case, q, y, beyond=True)
        with case.located():
            moving = motion.swinging(
                drawing.draw_modes(case.file, case.model(), *at, mode), mode - 1
            )
    data = motion.encode_animation(moving, kind)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_synced(path, data)
    except OSError as error:
        raise StorageError(f"cannot write {path}: {error.strerror}") from error


def _along(case: BuiltCase, name: str | None) -> motion.Animation:
    """Raises UsageError without a trajectory, or one of that name."""
    if case.file.trajectory is None:
        raise UsageError("the case has no trajectory to animate: ask for a mode (--mode 1)")
    named = {part.name: part for part in case.trajectories}
    chosen = case.trajectories[0] if name is None else named.get(name)
    if chosen is None:
        raise UsageError(f"no trajectory {name!r}; there are {', '.join(named)}")
    with case.located():
        poses = drawing.moving_poses(case.file, case.model(), chosen, case.initial_design)
    return motion.along_trajectory(case.file.title, poses)
