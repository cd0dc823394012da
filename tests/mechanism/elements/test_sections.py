"""Areas and inertias of sections against integrals over the cross-section."""

from __future__ import annotations

from types import SimpleNamespace as Shape

import numpy as np
import pytest
from spatial_cases import ALLOY, built
from spatial_oracle import Tree

from eigassign.mechanism import section_values
from eigassign.modal import eigenvalues


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


@pytest.mark.parametrize(
    ("width", "height", "factor"),  # of Timoshenko, Goodier, Theory of Elasticity, table in § 109
    [(1.0, 1.0, 0.1406), (1.0, 2.0, 0.229), (3.0, 1.0, 0.263), (1.0, 10.0, 0.312)],
)
def test_the_torsion_constant_of_a_rectangle_is_saint_venant_s(
    width: float, height: float, factor: float
) -> None:
    section = Shape(shape="rectangle", width=width, height=height)
    J = section_values(section, as_written).torsion_constant
    assert pytest.approx(factor * max(width, height) * min(width, height) ** 3, rel=2e-3) == J


def test_a_design_may_swap_the_sides_of_a_rectangle() -> None:
    def arm(height: float) -> Tree:
        return {
            "mechanism": {
                "space": "spatial",
                "materials": {"m": ALLOY},
                "sections": {"s": {"shape": "rectangle", "width": 0.02, "height": height}},
                "links": {"b": {"length": 1.0, "elements": 1, "material": "m", "section": "s"}},
                "joints": {"r": {"type": "revolute", "base": "ground", "follower": "b.start"}},
            },
            "coordinates": {"q": {"joint": "r", "drive": {"stiffness": 1e5}}},
            "design": {"h": {"parameter": "sections.s.height", "min": 0.005, "max": 0.08}},
        }

    designed = built(arm(0.03))
    for height, rel in ((0.08, 1e-12), (0.02, 1e-12), (0.01, 1e-12), (0.005, 1e-10)):
        found = eigenvalues(designed.pencil, np.array([[0.1, height]]), 6)[0]
        np.testing.assert_allclose(found, built(arm(height)).lam([0.1], 6), rtol=rel)
