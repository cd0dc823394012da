"""One or several trajectories studied together: their samples stacked, never joined.

Nothing that is differentiated, integrated or drawn over time may run from the end of one trajectory
into the start of the next; what does so goes part by part.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import UsageError
from eigassign.mechanism.trajectory import Trajectory

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


class NamedTrajectory(NamedTuple):
    """One of several trajectories; ``weight`` is what each of its seconds counts beside others."""

    name: str
    trajectory: Trajectory
    weight: float = 1.0


@dataclass(frozen=True)
class Trajectories:
    """At least one trajectory; n samples in all, those of the first one first.

    The time of each begins where its own does, so ``time_s`` need not increase from one to the
    next; ``rows`` says which samples are whose.
    """

    parts: tuple[NamedTrajectory, ...]

    def __post_init__(self) -> None:
        if not self.parts:
            raise UsageError("trajectories: none given")

    @cached_property
    def time_s(self) -> Floats:
        """(n,) in s."""
        return _stacked([part.trajectory.time_s for part in self.parts])

    @cached_property
    def q(self) -> Floats:
        """(n, n_q) in rad or m."""
        return _stacked([part.trajectory.q for part in self.parts])

    @cached_property
    def tip(self) -> Floats | None:
        """(n, 2 or 3) in m; None unless every trajectory is a path of the tip."""
        tips = [part.trajectory.tip for part in self.parts]
        given = [tip for tip in tips if tip is not None]
        return _stacked(given) if len(given) == len(tips) else None

    @property
    def notes(self) -> tuple[str, ...]:
        """Those of every trajectory, with its name where there are several."""
        return tuple(
            f"trajectory {part.name!r}: {note}" if self.several else note
            for part in self.parts
            for note in part.trajectory.notes
        )

    @property
    def several(self) -> bool:
        """Whether there is more than one, so that a sample needs more than its number."""
        return len(self.parts) > 1

    @cached_property
    def rows(self) -> tuple[slice, ...]:
        """Which samples belong to each trajectory."""
        ends = np.cumsum([0, *(len(part.trajectory.time_s) for part in self.parts)])
        return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))

    def rows_of(self, name: str | None) -> slice:
        """The samples of the trajectory of that name, or all; UsageError for an unknown one."""
        if name is None:
            return slice(0, len(self.time_s))
        for part, rows in zip(self.parts, self.rows, strict=True):
            if part.name == name:
                return rows
        raise UsageError(f"trajectory: there is none called {name!r}")

    def sample(self, k: int) -> str:
        """Sample k of all, in words: its place in its own trajectory, counted from 0."""
        part, rows = self._at(k)
        own = k - rows.start
        return f"sample {own} of trajectory {part.name!r}" if self.several else f"sample {own}"

    def where(self, k: int) -> str:
        """The same with its time."""
        return f"{self.sample(k)} (t = {self.time_s[k]:.4g} s)"

    def name_of(self, k: int) -> str:
        """The name of the trajectory that sample k of all belongs to."""
        return self._at(k)[0].name

    def _at(self, k: int) -> tuple[NamedTrajectory, slice]:
        pairs = zip(self.parts, self.rows, strict=True)
        return next(pair for pair in pairs if pair[1].start <= k < pair[1].stop)

    def weights(self, integral: Callable[[Floats], Floats]) -> Floats:
        """ω (n,) with ``ω @ g`` ≈ Σ weight · ∫ g dt over every trajectory for itself.

        ``integral`` gives the weights of one trajectory from its times, such as the trapezoidal
        rule's.
        """
        shares = [part.weight * integral(part.trajectory.time_s) for part in self.parts]
        return _stacked([np.asarray(share) for share in shares])

    def spread(self, count: int) -> Ints:
        """Numbers of about ``count`` samples: of each trajectory its share, with both its ends."""
        n = len(self.time_s)
        chosen = []
        for rows in self.rows:
            own = rows.stop - rows.start
            share = min(own, max(2, round(count * own / n)))
            ends = np.linspace(rows.start, rows.stop - 1, share)
            chosen.append(np.unique(ends.round().astype(np.intp)))
        return np.concatenate(chosen)

    def chosen(self, samples: Sequence[int] | Ints) -> Trajectories:
        """Some of the samples only, given by ascending numbers; no part that has none of them."""
        kept = np.asarray(samples, dtype=np.intp)
        parts = []
        for part, rows in zip(self.parts, self.rows, strict=True):
            own = kept[(kept >= rows.start) & (kept < rows.stop)] - rows.start
            if len(own):
                parts.append(part._replace(trajectory=_thinned(part.trajectory, own)))
        return Trajectories(tuple(parts))


def _thinned(trajectory: Trajectory, rows: Ints) -> Trajectory:
    tip = None if trajectory.tip is None else trajectory.tip[rows]
    return replace(trajectory, time_s=trajectory.time_s[rows], q=trajectory.q[rows], tip=tip)


def _stacked(arrays: Sequence[Floats]) -> Floats:
    stacked = arrays[0] if len(arrays) == 1 else np.concatenate(arrays)
    stacked.setflags(write=False)
    return stacked
