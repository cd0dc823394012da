"""The multivariate Taylor expansion of eigenvalues about x0 = (q0, y0) (eqs. (4)-(9)).

The expansion is carried out in local variables w: the relative joint coordinates and design
parameters on which anything depends, with w = V (x − x0). A coordinate that nothing depends on is
dropped by construction; coefficients over (q, y) follow by substituting V (x − x0).

How far off it is only exact solves say.

Of an expansion that is what takes long to compute: coefficients and vectors. What a key is made of
becomes a tree in JSON, whose leaves are the next so many values of two arrays.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from eigassign.arrays import Floats, Ints
from eigassign.brief import Brief, counted, cut, of_modes
from eigassign.errors import UsageError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.arguments import mode_numbers, point, samples, whole_within
from eigassign.modal.exact.solver import CLUSTER_GAP
from eigassign.modal.taylor.rayleigh import eigenvalue_series
from eigassign.modal.taylor.recursion import (
    LocalSpace,
    local_space,
    substitute,
    taylor_vectors,
    vector_set,
)
from eigassign.process import one_thread
from eigassign.series.algebra import Polynomials, monomials, polynomials
from eigassign.series.multi_index import LowerSet, frozen

MAX_ORDER = 20


@dataclass(frozen=True, eq=False, repr=False)
class Cluster(Brief):
    """Λ(w) and X(w) of the neighbouring ``modes``; r = 1 is a single eigenvalue."""

    modes: tuple[int, ...]
    coefficients: Floats  # Λ (r, r, N), rad²/s² over units of w
    vectors: Floats  # X (N_H, n_dof, r)


@dataclass(frozen=True, eq=False)
class Expansion:
    """Taylor expansion of the eigenvalues of ``modes`` about (q0, y0), eqs. (4)-(9); immutable.

        λ(x) ≈ Σ_γ λ_γ (x − x0)^γ,  x = (q, y), q in rad or m, y in SI units

    ``frequencies(q, y)`` (n, n_modes) in Hz, ``eigenvalues(q, y)`` in rad²/s², with ∂λ/∂x
    ``slopes(q, y)``, at y0 the l_0 and l of eq. (9); ``indices`` γ (N, n_q + n_y),
    ``coefficients`` λ_γ (n_modes, N). Neighbouring modes are expanded together, as the matrices of
    ``clusters``.
    """

    modes: tuple[int, ...]
    clusters: tuple[Cluster, ...]
    q0: Floats
    y0: Floats
    space: LowerSet  # over w
    directions: Floats  # V (n_w, n_x): w = V (x − x0)
    n_linear: int  # the last n_linear of w enter at most linearly, 0 for a full expansion
    vector_space: LowerSet
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        at = ", ".join(f"{value:.6g}" for value in self.x0)
        return cut(
            f"<Expansion of λ of {of_modes(self.modes)}: order {self.order}, {len(self.space)} "
            f"coefficients in {counted(self.space.n_variables, 'variable')}, about (q, y) = ({at})>"
        )

    @one_thread
    def eigenvalues(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """λ (n_samples, n_modes) in rad²/s²; q (n_samples, n_q) or (n_q,), y likewise."""
        w = self.local(q, y)
        return np.hstack(
            [
                _eigenvalues(c, made(w).reshape(len(w), *c.coefficients.shape[:2]), self.modes)
                for c, made in zip(self.clusters, self._prepared, strict=True)
            ]
        )

    def local(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """The local variables w (n_samples, n_w)."""
        return (samples(q, y, len(self.q0), len(self.y0)) - self.x0) @ self.directions.T

    @cached_property
    def _prepared(self) -> tuple[Polynomials, ...]:
        """The entries of every cluster's matrix, made ready: quicker even for one sample."""
        n = len(self.space)
        return tuple(polynomials(self.space, c.coefficients.reshape(-1, n)) for c in self.clusters)

    def frequencies(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """f = √λ/2π in Hz, (n_samples, n_modes); NaN where the polynomial is negative."""
        with np.errstate(invalid="ignore"):
            return np.asarray(np.sqrt(self.eigenvalues(q, y)) / (2.0 * np.pi))

    def slopes(self, q: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
        """λ (n_samples, n_modes) and ∂λ/∂x (n_samples, n_modes, n_x) over units of x."""
        lam, powers = self.eigenvalues(q, y), monomials(self.space, self.local(q, y))
        parts = [_slopes(c, self.space, powers, self.modes) for c in self.clusters]
        return lam, np.concatenate(parts, axis=1) @ self.directions

    @property
    def x0(self) -> Floats:
        """(q0, y0)."""
        return np.concatenate([self.q0, self.y0])

    @property
    def order(self) -> int:
        """Total degree p of the expansion."""
        return self.space.order

    @property
    def indices(self) -> NDArray[np.int64]:
        """Multi-indices γ (n_coefficients, n_q + n_y) over (q, y)."""
        return self._over_x[0].indices

    @property
    def coefficients(self) -> Floats:
        """λ_γ = ∂^γ λ(x0)/γ! (n_modes, n_coefficients), rad²/s² over units of x.

        Raises UsageError for clusters of several modes: a single eigenvalue has no series there;
        ``clusters`` has the series of the small matrix whose eigenvalues they are.
        """
        together = [c.modes for c in self.clusters if len(c.modes) > 1]
        if together:
            raise UsageError(f"modes {together[0]} are expanded as a cluster: see .clusters")
        return self._over_x[1]

    @cached_property
    def _over_x(self) -> tuple[LowerSet, Floats]:
        singles = [c.coefficients[0, 0] for c in self.clusters if len(c.modes) == 1]
        stacked = np.array(singles).reshape(-1, len(self.space))
        x_space, values = substitute(
            self.space, stacked, self.directions, len(self.q0), self.n_linear
        )
        return x_space, frozen(values)


def _eigenvalues(cluster: Cluster, matrices: Floats, wanted: tuple[int, ...]) -> Floats:
    """λ of the wanted modes from the small matrices (n, r, r)."""
    if len(cluster.modes) == 1:
        return matrices[:, 0]
    columns = [k for k, mode in enumerate(cluster.modes) if mode in wanted]
    return np.asarray(np.linalg.eigvalsh(matrices)[:, columns])


def _slopes(cluster: Cluster, space: LowerSet, powers: Floats, wanted: tuple[int, ...]) -> Floats:
    """∂λ/∂w (n, n_modes, n_w) = vᵀ (∂Λ/∂w) v with the eigenvectors v of Λ, from w^γ (n, N)."""
    value = np.tensordot(powers, cluster.coefficients, axes=(1, 2))
    columns = [k for k, mode in enumerate(cluster.modes) if mode in wanted]
    v = np.linalg.eigh(value)[1][:, :, columns]
    slopes = np.empty((len(v), len(columns), space.n_variables))
    for j in range(space.n_variables):  # ∂w^γ/∂w_j = γ_j w^(γ − e_j)
        there = np.flatnonzero(space.indices[:, j])
        lower = space.indices[there].copy()
        times = cluster.coefficients[:, :, there] * lower[:, j]
        lower[:, j] -= 1
        rates = np.tensordot(powers[:, space.find(lower)], times, axes=(1, 2))
        slopes[:, :, j] = np.einsum("nik,nij,njk->nk", v, rates, v)
    return slopes


def expand(
    pencil: Pencil,
    q0: ArrayLike,
    y0: ArrayLike,
    modes: Sequence[int] = (1,),
    order: int = 4,
    linear_in_y: bool = False,
    space: LowerSet | None = None,
    vector_order: int | None = None,
    cluster_gap: float = CLUSTER_GAP,
    known: Sequence[Cluster] | None = None,
) -> Expansion:
    """Expand the eigenvalues of ``modes`` (1 is the lowest elastic one) to total ``order``.

    ``linear_in_y`` keeps |β| ≤ 1, the terms of eqs. (7)-(9). ``space`` is any other lower set over
    (q, y). Eigenvectors are expanded to half the order, which suffices (2m + 1), or to
    ``vector_order``. Modes closer than ``cluster_gap`` (relative in λ) are expanded together.
    ``known`` clusters of the same expansion are not computed again.
    Raises UsageError for impossible arguments, and for known series of other shapes.
    """
    wanted = mode_numbers(modes)
    order = whole_within(order, "order", 1, MAX_ORDER)
    if vector_order is not None:
        vector_order = whole_within(vector_order, "vector_order", 0, MAX_ORDER)
    if not (isinstance(cluster_gap, int | float | np.number) and 0.0 <= cluster_gap < np.inf):
        raise UsageError(f"cluster_gap must be a number of at least 0, not {cluster_gap!r}")
    x0 = point(q0, y0, pencil.n_q, pencil.to_program.shape[1] - pencil.n_q)
    local = local_space(pencil, order, linear_in_y, space)
    half = vector_set(local.space, local.n_linear, vector_order)[0]
    if known is None:
        found = taylor_vectors(pencil, x0, wanted, local, vector_order, cluster_gap)
        known = [
            Cluster(g, eigenvalue_series(pencil, found.theta, local.space, half, X), X)
            for g, X in zip(found.groups, found.vectors, strict=True)
        ]
    for one in known:
        r = len(one.modes)
        shapes = (r, r, len(local.space)), (len(half), pencil.n_dof, r)
        if (one.coefficients.shape, one.vectors.shape) != shapes:
            raise UsageError("these series are not of this expansion: their shapes do not fit")
    groups = tuple(one.modes for one in known)
    if not set(wanted) <= {mode for group in groups for mode in group}:
        raise UsageError("these series are not of this expansion: a mode is missing")
    return Expansion(
        modes=tuple(m for g in groups for m in g if m in wanted),
        clusters=tuple(replace(c, coefficients=frozen(c.coefficients)) for c in known),
        q0=frozen(x0[: pencil.n_q]),
        y0=frozen(x0[pencil.n_q :]),
        space=local.space,
        directions=frozen(local.directions),
        n_linear=local.n_linear,
        vector_space=half,
        notes=_notes(groups, local, pencil),
    )


def _notes(groups: Sequence[tuple[int, ...]], local: LocalSpace, pencil: Pencil) -> tuple[str, ...]:
    """Sentences on modes expanded together and on variables dropped."""
    lines = [
        f"modes {g[0]}-{g[-1]} lie close together and are expanded as one cluster"
        for g in groups
        if len(g) > 1
    ]
    idle = len(pencil.active) - np.count_nonzero(pencil.active)
    if idle:
        which = "1 variable is" if idle == 1 else f"{idle} variables are"
        them = "it" if idle == 1 else "them"
        lines.append(f"{which} left out of the expansion: no frequency depends on {them}")
    return tuple(lines)


# --- Several expansions about points along a trajectory: each pose belongs to the nearest one


@dataclass(frozen=True, eq=False)
class NearestExpansion:
    """Expansions of the same modes at the same design, of which the nearest one is evaluated.

    Distances are |V (q − q0_k)| in the variables of the series, so that coordinates on which
    nothing depends do not count.
    """

    parts: tuple[Expansion, ...]

    def __repr__(self) -> str:
        return f"<NearestExpansion of {of_modes(self.modes)}: {len(self.parts)} expansion points>"

    @property
    def modes(self) -> tuple[int, ...]:
        """The modes expanded, in the order of the columns."""
        return self.parts[0].modes

    def owner(self, q: ArrayLike) -> Ints:
        """Index of the part nearest to each of q (n_samples, n_q) or (n_q,), (n_samples,)."""
        rows = np.atleast_2d(np.asarray(q, dtype=np.float64))
        V = self.parts[0].directions[:, : len(self.parts[0].q0)]
        away = [np.square((rows - part.q0) @ V.T).sum(axis=1) for part in self.parts]
        return np.asarray(np.argmin(away, axis=0), dtype=np.intp)

    def eigenvalues(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """λ (n_samples, n_modes) in rad²/s²; see `Expansion.eigenvalues`."""
        return self.pick(q, [part.eigenvalues(q, y) for part in self.parts])

    def frequencies(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """f (n_samples, n_modes) in Hz; see `Expansion.frequencies`."""
        return self.pick(q, [part.frequencies(q, y) for part in self.parts])

    def slopes(self, q: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
        """λ and ∂λ/∂x; see `Expansion.slopes`."""
        values, slopes = zip(*(part.slopes(q, y) for part in self.parts), strict=True)
        return self.pick(q, values), self.pick(q, slopes)

    def pick(self, q: ArrayLike, values: Sequence[Floats]) -> Floats:
        """The nearest part's value at each sample, of values (n_samples, …) for each part."""
        if len(values) == 1:
            return values[0]
        owner = np.broadcast_to(self.owner(q), len(values[0]))  # one pose and many designs
        return np.asarray(np.array(values)[owner, np.arange(len(owner))])


Array = NDArray[Any]
ALGORITHM = "expansion 4"  # raise it whenever the numbers an expansion is made of may change


# --- Expansions: the clusters of each, one after the other


def expansion_arrays(*expansions: Expansion) -> dict[str, Array]:
    """Modes, coefficients and vectors of the clusters of some expansions."""
    return {
        f"{each.name}_{k}_{i}": np.asarray(getattr(cluster, each.name))
        for k, expansion in enumerate(expansions)
        for i, cluster in enumerate(expansion.clusters)
        for each in fields(Cluster)
    }


def stored_series(arrays: Mapping[str, Array], k: int) -> list[Cluster]:
    """The clusters of expansion k of those that `expansion_arrays` took apart.

    Raises UsageError where arrays are missing, or their numbers are not finite.
    """
    found: list[Cluster] = []
    while f"modes_{k}_{len(found)}" in arrays:
        parts = [arrays.get(f"{each.name}_{k}_{len(found)}") for each in fields(Cluster)]
        if any(part is None or not np.isfinite(part).all() for part in parts):
            raise UsageError("these arrays are not expansions")
        modes, coefficients, vectors = (np.asarray(part) for part in parts)
        found.append(Cluster(tuple(modes.ravel().tolist()), coefficients, vectors))
    return found


# --- Frozen objects as a tree, and its leaves in two arrays


def tree_arrays(thing: Any) -> dict[str, Array]:
    """Data classes, tuples, arrays, text and numbers as ``tree``, ``numbers`` and ``integers``.

    Two things with equal arrays are equal bit for bit. Raises UsageError for any other type.
    """
    leaves: dict[str, list[Array]] = {"f": [], "i": []}
    text = json.dumps(_tree(thing, leaves), allow_nan=False).encode()
    return {
        "tree": np.frombuffer(text, dtype=np.uint8),
        "numbers": np.concatenate([np.zeros(0), *leaves["f"]]),
        "integers": np.concatenate([np.zeros(0, np.int64), *leaves["i"]], dtype=np.int64),
    }


def _tree(thing: Any, leaves: dict[str, list[Array]]) -> Any:
    if thing is None or isinstance(thing, (bool, int, float, str)):
        return thing
    if isinstance(thing, tuple):
        return {"tuple": [_tree(part, leaves) for part in thing]}
    if isinstance(thing, sparse.csr_array):
        csr = (thing.data, thing.indices, thing.indptr)
        return {"csr": thing.shape, "parts": [_tree(part, leaves) for part in csr]}
    if isinstance(thing, np.ndarray) and thing.dtype.kind in "fib" and thing.itemsize <= 8:
        leaves["f" if thing.dtype.kind == "f" else "i"].append(thing.ravel())
        return {"array": thing.dtype.kind, "shape": thing.shape}
    if is_dataclass(thing):
        own = (f.name for f in fields(thing) if f.compare)
        members = {name: _tree(getattr(thing, name), leaves) for name in own}
        return {"class": type(thing).__name__, "fields": members}
    raise UsageError(f"a {type(thing).__name__} cannot be stored")
