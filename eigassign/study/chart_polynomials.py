"""Polynomials of the box, made from an expansion or a reduced model: what many evaluations want.

They cost no exact solve beyond their source's, and as many terms as their tolerance needs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from eigassign.modal.expansion import expand
from eigassign.study.chart_methods import (
    Evaluator,
    Method,
    points_along,
    reciprocal,
    reduced_model,
    solves_per_point,
)
from eigassign.study.chart_question import Features, Points
from eigassign.study.scene import Scene
from eigassign.study.surrogates import adaptive, thinned_through

Floats = NDArray[np.float64]


def distilled_methods(
    scene: Scene,
    features: Features,
    tolerances: Sequence[float],
    sources: Sequence[tuple[int, int, bool]],
    most: int,
) -> Iterator[Method]:
    """A Chebyshev polynomial through a reduced model: cheap to train, cheap to evaluate.

    ``sources`` are (m, expansion points, guard) of the reduced models; the polynomial's degree on
    every axis is what the tolerance needs there, and the grid has at most ``most`` points.
    """
    for m, count, guard in sources:
        q, y = points_along(scene, count)
        name = f"reduced m = {m}, {len(q)} point{'s' if len(q) > 1 else ''}"
        for tolerance in tolerances:
            yield Method(
                f"{name} → polynomial {tolerance:.0e}",
                f"{name} → polynomial",
                True,
                {"half_order": m, "guard": guard, "q": q, "y": y, "tolerance": tolerance,
                 "features": features.names},
                partial(_distilled, scene, features, m, q, y, guard, tolerance, most),
                solves=len(q) * solves_per_point(scene, m, guard),
            )  # fmt: skip


def economised_methods(
    scene: Scene, features: Features, ladder: Sequence[tuple[int, float]], most: int
) -> Iterator[Method]:
    """1/λ's series turned into the Chebyshev polynomial of the box with the fewest terms.

    ``ladder`` are (order, tolerance): Lanczos's economisation, which costs no further solve.
    """
    point = scene.expansions.full
    for order, tolerance in ladder:
        yield Method(
            f"1/λ {order} → polynomial {tolerance:.0e}",
            "1/λ → polynomial",
            True,
            {"order": order, "q0": point.q0, "y0": point.y0, "tolerance": tolerance,
             "features": features.names},
            partial(_economised, scene, features, order, tolerance, most),
            solves=1,
        )  # fmt: skip


def _economised(
    scene: Scene, features: Features, order: int, tolerance: float, most: int, _: Floats
) -> Evaluator:
    point = scene.expansions.full
    made = expand(scene.model.pencil, point.q0, point.y0, point.modes, order)
    series, n_q = reciprocal(made), len(point.q0)

    def hz(u: Floats) -> Floats:
        return series(Points(features.x(u), u, len(u), 0, n_q))

    polynomial = thinned_through(hz, [order + 2] * features.d, tolerance, most)
    return lambda points: polynomial(points.u)


def _distilled(
    scene: Scene,
    features: Features,
    m: int,
    q: Floats,
    y: Floats,
    guard: bool,
    tolerance: float,
    most: int,
    _: Floats,
) -> Evaluator:
    made = reduced_model(scene, m, q, y, guard)

    def hz(u: Floats) -> Floats:
        x = features.x(u)
        return made.frequencies(x[:, : made.n_q], x[:, made.n_q :])

    polynomial, _used = adaptive(hz, features.d, tolerance, most)
    return lambda points: polynomial(points.u)
