"""What all kinds of requirements have in common: a curve in time, and edges that it keeps to.

The curve of a requirement is Σ c_i f_i, its terms being pairs (mode i, c_i): one mode with 1, of a
gap its two with ±1. There it shall be between ``lower_hz`` and ``upper_hz``: both are the same
where a frequency is wanted, and one is missing (infinite) for a limit. Its error is

    f / f_d − 1                                   of a wanted frequency,
    1 − f / lower  or  f / upper − 1, above 0     of a limit: its relative violation.

A kind is a class in a module of its own that says in which of this it differs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.exact.requirements import FrequencyGoal, FrequencyLimit
from eigassign.brief import Brief
from eigassign.case.schema.targets import (
    AnyTarget,
    FollowedMode,
    FrequencyFile,
    FrequencyProfile,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Edges = tuple[Floats, Floats]
Terms = tuple[tuple[int, float], ...]


@dataclass(frozen=True, eq=False)
class Solved:
    """Exact frequencies of a design at all samples, in Hz.

    ``hz`` (n_t, n_modes) are the lowest; ``followed`` (n_t, n_followed) those of followed modes,
    NaN where no target needs them, and ``numbers`` say which modes these are.
    """

    hz: Floats
    followed: Floats
    numbers: Ints

    def curve(self, mode: int) -> Floats:
        """The curve (n_t,) of one mode, numbered as in `Requirement`."""
        return np.asarray(self.hz[:, mode - 1] if mode > 0 else self.followed[:, mode])


@dataclass(frozen=True, repr=False, eq=False)
class Requirement(Brief):
    """One target on one mode at those ``rows`` of all samples where it holds; (n,) in Hz.

    A gap is on two modes, a band on all the ``modes`` it names, or without any on all there are.
    Modes are numbered from 1; those followed by their shape −1, −2, …, the last of them named being
    −1: they are in ``terms``, and none of ``modes``. ``along`` has each trajectory's part of
    the requirement's own arrays.
    """

    form: ClassVar[type[AnyTarget]]  # of the case file
    of_soft_model: ClassVar[bool] = False  # a model that is too stiff may seem to meet it
    columns: ClassVar[tuple[str, ...]] = ("target", "initial", "one shot", "exact")

    label: str  # in words: "mode 2 at least 320 Hz"
    place: str  # key path of its target
    modes: tuple[int, ...]
    terms: Terms
    rows: slice
    lower_hz: Floats
    upper_hz: Floats
    along: tuple[tuple[str, slice], ...]
    weight: float = 1.0
    trajectory: str | None = None  # the only one on which it holds
    followed: FollowedMode | None = None

    # --- From a target of the case file

    @staticmethod
    def asked(target: Any) -> str:
        """The words for what is asked of the mode."""
        raise NotImplementedError

    @staticmethod
    def edges(target: Any, *hz: Floats) -> Edges:
        """Lower and upper edge where the target's frequencies are ``hz``, each (n,)."""
        raise NotImplementedError

    @staticmethod
    def terms_of(modes: tuple[int, ...]) -> Terms:
        """The terms of a requirement on these modes."""
        return ((modes[0], 1.0),)

    @property
    def kind(self) -> str:
        """The key that only its targets have: frequency, at_least, at_most, keep_out or gap."""
        return self.form.kind

    @property
    def is_goal(self) -> bool:
        """True where its error is a distance; a limit's is a violation."""
        return self.form.is_goal

    def part(self, name: str, own: slice) -> Self:
        """The same along one trajectory only, at these of its own samples."""
        first, n = self.rows.start + own.start, own.stop - own.start
        return replace(
            self,
            rows=slice(first, first + n),
            lower_hz=self.lower_hz[own],
            upper_hz=self.upper_hz[own],
            along=((name, slice(0, n)),),
        )

    @property
    def parts(self) -> tuple[Self, ...]:
        """The same along each trajectory for itself."""
        return tuple(self.part(*one) for one in self.along)

    # --- Its curve and errors, where modes have some frequencies or lie between two

    @property
    def hz(self) -> Floats:
        """The wanted frequency, or the limit (n,); the lower edge of a band."""
        return self.lower_hz if np.isfinite(self.lower_hz).all() else self.upper_hz

    def curve(self, solved: Solved) -> Floats:
        """The curve (n,) that stands for it."""
        return np.asarray(sum(c * solved.curve(mode)[self.rows] for mode, c in self.terms))

    def curve_range(self, lowest: Solved, highest: Solved) -> Edges:
        """The range (n,) of its curve where each mode is between two frequencies."""
        least: Floats | float = 0.0
        most: Floats | float = 0.0
        for mode, c in self.terms:
            low, high = (c * solved.curve(mode)[self.rows] for solved in (lowest, highest))
            least, most = least + (low if c > 0.0 else high), most + (high if c > 0.0 else low)
        return np.asarray(least), np.asarray(most)

    def errors(self, solved: Solved) -> Floats:
        """The errors (n,)."""
        return self.worst_errors(solved, solved)

    def worst_errors(self, lowest: Solved, highest: Solved) -> Floats:
        """The largest errors (n,), in magnitude, of frequencies between two."""
        return self._outside(*self.curve_range(lowest, highest))

    def least_errors(self, lowest: Solved, highest: Solved) -> Floats:
        """The errors (n,) that no frequency between two avoids."""
        low, high = self.curve_range(lowest, highest)
        return self._outside(high, low)

    def _outside(self, low: Floats, high: Floats) -> Floats:
        """The way (n,) of ``low`` below the lower edge, or of ``high`` above the upper one."""
        with_edge = np.isfinite(self.lower_hz)
        below = np.where(with_edge, 1.0 - low / np.where(with_edge, self.lower_hz, 1.0), 0.0)
        return np.maximum(np.maximum(below, high / self.upper_hz - 1.0), 0.0)

    def near(self, initial: Solved, exact: Solved) -> tuple[int, ...] | None:
        """The modes to be shown with it, before and after; None where its curve says it all."""
        return None

    def stake(self, hz: Floats, raised: float) -> float:
        """The relative error that ``hz`` (n,) may have in a model that raises it so far at most."""
        return raised if self.of_soft_model else 0.0

    # --- Its rows of the program

    def goals(self) -> Iterator[FrequencyGoal]:
        """Yield what the program is to come near to."""
        yield from ()

    def limits(self) -> Iterator[FrequencyLimit]:
        """Yield what the program has to keep, whatever else is chosen."""
        for edge, at_least in ((self.lower_hz, True), (self.upper_hz, False)):
            if np.isfinite(edge).all():
                yield FrequencyLimit(self.label, self.terms, edge, self.rows, at_least)

    @property
    def bands(self) -> tuple[tuple[str, Any], ...]:
        """Bands along each trajectory for itself, in words, of which the program has a choice."""
        return ()

    # --- How it is shown

    @property
    def mode(self) -> int:
        """Its mode, of several the lowest, 1 of all; of a followed one what it is named by."""
        return min(self.modes, default=1) if self.followed is None else self.followed.like

    @property
    def curve_name(self) -> str:
        """The name of the mode whose frequency its curve is, to tell columns and files apart."""
        return f"mode {self.mode}" if self.followed is None else self.followed.name

    @property
    def axis(self) -> str:
        """The quantity that its curve is."""
        return "distance of the modes" if len(self.terms) > 1 else "frequency"

    @property
    def forbidden_hz(self) -> tuple[Floats | None, Floats | None]:
        """The values (n,) between which its curve shall not be; None without an end."""
        lower = bool(np.isfinite(self.lower_hz).all())
        return (None, self.lower_hz) if lower else (self.upper_hz, None)


def in_hz(curve: float | FrequencyProfile | FrequencyFile) -> str:
    """A frequency of a target in words."""
    return f"{curve:g} Hz" if isinstance(curve, (int, float)) else "its profile"
