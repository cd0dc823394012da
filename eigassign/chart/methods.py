"""The methods that a chart puts side by side, each in all of its sizes.

Some approximate the frequencies that others solve: series and Ritz models from derivatives at one
or few points; response surfaces, radial basis functions and Kriging from exact solves at many;
interpolation from exact solves along each design's own path. Fits are SciPy's and scikit-learn's.
References [11], [12] and [18] are those of Belotti et al. (2021).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec
from math import comb
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.chart.question import Effort, Points, Subject
from eigassign.errors import AccuracyError, UsageError
from eigassign.mechanism.assembly.build import refined
from eigassign.modal.exact.dense import condense
from eigassign.modal.expansion import NearestExpansion, expand
from eigassign.modal.reduced import reduce
from eigassign.series.multi_index import total_degree
from eigassign.study.built_case import build_model
from eigassign.study.pictures import spread_samples

Floats = NDArray[np.float64]
Answer = Callable[[Points], Floats]  # Hz (n, n_modes)
FULL, LINEAR, SEVERAL = "Taylor", "Taylor, linearised in y", "Taylor, several points"
RITZ, INTERPOLATED = "Ritz model", "interpolation along the path"
SURFACE, RADIAL, KRIGING = "response surface", "radial basis functions", "Kriging"
EXACT, SCIPY, MESH = "exact, eigassign", "exact, SciPy", "mesh"
LEARNING = (INTERPOLATED, SURFACE, RADIAL, KRIGING)  # they see nothing between what they solve
CURVES = (FULL, LINEAR, SEVERAL, RITZ, *LEARNING, EXACT, SCIPY, MESH)
NO_KRIGING = "Kriging needs scikit-learn: pip install 'eigassign[chart]'"
FEW = 3  # points of series about several
SCIPY_DOF = 1500  # beyond which its dense solver is not tried


@dataclass(frozen=True, eq=False)
class Built:
    """A method that is ready: its answers, and what it says of their relative error, if so."""

    answer: Answer
    claimed: Answer | None = None
    size: str = ""  # where that is known only now


@dataclass(frozen=True, eq=False)
class Method:
    """A way to the frequencies; ``build`` makes it from as many points as it ``learns`` from."""

    curve: str
    size: str
    build: Callable[[Points], Built]
    learns: int = 0
    use: str = ""  # the call, or key of the case file, that asks for it


def list_methods(subject: Subject, effort: Effort) -> Iterator[Method]:
    """All methods but meshes, exact solvers first."""
    kind = "dense" if subject.model.pencil.is_dense else "sparse"
    use = "model.frequencies(q, y)"
    yield Method(EXACT, kind, lambda _: Built(lambda points: subject.exact(points.x)), use=use)
    yield Method(SCIPY, "one by one", partial(_scipy, subject))
    if subject.rows or subject.changes:
        yield from _series(subject, effort)
        for count, half in ((1, 0), (1, 1), (1, 2), (FEW, 1), (FEW, 2)):
            use = f"ea.reduce(model, q0, y0, modes={subject.modes}, half_order={half})"
            if count == 1 or subject.rows:
                yield Method(RITZ, "", partial(_reduced, subject, count, half), use=use)
        for count in (5, 9, 17, 33):
            if count <= max((own.stop - own.start for own in subject.rows), default=0):
                build = partial(_interpolated, subject, count)
                yield Method(INTERPOLATED, f"{count} stations", build)
        yield from surrogates(subject, effort)


# --- Exact solves by others


def _scipy(subject: Subject, _: Points) -> Built:
    if subject.model.n_dof > SCIPY_DOF:
        raise UsageError(f"its dense solver is not tried with {subject.model.n_dof} unknowns")
    return Built(partial(_by_scipy, subject))


def _by_scipy(subject: Subject, points: Points) -> Floats:
    """Frequencies (n, n_modes) in Hz by scipy.linalg.eigh on M_c z = μ K_E z, μ = 1/λ."""
    from scipy.linalg import eigh

    pencil, highest = subject.model.pencil, max(subject.modes)
    elastic, mu = pencil.elastic, np.full((len(points), highest), np.nan)
    which = [len(elastic) - highest, len(elastic) - 1]
    for k, x in enumerate(points.x):
        K, M = pencil.matrices(pencil.theta(x[None]))
        pair = condense(M, elastic, pencil.rigid)[1][0], K[0][np.ix_(elastic, elastic)]
        try:
            mu[k] = eigh(*pair, eigvals_only=True, subset_by_index=which)[::-1]
        except np.linalg.LinAlgError:  # K is not positive definite
            continue
    return np.asarray(1.0 / (2.0 * np.pi * np.sqrt(mu[:, np.array(subject.modes) - 1])))


# --- Series and Ritz models: eigassign's


def _series(subject: Subject, effort: Effort) -> Iterator[Method]:
    """Full and linearised series of each order, and full ones about several points."""
    n, every = int(subject.model.pencil.active.sum()), (1, 2, 3, 4, 5, 6, 7, 8)
    several = (1, 2, 4, 6) if subject.rows else ()
    for curve, orders in ((FULL, every), (LINEAR, every), (SEVERAL, several)):
        for order in (p for p in orders if comb(n + p, p) <= effort.coefficients):
            count, linear = FEW if curve == SEVERAL else 1, curve == LINEAR
            how = ", linear_in_y=True" if linear else ""
            use = f"ea.expand(model, q0, y0, order={order}, modes={subject.modes}{how})"
            build = partial(_expanded, subject, order, linear, count)
            yield Method(curve, f"order {order}", build, use=use)


def _about(subject: Subject, count: int) -> tuple[Floats, Floats]:
    """q and y to expand about: x0, or poses spread along the path."""
    q, y = subject.split(subject.x0[None])
    if count > 1 and subject.path is not None:
        q = subject.path.q[spread_samples(subject.path.q, count)]
    return q, np.tile(y, (len(q), 1))


def _expanded(subject: Subject, order: int, linear: bool, count: int, _: Points) -> Built:
    about = zip(*_about(subject, count), strict=True)
    pencil, modes = subject.model.pencil, subject.modes
    parts = tuple(expand(pencil, *at, modes, order, linear) for at in about)
    made = NearestExpansion(parts) if count > 1 else parts[0]
    return Built(
        lambda points: made.frequencies(*subject.split(points.x)),
        lambda points: parts[0].last_degree_share(*subject.split(points.x)),
    )


def _reduced(subject: Subject, count: int, half: int, _: Points) -> Built:
    made = reduce(subject.model.pencil, *_about(subject, count), subject.modes, half)
    size = f"{made.size} vectors" + f" at {count} points" * (count > 1)
    return Built(lambda points: made.frequencies(*subject.split(points.x)), size=size)


# --- From exact solves


def _interpolated(subject: Subject, stations: int, _: Points) -> Built:
    """Cubic splines over exact solves at stations of each design's own path [18]."""
    from scipy.interpolate import CubicSpline

    def answer(points: Points) -> Floats:
        hz = np.empty((len(points), len(subject.modes)))
        for design in np.unique(points.design):
            own = points.design == design
            along = subject.along(subject.split(points.x[own][0])[1])
            for part in subject.rows:
                here = own & (points.place >= part.start) & (points.place <= part.stop - 1)
                at = np.unique(np.rint(np.linspace(part.start, part.stop - 1, stations)))
                known = subject.exact(along.x[at.astype(int)])
                hz[here] = CubicSpline(at, known)(points.place[here]) if len(at) > 1 else known
        return hz

    return Built(answer)


