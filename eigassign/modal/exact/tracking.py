"""Modes followed along a path of (q, y) by the overlap of their shapes.

From one sample to the next, modes are matched so that the sum of their squared overlaps

    O_ij = (φ_a,iᵀ M_b φ_b,j)² / (φ_a,iᵀ M_c,b φ_a,i),   M_c the mass without rigid motion,

is largest. Where an overlap is not clear the step is halved. So a curve keeps its shape through a
crossing, where the order of the modes swaps. In a veering the shapes turn into each other
gradually: the curve stays on its branch, and how much of its identity it gave away is reported.
Modes that coincide have no shapes of their own; those of the sample before are carried over.

Where two neighbouring modes come close along the path, an :class:`Encounter` says whether they
cross or veer, and how closely.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.brief import Brief
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.arguments import chunks, mode_numbers
from eigassign.modal.exact.condensation import Modes, block
from eigassign.modal.exact.solver import eigenvalues, lowest_modes

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
CLEAR = 0.75  # squared overlap above which a match needs no halving
HALVINGS = 12
COINCIDENT = 1e-9  # relative distance in λ below which shapes are arbitrary
EXTRA = 4  # modes above the highest tracked one that it may turn out to be


@dataclass(frozen=True, eq=False, repr=False)
class Tracked(Brief):
    """``modes`` as numbered at the first sample, followed along x (n, n_x); immutable.

    ``lam`` (n, n_modes) in rad²/s²; ``ordinals`` (n, n_modes): which mode, counted from the lowest
    elastic one, each is at each sample; ``overlap`` (n, n_modes): the least squared overlap on the
    way from the sample before; ``certain`` (n, n_modes): false from where identity was lost.
    """

    modes: tuple[int, ...]
    x: Floats
    lam: Floats
    ordinals: Ints
    overlap: Floats
    certain: NDArray[np.bool_]
    encounters: tuple[Encounter, ...]

    @property
    def frequencies(self) -> Floats:
        """f = √λ/2π in Hz, (n, n_modes)."""
        return np.asarray(np.sqrt(self.lam) / (2.0 * np.pi))

    @property
    def swaps(self) -> tuple[int, ...]:
        """Samples at which the order differs from that of the sample before."""
        changed = (np.diff(self.ordinals, axis=0) != 0).any(axis=1)
        return tuple((np.flatnonzero(changed) + 1).tolist())

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences for a reader: encounters, and where identity was lost."""
        lines = [e.line for e in self.encounters]
        for column in np.flatnonzero(~self.certain.all(axis=0)):
            first = int(np.argmin(self.certain[:, column]))
            lines.append(
                f"mode {self.modes[column]} cannot be told from its neighbours after sample {first}"
            )
        return tuple(lines)


@dataclass(frozen=True)
class _TrackedShapes:
    """Shapes of the tracked modes at x, their ordinals (0-based), least overlap on the way."""

    x: Floats
    shapes: Floats
    ordinals: Ints
    overlap: Floats


def track(pencil: Pencil, x: Floats, modes: Sequence[int], extra: int = EXTRA) -> Tracked:
    """Follow ``modes`` of the first sample along x (n, n_x).

    Raises UsageError for modes that there are not.
    """
    wanted = mode_numbers(modes)
    found = lowest_modes(pencil, pencil.theta(x), wanted[-1], extra)
    first = np.array(wanted, dtype=np.intp) - 1
    path = [_TrackedShapes(x[0], found.phi[0][:, first], first, np.ones(len(first)))]
    for k in range(1, len(x)):
        path.append(_advance(pencil, path[-1], x[k], _sample(found, k), 0))
    ordinals = np.array([here.ordinals for here in path])
    overlap = np.array([here.overlap for here in path])
    return Tracked(
        modes=wanted,
        x=x,
        lam=np.take_along_axis(found.lam, ordinals, axis=1),
        ordinals=ordinals + 1,
        overlap=overlap,
        certain=np.logical_and.accumulate(overlap >= 0.5, axis=0),
        encounters=find_encounters(pencil, x, found, ordinals),
    )


def _sample(found: Modes, k: int) -> Modes:
    return Modes(found.lam[k], found.phi[k])


