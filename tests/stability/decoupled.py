"""Cantilevers on the ground that know nothing of each other."""

from __future__ import annotations

from chains import Tree, model_of

from eigassign.modal import Model


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
