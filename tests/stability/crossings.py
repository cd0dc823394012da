"""Random regions in which modes meet, for fits: every depth, at every place, coupled or not.

Bars on the ground, whose first modes meet at one value of a modulus that the roots of all of them
share: with unequal roots steeply, with nearly equal ones so flatly that a kink is far below what an
accuracy allows, or not. And arms of round links, whose bending modes in two directions cross as the
joints move along a straight path.

``python tests/stability/crossings.py [how many [first seed]]`` prints each fit whose error is above
its estimate, and a summary.
"""

from __future__ import annotations

import sys

import numpy as np
from chains import Tree, model_of
from fit_calibration import Floats, Outcome, Setting, outcome, summary
from wide_draws import hanging_arm

import eigassign as ea
from eigassign.errors import EigassignError
from eigassign.modal import Model

ACCURACIES = (1e-2, 1e-4, 1e-6, 1e-8)
SOLVES = (5, 9, 12, 16, 25)
MODES = ((1,), (2,), (1, 2), (1, 2, 3))
E0, WIDTH = 70e9, 0.2  # Pa, and the share within which it varies
ALONE = ea.Box([E0 * (1.0 - WIDTH)], [E0 * (1.0 + WIDTH)])
POINTS = 400  # at which a fit is judged, with more of them at the ends
Random = np.random.Generator


def crossing(seed: int) -> Setting | None:
    """A region in which modes meet, or nearly; None where the mechanism has no such mode."""
    rng = np.random.default_rng([seed, 43])
    try:
        return _bars(seed, rng) if seed % 2 else _arm(seed, rng)
    except EigassignError:
        return None


def _bars(seed: int, rng: Random) -> Setting:
    """Two or three bars that meet at E = E0 (1 + WIDTH v), often close to an end of the box."""
    near = 1.0 - 10.0 ** rng.uniform(-3.0, 0.0)
    v = float(rng.choice([-1.0, 1.0]) * rng.choice([near, rng.uniform(0.0, 1.1)]))
    depth = float(10.0 ** rng.uniform(-6.0, 0.0))
    root = float(rng.uniform(0.05, 0.4))
    roots = [root, root * (1.0 + depth), root / (1.0 + 0.7 * depth)][: int(rng.integers(2, 4))]
    lengths = _meeting(roots, v)
    lengths[1:] *= 1.0 + rng.choice([0.0, 0.0, depth * 1e-2 * rng.normal()])
    stub = float(10.0 ** rng.uniform(-4.0, -1.0)) if rng.random() < 0.4 else None
    model = _rooted(roots, lengths.tolist(), stub)
    if rng.random() < 0.75:
        box = ALONE
    else:  # two parameters: the density of the last bar, too
        model = _rooted(roots, lengths.tolist(), stub, heavy=True)
        box = ea.Box([E0 * (1.0 - WIDTH), 0.999 * 2700.0], [E0 * (1.0 + WIDTH), 1.001 * 2700.0])
    low, high = np.array(box.lower), np.array(box.upper)
    y = low + (high - low) * _spread(rng, len(low))
    return Setting(f"bars {seed}", model, (np.zeros(0), box), np.zeros((len(y), 0)), y)


def rooted_bars(depth: float, place: float) -> tuple[Model, ea.Box]:
    """Two bars that meet at ``place`` of the box [−1, 1], the slopes of their f apart by depth."""
    roots = [0.2, 0.2 * (1.0 + depth)]
    return _rooted(roots, _meeting(roots, place).tolist()), ALONE


def _meeting(roots: list[float], v: float) -> Floats:
    """Lengths with which bars on the ground have one first frequency at E0 (1 + WIDTH v)."""
    at = [E0 * (1.0 + WIDTH * v)]
    alone = [_rooted([root], [1.0]).frequencies([], at, 1)[0, 0] for root in roots]
    return np.asarray(0.3 * np.sqrt(np.array(alone) / alone[0]))


