"""Elements per link: as few as the accuracy needs, judged by what the mesh leaves out."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import AccuracyError
from eigassign.modal.adaptive.cheapest import Rung
from eigassign.modal.discretisation import discretisation_error
from eigassign.modal.exact.roundoff import rounding_error
from eigassign.modal.model import Model

Floats = NDArray[np.float64]
MAX_ELEMENTS = 256  # of a link; with more round-off, which grows as n⁴, is the larger error
MAX_MESHES = 8  # tried at most; the paper's arm needs three at most, down to 1e-6
Build = Callable[[Mapping[str, int]], Model]
ModesAt = Callable[[Model, Floats], tuple[int, ...]]  # that matter at x (n, n_x)


@dataclass(frozen=True, eq=False, kw_only=True)
class MeshChoice(Rung):
    """Elements per link, and by how much they raise frequencies at most, (n_modes,)."""

    elements: Mapping[str, int]


def meshes(
    build: Build,
    elements: Mapping[str, int | None],
    x: Floats,
    accuracy: float,
    modes_at: ModesAt = lambda _model, _x: (1,),
) -> Iterator[MeshChoice]:
    """Elements for the links that have None, the others kept, more and more; their error at x.

    It is that of the modes that `modes_at` names, which may depend on the mesh. From one mesh to
    the next there are as many more as ``accuracy`` is thought to need.

    Raises AccuracyError where `MAX_ELEMENTS` do not suffice or round-off is in the way.
    """
    free = [name for name, n in elements.items() if n is None]
    now = {name: n or 2 for name, n in elements.items()}
    reasons: list[str] = []
    before: dict[str, tuple[int, float]] = {}
    for _ in range(MAX_MESHES):
        model = build(now)
        modes = modes_at(model, x)
        if (lost := rounding_error(model.pencil, x[0], max(modes))) > accuracy:
            raise AccuracyError(
                f"round-off is {lost:.1e} with {_shown(now)} elements, above the accuracy "
                f"{accuracy:.1e}, and a finer mesh makes it larger: ask for less"
            )
        if model.meshed is None:
            yield MeshChoice(np.zeros(len(modes)), (), elements=now)
            return
        found = discretisation_error(model.meshed, x, modes, refinements=model.refinements)
        error = found.total.max(axis=0)
        reasons.append(f"{_shown(now)} elements: {_said(error, modes, model)}")
        yield MeshChoice(error, tuple(reasons), elements=now)
        if not free:
            break
        alone = {name: (now[name], float(found.links[name].max())) for name in free}
        now, before = _refined(now, alone, before, accuracy), alone
    worst = max(found.links, key=lambda name: float(found.links[name].max()))
    raise AccuracyError(
        f"the mesh misses the accuracy {accuracy:.1e}, with {reasons[-1]}: give more elements to "
        f"{worst}, which has most of the error"
    )


def _refined(
    now: Mapping[str, int],
    alone: Mapping[str, tuple[int, float]],
    before: Mapping[str, tuple[int, float]],
    accuracy: float,
) -> dict[str, int]:
    """More elements where the links alone err most: of each their number and its error.

    As many as the fourth-order law predicts, or, where the step from ``before`` gained less, as its
    own order does: stretch and shear strain converge with the square.
    """
    share = accuracy / len(alone)
    after = dict(now)
    for name, (n, error) in alone.items():
        if not np.isfinite(error):
            after[name] = min(2 * n, MAX_ELEMENTS)
        elif error > share:
            order, (few, more) = 4.0, before.get(name, (n, error))
            if few < n and np.isfinite(more):
                order = float(np.clip(np.log(more / error) / np.log(n / few), 1.0, 4.0))
            predicted = int(np.ceil(n * min((error / share) ** (1.0 / order), 8.0)))
            after[name] = min(max(predicted, n + 1), MAX_ELEMENTS)
    if after == dict(now):
        after = {name: n + (name in alone) for name, n in now.items()}
    return after


def _shown(elements: Mapping[str, int]) -> str:
    counts = set(elements.values())
    if len(counts) == 1:
        return str(counts.pop())
    return ", ".join(f"{name} {n}" for name, n in elements.items())


def _said(error: Floats, modes: Sequence[int], model: Model) -> str:
    about = "at most" if model.pencil.weight is None else "about"
    return ", ".join(
        f"mode {mode} {about} {100.0 * worst:.2g} % too high"
        if np.isfinite(worst)
        else f"mode {mode} not resolved"
        for mode, worst in zip(modes, error, strict=True)
    )
