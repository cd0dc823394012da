"""The scenes of the ladder: every shipped case, and mechanisms for what these leave out.

x is measured in a box around one point: for a shipped case a sample of its own trajectory, half the
design box, and a sixth of what each coordinate travels. The others have loops, springs, carriages,
and every kind of design parameter: section dimensions, modulus, body mass, spring and drive
stiffness, and a length in an open chain and in a loop, where it moves the passive joints too.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np
from chains import Tree, case_of, two_link
from spatial_examples import arm3r, four_bar, gantry, slider_crank

from eigassign import Case, expand, load_case
from eigassign.mechanism import Pencil
from eigassign.modal import Expansion, Model, eigenvalues, rounding_error

SHIPPED = {p.stem: p for p in sorted((Path(__file__).parents[3] / "cases").glob("*.yaml"))}


@dataclass(frozen=True)
class Scene:
    """A case, its expansion point x0 = (q0, y0), and half-widths ``span`` of a box about it."""

    case: Case
    x0: np.ndarray
    span: np.ndarray
    tree: Tree | None = None

    @cached_property
    def model(self) -> Model:
        return self.case.model()

    @property
    def pencil(self) -> Pencil:
        return self.model.pencil

    @cached_property
    def floor(self) -> float:
        """Round-off of λ at x0."""
        return 2.0 * rounding_error(self.pencil, self.x0, 1)

    @property
    def few(self) -> bool:
        """True where the variables are so few that third order is cheap."""
        return len(self.x0) <= 4

    def expand(self, order: int, model: Model | None = None, **more: Any) -> Expansion:
        q0, y0 = np.split(self.x0, [self.pencil.n_q])
        return expand(model or self.model, q0, y0, (1,), order, **more)

    def lam(self, w: np.ndarray) -> np.ndarray:
        """Exact λ_1 (1,) at x0 + span w."""
        return eigenvalues(self.pencil, (self.x0 + self.span * w)[None], 1)[0]

    def scaled(self, e: Expansion) -> dict[tuple[int, ...], float]:
        """Coefficients over w instead of x, relative to λ at x0."""
        values = e.coefficients[0] * np.prod(self.span**e.indices, axis=1)
        return dict(zip(map(tuple, e.indices.tolist()), values / values[0], strict=True))


def with_design(tree: Tree, **paths: str) -> Tree:
    """Each path with wide bounds: of an elastic modulus, or of a length, mass or stiffness."""
    return {
        **tree,
        "design": {
            name: {"parameter": p, **_bounds(p.endswith("modulus"))} for name, p in paths.items()
        },
    }


def _bounds(modulus: bool) -> dict[str, float]:
    return {"min": 1e6, "max": 1e13} if modulus else {"min": 1e-4, "max": 1e5}


def absolute() -> Tree:
    return two_link(angles=("absolute", "absolute"), masses=(0.125, 0.125))


def branched() -> Tree:
    """An arm with a held and a free joint and designed length, section and drive."""
    held = {"stiffness": 2e3}
    tree = two_link((3, 2), drives=(held, "free"), masses=(0.3, 0.2), tip_inertia=1e-3)
    mechanism = tree["mechanism"]
    mechanism["sections"]["pipe"] = {"shape": "tube", "outer_diameter": 0.03, "thickness": 3e-3}
    mechanism["links"]["hand"] = {"length": 0.2, "material": "al", "section": "pipe", "elements": 2}
    mechanism["joints"]["wrist"] = {
        "type": "revolute", "base": "fore.end", "follower": "hand.start", "angle": 0.4
    }  # fmt: skip
    tree["coordinates"]["q3"] = {"joint": "wrist", "drive": {"stiffness": 400.0}}
    tree = with_design(
        tree,
        length="links.upper.length",
        wall="sections.pipe.thickness",
        drive="coordinates.q3.drive.stiffness",
    )
    tree["design"]["wall"]["max"] = 0.0149  # below the radius
    return tree


def loop() -> Tree:
    tree = four_bar("free")
    tree["mechanism"]["bodies"] = {"pin": {"at": "coupler.end", "mass": 0.3, "inertia": 1e-4}}
    tree["mechanism"]["assembly"] = {"at": {"th": 2.1}, "guess": {"B": -1.5, "D": 2.1, "E": 1.5}}
    return with_design(
        tree, length="links.coupler.length", pin="bodies.pin.mass", height="sections.s.height"
    )


def slider() -> Tree:
    tree = slider_crank("free")
    tree["mechanism"]["springs"] = {
        "seat": {"between": ["rod.end", "ground"], "translational": [0.0, 2e4]}
    }
    tree["mechanism"]["assembly"] = {"at": {"th": 1.0}, "guess": {"B": -1.3, "P": 0.5, "E": 0.3}}
    return with_design(tree, block="links.slider.mass", rod="links.rod.length")


def spatial_arm() -> Tree:
    tree = arm3r("free")
    tree["coordinates"]["elbow"]["drive"] = {"stiffness": 5e3}
    tree = with_design(
        tree,
        wall="sections.s.inner_diameter",
        modulus="materials.m.youngs_modulus",
        length="links.up.length",
        drive="coordinates.elbow.drive.stiffness",
    )
    tree["design"]["wall"]["max"] = 0.039  # below the outer diameter
    return tree


def portal() -> Tree:
    tree = gantry("free")
    tree["mechanism"]["springs"] = {
        "stop": {"between": ["girder.start", "ground"], "translational": 4e5}
    }
    return with_design(tree, trolley="links.trolley.mass", stop="springs.stop.translational")


# the tree, q0, and half-widths of the box in (q, y)
MADE: dict[str, tuple[Callable[[], Tree], list[float], list[float]]] = {
    "absolute": (absolute, [1.817, 5.312], [0.3, 0.3, 0.06, 0.06]),
    "branched": (branched, [0.4, 1.3, -0.6], [0.5, 0.5, 0.5, 0.1, 2.5e-4, 50.0]),
    "loop": (loop, [2.1], [0.25, 0.0125, 0.025, 1.25e-4]),
    "slider": (slider, [1.0], [0.25, 0.05, 0.0125]),
    "spatial_arm": (spatial_arm, [0.3, 0.5, -0.9], [0.3, 0.3, 0.3, 3e-4, 3e9, 0.015, 300.0]),
    "portal": (portal, [0.6], [0.2, 0.75, 1e5]),
}


@cache
def scene(name: str) -> Scene:
    if name in MADE:
        make, q0, span = MADE[name]
        tree = make()
        case = case_of(tree)
        return Scene(case, np.append(q0, case.initial_design), np.array(span), tree)
    case = load_case(SHIPPED[name])
    q = case.trajectory.q
    box = [(p.min, p.max) for p in case.file.design.parameters.values()]
    low, high = np.array(box, dtype=float).reshape(-1, 2).T
    travelled = np.ptp(q, axis=0)
    q_span = np.where(travelled > 0.0, travelled, 0.5) / 6.0
    x0 = np.concatenate([q[len(q) // 3], 0.5 * (low + high)])
    return Scene(case, x0, np.concatenate([q_span, 0.25 * (high - low)]))
