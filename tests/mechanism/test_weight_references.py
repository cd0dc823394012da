"""Four mechanisms under weight against numbers of another program, which has no code of ours."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import yaml

import eigassign as ea
from eigassign.modal import weight_changes

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


SLOPES = {  # of λ per m/s² downwards without gravity, by stress alone and by stress and sag
    "double_arm": (
        [0.354945467, -0.0832215893, 21.0961471, -33.4450296, -6.6676459],
        [0.4254092, -2.27787999, 388.603423, 655.601318, -5007.7266],
    ),
    "four_bar": (
        [-6.4809543, -6.16283009, -246.494656, -49.6402854, -133.763949],
        [-20.4607819, 10.3669218, -263.706157, 106.545454, 805.720422],
    ),
    "pendulum": (
        [16.9319193, 43.1937786, 90.8762367, 195.646191],
        [49.8861067, -349.713938, 764.925465, -1757.52567],
    ),
    "l_beam": (
        [0.0661645379, 0.0966081141, -0.345484722, 3.47218204, 0.512333463],
        [0.105002806, -0.181515416, -7.44611385, 4.58166957, -44.9720155],
    ),
}


@pytest.mark.parametrize("name", SLOPES)
def test_slopes_by_stress_and_sag_are_those_of_another_program(name: str) -> None:
    """Between nodes loads are linear: in space that errs, by less than the mesh does."""
    text = (FOLDER / f"{name}.yaml").read_text(encoding="utf-8")
    case = ea.load_case(yaml.safe_load(re.sub("gravity:.*", "gravity: none", text)))
    q, (stress, both) = STRESSED[name][0], np.array(SLOPES[name])
    model, modes = case.model(), tuple(range(1, len(stress) + 1))
    lam = (2 * np.pi * model.frequencies(q, case.initial_design, len(modes))[0]) ** 2
    found = weight_changes(model, q, case.initial_design, modes)
    axis = -1 if case.file.mechanism.space == "spatial" else 1
    np.testing.assert_allclose(-lam * found.stress[0, :, axis], stress, rtol=1e-6)
    sag, tolerance = -lam * found.sag[0, :, axis], 2e-2 if name == "l_beam" else 1e-6
    np.testing.assert_allclose(sag, both - stress, rtol=tolerance)
