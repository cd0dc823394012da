"""The frequency up to which links keep their fixed-interface modes, and whether reducing pays.

The first trial is twice the highest frequency that matters; it is raised until the bound on the
truncation error fits. A model with fewer than half of the dofs pays: its dense blocks then cost
less than the sparse ones of the whole mechanism (benchmarks/craig_bampton.py).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.modal.adaptive.cheapest import Rung
from eigassign.modal.adaptive.mesh import ModesAt
from eigassign.modal.arguments import spread
from eigassign.modal.model import Model

Floats = NDArray[np.float64]
POSES = 30  # poses and designs at which it is judged; each costs an exact solve


@dataclass(frozen=True, eq=False, kw_only=True)
class ReductionChoice(Rung):
    """The frequency in Hz for each link, None where it stays whole; errors are (n_modes,)."""

    frequencies: Mapping[str, float | None]


def reductions(
    names: Sequence[str],
    whole: Model,
    build: Callable[[float], Model],
    x: Floats,
    modes_at: ModesAt,
) -> Iterator[ReductionChoice]:
    """Higher and higher frequencies with bounds on their truncation error at x (n, n_x).

    Last, where the model keeps more than half of its dofs, the links as they are in ``whole``.
    """
    x = spread(x, POSES)
    q, y = x[:, : len(whole.q_names)], x[:, len(whole.q_names) :]
    reasons: list[str] = []
    modes = modes_at(whole, x)
    highest = float(whole.frequencies(q[:1], y[:1], max(modes)).max())
    size = 0
    for frequency in 2.0 * highest * 1.5 ** np.arange(16):
        model = build(float(frequency))
        if model.reduced is None or model.n_dof > 0.5 * whole.n_dof:
            reasons.append(f"reduced to {frequency:.4g} Hz: {model.n_dof} of {whole.n_dof} dofs")
            break
        if model.n_dof == size:  # no mode in between
            continue
        size = model.n_dof
        error = model.truncation_error(q, y, modes).max(axis=0)
        worst = float(error.max())
        stated = f"truncation error at most {100 * worst:.2g} %" if worst < np.inf else "no bound"
        reasons.append(f"reduced to {frequency:.4g} Hz: {size} of {whole.n_dof} dofs, {stated}")
        frequencies = dict.fromkeys(names, float(frequency))
        yield ReductionChoice(error, tuple(reasons), frequencies=frequencies)
    reasons.append(f"not reduced, because it saves too little: {', '.join(names)}")
    nothing = np.zeros(len(modes))
    yield ReductionChoice(nothing, tuple(reasons), frequencies=dict.fromkeys(names))
