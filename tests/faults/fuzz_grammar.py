"""Case files by grammar: mechanisms of every kind of part, most of them possible, few sensible.

A number is of an ordinary size, now and then an extreme one; a name is mostly one that exists.
"""

from __future__ import annotations

from random import Random
from typing import Any

from fuzz_mutations import EXTREME, WORDS, written
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

Tree = dict[str, Any]
SHAPES = {
    "circle": ("diameter",),
    "tube": ("outer_diameter", "thickness"),
    "rectangle": ("width", "height"),
    "box": ("height", "width", "thickness"),
    "i_profile": ("height", "width", "flange_thickness", "web_thickness"),
}
FREEDOMS = {
    "revolute": ("turn",),
    "prismatic": ("slide",),
    "fixed": (),
    "cylindrical": ("slide", "turn"),
    "screw": ("turn",),
    "universal": ("turn", "turn"),
    "spherical": ("turn", "turn", "turn"),
    "carriage": ("ride",),
    "nut": ("ride",),
}
PLANAR = ("revolute", "revolute", "revolute", "prismatic", "fixed", "carriage")
SPATIAL = (*PLANAR, "cylindrical", "screw", "universal", "spherical", "nut")
COMPONENTS = {
    "cylindrical": ("translation", "rotation"),
    "universal": (1, 2),
    "spherical": (1, 2, 3),
}


@st.composite
def cases(draw: st.DrawFn) -> str:
    """Text of a case file."""
    chance = draw(st.randoms(use_true_random=True))
    writer = _Writer(chance, draw(st.sampled_from(_RISKS)))
    return written(writer.case()) + "\n"


_RISKS = (0.0, 0.0, 0.005, 0.02, 0.1)  # how often a number or word is not an ordinary one


