"""The mesh axis: elements per link doubled, against the limit the frequencies converge to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.chart.results import MeshRow, Timing
from eigassign.chart.timing import Patience, measure
from eigassign.modal.model import Model

Floats = NDArray[np.float64]
RATE = 16.0  # a frequency's error falls so when cubic beam elements are halved: h⁴


@dataclass(frozen=True)
class Mesh:
    """The case's mechanism with ``factor`` times the elements in every link."""

    factor: float
    elements: int
    build: Callable[[], Model]


@dataclass(frozen=True)
class _Solved:
    mesh: Mesh
    n_dof: int
    hz: Floats  # (n, n_modes)
    solve: Timing


def mesh_axis(
    meshes: Sequence[Mesh], x: Floats, modes: Sequence[int], most_dof: int, patience: Patience
) -> tuple[MeshRow, ...]:
    """One row for each mesh up to ``most_dof``, at the points x (n, n_x).

    The limit is extrapolated from the two finest, f + (f − f_coarser)/15, for errors fall like h⁴;
    the finest row's own error is therefore an estimate. Fewer than two meshes: no rows.
    """
    solved: list[_Solved] = []
    for mesh in sorted(meshes, key=lambda m: m.factor):
        model = mesh.build()
        if model.n_dof > most_dof:
            break
        solved.append(_solve(mesh, model, x, modes, patience))
    if len(solved) < 2:
        return ()
    limit = solved[-1].hz + (solved[-1].hz - solved[-2].hz) / (RATE - 1.0)
    worst = [float(np.abs(s.hz - limit).max()) for s in solved]
    return tuple(
        MeshRow(
            s.mesh.factor,
            s.mesh.elements,
            s.n_dof,
            worst[k],
            float(np.abs(s.hz / limit - 1.0).max()),
            _order(solved, worst, k),
            s.solve,
        )
        for k, s in enumerate(solved)
    )


def _solve(
    mesh: Mesh, model: Model, x: Floats, modes: Sequence[int], patience: Patience
) -> _Solved:
    n_q, pick = len(model.q_names), np.array(modes) - 1
    hz, spent = measure(lambda: model.frequencies(x[:, :n_q], x[:, n_q:], max(modes)), patience)
    return _Solved(mesh, model.n_dof, hz[:, pick], spent.times(1.0 / len(x)))


def _order(solved: Sequence[_Solved], worst: Sequence[float], k: int) -> float | None:
    """log(error ratio)/log(mesh ratio) to the next finer mesh; none beside the extrapolated one."""
    if k + 2 >= len(solved) or min(worst[k], worst[k + 1]) <= 0.0:
        return None
    ratio = solved[k + 1].mesh.factor / solved[k].mesh.factor
    return float(np.log(worst[k] / worst[k + 1]) / np.log(ratio))
