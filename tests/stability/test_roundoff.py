"""The stated round-off of exact frequencies beside what round-off does.

Of random chains of fine beams and stiff springs: Young's modulus, density and springs times one
factor leave every frequency as it is, but round all numbers anew. The spread over several factors
is what round-off does.
"""

import sys

import numpy as np
import pytest
from chains import Tree, model_of
from spatial_cases import linkage

from eigassign.errors import EigassignError
from eigassign.modal import rounding_error

FACTORS = (1.0, 1.1, 1.0 / 3.0, 7.3, 0.61, 1.9, 23.7, 0.013)
Random = np.random.Generator


def stiff_chain(rng: Random, factor: float) -> Tree:
    """One to three round beams of 3 to 250 elements, in a plane or in space, and two springs."""
    spatial, n = bool(rng.random() < 0.3), int(rng.integers(1, 4))
    metal = {"youngs_modulus": 70e9 * factor, "density": 2700.0 * factor, "poissons_ratio": 0.3}
    own = {"sections": {}, "space": "spatial" if spatial else "planar", "springs": {}}
    tree = linkage({}, {}, material=metal, **own)
    m, coordinates = tree["mechanism"], tree["coordinates"]
    for k in range(n):
        m["sections"][f"s{k}"] = {"shape": "circle", "diameter": float(10 ** rng.uniform(-3, -1.3))}
        m["links"][f"l{k}"] = {
            "length": float(rng.uniform(0.2, 1.5)),
            "material": "m",
            "section": f"s{k}",
            "elements": round(10 ** rng.uniform(0.5, 1.7 if spatial else 2.4)),
        }
        joint = {"base": f"l{k - 1}.end" if k else "ground", "follower": f"l{k}.start"}
        drive = [None, "free", "locked", {"stiffness": float(10 ** rng.uniform(0, 15)) * factor}]
        held = drive[rng.integers(4)]
        if held is None:
            m["joints"][f"j{k}"] = {"type": "fixed", **joint}
            continue
        axis = {"axis": [0.0, 0.0, 1.0]} if spatial else {}
        m["joints"][f"j{k}"] = {"type": "revolute", **joint, **axis}
        coordinates[f"q{k}"] = {"joint": f"j{k}", "drive": held}
    for s in range(int(rng.integers(0, 3))):
        ends = [f"l{rng.integers(n)}.end", f"l{rng.integers(n)}.{rng.choice(['start', 'end'])}"]
        both = [ends[0], "ground"] if rng.random() < 0.5 or ends[0] == ends[1] else ends
        keys = [("translational",), ("rotational",), ("translational", "rotational")]
        m["springs"][f"k{s}"] = {
            "between": both,
            **{key: float(10 ** rng.uniform(0, 15.5)) * factor for key in keys[rng.integers(3)]},
        }
    return tree


def spread_and_stated(seed: int) -> tuple[float, float] | None:
    """What round-off does to the lowest frequencies, and what is stated; None without modes."""
    found, stated = [], 0.0
    try:
        for factor in FACTORS:
            rng = np.random.default_rng([seed, 47])
            tree = stiff_chain(rng, factor)
            model = model_of(tree)
            q, count = rng.uniform(-1.0, 1.0, len(tree["coordinates"])), int(rng.integers(1, 4))
            found.append(model.frequencies(q, [], count)[0])
            if factor == 1.0:
                stated = rounding_error(model.pencil, model.x(q, [])[0], count)
    except EigassignError:
        return None
    hz = np.array(found)
    return float(np.abs(hz / np.median(hz, axis=0) - 1.0).max()), stated


def check(seeds: range, least: int) -> None:
    pairs = [pair for seed in seeds if (pair := spread_and_stated(seed)) is not None]
    assert len(pairs) >= least
    spread, stated = np.array(pairs).T
    over = spread / stated
    sys.stdout.write(
        f"{len(over)} models, too small {(over > 1).sum()} times, by {over.max():.2f}\n"
    )
    assert (spread <= 1.5 * stated).all()
    assert (spread <= stated).mean() >= 0.99
    assert np.median(stated / np.maximum(spread, 1e-15)) < 30.0  # no mere bound


def test_round_off_is_neither_above_what_is_stated_nor_far_below():
    check(range(5), 3)


@pytest.mark.slow
def test_it_is_so_for_hundreds_of_chains_of_fine_beams_and_stiff_springs():
    check(range(1000, 1400), 300)
