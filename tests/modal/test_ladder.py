"""The ladder over every shipped case: residual, slope, differences, 2m + 1, subsets, estimate.

Cases are found, not listed. x is measured in a box around a sample of the case's own trajectory:
half the design box, and a sixth of what each coordinate travels.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rungs import derivative, residual, slope, treat_as_large
from spatial_cases import changed
from spatial_oracle import world

from eigassign import Case, expand, load_case, reduce
from eigassign.case import plain
from eigassign.mechanism import Pencil
from eigassign.modal import Expansion, Model, eigenvalues, rounding_error

SHIPPED = sorted((Path(__file__).parents[2] / "cases").glob("*.yaml"))
every_case = pytest.mark.parametrize("path", SHIPPED, ids=lambda p: p.stem)


@dataclass(frozen=True)
class Scene:
    """A case, its expansion point x0 = (q0, y0), half-widths of a box, and round-off of λ there."""

    case: Case
    model: Model
    x0: np.ndarray
    span: np.ndarray
    floor: float

    @property
    def pencil(self) -> Pencil:
        return self.model.pencil

    def expand(self, order: int, **more: Any) -> Expansion:
        q0, y0 = np.split(self.x0, [self.pencil.n_q])
        return expand(self.model, q0, y0, (1,), order, **more)

    def lam(self, w: np.ndarray) -> np.ndarray:
        """Exact λ_1 (1,) at x0 + span w."""
        return eigenvalues(self.pencil, (self.x0 + self.span * w)[None], 1)[0]

    def scaled(self, e: Expansion) -> dict[tuple[int, ...], float]:
        """Coefficients over w instead of x, relative to λ at x0."""
        values = e.coefficients[0] * np.prod(self.span**e.indices, axis=1)
        return dict(zip(map(tuple, e.indices.tolist()), values / values[0], strict=True))


@cache
def scene(path: Path) -> Scene:
    case = load_case(path)
    model, q = case.model(), case.trajectory.q
    box = [(p.min, p.max) for p in case.file.design.parameters.values()]
    low, high = np.array(box, dtype=float).reshape(-1, 2).T
    travelled = np.ptp(q, axis=0)
    q_span = np.where(travelled > 0.0, travelled, 0.5) / 6.0
    x0 = np.concatenate([q[len(q) // 3], 0.5 * (low + high)])
    floor = 2.0 * rounding_error(model.pencil, x0, 1)
    return Scene(case, model, x0, np.concatenate([q_span, 0.25 * (high - low)]), floor)


def few(s: Scene) -> bool:
    """Whether the variables are so few that third order is cheap."""
    return len(s.x0) <= 4


@every_case
def test_the_recursion_leaves_no_residual_at_any_multi_index(path: Path) -> None:
    s = scene(path)
    left = residual(s.pencil, s.x0, s.span, 3 if few(s) else 2, (1, 2))
    assert left.max() < 1e-12


@every_case
@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_the_truncation_error_falls_with_one_power_more_than_the_order(
    path: Path, order: int
) -> None:
    s = scene(path)
    e = s.expand(order)
    assert e.clusters[0].modes == (1,)
    found = slope(s.pencil, e, s.span, s.floor)
    if found is not None:  # else a polynomial of this order, over the whole box
        assert found == pytest.approx(order + 1, abs=0.1)


@every_case
def test_first_and_second_derivatives_are_those_of_exact_eigenvalues(path: Path) -> None:
    s = scene(path)
    found = s.scaled(s.expand(2))
    centre = s.lam(np.zeros(len(s.x0)))
    rng = np.random.default_rng(2)
    for gamma in (g for g in found if sum(g) < 2 or few(s) or rng.random() < 0.25):
        along = np.eye(len(s.x0))[np.repeat(np.arange(len(s.x0)), gamma)]
        expected = derivative(lambda w: s.lam(0.5 * w), along, centre) / centre
        np.testing.assert_allclose(
            found[gamma] * 0.5 ** sum(gamma),
            expected[0],
            atol=1e-7 + 100.0 * s.floor,
            err_msg=str(gamma),
        )


@every_case
def test_half_the_order_of_the_vectors_gives_the_whole_order_of_the_eigenvalue(
    path: Path,
) -> None:
    s = scene(path)
    order = 5 if few(s) else 3
    half, full = s.scaled(s.expand(order)), s.scaled(s.expand(order, vector_order=order))
    close(half, full, s.floor)


@every_case
def test_the_partially_linear_expansion_has_the_full_ones_coefficients(path: Path) -> None:
    s = scene(path)
    order, n_q = 4 if few(s) else 3, s.pencil.n_q
    full, part = s.scaled(s.expand(order)), s.scaled(s.expand(order, linear_in_y=True))
    assert set(part) == {g for g in full if sum(g[n_q:]) <= 1}
    close(part, {g: full[g] for g in part}, s.floor)


def close(a: dict[tuple[int, ...], float], b: dict[tuple[int, ...], float], floor: float) -> None:
    assert set(a) == set(b)
    for gamma, value in a.items():
        assert value == pytest.approx(b[gamma], rel=1e-6, abs=1e-9 + 10.0 * floor), gamma


@every_case
def test_sparse_algebra_gives_what_dense_algebra_gives(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    s = scene(path)
    dense, lam = s.scaled(s.expand(2)), eigenvalues(s.pencil, s.x0[None], 2)
    treat_as_large(monkeypatch)
    close(s.scaled(s.expand(2)), dense, s.floor)
    np.testing.assert_allclose(eigenvalues(s.pencil, s.x0[None], 2), lam, rtol=10.0 * s.floor)


@every_case
def test_the_estimates_cover_the_error_along_the_trajectory_and_over_the_design_box(
    path: Path,
) -> None:
    s = scene(path)
    rng = np.random.default_rng(1)
    q = s.case.trajectory.q
    low, high = (s.x0 + 2.0 * sign * s.span for sign in (-1.0, 1.0))
    points = q[[len(q) // 6, len(q) // 2, 5 * len(q) // 6]]
    y0 = s.x0[s.pencil.n_q :]
    q = q[np.linspace(0, len(q) - 1, 25).astype(int)]
    y = rng.uniform(low, high, (len(q), len(low)))[:, s.pencil.n_q :]
    exact = s.model.frequencies(q, y, 1)
    reduced = reduce(s.model, points, np.tile(y0, (3, 1)), (1,), 2)
    for approximation in (reduced, s.expand(3)):
        error = np.abs(approximation.frequencies(q, y) / exact - 1.0)
        estimate = approximation.error_estimate(q, y)
        assert (estimate >= np.nan_to_num(error, nan=np.inf)).all()
    estimate = reduced.error_estimate(q, y)
    answered = np.isfinite(estimate)
    # Of modes that coincide (a shaft's in two planes) LAPACK picks any pair of shapes as guards: at
    # the margin it is their choice, and the machine's, whether a corner of the box is refused.
    assert answered.mean() >= 0.9
    assert estimate[answered].max() < 1e-3


@every_case
def test_the_frequencies_are_those_of_the_plainly_assembled_mechanism(path: Path) -> None:
    """Global coordinates, joints as linear constraints, rigid modes left in: nothing in common."""
    s = scene(path)
    file, q = s.case.file, s.x0[: s.pencil.n_q]
    tree = plain({"mechanism": file.mechanism, "coordinates": file.coordinates})
    assert isinstance(tree, dict)
    if any(link["type"] == "superelement" for link in tree["mechanism"]["links"].values()):
        pytest.skip("matrices from elsewhere: compared with its beams in test_shipped_cases")
    n = len(file.coordinates)
    for load, value in zip(file.loads, q[n:].tolist(), strict=True):
        tree = changed(tree, load, value)
    frame = world(tree, q[:n])
    frame.n_free = len(s.pencil.rigid)  # springs hold free coordinates too
    x = np.concatenate([q, s.case.initial_design])[None]
    # The oracle's null space costs it another two digits.
    np.testing.assert_allclose(
        eigenvalues(s.pencil, x, 4)[0], frame.spectrum(4), rtol=1e-9 + 100.0 * s.floor
    )
