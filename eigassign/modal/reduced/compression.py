"""A smaller basis for a region that is known: what is not used in it is left out.

Modes z(x) of the whole reduced model are taken at samples of boxes around the expansion points.
Beside the modes that the error estimate counts on, V keeps the leading directions U of the others
(proper orthogonal decomposition in the mean stiffness K̄ of the samples),

    min Σ_s ‖z(x_s) − P z(x_s)‖²_K̄ ,

as few as move no frequency by more than the accuracy asked for at other samples of the same boxes.
The residual is that of the whole pencil, so the error estimate covers what was left out as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve_triangular

from eigassign.errors import UsageError
from eigassign.modal.reduced.basis import DEPENDENT, RitzBasis
from eigassign.modal.reduced.error_estimate import error_terms
from eigassign.modal.reduced.model import ReducedModel
from eigassign.modal.reduced.pencil import ritz_pairs, ritz_values

Floats = NDArray[np.float64]
ACCURACY = 1e-4
SAMPLES = 500  # to learn from; as many others to judge by
SHARE = 1.0 / 3.0  # of the accuracy, at the samples to judge by: others may be worse


def half_widths(span: tuple[ArrayLike, ArrayLike], n_q: int, n_y: int, accuracy: float) -> Floats:
    """``span`` as (n_x,), checked; raises UsageError."""
    if not 0.0 < accuracy < 1.0:
        raise UsageError(f"accuracy {accuracy} is not within 0 to 1")
    parts = [np.asarray(part, dtype=np.float64) for part in span]
    if [p.shape for p in parts] != [(n_q,), (n_y,)]:
        raise UsageError(f"span must be half-widths of q ({n_q},) and of y ({n_y},)")
    widths = np.concatenate(parts)
    if not (np.isfinite(widths) & (widths >= 0.0)).all():
        raise UsageError("span must be finite and not negative")
    return widths


def compressed(
    basis: RitzBasis, whole: ReducedModel, widths: Floats, accuracy: float
) -> ReducedModel:
    """``whole`` on as few vectors as serve ``accuracy``; itself where all are needed."""
    rng = np.random.default_rng(0)
    points, count = basis.points[:, None], max(SAMPLES // len(basis.points), 2)
    # denser towards the faces of the boxes, where errors are largest
    drawn = np.sin(np.pi * (rng.random((2, len(points), count, len(widths))) - 0.5))
    learnt, judged = (points + widths * drawn).reshape(2, -1, len(widths))
    directions, fixed = _directions(basis, whole, learnt)
    judges = [(K, M_c, ritz_values(K, M_c)) for K, M_c, _ in whole.matrices(judged)]
    low, high = fixed, directions.shape[1]
    while low < high:
        size = (low + high) // 2
        if largest_change(judges, directions[:, :size], basis.modes) <= SHARE * accuracy:
            high = size
        else:
            low = size + 1
    if high == whole.size:
        return whole
    return _on(basis, whole, np.linalg.qr(directions[:, :high])[0])


def _on(basis: RitzBasis, whole: ReducedModel, U: Floats) -> ReducedModel:
    """``whole`` on V U, U (k, r) orthonormal, from its own terms.

    Projecting the mesh on V U instead would lose digits: in V the columns are graded in size, and
    with them the round-off of terms that cancel.
    """
    (k, r), f = U.shape, whole.mass.shape[1] - whole.size
    wide = np.zeros((k + f, r + f))
    wide[:k, :r], wide[k:, r:] = U, np.eye(f)
    return replace(
        whole,
        stiffness=U.T @ whole.stiffness @ U,
        mass=wide.T @ whole.mass @ wide,
        certified=partial(error_terms, replace(basis, V=basis.V @ U)),
    )


def largest_change(
    judges: Sequence[tuple[Floats, Floats, Floats]], U: Floats, modes: tuple[int, ...]
) -> float:
    """Largest relative change of the frequencies of ``modes`` on U (k, r) alone."""
    wanted = np.array(modes) - 1
    worst = 0.0
    for K, M_c, mu in judges:
        smaller = ritz_values(U.T @ K @ U, U.T @ M_c @ U)
        worst = max(worst, float(np.sqrt(mu[:, wanted] / smaller[:, wanted]).max()) - 1.0)
    return worst


def _directions(basis: RitzBasis, whole: ReducedModel, x: Floats) -> tuple[Floats, int]:
    """V's coordinates (k, k) in the order of their use, and how many of them must stay."""
    found = [(K, ritz_pairs(K, M_c)[1]) for K, M_c, _ in whole.matrices(x)]
    root = np.linalg.cholesky(np.mean(np.concatenate([K for K, _ in found]), axis=0)).T
    U, size, _ = np.linalg.svd(root @ np.hstack(list(basis.shapes)), full_matrices=False)
    fixed = U[:, size > DEPENDENT * size[0]]  # an orthonormal basis of their span
    modes = np.concatenate([z[:, :, : basis.modes[-1]] for _, z in found])
    rest = root @ modes.transpose(1, 0, 2).reshape(len(root), -1)
    for _ in range(2):
        rest = rest - fixed @ (fixed.T @ rest)
    others = np.linalg.svd(rest, full_matrices=False)[0][:, : len(root) - fixed.shape[1]]
    return solve_triangular(root, np.hstack([fixed, others])), fixed.shape[1]
