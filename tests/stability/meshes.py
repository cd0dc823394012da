"""Random mechanisms of few elements, and their stated mesh errors beside those against finer ones.

Trees and loops in the plane and in space with riders and frames, strong tapers; some with shear,
some with a material softened over decades, some under weight up to half of what buckles.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from calibration import Drawn
from chains import case_of
from tapers import tapers
from weighed_draws import DRAWS, hung

from eigassign.case import CaseFile
from eigassign.errors import EigassignError
from eigassign.mechanism import refined
from eigassign.study import build_model

FINER = 6.0
SHARES = (1e-3, 0.03, 0.2, 0.5)  # of the load that buckles
MODES = 3


def mechanism(seed: int) -> Drawn | None:
    """One mechanism, its beams of one to four elements; None where it cannot be drawn."""
    rng = np.random.default_rng([seed, 38])
    draws = (*DRAWS, _tapers)
    drawn = draws[seed % len(draws)](seed, 1)
    if drawn is None or not len(drawn.q) or not drawn.model.is_meshed:
        return None
    drawn = replace(drawn, model=build_model(_in_few(drawn.model.poses.case, rng)))
    return (rng.random() < 0.3 and hung(drawn, rng, SHARES)) or drawn


def _tapers(seed: int, _samples: int) -> Drawn:
    model = case_of(tapers(np.random.default_rng([seed, 12]))).model()
    none = np.zeros(0), np.zeros(0), np.zeros((1, 0)), np.zeros((1, 0))
    return Drawn(seed, model, *none, (1,), 1)


def _in_few(file: CaseFile, rng: np.random.Generator) -> CaseFile:
    """One to four elements a beam; three of ten all with shear, three with a softer material."""
    sheared, links = rng.random() < 0.3, {}
    for name, link in file.mechanism.links.items():
        change = {"elements": int(rng.integers(1, 5))} if hasattr(link, "elements") else {}
        if sheared and hasattr(link, "shear"):
            change["shear"] = True
        links[name] = link.model_copy(update=change)
    parts = {"links": type(file.mechanism.links)(links)}
    if rng.random() < 0.3:
        materials = dict(file.mechanism.materials.items())
        name = str(rng.choice(sorted(materials)))
        modulus = materials[name].youngs_modulus * 10.0 ** rng.uniform(-3.0, 0.0)
        materials[name] = materials[name].model_copy(update={"youngs_modulus": modulus})
        parts["materials"] = type(file.mechanism.materials)(materials)
    return replace(file, mechanism=file.mechanism.model_copy(update=parts))


@dataclass(frozen=True)
class Stated:
    """Stated and true errors, (n,), and the seed of each."""

    stated: np.ndarray
    true: np.ndarray
    seeds: np.ndarray

    def __str__(self) -> str:
        ratio = self.ratio
        return (
            f"{len(self.true)} numbers, {np.isinf(self.stated).sum()} not known; at or above the "
            f"truth {100 * (ratio >= 1.0).mean():.2f} %, below two thirds {(ratio < 2 / 3).sum()} "
            f"(seeds {set(self.seeds[ratio < 2 / 3].tolist())}), within twice "
            f"{100 * (ratio <= 2.0).mean():.2f} %"
        )

    @property
    def ratio(self) -> np.ndarray:
        """Of all that is stated, infinite where it is not known."""
        return self.stated / self.true


def stated(seeds: Iterable[int], least: float = 1e-6) -> Stated:
    """The three lowest modes of every mechanism, where the true error is above ``least``."""
    rows = []
    for seed in seeds:
        try:
            drawn = mechanism(seed)
            if drawn is None:
                continue
            model, q, y = drawn.model, drawn.q[:1], drawn.y[:1]
            modes = tuple(range(1, 1 + min(MODES, model.n_dof - model.n_rigid)))
            hz = model.frequencies(q, y, modes[-1])[0]
            said = model.discretisation_error(q, y, modes)[0]
            fine = build_model(refined(model.poses.case, FINER)[0])
            true = np.abs(hz / fine.frequencies(q, y, modes[-1])[0] - 1.0)
        except EigassignError:  # fewer modes have mass, or the finer mesh buckles
            continue
        rows += [(*each, seed) for each in zip(said, true, strict=True) if each[1] > least]
    table = np.array(rows)
    return Stated(table[:, 0], table[:, 1], table[:, 2].astype(int))
