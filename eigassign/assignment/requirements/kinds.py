"""What may be asked of modes: a frequency, the highest there is, limits, a gap, a band.

Along one trajectory a band is clear if and only if the number k of modes below both of its edges is
the same everywhere. Whatever k is, that is two limits: mode k is at most the lower edge, and mode
k + 1 at least the upper one. From one trajectory to another k may change.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from eigassign.arrays import Floats, Ints
from eigassign.assignment.requirements.requirement import (
    EdgeRows,
    Edges,
    Requirement,
    Solved,
    Terms,
)
from eigassign.case.schema.targets import (
    AnyTarget,
    AtLeastTarget,
    AtMostTarget,
    FrequencyProfile,
    FrequencyTarget,
    GapTarget,
    Harmonic,
    HighestTarget,
    KeepOutTarget,
)
from eigassign.case.units import SI, handy_unit, written
from eigassign.errors import UsageError


class AssignedFrequency(Requirement):
    """The frequency of a mode is ``hz``; the error is the distance to it, of either sign."""

    form = FrequencyTarget
    columns = ("target", "initial", "one shot", "predicted", "exact")

    def errors(self, solved: Solved) -> Floats:
        """The errors f / f_d − 1 (n,)."""
        return np.asarray(self.curve(solved) / self.hz - 1.0)

    def edge_rows(self, factor: Floats | float = 1.0) -> Iterator[EdgeRows]:
        """Yield factor · (f / f_d − 1), of either sign: to miss it violates no limit."""
        yield EdgeRows(self, "lower", self.hz, factor / self.hz)


class HighestFrequency(Requirement):
    """The frequency of a mode is as far above 0 Hz as can be: its row of the objective is −f.

    As a limit, of 0 Hz, it is always met.
    """

    form = HighestTarget
    columns = ("initial", "exact")
    is_aim = True

    def stake(self, solved: Solved, raised: float) -> float:
        """The share of its frequency that a model has raised it by at most."""
        return raised / (1.0 + raised) if np.isfinite(raised) else 1.0

    @property
    def forbidden_hz(self) -> tuple[Floats | None, Floats | None]:
        """None: every frequency is allowed."""
        return None, None


class LowerLimit(Requirement):
    """The frequency of a mode is at least ``hz``."""

    form = AtLeastTarget


class UpperLimit(Requirement):
    """The frequency of a mode is at most ``hz``; too stiff a model is on the safe side."""

    form = AtMostTarget


class ModeGap(Requirement):
    """The frequencies of two modes differ by at least ``hz``: the higher less the lower one."""

    form = GapTarget


NEAR = 0.5  # of an edge: modes this near to a band are shown with it


class Margin(NamedTuple):
    """How far modes keep off a band, relative: off both edges, and off the upper one besides."""

    room: float = 0.0
    raised: float = 0.0  # by what the model raises the mode above the band


class ForbiddenBand(Requirement):
    """The modes keep out of what lies between both edges.

    The error is the way that they lack to be clear, with the best constant number of them below
    along each trajectory: the way out of the band, relative to the edge that is passed, and that
    of modes on the wrong side to the other edge. For its curve stands the frequency nearest to the
    middle of the band.
    """

    form = KeepOutTarget
    columns = ("lower", "upper")

    @property
    def bands(self) -> tuple[ForbiddenBand, ...]:
        """The band along each trajectory for itself: only there k must not change."""
        if len(self.along) < 2:
            return (self,)
        words = ((f"{self.label} along {name!r}", self.part(name, own)) for name, own in self.along)
        return tuple(replace(part, label=label, part_of=self.label) for label, part in words)

    @property
    def counted(self) -> tuple[int, ...]:
        """The only modes that count, ascending; none where all do."""
        return tuple(sorted(self.modes))

    def below(self, solved: Solved) -> Ints:
        """The number of modes below each edge (2, n), of all that matter."""
        hz = self._counted(solved)
        return np.array([(hz < e[:, None]).sum(axis=1) for e in (self.lower, self.upper)])

    def kept_clear(self, k: int, above: int | None, margin: Margin) -> Iterator[Requirement]:
        """Yield what says: k of the modes that count are below, and mode ``above`` is above.

        ``above`` is 0 or None where there is no such mode.
        """
        lower, upper = self.drawn_out(margin)
        endless = np.full_like(lower, np.inf)
        if k:
            highest = self.counted[k - 1] if self.modes else k
            yield self._one_side(UpperLimit, highest, -endless, lower)
        if above:
            yield self._one_side(LowerLimit, above, upper, endless)

    def _one_side(
        self, kind: type[Requirement], mode: int, lower: Floats, upper: Floats
    ) -> Requirement:
        own: dict[str, object] = {"label": self.name, "terms": ((mode, 1.0),), "modes": ()}
        if mode > 0:
            own |= {"label": f"{self.name}: mode {mode}", "modes": (mode,)}
        return kind(**vars(self) | own | {"lower": lower, "upper": upper, "part_of": self.name})

    def curve_range(self, lowest: Solved, highest: Solved) -> Edges:
        """Bounds (n,) of the curve: no farther from the middle than one mode is at the most."""
        least, most = self._counted(lowest), self._counted(highest)
        middle = 0.5 * (self.lower + self.upper)[:, None]
        far = np.maximum(middle - least, most - middle).min(axis=1, keepdims=True)
        ends = middle - far, middle + far
        slack = 1e-12 * middle  # round-off: of one frequency, least and most are at an end
        near = (most >= ends[0] - slack) & (least <= ends[1] + slack)
        low, high = (np.clip(end, least, most) for end in ends)
        return np.where(near, low, np.inf).min(axis=1), np.where(near, high, 0.0).max(axis=1)

    def worst_errors(self, lowest: Solved, highest: Solved) -> Floats:
        """The way (n,) that modes between two frequencies lack to be clear."""
        least, most = self._counted(lowest), self._counted(highest)
        low, high = self.lower[:, None], self.upper[:, None]
        down, up = np.maximum(most / low - 1.0, 0.0), np.maximum(1.0 - least / high, 0.0)
        each = (_by_count(down[own], up[own]) for _, own in self.along)
        return np.concatenate([min(errors, key=lambda one: float(one.max())) for errors in each])

    def drawn_out(self, margin: Margin) -> Edges:
        """The edges (n,) that modes keep off by a margin."""
        raised = (1.0 + margin.room) * (1.0 + margin.raised)
        return self.lower * (1.0 - margin.room), self.upper * raised

    def errors_by_count(self, solved: Solved, margin: Margin) -> Floats:
        """The largest error (count + 1,) with 0, 1, … modes below the band; below 0 it is room."""
        own = self._counted(solved)
        low, high = (edge[:, None] for edge in self.drawn_out(margin))
        return np.array([e.max() for e in _by_count(own / low - 1.0, 1.0 - own / high)])

    def least_errors(self, lowest: Solved, highest: Solved) -> Floats:
        """No errors (n,): which mode is where is not known."""
        return np.zeros(len(self.lower))

    def _counted(self, solved: Solved) -> Floats:
        if not self.modes:
            return solved.hz[self.rows]
        most = solved.hz.shape[1]  # of modes that have mass
        return np.stack([solved.curve(m)[self.rows] for m in self.counted if m <= most], axis=1)

    def near(self, initial: Solved, exact: Solved) -> tuple[int, ...] | None:
        """Modes near the band before or after, one on either side at least; None if followed."""
        if self.followed:
            return None
        both = np.stack([initial.hz[self.rows], exact.hz[self.rows]])
        low, high = self.lower.min(), self.upper.max()
        inside = (both > low * (1.0 - NEAR)) & (both < high * (1.0 + NEAR))
        shown = inside.any(axis=(0, 1))
        below = int((both[1].max(axis=0) < high).sum())  # as many modes are below
        shown[max(below - 1, 0) : below + 1] = True
        return tuple((np.flatnonzero(shown) + 1).tolist())

    @property
    def forbidden_hz(self) -> Edges:
        """The edges."""
        return self.lower, self.upper


def _by_count(down: Floats, up: Floats) -> list[Floats]:
    """The errors (n,) by the number of modes below: of modes (n, count) the ways below and above
    the band, negative where there is room; infinite room where there is no mode.
    """
    none = -np.inf
    return [
        np.maximum(down[:, :k].max(axis=1, initial=none), up[:, k:].max(axis=1, initial=none))
        for k in range(down.shape[1] + 1)
    ]


KINDS: dict[str, type[Requirement]] = {
    one.form.kind: one
    for one in (AssignedFrequency, LowerLimit, UpperLimit, ForbiddenBand, ModeGap, HighestFrequency)
}  # by the key that only their targets have


def asked_of(target: AnyTarget, *hz: Floats) -> tuple[str, Floats, Floats]:
    """What is asked of modes in words, and both edges where its frequencies are ``hz``, each (n,).

    Those of a band are as they are given, or about a multiple of a frequency. Raises UsageError
    for a kind that is not among the cases.
    """
    endless = np.array(np.inf)
    match target:
        case FrequencyTarget():
            return f"at {_said(target.frequency)}", hz[0], hz[0]
        case AtLeastTarget():
            return f"at least {_said(target.at_least)}", hz[0], endless
        case AtMostTarget():
            return f"at most {_said(target.at_most)}", -endless, hz[0]
        case GapTarget():
            return f"at least {_said(target.gap.at_least)} apart", hz[0], endless
        case KeepOutTarget(keep_out=Harmonic() as band):
            times = "" if band.harmonic == 1.0 else f"{band.harmonic:g} × "
            of = band.of.frequency if isinstance(band.of, FrequencyProfile) else (band.of,)
            unit, size = handy_unit(SI("Hz", *of))
            ends = " … ".join(f"{each / size:.12g}" for each in sorted({min(of), max(of)}))
            words = f"clear of {times}{ends} {unit} ± {100 * band.margin:g} %"
            middle = band.harmonic * hz[0]
            return words, middle * (1.0 - band.margin), middle * (1.0 + band.margin)
        case KeepOutTarget(keep_out=(float(low), float(high))):
            unit, size = handy_unit(SI("Hz", low, high))
            return f"clear of {low / size:g} … {high / size:g} {unit}", hz[0], hz[1]
        case HighestTarget():
            return "as high as can be", np.array(0.0), endless
    raise UsageError(f"{target.kind}: its words and edges stand in no case of `asked_of`")


def _said(curve: float | FrequencyProfile) -> str:
    return written(curve, "Hz") if isinstance(curve, float) else "its profile"


def terms_of(target: AnyTarget, modes: tuple[int, ...]) -> Terms:
    """The terms of a requirement on these modes; of a band none: it depends on k which count."""
    if isinstance(target, KeepOutTarget):
        return ()
    if isinstance(target, GapTarget):
        low, high = modes
        return (high, 1.0), (low, -1.0)
    return ((modes[0], 1.0),)
