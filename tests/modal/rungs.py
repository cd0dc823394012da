"""The rungs of the ladder: residual of the recursion, slope of the error, differences."""

import itertools
from collections.abc import Callable, Sequence

import numpy as np

from eigassign.mechanism import Pencil
from eigassign.modal import Expansion, eigenvalues, expand_subspace, modes
from eigassign.series import total_degree

Floats = np.ndarray


def residual(pencil: Pencil, x0: Floats, span: Floats, order: int, wanted: Sequence[int]) -> Floats:
    """Largest entry of Σ K_δ X_{γ−δ} − Σ M_δ X_ε Λ_ζ and of Φ0ᵀM0X_γ − I, γ by γ (N,), by loops.

    Relative to |K_δ||X_{γ−δ}| and |Φ0ᵀ||M0||X_γ|, which round-off is proportional to. x is scaled
    by ``span``, so that all variables weigh alike; where nothing depends on x^γ at all, relative to
    1e-5 |K_0||X_0|.
    """
    space = total_degree(len(x0), order)
    theta = pencil.theta_series(space, x0, pencil.to_program * span)
    found, pick = modes(pencil, x0[None], max(wanted)), np.array(wanted) - 1
    lam0, phi0 = found.lam[0, pick], found.phi[0][:, pick]
    series = expand_subspace(pencil, theta, space, lam0, phi0)
    K, M = (
        [pencil.sparse(weights @ theta[:, k]) for k in range(len(space))]
        for weights in (pencil.stiffness, pencil.mass)
    )
    members = [tuple(row) for row in space.indices.tolist()]
    place = {row: k for k, row in enumerate(members)}
    X, L = series.vectors, series.values
    pairs = [
        (a, b, place[c])
        for a, ra in enumerate(members)
        for b, rb in enumerate(members)
        if (c := tuple(i + j for i, j in zip(ra, rb, strict=True))) in place
    ]
    left, right, product = (np.zeros_like(X) for _ in range(3))
    size = np.zeros(len(members))
    for a, b, c in pairs:
        left[c] += K[a] @ X[b]
        product[c] += X[a] @ L[b]
        size[c] = max(size[c], (abs(K[a]) @ np.abs(X[b])).max())
    for a, b, c in pairs:
        right[c] += M[a] @ product[b]
    left_over = np.abs(left - right).max(axis=(1, 2)) / np.maximum(size, 1e-5 * size[0])
    border = phi0.T @ M[0] @ X
    border[0] -= np.eye(len(pick))
    largest = (np.abs(phi0).T @ abs(M[0]) @ np.abs(X)).max(axis=(1, 2))
    apart = np.abs(border).max(axis=(1, 2)) / np.maximum(largest, 1e-5 * largest[0])
    return np.maximum(left_over, apart)


def truncation(pencil: Pencil, e: Expansion, span: Floats, h: float) -> float:
    """Root mean square error of λ_1 at random places, both ways, at a distance h of ``span``."""
    rng = np.random.default_rng(5)
    d = rng.standard_normal((6, len(span)))
    d = np.vstack([d, -d]) / np.linalg.norm(d, axis=1).max() * span * h
    x = e.x0 + d
    q, y = np.split(x, [len(e.q0)], axis=1)
    true = eigenvalues(pencil, x, 1)
    return float(np.sqrt(np.mean((e.eigenvalues(q, y) / true - 1.0) ** 2)))


def slope(pencil: Pencil, e: Expansion, span: Floats, floor: float) -> float | None:
    """Slope of log error against log h, over two decades of the error.

    They end at 1e5 times round-off ``floor``, where that is over 1e-6 nearer to it: terms of higher
    order, and other modes that come near far outside, have died away there. None where the error is
    less over the whole box: nearly a polynomial of this order.
    """
    power, error, start = e.order + 1.0, truncation(pencil, e, span, 1.0), 1.0
    if error < 1e4 * floor:
        return None
    most = min(1e5 * floor, max(1e-6, 1e3 * floor))
    for _ in range(8):  # a guess from an error far above is a bad one
        if error < 2.0 * most and (error > 0.5 * most or start == 1.0):
            break
        start = min(1.0, start * (most / error) ** (1.0 / power))
        error = truncation(pencil, e, span, start)
    steps = start * 10.0 ** (-2.0 / power * np.array([0.0, 0.5, 1.0]))
    errors = [truncation(pencil, e, span, h) for h in steps.tolist()]
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def richardson(f: Callable[[float], Floats], h: float) -> Floats:
    """Even error terms h², h⁴, h⁶ of f(h) taken out."""
    rows = [f(h / 2**k) for k in range(4)]
    for k in range(1, 4):
        rows = [b + (b - a) / (4.0**k - 1.0) for a, b in itertools.pairwise(rows)]
    return rows[0]


def derivative(at: Callable[[Floats], Floats], along: Floats, centre: Floats) -> Floats:
    """∂^γ/γ! of a function from its values, ``along`` the units of γ (none, one or two)."""

    def even(h: float, d: Floats) -> Floats:
        return at(h * d) + at(-h * d)

    if len(along) == 0:
        return centre
    a, b = along[0], along[-1]
    if len(along) == 1:
        return richardson(lambda h: (at(h * a) - at(-h * a)) / (2 * h), 1.0)
    if (a == b).all():
        return richardson(lambda h: (even(h, a) - 2 * centre) / (2 * h**2), 1.0)
    return richardson(lambda h: (even(h, a + b) - even(h, a - b)) / (4 * h**2), 1.0)
