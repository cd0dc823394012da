"""The methods that a chart puts side by side, each in all of its sizes.

Some approximate the frequencies that others solve: series and Ritz models from derivatives at one
or few points; response surfaces, radial basis functions and Kriging from exact solves at many;
interpolation from exact solves along each design's own path. Fits are SciPy's and scikit-learn's.
References [11], [12] and [18] are those of Belotti et al. (2021).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec
from math import comb

import numpy as np
from scipy.interpolate import CubicSpline, RBFInterpolator
from scipy.linalg import eigh, lstsq

from eigassign.arrays import Floats
from eigassign.chart.question import Effort, Points, Subject
from eigassign.chart.results import Kind
from eigassign.errors import AccuracyError, UsageError
from eigassign.mechanism.assembly.build import refined
from eigassign.modal.exact.dense import condense
from eigassign.modal.expansion import NearestExpansion, expand
from eigassign.modal.reduced import reduce
from eigassign.series.multi_index import total_degree
from eigassign.study.built_case import build_model
from eigassign.study.pictures import spread_samples

Answer = Callable[[Points], Floats]  # Hz (n, n_modes)
Fit = Callable[[Floats, Floats], Callable[[Floats], Floats]]  # of inputs (n, n_u), Hz (n, n_modes)
NO_KRIGING = "Kriging needs scikit-learn: pip install 'eigassign[chart]'"
FEW = 3  # points of series about several
SCIPY_DOF = 1500  # beyond which its dense solver is not tried


@dataclass(frozen=True, eq=False)
class Built:
    """A method that is ready: its answers."""

    answer: Answer
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
    """All methods but meshes, exact solvers first; references [11, 12] of fits, [18] of stations.

    Fits are to exact solves at poses and designs spread over the case's ranges.
    """
    kind = "dense" if subject.model.pencil.is_dense else "sparse"
    yield Method(Kind.EXACT, kind, partial(_solved, subject), use="model.frequencies(q, y)")
    yield Method(Kind.SCIPY, "one by one", partial(_by_scipy, subject))
    if not (subject.rows or subject.free):
        return
    n, every = int(subject.model.pencil.active.sum()), (1, 2, 3, 4, 5, 6, 7, 8)
    several, modes = (1, 2, 4, 6) if subject.rows else (), subject.modes
    linear = every if subject.free else ()  # without a design both are the same
    for curve, orders in ((Kind.FULL, every), (Kind.LINEAR, linear), (Kind.SEVERAL, several)):
        for order in (p for p in orders if comb(n + p, p) <= effort.coefficients):
            count, is_linear = FEW if curve == Kind.SEVERAL else 1, curve == Kind.LINEAR
            how = ", linear_in_y=True" if is_linear else ""
            use = f"ea.expand(model, q0, y0, order={order}, modes={modes}{how})"
            build = partial(_expanded, subject, order, is_linear, count)
            yield Method(curve, f"order {order}", build, use=use if count == 1 else "")
    for count, half in ((1, 0), (1, 1), (1, 2), (FEW, 1), (FEW, 2)):
        at = f" with {count} rows of q0, y0" if count > 1 else ""
        use = f"ea.reduce(model, q0, y0, modes={modes}, half_order={half}){at}"
        if count == 1 or subject.rows:  # the modes alone are there to compare with
            build = partial(_reduced, subject, count, half)
            yield Method(Kind.RITZ, "", build, use=use if half else "")
    for count in (5, 9, 17, 33):
        if count <= max((own.stop - own.start for own in subject.rows), default=0):
            build = partial(_interpolated, subject, count)
            yield Method(Kind.INTERPOLATED, f"{count} stations", build)
    n = len(subject.free) + (min(3, len(subject.model.q_names)) if subject.rows else 0)
    for degree in (1, 2, 3, 4):
        if (terms := comb(n + degree, degree)) <= 2 * max(effort.learnt):
            build = partial(_fitted, subject, partial(_polynomials, degree))
            yield Method(Kind.SURFACE, f"degree {degree}", build, max(2 * terms, 12))
    for curve, fit, counts in (
        # RBFInterpolator as it is: thin plate splines
        (Kind.RADIAL, RBFInterpolator, effort.learnt),
        (Kind.KRIGING, _kriged, effort.kriged if find_spec("sklearn") else ()),
    ):
        for count in counts:
            yield Method(curve, f"{count} points", partial(_fitted, subject, fit), count)


# --- Exact solves


def _solved(subject: Subject, _: Points) -> Built:
    return Built(lambda points: subject.exact(points.x))


def _by_scipy(subject: Subject, _: Points) -> Built:
    """scipy.linalg.eigh on M_c z = μ K_E z, μ = 1/λ, at one point after the other."""
    if subject.model.n_dof > SCIPY_DOF:
        raise UsageError(f"its dense solver is not tried with {subject.model.n_dof} unknowns")
    pencil, highest = subject.model.pencil, max(subject.modes)
    elastic, modes = pencil.elastic, np.array(subject.modes) - 1
    which = [len(elastic) - highest, len(elastic) - 1]

    def answer(points: Points) -> Floats:
        mu = np.full((len(points), highest), np.nan)
        for k, x in enumerate(points.x):
            K, M = pencil.matrices(pencil.theta(x[None]))
            pair = condense(M, elastic, pencil.rigid)[1][0], K[0][np.ix_(elastic, elastic)]
            with suppress(np.linalg.LinAlgError):  # K is not positive definite
                mu[k] = eigh(*pair, eigvals_only=True, subset_by_index=which)[::-1]
        return np.asarray(1.0 / (2.0 * np.pi * np.sqrt(mu[:, modes])))

    return Built(answer)


# --- Series and Ritz models: eigassign's


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
    return Built(lambda points: made.frequencies(*subject.split(points.x)))


def _reduced(subject: Subject, count: int, half: int, _: Points) -> Built:
    made = reduce(subject.model.pencil, *_about(subject, count), subject.modes, half)
    size = f"{made.size} vectors" + f" at {count} points" * (count > 1)
    return Built(lambda points: made.frequencies(*subject.split(points.x)), size=size)


# --- From exact solves


def _interpolated(subject: Subject, stations: int, _: Points) -> Built:
    """Cubic splines over exact solves at stations of each design's own path [18]."""

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


