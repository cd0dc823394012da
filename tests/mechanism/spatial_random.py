"""Random mechanisms, planar and spatial, open and with loops, in the language of a case file."""

import copy
from functools import cache
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from spatial_cases import ALLOY, STEEL
from spatial_oracle import (
    FREEDOMS,
    Pose,
    Tree,
    condition,
    mount,
    point,
    relative,
    solve_pose,
    split_coordinates,
    walk,
)

Random = np.random.Generator
PLANAR = ("revolute", "revolute", "revolute", "prismatic", "fixed", "carriage")
SPATIAL = (
    "revolute", "revolute", "prismatic", "cylindrical", "universal", "spherical", "screw",
    "fixed", "carriage", "nut",
)  # fmt: skip
WAY = np.linspace(0.125, 1.0, 8)  # from one configuration to the other
PARTS = {"cylindrical": ["translation", "rotation"], "universal": [1, 2], "spherical": [1, 2, 3]}

# Draws that hold every kind of part, all together: see test_spatial
EVERY_TREE = [  # seed, space, swap
    *((seed, "planar", swap) for seed, swap in ((68, True), (8, False), (7, False), (16, True))),
    *((seed, "spatial", False) for seed in (32, 72)),
    *((seed, "spatial", True) for seed in (89, 97, 5, 10, 36, 45)),
]
EVERY_LOOP = [  # seed, space, loops, swap
    *((seed, "planar", 1, True) for seed in (9, 0, 7)),
    *((seed, "planar", 1, False) for seed in (1, 10)),
    *((seed, "spatial", 1, False) for seed in (0, 6, 4)),
    *((seed, "spatial", 1, True) for seed in (2, 4, 6, 8, 13, 15)),
]


def geared(tree: Tree, seed: int) -> Tree:
    """The tree with an inertia on the drive of every coordinate that is not locked."""
    rng = np.random.default_rng(seed)
    for data in tree["coordinates"].values():
        given: Any = data.get("drive", "free")
        if given != "locked":
            held = given if isinstance(given, dict) else {}
            data["drive"] = {**held, "inertia": float(10 ** rng.uniform(-2, 1))}
    return tree


def empty(space: str, rng: Random) -> Tree:
    d = rng.uniform(0.02, 0.04)
    sections = {
        "round": {"shape": "circle", "diameter": d},
        "thin": {"shape": "circle", "diameter": 0.6 * d},
        "pipe": {"shape": "tube", "outer_diameter": 0.04, "thickness": 0.004},
        "pipe_in": {"shape": "tube", "outer_diameter": 0.05, "inner_diameter": 0.04},
        "flat": {"shape": "rectangle", "width": 0.02, "height": rng.uniform(0.01, 0.04)},
        "profile": {
            "shape": "i_profile", "height": 0.06, "width": 0.04,
            "flange_thickness": 0.005, "web_thickness": 0.004,
        },
        "bare": {"area": 5e-4, "inertia_z": 3e-8, "inertia_y": 6e-8, "torsion_constant": 5e-8,
                 "polar_inertia": 1e-7},
        "plain": {"area": 5e-4, "bending_inertia": 3e-8},
    }  # fmt: skip
    sections.pop("plain" if space == "spatial" else "bare")
    mechanism = {
        "space": space,
        "materials": {"steel": STEEL, "alloy": ALLOY},
        "sections": sections,
        "links": {},
        "joints": {},
        "bodies": {},
    }
    return {"mechanism": mechanism, "coordinates": {}}


def vector(space: str, rng: Random, size: float) -> list[float]:
    return rng.uniform(-size, size, 2 if space == "planar" else 3).tolist()