def many_cases(count: int, start: int) -> list[str]:
    """``count`` of them, the same for the same ``start``."""
    texts: list[str] = []

    @seed(start)
    @settings(
        max_examples=count,
        database=None,
        deadline=None,
        derandomize=False,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(cases())
    def collect(text: str) -> None:
        texts.append(text)

    collect()
    return texts


class _Writer:
    """One case, drawn from ``chance``; each value is a stray one with probability ``risk``."""

    def __init__(self, chance: Random, risk: float) -> None:
        self.chance, self.risk = chance, risk
        self.spatial = chance.random() < 0.4
        self.n = 3 if self.spatial else 2
        self.properties: dict[str, tuple[float, str]] = {}  # path: value and unit
        self.nodes: list[str] = []

    def likely(self, share: float) -> bool:
        return self.chance.random() < share

    def pick(self, *values: Any) -> Any:
        return self.chance.choice(WORDS) if self.likely(self.risk) else self.chance.choice(values)

    def number(self, low: float, high: float, unit: str = "", path: str = "") -> str:
        if self.likely(self.risk):
            return self.chance.choice(EXTREME) + unit
        value = (
            low * (high / low) ** self.chance.random()
            if low > 0
            else (low + (high - low) * self.chance.random())
        )
        if path:
            self.properties[path] = (value, unit)
        return f"{value:.4g}{unit}"

    def vector(self, size: float) -> list[str]:
        return [self.pick("0", self.number(-size, size)) for _ in range(self.n)]

    def some(self, most: int, least: int = 0) -> int:
        return self.chance.randint(least, most)

    def case(self) -> Tree:
        mechanism: Tree = {"space": "spatial" if self.spatial else "planar"}
        mechanism["materials"] = {f"m{k}": self.material(k) for k in range(self.some(2, 1))}
        mechanism["sections"] = {f"s{k}": self.section(k) for k in range(self.some(3, 1))}
        self.materials, self.sections = list(mechanism["materials"]), list(mechanism["sections"])
        links: Tree = {}
        joints: Tree = {}
        self.beams: list[str] = []
        ends: dict[str, list[str]] = {}
        for k in range(self.some(4, 1)):
            name = f"l{k}"
            links[name], ends[name] = self.link(name)
            joints[f"j{k}"] = self.joint(k, name)
            self.nodes += [f"{name}.{end}" for end in ends[name]]
            self.beams += [name] if links[name].get("type", "beam") == "beam" else []
        mechanism |= {"links": links, "joints": joints}
        mechanism["bodies"] = {f"b{k}": self.body(k) for k in range(self.some(2))}
        mechanism["springs"] = {f"k{k}": self.spring(k) for k in range(self.some(1))}
        coordinates = self.coordinates(joints)
        if self.likely(0.15):
            joints["closing"] = self.closing()
            if self.likely(0.5):
                mechanism["assembly"] = self.assembly(joints, coordinates)
            kept = list(coordinates)[: self.some(max(len(coordinates), 1), 1)]
            coordinates = {q: coordinates[q] for q in kept}
        self.kinds = [self.kind_of[q] for q in coordinates]
        self.names = list(coordinates)
        case: Tree = {"title": "Drawn", "mechanism": mechanism, "coordinates": coordinates}
        case |= self.study()
        if self.likely(self.risk):
            del case[self.chance.choice(list(case))]
        return {key: value for key, value in case.items() if value != {}}

    # --- the mechanism

    def material(self, k: int) -> Tree:
        path = f"materials.m{k}"
        found = {
            "youngs_modulus": self.number(1e9, 3e11, "", f"{path}.youngs_modulus"),
            "density": self.number(500, 9000, "", f"{path}.density"),
        }
        found[self.pick("poissons_ratio")] = self.number(0.1, 0.4)
        return found

    def section(self, k: int) -> Tree:
        path = f"sections.s{k}"
        shape = self.pick(*SHAPES, "bare")
        if shape == "bare" or shape not in SHAPES:
            inertias = ["inertia_y", "inertia_z", "torsion_constant"]
            keys = inertias if self.spatial else ["bending_inertia"]
            found = {"area": self.number(1e-4, 1e-3, "", f"{path}.area")}
            return found | {key: self.number(1e-9, 1e-7, "", f"{path}.{key}") for key in keys}
        found = {"shape": shape}
        for key in SHAPES[shape]:
            wall = "thickness" in key
            size = (1.0, 4.0) if wall else (10.0, 80.0)
            found[key] = self.number(*size, " mm", f"{path}.{key}")
        return found

    def link(self, name: str) -> tuple[Tree, list[str]]:
        kind = self.pick("beam", "beam", "beam", "rigid", "frame", "superelement")
        if kind == "rigid":
            return self.rigid(name), ["start", "end"]
        if kind == "frame":
            return self.frame(), ["start", "a", "b"]
        if kind == "superelement" and not self.spatial:
            return self.superelement(), ["start", "end"]
        beam: Tree = {
            "length": self.number(0.05, 2.0, "", f"links.{name}.length"),
            "material": self.pick(*self.materials),
            "section": self.pick(*self.sections),
            "elements": self.pick("1", "2", "3", "4", "6", "auto"),
        }
        if self.likely(0.2):
            beam["section"] = {"start": beam["section"], "end": self.pick(beam["section"])}
        if self.likely(0.3):
            beam["shear"] = self.pick("true", "false")
        if self.likely(0.1 if self.spatial else self.risk):
            beam["roll"] = self.number(-90, 90, " deg")
        if self.likely(0.1):
            beam["reduce_to"] = self.pick("auto", "2 kHz", self.number(1, 1e5, " Hz"))
        return beam, ["start", "end"]

    def inertia(self) -> Any:
        if not self.spatial:
            return self.number(1e-4, 1e-1)
        size = 10 ** self.chance.uniform(-4, -1)
        return [self.number(size, 1.5 * size) for _ in range(3)]

    def rigid(self, name: str) -> Tree:
        return {
            "type": "rigid",
            "length": self.number(0.01, 1.0),
            "mass": self.number(0.1, 20.0, "", f"links.{name}.mass"),
            "inertia": self.inertia(),
        }

    def frame(self) -> Tree:
        def beam(start: str, end: str) -> Tree:
            ends = {"from": self.pick(start), "to": self.pick(end)}
            material = {"material": self.pick(*self.materials)}
            return {**ends, **material, "section": self.pick(*self.sections)}

        more = ["0"] * (self.n - 2)
        a, b = ([self.number(0.1, 1.0), self.number(*y), *more] for y in ((0.1, 1), (-1, -0.1)))
        nodes = {"start": ["0"] * self.n, "a": a, "b": b}
        beams = {"x": beam("start", "a"), "y": beam("a", "b"), "z": beam("b", "start")}
        return {"type": "frame", "nodes": nodes, "beams": beams}

    def superelement(self) -> Tree:
        ends = {
            "start": {"position": ["0", "0"], "dofs": ["0", "1", "2"]},
            "end": {"position": ["0.45", "0"], "dofs": ["72", "73", self.pick("74")]},
        }
        files = {key: f"superelement_arm/{key}.mtx" for key in ("stiffness", "mass")}
        return {"type": "superelement", **files, "nodes": ends}

    def joint(self, k: int, link: str) -> Tree:
        kind = self.pick(*(SPATIAL if self.spatial else PLANAR))
        base = self.pick("ground", *self.nodes) if k else "ground"
        if kind in ("carriage", "nut"):
            if self.beams:
                base = self.pick(*self.beams)
            else:
                kind = "revolute"
        joint: Tree = {"type": kind, "base": base, "follower": f"{link}.start"}
        if kind in ("screw", "nut"):
            joint["lead"] = self.number(1, 50, " mm")
        if kind == "universal":
            joint["axes"] = [["0", "1", "0"], ["0", "0", "1"]]
        if kind in ("revolute", "prismatic") and (self.spatial or kind == "prismatic"):
            joint["axis"] = self.vector(1.0) if self.likely(0.3) else ["1"] + ["0"] * (self.n - 1)
        if self.likely(0.2):
            joint["position"] = self.vector(0.5)
        if self.likely(0.3):
            turn = [self.number(-180, 180, " deg") for _ in range(3)]
            joint["orientation" if self.spatial else "angle"] = turn if self.spatial else turn[0]
        return joint

    def body(self, k: int) -> Tree:
        mass = self.number(0.1, 10.0, "", f"bodies.b{k}.mass")
        return {"at": self.pick(*self.nodes), "mass": mass, "inertia": self.inertia()}

    def spring(self, k: int) -> Tree:
        stiffness = self.number(10.0, 1e6, "", f"springs.k{k}.translational")
        return {
            "between": [self.pick(*self.nodes), self.pick("ground")],
            "translational": stiffness,
        }

    def coordinates(self, joints: Tree) -> Tree:
        found: Tree = {}
        self.kind_of: dict[str, str] = {}
        for name, joint in joints.items():
            freedoms = FREEDOMS.get(joint["type"], ())
            for i, kind in enumerate(freedoms):
                q = f"q{len(found)}"
                found[q] = {"joint": name}
                if len(freedoms) > 1:
                    found[q]["component"] = str(COMPONENTS[joint["type"]][i])
                drive = self.pick("free", "locked", "held", "held", "held")
                if drive == "held":
                    path = f"coordinates.{q}.drive.stiffness"
                    drive = {"stiffness": self.number(1e3, 1e6, "", path)}
                    if self.likely(0.3):
                        drive["inertia"] = self.number(1e-4, 1.0)
                found[q]["drive"] = drive
                self.kind_of[q] = kind
        return found

    def closing(self) -> Tree:
        kind = self.pick("revolute", "revolute", "fixed", "prismatic")
        place = {"base": self.pick("ground"), "position": self.vector(1.0)}
        return {"type": kind, "follower": self.nodes[-1], **place}

    def assembly(self, joints: Tree, coordinates: Tree) -> Tree:
        at = {q: self.number(-1, 1) for q in coordinates if self.likely(0.5)}
        return {"at": at, "guess": {j: self.number(-1, 1) for j in joints if self.likely(0.5)}}

    # --- what is asked of it

    def q(self) -> list[str]:
        sizes = {"turn": (-2.0, 2.0), "slide": (-0.3, 0.3), "ride": (0.01, 0.3)}
        return [self.number(*sizes[kind]) for kind in self.kinds]

    def study(self) -> Tree:
        found: Tree = {}
        if self.likely(0.85):
            several = [self.trajectory() for _ in range(self.some(3, 1))]
            found["trajectory"] = several if self.likely(0.2) else several[0]
        if self.likely(0.8):
            found["design"] = self.design()
        if self.likely(0.8):
            found["targets"] = [self.target() for _ in range(self.some(3, 1))]
        found["assignment"] = {"starts": "1", "steps": "2", "seconds": "1"}
        if self.likely(0.2):
            found["assignment"]["method"] = self.pick("one_shot", "sequential")
        if self.likely(0.2):
            found["assignment"]["objective"] = self.pick("worst_case", "least_squares")
        if self.likely(0.5):
            found["expansion"] = {"order": self.pick("1", "2", "3", "4", "6", "auto", "8", "20")}
            if self.likely(0.3):
                found["expansion"]["q"] = self.q()
        if self.likely(0.3):
            found["validation"] = {"max_error": self.number(0.1, 10, " %")}
        return found

    def trajectory(self) -> Tree:
        kind = self.pick("q", "points", "tip")
        samples = self.pick("2", "3", "5", "20", "101")
        duration = self.number(0.01, 10, " s")
        if kind == "q":
            return {"q": [self.q() for _ in range(self.some(6, 2))], "duration": duration}
        if kind == "points":
            points = [self.q() for _ in range(self.some(4, 2))]
            return {"points": points, "duration": duration, "samples": samples}
        ways = [self.vector(0.7) for _ in range(self.some(4, 2))]
        tip = self.pick(*self.nodes)
        path = self.pick("spline", "straight")
        return {
            "tip": tip,
            "waypoints": ways,
            "duration": duration,
            "samples": samples,
            "path": path,
        }

    def design(self) -> Tree:
        found: Tree = {}
        paths = [p for p in self.properties if self.likely(0.4)] or list(self.properties)[:1]
        for k, path in enumerate(paths[:4]):
            value, unit = self.properties[path]
            low, high = value * self.chance.uniform(0.5, 1.0), value * self.chance.uniform(1.0, 1.6)
            entry: Tree = {"parameter": self.pick(path)}
            if self.likely(0.2):
                entry["values"] = [f"{v:.4g}{unit}" for v in (low, (low + high) / 2, high)]
            else:
                entry |= {"min": f"{low:.4g}{unit}", "max": f"{high:.4g}{unit}"}
            if self.likely(0.2):
                entry["price"] = self.number(0.1, 10)
            if self.likely(0.2):
                entry["tolerance"] = self.number(0.1, 5, " %")
            found[f"y{k}"] = entry
        if self.likely(0.1):
            found["constraints"] = {"c": {"terms": {"y0": "1"}, "max": self.number(0.1, 1e6)}}
        if self.likely(0.1):
            found["mass"] = {"max": self.number(0.1, 100)}
        return found

    def target(self) -> Tree:
        hz = self.number(1, 1000, " Hz")
        mode = self.pick("1", "1", "1", "2", "3", "{like: 1, at: {time: 0}}")
        kind = self.pick("frequency", "frequency", "at_least", "at_most", "keep_out", "gap")
        if kind == "keep_out":
            return {"keep_out": {"harmonic": "2", "of": hz, "margin": self.number(1, 20, " %")}}
        if kind == "gap":
            return {"gap": {"between": ["1", "2"], "at_least": hz}}
        if mode.startswith("{"):
            return {"mode": {"like": "1", "at": {"time": self.number(0, 0.01)}}, kind: hz}
        return {"mode": mode, kind: hz, "weight": self.number(0.1, 10)}
