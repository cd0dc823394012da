"""Modes that targets name by their shape: at which pose and of which design."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.inputs import frozen
from eigassign.case.case_file import CaseFile
from eigassign.case.schema.design import Choices
from eigassign.case.schema.targets import FollowedMode
from eigassign.mechanism.kinematics.parameters import initial_design, written_loads
from eigassign.mechanism.trajectory.trajectory import Trajectories

Floats = NDArray[np.float64]


def followed_modes(file: CaseFile) -> tuple[FollowedMode, ...]:
    """The modes that targets follow by their shape, each once, in the order of the file."""
    return tuple(dict.fromkeys(mode for target in file.targets for mode in target.followed))


def named_design(file: CaseFile, followed: FollowedMode) -> Floats:
    """y (n_y,) at which mode `like` has the shape to follow; what it leaves out as in the file."""
    y = initial_design(file)
    start = 0
    for name, entry in file.design.entries.items():
        given = followed.design.get(name)
        columns = slice(start, start + (len(entry.properties) if isinstance(entry, Choices) else 1))
        if isinstance(entry, Choices):
            if isinstance(given, str):
                y[columns] = [entry.choices[given][p] for p in entry.properties]
        elif given is not None:
            y[columns] = given
        start = columns.stop
    return frozen(y)


def named_pose(file: CaseFile, followed: FollowedMode, path: Trajectories, y: Floats) -> Floats:
    """q (n_q,) at which it has that shape, of design y where coordinates follow the design.

    What trajectories set is as in the file where the pose is given by its coordinates.
    """
    pose = followed.at
    if pose.time is None:
        return frozen(np.append(np.array(pose.q), written_loads(file)))
    return frozen(path.whole.pose(pose.time, pose.trajectory, y))