def add_link(tree: Tree, rng: Random, kinds: tuple[str, ...] = ("beam", "rigid", "frame")) -> str:
    m, space = tree["mechanism"], tree["mechanism"]["space"]
    name = f"l{len(m['links'])}"
    weights = np.array([{"beam": 6, "rigid": 2, "frame": 2}[kind] for kind in kinds])
    kind = str(rng.choice(kinds, p=weights / sum(weights)))
    material = str(rng.choice(["steel", "alloy"]))
    if kind == "beam":
        link = beam(m, space, material, rng)
        link["length"], link["elements"] = float(rng.uniform(0.3, 0.8)), int(rng.integers(1, 4))
    elif kind == "rigid":
        link = {"type": "rigid", "nodes": {"a": vector(space, rng, 0.3)}, "mass": 1.5}
        link["inertia"] = 0.02 if space == "planar" else [0.02, 0.03, 0.025, 2e-3, -1e-3, 3e-3]
        link["center"] = vector(space, rng, 0.1)
        if rng.random() < 0.5:
            link["length"] = 0.3
    else:
        nodes = {"start": [0.0] * (2 if space == "planar" else 3)}
        nodes |= {k: vector(space, rng, 0.4) for k in ("a", "b")}
        link = {"type": "frame", "nodes": nodes, "beams": {}}
        for k, (i, j) in enumerate((("start", "a"), ("a", "b"), ("b", "start"))):
            link["beams"][f"b{k}"] = {
                "from": i, "to": j, **beam(m, space, material, rng, taper=False),
                "elements": int(rng.integers(1, 3)),
            }  # fmt: skip
    m["links"][name] = link
    return name


def beam(m: Tree, space: str, material: str, rng: Random, taper: bool = True) -> Tree:
    out: Tree = {"material": material, "section": str(rng.choice(list(m["sections"])))}
    if taper and rng.random() < 0.2:
        out["section"] = {"start": "round", "end": "thin"}
    if rng.random() < 0.3:
        out["shear"] = True
    if space == "spatial" and rng.random() < 0.5:
        out["roll"] = float(rng.uniform(-1.5, 1.5))
    return out


def nodes(tree: Tree, link: str) -> list[str]:
    data = tree["mechanism"]["links"][link]
    if data.get("type", "beam") == "beam":
        return ["start", "end"]
    return list({"start": 0, **data.get("nodes", {}), **({"end": 0} if "length" in data else {})})


def last_node(tree: Tree) -> str:
    link = list(tree["mechanism"]["links"])[-1]
    return f"{link}.{nodes(tree, link)[-1]}"


def joint_of(space: str, kind: str, rng: Random) -> Tree:
    joint: Tree = {"type": kind}
    if kind in ("prismatic", "revolute", "cylindrical", "screw") and rng.random() < 0.7:
        if space == "spatial":
            joint["axis"] = rng.normal(size=3).tolist()
        elif kind == "prismatic":
            joint["axis"] = rng.normal(size=2).tolist()
    if kind == "prismatic" and "axis" not in joint:
        joint["axis"] = [1.0, 0.0] if space == "planar" else [1.0, 0.0, 0.0]
    if kind in ("cylindrical", "screw") and "axis" not in joint:
        joint["axis"] = [0.0, 0.0, 1.0]
    if kind == "universal":
        a = rng.normal(size=3)
        joint["axes"] = [a.tolist(), np.cross(a, rng.normal(size=3)).tolist()]
    if kind in ("screw", "nut"):
        joint["lead"] = float(rng.choice([0.05, -0.3, 0.8]))
    if rng.random() < 0.6:
        if space == "planar":
            joint["angle"] = float(rng.uniform(-2.5, 2.5))
        else:
            joint["orientation"] = rng.uniform(-2.5, 2.5, 3).tolist()
    if rng.random() < 0.5:
        joint["position"] = vector(space, rng, 0.2)
        if kind == "nut":
            joint["position"][1:] = [0.0, 0.0]  # on the axis of its shaft
    return joint


