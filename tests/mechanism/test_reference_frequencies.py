"""From YAML text to frequencies, against an independent program (global coordinates, joints as
linear constraints, checked against OpenSees 3.7.1) on the same meshes, to the digits it printed."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from reference_mechanisms import ARM_3R, FOUR_BAR, GANTRY, SLIDER_CRANK, two_link

from eigassign import load_case


class Reference(NamedTuple):
    text: str
    q: tuple[float, ...]
    rigid_modes: int
    frequencies_hz: tuple[float, ...]


Q0 = (1.817, 5.312)
MASSES = (0.125, 0.125)
REFERENCES = {
    "two_link_q0": Reference(
        two_link("free"), Q0, 2, (202.219554, 513.156239, 736.419559, 1322.403962)
    ),
    "two_link_q0_masses": Reference(
        two_link("free", MASSES), Q0, 2, (193.113002, 427.149912, 708.216892, 1186.668413)
    ),
    "two_link_stretched": Reference(
        two_link("free", (0.0, 0.25), 1e-3),
        (0.4, 0.4),
        2,
        (200.471324, 397.17344, 738.915064, 1020.726241),
    ),
    "two_link_locked": Reference(
        two_link("locked", MASSES), Q0, 0, (36.102253, 56.159893, 347.487029, 515.012919)
    ),
    "four_bar_30_locked": Reference(
        FOUR_BAR.replace("DRIVE", "locked"),
        (math.radians(30),),
        0,
        (43.458198, 56.698049, 104.946391, 211.618302),
    ),
    "four_bar_120_free": Reference(
        FOUR_BAR.replace("DRIVE", "free"),
        (math.radians(120),),
        1,
        (45.444569, 61.60197, 182.088799, 234.94075),
    ),
    "slider_crank_60_locked": Reference(
        SLIDER_CRANK.replace("DRIVE", "locked"),
        (math.radians(60),),
        0,
        (69.969253, 117.856079, 472.847569, 1062.924619),
    ),
    "arm3r_locked": Reference(
        ARM_3R.replace("DRIVE", "locked"),
        (0.3, 0.5, -0.9),
        0,
        (13.042665, 14.450046, 58.723631, 82.248006),
    ),
    "arm3r_free": Reference(
        ARM_3R.replace("DRIVE", "free"),
        (0.3, 0.5, -0.9),
        3,
        (81.590203, 137.473761, 301.577356, 434.514977),
    ),
    "gantry_050": Reference(
        GANTRY.replace("DRIVE", "locked"),
        (0.5,),
        0,
        (41.041292, 71.718492, 200.065698, 324.872396),
    ),
}


@pytest.mark.parametrize("reference", REFERENCES.values(), ids=REFERENCES)
def test_a_mechanism_vibrates_as_the_independent_program_says(
    reference: Reference, tmp_path: Path
) -> None:
    file = tmp_path / "case.yaml"
    file.write_text(reference.text)
    model = load_case(file).model()
    assert len(model.pencil.rigid) == reference.rigid_modes
    found = model.frequencies(reference.q, (), count=4)[0]
    # 5e-7 Hz of printed digits on 13 Hz is 4e-8
    np.testing.assert_allclose(found, reference.frequencies_hz, rtol=5e-8)
