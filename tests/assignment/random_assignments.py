"""Random cases with frequencies to assign, as case files: hard ones for the search of a design.

Arms, loops of four and five bars, trees with two alike branches, thin tubes on soft drives. One to
twelve parameters over up to two decades, linear constraints in a third of them, one to three
targets on modes 1 to 4: what a random design has (so that it can be reached), its mean, what
nothing reaches, or one frequency for two neighbouring modes, which then meet.
"""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import eigassign as ea

DEVELOPMENT = range(48)

Random = np.random.Generator
Tree = dict[str, Any]
MATERIALS = {
    "steel": {"youngs_modulus": 2.1e11, "density": 7850.0, "poissons_ratio": 0.3},
    "alloy": {"youngs_modulus": 7.0e10, "density": 2700.0, "poissons_ratio": 0.33},
}


def random_case(seed: int) -> str:
    """The text of the case file of this seed; always the same."""
    rng = np.random.default_rng([seed, 11])
    family = FAMILIES[seed % len(FAMILIES)]
    case = family(rng)
    case["title"] = f"Random assignment {seed}: {family.__name__.replace('_', ' ')}"
    case["trajectory"] = _trajectory(case.pop("poses"), rng)
    case["design"] = _design(case, rng)
    case["targets"] = _targets(case, rng)
    if seed % 3 == 0:
        case["design"]["constraints"] = _constraints(case, rng)
    return str(yaml.safe_dump(case, sort_keys=False))


def many_parameters(seed: int) -> str:
    """The case of this seed with 6 to 12 parameters and two or three modes at few samples."""
    rng = np.random.default_rng([seed, 77])
    while True:
        family = FAMILIES[int(rng.integers(len(FAMILIES)))]
        case = family(rng)
        case["title"] = f"Many parameters {seed}: {family.__name__.replace('_', ' ')}"
        poses = [[_short(x) for x in pose] for pose in case.pop("poses")]
        samples = int(rng.integers(5, 9))
        case["trajectory"] = {"points": poses, "duration": 1.0, "samples": samples}
        found = list(_candidates(case, rng))
        if len(found) < 6:
            continue
        count = int(rng.integers(6, min(12, len(found)) + 1))
        chosen = [found[k] for k in sorted(rng.choice(len(found), count, replace=False))]
        case["design"] = {
            f"y{k}": {"parameter": path, "min": low, "max": high}
            for k, (path, low, high) in enumerate(chosen)
        }
        try:
            case["targets"] = _of_two_or_three_modes(case, rng)
        except ea.EigassignError:
            continue
        return str(yaml.safe_dump(case, sort_keys=False))


def _of_two_or_three_modes(case: Tree, rng: Random) -> list[Tree]:
    """Targets that one design has, in the mean or along the way, that others have, or none has."""
    loaded = load_text(str(yaml.safe_dump(case, sort_keys=False)))
    path, model = loaded.trajectory, loaded.model()
    curves = np.array([model.frequencies(path.q, _drawn(case, rng), 4) for _ in range(8)])
    modes = sorted(int(k) for k in rng.choice(4, int(rng.integers(2, 4)), replace=False))
    kind = str(rng.choice(["profile", "mean", "mixed", "unreachable"]))
    targets: list[Tree] = []
    for j, mode in enumerate(modes):
        curve = curves[j if kind == "mixed" else 0, :, mode]
        frequency: Any = _short(curve.mean() * (1.2 if kind == "unreachable" else 1.0))
        if kind == "profile":
            at = np.linspace(0.0, 1.0, 4)
            hz = [_short(x) for x in np.interp(at, path.time_s, curve)]
            frequency = {"time": at.tolist(), "frequency": hz}
        targets.append({"mode": mode + 1, "frequency": frequency})
        if rng.random() < 0.4:
            targets[-1]["weight"] = _short(10 ** rng.uniform(-1.0, 1.0))
    return targets


