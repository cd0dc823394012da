"""What is stated of twenty meshes of solids, against finer meshes of the same parts."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from solid_parts import Bar, blocks, case

import eigassign as ea
from eigassign.modal import Model

MODES = (1, 2, 3, 4)
TO = 8  # times the fourth frequency of a part: what reduction leaves out is the same in both meshes
# Hz of the fourth mode, about
FOURTH = {"bar": 940, "block": 12600, "plate": 1350, "ring": 2600, "taper": 1900, "twist": 1390}
FOURTH |= {"angle": 1840, "tee": 2420, "channel": 1590, "tube": 2340, "holed": 2200}
# edges of blocks along x, y and z in m, missing blocks, axis of the tip
PARTS: dict[str, tuple[Any, Any, int]] = {
    "bar": (([0, 0.4], [-0.01, 0.01], [-0.015, 0.015]), (), 0),
    "block": (([0, 0.1], [-0.03, 0.03], [-0.02, 0.02]), (), 0),
    "plate": (([0, 0.2], [-0.1, 0.1], [0, 0.006]), (), 0),
    "ring": (([0, 0.5 * np.pi], [0, 0.02], [0, 0.015]), (), 0),
    "taper": (([0, 0.3], [-0.02, 0.02], [-0.015, 0.015]), (), 0),
    "twist": (([0, 0.3], [-0.02, 0.02], [-0.006, 0.006]), (), 0),
    "angle": (([0, 0.02, 0.12], [0, 0.04], [0, 0.02, 0.12]), [(1, 0, 1)], 2),
    "tee": (
        ([0, 0.25], [-0.03, -0.004, 0.004, 0.03], [0, 0.008, 0.04]),
        [(0, 0, 1), (0, 2, 1)],
        0,
    ),
    "channel": (([0, 0.3], [-0.02, -0.014, 0.014, 0.02], [0, 0.006, 0.03]), [(0, 1, 1)], 0),
    "tube": (
        ([0, 0.3], [-0.025, -0.02, 0.02, 0.025], [-0.02, -0.015, 0.015, 0.02]),
        [(0, 1, 1)],
        0,
    ),
    "holed": (([0, 0.05, 0.09, 0.15], [-0.04, -0.02, 0.02, 0.04], [0, 0.01]), [(1, 1, 0)], 0),
}
# cells of hexahedra in each block; the finer mesh has half as many more
FINE = {
    "bar": ([18], [3], [3]),
    "block": ([6], [4], [3]),
    "plate": ([11], [11], [1]),
    "ring": ([14], [3], [2]),
    "taper": ([14], [4], [3]),
    "twist": ([15], [4], [2]),
    "angle": ([3, 7], [4], [3, 7]),
    "tee": ([14], [3, 1, 3], [1, 4]),
    "channel": ([14], [1, 4, 1], [1, 4]),
    "tube": ([10], [1, 3, 1], [1, 3, 1]),
    "holed": ([4, 3, 4], [2, 4, 2], [1]),
}
MESHES: list[tuple[str, Any, int]] = [
    ("bar", ([16], [2], [2]), 10),
    ("bar", ([5], [1], [1]), 20),
    ("bar", ([60], [3], [3]), 4),
    ("block", ([4], [2], [2]), 10),
    ("block", ([3], [2], [1]), 20),
    ("block", ([10], [6], [4]), 4),
    ("plate", ([6], [6], [1]), 10),
    ("plate", ([5], [5], [1]), 20),
    ("ring", ([8], [1], [1]), 10),
    ("taper", ([8], [2], [2]), 10),
    ("taper", ([4], [1], [1]), 20),
    ("taper", ([30], [4], [3]), 4),
    ("twist", ([10], [3], [1]), 10),
    ("angle", ([1, 4], [2], [1, 4]), 10),
    ("angle", ([1, 3], [1], [1, 3]), 20),
    ("tee", ([8], [2, 1, 2], [1, 2]), 10),
    ("tee", ([5], [1, 1, 1], [1, 1]), 20),
    ("channel", ([10], [1, 2, 1], [1, 2]), 10),
    ("tube", ([5], [1, 2, 1], [1, 2, 1]), 20),
    ("holed", ([3, 2, 3], [1, 2, 1], [1]), 10),
]


def part_of(name: str, cells: Any, count: int, grading: float = 1.0) -> Bar:
    edges, missing, tip = PARTS[name]
    made = blocks(edges, cells, count, missing, grading, tip)
    x, y, z = made.x.T
    if name == "ring":
        return made._replace(x=np.stack([(0.1 + y) * np.sin(x), (0.1 + y) * np.cos(x), z], axis=1))
    if name == "taper":
        narrow = 1.0 - 2.0 * x
        return made._replace(x=np.stack([x, narrow * y, narrow * z], axis=1))
    if name == "twist":
        c, s = np.cos(x / 0.3), np.sin(x / 0.3)
        return made._replace(x=np.stack([x, c * y - s * z, s * y + c * z], axis=1))
    return made


def model_of(folder: Path, name: str, part: Bar) -> Model:
    given = case(folder, part, reduce_to=TO * FOURTH[name])
    return ea.load_case(given, allow_outside=True).model()


@cache
def true_hz(folder: Path, name: str) -> np.ndarray:
    """By Richardson: corners where a surface moves as one let λ converge with about h^1.5."""
    found, grading = [], 1.0 if name in ("angle", "holed") else 1.3
    for more in (1.0, 1.5):
        cells = [[round(more * n) for n in own] for own in FINE[name]]
        model = model_of(folder, name, part_of(name, cells, 20, grading))
        found.append(model.frequencies([0.0], [], len(MODES))[0] ** 2)
    return np.sqrt(found[1] - (found[0] - found[1]) / (1.5**1.5 - 1.0))


@pytest.mark.parametrize(
    ("name", "cells", "count"),
    [pytest.param(*row, marks=() if row[0] == "bar" else pytest.mark.slow) for row in MESHES],
)
def test_stated_is_true_within_a_factor_of_two(
    tmp_path_factory: pytest.TempPathFactory, name: str, cells: Any, count: int
) -> None:
    folder = tmp_path_factory.getbasetemp()
    model = model_of(folder, name, part_of(name, cells, count))
    raised = model.frequencies([0.0], [], len(MODES))[0] / true_hz(folder, name) - 1.0
    stated = model.discretisation_error([0.0], [], MODES)[0]
    print(f"{name:8s} {count:2d} true %", *(f"{100 * e:7.3f}" for e in raised), end="  ")  # noqa: T201
    print("stated/true", *(f"{e:5.2f}" for e in stated / raised), flush=True)  # noqa: T201
    assert (stated > 0.5 * raised).all()
    assert (stated < 2.0 * raised).all()
