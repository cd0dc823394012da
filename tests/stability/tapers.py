"""Random strong tapers of few elements, with shear and without."""

from __future__ import annotations

import numpy as np
from chains import Tree

Random = np.random.Generator


def tapers(rng: Random) -> Tree:
    """One or two beams of 1 to 5 elements, their ends up to twentyfold apart, some with bodies."""
    n, space = int(rng.integers(1, 6)), str(rng.choice(["planar", "spatial"]))
    mechanism: Tree = {
        "space": space,
        "materials": {"m": {"youngs_modulus": 7e10, "density": 2.7e3, "poissons_ratio": 0.33}},
        "sections": {},
        "links": {},
        "joints": {},
        "bodies": {},
    }
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
    return {"mechanism": mechanism, "coordinates": {}}


def _ends(rng: Random, thick: float) -> tuple[Tree, Tree]:
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