def _advance(
    pencil: Pencil, here: _TrackedShapes, x: Floats, there: Modes, depth: int
) -> _TrackedShapes:
    """Match the shapes at hand with the modes at x, by way of the midpoint where unclear."""
    from scipy.optimize import linear_sum_assignment

    shapes = turn_coincident(pencil, here.shapes, x, there)
    squares = overlaps(pencil, here.shapes, x, shapes)
    columns = np.asarray(linear_sum_assignment(-squares)[1], dtype=np.intp)
    clear = squares[np.arange(len(columns)), columns]
    if clear.min() < CLEAR and depth < HALVINGS:
        middle = 0.5 * (here.x + x)
        count = len(there.lam)
        at = lowest_modes(pencil, pencil.theta(middle[None]), count, 0)
        half = _advance(pencil, here, middle, _sample(at, 0), depth + 1)
        rest = _advance(pencil, half, x, there, depth + 1)
        return _TrackedShapes(x, rest.shapes, rest.ordinals, np.minimum(half.overlap, rest.overlap))
    return _TrackedShapes(x, shapes[:, columns], columns, clear)


def overlaps(pencil: Pencil, shapes: Floats, x: Floats, modes: Floats) -> Floats:
    """O (m, c): share of each shape (n_dof, m) that is each mode (n_dof, c); rows sum to ≤ 1."""
    across, sizes = links(pencil, x[None], shapes[None], modes[None])
    return np.asarray(across[0].T ** 2 / np.diag(sizes[0])[:, None])


def links(pencil: Pencil, x: Floats, before: Floats, after: Floats) -> tuple[Floats, Floats]:
    """φᵀMψ (n, c, m) and ψᵀM_cψ (n, m, m) of shapes ψ ``before`` and modes φ ``after``.

    M is that at x (n, n_x), M_c the same without the rigid motion that shapes contain there.
    """
    theta = pencil.theta(x)
    across = np.empty((len(x), after.shape[2], before.shape[2]))
    sizes = np.empty((len(x), before.shape[2], before.shape[2]))
    every = np.arange(len(x))
    for at in chunks(every, pencil.n_dof**2) if pencil.is_dense else every[:, None]:
        if pencil.is_dense:
            M = pencil.mass_matrices(theta[:, at])
            product, M_FF = M @ before[at], block(M, pencil.rigid, pencil.rigid)
        else:
            whole = pencil.sparse(pencil.mass @ theta[:, at[0]])
            product = np.asarray(whole @ before[at[0]])[None]
            M_FF = whole[pencil.rigid][:, pencil.rigid].toarray()[None]
        on_rigid = product[:, pencil.rigid]
        across[at] = np.swapaxes(after[at], 1, 2) @ product
        sizes[at] = np.swapaxes(before[at], 1, 2) @ product
        if len(pencil.rigid):
            sizes[at] -= np.swapaxes(on_rigid, 1, 2) @ np.linalg.solve(M_FF, on_rigid)
    return across, sizes


def turn_coincident(pencil: Pencil, before: Floats, x: Floats, there: Modes) -> Floats:
    """The modes at x, coincident ones turned within their space to the shapes of before."""
    lam, phi = there.lam, there.phi
    apart = np.diff(lam) > COINCIDENT * lam[1:]
    if apart.all():
        return phi
    M = pencil.sparse(pencil.mass @ pencil.theta(x[None])[:, 0])
    across = phi.T @ (M @ before)
    turned = phi.copy()
    for group in np.split(np.arange(len(lam)), np.flatnonzero(apart) + 1):
        if len(group) > 1:
            turned[:, group] = phi[:, group] @ _rotation(across[group])
    return turned


def _rotation(across: Floats) -> Floats:
    """Orthogonal (g, g) whose first columns are nearest to the shapes most within the space."""
    g = len(across)
    nearest = np.sort(np.argsort(-(across**2).sum(axis=0), kind="stable")[:g])
    U, _, Vt = np.linalg.svd(across[:, nearest])
    square = np.eye(g)
    square[: len(Vt), : len(Vt)] = Vt
    return np.asarray(U @ square)


# --- Where two neighbouring modes come close: do they cross, or veer, and how closely

NEAR = 0.15  # relative distance in frequency above which two modes do not meet
EXCHANGED = 0.1  # share of identity given away from which a veering is reported
CROSSES = 1e-9  # least relative distance in frequency that is taken for zero


