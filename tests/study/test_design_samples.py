"""Where an automatic order is judged: poses and designs all over the box, and the worst of it."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import SHIPPED, scene_of

from eigassign.study import Scene, at_corners, at_random, corners, with_worse_designs


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return scene_of(tmp_path_factory.mktemp("arm"), SHIPPED)


@pytest.mark.parametrize("n", range(1, 16))
def test_no_corner_is_looked_at_twice(n: int) -> None:
    rows = {row.tobytes() for row in corners(n)}
    assert len(rows) >= min(2**n, 16)


def test_random_poses_are_samples_and_designs_in_the_box_half_of_them_corners(
    scene: Scene,
) -> None:
    (low, high), full = scene.bounds, scene.expansions.full
    seen = at_random(scene.file, scene.trajectory, full.q0, full.y0, 200)
    assert scene.trajectory is not None
    np.testing.assert_array_equal(seen.x[:, :2], scene.trajectory.q[seen.samples.astype(int)])
    y = seen.x[:, 2:]
    assert ((y >= low) & (y <= high)).all()
    at_a_corner = ((y == low) | (y == high)).all(axis=1)
    assert at_a_corner.sum() == 100
    again = at_random(scene.file, scene.trajectory, full.q0, full.y0, 200)
    np.testing.assert_array_equal(again.x, seen.x)
    assert seen.place(3) == scene.trajectory.sample(int(seen.samples[3]))


def test_the_worst_corner_is_climbed_to_from_a_bad_one(scene: Scene) -> None:
    """An error that is largest where the first mass is least and the second largest."""
    (low, high), full = scene.bounds, scene.expansions.full
    seen = at_corners(scene.file, scene.trajectory, full.q0, full.y0, [[False, False]], 5)

    def error(x: np.ndarray) -> np.ndarray:
        return 1.0 + x[:, 3] - x[:, 2]

    more, errors = with_worse_designs(seen, error, scene.file)
    assert len(more.x) == len(errors) == len(more.samples) > len(seen.x)
    np.testing.assert_array_equal(errors[: len(seen.x)], error(seen.x))
    np.testing.assert_allclose(errors.max(), 1.0 + high[1] - low[0])
    np.testing.assert_array_equal(more.x[errors.argmax(), 2:], [low[0], high[1]])


@pytest.mark.parametrize("n", [0, 1, 2, 4, 5, 9, 15])
def test_corners_show_every_two_parameters_in_all_four_combinations(n: int) -> None:
    at = corners(n)
    assert at.shape == (2**n if n <= 4 else 17, n)
    for i in range(n):
        for j in range(i):
            assert len(np.unique(at[:, [i, j]], axis=0)) == 4
    assert at.all(axis=1).any()
    assert (~at).all(axis=1).any()
