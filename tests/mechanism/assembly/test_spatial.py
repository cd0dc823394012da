"""The ERLS pencil of every kind of mechanism against a plain frame program in world axes."""

from typing import Any

import chains
import numpy as np
import pytest
from frame_comparison import agree
from spatial_cases import built, changed
from spatial_examples import arm3r, four_bar, gantry, slider_crank
from spatial_oracle import Tree, world
from spatial_random import (
    EVERY_LOOP,
    EVERY_TREE,
    PLANAR,
    SPATIAL,
    geared,
    random_closed,
    random_open,
)

from eigassign.modal import eigenvalues

SPACES = pytest.mark.parametrize("space", ["planar", "spatial"])


@pytest.mark.parametrize("drawn", EVERY_TREE, ids=str)
def test_random_trees_have_the_spectrum_and_places_of_the_plain_frame(
    drawn: tuple[int, str, bool],
) -> None:
    """Their drives with the inertia that a gear reflects."""
    tree, q = random_open(*drawn)
    agree(geared(tree, drawn[0]), (q,))


@pytest.mark.parametrize("drawn", EVERY_LOOP, ids=str)
def test_random_loops_have_the_spectrum_and_places_of_the_plain_frame(
    drawn: tuple[int, str, int, bool],
) -> None:
    tree, *poses = random_closed(*drawn)
    agree(tree, tuple(poses))


def kinds_of(trees: list[Tree]) -> tuple[set[str], ...]:
    """Types of links, sections, drives and joints, those that are walked backwards marked."""
    links, sections, drives, joints = (set[str]() for _ in range(4))
    for tree in trees:
        m = tree["mechanism"]
        order = ["ground", *m["links"]]
        for link in m["links"].values():
            links.add(link.get("type", "beam"))
            for beam in link.get("beams", {"": link}).values():
                sections.add(str(beam.get("section")))
        drives |= {
            type(c["drive"]).__name__ + str(c["drive"])[0] for c in tree["coordinates"].values()
        }
        for joint in m["joints"].values():
            first, last = (order.index(joint[end].split(".")[0]) for end in ("base", "follower"))
            joints.add(joint["type"] + (" backwards" if first > last else ""))
    return links, sections, drives, joints


@pytest.mark.parametrize(("space", "types"), [("planar", PLANAR), ("spatial", SPATIAL)])
def test_few_draws_hold_every_kind_of_part(space: str, types: tuple[str, ...]) -> None:
    trees = [random_open(*drawn)[0] for drawn in EVERY_TREE if drawn[1] == space]
    loops = [random_closed(*drawn)[0] for drawn in EVERY_LOOP if drawn[1] == space]
    links, sections, drives, joints = kinds_of(trees)
    assert links == {"beam", "rigid", "frame"}
    assert len(sections - {"None"}) == 8  # seven and a taper
    assert drives == {"strf", "strl", "dict{"}
    assert joints == {*types, *(f"{kind} backwards" for kind in types)}
    links, _, drives, joints = kinds_of(loops)
    assert links == {"beam", "rigid", "frame"}
    assert drives == {"strf", "strl", "dict{"}
    assert {kind.removesuffix(" backwards") for kind in joints} >= {*types} - {"nut"}


@pytest.mark.parametrize(("seed", "space"), [(0, "planar"), (2, "planar"), (5, "spatial")])
def test_random_double_loops_have_the_spectrum_of_the_plain_frame(seed: int, space: str) -> None:
    tree, *poses = random_closed(seed, space, loops=2)
    agree(tree, tuple(poses))


@SPACES
@pytest.mark.parametrize("seed", range(4))
def test_every_sample_of_a_batch_is_its_own_pose(seed: int, space: str) -> None:
    tree, q0, near = random_closed(seed, space)
    model = built(tree)
    count = min(3, model.n_elastic)
    batch = np.array([near, q0, 0.5 * (q0 + near)])
    together = eigenvalues(model.pencil, model.x(batch), count)
    alone = [model.lam(q, count) for q in batch]
    np.testing.assert_allclose(together, alone, rtol=1e-9)


@SPACES
@pytest.mark.parametrize("seed", range(12))
def test_free_coordinates_are_all_the_motions_without_stiffness(seed: int, space: str) -> None:
    tree, q = random_open(seed, space)
    if any(link.get("type") == "rigid" for link in tree["mechanism"]["links"].values()):
        tree["mechanism"]["bodies"] = {}
    frame = world(tree, q)
    assert frame.rigid() == frame.n_free == len(built(tree).pencil.rigid)


def test_a_designed_stiffness_is_the_number_it_stands_for() -> None:
    tree = gantry("locked")
    tree["mechanism"]["springs"] = {
        "stop": {"between": ["girder.end", "ground"], "translational": 1e5, "rotational": 2e3}
    }
    tree["design"] = {
        "k": {"parameter": "springs.stop.translational", "min": 0.0, "max": 1e9},
        "r": {"parameter": "springs.stop.rotational", "min": 0.0, "max": 1e9},
    }
    model = built(tree)
    lam = eigenvalues(model.pencil, np.array([[0.5, 7e6, 4e4]]), 5)[0]
    other = changed(
        changed(tree, "springs.stop.translational", 7e6), "springs.stop.rotational", 4e4
    )
    np.testing.assert_allclose(lam, world(other, [0.5]).spectrum(5), rtol=1e-8)


# Figures (Hz) of another program in global coordinates, checked against OpenSees 3.7.1

Q0, MASSES = [1.817, 5.312], (0.125, 0.125)


def two_link(drive: str, masses: tuple[float, float] = (0.0, 0.0), inertia: float = 0.0) -> Tree:
    return chains.two_link(drives=(drive, drive), masses=masses, tip_inertia=inertia, design={})


def loaded(drive: str) -> Tree:
    return two_link(drive, MASSES)


def stretched(drive: str) -> Tree:
    return two_link(drive, (0.0, 0.25), 1e-3)


REFERENCE = [
    (two_link, "free", Q0, [202.219554, 513.156239, 736.419559, 1322.403962]),
    (loaded, "free", Q0, [193.113002, 427.149912, 708.216892, 1186.668413]),
    (stretched, "free", [0.4, 0.4], [200.471324, 397.17344, 738.915064, 1020.726241]),
    (loaded, "locked", Q0, [36.102253, 56.159893, 347.487029, 515.012919]),
    (four_bar, "locked", [np.pi / 6], [43.458198, 56.698049, 104.946391, 211.618302]),
    (four_bar, "free", [2 * np.pi / 3], [45.444569, 61.60197, 182.088799, 234.94075]),
    (slider_crank, "locked", [np.pi / 3], [69.969253, 117.856079, 472.847569, 1062.924619]),
    (arm3r, "locked", [0.3, 0.5, -0.9], [13.042665, 14.450046, 58.723631, 82.248006]),
    (arm3r, "free", [0.3, 0.5, -0.9], [81.590203, 137.473761, 301.577356, 434.514977]),
    (gantry, "locked", [0.5], [41.041292, 71.718492, 200.065698, 324.872396]),
]


@pytest.mark.parametrize(("make", "drive", "q", "hertz"), REFERENCE)
def test_the_pencil_and_the_plain_frame_have_the_figures_of_another_program(
    make: Any, drive: str, q: list[float], hertz: list[float]
) -> None:
    tree = make(drive)
    for lam in (built(tree).lam(q, 4), world(tree, q).spectrum(4)):
        # 5e-7 Hz of printed digits on 13 Hz is 4e-8
        np.testing.assert_allclose(np.sqrt(lam) / (2 * np.pi), hertz, rtol=5e-8)
