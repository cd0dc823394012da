"""The ladder on random mechanisms: trees and loops, planar and spatial, free, locked and held."""

import numpy as np
import pytest
from calibration import Drawn
from rungs import residual, slope
from wide_draws import FAMILIES

from eigassign.errors import EigassignError
from eigassign.mechanism import Pencil
from eigassign.modal import Expansion, expand, rounding_error

SPAN = 0.2  # rad or m, and of the design parameters' middle values


def climb(family: str, seed: int) -> list[float]:
    """Slopes beyond order + 1; that none falls short, and the residual, are asserted on the way.

    There is none where no variable matters, and where modes lie so close that they are expanded
    together: λ_1 is then no polynomial, and clusters have a ladder of their own in test_clusters.
    """
    drawn = FAMILIES[family](seed, 1)
    if drawn is None or not drawn.model.pencil.active.any():
        return []
    pencil, x0, span = drawn.model.pencil, *scaled(drawn)
    floor = 2.0 * rounding_error(pencil, x0, 1)
    together = expand(pencil, drawn.q0, drawn.y0, (1,), 1).clusters[0].modes
    assert residual(pencil, x0, span, 2, together).max() < 1e-10, (family, seed)
    beyond = []
    for order in (1, 2, 3, 4):
        e = expand(pencil, drawn.q0, drawn.y0, (1,), order)
        found = apart(pencil, e, span, floor)
        if found is not None:
            # More where the terms of one degree vanish, as in a symmetric pose.
            assert found > order + 1 - 0.3, (family, seed, order)
            beyond.append(found - order - 1)
    return beyond


def scaled(drawn: Drawn) -> tuple[np.ndarray, np.ndarray]:
    span = np.concatenate([np.full(len(drawn.q0), SPAN), SPAN * drawn.y0])
    return np.concatenate([drawn.q0, drawn.y0]), span


def apart(pencil: Pencil, e: Expansion, span: np.ndarray, floor: float) -> float | None:
    if e.clusters[0].modes != (1,):
        return None
    for share in (1.0, 0.1, 0.01):  # as much of the box as can be posed
        try:
            return slope(pencil, e, share * span, floor)
        except EigassignError:
            continue
    return None


@pytest.mark.parametrize("family", FAMILIES)
def test_random_mechanisms_are_expanded_to_their_order(family: str) -> None:
    beyond = [b for seed in range(60_000, 60_002) for b in climb(family, seed)]
    assert len(beyond) >= 4
    assert np.median(beyond) == pytest.approx(0.0, abs=0.1)
