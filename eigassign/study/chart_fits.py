"""eigassign's fits as charted methods: along one trajectory at a design, and over trajectory × box.

Their set-up holds every exact solve, the checks and the error estimate.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.modal.fit import Fit, fit
from eigassign.modal.region import Box
from eigassign.study.chart_methods import (
    Evaluator,
    Method,
    points_along,
    reduced_model,
    solves_per_point,
)
from eigassign.study.chart_question import Features, Points
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Fitted:
    """Fits that answer points, and how many exact solves they took."""

    fits: tuple[Fit, ...]  # one for all designs, or one for each
    solves: int

    def __call__(self, points: Points) -> Floats:
        """(n, n_modes) in Hz."""
        n = points.n_random
        parts = [] if not n else [self.fits[0].frequencies(points.q[:n], points.y[:n])]
        if points.designs:
            hz = self._runs(points.y[n :: len(points.along)])
            if len(points.along) < hz.shape[1]:
                hz = hz[:, points.along]
            parts.append(hz.reshape(-1, hz.shape[2]))
        return parts[0] if len(parts) == 1 else np.vstack(parts)

    def _runs(self, y: Floats) -> Floats:
        if len(self.fits) == 1:
            return self.fits[0].along(y)
        return np.array([each.along() for each in self.fits])


def fit_methods(
    scene: Scene,
    features: Features,
    points: Points,
    accuracies: Sequence[float],
    sources: Sequence[tuple[int, int]],
    most: int,
) -> Iterator[Method]:
    """Every fit for every accuracy; ``most`` exact solves at most for one.

    ``sources`` are half order and expansion points of the reduced models that are fitted.
    """
    if features.place is not None:
        for accuracy in accuracies:
            yield _method(
                f"fit along {accuracy:.0e}",
                "fit along one trajectory",
                {"accuracy": accuracy},
                partial(_along, scene, points, accuracy, most),
                per_design=True,
                one=partial(_one, scene, points, accuracy, most),
                use=f"ea.fit(model, q, y, accuracy={accuracy:g}).along()",
                note="fitted anew for every design: answers the runs along the trajectory only",
            )
    for accuracy in accuracies:
        yield _method(
            f"fit {accuracy:.0e}",
            "fit of exact solves",
            {"accuracy": accuracy},
            partial(_over_box, scene, features, accuracy, most),
            use=f"ea.fit(model, q, ea.Box(lower, upper), accuracy={accuracy:g}).along(designs)",
        )
    for m, count in sources:
        q, y = points_along(scene, count)
        name = f"reduced m = {m}, {len(q)} point{'s' if len(q) > 1 else ''}"
        for accuracy in accuracies:
            yield _method(
                f"fit {accuracy:.0e} of {name}",
                f"fit of {name}",
                {"accuracy": accuracy, "half_order": m, "q": q, "y": y},
                partial(_of_reduced, scene, features, accuracy, m, q, y),
                use=f"ea.fit(ea.reduce(model, q0, y0, half_order={m}), q, ea.Box(lower, upper), "
                f"accuracy={accuracy:g})",
            )


def _method(name: str, family: str, parameters: dict[str, Any], fit: Any, **more: Any) -> Method:
    return Method(name, family, True, parameters, fit, **more)


def _one(scene: Scene, points: Points, accuracy: float, most: int) -> Fit:
    """The fit of the first design of the runs."""
    y = points.y[points.n_random]
    return fit(scene.model, scene.path.q, y, scene.expansions.modes, accuracy, most)


def _along(scene: Scene, points: Points, accuracy: float, most: int, _: Floats) -> Evaluator:
    """One fit for each design of the runs."""
    y = points.y[points.n_random :: len(points.along)]
    modes, q = scene.expansions.modes, scene.path.q
    fits = tuple(fit(scene.model, q, each, modes, accuracy, most) for each in y)
    return Fitted(fits, sum(each.solves for each in fits))


def _box(features: Features) -> Box:
    """The bounds of y, parameters without room where they are kept."""
    free = features.upper > features.lower
    low = np.where(free, features.lower, features.fixed_y)
    return Box(low, np.where(free, features.upper, features.fixed_y))


def _over_box(scene: Scene, features: Features, accuracy: float, most: int, _: Floats) -> Evaluator:
    made = fit(scene.model, scene.path.q, _box(features), scene.expansions.modes, accuracy, most)
    return Fitted((made,), made.solves)


def _of_reduced(
    scene: Scene, features: Features, accuracy: float, m: int, q: Floats, y: Floats, _: Floats
) -> Evaluator:
    reduced = reduced_model(scene, m, q, y)
    made = fit(reduced, scene.path.q, _box(features), scene.expansions.modes, accuracy)
    return Fitted((made,), len(q) * solves_per_point(scene, m, True))
