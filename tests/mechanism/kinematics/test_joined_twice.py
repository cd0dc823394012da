"""A joint that holds what another one holds already changes nothing."""

import numpy as np
from spatial_cases import built
from spatial_examples import four_bar


def test_a_second_joint_on_the_same_pin_changes_nothing() -> None:
    tree = four_bar("free")
    pin = {"type": "revolute", "base": "crank.end", "follower": "coupler.start"}
    tree["mechanism"]["joints"]["again"] = pin
    q = [0.6]
    expected = built(four_bar("free")).lam(q, 3)
    np.testing.assert_allclose(built(tree).lam(q, 3), expected, rtol=1e-8)
