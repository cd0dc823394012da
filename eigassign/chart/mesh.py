"""Elements per link against discretisation error: the limit that the frequencies converge to."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.chart.results import MeshRow, Timing
from eigassign.chart.timing import Patience, measure
from eigassign.modal.model import Model
from eigassign.study.build import build_model

Floats = NDArray[np.float64]
RATE = 16.0  # a frequency's error falls so when cubic beam elements are halved: h⁴


@dataclass(frozen=True)
class Mesh:
    """A case with ``factor`` times the elements in every link, ``elements`` in all."""

    factor: float
    elements: int
    file: CaseFile


def refined(file: CaseFile, factor: float) -> tuple[CaseFile, tuple[int, ...]]:
    """The same case with ``factor`` times the elements in every beam, and their numbers.

    A beam keeps at least one. Every number of elements must be given or settled.
    """
    counts: list[int] = []

    def scaled(part: Any) -> Any:
        if hasattr(part, "elements"):
            counts.append(max(1, round(part.elements * factor)))
            return part.model_copy(update={"elements": counts[-1]})
        if hasattr(part, "beams"):
            beams = {name: scaled(beam) for name, beam in part.beams.items()}
            return part.model_copy(update={"beams": beams})
        return part

    links = {name: scaled(link) for name, link in file.mechanism.links.items()}
    mechanism = file.mechanism.model_copy(update={"links": links})
    return replace(file, mechanism=mechanism), tuple(counts)


def meshes(file: CaseFile, factors: Sequence[float]) -> Iterator[Mesh]:
    """From coarse to fine, each mesh once; none where no link has elements."""
    seen: set[tuple[int, ...]] = set()
    for factor in sorted(factors):
        finer, counts = refined(file, factor)
        if counts and counts not in seen:
            seen.add(counts)
            yield Mesh(factor, sum(counts), finer)


def chart_meshes(
    listed: Sequence[Mesh],
    x: Floats,
    modes: Sequence[int],
    most_dof: int,
    patience: Patience,
) -> tuple[MeshRow, ...]:
    """One row for each mesh up to ``most_dof``, at the points x (n, n_x).

    The limit is extrapolated from the two finest, f + (f − f_coarser)/15, for errors fall like h⁴;
    the finest row's own error is therefore an estimate. Fewer than two meshes: no rows.
    """
    solved: list[tuple[Mesh, int, Floats, Timing]] = []
    for mesh in listed:
        model = build_model(mesh.file)
        if model.n_dof > most_dof:
            break
        hz, spent = measure(partial(_frequencies, model, x, modes), patience)
        solved.append((mesh, model.n_dof, hz, spent.times(1.0 / len(x))))
    if len(solved) < 2:
        return ()
    finest, coarser = solved[-1][2], solved[-2][2]
    limit = finest + (finest - coarser) / (RATE - 1.0)
    worst = [float(np.abs(hz - limit).max()) for _, _, hz, _ in solved]
    factors = [mesh.factor for mesh, *_ in solved]
    return tuple(
        MeshRow(
            mesh.factor,
            mesh.elements,
            n_dof,
            worst[k],
            float(np.abs(hz / limit - 1.0).max()),
            _order(factors[k : k + 2], worst[k : k + 2]) if k + 2 < len(solved) else None,
            spent,
        )
        for k, (mesh, n_dof, hz, spent) in enumerate(solved)
    )


def _frequencies(model: Model, x: Floats, modes: Sequence[int]) -> Floats:
    n_q = len(model.q_names)
    return model.frequencies(x[:, :n_q], x[:, n_q:], max(modes))[:, np.array(modes) - 1]


def _order(factors: Sequence[float], worst: Sequence[float]) -> float | None:
    """log(error ratio)/log(mesh ratio) of two meshes; None where one has no error."""
    if min(worst) <= 0.0:
        return None
    return float(np.log(worst[0] / worst[1]) / np.log(factors[1] / factors[0]))
