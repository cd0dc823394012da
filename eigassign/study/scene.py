"""A case ready to be studied: its model, trajectory and expansions, in one frozen object.

How good an expansion is: exact, full Taylor and linearised frequency at the same points.

Only the exact solves cost anything, so all points of one study are solved in one batch.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.case import CaseFile
from eigassign.errors import CaseError
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.expansion import Expansion, nearest_values
from eigassign.modal.model import Model
from eigassign.study.results import Comparison, DesignMap

# --- A case ready to be studied: its model, trajectory and expansions, in one frozen object

Floats = NDArray[np.float64]
BLOCK = 2_000_000  # numbers of a batch of matrices: a second or so of dense solves
OTHERS = 3  # modes shown above the highest assigned one


def _untold(done: int, of: int) -> None:
    """Progress that nobody watches."""


@dataclass(frozen=True)
class Scene:
    """What all studies of one case start from. SI units."""

    file: CaseFile
    model: Model
    initial: Floats  # y as the file writes it, (n_y,)
    trajectory: Trajectories | None
    expansions: Expansions
    notes: tuple[str, ...]  # what was chosen and why

    @property
    def path(self) -> Trajectories:
        """The trajectory, or several; raises CaseError where the case has none."""
        if self.trajectory is None:
            problem = self.file.problem("trajectory", "is missing, and needed here")
            raise CaseError((problem,))
        return self.trajectory

    @property
    def q0(self) -> Floats:
        """The expansion point in q, (n_q,)."""
        return self.expansions.full.q0

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is implausible in the case file, with its place."""
        return tuple(str(problem) for problem in self.file.warnings)

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper bounds of y, each (n_y,)."""
        parameters = self.file.design.parameters.values()
        return np.array([p.min for p in parameters]), np.array([p.max for p in parameters])

    @property
    def shown_modes(self) -> tuple[int, ...]:
        """Every mode solved along the trajectory: from 1 to three above the expanded ones."""
        available = self.model.n_dof - self.model.n_rigid
        return tuple(range(1, min(max(self.expansions.modes) + OTHERS, available) + 1))

    def exact(self, y: Floats, tell: Callable[[int, int], None] = _untold) -> Floats:
        """Exact frequencies (n_t, n_shown_modes) in Hz on every sample of the trajectory."""
        q, count = self.path.q, len(self.shown_modes)
        block = max(1, BLOCK // self.model.n_dof**2)
        parts = []
        for start in range(0, len(q), block):  # a signal is heard, and progress told, in between
            parts.append(self.model.frequencies(q[start : start + block], y, count))
            if start + block < len(q):
                tell(start + block, len(q))
        hz = np.concatenate(parts)
        hz.setflags(write=False)
        return hz


# --- How good an expansion is: exact, full Taylor and linearised frequency at the same points

# Points along the axes of a map of one and of two variables, both ends included; odd, so that the
# middle is one of them; fewer where a single exact solve takes milliseconds.
AXES = {1: 61, 2: 13}
COARSE = {1: 21, 2: 7}


@dataclass(frozen=True)
class Expansions:
    """The full and the partially linearised expansion of the same modes about the same point.

    ``order`` is that of the linearised one, as asked for; ``full_order`` may be lower, where the
    full set would be too large. (The degree of a set may be lower still: where no coordinate
    matters, the linearised set is linear whatever its order.)
    """

    full: Expansion
    linear: Expansion
    order: int
    full_order: int
    others: tuple[Expansions, ...] = ()  # about further points along the trajectory, same y0

    @property
    def modes(self) -> tuple[int, ...]:
        """The modes that both hold, in the order of their columns."""
        return self.full.modes

    @property
    def all(self) -> tuple[Expansions, ...]:
        """One for each expansion point, the first being this one."""
        return (self, *self.others)

    def taylor_hz(self, q: Floats, y: Floats) -> Floats:
        """Full expansion at samples, (n, n_modes) in Hz; each by the nearest point."""
        return self._pick(q, [part.full.frequencies(q, y) for part in self.all])

    def linearised_hz(self, q: Floats, y: Floats) -> Floats:
        """Partially linearised expansion at samples, (n, n_modes) in Hz."""
        return self._pick(q, [part.linear.frequencies(q, y) for part in self.all])

    def linear_in_design(self, q: Floats) -> tuple[Floats, Floats]:
        """l_0 (n, n_modes) and l (n, n_modes, n_y) of eq. (9); all points share y0."""
        found = [part.linear.linear_in_design(q) for part in self.all]
        return self._pick(q, [f[0] for f in found]), self._pick(q, [f[1] for f in found])

    def estimate(self, q: Floats, y: Floats) -> Floats:
        """Error estimate of the full expansion, relative in Hz, (n, n_modes)."""
        return self._pick(q, [part.full.error_estimate(q, y) for part in self.all])

    def _pick(self, q: Floats, values: list[Floats]) -> Floats:
        return nearest_values([part.full for part in self.all], np.atleast_2d(q), values)

    def column(self, mode: int) -> int:
        """Column of ``mode`` in what the expansions evaluate to."""
        return self.modes.index(mode)


def compare(
    model: Model,
    expansions: Expansions,
    x: Floats,
    exact_hz: Floats | None = None,
) -> tuple[Comparison, ...]:
    """One comparison for each expanded mode at the points x (n, n_x), arrays (n,) in Hz.

    ``exact_hz`` (n, at least the highest mode) are exact frequencies already known there.
    """
    q, y = _split(model, x)
    if exact_hz is None:
        exact_hz = model.frequencies(q, y, max(expansions.modes))
    taylor, linearised = expansions.taylor_hz(q, y), expansions.linearised_hz(q, y)
    return tuple(
        Comparison(_frozen(exact_hz[:, mode - 1]), _frozen(taylor[:, k]), _frozen(linearised[:, k]))
        for k, mode in enumerate(expansions.modes)
    )


def _split(model: Model, x: Floats) -> tuple[Floats, Floats]:
    n_q = len(model.q_names)
    return x[:, :n_q], x[:, n_q:]


@dataclass(frozen=True)
class Grid:
    """A tensor grid over one or two entries of x, the others as in ``x0``."""

    entries: tuple[int, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    axes: tuple[Floats, ...]
    x0: Floats

    @property
    def shape(self) -> tuple[int, ...]:
        """Points along each axis."""
        return tuple(len(axis) for axis in self.axes)

    def points(self) -> Floats:
        """All of them, (n, n_x), the last axis varying fastest."""
        mesh = np.meshgrid(*self.axes, indexing="ij")
        x = np.tile(self.x0, (mesh[0].size, 1))
        for entry, values in zip(self.entries, mesh, strict=True):
            x[:, entry] = values.ravel()
        return x


def grid_over(
    entries: Sequence[int],
    names: Sequence[str],
    units: Sequence[str],
    lower: Floats,
    upper: Floats,
    x0: Floats,
    counts: Mapping[int, int] = AXES,
) -> Grid | None:
    """A grid over the first two of ``entries`` of x that have room between their bounds.

    ``names``, ``units``, ``lower`` and ``upper`` belong to the entries, ``counts`` are points an
    axis by the number of axes. None without room.
    """
    chosen = [k for k in range(len(entries)) if upper[k] > lower[k]][:2]
    if not chosen:
        return None
    count = counts[len(chosen)]
    return Grid(
        tuple(entries[k] for k in chosen),
        tuple(names[k] for k in chosen),
        tuple(units[k] for k in chosen),
        tuple(_frozen(np.linspace(lower[k], upper[k], count)) for k in chosen),
        x0,
    )


def map_over(model: Model, expansions: Expansions, grid: Grid | None) -> tuple[DesignMap, ...]:
    """One map for each expanded mode; none without a grid."""
    if grid is None:
        return ()
    return tuple(
        DesignMap(grid.names, grid.units, grid.axes, _reshaped(values, grid.shape))
        for values in compare(model, expansions, grid.points())
    )


def _reshaped(values: Comparison, shape: tuple[int, ...]) -> Comparison:
    parts = (values.exact_hz, values.taylor_hz, values.linearised_hz)
    return Comparison(*(part.reshape(shape) for part in parts))


def _frozen(array: Floats) -> Floats:
    array = np.ascontiguousarray(array)
    array.setflags(write=False)
    return array