def load_text(text: str) -> ea.Case:
    """The case of a case file's text."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "case.yaml"
        path.write_text(text, encoding="utf-8")
        return ea.load_case(path)


# --- Mechanisms, and the q that their trajectories join


def planar_arm(rng: Random) -> Tree:
    """Two to four links; the first joint free or held, others of every kind."""
    return _arm("planar", int(rng.integers(2, 5)), rng)


def spatial_arm(rng: Random) -> Tree:
    """Two or three links on revolute joints about random axes."""
    return _arm("spatial", int(rng.integers(2, 4)), rng)


def four_bar(rng: Random) -> Tree:
    """Crank and rocker; the crank's motor free or elastic."""
    case = _empty("planar")
    g, a, b, c = 0.5, *rng.uniform([0.1, 0.42, 0.36], [0.14, 0.48, 0.42])
    for name, length in (("crank", a), ("coupler", b), ("rocker", c)):
        _link(case, name, float(length), rng)
    joints = case["mechanism"]["joints"]
    joints["A"] = {"type": "revolute", "base": "ground", "follower": "crank.start"}
    joints["B"] = {"type": "revolute", "base": "crank.end", "follower": "coupler.start"}
    joints["D"] = {"type": "revolute", "base": "ground", "follower": "rocker.start"}
    joints["D"]["position"] = [g, 0.0]
    joints["C"] = {"type": "revolute", "base": "coupler.end", "follower": "rocker.end"}
    start = float(rng.uniform(0.5, 1.5))
    elbow = a * np.array([np.cos(start), np.sin(start)])
    coupler, rocker = _meeting(elbow, np.array([g, 0.0]), b, c)
    guess = {"B": coupler - start, "D": rocker, "C": rocker - coupler}
    case["mechanism"]["assembly"] = {
        "at": {"q0": start},
        "guess": {name: _short(value) for name, value in guess.items()},
    }
    case["coordinates"] = {"q0": {"joint": "A", "drive": _drive(rng, ("free", "held"))}}
    case["poses"] = [[start], [start + float(rng.uniform(0.7, 1.5))]]
    return case


def five_bar(rng: Random) -> Tree:
    """Two cranks on elastic motors, two forearms, a tool where they meet."""
    case = _empty("planar")
    base, crank, arm = rng.uniform([0.15, 0.2, 0.32], [0.25, 0.3, 0.42])
    angles = np.array([2.1, 1.05])
    feet = np.array([[0.0, 0.0], [base, 0.0]])
    for side in ("left", "right"):
        _link(case, f"{side}_crank", float(crank), rng)
        _link(case, f"{side}_arm", float(arm), rng)
    joints = case["mechanism"]["joints"]
    for side, foot in zip(("left", "right"), feet, strict=True):
        joints[f"{side}_motor"] = {
            "type": "revolute",
            "base": "ground",
            "follower": f"{side}_crank.start",
            "position": [_short(x) for x in foot],
        }
        joints[f"{side}_elbow"] = {
            "type": "revolute",
            "base": f"{side}_crank.end",
            "follower": f"{side}_arm.start",
        }
    joints["tool"] = {"type": "revolute", "base": "left_arm.end", "follower": "right_arm.end"}
    elbows = feet + crank * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    left, right = _meeting(elbows[0], elbows[1], arm, arm)
    guess = {"left_elbow": left - angles[0], "right_elbow": right - angles[1], "tool": right - left}
    case["mechanism"]["assembly"] = {
        "at": {"q0": 2.1, "q1": 1.05},
        "guess": {name: _short(value) for name, value in guess.items()},
    }
    case["mechanism"]["bodies"]["tool"] = {"at": "left_arm.end", "mass": 0.4}
    for k, side in enumerate(("left", "right")):
        case["coordinates"][f"q{k}"] = {"joint": f"{side}_motor", "drive": _drive(rng, ("held",))}
    case["poses"] = [(angles + rng.uniform(-0.25, 0.25, 2)).tolist() for _ in range(3)]
    return case


def twin_branches(rng: Random) -> Tree:
    """A hub with two nearly alike arms on elastic joints, whose modes cross."""
    case = _empty("planar")
    _link(case, "hub", 0.3, rng)
    joints, coordinates = case["mechanism"]["joints"], case["coordinates"]
    joints["j0"] = {"type": "revolute", "base": "ground", "follower": "hub.start"}
    coordinates["q0"] = {"joint": "j0", "drive": _drive(rng, ("held", "locked"))}
    for side in ("left", "right"):
        _link(case, side, 0.5 * float(rng.choice([1.0, 1.0, 1.001, 1.02])), rng)
        if side == "right":
            case["mechanism"]["sections"]["right"] = dict(case["mechanism"]["sections"]["left"])
            case["mechanism"]["links"]["right"]["material"] = case["mechanism"]["links"]["left"][
                "material"
            ]
        joints[side] = {"type": "revolute", "base": "hub.end", "follower": f"{side}.start"}
        coordinates[side] = {"joint": side, "drive": {"stiffness": 3000.0}}
        case["mechanism"]["bodies"][side] = {"at": f"{side}.end", "mass": 0.3}
    turn = float(rng.uniform(0.3, 1.0))
    case["poses"] = [[0.0, 0.8, -0.8], [0.4, 0.8 - turn, -0.8 - turn]]
    return case


