"""Random planar mechanisms, each with a design box and poses around one point."""

from dataclasses import dataclass

import numpy as np
from chains import Tree, model_of, random_chain

from eigassign.errors import MechanismError
from eigassign.modal import Model

SPAN = np.pi / 3.0  # rad: q is drawn within this of q0, coordinate by coordinate
Floats = np.ndarray


@dataclass(frozen=True)
class Drawn:
    """One random mechanism with its design box and the poses it is judged at."""

    model: Model
    q0: Floats
    y0: Floats
    q: Floats
    y: Floats
    modes: tuple[int, ...]


def draw(seed: int, samples: int) -> Drawn | None:
    """A planar tree of 1 to 5 links, up to four design parameters; None where it has no mode."""
    tree, q0 = random_chain(seed)
    rng = np.random.default_rng([seed, 1])
    tree["design"] = with_box(_candidates(tree), rng, {})
    try:
        model = model_of(tree)
    except MechanismError:
        return None
    box = np.array([[p["min"], p["max"]] for p in tree["design"].values()]).reshape(-1, 2)
    y0 = box.mean(axis=1)
    y = rng.uniform(box[:, 0], box[:, 1], (samples, len(box)))
    q = q0 + rng.uniform(-SPAN, SPAN, (samples, len(q0)))
    elastic = model.n_dof - model.n_rigid
    modes = tuple(range(1, 1 + int(rng.integers(1, min(4, elastic + 1)))))
    return Drawn(model, q0, y0, q, y, modes[-1:] if rng.random() < 0.5 else modes)


def with_box(
    choices: list[tuple[str, float]], rng: np.random.Generator, narrow: dict[str, float]
) -> Tree:
    """Up to four of the parameters, each with a box of a factor of up to four.

    ``narrow`` holds, for the last word of a path, the share that such a box stays within.
    """
    rng.shuffle(choices)
    design = {}
    for k, (path, value) in enumerate(choices[: rng.integers(0, 5)]):
        low, high = rng.uniform(0.5, 0.95), rng.uniform(1.05, 2.0)
        share = narrow.get(path.rpartition(".")[2], 1.0)
        low, high = max(low, 1.0 - share), min(high, 1.0 + share)
        design[f"y{k}"] = {"parameter": path, "min": value * low, "max": value * high}
    return design


def _candidates(tree: Tree) -> list[tuple[str, float]]:
    mechanism = tree["mechanism"]
    links = mechanism["links"]
    found = [(f"links.{n}.length", link["length"]) for n, link in links.items()]
    found += [(f"bodies.{n}.mass", b["mass"]) for n, b in mechanism["bodies"].items()]
    for m in sorted({link["material"] for link in links.values()}):
        for key in ("youngs_modulus", "density"):
            found.append((f"materials.{m}.{key}", mechanism["materials"][m][key]))
    for s in sorted({link["section"] for link in links.values()}):
        section = mechanism["sections"][s]
        keys = ("diameter", "height", "bending_inertia")
        found += [(f"sections.{s}.{key}", section[key]) for key in keys if key in section]
    for n, c in tree["coordinates"].items():
        if isinstance(c["drive"], dict):
            found.append((f"coordinates.{n}.drive.stiffness", c["drive"]["stiffness"]))
    return found
