"""What people do without eigassign, trained on its exact solves so that only the idea differs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from eigassign.modal.exact import condense
from eigassign.modal.model import Model
from eigassign.study.chart_methods import Evaluator, Method
from eigassign.study.chart_question import Features, Points
from eigassign.study.surrogates import (
    Kernel,
    Surrogate,
    along,
    chebyshev,
    chebyshev_nodes,
    equal_nodes,
    grid_interpolation,
    grid_points,
    radial_basis,
    response_surface,
    spread_points,
)
from eigassign.study.surrogates_kriging import fit_kriging

Floats = NDArray[np.float64]
MOST_NODES = 20  # of one Chebyshev polynomial along the trajectory
MOST_DENSE = 2500  # n_dof up to which a dense solve is tried


def lapack(model: Model, modes: Sequence[int], most: int) -> Method:
    """SciPy's dense generalised solver, one sample after the other."""
    count, pick = max(modes), np.array(modes) - 1
    return Method(
        "exact dense, SciPy one by one",
        "exact by others",
        False,
        {"solver": "scipy.linalg.eigh, subset by index", "points": most},
        lambda _: lambda points: lapack_frequencies(model, points.x, count)[:, pick],
        exact=True,
        most=most,
    )


def lapack_frequencies(model: Model, x: Floats, count: int) -> Floats:
    """Exact frequencies (n, count) in Hz by scipy.linalg.eigh on M_c z = μ K_E z."""
    rows = [_lapack_one(model, model.pencil.theta(each[None]), count) for each in x]
    return np.asarray(1.0 / (2.0 * np.pi * np.sqrt(np.array(rows))))


def _lapack_one(model: Model, theta: Floats, count: int) -> Floats:
    K, M = model.pencil.matrices(theta)
    elastic = model.pencil.elastic
    _, M_c = condense(M, elastic, model.pencil.rigid)
    n = len(elastic)
    K_E = K[0][np.ix_(elastic, elastic)]
    mu = eigh(M_c[0], K_E, eigvals_only=True, subset_by_index=[n - count, n - 1])
    return np.asarray(mu[::-1])


def trajectory_methods(features: Features, stations: Sequence[int], n_q: int) -> Iterator[Method]:
    """Static modal analyses at stations of the trajectory, interpolated; anew for every design."""
    if features.place is None:
        return
    for k in stations:
        for kind in ("linear", "cubic", "Chebyshev"):
            if kind == "Chebyshev" and k > MOST_NODES:
                continue
            yield Method(
                f"stations {kind} {k}",
                f"stations, {kind}",
                False,
                {"stations": k, "interpolation": kind},
                partial(_per_run, kind, k),
                partial(_stations, features, station_nodes(kind, k), n_q),
                per_design=True,
                note="solved anew for every design: answers the runs along the trajectory only",
            )


def station_nodes(kind: str, k: int) -> Floats:
    """Where along the trajectory the stations are, (k,) in [0, 1]."""
    return chebyshev_nodes(k) if kind == "Chebyshev" else equal_nodes(k)


def _stations(features: Features, nodes: Floats, n_q: int, points: Points) -> Floats:
    """x (designs · k, n_x)."""
    runs, k = points.runs(), len(nodes)
    q = features.travel(nodes)
    y = runs.x[:: len(runs.x) // runs.designs, n_q:]
    return np.hstack([np.tile(q, (len(y), 1)), np.repeat(y, k, axis=0)])


def _per_run(kind: str, k: int, f: Floats) -> Evaluator:
    by_design = f.reshape(-1, k, f.shape[1])

    def evaluate(points: Points) -> Floats:
        u = points.u.reshape(len(by_design), -1, points.u.shape[1])
        pairs = zip(by_design, u, strict=True)
        return np.vstack([_interpolated(kind, own)(at) for own, at in pairs])

    return evaluate


def _interpolated(kind: str, f: Floats) -> Surrogate:
    """Through stations f (k, n_modes) of one design."""
    if kind == "Chebyshev":
        line = chebyshev([len(f)], f)
        return lambda at: line(at[:, :1])
    return along(equal_nodes(len(f)), f, kind == "cubic")


def grid_methods(features: Features, nodes: Sequence[int]) -> Iterator[Method]:
    """Interpolation over a grid in place and design: linear, cubic spline, Chebyshev polynomial."""
    for k in nodes:
        for kind in ("linear", "cubic", "Chebyshev"):
            if kind == "cubic" and k < 4:
                continue
            axis = chebyshev_nodes(k) if kind == "Chebyshev" else equal_nodes(k)
            yield Method(
                f"grid {kind} {k}",
                f"grid, {kind}",
                False,
                {"nodes": k, "features": features.names, "interpolation": kind},
                partial(_on_grid, kind, k, features.d),
                partial(_at, features, grid_points(axis, features.d)),
            )


def _on_grid(kind: str, k: int, d: int, f: Floats) -> Evaluator:
    if kind == "Chebyshev":
        return _on_u(chebyshev([k] * d, f))
    return _on_u(grid_interpolation(k, d, f, kind == "cubic"))


def _at(features: Features, u: Floats, _: Points) -> Floats:
    """Training points x, whatever is asked."""
    return features.x(u)


def _on_u(surrogate: Surrogate) -> Evaluator:
    return lambda points: surrogate(points.u)


def surrogate_methods(
    features: Features, counts: Sequence[int], kriging: Sequence[int]
) -> Iterator[Method]:
    """Surrogates fitted to the same spread-out exact solves; Kriging for the counts it can bear."""
    for n in counts:
        u = spread_points(n, features.d)
        yield from (_fitted(features, u, n, *each) for each in _fits(u))
        if n in kriging:
            how = {"kernel": "squared exponential", "starts": 2}
            yield _fitted(features, u, n, "Kriging", how, partial(_kriging, u))


def _fits(u: Floats) -> Iterator[tuple[str, dict[str, object], Callable[[Floats], Evaluator]]]:
    """Family, parameters and fit of the cheap surrogates."""
    for name, degree in (("quadratic", 2), ("cubic", 3)):
        yield f"response surface, {name}", {"degree": degree}, partial(_surface, u, degree)
    kernels: tuple[Kernel, ...] = ("thin_plate_spline", "quintic")
    for kernel in kernels:
        yield f"RBF, {kernel}".replace("_", " "), {"kernel": kernel}, partial(_rbf, u, kernel)


def _fitted(
    features: Features,
    u: Floats,
    n: int,
    family: str,
    how: Mapping[str, object],
    fit: Callable[[Floats], Evaluator],
) -> Method:
    parameters = {**how, "training_points": n, "features": features.names}
    name = f"{family.replace(',', '')} {n}"
    return Method(name, family, False, parameters, fit, partial(_at, features, u))


def _surface(u: Floats, degree: int, f: Floats) -> Evaluator:
    return _on_u(response_surface(u, f, degree))


def _rbf(u: Floats, kernel: Kernel, f: Floats) -> Evaluator:
    return _on_u(radial_basis(u, f, kernel))


def _kriging(u: Floats, f: Floats) -> Evaluator:
    fitted = [fit_kriging(u, column) for column in f.T]
    return lambda points: np.column_stack([one(points.u) for one in fitted])
