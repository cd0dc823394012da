"""Modes followed by their shapes, along a path or from where they are named.

From one sample to the next, modes are matched so that the sum of their squared overlaps

    O_ij = (φ_a,iᵀ M_b φ_b,j)² / (φ_a,iᵀ M_c,b φ_a,i),   M_c the mass without rigid motion,

is largest. Where an overlap is not clear the step is halved. So a curve keeps its shape through a
crossing, where the order of the modes swaps. In a veering the shapes turn into each other
gradually: the curve stays on its branch, and how much of its identity it gave away is reported.
Modes that coincide have no shapes of their own; those of the sample before are carried over.

Where two neighbouring modes come close along the path, an :class:`Encounter` says whether they
cross or veer, and how closely.

A shape ψ, ψᵀMψ = 1, is carried from a place to the next. Its shares in the modes φ_j there are

    s_j = (φ_jᵀ M ψ)² / (ψᵀ M_c ψ),   M_c the mass M of that place without rigid motion.

The mode of the largest share and those within `NEAR` of its frequency are kept,

    ψ ← Σ_j φ_j (φ_jᵀ M ψ) / √Σ_j (φ_jᵀ M ψ)²,

so that a mode far from all others is ψ itself, however its shape changes, and ψ does not turn with
modes that meet: it goes straight through a crossing. In a veering it is a mixture of both, and
comes out as one of them again, the closer the veering the more nearly as the one that has its
shape. Where the modes kept hold less than `CLEAR` of ψ, or the number changes while no other mode
is near, the step is halved; what stays unclear is lost.

`tracking` keeps to the branch instead, and says how much of its shape a curve gave away.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from eigassign.brief import Brief
from eigassign.errors import Candidate, LostModeError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.arguments import chunks, mode_numbers, solve_blocks
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


ALIKE = 1e-3  # of the frequency: modes that share a shape and differ by less may both stand for it


class MoreModesError(Exception):
    """The mode may be among those above the modes that were solved."""


@dataclass(frozen=True, eq=False)
class ModesAtPoint:
    """The lowest modes at x (n_x,); ``complete`` where there are no more."""

    x: Floats
    lam: Floats  # (count,)
    phi: Floats  # (n_dof, count)
    complete: bool


@dataclass(frozen=True, eq=False)
class FollowedShape:
    """A shape ψ = Φ a at a place, |a| = 1; ``a`` (count,) is 0 of modes far from it."""

    at: ModesAtPoint
    a: Floats

    @property
    def number(self) -> int:
        """The mode, from 1, that has the largest share; of modes that coincide the first."""
        return int(np.argmax(self._same)) + 1

    @property
    def lam(self) -> float:
        """Its eigenvalue in rad²/s²."""
        return float(self.at.lam[np.argmax(self.a**2)])

    @property
    def phi(self) -> Floats:
        """The mode itself (n_dof,); of modes that coincide the mixture that has the shape."""
        part = np.where(self._same, self.a, 0.0)
        return np.asarray(self.at.phi @ (part / np.linalg.norm(part)))

    @property
    def is_shared(self) -> bool:
        """True where too much of it is other modes, whose frequencies differ too."""
        away = np.abs(np.sqrt(self.at.lam / self.lam) - 1.0)
        return bool((self.a**2)[self._same].sum() < CLEAR and self.a**2 @ away > ALIKE)

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """The modes that have a part of it."""
        return candidates(self.at, self.a**2)

    @property
    def _same(self) -> NDArray[np.bool_]:
        return np.asarray(np.abs(self.at.lam / self.lam - 1.0) <= COINCIDENT)


def candidates(at: ModesAtPoint, shares: Floats, most: int = 3) -> tuple[Candidate, ...]:
    """The modes of the largest shares, the largest first; none that have hardly any."""
    order = np.argsort(-shares, kind="stable")[:most]
    hz = np.sqrt(at.lam) / (2.0 * np.pi)
    kept = (int(j) for j in order if shares[j] > 0.01)
    return tuple(Candidate(j + 1, float(hz[j]), float(shares[j])) for j in kept)


def places(pencil: Pencil, x: Floats, least: int, extra: int) -> list[ModesAtPoint]:
    """The lowest modes at x (n, n_x), at all as many: ``least``, and up to ``extra`` more.

    Raises what `lowest_modes` raises.
    """
    blocks = solve_blocks(x, pencil.n_dof)
    found = [lowest_modes(pencil, pencil.theta(some), least, extra) for some in blocks]
    count = min(part.lam.shape[1] for part in found)
    lam, phi = (
        np.concatenate([getattr(part, name)[..., :count] for part in found])
        for name in ("lam", "phi")
    )
    complete = count < least + extra or count == len(pencil.elastic)
    return [ModesAtPoint(*each, complete) for each in zip(x, lam, phi, strict=True)]


def follow(
    pencil: Pencil, start: FollowedShape, path: Sequence[ModesAtPoint]
) -> list[FollowedShape]:
    """``start`` carried to the first place of a path, from there to the next, and so on.

    Raises LostModeError, whose ``step`` is the place that the shape was not carried to;
    MoreModesError where the places may hold too few modes.
    """
    if len(path) > 1:
        phi, x = (np.array([getattr(each, name) for each in path]) for name in ("phi", "x"))
        across, sizes = links(pencil, x[1:], phi[:-1], phi[1:])
    found = [start]
    for k, there in enumerate(path):
        link = (across[k - 1], sizes[k - 1]) if k else _link(pencil, start.at, there)
        try:
            found.append(_carried(pencil, found[-1], there, link, 0))
        except LostModeError as lost:
            raise LostModeError(lost.candidates, k) from None
    return found[1:]


def _link(pencil: Pencil, here: ModesAtPoint, there: ModesAtPoint) -> tuple[Floats, Floats]:
    across, sizes = links(pencil, there.x[None], here.phi[None], there.phi[None])
    return across[0], sizes[0]


def _carried(
    pencil: Pencil,
    here: FollowedShape,
    there: ModesAtPoint,
    link: tuple[Floats, Floats],
    depth: int,
) -> FollowedShape:
    """The shape at the next place, by way of the midpoint where the step is unclear."""
    across, sizes = link
    c = across @ here.a
    shares = c**2 / (here.a @ sizes @ here.a)
    best = int(np.argmax(shares))
    near = _near(there, best)
    if near[-1] and not there.complete:
        raise MoreModesError
    before = here.number - 1
    passed = slice(min(before, best), max(before, best) + 1)
    is_met = bool(near[passed].all() and _near(here.at, before)[passed].all())
    if shares[near].sum() >= CLEAR and (depth == HALVINGS or is_met):
        a = np.where(near, c, 0.0)
        return FollowedShape(there, a / np.linalg.norm(a))
    if depth == HALVINGS:
        if shares.sum() < CLEAR and not there.complete:
            raise MoreModesError
        raise LostModeError(candidates(there, shares), 0)
    x = 0.5 * (here.at.x + there.x)
    (middle,) = places(pencil, x[None], len(there.lam), 0)
    middle = replace(middle, complete=there.complete)
    half = _carried(pencil, here, middle, _link(pencil, here.at, middle), depth + 1)
    return _carried(pencil, half, there, _link(pencil, middle, there), depth + 1)


def _near(at: ModesAtPoint, best: int) -> NDArray[np.bool_]:
    """Flags of the modes near one, in the logarithm of the frequency, which is symmetric."""
    return np.asarray(np.abs(np.log(at.lam / at.lam[best])) < 2.0 * NEAR)
