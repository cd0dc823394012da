"""Random strong tapers of few elements, with shear and without, judged against fine meshes.

As they are, or with their links reduced to few modes.

``python tests/stability/tapers.py [reduced] [how many [first seed]]`` prints true
errors and those stated.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from chains import Tree, case_of

from eigassign.errors import MechanismError
from eigassign.mechanism import refined, with_reduction
from eigassign.modal import rounding_error
from eigassign.study import build_model

FINE = 64  # elements of what is called true
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


@dataclass(frozen=True)
class Judged:
    """Modes of one mesh: true relative errors and those stated, (n_modes,)."""

    seed: int
    true: np.ndarray
    stated: np.ndarray
    round_off: float  # of the true errors


def judged(seed: int) -> Judged:
    """Three modes of one random mechanism of tapers."""
    case = case_of(tapers(np.random.default_rng([seed, 12])))
    elements = next(iter(case.file.mechanism.links.values())).elements  # type: ignore[union-attr]
    fine, model = build_model(refined(case.file, FINE / elements)[0]), case.model()
    true = model.frequencies([], [], 3)[0] / fine.frequencies([], [], 3)[0] - 1.0
    stated = model.discretisation_error([], [], (1, 2, 3))[0]
    return Judged(seed, true, stated, rounding_error(fine.pencil, fine.x([], [])[0], 3))


def judged_reduced(seed: int) -> Judged | None:
    """Three modes of tapers of 3 to 12 elements with their links reduced, mesh and links together.

    On an elastic joint, and with a spring at a tip, of some; None where nothing is reduced.
    """
    rng = np.random.default_rng([seed, 13])
    tree, n = tapers(rng), int(rng.integers(3, 13))
    mechanism = tree["mechanism"]
    for link in mechanism["links"].values():
        link["elements"] = n
    if rng.random() < 0.4:
        mechanism["joints"]["j0"] |= {"type": "revolute", **_axis(mechanism["space"])}
        tree["coordinates"]["q"] = {"joint": "j0", "drive": {"stiffness": 10 ** rng.uniform(2, 6)}}
    if rng.random() < 0.4:
        kind = str(rng.choice(["rotational", "translational"]))
        tip = f"l{len(mechanism['links']) - 1}.end"
        mechanism["springs"] = {"s": {"between": [tip, "ground"], kind: 10 ** rng.uniform(2, 7)}}
    file, whole = case_of(tree).file, case_of(tree).model()
    q, count = np.zeros(len(whole.q_names)), 3
    cut = whole.frequencies(q, [], count)[0, -1] * 10 ** rng.uniform(-0.5, 0.8)
    model = build_model(with_reduction(file, dict.fromkeys(mechanism["links"], float(cut))))
    if model.reduced is None or model.n_dof - model.n_rigid < count:
        return None
    fine = build_model(refined(file, max(FINE / n, 4.0))[0])
    try:
        exact, hz = (each.frequencies(q, [], count)[0] for each in (fine, model))
    except MechanismError:  # fewer modes have mass
        return None
    mesh, links = (
        error(q, [], (1, 2, 3))[0] for error in (model.discretisation_error, model.truncation_error)
    )
    stated = (1.0 + mesh) * (1.0 + links) - 1.0
    return Judged(seed, hz / exact - 1.0, stated, rounding_error(fine.pencil, fine.x(q, [])[0], 3))


def _axis(space: str) -> Tree:
    return {} if space == "planar" else {"axis": [0.0, 0.0, 1.0]}


def figures(found: Sequence[Judged]) -> str:
    """How true errors compare with those stated."""
    true, stated, lost = (
        np.concatenate([np.broadcast_to(getattr(each, k), 3) for each in found])
        for k in ("true", "stated", "round_off")
    )
    known = np.isfinite(stated)
    clear = known & (true > 100.0 * lost)
    over, below = stated[clear] / true[clear], known & (true > stated + lost)
    worst = (true[below] / stated[below]).max(initial=1.0)
    return (
        f"{len(found)} meshes, {len(true)} numbers, {(~known).sum()} not stated; {below.sum()} "
        f"true errors above what is stated, {worst:.4f} times at most; "
        f"overestimate {np.median(over):.3f}, {np.percentile(over, 90):.2f} in 90 %"
    )


if __name__ == "__main__":
    reduced = sys.argv[1:2] == ["reduced"]
    given = sys.argv[2 if reduced else 1 :]
    count, first = (int(a) for a in (*given, *("300", "0")[len(given) :]))
    judge = judged_reduced if reduced else judged
    each = (judge(seed) for seed in range(first, first + count))
    sys.stdout.write(figures([one for one in each if one is not None]) + "\n")
