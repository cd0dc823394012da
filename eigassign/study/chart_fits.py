"""eigassign's fits as charted methods: along one trajectory at a design, and over trajectory × box.

To a stated accuracy, or of a given number of exact solves. Their set-up holds every exact solve,
the checks and the error estimate, but for round-off that decides nothing and is looked at when the
estimate is asked for; what can state none is left out, as what is refused.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.modal.fit import Fit
from eigassign.modal.fitting import MOST, fit
from eigassign.modal.path_fit import PathFit
from eigassign.modal.region import Box
from eigassign.study.chart_methods import (
    Evaluator,
    Method,
    points_along,
    reduced_model,
    said,
    solves_per_point,
)
from eigassign.study.chart_question import Features, Points
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
Made = Fit | PathFit
ALONG = (3, 4, 5, 6, 7, 9, 11, 13, 17, 25)  # exact solves of a fit along one trajectory
OVER_BOX = (9, 12, 16, 22, 30, 42, 60, 84, 120, 160, 220, 300, 400, 550)  # over all designs


@dataclass(frozen=True, eq=False)
class Fitted:
    """Fits that answer points, and how many exact solves they took."""

    fits: tuple[Made, ...]  # one for all designs, or one for each
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

    @property
    def estimate(self) -> float:
        """The largest error estimate of all fits, relative in Hz."""
        return max(each.error_estimate for each in self.fits)

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
        counts: list[dict[str, Any]] = [{"solves": k} for k in ALONG if k * points.designs <= most]
        for how in (*counts, *_to_accuracies(accuracies, min(most, MOST))):
            yield _method(
                f"fit {_named(how)} along",
                f"fit {_kind(how)} along one trajectory",
                how,
                partial(_along, scene, points, how),
                per_design=True,
                one=partial(_one, scene, points, how),
                use=f"ea.fit(model, q, y{said(scene)}, {_call(how)}).along()",
                note="fitted anew for every design: answers the runs along the trajectory only",
            )
    over: list[dict[str, Any]] = [{"solves": k} for k in OVER_BOX if k <= most]
    for how in (*over, *_to_accuracies(accuracies, most)):
        yield _method(
            f"fit {_named(how)}",
            f"fit {_kind(how)}",
            how,
            partial(_over_box, scene, features, how),
            use=f"ea.fit(model, q, ea.Box(lower, upper){said(scene)}, {_call(how)}).along(designs)",
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
                use=f"ea.fit(ea.reduce(model, q0, y0{said(scene)}, half_order={m}), q, "
                f"ea.Box(lower, upper), accuracy={accuracy:g})",
            )


def _method(name: str, family: str, parameters: dict[str, Any], fit: Any, **more: Any) -> Method:
    return Method(name, family, True, parameters, fit, **more)


def _to_accuracies(accuracies: Sequence[float], most: int) -> Iterator[dict[str, Any]]:
    """What is asked of fits, ``most`` frequencies for each."""
    yield from ({"accuracy": accuracy, "most": most} for accuracy in accuracies)


def _kind(how: Mapping[str, Any]) -> str:
    return "of given solves" if "solves" in how else "to an accuracy"


def _named(how: Mapping[str, Any]) -> str:
    return f"of {how['solves']} solves" if "solves" in how else f"{how['accuracy']:.0e}"


def _call(how: Mapping[str, Any]) -> str:
    """As arguments of `ea.fit`; ``most`` only where its default might not do."""
    if "solves" in how:
        return f"solves={how['solves']}"
    more = f", most={how['most']}" if how["most"] > MOST else ""
    return f"accuracy={how['accuracy']:g}{more}"


def _one(scene: Scene, points: Points, how: Mapping[str, Any]) -> Made:
    """The fit of the first design of the runs."""
    y = points.y[points.n_random]
    return fit(scene.model, scene.path, y, scene.expansions.modes, **how)


def _along(scene: Scene, points: Points, how: Mapping[str, Any], _: Floats) -> Evaluator:
    """One fit for each design of the runs."""
    y = points.y[points.n_random :: len(points.along)]
    modes, q = scene.expansions.modes, scene.path
    fits = tuple(fit(scene.model, q, each, modes, **how) for each in y)
    return Fitted(fits, sum(each.solves for each in fits))


def _box(features: Features) -> Box:
    """The bounds of y, parameters without room where they are kept."""
    free = features.upper > features.lower
    low = np.where(free, features.lower, features.fixed_y)
    return Box(low, np.where(free, features.upper, features.fixed_y))


def _over_box(scene: Scene, features: Features, how: Mapping[str, Any], _: Floats) -> Evaluator:
    made = fit(scene.model, scene.path, _box(features), scene.expansions.modes, **how)
    return Fitted((made,), made.solves)


def _of_reduced(
    scene: Scene, features: Features, accuracy: float, m: int, q: Floats, y: Floats, _: Floats
) -> Evaluator:
    reduced = reduced_model(scene, m, q, y)
    made = fit(reduced, scene.path, _box(features), scene.expansions.modes, accuracy)
    return Fitted((made,), len(q) * solves_per_point(scene, m, True))
