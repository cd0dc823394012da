"""Order and expansion points of the Taylor polynomial, doubled until they are accurate enough.

Its errors are measured at samples that are given, which are solved exactly once. The order doubles
where that lessens the largest error, then the points, all of the same design: each is joined by the
pose that it answers worst. A pose is answered by the nearest point.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import comb

import numpy as np

from eigassign.arrays import Floats
from eigassign.errors import AccuracyError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.arguments import MOST_TERMS, solve_blocks
from eigassign.modal.exact.solver import eigenvalues
from eigassign.modal.expansion import NearestExpansion, expand

ORDERS = (2, 4, 8, 16)
MAX_POINTS = 32
# On the worst error measured, where an accuracy is stated: of 540 answers at other poses and
# designs (`tests/stability/test_measured_errors.py`) none lies above it.
MARGIN = 1.25


@dataclass(frozen=True, eq=False)
class ExpansionChoice(NearestExpansion):
    """Expansions of one order, and their errors (n, n_modes) measured at the samples, in Hz/Hz."""

    error: Floats
    reasons: tuple[str, ...] = ()  # all that was tried, in words

    @property
    def order(self) -> int:
        """Their order, at least 1; where no variable matters, their degree is 0."""
        return max(self.parts[0].order, 1)

    @property
    def size(self) -> int:
        """The number of coefficients of all points."""
        return sum(c.coefficients.size for part in self.parts for c in part.clusters)

    @property
    def stated(self) -> float:
        """The largest error, with its margin."""
        return MARGIN * float(self.error.max())


def raise_order(
    pencil: Pencil,
    x: Floats,
    start: Floats,
    accuracy: float,
    modes: Sequence[int] = (1,),
    orders: Sequence[int] = ORDERS,
    most: float = np.inf,
) -> ExpansionChoice:
    """The first expansions whose error, with its margin, is within ``accuracy`` at x (n, n_x).

    The first point is ``start`` (n_x,); all share its design. No order of over `MOST_TERMS`
    coefficients is tried, and nothing further after ``most`` coefficients. Raises AccuracyError,
    naming the pose, where nothing meets the accuracy.
    """
    n, (q0, y0) = int(pencil.active.sum()), np.split(start, [pencil.n_q])
    q, y = np.split(x, [pencil.n_q], axis=1)
    lam = [eigenvalues(pencil, some, max(modes)) for some in solve_blocks(x, pencil.n_dof)]
    exact_hz = np.sqrt(np.concatenate(lam))[:, np.array(modes) - 1] / (2.0 * np.pi)
    reasons = [f"compared with exact solves at {len(x)} poses and designs"]

    def tries() -> Iterator[ExpansionChoice]:
        """Yield higher orders while that helps; then of as many points again, from the best."""
        todo, poses = [p for p in orders if comb(n + p, p) <= MOST_TERMS] or orders[:1], [q0]
        while len(poses) <= MAX_POINTS:
            each: list[ExpansionChoice] = []
            for order in todo:
                parts = tuple(expand(pencil, pose, y0, modes, order) for pose in poses)
                off = np.abs(NearestExpansion(parts).frequencies(q, y) / exact_hz - 1.0)
                each.append(ExpansionChoice(parts, np.where(np.isnan(off), np.inf, off)))
                yield each[-1]
                if each[-1].stated > min(one.stated for one in each):
                    break
            best = min(each, key=lambda one: one.stated)
            owner, worst = best.owner(q), best.error.max(axis=1)
            rows = [np.where(owner == k, worst, -1.0).argmax() for k in range(len(poses))]
            known = {pose.tobytes() for pose in poses}
            further = [pose for pose in np.unique(q[rows], axis=0) if pose.tobytes() not in known]
            if not further:
                return
            todo, poses = [p for p in todo if p >= best.parts[0].order], [*poses, *further]

    each, tried = (
        list[ExpansionChoice](),
        f"of order up to {max(orders)} at up to {MAX_POINTS} points",
    )
    for found in tries():
        reasons.append(_line(found))
        if found.stated <= accuracy:
            return replace(found, reasons=tuple(reasons))
        each.append(found)
        if found.size > most:
            tried = "tried"
            break
    best = min(each, key=lambda one: one.stated)
    worst = ", ".join(f"{value:.6g}" for value in x[best.error.max(axis=1).argmax()])
    where = f"at (q, y) = ({worst})"
    off_by = f"the best is about {best.stated:.1e} off" if np.isfinite(best.stated) else "λ < 0"
    raise AccuracyError(
        f"no expansion {tried} reaches {accuracy:.1e}: {off_by} {where}. Ask for less, narrow the "
        "bounds of the design, or use ea.reduce"
    )


def _line(found: ExpansionChoice) -> str:
    """Order, points and error in words."""
    what = f"order {found.order}"
    what += f" at {len(found.parts)} points" if len(found.parts) > 1 else ""
    off = f"about {found.stated:.1e} off" if np.isfinite(found.stated) else "no frequency (λ < 0)"
    return f"{what}: {off}"
