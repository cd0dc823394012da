"""Hollow rectangles against the Poisson problems of torsion and shear, and in beams."""

from types import SimpleNamespace as Shape

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import splu
from spatial_cases import built, linkage
from spatial_oracle import Tree, world

from eigassign.mechanism import section_values
from eigassign.modal import eigenvalues

CORNER = 4 / 3  # order of the energy's error beside a corner of 270°


def values(width: float, height: float, thickness: float) -> tuple[float, ...]:
    section = Shape(shape="box", width=width, height=height, thickness=thickness)
    return section_values(section, lambda _, value: value)


def lines(side: float, t: float, n: int) -> np.ndarray:
    """Grid lines over half a side, n in the wall."""
    inner = side / 2 - t
    count = max(2, round(min(inner / t, 20) * n))
    return np.r_[np.linspace(0, inner, count + 1), np.linspace(inner, side / 2, n + 1)[1:]]


def solved(b: float, h: float, t: float, n: int) -> tuple[float, float]:
    """J and κ of bilinear elements on a quarter of the box, n across the wall.

    Torsion: ∇²Φ = −2, Φ = 0 outside and constant at the hole, J = 2 ∫ Φ + 2 Φ_hole A_hole. Shear
    along y for ν = 0: ∇²χ = −y, no flow through the surface, κ = I²/(A ∫ |∇χ|²).
    """
    X, Y = lines(b, t, n), lines(h, t, n)
    idx = np.arange(len(X) * len(Y)).reshape(len(X), len(Y))
    middle_x, middle_y = (X[1:] + X[:-1]) / 2, (Y[1:] + Y[:-1]) / 2
    i, j = np.nonzero((middle_x[:, None] > b / 2 - t) | (middle_y > h / 2 - t))
    quads = np.stack([idx[i, j], idx[i + 1, j], idx[i + 1, j + 1], idx[i, j + 1]], axis=1)
    dx, dy = np.diff(X)[i, None, None], np.diff(Y)[j, None, None]
    of_x = np.array([[2, -2, -1, 1], [-2, 2, 1, -1], [-1, 1, 2, -2], [1, -1, -2, 2]]) / 6
    of_y = np.array([[2, 1, -1, -2], [1, 2, -2, -1], [-1, -2, 2, 1], [-2, -1, 1, 2]]) / 6
    mass = np.array([[4, 2, 1, 2], [2, 4, 2, 1], [1, 2, 4, 2], [2, 1, 2, 4]]) / 36

    def assembled(blocks: np.ndarray) -> sparse.csr_array:
        rows, columns = np.repeat(quads, 4, axis=1), np.tile(quads, (1, 4))
        entries = (blocks.ravel(), (rows.ravel(), columns.ravel()))
        return sparse.csr_array(sparse.coo_array(entries, shape=(idx.size, idx.size)))

    K, M = assembled(of_x * dy / dx + of_y * dx / dy), assembled(mass * dx * dy)
    # one unknown for all nodes at the hole, none outside
    one, y = np.zeros(idx.size), np.tile(Y, len(X))
    one[quads] = 1.0
    a, c = np.searchsorted(X, b / 2 - t - 1e-12), np.searchsorted(Y, h / 2 - t - 1e-12)
    column = np.full(idx.size, -1)
    hole = np.zeros(idx.shape, bool)
    hole[: a + 1, c] = hole[a, : c + 1] = True
    inside = one.astype(bool) & ~hole.ravel()
    inside[np.r_[idx[-1, :], idx[:, -1]]] = False
    column[inside] = np.arange(inside.sum()) + 1
    column[hole.ravel()] = 0
    kept = np.flatnonzero(column >= 0)
    T = sparse.csr_array((np.ones(len(kept)), (kept, column[kept])))
    T.resize(idx.size, inside.sum() + 1)
    load = T.T @ (M @ one * 2)
    load[0] += 2 * (b / 2 - t) * (h / 2 - t)
    J = 4 * load @ splu(sparse.csc_array(T.T @ K @ T)).solve(load)
    free = np.setdiff1d(np.flatnonzero(one), idx[:, 0])  # χ is odd in y
    source = (M @ (y * one))[free]
    U = 4 * source @ splu(sparse.csc_array(K[free][:, free])).solve(source)
    A, I_z = (b * h - 4 * X[a] * Y[c], (b * h**3 - 16 * X[a] * Y[c] ** 3) / 12)
    return J, I_z**2 / (A * U)


