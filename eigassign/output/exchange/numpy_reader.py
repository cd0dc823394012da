"""Frequencies of a reduced model of eigassign from its .npz file, by NumPy alone.

    model = read("arm.npz")
    frequencies(model, q, y)  # Hz, one for each of model["modes"]; NaN where there are none
    answer(model, q, y)  # the same, and 0 or the code of what is wrong: DOMAIN, LOOP, INDEFINITE

q in rad or m and y in SI units, as the case orders them, between model["lower"] and model["upper"]:
the poses and designs that the model was made for. It does not estimate its error.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Model = dict[str, NDArray[Any]]
Floats = NDArray[np.float64]

STEP, FARTHEST, REFINEMENTS = 0.15, 500.0, (1, 4, 16, 64)  # of a loop that is followed from a_0
ACCEPT, CONVERGED, SINGULAR = 1e-9, 1e-8, 1e-5


def read(path: str) -> Model:
    """The arrays of a file by name."""
    with np.load(path, allow_pickle=False) as file:
        return {name: file[name] for name in file.files}


DOMAIN, LOOP, INDEFINITE = 1, 2, 3


class RefusedError(ValueError):
    """No answer; its first argument is the code of why."""


def frequencies(model: Model, q: ArrayLike, y: ArrayLike) -> Floats:
    """(n_modes,) in Hz at q (n_q,) and y (n_y,); NaN where there are none."""
    return answer(model, q, y)[0]


def answer(model: Model, q: ArrayLike, y: ArrayLike) -> tuple[Floats, int]:
    """`frequencies` and 0; or NaN and the code of why: DOMAIN, LOOP, INDEFINITE.

    These are: q or y is not where the model was made for; a closed loop cannot be closed there; K
    is not positive definite.
    """
    try:
        K, M = matrices(model, q, y)
    except RefusedError as error:
        return np.full(len(model["modes"]), np.nan), error.args[0]
    try:
        inverse = np.linalg.inv(np.linalg.cholesky(K))
    except np.linalg.LinAlgError:
        return np.full(len(model["modes"]), np.nan), INDEFINITE
    mu = np.linalg.eigvalsh(inverse @ M @ inverse.T)[::-1]
    return np.asarray(1.0 / (2.0 * np.pi * np.sqrt(mu[model["modes"] - 1]))), 0


def matrices(model: Model, q: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
    """K and M (k, k) of K φ = (2 π f)² M φ, rigid-body motion projected out; else RefusedError."""
    x = np.concatenate([np.ravel(q), np.ravel(y)]).astype(float)
    if len(x) != model["n_q"][0] + model["n_y"][0]:
        raise ValueError("q or y has another length than the model's")
    if not ((x >= model["lower"]) & (x <= model["upper"])).all():
        raise RefusedError(DOMAIN, "q or y is not where the model was made for")
    theta = np.append(1.0, run(model, 0, model["to_program"] @ x + model["shift"]))
    if not np.isfinite(theta).all():
        raise RefusedError(DOMAIN, "q or y is outside the domain of a section or length")
    k, f = model["size"][0], model["rigid"][0]
    K = _square(theta[model["stiffness_terms"]] @ model["stiffness"], k)
    M = _square(theta[model["mass_terms"]] @ model["mass"], k + f)
    coupling = np.linalg.solve(M[k:, k:], M[k:, :k])
    return K, M[:k, :k] - M[:k, k:] @ coupling


def _square(triangle: Floats, n: int) -> Floats:
    A = np.zeros((n, n))
    A[np.tril_indices(n)] = triangle
    return A + np.tril(A, -1).T


def run(model: Model, f: int, arguments: Floats) -> Floats:
    """The outputs of function f."""
    begin, end = model["functions"][f][:2]
    values = list(arguments)
    for k in range(begin, end):
        part = slice(model["first_atom"][k], model["first_atom"][k + 1])
        a = np.array([values[i] for i in model["atoms"][part]])
        kind, number = model["kinds"][k], model["numbers"][k]
        with np.errstate(all="ignore"):
            if kind == 0:
                values.append(number + model["weights"][part] @ a)
            elif kind == 1:
                values.append(a[0] * a[1])
            elif kind == 2:
                values.append(np.power(a[0], number))
            elif kind in (3, 4, 5):
                values.append((np.sin, np.cos, np.exp)[kind - 3](a[0]))
            elif kind == 6:
                n = int(number)
                A, B = a[: n * n].reshape(n, n), a[n * n :].reshape(n, -1)
                try:
                    values.extend(np.linalg.solve(A, B).ravel())
                except np.linalg.LinAlgError:
                    raise RefusedError(LOOP, "a closed loop is at a dead point") from None
            else:
                values.extend(close(model, int(number), a))
    first, last = model["first_output"][f : f + 2]
    return np.array([values[i] for i in model["outputs"][first:last]])


def close(model: Model, f: int, a: Floats) -> Floats:
    """p of F(p, a) = 0 for a closed loop, followed from the known pose so as to keep its branch."""
    size = model["functions"][f][4]
    known = model["known"][model["first_known"][f] : model["first_known"][f + 1]]
    a0, p0 = known[:-size], known[-size:]
    far = np.abs(a - a0).max(initial=0.0)
    if not far < FARTHEST:
        raise RefusedError(LOOP, "a closed loop cannot be followed so far")
    for refinement in REFINEMENTS:
        p = _followed(model, f, a0, p0, a, refinement * max(int(np.ceil(far / STEP)), 1))
        if p is not None:
            return p
    raise RefusedError(LOOP, "a closed loop cannot be closed, or is at a dead point")


def _followed(model: Model, f: int, a0: Floats, p: Floats, a: Floats, steps: int) -> Floats | None:
    J = _equations(model, f, a0, p)[2]
    smallest = np.linalg.svd(J, compute_uv=False)[-1]
    for k in range(1, steps + 1):
        here, before = a0 + k / steps * (a - a0), J
        tolerance = 1e-13 if k == steps else 1e-6
        for _ in range(12):
            F, _, J = _equations(model, f, here, p)
            if not np.isfinite(J).all():
                return None
            step = -np.linalg.lstsq(J, F, rcond=None)[0]
            p = p + np.clip(step, -0.5, 0.5)
            if np.abs(step).max() < tolerance:
                break
        s = np.linalg.svd(J, compute_uv=False)
        converged = np.abs(step).max() < max(tolerance, CONVERGED)
        if not (converged and s[-1] > SINGULAR * s[0] and np.linalg.norm(J - before) < smallest):
            return None
        smallest = s[-1]
    F, check, _ = _equations(model, f, a, p)
    return p if np.abs(np.append(F, check)).max() < ACCEPT else None


def _equations(model: Model, f: int, a: Floats, p: Floats) -> tuple[Floats, Floats, Floats]:
    size, m, checks = model["functions"][f][4:]
    rows = run(model, f, np.concatenate([a, p]))
    return rows[:m], rows[m : m + checks], rows[m + checks :].reshape(m, size)