@dataclass(frozen=True)
class Encounter:
    """Modes ``lower`` and ``lower + 1`` (by order) meet at path position ``sample``.

    ``gap`` is their least relative distance in frequency; ``swapped`` says that the tracked curves
    change places; ``exchanged`` is the share of their shapes that changed places instead (0 to 1).
    """

    sample: float
    lower: int
    gap: float
    swapped: bool
    exchanged: float

    @property
    def line(self) -> str:
        """One sentence for logs and reports."""
        pair = f"modes {self.lower} and {self.lower + 1}"
        where = f"at sample {self.sample:.2f}"
        if self.gap < CROSSES:
            return f"{pair} cross {where}: their order swaps, each curve keeps its shape"
        if self.swapped:
            return (
                f"{pair} veer {where} with a gap of {self.gap:.1e}, closer than the samples "
                "resolve: followed as a crossing"
            )
        return (
            f"{pair} veer {where} with a gap of {self.gap:.1e}: each stays on its branch and "
            f"{self.exchanged:.0%} of their shapes change places"
        )


def find_encounters(
    pencil: Pencil, x: Floats, found: Modes, ordinals: Ints
) -> tuple[Encounter, ...]:
    """Encounters of tracked modes (``ordinals`` (n, m), 0-based) with their neighbours."""
    if len(x) < 2:
        return ()
    met: list[Encounter] = []
    f = np.sqrt(found.lam)
    for lower in range(f.shape[1] - 1):
        tracked = ((ordinals == lower) | (ordinals == lower + 1)).any(axis=1)
        gap = (f[:, lower + 1] - f[:, lower]) / f[:, lower + 1]
        for k in _swaps(ordinals, lower):
            at, least = _closest(pencil, x, k - 1, k, lower)
            met.append(Encounter(at, lower + 1, least, True, 0.0))
        least_here = (gap[1:-1] <= gap[:-2]) & (gap[1:-1] < gap[2:]) & (gap[1:-1] < NEAR)
        for k in (np.flatnonzero(least_here & tracked[1:-1]) + 1).tolist():
            if not any(e.lower == lower + 1 and abs(e.sample - k) <= 1.0 for e in met):
                met += _veering(pencil, x, found, gap, k, lower)
    return tuple(sorted(met, key=lambda e: (e.sample, e.lower)))


def _swaps(ordinals: Ints, lower: int) -> list[int]:
    """Samples k at which a curve has moved between ``lower`` and ``lower + 1`` since k − 1."""
    before, after = ordinals[:-1], ordinals[1:]
    up = (before <= lower) & (after > lower)
    down = (before > lower) & (after <= lower)
    return (np.flatnonzero((up | down).any(axis=1)) + 1).tolist()


def _veering(
    pencil: Pencil, x: Floats, found: Modes, gap: Floats, k: int, lower: int
) -> list[Encounter]:
    at, least = _closest(pencil, x, k - 1, k + 1, lower)
    far = np.flatnonzero(gap > 3.0 * gap[k])
    left = int(far[far < k].max(initial=0))
    right = int(far[far > k].min(initial=len(gap) - 1))
    pair = slice(lower, lower + 2)
    M = pencil.sparse(pencil.mass @ pencil.theta(x[right : right + 1])[:, 0])
    squares = (found.phi[left][:, pair].T @ (M @ found.phi[right][:, pair])) ** 2
    exchanged = float((squares[0, 1] + squares[1, 0]) / max(squares.sum(), 1e-300))
    if exchanged < EXCHANGED:
        return []
    return [Encounter(at, lower + 1, least, False, exchanged)]


def _closest(pencil: Pencil, x: Floats, left: int, right: int, lower: int) -> tuple[float, float]:
    """Path position and value of the least relative distance in frequency between two samples."""

    def distance(t: float) -> float:
        k = min(int(t), len(x) - 2)
        point = x[k] + (t - k) * (x[k + 1] - x[k])
        lam = eigenvalues(pencil, point[None], lower + 2)[0]
        below, above = np.sqrt(lam[lower : lower + 2])
        return float((above - below) / above)

    a, b = float(left), float(right)
    ratio = (np.sqrt(5.0) - 1.0) / 2.0
    c, d = b - ratio * (b - a), a + ratio * (b - a)
    at_c, at_d = distance(c), distance(d)
    for _ in range(60):  # golden sections down to 3e-13: at a crossing the minimum is a kink
        if at_c < at_d:
            b, d, at_d = d, c, at_c
            c = b - ratio * (b - a)
            at_c = distance(c)
        else:
            a, c, at_c = c, d, at_d
            d = a + ratio * (b - a)
            at_d = distance(d)
    return (c, at_c) if at_c < at_d else (d, at_d)