def add_joint(
    tree: Tree,
    rng: Random,
    link: str,
    base: str,
    drives: tuple[Any, ...],
    absolute: bool,
    swap: bool = False,
) -> dict[str, float]:
    """Hang ``link`` on the link ``base`` or "ground" by a random joint; its coordinates' values.

    With ``swap`` the joint's own base may be ``link``.
    """
    m, space = tree["mechanism"], tree["mechanism"]["space"]
    if swap and base != "ground" and rng.random() < 0.5:
        link, base, absolute = base, link, False
    kind = str(rng.choice(PLANAR if space == "planar" else SPATIAL))
    rides = kind in ("carriage", "nut")
    beam = m["links"].get(base, {}).get("type", "beam") == "beam" and base != "ground"
    ridden = {j["base"] for j in m["joints"].values() if j["type"] in ("carriage", "nut")}
    if rides and (not beam or base in ridden):
        kind, rides = "revolute", False
    name = f"j{len(m['joints'])}"
    joint = joint_of(space, kind, rng)
    node = "" if rides or base == "ground" else f".{rng.choice(nodes(tree, base))}"
    joint |= {"base": base + node, "follower": f"{link}.{rng.choice(nodes(tree, link))}"}
    m["joints"][name] = joint
    return drive(tree, rng, name, drives, absolute)


def drive(
    tree: Tree, rng: Random, name: str, drives: tuple[Any, ...], absolute: bool = False
) -> dict[str, float]:
    joint, values = tree["mechanism"]["joints"][name], {}
    kind = joint["type"]
    for k in range(FREEDOMS[kind]):
        slides = kind in ("prismatic", "carriage", "nut") or (kind, k) == ("cylindrical", 0)
        value = float(rng.uniform(-0.2, 0.2) if slides else rng.uniform(-1.2, 1.2))
        if kind in ("carriage", "nut"):
            value = float(
                rng.uniform(0.3, 0.7) * tree["mechanism"]["links"][joint["base"]]["length"]
            )
        data: Tree = {"joint": name, "drive": drives[rng.integers(len(drives))]}
        if data["drive"] == "held":
            data["drive"] = {"stiffness": float(10 ** (rng.uniform(3, 5) + 2 * slides))}
        if kind in PARTS:
            data["component"] = PARTS[kind][k]
        if absolute and kind == "revolute" and rng.random() < 0.5:
            data["angle"] = "absolute"
        tree["coordinates"][f"q{len(tree['coordinates'])}"] = data
        values[f"q{len(tree['coordinates']) - 1}"] = value
    return values


def add_bodies(tree: Tree, rng: Random) -> None:
    m, space = tree["mechanism"], tree["mechanism"]["space"]
    for link in m["links"]:
        if rng.random() < 0.4:
            data: Tree = {
                "at": f"{link}.{rng.choice(nodes(tree, link))}",
                "mass": float(rng.uniform(0, 2)),
            }
            if rng.random() < 0.6:
                data["inertia"] = (
                    3e-3 if space == "planar" else [4e-3, 5e-3, 3e-3, 1e-4, 5e-4, -2e-4]
                )
            if rng.random() < 0.6:
                data["offset"] = vector(space, rng, 0.1)
            m["bodies"][f"on_{link}"] = data


def add_springs(tree: Tree, rng: Random) -> None:
    m, space = tree["mechanism"], tree["mechanism"]["space"]
    m["springs"] = {}
    links = list(m["links"])
    for k in range(int(rng.integers(1, 3))):
        a, b = (str(rng.choice(links)) for _ in range(2))
        between = [f"{a}.{rng.choice(nodes(tree, a))}", f"{b}.{rng.choice(nodes(tree, b))}"]
        between[1] = "ground" if rng.random() < 0.5 or a == b else between[1]
        data: Tree = {"between": between, "translational": 3e4}
        if rng.random() < 0.5:
            data["translational"] = rng.uniform(0, 5e4, 2 if space == "planar" else 3).tolist()
        if rng.random() < 0.5:
            data["rotational"] = 500.0 if space == "planar" else [100.0, 300.0, 200.0]
        if rng.random() < 0.5 and space == "spatial":
            data["orientation"] = rng.uniform(-2, 2, 3).tolist()
        elif rng.random() < 0.5 and space == "planar":
            data["angle"] = float(rng.uniform(-2, 2))
        m["springs"][f"s{k}"] = data


