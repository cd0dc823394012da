"""Expansion coefficients as files for other programs: JSON and HDF5 with the same content."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.hdf5 import pack
from eigassign.modal.expansion import Expansion
from eigassign.output.documents import dumps
from eigassign.study.scene import Scene

Array = NDArray[Any]


def coefficient_files(scene: Scene, linear_only: bool) -> dict[str, bytes]:
    """coefficients.json and coefficients.h5 of a scene's expansions.

    Names are those of the Python face. For ``linearised`` and, unless ``linear_only``, ``full``:
    ``indices`` (n_coefficients, n_q + n_y) and ``coefficients`` (n_modes, n_coefficients) with
    λ = Σ_γ λ_γ (x − x0)^γ in rad²/s², x = (q, y) in SI units; of modes that are expanded together
    ``cluster_<k>_coefficients`` (r, r, N) over w = ``directions`` (x − x0) with ``local_indices``.
    """
    expansions = scene.expansions
    tables = {}
    each = zip(expansions.linears.parts, expansions.fulls.parts, strict=True)
    for k, (linear, full) in enumerate(each, 1):
        where = f"_at_point_{k}" if k > 1 else ""
        tables[f"linearised{where}"] = _table(linear)
        if not linear_only:
            tables[f"full{where}"] = _table(full)
    names = [*scene.model.q_names, *scene.model.y_names]
    point = {"q0": expansions.full.q0, "y0": expansions.full.y0}
    document = {
        "case": {"title": scene.file.title, "sha256": scene.file.sha256},
        "x_names": names,
        **point,
        **tables,
    }
    flat = {f"{part}_{name}": a for part, table in tables.items() for name, a in table.items()}
    meta = {"case": scene.file.title, "sha256": scene.file.sha256, "x_names": ", ".join(names)}
    return {
        "coefficients.json": (dumps(document) + "\n").encode(),
        "coefficients.h5": pack("coefficients", {**point, **flat}, meta),
    }


def _table(expansion: Expansion) -> dict[str, Array]:
    """The arrays of an expansion, by the names of the Python face."""
    modes = {
        "modes": np.array(expansion.modes),
        "order": np.array(expansion.order),
        "q0": expansion.q0,
        "y0": expansion.y0,
    }
    if all(len(cluster.modes) == 1 for cluster in expansion.clusters):
        return {**modes, "indices": expansion.indices, "coefficients": expansion.coefficients}
    series: dict[str, Array] = {}
    for k, cluster in enumerate(expansion.clusters):
        series[f"cluster_{k}_modes"] = np.array(cluster.modes)
        series[f"cluster_{k}_coefficients"] = cluster.coefficients
    local = {"local_indices": expansion.space.indices, "directions": expansion.directions}
    return {**modes, **local, **series}
