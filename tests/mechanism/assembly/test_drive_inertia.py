"""The inertia that a drive reflects through its gear: ½ J ṡ² with the joint's own rate ṡ."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from chains import Tree, model_of, two_link
from frame_comparison import agree
from spatial_random import EVERY_TREE, random_closed, random_open


def test_the_inertia_may_be_a_design_parameter() -> None:
    design = {"J": {"parameter": "coordinates.q2.drive.inertia", "min": 0.0, "max": 0.5}}
    drive = {"stiffness": 300.0, "inertia": 0.1}
    varied = model_of(two_link(drives=("free", drive), design=design))
    for J in (0.0, 0.1, 0.37):
        written = model_of(two_link(drives=("free", {**drive, "inertia": J}), design={}))
        np.testing.assert_allclose(
            varied.frequencies([0.3, 1.1], [J], 4),
            written.frequencies([0.3, 1.1], [], 4),
            rtol=1e-12,
        )


def geared(tree: Tree, seed: int) -> Tree:
    """The tree with an inertia on the drive of every coordinate that is not locked."""
    random = np.random.default_rng(seed)
    for data in tree["coordinates"].values():
        given: Any = data.get("drive", "free")
        if given != "locked":
            held = given if isinstance(given, dict) else {}
            data["drive"] = {**held, "inertia": float(10 ** random.uniform(-2, 1))}
    return tree


@pytest.mark.parametrize("drawn", EVERY_TREE, ids=str)
def test_random_trees_with_geared_drives_have_the_spectrum_of_the_plain_frame(
    drawn: tuple[int, str, bool],
) -> None:
    tree, q = random_open(*drawn)
    agree(geared(tree, drawn[0]), (q,))


@pytest.mark.parametrize("space", ["planar", "spatial"])
@pytest.mark.parametrize("seed", range(8))
def test_random_loops_with_geared_drives_have_the_spectrum_of_the_plain_frame(
    seed: int, space: str
) -> None:
    tree, *poses = random_closed(seed, space)
    agree(geared(tree, seed), tuple(poses))
