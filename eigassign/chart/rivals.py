"""What people do without eigassign, trained on its exact solves so that only the method differs.

A dense eigenvalue solver, modal analyses at stations of the trajectory, interpolation on a grid in
place and design, and surrogates fitted to spread-out points.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from eigassign.chart.methods import Evaluator, Method
from eigassign.chart.question import EvaluationPoints, Features
from eigassign.chart.surrogates import (
    KINDS,
    Kind,
    Separable,
    Surrogate,
    grid_points,
    has_kriging,
    kriging,
    nodes,
    radial_basis,
    response_surface,
    spread_points,
    tensor_interpolation,
)
from eigassign.modal.exact.condensation import condense
from eigassign.modal.model import Model

Floats = NDArray[np.float64]
MOST_NODES = 20  # of one Chebyshev polynomial along the trajectory
MOST_DENSE = 2500  # n_dof up to which a dense solve is tried


def dense_by_scipy(model: Model, modes: Sequence[int], most: int) -> Method:
    """SciPy's dense generalised solver, one sample after the other."""
    count, wanted = max(modes), np.array(modes) - 1
    return Method(
        "exact dense, SciPy one by one",
        "exact by others",
        {"solver": "scipy.linalg.eigh, subset by index", "points": most},
        lambda _: lambda points: scipy_frequencies(model, points.x, count)[:, wanted],
        ours=False,
        exact=True,
        most=most,
    )


def scipy_frequencies(model: Model, x: Floats, count: int) -> Floats:
    """Exact frequencies (n, count) in Hz by scipy.linalg.eigh on M_c z = μ K_E z, μ = 1/λ."""
    elastic = model.pencil.elastic
    n, mu = len(elastic), np.empty((len(x), count))
    for k, each in enumerate(x):
        K, M = model.pencil.matrices(model.pencil.theta(each[None]))
        _, M_c = condense(M, elastic, model.pencil.rigid)
        K_E = K[0][np.ix_(elastic, elastic)]
        found = eigh(M_c[0], K_E, eigvals_only=True, subset_by_index=[n - count, n - 1])
        mu[k] = found[::-1]
    return np.asarray(1.0 / (2.0 * np.pi * np.sqrt(mu)))


def station_methods(features: Features, stations: Sequence[int], n_q: int) -> Iterator[Method]:
    """Modal analyses at stations of the trajectory, interpolated; anew for every design."""
    if features.place is None:
        return
    for k in stations:
        for kind in KINDS:
            if kind == "Chebyshev" and k > MOST_NODES:
                continue
            yield Method(
                f"stations {kind} {k}",
                f"stations, {kind}",
                {"interpolation": kind, "stations": nodes(kind, k)},
                partial(_between_stations, station_weights(features.place, kind, k)),
                partial(_at_stations, features, nodes(kind, k), n_q),
                ours=False,
                per_design=True,
                note="solved anew for every design: answers the runs along the trajectory only",
            )


def _at_stations(features: Features, places: Floats, n_q: int, points: EvaluationPoints) -> Floats:
    """x (designs · k, n_x)."""
    q, y = features.pose(places), points.run_designs
    return np.hstack([np.tile(q, (len(y), 1)), np.repeat(y, len(q), axis=0)])


def station_weights(place: Floats, kind: Kind, k: int) -> Floats:
    """What each of k stations contributes to each sample of the trajectory, (n_t, k)."""
    return tensor_interpolation(kind, k, 1, np.eye(k))(place[:, None])


def _between_stations(weights: Floats, f: Floats) -> Evaluator:
    """One product for all designs: they share the weights."""
    by_design = f.reshape(-1, weights.shape[1], f.shape[1])
    return lambda points: np.matmul(weights[points.along], by_design).reshape(-1, f.shape[1])


def grid_methods(features: Features, sizes: Sequence[int]) -> Iterator[Method]:
    """Interpolation on a grid in place and design: linear, cubic spline, Chebyshev polynomial."""
    for k in sizes:
        for kind in KINDS:
            if kind == "cubic" and k < 4:
                continue
            yield Method(
                f"grid {kind} {k}",
                f"grid, {kind}",
                {"nodes": k, "features": features.names, "interpolation": kind},
                partial(_on_grid, features, kind, k),
                partial(_at, features, grid_points(nodes(kind, k), features.d)),
                ours=False,
            )


def _on_grid(features: Features, kind: Kind, k: int, f: Floats) -> Evaluator:
    return _by_runs(features, tensor_interpolation(kind, k, features.d, f))


def _at(features: Features, u: Floats, _: EvaluationPoints) -> Floats:
    """The training points x are the same for all evaluation points."""
    return features.x(u)


def _by_runs(features: Features, made: Separable) -> Evaluator:
    """Whole trajectories of many designs at once, as fits answer them; other points one by one."""
    if features.place is None or features.d == 1:
        return lambda points: made(points.u)
    along = made.along(features.place)

    def evaluate(points: EvaluationPoints) -> Floats:
        n = points.n_random if points.designs else len(points.u)
        parts = [made(points.u[:n])] if n else []
        if points.designs:
            hz = along(points.u[n :: len(points.along), 1:])
            whole = len(points.along) == hz.shape[1]
            parts.append((hz if whole else hz[:, points.along]).reshape(-1, hz.shape[2]))
        return parts[0] if len(parts) == 1 else np.vstack(parts)

    return evaluate


def surrogate_methods(features: Features, counts: Sequence[int]) -> Iterator[Method]:
    """Surrogates fitted to ``counts`` spread-out points; Kriging where scikit-learn is there."""
    fits: dict[str, tuple[Callable[[Floats, Floats], Surrogate], dict[str, Any]]] = {
        "response surface, quadratic": (partial(response_surface, degree=2), {"degree": 2}),
        "response surface, cubic": (partial(response_surface, degree=3), {"degree": 3}),
    }
    kernels: tuple[Literal["thin_plate_spline", "quintic"], ...] = ("thin_plate_spline", "quintic")
    for kernel in kernels:
        name = f"RBF, {kernel.replace('_', ' ')}"
        fits[name] = (partial(radial_basis, kernel=kernel), {"kernel": kernel})
    if has_kriging():
        fits["Kriging"] = (kriging, {"kernel": "squared exponential", "by": "scikit-learn"})
    for n in counts:
        u = spread_points(n, features.d)
        for family, (fit, how) in fits.items():
            yield Method(
                f"{family.replace(',', '')} {n}",
                family,
                {**how, "training_points": n, "features": features.names},
                partial(_surrogate, features, partial(fit, u)),
                partial(_at, features, u),
                ours=False,
            )


def _surrogate(features: Features, fit: Callable[[Floats], Surrogate], f: Floats) -> Evaluator:
    made = fit(f)
    return _by_runs(features, made) if isinstance(made, Separable) else lambda at: made(at.u)