@pytest.mark.parametrize(
    ("share", "of_J", "of_kappa"),  # t of the smaller side; what the docstrings state
    [(0.01, 1e-4, 5e-3), (0.1, 1e-4, 5e-3), (0.2, 4e-4, 1e-2), (0.3, 1.2e-3, 3e-2),
     (0.4, 7e-3, 4e-2)],
)  # fmt: skip
@pytest.mark.parametrize("ratio", [0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 1.0, 1.3, 2.0, 5.0])
def test_torsion_and_shear_are_those_of_the_poisson_problems(
    ratio: float, share: float, of_J: float, of_kappa: float
) -> None:
    h, b = 1.0, ratio
    t = share * min(b, h)
    coarse, fine = (np.array(solved(b, h, t, n)) for n in (6, 12))
    J, kappa = fine + (fine - coarse) / (2**CORNER - 1)
    found = values(b, h, t)
    assert found.torsion_constant == pytest.approx(J, rel=of_J)
    assert found.shear_coefficient == pytest.approx(kappa, rel=of_kappa)
    turned = values(h, b, t)
    assert turned.shear_coefficient_y == pytest.approx(found.shear_coefficient)
    assert turned.torsion_constant == pytest.approx(found.torsion_constant)
    assert turned[1:3] == pytest.approx(found[2:0:-1])


def test_thin_walls_have_bredts_torsion_and_cowpers_shear() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        b, h = 10.0 ** rng.uniform(-2, 0, 2)
        t = 1e-4 * min(b, h)
        found, m = values(b, h, t), b / h
        bredt = 2 * t * (b * h) ** 2 / (b + h)
        cowper = (1 + 3 * m) ** 2 / ((1 + m) * (1.2 + 6 * m + 9 * m**2 + 3 * m**3))
        assert found.torsion_constant == pytest.approx(bredt, rel=1e-3)
        assert found.shear_coefficient == pytest.approx(cowper, rel=1e-3)
        assert found.area == pytest.approx(2 * t * (b + h), rel=1e-3)
        assert found.inertia_z == pytest.approx(t * h**2 * (h / 6 + b / 2), rel=1e-3)


def arm(space: str, section: Tree, shear: bool) -> Tree:
    thin = {**section, "width": 0.03, "height": 0.05, "thickness": 0.0025}
    beam = {"length": 0.5, "elements": 3, "material": "m", "shear": shear}
    return linkage(
        {
            "a": {**beam, "section": "s"},
            "b": {**beam, "section": {"start": "s", "end": "e"}},
        },
        {
            "r": {"type": "revolute", "base": "ground", "follower": "a.start"},
            "f": {"type": "fixed", "base": "a.end", "follower": "b.start"},
        },
        {"q": {"joint": "r", "drive": {"stiffness": 1e5}}},
        sections={"s": section, "e": thin},
        space=space,
    ) | {
        "design": {
            "t": {"parameter": "sections.s.thickness", "min": 0.001, "max": 0.01},
            "h": {"parameter": "sections.s.height", "min": 0.03, "max": 0.1},
        }
    }


@pytest.mark.parametrize("shear", [False, True])
@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_box_beams_are_those_of_an_independent_model_at_other_designs_too(
    space: str, shear: bool
) -> None:
    box = {"shape": "box", "width": 0.04, "height": 0.06, "thickness": 0.003}
    designed = built(arm(space, box, shear))
    for t, h in ((0.003, 0.06), (0.005, 0.045), (0.0015, 0.08)):
        tree = arm(space, {**box, "thickness": t, "height": h}, shear)
        lam = eigenvalues(designed.pencil, np.array([[0.2, t, h]]), 6)[0]
        np.testing.assert_allclose(lam, built(tree).lam([0.2], 6), rtol=1e-11)
        np.testing.assert_allclose(lam, world(tree, np.array([0.2])).spectrum(6), rtol=1e-7)