def random_open(seed: int, space: str, swap: bool = False) -> tuple[Tree, np.ndarray]:
    """A tree of 1 to 4 links, every joint and drive; springs only where nothing is free."""
    rng = np.random.default_rng([seed, space == "spatial"])
    tree, values = empty(space, rng), {}
    sprung = rng.random() < 0.4
    drives = ("locked", "held") if sprung else ("free", "free", "locked", "held")
    for k in range(int(rng.integers(1, 5))):
        link = add_link(tree, rng, ("beam",) if k == 0 else ("beam", "rigid", "frame"))
        grounded = k == 0 or rng.random() < 0.1
        base = "ground" if grounded else f"l{rng.integers(k)}"
        values |= add_joint(tree, rng, link, base, drives, space == "planar", swap)
    add_bodies(tree, rng)
    if sprung:
        add_springs(tree, rng)
    return tree, np.array(list(values.values()))


def random_closed(
    seed: int,
    space: str,
    loops: int = 1,
    swap: bool = False,
    kinds: tuple[str, ...] = ("beam", "rigid", "frame"),
) -> tuple[Tree, np.ndarray, np.ndarray]:
    """A mechanism with loops, the q it was closed at, and a q nearby on the same branch.

    ``kinds`` are those of the links in the loops; loops of rigid links alone hang on a beam.
    """
    return copy.deepcopy(_random_closed(seed, space, loops, swap, kinds))


@cache
def _random_closed(
    seed: int, space: str, loops: int, swap: bool, kinds: tuple[str, ...]
) -> tuple[Tree, np.ndarray, np.ndarray]:
    """The same, found once: of some hundred attempts one closes."""
    for attempt in range(3000):
        rng = np.random.default_rng([seed, space == "spatial", loops, attempt])
        tree, values = empty(space, rng), {}
        done = True
        for _ in range(loops):
            done = done and _close(tree, rng, values, swap, kinds)
        if done:
            add_bodies(tree, rng)
            found = _nearby(tree, rng, values)
            if found is not None:
                return found
    raise AssertionError("no mechanism found")


def _close(
    tree: Tree, rng: Random, values: dict[str, float], swap: bool, kinds: tuple[str, ...]
) -> bool:
    """Add a chain of links and the joint that closes it; False where that fails."""
    m, space = tree["mechanism"], tree["mechanism"]["space"]
    drives = ("free", "locked", "held")
    if "beam" not in kinds and not m["links"]:
        values |= add_joint(tree, rng, add_link(tree, rng, ("beam",)), "ground", drives, False)
    size, before = (3, 6)[space == "spatial"], len(m["links"])
    old = list(m["links"])
    base = str(rng.choice(["ground", *old]))
    for k in range(int(rng.integers(1, 4))):
        last = add_link(tree, rng, kinds)
        onto = base if k == 0 else f"l{before + k - 1}"
        values |= add_joint(tree, rng, last, onto, drives, False, swap)
    if m["links"][last].get("type") == "rigid" and "beam" in kinds:
        return False
    taken = {j["base"] for j in m["joints"].values()} | {
        j["follower"] for j in m["joints"].values()
    }
    free = [f"{last}.{n}" for n in nodes(tree, last) if f"{last}.{n}" not in taken]
    if not free:
        return False
    name, kind = f"j{len(m['joints'])}", str(rng.choice(["revolute", "prismatic", "fixed"]))
    if space == "spatial":
        kind = str(rng.choice(["spherical", "universal", "cylindrical", "revolute"]))
    joint = joint_of(space, kind, rng)
    other = str(rng.choice(["ground", *old]))
    onto = other if other == "ground" else f"{other}.{rng.choice(nodes(tree, other))}"
    here = str(rng.choice(free))
    backward = onto != "ground" and rng.random() < 0.5
    joint["base"], joint["follower"] = (here, onto) if backward else (onto, here)
    pose = posed(tree, values)
    share = 0.2 if kind == "prismatic" else 1.0
    fit(tree, joint, pose, rng, list(rng.uniform(-0.8, 0.8, FREEDOMS[kind]) * share))
    m["joints"][name] = joint
    c = joint.pop("c")
    values |= dict(zip(drive(tree, rng, name, ("free", "locked", "held")), c, strict=True))
    return _release(tree, rng, values, size)


