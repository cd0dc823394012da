"""Elements per link: as few as the accuracy needs, judged by a mesh twice as fine.

Halving the elements changes a frequency by the factor 1 + Δ. With an error that falls at least as
h² (axial; bending falls as h⁴) at most 4/3 |Δ| of it is left (Richardson).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import AccuracyError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.arguments import spread
from eigassign.modal.exact.roundoff import rounding_error
from eigassign.modal.exact.solver import eigenvalues

Floats = NDArray[np.float64]
START = 2  # elements of a link at first
MAX_ELEMENTS = 256  # of a link; with more round-off, which grows as n⁴, is the larger error
MAX_MESHES = 8  # tried at most; the paper's arm needs three at most, down to 1e-6
POSES = 9  # samples at which meshes are compared; each costs exact solves of every mesh
RICHARDSON = 4.0 / 3.0


class HasPencil(Protocol):
    """A model of which only the pencil counts."""

    @property
    def pencil(self) -> Pencil:
        """The affine pencil."""


Build = Callable[[Mapping[str, int]], HasPencil]


@dataclass(frozen=True, eq=False)
class MeshChoice:
    """Elements per link, the discretisation error that they leave, and why these."""

    elements: Mapping[str, int]
    error: Floats  # (n_modes,): estimated relative error in frequency, largest over the samples
    reasons: tuple[str, ...]


def mesh_error(
    build: Build, elements: Mapping[str, int], x: Floats, modes: Sequence[int]
) -> Floats:
    """Estimated discretisation error (n_samples, n_modes), relative in frequency."""
    f = _frequencies(build, elements, x, modes)
    return RICHARDSON * _change(f, build, _doubled(elements), x, modes)


def choose_mesh(
    build: Build,
    elements: Mapping[str, int | None],
    x: Floats,
    accuracy: float,
    modes: Sequence[int] = (1,),
) -> MeshChoice:
    """Elements for the links that have None, the others kept; error ≤ ``accuracy`` at x (n, n_x).

    Raises AccuracyError where `MAX_ELEMENTS` do not suffice or round-off is in the way.
    """
    free = [name for name, n in elements.items() if n is None]
    now = {name: START if n is None else n for name, n in elements.items()}
    x = spread(x, POSES)
    reasons: list[str] = []
    for _ in range(MAX_MESHES):
        f = _frequencies(build, now, x, modes)
        change = _change(f, build, _doubled(now), x, modes)
        error = RICHARDSON * change.max(axis=0)
        reasons.append(_line(now, change, modes))
        if error.max() <= accuracy:
            return MeshChoice(dict(now), error, tuple(reasons))
        if not free:
            break
        now = _refined(build, now, free, f, x, modes, accuracy)
        lost = rounding_error(build(now).pencil, x[0], max(modes))
        if lost > accuracy:
            raise AccuracyError(
                f"with {_shown(now)} elements round-off is {lost:.1e}, above the {accuracy:.1e} "
                "that is asked for: a finer mesh makes it worse"
            )
    raise AccuracyError(
        f"the mesh leaves {error.max():.1e} where {accuracy:.1e} is asked for: {reasons[-1]}"
    )


def _refined(
    build: Build,
    now: Mapping[str, int],
    free: Sequence[str],
    f: Floats,
    x: Floats,
    modes: Sequence[int],
    accuracy: float,
) -> dict[str, int]:
    """More elements where doubling them alone matters, as many as the fourth-order law predicts."""
    share = accuracy / len(free)
    after = dict(now)
    for name in free:
        alone = {**now, name: 2 * now[name]}
        error = RICHARDSON * float(_change(f, build, alone, x, modes).max())
        if error > share:
            predicted = int(np.ceil(now[name] * (error / share) ** 0.25))
            after[name] = min(max(predicted, now[name] + 1), MAX_ELEMENTS)
    if after == dict(now):
        after = {name: n + (name in free) for name, n in now.items()}
    return after


def _frequencies(
    build: Build, elements: Mapping[str, int], x: Floats, modes: Sequence[int]
) -> Floats:
    pencil = build(elements).pencil
    pick = np.array(modes) - 1
    return np.asarray(np.sqrt(eigenvalues(pencil, x, max(modes))[:, pick]) / (2.0 * np.pi))


def _doubled(elements: Mapping[str, int]) -> dict[str, int]:
    return {name: 2 * n for name, n in elements.items()}


def _change(
    f: Floats, build: Build, elements: Mapping[str, int], x: Floats, modes: Sequence[int]
) -> Floats:
    """|f / f of ``elements`` − 1|, (n_samples, n_modes)."""
    finer = _frequencies(build, elements, x, modes)
    return np.asarray(np.abs(f / finer - 1.0))


def _shown(elements: Mapping[str, int]) -> str:
    counts = set(elements.values())
    if len(counts) == 1:
        return str(counts.pop())
    return ", ".join(f"{name} {n}" for name, n in elements.items())


def _line(elements: Mapping[str, int], change: Floats, modes: Sequence[int]) -> str:
    each = ", ".join(
        f"mode {mode} moves {percent:.2g} %"
        for mode, percent in zip(modes, 100.0 * change.max(axis=0), strict=True)
    )
    counts = set(elements.values())
    twice = f"with {2 * counts.pop()}" if len(counts) == 1 else "with twice as many"
    return f"{_shown(elements)} elements: {each} {twice}"
