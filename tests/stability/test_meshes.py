"""Stated mesh errors of random mechanisms of few elements against six times the elements.

Trees and loops in the plane and in space with riders and frames, strong tapers; some with shear,
some with a material softened over decades, some under weight up to half of what buckles.
"""

import sys
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from calibration import Drawn
from chains import Tree, case_of
from spatial_cases import linkage
from weighed_draws import DRAWS, hung

from eigassign.case import CaseFile
from eigassign.errors import EigassignError
from eigassign.mechanism import refined
from eigassign.study import build_model

Generator = np.random.Generator


def drawn_tapers(rng: Generator) -> Tree:
    """One or two beams of 1 to 5 elements, their ends up to twentyfold apart, some with bodies."""
    n, space = int(rng.integers(1, 6)), str(rng.choice(["planar", "spatial"]))
    metal = {"youngs_modulus": 7e10, "density": 2.7e3, "poissons_ratio": 0.33}
    tree = linkage({}, {}, material=metal, sections={}, space=space, bodies={})
    mechanism = tree["mechanism"]
    for k in range(int(rng.integers(1, 3))):
        length = float(rng.uniform(0.2, 1.0))
        sections = _ends(rng, length / 10 ** rng.uniform(0.5, 1.5))
        mechanism["sections"] |= {f"a{k}": sections[0], f"b{k}": sections[1]}
        mechanism["links"][f"l{k}"] = {
            "length": length,
            "material": "m",
            "section": {"start": f"a{k}", "end": f"b{k}"},
            "elements": n,
            "shear": bool(rng.random() < 0.7),
        }
        base = f"l{k - 1}.end" if k else "ground"
        mechanism["joints"][f"j{k}"] = {"type": "fixed", "base": base, "follower": f"l{k}.start"}
        if rng.random() < 0.5:
            mechanism["bodies"][f"m{k}"] = {
                "at": f"l{k}.end",
                "mass": float(10 ** rng.uniform(-2, 1)),
            }
    return tree


def _ends(rng: Generator, thick: float) -> tuple[Tree, Tree]:
    """Sections at both ends, the thicker one first or last."""
    shape, ratio = rng.choice(["circle", "rectangle", "tube"]), 1.0 / 10 ** rng.uniform(0.3, 1.3)
    if shape == "circle":
        ends = [{"diameter": thick}, {"diameter": thick * ratio}]
    elif shape == "tube":
        inner = rng.uniform(0.3, 0.9)
        ends = [{"outer_diameter": d, "inner_diameter": inner * d} for d in (thick, thick * ratio)]
    else:
        other = thick * 10 ** rng.uniform(-0.5, 0.5)
        share = ratio if rng.random() < 0.5 else 1.0
        ends = [
            {"width": other, "height": thick},
            {"width": other * share, "height": thick * ratio},
        ]
    first, last = ({"shape": str(shape), **end} for end in ends)
    return (first, last) if rng.random() < 0.5 else (last, first)


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
    model = case_of(drawn_tapers(np.random.default_rng([seed, 12]))).model()
    none = np.zeros(0), np.zeros(0), np.zeros((1, 0)), np.zeros((1, 0))
    return Drawn(model, *none, (1,))


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


@pytest.mark.parametrize("count", [24, pytest.param(1_000, marks=pytest.mark.slow)])
def test_stated_errors_are_above_the_true_ones_and_near_them(count: int) -> None:
    found = stated(range(10_000, 10_000 + count))
    sys.stdout.write(f"{found}\n")
    assert (found.ratio >= 1.0).mean() >= 0.99
    assert (found.ratio < 2.0 / 3.0).sum() <= 2
    assert (found.ratio <= 2.0).mean() >= 0.9
    assert np.isinf(found.stated).mean() < 0.05
