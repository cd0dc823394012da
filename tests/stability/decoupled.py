"""Random mechanisms of parts that know little or nothing of each other, and designs that load one.

Combs (cantilevers on the ground), rakes (on a common stiff bar), pods (arms on the ground, each on
its own joint), symmetric trees, and arms with one link almost without mass. Expanded where the
parts are much alike; then masses grow up to twentyfold and stiffness falls, of single parts too.
"""

from __future__ import annotations

import numpy as np
from calibration import Drawn
from chains import Tree, model_of

from eigassign.errors import EigassignError
from eigassign.modal import Model

KINDS = ("comb", "rake", "pods", "tree", "light")
Random = np.random.Generator


def decoupled(seed: int, samples: int) -> Drawn | None:
    """One of the KINDS with up to three design parameters; None where a pose has no such mode."""
    rng = np.random.default_rng([seed, 41])
    kind = KINDS[seed % len(KINDS)]
    tree = _empty()
    _PARTS[kind](tree, rng)
    tree["design"] = _design(tree, rng)
    try:
        model = model_of(tree)
    except EigassignError:
        return None
    box = np.array([[p["min"], p["max"]] for p in tree["design"].values()]).reshape(-1, 2)
    # at the lower end, a little above it, in the middle, or anywhere
    share = [0.0, 0.05, 0.5, rng.random(len(box))][rng.integers(4)]
    y0 = box[:, 0] + share * (box[:, 1] - box[:, 0])
    # corners as often as the inside
    inside = rng.random((samples, len(box)))
    inside = np.where(rng.random((samples, 1)) < 0.5, np.round(inside), inside)
    y = box[:, 0] + inside * (box[:, 1] - box[:, 0])
    q0 = rng.uniform(-1.5, 1.5, len(tree["coordinates"]))
    q = q0 + rng.uniform(-1.0, 1.0, (samples, len(q0))) * rng.choice([0.0, 0.3, 1.0])
    modes = tuple(range(1, 1 + int(rng.integers(1, 4))))
    half_order = int(rng.integers(1, 4))
    if half_order == 3 and len(box) + len(q0) > 4:
        half_order = 2  # hundreds of vectors of a few dozen unknowns
    try:
        model.frequencies(np.vstack([q0, q]), np.vstack([y0, y]), max(modes))
    except EigassignError:
        return None
    return Drawn(seed, model, q0, y0, q, y, modes, half_order)


def _empty() -> Tree:
    return {
        "mechanism": {
            "space": "planar",
            "materials": {},
            "sections": {},
            "links": {},
            "joints": {},
            "bodies": {},
        },
        "coordinates": {},
        "design": {},
    }


def _comb(tree: Tree, rng: Random) -> None:
    ratio = rng.choice([1.0, 1.001, 1.02, 1.06, 1.15])
    for k in range(int(rng.integers(2, 15))):
        _link(tree, f"t{k}", rng, 0.25 / ratio**k, 0.004)
        _fix(tree, f"t{k}", "ground", 0.0)


def _rake(tree: Tree, rng: Random) -> None:
    """Tines along a bar that is stiff by its section: nearly decoupled."""
    ratio, tines = rng.choice([1.0, 1.01, 1.06]), int(rng.integers(2, 8))
    for k in range(tines):
        _link(tree, f"b{k}", rng, 0.05, float(rng.choice([0.012, 0.03, 0.1])), elements=1)
        _join(tree, f"b{k}", f"b{k - 1}.end" if k else "ground", 0.0, rng, turns=k == 0)
        _link(tree, f"t{k}", rng, 0.25 / ratio**k, 0.004)
        _fix(tree, f"t{k}", f"b{k}.end", 1.5)


def _pods(tree: Tree, rng: Random) -> None:
    ratio = rng.choice([1.0, 1.02, 1.1])
    for k in range(int(rng.integers(2, 5))):
        for part, length in (("a", 0.3), ("f", 0.2))[: rng.integers(1, 3)]:
            _link(tree, f"{part}{k}", rng, length / ratio**k, 0.006)
            base = "ground" if part == "a" else f"a{k}.end"
            _join(tree, f"{part}{k}", base, 0.4, rng, turns=rng.random() < 0.5)


def _tree(tree: Tree, rng: Random) -> None:
    """A trunk with equal branches to either side, whose antisymmetric modes leave it alone."""
    _link(tree, "trunk", rng, 0.3, float(rng.choice([0.006, 0.02])))
    _join(tree, "trunk", "ground", 0.0, rng, turns=rng.random() < 0.5)
    for k in range(int(rng.integers(1, 4))):
        for side in (-1.0, 1.0):
            name = f"{'l' if side < 0 else 'r'}{k}"
            _link(tree, name, rng, 0.25 / 1.1**k, 0.004)
            _fix(tree, name, "trunk.end", side * (0.7 + 0.3 * k))