def _rooted(
    roots: list[float], lengths: list[float], stub: float | None = None, heavy: bool = False
) -> Model:
    """Bars of two beams each; the first, a share of the length, is of the material that varies."""
    material = {"youngs_modulus": E0, "density": 2700.0}
    m: Tree = {
        "space": "planar",
        "materials": {"varied": dict(material), "own": dict(material), "last": dict(material)},
        "sections": {"rod": {"area": 3e-4, "bending_inertia": 8e-9}},
        "links": {},
        "joints": {},
    }
    base = "ground"
    if stub is not None:
        m["sections"]["stiff"] = {"area": 3e-2, "bending_inertia": 8e-6}
        _fixed(m, "stub", "ground", stub, "own", "stiff", 1)
        base = "stub.end"
    for k, (root, length) in enumerate(zip(roots, lengths, strict=True)):
        own = "last" if k == len(roots) - 1 else "own"
        _fixed(m, f"root{k}", base, root * length, "varied", "rod", 1)
        _fixed(m, f"bar{k}", f"root{k}.end", (1.0 - root) * length, own, "rod", 2)
    design = {"E": {"parameter": "materials.varied.youngs_modulus", "min": 1e9, "max": 1e12}}
    if heavy:
        design["rho"] = {"parameter": "materials.last.density", "min": 1.0, "max": 1e5}
    return model_of({"mechanism": m, "coordinates": {}, "design": design})


def _fixed(
    m: Tree, name: str, base: str, length: float, material: str, section: str, elements: int
) -> None:
    m["links"][name] = {
        "length": length,
        "material": material,
        "section": section,
        "elements": elements,
    }
    m["joints"][name] = {"type": "fixed", "base": base, "follower": f"{name}.start"}


def _arm(seed: int, rng: Random) -> Setting:
    """A straight joint path of an arm whose sections are (nearly) alike in both directions."""
    q0, model = np.zeros(0), None
    for each in range(seed, seed + 100_000, 1000):  # the first that its pose matters to
        tree, q0 = hanging_arm(each)
        tree["design"] = {}
        model = model_of(tree)
        if len(model.pencil.local_directions[1]):
            break
    assert model is not None
    step = rng.normal(size=len(q0)) * float(rng.choice([0.05, 0.3, 1.0]))
    path = q0 + np.linspace(0.0, 1.0, 60)[:, None] * step
    q = q0 + _spread(rng, 1) * step
    return Setting(f"arm {seed}", model, (path, np.zeros(0)), q, np.zeros((len(q), 0)))


def _spread(rng: Random, d: int) -> Floats:
    """In [0, 1]^d, as dense at the ends as Chebyshev points."""
    at = 0.5 - 0.5 * np.cos(np.pi * rng.random((POINTS, d)))
    return np.vstack([np.zeros(d), np.ones(d), at])


def outcomes(seeds: range) -> tuple[list[Outcome], int]:
    """Of one fit for each seed, to an accuracy or of given solves; and how many were refused."""
    found, refused = [], 0
    for seed in seeds:
        setting, rng = crossing(seed), np.random.default_rng([seed, 44])
        if setting is None:
            continue
        modes = MODES[rng.integers(len(MODES))]
        asked = (
            {"accuracy": float(rng.choice(ACCURACIES))}
            if rng.random() < 0.5
            else {"solves": int(rng.choice(SOLVES))}
        )
        try:
            exact = setting.model.frequencies(setting.q, setting.y, modes[-1])
        except EigassignError:
            continue
        one = outcome(setting, modes, asked, exact)
        refused += one is None
        found += [] if one is None else [one]
    return found, refused


def main() -> None:
    count, first = (int(a) for a in [*sys.argv[1:], *("500", "0")[len(sys.argv) - 1 :]])
    found, refused = outcomes(range(first, first + count))
    for each in found:
        if each.overshoot > 1.0:
            sys.stdout.write(
                f"{each.overshoot:9.2e} {each.estimate:.1e} {each.solves:5d} {each.asked} "
                f"{each.modes} {each.name}\n"
            )
    for kind in ("bars", "arm"):
        for asked in ("accuracy", "solves"):
            own = [x for x in found if x.name.startswith(kind) and x.asked.startswith(asked)]
            sys.stdout.write(f"{kind}, {asked}: {summary(own)}\n")
    sys.stdout.write(f"{summary(found)}; {refused} refused\n")


if __name__ == "__main__":
    main()
