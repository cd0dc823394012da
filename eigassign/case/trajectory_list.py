"""The key `trajectory` as a whole: one mapping, or a list of them with names."""

from __future__ import annotations

from typing import Annotated, TypeAlias

from pydantic import Discriminator, Field, Tag

from eigassign.case.trajectory_parts import Trajectory
from eigassign.case.vectors import one_or_list
from eigassign.case.yaml_reader import KeyPath

MOST = 100  # trajectories of one case

Trajectories: TypeAlias = Annotated[
    Annotated[Trajectory, Tag("<one>")]
    | Annotated[
        Annotated[tuple[Trajectory, ...], Field(min_length=1, max_length=MOST)], Tag("<list>")
    ],
    Discriminator(one_or_list),
]


def named_trajectories(
    given: Trajectory | tuple[Trajectory, ...] | None,
) -> tuple[tuple[KeyPath, str, Trajectory], ...]:
    """Key path, name and content of each trajectory, in the order of the file."""
    if given is None:
        return ()
    if not isinstance(given, tuple):
        return ((("trajectory",), given.name or "1", given),)
    return tuple((("trajectory", k), t.name or str(k + 1), t) for k, t in enumerate(given))