def _light(tree: Tree, rng: Random) -> None:
    """An arm of two to four links, one of which has next to no mass."""
    links = int(rng.integers(2, 5))
    for k in range(links):
        _link(tree, f"a{k}", rng, float(rng.uniform(0.2, 0.5)), 0.008)
        _join(tree, f"a{k}", f"a{k - 1}.end" if k else "ground", 0.5, rng, turns=True)
    material = tree["mechanism"]["materials"][f"a{rng.integers(links)}"]
    material["density"] *= float(10.0 ** rng.uniform(-8.0, -1.0))


_PARTS = {"comb": _comb, "rake": _rake, "pods": _pods, "tree": _tree, "light": _light}


def _link(
    tree: Tree, name: str, rng: Random, length: float, height: float, elements: int = 2
) -> None:
    """A bar, and often a body at its end."""
    _bar(tree, name, length, height, elements)
    if rng.random() < 0.6:
        weight = 2700.0 * 0.02 * height * length
        tree["mechanism"]["bodies"][name] = {
            "at": f"{name}.end",
            "mass": float(weight * rng.choice([0.0, 0.0, 0.05, 0.5, 2.0])),
        }


def _bar(tree: Tree, name: str, length: float, height: float, elements: int) -> None:
    """A flat bar of aluminium with material and section of its own."""
    m = tree["mechanism"]
    m["materials"][name] = {"youngs_modulus": 70e9, "density": 2700.0}
    m["sections"][name] = {"shape": "rectangle", "width": 0.02, "height": height}
    m["links"][name] = {"length": length, "material": name, "section": name, "elements": elements}


def _fix(tree: Tree, name: str, base: str, angle: float) -> None:
    tree["mechanism"]["joints"][name] = {
        "type": "fixed",
        "base": base,
        "follower": f"{name}.start",
        "angle": angle,
    }


def _join(tree: Tree, name: str, base: str, angle: float, rng: Random, turns: bool) -> None:
    """A revolute joint, free, locked or held, or a fixed one."""
    if not turns:
        _fix(tree, name, base, angle)
        return
    joint = {"type": "revolute", "base": base, "follower": f"{name}.start"}
    tree["mechanism"]["joints"][name] = joint
    drives = ["free", "locked", {"stiffness": float(10.0 ** rng.uniform(1.0, 4.0))}]
    tree["coordinates"][f"q{name}"] = {"joint": name, "drive": drives[rng.integers(3)]}


def _design(tree: Tree, rng: Random) -> dict[str, Tree]:
    """Masses up to 20 × their link's or their own; stiffness and density of single links."""
    m = tree["mechanism"]
    found: list[tuple[str, float, float]] = []
    for name, body in m["bodies"].items():
        link = m["links"][name]
        weight = 2700.0 * 0.02 * m["sections"][name]["height"] * link["length"]
        most = max(body["mass"], weight) * float(rng.uniform(1.0, 20.0))
        found += [(f"bodies.{name}.mass", body["mass"] * float(rng.uniform(0, 1)), most)] * 2
    for name, data in m["materials"].items():
        E, rho = data["youngs_modulus"], data["density"]
        found.append((f"materials.{name}.youngs_modulus", E / float(rng.uniform(1, 10)), E * 1.5))
        found.append((f"materials.{name}.density", 0.7 * rho, rho * float(rng.uniform(1, 20))))
    for name, data in m["sections"].items():
        found.append((f"sections.{name}.height", 0.6 * data["height"], 1.4 * data["height"]))
    for name, data in tree["coordinates"].items():
        if isinstance(data["drive"], dict):
            k = data["drive"]["stiffness"]
            found.append((f"coordinates.{name}.drive.stiffness", 0.1 * k, 2.0 * k))
    rng.shuffle(found)
    design: dict[str, Tree] = {}
    for path, low, high in found[: rng.integers(1, 4)]:
        if path not in {p["parameter"] for p in design.values()}:
            design[f"y{len(design)}"] = {"parameter": path, "min": low, "max": high}
    return design


def comb(
    tines: int,
    bodies: tuple[int, ...] | None = None,
    densities: tuple[int, ...] = (),
    elements: int = 3,
) -> Model:
    """Cantilevers of 0.25 m / 1.06^k; masses at the tips ``bodies`` (the last), then densities."""
    tree = _empty()
    m = tree["mechanism"]
    for k in range(tines):
        _bar(tree, f"t{k}", 0.25 / 1.06**k, 0.004, elements)
        _fix(tree, f"t{k}", "ground", 0.0)
    paths = [f"materials.t{k}.density" for k in densities]
    for k in reversed(bodies if bodies is not None else (tines - 1,)):
        m["bodies"][f"t{k}"] = {"at": f"t{k}.end", "mass": 0.0}
        paths.insert(0, f"bodies.t{k}.mass")
    most = {"mass": 1.0, "density": 1e5}
    tree["design"] = {
        f"y{i}": {"parameter": path, "min": 0.0, "max": most[path.rpartition(".")[2]]}
        for i, path in enumerate(paths)
    }
    return model_of(tree)