def posed(tree: Tree, values: dict[str, float]) -> Pose:
    """The pose before the new joint: passive freedoms keep their values in the guess."""
    _, passive = split_coordinates(tree)
    guess = tree["mechanism"].get("assembly", {}).get("guess", {})
    p = {(j, k): np.atleast_1d(guess[j])[k if np.ndim(guess[j]) else 0] for j, k in passive}
    return walk(tree, values, p)


def fit(tree: Tree, joint: Tree, pose: Pose, rng: Random, c: list[float]) -> None:
    """Place and mount a joint so that it closes where its freedoms have the values c."""
    space = tree["mechanism"]["space"]
    joint["c"] = c
    b, f = (joint[k].split(".")[0] for k in ("base", "follower"))
    R, d = relative(joint, np.array(c))
    M = pose.R[b].T @ pose.R[f] @ R.T
    gap = pose.node(tree, joint["follower"]) - pose.node(tree, joint["base"])
    position = pose.R[b].T @ gap - M @ d
    if space == "planar":
        joint["angle"] = float(np.arctan2(M[1, 0], M[0, 0]))
        joint["position"] = position[:2].tolist()
    else:
        joint["orientation"] = Rotation.from_matrix(M).as_euler("xyz").tolist()
        joint["position"] = position.tolist()
    assert np.abs(mount(joint) - M).max() < 1e-9
    assert np.abs(point(joint["position"]) - position).max() < 1e-9


def _release(tree: Tree, rng: Random, values: dict[str, float], size: int) -> bool:
    """Make ``size`` coordinates passive, such that the loops stay well determined."""
    m, names = tree["mechanism"], list(tree["coordinates"])
    if len(names) < size:
        return False
    guess0 = copy.deepcopy(m.get("assembly", {}).get("guess", {}))
    for _ in range(12):
        trial = copy.deepcopy(tree)
        guess = copy.deepcopy(guess0)
        for n in rng.choice(names, size, replace=False):
            data = trial["coordinates"].pop(str(n))
            kind = m["joints"][data["joint"]]["type"]
            at = guess.setdefault(data["joint"], [0.0] * FREEDOMS[kind])
            k = 0 if FREEDOMS[kind] == 1 else PARTS[kind].index(data["component"])
            at[k] = values[str(n)]
        left = {n: values[n] for n in trial["coordinates"]}
        trial["mechanism"]["assembly"] = {"at": left, "guess": guess}
        pose = posed(trial, left)
        if rides_well(trial, pose) and condition(trial, pose) > 0.03:
            # coordinates are numbered anew so that names stay unique
            tree.clear()
            tree.update(trial)
            values.clear()
            new = {n: f"q{k}" for k, n in enumerate(left)}
            values.update({new[n]: v for n, v in left.items()})
            tree["coordinates"] = {new[n]: d for n, d in tree["coordinates"].items()}
            tree["mechanism"]["assembly"]["at"] = dict(values)
            return True
    return False


def rides_well(tree: Tree, pose: Pose) -> bool:
    """Whether every carriage and nut stands well inside its beam."""
    m = tree["mechanism"]
    riders = {n: j for n, j in m["joints"].items() if j["type"] in ("carriage", "nut")}
    shares = [pose.values[n][0] / m["links"][j["base"]]["length"] for n, j in riders.items()]
    return all(0.15 < share < 0.85 for share in shares)


def _nearby(
    tree: Tree, rng: Random, values: dict[str, float]
) -> tuple[Tree, np.ndarray, np.ndarray] | None:
    """The guess blurred, single values as numbers, and a second configuration."""
    guess = tree["mechanism"]["assembly"]["guess"]
    for j, v in guess.items():
        blurred = [x + rng.uniform(-0.01, 0.01) for x in v]
        guess[j] = blurred if len(v) > 1 else blurred[0]
    q0 = np.array(list(values.values()))
    near = q0 + rng.uniform(-0.12, 0.12, len(q0))
    try:
        way = [solve_pose(tree, q0 + t * (near - q0)) for t in WAY]
    except ValueError:
        return None
    if rides_well(tree, way[-1]) and min(condition(tree, pose) for pose in way) > 0.02:
        return tree, q0, near
    return None  # beyond a dead point there may be a pose again, but no way to it
