"""What is drawn: a mechanism with a design box and poses around one point."""

from dataclasses import dataclass

import numpy as np
from chains import Tree

from eigassign.modal import Model

SPAN = np.pi / 3.0  # rad: q is drawn within this of q0, coordinate by coordinate
Floats = np.ndarray


@dataclass(frozen=True)
class Drawn:
    """One random mechanism with its design box and the poses it is judged at."""

    model: Model
    q0: Floats
    y0: Floats
    q: Floats
    y: Floats
    modes: tuple[int, ...]


def with_box(
    choices: list[tuple[str, float]], rng: np.random.Generator, narrow: dict[str, float]
) -> Tree:
    """Up to four of the parameters, each with a box of a factor of up to four.

    ``narrow`` holds, for the last word of a path, the share that such a box stays within.
    """
    rng.shuffle(choices)
    design = {}
    for k, (path, value) in enumerate(choices[: rng.integers(0, 5)]):
        low, high = rng.uniform(0.5, 0.95), rng.uniform(1.05, 2.0)
        share = narrow.get(path.rpartition(".")[2], 1.0)
        low, high = max(low, 1.0 - share), min(high, 1.0 + share)
        design[f"y{k}"] = {"parameter": path, "min": value * low, "max": value * high}
    return design