def thin_tubes(rng: Random) -> Tree:
    """Two thin tubes on soft drives: stiffnesses of very unlike size to choose."""
    case = _empty("planar")
    for k, length in enumerate((0.6, 0.45)):
        name = f"l{k}"
        case["mechanism"]["sections"][name] = {
            "shape": "tube",
            "outer_diameter": _short(rng.uniform(0.03, 0.06)),
            "thickness": _short(10 ** rng.uniform(-3.0, -2.4)),
        }
        case["mechanism"]["links"][name] = {
            "length": length,
            "material": "alloy",
            "section": name,
            "elements": 3,
        }
        case["mechanism"]["bodies"][name] = {"at": f"{name}.end", "mass": _short(rng.uniform(0, 1))}
        case["mechanism"]["joints"][f"j{k}"] = {
            "type": "revolute",
            "base": "l0.end" if k else "ground",
            "follower": f"{name}.start",
        }
        case["coordinates"][f"q{k}"] = {
            "joint": f"j{k}",
            "drive": {"stiffness": _short(10 ** rng.uniform(2.5, 4.5))},
        }
    case["poses"] = [[0.2, 0.3], [0.9, 1.2], [0.4, 2.2]]
    return case


def sprung_gantry(rng: Random) -> Tree:
    """A clamped portal with a travelling carriage, held sideways by a spring."""
    case = _empty("planar")
    for name, length, elements in (("left", 0.8, 2), ("girder", 1.6, 4), ("right", 0.8, 2)):
        _link(case, name, length, rng)
        case["mechanism"]["links"][name]["elements"] = elements
    m = case["mechanism"]
    m["links"]["carriage"] = {"type": "rigid", "mass": _short(rng.uniform(1, 6))}
    corners = {
        "left_foot": ("ground", "left.start", "90 deg"),
        "left_corner": ("left.end", "girder.start", "-90 deg"),
        "right_corner": ("girder.end", "right.start", "-90 deg"),
        "right_foot": ("ground", "right.end", "-90 deg"),
    }
    m["joints"] = {
        name: {"type": "fixed", "base": base, "follower": follower, "angle": angle}
        for name, (base, follower, angle) in corners.items()
    }
    m["joints"]["right_foot"]["position"] = [1.6, 0.0]
    m["joints"]["rail"] = {"type": "carriage", "base": "girder", "follower": "carriage.start"}
    m["springs"] = {
        "stay": {
            "between": ["girder.end", "ground"],
            "translational": _short(10 ** rng.uniform(4, 6)),
        }
    }
    case["coordinates"] = {"x": {"joint": "rail", "drive": "locked"}}
    case["poses"] = [[0.3], [float(rng.uniform(0.9, 1.3))]]
    return case


FAMILIES: tuple[Callable[[Random], Tree], ...] = (
    planar_arm, spatial_arm, twin_branches, four_bar, thin_tubes, planar_arm, five_bar, spatial_arm,
    sprung_gantry, twin_branches, thin_tubes,
)  # fmt: skip


def _empty(space: str) -> Tree:
    mechanism: Tree = {"space": space, "materials": {k: dict(v) for k, v in MATERIALS.items()}}
    if space == "planar":
        for material in mechanism["materials"].values():
            del material["poissons_ratio"]
    return {
        "title": "",
        "mechanism": {**mechanism, "sections": {}, "links": {}, "joints": {}, "bodies": {}},
        "coordinates": {},
        "poses": [],
    }


