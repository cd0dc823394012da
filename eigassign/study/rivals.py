"""What people do without eigassign, trained on its exact solves so that only the idea differs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from eigassign.modal.condensation import condense
from eigassign.modal.model import Model
from eigassign.study.chart_methods import Evaluator, Method
from eigassign.study.chart_question import Features, Points
from eigassign.study.surrogates import (
    Kernel,
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
from eigassign.study.surrogates_kriging import Kriging, fit_kriging, kriging_lines
from eigassign.study.surrogates_lines import Separable, Trajectory

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
                {"interpolation": kind, "stations": station_nodes(kind, k)},
                partial(_per_run, features, kind, k),
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


def _per_run(features: Features, kind: str, k: int, f: Floats) -> Evaluator:
    """One product for all designs: what stations contribute to each sample is the same for all."""
    by_design = f.reshape(-1, k, f.shape[1])

    def evaluate(points: Points) -> Floats:
        hz = np.matmul(station_shares(features, kind, k)[points.along], by_design)
        return np.asarray(hz.reshape(-1, f.shape[1]))

    return evaluate


@lru_cache(maxsize=64)
def station_shares(features: Features, kind: str, k: int) -> Floats:
    """What each station contributes to each sample of the trajectory, (n_t, k)."""
    assert features.place is not None
    one = chebyshev(k, 1, np.eye(k)) if kind == "Chebyshev" else None
    made = one or along(equal_nodes(k), np.eye(k), kind == "cubic")
    shares: Floats = made(features.place[:, None])
    shares.setflags(write=False)
    return shares


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
                partial(_on_grid, features, kind, k),
                partial(_at, features, grid_points(axis, features.d)),
            )


def _on_grid(features: Features, kind: str, k: int, f: Floats) -> Evaluator:
    if kind == "Chebyshev":
        return _by_lines(features, chebyshev(k, features.d, f))
    return _by_lines(features, grid_interpolation(k, features.d, f, kind == "cubic"))


def _at(features: Features, u: Floats, _: Points) -> Floats:
    """Training points x, whatever is asked."""
    return features.x(u)


def _by_lines(features: Features, made: Separable) -> Evaluator:
    """Whole trajectories of many designs at once, as fits answer them; other points one by one."""
    if features.place is None or features.d == 1:
        return lambda points: made(points.u)
    path = Trajectory(made.lines, features.place)

    def evaluate(points: Points) -> Floats:
        n = points.n_random if points.designs else len(points.u)
        parts = [made(points.u[:n])] if n else []
        if points.designs:
            hz = path(points.u[n :: len(points.along), 1:])
            whole = len(points.along) == hz.shape[1]
            parts.append((hz if whole else hz[:, points.along]).reshape(-1, hz.shape[2]))
        return parts[0] if len(parts) == 1 else np.vstack(parts)

    return evaluate


def surrogate_methods(
    features: Features, counts: Sequence[int], kriging: Sequence[int]
) -> Iterator[Method]:
    """Surrogates fitted to the same spread-out exact solves; Kriging for the counts it can bear."""
    for n in counts:
        u = spread_points(n, features.d)
        yield from (_fitted(features, u, n, *each) for each in _fits(features, u))
        if n in kriging:
            how = {"kernel": "squared exponential", "starts": 2}
            yield _fitted(features, u, n, "Kriging", how, partial(_kriging, features, u))


def _fits(
    features: Features, u: Floats
) -> Iterator[tuple[str, dict[str, object], Callable[[Floats], Evaluator]]]:
    """Family, parameters and fit of the cheap surrogates."""
    for name, degree in (("quadratic", 2), ("cubic", 3)):
        yield (
            f"response surface, {name}",
            {"degree": degree},
            partial(_surface, features, u, degree),
        )
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


def _surface(features: Features, u: Floats, degree: int, f: Floats) -> Evaluator:
    return _by_lines(features, response_surface(u, f, degree))


def _rbf(u: Floats, kernel: Kernel, f: Floats) -> Evaluator:
    """Point by point: neither kernel is a sum of products."""
    made = radial_basis(u, f, kernel)
    return lambda points: made(points.u)


def _kriging(features: Features, u: Floats, f: Floats) -> Evaluator:
    fitted = [fit_kriging(u, column) for column in f.T]
    anywhere = partial(_columns, fitted)
    return _by_lines(features, Separable(anywhere, kriging_lines(fitted)))


def _columns(fitted: Sequence[Kriging], at: Floats) -> Floats:
    return np.column_stack([one(at) for one in fitted])
