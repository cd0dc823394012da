"""Random chains of fine beams and stiff springs, whose frequencies round-off limits.

Young's modulus, density and springs times one factor leave every frequency as it is, but round all
numbers anew: the spread over several factors is what round-off does.

``python tests/stability/roundoff_draws.py [how many [first seed]]`` prints spread and statement.
"""

from __future__ import annotations

import sys

import numpy as np
from chains import Tree, model_of

from eigassign.errors import EigassignError
from eigassign.modal import rounding_error

FACTORS = (1.0, 1.1, 1.0 / 3.0, 7.3, 0.61, 1.9, 23.7, 0.013)
Random = np.random.Generator


def stiff_chain(rng: Random, factor: float) -> Tree:
    """One to three round beams of 3 to 250 elements, in a plane or in space, and two springs."""
    spatial, n = bool(rng.random() < 0.3), int(rng.integers(1, 4))
    m: Tree = {
        "space": "spatial" if spatial else "planar",
        "materials": {
            "a": {
                "youngs_modulus": 70e9 * factor,
                "density": 2700.0 * factor,
                "poissons_ratio": 0.3,
            }
        },
        "sections": {},
        "links": {},
        "joints": {},
        "springs": {},
    }
    coordinates: Tree = {}
    for k in range(n):
        m["sections"][f"s{k}"] = {"shape": "circle", "diameter": float(10 ** rng.uniform(-3, -1.3))}
        m["links"][f"l{k}"] = {
            "length": float(rng.uniform(0.2, 1.5)),
            "material": "a",
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
    return {"mechanism": m, "coordinates": coordinates}


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


def main() -> None:
    count, first = (int(a) for a in [*sys.argv[1:], *("500", "0")[len(sys.argv) - 1 :]])
    pairs = []
    for seed in range(first, first + count):
        pair = spread_and_stated(seed)
        if pair is not None:
            pairs.append(pair)
            sys.stdout.write(f"{seed} {pair[0]:.2e} {pair[1]:.2e} {pair[0] / pair[1]:.3f}\n")
    over = np.array([spread / stated for spread, stated in pairs])
    usual, most = np.median(1.0 / np.maximum(over, 1e-12)), over.max()
    sys.stdout.write(
        f"{len(over)} models, too small {(over > 1.0).sum()} times, by {most:.2f}; "
        f"median {usual:.0f}, most {1.0 / over.min():.0f}\n"
    )


if __name__ == "__main__":
    main()
