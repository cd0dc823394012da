"""Four mechanisms under weight against numbers of another program, which has no code of ours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import eigassign as ea

FOLDER = Path(__file__).parent / "weight_references"
STRESSED = {  # pose, and the lowest frequencies in Hz with the internal forces of the weight
    "double_arm": (
        [0.4, -1.1],
        [1.2619000253464134, 3.9456612087395126, 48.23762263403272, 78.1594258346546,
         202.38241841721154],
    ),
    "four_bar": (
        [0.9],
        [10.34648166483722, 26.888482136982947, 45.845752605718474, 48.07192832069266,
         144.67127499488532],
    ),
    "l_beam": (
        [0.3],
        [2.215944876961315, 6.2447522805677815, 9.900417219141325, 19.914673076754354,
         39.85264158106639],
    ),
    "pendulum": (
        [-1.1],
        [0.38332275185728615, 9.837283958035798, 32.14082793442983, 65.37405460740419,
         120.70802129690145],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", STRESSED)
def test_frequencies_under_weight_are_those_of_another_program(name: str) -> None:
    case = ea.load_case(FOLDER / f"{name}.yaml")
    q, expected = STRESSED[name]
    found = case.model().frequencies(q, case.initial_design, 5)[0]
    np.testing.assert_allclose(found, expected, rtol=1e-5)
