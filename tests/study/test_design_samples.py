"""Where an automatic order is judged: designs at corners of the bounds."""

import numpy as np
import pytest

from eigassign.study import corners


@pytest.mark.parametrize("n", range(1, 16))
def test_no_corner_is_looked_at_twice(n: int) -> None:
    rows = {row.tobytes() for row in corners(n)}
    assert len(rows) >= min(2**n, 16)


@pytest.mark.parametrize("n", [0, 1, 2, 4, 5, 9, 15])
def test_corners_show_every_two_parameters_in_all_four_combinations(n: int) -> None:
    at = corners(n)
    assert at.shape == (2**n if n <= 4 else 17, n)
    for i in range(n):
        for j in range(i):
            assert len(np.unique(at[:, [i, j]], axis=0)) == 4
    assert at.all(axis=1).any()
    assert (~at).all(axis=1).any()
