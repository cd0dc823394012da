"""A design with the deviations that its tolerances allow: the same problem at several designs.

A scenario σ (n_y,), each entry between −1 and 1, stands for the design

    D_j(y) = y_j + σ_j (share_j |y_j| + amount_j),      not below 0 where nature forbids that,

and what is asked of y is asked of D(y) too: its rows follow those of y, with the slopes of D.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.exact.design_problem import Appraisal
from eigassign.assignment.requirements.crossing import NeighbourPairs, joined
from eigassign.assignment.targets import Floats

Appraise = Callable[[Floats], Appraisal]


@dataclass(frozen=True, eq=False)
class Tolerances:
    """How far parameters may deviate either way, ``share`` of |y| and ``amount`` (n_y,) in SI.

    ``natural`` (n_y,) are those that cannot be below 0, such as masses.
    """

    share: Floats
    amount: Floats
    natural: NDArray[np.bool_]

    @property
    def given(self) -> NDArray[np.bool_]:
        """The parameters (n_y,) that have one."""
        return (self.share > 0.0) | (self.amount > 0.0)

    def deviated(self, y: Floats, sigma: Floats) -> tuple[Floats, Floats]:
        """D (n_y,) of a design y (n_y,), and its slopes (n_y,): D_j depends on y_j alone."""
        design = y + sigma * (self.share * np.abs(y) + self.amount)
        slopes = 1.0 + sigma * self.share * np.sign(y)
        floor = np.where(self.natural, np.minimum(y, 0.0), -np.inf)
        below = design < floor
        return np.where(below, floor, design), np.where(below, np.where(y < 0.0, 1.0, 0.0), slopes)

    def box(self, y: Floats) -> tuple[Floats, Floats]:
        """The least and the largest values (n_y,) of the designs about y."""
        ones = np.ones(len(y))
        return self.deviated(y, -ones)[0], self.deviated(y, ones)[0]

    def scenario(self, y: Floats, design: Floats) -> Floats:
        """σ (n_y,) of a design in the box about y."""
        reach = self.share * np.abs(y) + self.amount
        return np.asarray(np.where(reach > 0.0, (design - y) / np.where(reach > 0.0, reach, 1), 0))


def with_scenarios(
    appraise: Appraise, tolerances: Tolerances, scenarios: Sequence[Floats], of_residuals: bool
) -> Appraise:
    """What sees a design with its excesses in all scenarios; its residuals too, if asked for."""
    if not scenarios:
        return appraise

    def appraised(y: Floats) -> Appraisal:
        each = [(appraise(y), np.ones(len(y)))]
        for sigma in scenarios:
            design, slopes = tolerances.deviated(y, sigma)
            each.append((appraise(design), slopes))
        goals = each if of_residuals else each[:1]
        m, k = len(each[0][0].residual), len(each[0][0].excess)
        pairs: list[NeighbourPairs] = []
        for s, (seen, slopes) in enumerate(each):
            if seen.pairs is not None:
                own = seen.pairs.chosen((seen.pairs.row >= m) | (s < len(goals)))
                row = np.where(own.row < m, own.row + s * m, own.row + (len(goals) - 1) * m + s * k)
                others, mixed = own.others * slopes, own.mixed * slopes
                pairs.append(replace(own, row=row, others=others, mixed=mixed))
        return Appraisal(
            np.concatenate([seen.residual for seen, _ in goals]),
            np.vstack([seen.slopes * slopes for seen, slopes in goals]),
            np.concatenate([seen.excess for seen, _ in each]),
            np.vstack([seen.excess_slopes * slopes for seen, slopes in each]),
            joined(pairs),
        )

    return appraised
