"""Everything left to ``auto``: elements, order, expansion points, basis; the cheapest that will do.

The accuracy asked for is shared: the mesh may use one half of it, the approximation the other, and
both are stated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import UsageError
from eigassign.modal.expansion_choice import ORDERS, ExpansionChoice, choose_expansion
from eigassign.modal.mesh_choice import Build, HasPencil, MeshChoice, choose_mesh

Floats = NDArray[np.float64]
MESH_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class Settled:
    """What was chosen. Errors are relative in frequency, the largest over samples and modes."""

    model: HasPencil
    mesh: MeshChoice
    expansion: ExpansionChoice
    mesh_error: float
    approximation_error: float
    reasons: tuple[str, ...]


def settle(
    build: Build,
    elements: Mapping[str, int | None],
    x: Floats,
    accuracy: float,
    modes: Sequence[int] = (1,),
    linear_in_y: bool = False,
    orders: Sequence[int] = ORDERS,
    start: Floats | None = None,
) -> Settled:
    """Choose for samples x (n, n_x) so that mesh and approximation together are ≤ ``accuracy``.

    ``elements`` gives each link's number of elements or None to choose it; ``build`` makes the
    model of a mesh; ``orders`` of one entry fixes the order, ``start`` (n_x,) the first expansion
    point. Raises AccuracyError with the reason where it cannot be met, UsageError for an accuracy
    that is none.
    """
    if not 0.0 < accuracy < 1.0:
        raise UsageError(f"accuracy {accuracy} is not within 0 to 1")
    mesh = choose_mesh(build, elements, x, MESH_SHARE * accuracy, modes)
    left = accuracy - float(mesh.error.max())
    model = build(mesh.elements)
    expansion = choose_expansion(model.pencil, x, left, modes, linear_in_y, orders, start)
    found = float(expansion.estimate.max())
    summary = (
        f"discretisation error {mesh.error.max():.1e}, approximation error {found:.1e}, "
        f"asked for {accuracy:.1e}"
    )
    return Settled(
        model=model,
        mesh=mesh,
        expansion=expansion,
        mesh_error=float(mesh.error.max()),
        approximation_error=found,
        reasons=(*mesh.reasons, *expansion.reasons, summary),
    )
