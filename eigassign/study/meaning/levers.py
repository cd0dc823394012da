"""What a mode is, and what would help: where its energy is, and what each property does to it.

All properties that the mechanism is made of and that are not 0 become parameters of a model of
their own, whose exact slopes say by how many per cent a frequency rises for a per cent more of
each, the coordinates as they are. Those of the design have slopes already.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import EigassignError
from eigassign.modal.exact.solver import modes
from eigassign.modal.model import Model
from eigassign.study.build import build_model
from eigassign.study.results import EffectRow, ModeAnatomy, PartRow

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
FEW = 21  # samples of a trajectory that modes are looked at


def anatomies(
    model: Model, q: Floats, y: Floats, numbers: Mapping[str, Ints]
) -> Iterator[ModeAnatomy]:
    """Yield each mode's energies and what properties do to it, at poses q (n, n_q) of a design y.

    ``numbers`` (n,) are by the mode's name those that it has there, 0 where it does not matter.
    Raises EigassignError where the model has no such modes.
    """
    count, x = max(int(own.max()) for own in numbers.values()), model.x(q, y)
    found = modes(model.pencil, x, count)
    strain, kinetic = model.energies.shares(model.pencil, x, found.lam, found.phi)
    effects = dict(_effects(model, q, y, count))
    for name, own in numbers.items():
        there = np.flatnonzero(own)

        def row(values: Floats, k: Ints = there, mode: Ints = own) -> tuple[float, float]:
            along = values[k, mode[k] - 1]
            return float(along.mean()), float(along[np.abs(along).argmax()])

        none = np.zeros_like(found.lam)
        parts = tuple(
            PartRow(name, key, *row(strain.get(key, none)), *row(kinetic.get(key, none)))
            for key in dict.fromkeys((*strain, *kinetic))
        )
        rows = [EffectRow(name, path, *row(values)) for path, values in effects.items()]
        # to six digits, so that round-off does not decide which of two alike stands first
        rows.sort(key=lambda one: -float(f"{abs(one.percent_per_percent):.5e}"))
        yield ModeAnatomy(name, parts, tuple(rows))


def _effects(model: Model, q: Floats, y: Floats, count: int) -> Iterator[tuple[str, Floats]]:
    """Yield (p/f) ∂f/∂p (n, count) of each property p that is no design parameter, by its path.

    Without lengths, places and angles where loops cannot follow them.
    """
    case = model.poses.case
    try:
        every = case.with_design(y).with_every_property()
        made = build_model(every)
    except EigassignError:
        every = case.with_design(y).with_every_property(places=False)
        made = build_model(every)
    p = np.array([every.value_at(path) for path in made.y_names])
    x = made.x(q, p)
    wanted = np.arange(x.shape[1]) >= made.pencil.n_joints
    lam, slopes = made.slopes(q, p, count, wanted)
    names = (*made.q_names, *made.y_names)
    for k in np.flatnonzero(wanted):
        if names[k] not in case.design_paths:
            yield names[k], 0.5 * x[:, k, None] * slopes[:, :, k] / lam