def _fitted(subject: Subject, fit: Fit, learnt: Points) -> Built:
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
    answer = fit((x - middle) / width @ turned, hz[known])
    return Built(lambda points: answer((points.x - middle) / width @ turned))


def _polynomials(degree: int, u: Floats, hz: Floats) -> Callable[[Floats], Floats]:
    """Polynomials of all terms up to a degree, by least squares."""
    powers = total_degree(u.shape[1], degree).indices

    def terms(at: Floats) -> Floats:
        return np.asarray(np.prod(at[:, None, :] ** powers, axis=2))

    mean = hz.mean(axis=0)  # which too few points would not give
    coefficients = lstsq(terms(u), hz - mean)[0]
    return lambda at: np.asarray(mean + terms(at) @ coefficients)


def _kriged(u: Floats, hz: Floats) -> Callable[[Floats], Floats]:
    """scikit-learn's Gaussian process with a length for each input, found by likelihood."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel

    kernel = ConstantKernel(1.0, (1e-3, 1e6)) * RBF(np.ones(u.shape[1]), (1e-2, 1e3))
    process = GaussianProcessRegressor(
        kernel, alpha=1e-10, normalize_y=True, n_restarts_optimizer=2, random_state=0
    )
    with warnings.catch_warnings(action="ignore"):  # of lengths at the ends of their range
        process.fit(u, hz)
    return lambda at: np.reshape(process.predict(at), (len(at), -1))


# --- The mesh itself


def list_meshes(
    subject: Subject, effort: Effort, tests: Points
) -> Iterator[tuple[Method, Points, Floats]]:
    """The case with 1, 2, 4, … elements in every beam, as large as is solved, and as it is.

    Each with a few of the test points, and Hz (n, n_modes) of the limit of all there:
    f + (f − f_coarser)/15, for errors fall like h⁴ when halved.
    """
    few = tests[np.unique(np.linspace(0, len(tests) - 1, 16).astype(int))]
    coarsest, hz = refined(subject.file, 1e-9)[0], list[Floats]()  # a beam keeps one
    meshes = list[Method]()
    for count in effort.elements:
        file, counts = refined(coarsest, count)
        model = build_model(file) if counts else subject.model
        if not counts or model.n_dof > effort.most_dof:
            break
        finer = replace(subject, file=file, model=model)
        hz.append(finer.exact(few.x))
        size, use = f"{count} element{'s' * (count > 1)} a link", f"elements: {count}"
        meshes.append(Method(Kind.MESH, size, partial(_solved, finer), use=use))
    if len(hz) > 1:
        meshes.append(Method(Kind.MESH, "as in the case", partial(_solved, subject)))
        yield from ((mesh, few, hz[-1] + (hz[-1] - hz[-2]) / 15.0) for mesh in meshes)
