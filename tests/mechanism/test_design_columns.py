"""A choice that is made by y is the mechanism that has it written in its file."""

import numpy as np
import pytest
from small_case import edited

from eigassign.case import CaseFile, parse
from eigassign.study import BuiltCase

D = "  d: {parameter: sections.rod.diameter, min: 20 mm, max: 40 mm}\n"
ENTRIES = """\
  boom:
    choices:
      light: {sections.bar.area: 4 cm2, sections.bar.bending_inertia: 2 cm4}
      heavy: {sections.bar.area: 6 cm2, sections.bar.bending_inertia: 5 cm4}
  d: {parameter: sections.rod.diameter, values: [25 mm, 35 mm]}
"""


def read(text: str) -> CaseFile:
    return parse(text.encode(), "case.yaml")


@pytest.mark.parametrize(("choice", "area", "inertia"), [(0, "4e-4", "2e-8"), (1, "6e-4", "5e-8")])
def test_the_columns_of_choices_are_ordinary_parameters(
    choice: int, area: str, inertia: str
) -> None:
    file = read(edited(D, ENTRIES))
    boom, d = file.design.catalogues
    y = np.array([0.1, 0.0, 0.0, 0.0])
    y[list(boom.columns)], y[list(d.columns)] = boom.rows[choice], d.rows[1]
    text = edited(
        "area: 7.0632e-4, bending_inertia: 3.97e-8", f"area: {area}, bending_inertia: {inertia}"
    )
    written = BuiltCase(read(text.replace("diameter: 30 mm", "diameter: 35 mm")))
    q = np.array([[0.3, 1.1], [0.4, 2.0]])
    chosen = BuiltCase(file).model().frequencies(q, y, 3)
    expected = written.model().frequencies(q, written.initial_design, 3)
    np.testing.assert_allclose(chosen, expected, rtol=1e-9)  # round-off of the eigensolver