def _arm(space: str, count: int, rng: Random) -> Tree:
    case = _empty(space)
    for k in range(count):
        name = f"l{k}"
        _link(case, name, float(rng.uniform(0.3, 0.7)), rng)
        joint: Tree = {
            "type": "revolute",
            "base": f"l{k - 1}.end" if k else "ground",
            "follower": f"{name}.start",
        }
        if space == "spatial":
            joint["axis"] = [_short(x) for x in rng.normal(size=3)]
            joint["orientation"] = [_short(x) for x in rng.uniform(-1.5, 1.5, 3)]
        case["mechanism"]["joints"][f"j{k}"] = joint
        drives = ("held", "held", "free") if k == 0 else ("held", "held", "free", "locked")
        case["coordinates"][f"q{k}"] = {"joint": f"j{k}", "drive": _drive(rng, drives)}
        if rng.random() < 0.7:
            mass = 0.0 if rng.random() < 0.4 else _short(10 ** rng.uniform(-1.0, 0.5))
            case["mechanism"]["bodies"][name] = {"at": f"{name}.end", "mass": mass}
    first = rng.uniform(-1.0, 1.0, count)
    moves = rng.uniform(-1.2, 1.2, (int(rng.integers(1, 3)), count))
    case["poses"] = [first.tolist(), *(first + moves).tolist()]
    return case


def _link(case: Tree, name: str, length: float, rng: Random) -> None:
    """A beam with a section of its own."""
    d = float(rng.uniform(0.015, 0.04))
    shape = str(rng.choice(["circle", "tube", "rectangle"]))
    section: Tree = {"shape": shape}
    if shape == "circle":
        section["diameter"] = _short(d)
    elif shape == "tube":
        section |= {
            "outer_diameter": _short(1.4 * d),
            "thickness": _short(rng.uniform(0.1, 0.3) * d),
        }
    else:
        spatial = case["mechanism"]["space"] == "spatial"  # where the width stays the longer side
        wide = 3.5 if spatial else rng.uniform(0.7, 1.6)
        section |= {"width": _short(wide * d), "height": _short(d)}
    case["mechanism"]["sections"][name] = section
    case["mechanism"]["links"][name] = {
        "length": _short(length),
        "material": str(rng.choice(["steel", "alloy"])),
        "section": name,
        "elements": int(rng.integers(2, 4)),
    }


def _drive(rng: Random, kinds: tuple[str, ...]) -> Any:
    kind = str(rng.choice(kinds))
    return {"stiffness": _short(10 ** rng.uniform(3.0, 5.0))} if kind == "held" else kind


def _meeting(a: np.ndarray, b: np.ndarray, ra: float, rb: float) -> tuple[float, float]:
    """Angles of the bars from a and from b to where they meet, to the left of the way a → b."""
    gap = b - a
    far = float(np.hypot(*gap))
    along = (far**2 + ra**2 - rb**2) / (2.0 * far)
    across = np.sqrt(ra**2 - along**2)
    meet = a + (along * gap + across * np.array([-gap[1], gap[0]])) / far
    return tuple(float(np.arctan2(*(meet - end)[::-1])) for end in (a, b))  # type: ignore


# --- Trajectory, design, targets, constraints


