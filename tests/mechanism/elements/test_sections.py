"""Areas and inertias of sections against integrals over the cross-section."""

from __future__ import annotations

from types import SimpleNamespace as Shape

import numpy as np
import pytest
from spatial_cases import ALLOY, built
from spatial_oracle import Tree

from eigassign.errors import MechanismError
from eigassign.mechanism.elements.sections import section_values


def as_written(key: str, value: float) -> float:
    return value


def ring(inner: float, outer: float) -> tuple[float, float]:
    """∫dA and ∫y²dA in polar coordinates, radii: ∫2πr dr and ∫πr³ dr."""
    return np.pi * (outer**2 - inner**2), np.pi / 4 * (outer**4 - inner**4)


CASES = [
    (Shape(shape="circle", diameter=0.03), ring(0.0, 0.015)),
    (Shape(shape="tube", outer_diameter=0.04, inner_diameter=0.034, thickness=None),
     ring(0.017, 0.02)),
    (Shape(shape="tube", outer_diameter=0.04, inner_diameter=None, thickness=0.003),
     ring(0.017, 0.02)),
    (Shape(shape="tube", outer_diameter=0.04, inner_diameter=None, thickness=0.02),
     ring(0.0, 0.02)),
    (Shape(shape="rectangle", width=0.02, height=0.004), (8e-5, 0.02 * 0.004**3 / 12)),
    (Shape(shape="bare", area=1.5e-4, bending_inertia=2e-9), (1.5e-4, 2e-9)),
]  # fmt: skip


@pytest.mark.parametrize(("section", "expected"), CASES)
def test_area_and_inertia_are_the_integrals(section: Shape, expected: tuple[float, float]) -> None:
    np.testing.assert_allclose(section_values(section, as_written)[:2], expected, rtol=1e-12)


def test_the_papers_rod_of_30_mm_weighs_what_the_paper_says() -> None:
    # Belotti et al. 2021, Table 1: 1.9 kg/m of aluminium, I = 3.97e-8 m⁴ (printed e-4: a misprint)
    area, inertia = section_values(Shape(shape="circle", diameter=0.03), as_written)[:2]
    np.testing.assert_allclose(inertia, 3.97e-8, rtol=2e-3)
    np.testing.assert_allclose(area * 2690.0, 1.9, rtol=2e-3)


def test_a_design_that_swaps_the_sides_of_a_rectangle_is_refused() -> None:
    def arm(low: float, high: float) -> Tree:
        return {
            "mechanism": {
                "space": "spatial",
                "materials": {"m": ALLOY},
                "sections": {"s": {"shape": "rectangle", "width": 0.02, "height": 0.03}},
                "links": {"b": {"length": 1.0, "elements": 1, "material": "m", "section": "s"}},
                "joints": {"r": {"type": "revolute", "base": "ground", "follower": "b.start"}},
            },
            "coordinates": {"q": {"joint": "r"}},
            "design": {"h": {"parameter": "sections.s.height", "min": low, "max": high}},
        }

    assert built(arm(0.021, 0.05)).pencil.n_dof
    with pytest.raises(MechanismError, match="change places"):
        assert built(arm(0.015, 0.05)).pencil.n_dof