def surrogates(subject: Subject, effort: Effort) -> Iterator[Method]:
    """Fits to exact solves at poses and designs spread over the case's ranges [11, 12]."""
    n = len(subject.free) + (min(3, len(subject.model.q_names)) if subject.rows else 0)
    for degree in (1, 2, 3, 4):
        if (terms := comb(n + degree, degree)) <= 2 * max(effort.learnt):
            build = partial(_surface, subject, degree)
            yield Method(SURFACE, f"degree {degree}", build, max(2 * terms, 12))
    for count in effort.learnt:
        yield Method(RADIAL, f"{count} points", partial(_radial, subject), count)
    for count in effort.kriged if find_spec("sklearn") else ():
        yield Method(KRIGING, f"{count} points", partial(_kriged, subject), count)


def _fitted(
    subject: Subject, learnt: Points, fit: Callable[[Floats, Floats], Callable[[Floats], Any]]
) -> Callable[[Points], Any]:
    """``fit`` to exact solves over inputs of unit size: directions in which the points differ."""
    hz = subject.exact(learnt.x)
    known = np.isfinite(hz).all(axis=1)
    if not known.any():
        raise AccuracyError("none of the points to learn from has an exact answer")
    x = learnt.x[known]
    middle, width = x.mean(axis=0), np.ptp(x, axis=0)
    width = np.where(width > 1e-12 * (1.0 + np.abs(middle)), width, np.inf)
    _, s, Vt = np.linalg.svd((x - middle) / width, full_matrices=False)
    kept = s > 1e-6 * s[0]
    turned = Vt[kept].T / s[kept] * np.sqrt(len(x))
    found = fit((x - middle) / width @ turned, hz[known])
    return lambda points: found((points.x - middle) / width @ turned)


