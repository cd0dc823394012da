"""Frequencies along the trajectory and their slopes in the design, as the assignment asks for them.

    ∂f/∂y = (∂λ/∂y + ∂λ/∂q dq/dy) / (8π² f)

Exactly, from a solve at every sample; or, of large models, from reduced models, each made about one
design at a few poses and used as far as its own error estimate allows. Where it allows no more, one
is made about the design that is asked for. Answers are judged by exact solves alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.assignment.requirements.requirement import Frequencies, Solved
from eigassign.errors import AccuracyError, EigassignError, LostModeError
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.exact.condensation import Modes
from eigassign.modal.model import Model
from eigassign.modal.reduced.model import ReducedModel
from eigassign.modal.reduced.reduce import reduce
from eigassign.modal.slopes import eigenvalue_slopes, mixed_slopes, mode_slopes, neighbour_slopes
from eigassign.study.design.followed import Follower, Spectrum, follow_all, unfollowed
from eigassign.study.scene import AT_LEAST, BLOCK, OTHERS, Scene

Floats = NDArray[np.float64]


@dataclass
class DesignResponse:
    """The lowest ``count`` frequencies at every sample and the one above, then those followed.

    By exact solves, which are remembered; by reduced ``models``, if any, where they can be trusted,
    and then without the one above. Of the ``initial`` design all that is shown is kept: ``solved``.
    """

    model: Model
    path: Trajectories
    wanted: NDArray[np.bool_]  # (n_x,): where slopes are wanted
    count: int
    followers: tuple[Follower, ...] = ()
    models: ReducedModels | None = None
    initial: Floats | None = None
    solved: Solved | None = None
    exact_solves: int = 0  # so far
    known: dict[bytes, Frequencies] = field(default_factory=dict)
    lost: list[str] = field(default_factory=list)  # designs at which a followed mode is lost

    def __call__(self, y: Floats) -> Frequencies:
        """Raises EigassignError where the mechanism has no modes, or no pose, at this design.

        LostModeError where a followed mode is lost.
        """
        reduced = None if self.models is None else self.models.at(y, self.count)
        if reduced is not None:
            q, of_design = self.path.at(y)
            found = reduced.eigenvalue_slopes(self.model.x(q, y), self.count, self.wanted)
            hz, slopes = _in_hz(*found)
            return Frequencies(hz, _in_design(slopes, of_design, self.path.follows_design))
        key = y.tobytes()
        if key not in self.known:
            try:
                self.known[key] = self._exact(y)
            except LostModeError as error:
                self.lost.append(str(error))
                raise
        return self.known[key]

    def _exact(self, y: Floats) -> Frequencies:
        q, of_design = self.path.at(y)
        self.exact_solves += len(q)
        shown = self.initial is not None and np.array_equal(y, self.initial)
        if self.followers:
            found, slopes, mixed = self._with_followed(y)
            solved = found.solved
            hz = np.hstack([solved.hz[:, : self.count + 1], solved.followed])
        else:
            x, solve = self.model.x(q, y), partial(mixed_slopes, above=OTHERS if shown else 1)
            lam, slopes, mixed = _in_blocks(solve, self.model, x, self.count, self.wanted)
            solved = unfollowed(np.sqrt(lam) / (2.0 * np.pi))
            hz = solved.hz[:, : self.count + 1]
        self.solved = solved if shown else self.solved
        slopes = slopes / (8.0 * np.pi**2 * hz[..., None])
        lower, upper = (hz[:, k : k + mixed.shape[1]] for k in (0, 1))
        mixed = mixed / (4.0 * np.pi**2 * (lower + upper))[..., None]
        follows = self.path.follows_design
        return Frequencies(hz, *(_in_design(part, of_design, follows) for part in (slopes, mixed)))

    def _with_followed(self, y: Floats) -> tuple[Spectrum, Floats, Floats]:
        """The modes, slopes of λ in (q, y), and those off the diagonal of numbered modes alone."""
        found = follow_all(self.model, self.path, self.followers, y, self.count)
        own = Modes(found.modes.lam[:, : self.count + 1], found.modes.phi[..., : self.count + 1])
        slopes, mixed = neighbour_slopes(self.model.pencil, found.x, own, self.wanted)
        of_followed = mode_slopes(self.model.pencil, found.x, found.followed, self.wanted)
        return found, np.concatenate([slopes, of_followed], axis=1), mixed


def _in_design(slopes: Floats, of_design: Floats, follows: bool) -> Floats:
    """Slopes in y alone of those in (q, y); dq/dy is ``of_design`` where q follows y."""
    n_q = slopes.shape[2] - of_design.shape[2]
    by_y = slopes[..., n_q:]
    return by_y + slopes[..., :n_q] @ of_design if follows else by_y


def exact_slopes(model: Model, x: Floats, count: int, wanted: ArrayLike) -> tuple[Floats, Floats]:
    """The lowest frequencies (n, count) in Hz at x (n, n_x), and their slopes (n, count, n_x).

    ``wanted`` and what is raised are those of `eigenvalue_slopes`.
    """
    return _in_hz(*_in_blocks(eigenvalue_slopes, model, x, count, wanted))


def _in_blocks(
    solve: Callable[..., tuple[Floats, ...]],
    model: Model,
    x: Floats,
    count: int,
    wanted: ArrayLike,
) -> Iterator[Floats]:
    """Yield what ``solve`` finds, block by block, of the modes that there are at all samples."""
    block = max(AT_LEAST, BLOCK // model.n_dof**2)
    parts = [
        solve(model.pencil, x[at : at + block], count, wanted) for at in range(0, len(x), block)
    ]
    for found in zip(*parts, strict=True):
        there = min(part.shape[1] for part in found)
        yield np.concatenate([part[:, :there] for part in found])


def _in_hz(lam: Floats, slopes: Floats) -> tuple[Floats, Floats]:
    hz = np.sqrt(lam) / (2.0 * np.pi)
    return hz, slopes / (8.0 * np.pi**2 * hz[..., None])


def response_of(
    scene: Scene,
    count: int,
    followers: tuple[Follower, ...] = (),
    models: ReducedModels | None = None,
) -> DesignResponse:
    """The response at all samples of the scene's trajectory."""
    lower, upper = scene.bounds
    moving = np.full(scene.path.q.shape[1], scene.path.follows_design)
    moving[scene.model.pencil.n_joints :] = False  # loads do not follow the design
    wanted = np.append(moving, upper > lower)
    own = scene.model, scene.path, wanted, count, followers, models
    return DesignResponse(*own, initial=scene.initial)


