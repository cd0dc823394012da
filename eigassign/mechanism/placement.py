"""How links hang on one another, and the joints that close loops: what walking the tree found."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from eigassign.mechanism.rotations import Objects, multiply
from eigassign.mechanism.tree import Edge


@dataclass(frozen=True)
class Placement:
    """How one link hangs on its base, and its motion.

    ``rotation`` turns the link's components into base components; ``lever`` runs from the base node
    to the joint node of the link (base axes); ``freedoms`` is A (6, k). ``twist`` (6, n_columns) is
    that of the link's own origin per column, in its own axes. ``foot`` and ``root`` are the base
    node and the joint node, each in its own link's frame.
    """

    link: str
    edge: Edge
    rotation: Objects
    lever: Objects
    freedoms: Objects
    twist: Objects
    base: Placement | None = field(repr=False)  # of the base link; None for the ground
    foot: Objects
    root: Objects

    @property
    def world_rotation(self) -> Objects:
        """From the link's axes to those of the world, (3, 3)."""
        return self._world[0]

    @property
    def world_origin(self) -> Objects:
        """The link's origin in the world, m (3,)."""
        return self._world[1]

    @cached_property
    def _world(self) -> tuple[Objects, Objects]:
        """Asked for where something is drawn, reached or closed; links of a model mostly are not.

        The bases come first, one by one: a chain may be longer than Python lets calls nest.
        """
        waiting = [self]
        while waiting[-1].base is not None and "_world" not in waiting[-1].base.__dict__:
            waiting.append(waiting[-1].base)
        for base in reversed(waiting[1:]):
            base._world  # noqa: B018
        R, foot = (
            (np.eye(3).astype(object), self.foot) if self.base is None else self.base.at(self.foot)
        )
        rotation = multiply(R, self.rotation)
        return rotation, foot + multiply(R, self.lever) - multiply(rotation, self.root)

    def at(self, X: Objects) -> tuple[Objects, Objects]:
        """World rotation, and world position of the point X of the link."""
        return self.world_rotation, self.world_origin + multiply(self.world_rotation, X)


@dataclass(frozen=True)
class Loop:
    """One loop-closing joint: pose and twist of its follower node, reached along both sides."""

    edge: Edge
    rotation: Objects  # from the follower's axes to the base link's axes
    lever: Objects  # from base node to follower node, base axes
    freedoms: Objects
    position_gap: Objects  # (3,) world: along the base side minus along the follower side
    misalignment: Objects  # (3, 3): R_baseᵀ R_follower, the identity when closed
    twist_gap: Objects  # (6, n_columns): follower's own twist minus the carried and joint twist