def _surface(subject: Subject, degree: int, learnt: Points) -> Built:
    """Polynomials of all terms up to a degree, by least squares."""
    from scipy.linalg import lstsq

    def fit(u: Floats, hz: Floats) -> Callable[[Floats], Floats]:
        powers = total_degree(u.shape[1], degree).indices

        def terms(at: Floats) -> Floats:
            return np.asarray(np.prod(at[:, None, :] ** powers, axis=2))

        mean = hz.mean(axis=0)  # which too few points would not give
        coefficients = lstsq(terms(u), hz - mean)[0]
        return lambda at: np.asarray(mean + terms(at) @ coefficients)

    return Built(_fitted(subject, learnt, fit))


def _radial(subject: Subject, learnt: Points) -> Built:
    """scipy.interpolate.RBFInterpolator as it is: thin plate splines."""
    from scipy.interpolate import RBFInterpolator

    return Built(_fitted(subject, learnt, RBFInterpolator), size=f"{len(learnt)} points")


def _kriged(subject: Subject, learnt: Points) -> Built:
    """scikit-learn's Gaussian process with a length for each input, found by likelihood."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel

    def fit(u: Floats, hz: Floats) -> Any:
        kernel = ConstantKernel(1.0, (1e-3, 1e6)) * RBF(np.ones(u.shape[1]), (1e-2, 1e3))
        process = GaussianProcessRegressor(
            kernel, alpha=1e-10, normalize_y=True, n_restarts_optimizer=2, random_state=0
        )
        return partial(process.fit(u, hz).predict, return_std=True)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of lengths at the ends of their range
        both = _fitted(subject, learnt, fit)

    def answer(points: Points, claimed: bool) -> Floats:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of variances below 0
            hz, off = (np.reshape(each, (len(points), -1)) for each in both(points))
        return np.asarray(off / hz if claimed else hz)

    size = f"{len(learnt)} points"  # of few samples there are no more
    return Built(partial(answer, claimed=False), partial(answer, claimed=True), size)


# --- The mesh itself


def list_meshes(subject: Subject, effort: Effort) -> Iterator[tuple[int, Subject]]:
    """The case with 1, 2, 4, … elements in every beam up to the largest mesh, and how many."""
    coarsest = refined(subject.file, 1e-9)[0]  # a beam keeps one
    for count in effort.elements:
        file, counts = refined(coarsest, count)
        model = build_model(file) if counts else subject.model
        if not counts or model.n_dof > effort.most_dof:
            return
        yield count, replace(subject, file=file, model=model)