# --- Reduced models

TRUSTED = 1e-3  # relative, of the estimate; the errors themselves were below 1e-5


@dataclass
class ReducedModels:
    """Reduced models about designs that a search came by, made as they are needed.

    Modes and their derivatives at three poses make one; its error is estimated at five samples.
    """

    model: Model
    path: Trajectories
    left: int = 8  # that may still be tried in one search
    made: list[ReducedModel] = field(default_factory=list)  # the last used one last

    def at(self, y: Floats, count: int) -> ReducedModel | None:
        """One whose lowest ``count`` modes hold at y (n_y,); None where no more shall be made."""
        watched = self.path.chosen(self.path.spread(5)).at(y)[0]
        for k in range(len(self.made) - 1, -1, -1):
            if len(self.made[k].modes) >= count and self._holds(self.made[k], watched, y):
                self.made.append(self.made.pop(k))
                return self.made[-1]
        if self.left <= 0:
            return None
        self.left -= 1
        poses = self.path.chosen(self.path.spread(3)).at(y)[0]
        modes = tuple(range(1, count + 1))
        try:
            one = reduce(self.model.pencil, poses, np.tile(y, (len(poses), 1)), modes, 1)
        except AccuracyError:
            return None
        if not self._holds(one, watched, y):
            return None
        self.made.append(one)
        return one

    @staticmethod
    def _holds(reduced: ReducedModel, q: Floats, y: Floats) -> bool:
        try:
            return bool(reduced.error_estimate(q, y).max() <= TRUSTED)
        except EigassignError:
            return False


def reduced_models(scene: Scene) -> ReducedModels | None:
    """Models to be reduced as a search needs them; None where exact solves are not dear."""
    large = not scene.model.pencil.is_dense
    return ReducedModels(scene.model, scene.path) if large else None