def _trajectory(poses: list[list[float]], rng: Random) -> Any:
    samples = int(rng.integers(60, 151))
    poses = [[_short(x) for x in pose] for pose in poses]
    second = list(poses[1])  # a case file has no aliases
    whole: Tree = {"points": poses, "duration": 1.0, "samples": samples}
    if len(poses) < 3 or rng.random() < 0.5:
        return whole
    there = {"name": "there", "points": poses[:2], "duration": 1.0, "samples": samples // 2}
    back = {
        "name": "back",
        "points": [second, *poses[2:]],
        "duration": 0.6,
        "samples": samples // 2,
    }
    return [there, {**back, "weight": 0.5}]


def _design(case: Tree, rng: Random) -> Tree:
    """One to twelve of the mechanism's numbers, between bounds that hold its own."""
    found = list(_candidates(case, rng))
    count = min(len(found), 1 + int(12 * rng.random() ** 1.3))
    chosen = [found[k] for k in sorted(rng.choice(len(found), count, replace=False))]
    return {
        f"y{k}": {"parameter": path, "min": low, "max": high}
        for k, (path, low, high) in enumerate(chosen)
    }


def _candidates(case: Tree, rng: Random) -> Any:
    """Path and bounds of what can vary."""
    m, wide = case["mechanism"], float(rng.choice([0.15, 0.5, 1.0]))  # decades to each side

    def span(value: float, most: float = 1.0) -> tuple[float, float]:
        down, up = 10.0 ** (min(wide, most) * rng.uniform(0.2, 1.0, 2))
        return _short(value / down), _short(value * up)

    for name, body in m["bodies"].items():
        if body["mass"] == 0.0:
            yield f"bodies.{name}.mass", 0.0, _short(rng.uniform(0.3, 3.0))
        else:
            yield f"bodies.{name}.mass", *span(body["mass"])
    for name, section in m["sections"].items():
        if section["shape"] == "tube":
            low, high = span(section["thickness"])
            yield (
                f"sections.{name}.thickness",
                low,
                min(high, _short(0.4 * section["outer_diameter"])),
            )
        else:
            for key in ("diameter", "width", "height"):
                if key in section and (key, m["space"]) != ("width", "spatial"):
                    yield f"sections.{name}.{key}", *span(section[key], 0.5)
    for name, coordinate in case["coordinates"].items():
        if isinstance(coordinate["drive"], dict):
            yield f"coordinates.{name}.drive.stiffness", *span(coordinate["drive"]["stiffness"])
    for name, spring in m.get("springs", {}).items():
        yield f"springs.{name}.translational", *span(spring["translational"])
    for name in sorted({link["material"] for link in m["links"].values() if "material" in link}):
        yield f"materials.{name}.youngs_modulus", *span(m["materials"][name]["youngs_modulus"], 0.3)
        yield f"materials.{name}.density", *span(m["materials"][name]["density"], 0.2)


def _bounds(case: Tree) -> tuple[np.ndarray, np.ndarray]:
    entries = [e for name, e in case["design"].items() if name != "constraints"]
    return np.array([e["min"] for e in entries]), np.array([e["max"] for e in entries])


def _drawn(case: Tree, rng: Random) -> np.ndarray:
    """A random design: uniform, in the logarithm where the bounds span more than a decade."""
    low, high = _bounds(case)
    u, far = rng.random(len(low)), (low > 0.0) & (high > 10.0 * low)
    base = np.where(far, low, 1.0)
    return np.where(far, base * (np.where(far, high, 1.0) / base) ** u, low + u * (high - low))


def _targets(case: Tree, rng: Random) -> list[Tree]:
    loaded = load_text(str(yaml.safe_dump(case, sort_keys=False)))
    path, model = loaded.trajectory, loaded.model()
    designs = [_drawn(case, rng) for _ in range(8)]
    curves = np.array([model.frequencies(path.q, y, 4) for y in designs])  # (8, n, 4)
    count = int(rng.integers(1, 4))
    modes = sorted(int(k) for k in rng.choice(4, count, replace=False))
    kind = str(rng.choice(["profile", "mean", "mean", "unreachable", "together"]))
    if kind == "together":
        low = int(rng.integers(0, 2))
        both = float(np.sqrt(curves[0, :, low].mean() * curves[0, :, low + 1].mean()))
        return [{"mode": low + k, "frequency": _short(both)} for k in (1, 2)]
    several = path.several
    targets = []
    for mode in modes:
        curve = curves[0, :, mode]
        target: Tree = {"mode": mode + 1, "frequency": _short(curve.mean())}
        if kind == "unreachable":
            target["frequency"] = _short(1.5 * curves[..., mode].max())
        elif kind == "profile":
            rows = path.rows[0]
            t, f = path.time_s[rows], curve[rows]
            at = np.linspace(0.0, 1.0, int(rng.integers(3, 7)))
            profile = {"time": at.tolist(), "frequency": [_short(x) for x in np.interp(at, t, f)]}
            target["frequency"] = profile
            if several:
                target["trajectory"] = "there"
        if rng.random() < 0.4:
            target["weight"] = _short(10 ** rng.uniform(-1.0, 1.0))
        targets.append(target)
    return targets


def _constraints(case: Tree, rng: Random) -> Tree:
    """One or two limits on sums of parameters, each relative to its range; the file's design meets
    them.
    """
    loaded = load_text(str(yaml.safe_dump(case, sort_keys=False)))
    low, high = _bounds(case)
    initial = loaded.initial_design
    limits = {}
    for k in range(int(rng.integers(1, 3))):
        chosen = rng.random(len(low)) < 0.7
        if not chosen.any():
            chosen[int(rng.integers(len(low)))] = True
        signs = rng.choice([1.0, 1.0, -1.0], len(low))
        coefficients = np.array([_short(a) for a in signs / (high - low)]) * chosen
        terms = {f"y{j}": float(a) for j, a in enumerate(coefficients) if a}
        now = float(coefficients @ initial)
        most = float(np.maximum(coefficients * low, coefficients * high).sum())
        limits[f"limit{k}"] = {
            "terms": terms,
            "max": now + float(rng.uniform(0.05, 0.4)) * (most - now),
        }
    return limits


def _short(value: float) -> float:
    """Four digits."""
    return float(f"{value:.4g}")
