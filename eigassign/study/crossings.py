"""Where the number of a mode may not be believed: neighbouring frequencies that nearly meet."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
NEAR = 0.01  # relative gap in Hz below which two modes may swap numbers between samples


def crossing_warnings(
    hz: Floats, modes: tuple[int, ...], where: Callable[[int], str], design: str
) -> Iterator[str]:
    """A warning for each of ``modes`` whose neighbour comes within 1 % along the trajectory.

    ``hz`` (n_t, at least the highest mode) are exact frequencies at the design named ``design``;
    ``where`` says in words which sample k is.
    Modes are numbered by size at every sample: where two curves cross, their numbers swap.
    """
    pairs = {(low, low + 1) for mode in modes for low in (mode - 1, mode) if low >= 1}
    for low, high in sorted(pairs):
        if high > hz.shape[1]:
            continue
        gap = hz[:, high - 1] / hz[:, low - 1] - 1.0
        k = int(np.argmin(gap))
        if gap[k] < NEAR:
            yield (
                f"modes {low} and {high} come within {100 * gap[k]:.2g} % of each other at "
                f"{where(k)}, near {hz[k, low - 1]:.6g} Hz, with the {design} design; "
                "modes are numbered by size, so if they cross there the curve of a mode changes "
                "from one motion to the other"
            )
