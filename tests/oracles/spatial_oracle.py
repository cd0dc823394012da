"""An independent frame program in three dimensions: world axes, joints as linear constraints.

Nothing of the code under test is used. It reads the tree of a case file. Every node has six
displacements in world axes (planar mechanisms keep x, y and the turn about z); element matrices are
integrated from cubic deflections with a shear strain that is constant over the element and does no
work on it (of one section those of Friedman and Kosmatka, Computers & Structures 47 (1993) 473;
cubic Hermite without shear); every joint is six rows
"follower − carried base − Σ a_j c_j = 0" with one unknown c_j per freedom that is not locked, and
the pencil is projected on the null space of all rows. Closed loops are posed by a Newton method of
its own with differenced rotation vectors.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy import linalg

Tree = dict[str, Any]
Array = np.ndarray
X, Y, Z = np.eye(3)
FREEDOMS = {
    "fixed": 0, "revolute": 1, "prismatic": 1, "carriage": 1, "nut": 1, "screw": 1,
    "cylindrical": 2, "universal": 2, "spherical": 3,
}  # fmt: skip
NUMBER = {"translation": 0, "rotation": 1, 1: 0, 2: 1, 3: 2}
KAPPA = {"circle": 0.9, "tube": 0.5, "rectangle": 5 / 6, "i_profile": 0.44}


# Where everything is


def turn(axis: Array, angle: float) -> Array:
    """Rodrigues' formula."""
    W = cross(axis)
    return np.eye(3) + np.sin(angle) * W + (1.0 - np.cos(angle)) * W @ W


def rotation_vector(R: Array) -> Array:
    v = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    s = float(np.linalg.norm(v))
    return v if s < 1e-12 else v * (np.arctan2(s, 0.5 * (np.trace(R) - 1.0)) / s)


def unit(a: Any, default: Array) -> Array:
    v = np.array([*(default if a is None else a), 0.0, 0.0][:3], float)
    return v / np.linalg.norm(v)


def cross(r: Array) -> Array:
    x, y, z = r
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def point(a: Any) -> Array:
    return np.array([*(a or ()), 0.0, 0.0, 0.0][:3], float)


def mount(joint: Tree) -> Array:
    if "orientation" in joint:
        x, y, z = (turn(a, v) for a, v in zip((X, Y, Z), joint["orientation"], strict=True))
        return z @ y @ x
    return turn(Z, joint.get("angle", 0.0))


def placed(joint: Tree, c: Array) -> tuple[Array, Array]:
    """Turn and travel of the follower in base axes; a nut turns about the beam's axis."""
    R, d = relative(joint, c)
    m = mount(joint)
    return (R @ m, d) if joint["type"] == "nut" else (m @ R, m @ d)


def relative(joint: Tree, c: Array) -> tuple[Array, Array]:
    """Turn and travel of a joint in its own axes."""
    kind, nothing = joint["type"], np.zeros(3)
    if kind == "revolute":
        return turn(unit(joint.get("axis"), Z), c[0]), nothing
    if kind == "prismatic":
        return np.eye(3), unit(joint.get("axis"), X) * c[0]
    if kind == "cylindrical":
        a = unit(joint.get("axis"), Z)
        return turn(a, c[1]), a * c[0]
    if kind == "screw":
        a = unit(joint.get("axis"), Z)
        return turn(a, c[0]), a * joint["lead"] * c[0] / (2 * np.pi)
    if kind == "universal":
        a, b = (unit(v, Z) for v in joint["axes"])
        return turn(a, c[0]) @ turn(b, c[1]), nothing
    if kind == "spherical":
        return turn(X, c[0]) @ turn(Y, c[1]) @ turn(Z, c[2]), nothing
    if kind == "nut":
        return turn(X, 2 * np.pi * c[0] / joint["lead"]), nothing
    return np.eye(3), nothing  # fixed, carriage


def motions(joint: Tree, c: Array, base: Array, follower: Array) -> Array:
    """World (v, ω) of the follower's joint point per freedom, (6, k); R of base and follower."""
    kind, m, none = joint["type"], base @ mount(joint), np.zeros(3)
    if kind == "spherical":
        axes = (m @ X, m @ turn(X, c[0]) @ Y, follower @ Z)
        return np.array([np.r_[none, a] for a in axes]).T
    if kind == "universal":
        a, b = (unit(v, Z) for v in joint["axes"])
        return np.array([np.r_[none, m @ a], np.r_[none, follower @ b]]).T
    if kind == "carriage":
        return np.r_[base @ X, none][:, None]
    if kind == "nut":
        return np.r_[base @ X, base @ X * 2 * np.pi / joint["lead"]][:, None]
    if kind == "fixed":
        return np.zeros((6, 0))
    a = m @ unit(joint.get("axis"), X if kind == "prismatic" else Z)
    if kind == "cylindrical":
        return np.array([np.r_[a, none], np.r_[none, a]]).T
    if kind == "screw":
        return np.r_[a * joint["lead"] / (2 * np.pi), a][:, None]
    return (np.r_[a, none] if kind == "prismatic" else np.r_[none, a])[:, None]


@dataclass
class Pose:
    """World R and origin of every link, values of every joint's freedoms, gaps of the loops."""

    R: dict[str, Array]
    o: dict[str, Array]
    values: dict[str, Array]
    gaps: Array
    order: list[str]
    closing: list[str]

    def node(self, tree: Tree, name: str) -> Array:
        if name == "ground":
            return np.zeros(3)
        link = name.partition(".")[0]
        return self.o[link] + self.R[link] @ place(tree, name, self.values)


def place(tree: Tree, name: str, values: dict[str, Array]) -> Array:
    """A node in its link's frame; "link.@joint" is where a carriage or nut stands."""
    link, _, node = name.partition(".")
    data = tree["mechanism"]["links"][link]
    if node.startswith("@"):
        return values[node[1:]][0] * X
    if node in data.get("nodes", {}):
        given = data["nodes"][node]
        return point(given["position"] if isinstance(given, dict) else given)
    return data["length"] * X if node == "end" else np.zeros(3)


def base_of(name: str, joint: Tree) -> str:
    return f"{joint['base']}.@{name}" if joint["type"] in ("carriage", "nut") else joint["base"]


def split_coordinates(tree: Tree) -> tuple[dict[tuple[str, int], str], list[tuple[str, int]]]:
    """Driven freedoms with their coordinate, and passive ones."""
    driven = {}
    for name, data in tree["coordinates"].items():
        part = data.get("component")
        driven[data["joint"], 0 if part is None else NUMBER[part]] = name
    every = [
        (j, k) for j, d in tree["mechanism"]["joints"].items() for k in range(FREEDOMS[d["type"]])
    ]
    return driven, [f for f in every if f not in driven]


def walk(tree: Tree, q: dict[str, float], passive: dict[tuple[str, int], float]) -> Pose:
    joints = tree["mechanism"]["joints"]
    driven, _ = split_coordinates(tree)
    pose = Pose({"ground": np.eye(3)}, {"ground": np.zeros(3)}, {}, np.zeros(0), [], [])
    waiting, gaps = dict(joints), []
    while waiting:
        name, backward = following(waiting, pose)
        closing = name is None
        name = next(iter(waiting)) if closing else name
        joint = waiting.pop(name)
        base, follower = joint["base"].split(".")[0], joint["follower"].split(".")[0]
        c = np.zeros(FREEDOMS[joint["type"]])
        for k in range(len(c)):
            c[k] = q[driven[name, k]] if (name, k) in driven else passive[name, k]
            if (name, k) in driven:
                data = tree["coordinates"][driven[name, k]]
                if data.get("angle") == "absolute":
                    x = pose.R[base] @ mount(joint) @ X
                    c[k] -= np.arctan2(x[1], x[0])
        pose.values[name] = c
        R, d = placed(joint, c)
        if backward:
            pose.order.append(name)
            pose.R[base] = pose.R[follower] @ R.T
            at = pose.node(tree, joint["follower"])
            at = at - pose.R[base] @ (point(joint.get("position")) + d)
            pose.o[base] = at - pose.R[base] @ place(tree, base_of(name, joint), pose.values)
            continue
        here = pose.node(tree, base_of(name, joint))
        at = here + pose.R[base] @ (point(joint.get("position")) + d)
        R = pose.R[base] @ R
        if closing:
            pose.closing.append(name)
            apart = rotation_vector(pose.R[follower].T @ R)
            gaps += [at - pose.node(tree, joint["follower"]), pose.R[follower] @ apart]
        else:
            pose.order.append(name)
            pose.R[follower] = R
            pose.o[follower] = at - R @ place(tree, joint["follower"], pose.values)
    pose.gaps = np.concatenate(gaps) if gaps else np.zeros(0)
    return pose


def following(waiting: Tree, pose: Pose) -> tuple[str | None, bool]:
    """The next joint with one end placed, and whether that is its follower."""
    for backward, (near, far) in enumerate((("base", "follower"), ("follower", "base"))):
        for name, joint in waiting.items():
            if joint[near].split(".")[0] in pose.R and joint[far].split(".")[0] not in pose.R:
                return name, bool(backward)
    return None, False


def solve_pose(tree: Tree, q: Array) -> Pose:
    """The pose at q, reached in small steps from the one of ``assembly``."""
    names = list(tree["coordinates"])
    _, passive = split_coordinates(tree)
    if not passive:
        return walk(tree, dict(zip(names, q, strict=True)), {})
    assembly = tree["mechanism"].get("assembly", {})
    start = np.array([assembly.get("at", {}).get(n, 0.0) for n in names])
    guess = assembly.get("guess", {})
    p = np.array([np.atleast_1d(guess.get(j, 0.0))[k if np.ndim(guess.get(j, 0.0)) else 0]
                  for j, k in passive], float)  # fmt: skip
    q = np.asarray(q, float)
    n = max(1, int(np.ceil(np.abs(q - start).max(initial=0.0) / 0.05)))
    for t in np.linspace(0.0, 1.0, n + 1):
        here = dict(zip(names, start + t * (q - start), strict=True))
        p = newton(tree, here, passive, p, 1e-13 if t == 1.0 else 1e-3)
    return walk(tree, here, dict(zip(passive, p, strict=True)))


def newton(
    tree: Tree, q: dict[str, float], passive: list[tuple[str, int]], p: Array, close: float
) -> Array:
    """Passive coordinates from nearby p, until a step is shorter than ``close``."""

    def gap(p: Array) -> Array:
        return walk(tree, q, dict(zip(passive, p, strict=True))).gaps

    for _ in range(40):
        J = np.array([(gap(p + e) - gap(p - e)) / 2e-6 for e in 1e-6 * np.eye(len(p))]).T
        step = np.linalg.lstsq(J, -gap(p), rcond=1e-9)[0]
        p = p + np.clip(step, -0.3, 0.3)
        if np.abs(step).max() < close:
            break
    if np.abs(gap(p)).max() > max(1e-10, close):
        raise ValueError("the oracle cannot close the loops")
    return p


def condition(tree: Tree, pose: Pose) -> float:
    """Smallest over largest singular value of the loops' differenced Jacobian."""
    driven, passive = split_coordinates(tree)
    values = {f: pose.values[f[0]][f[1]] for f in [*passive, *driven]}
    fixed = {driven[f]: 0.0 for f in driven}
    plain = {
        **tree,
        "coordinates": {n: {**d, "angle": "relative"} for n, d in tree["coordinates"].items()},
    }
    for f, n in driven.items():
        fixed[n] = values[f]

    def gap(k: int, h: float) -> Array:
        moved = {f: values[f] + h * (j == k) for j, f in enumerate(passive)}
        return walk(plain, fixed, moved).gaps

    J = np.array([(gap(k, 1e-6) - gap(k, -1e-6)) / 2e-6 for k in range(len(passive))]).T
    s = np.linalg.svd(J, compute_uv=False)
    return float(s[-1] / s[0])


# Sections and elements


def dimensions(mechanism: Tree, section: Any, share: float) -> Tree:
    if isinstance(section, str):
        return mechanism["sections"][section]
    a, b = (mechanism["sections"][section[k]] for k in ("start", "end"))
    return {k: v if isinstance(v, str) else v * (1 - share) + b[k] * share for k, v in a.items()}


def section(s: Tree) -> tuple[Any, ...]:
    """A, I_z, I_y, J, I_p, κ; the κ of a box are two, with I_z and I_y."""
    shape = s.get("shape", "bare")
    kappa = s.get("shear_coefficient", KAPPA.get(shape, 5 / 6))
    if shape in ("circle", "tube"):
        D = s["diameter"] if shape == "circle" else s["outer_diameter"]
        d = 0.0
        if shape == "tube":
            d = s["inner_diameter"] if "inner_diameter" in s else D - 2 * s["thickness"]
        I = np.pi / 64 * (D**4 - d**4)  # noqa: E741
        return np.pi / 4 * (D**2 - d**2), I, I, 2 * I, 2 * I, kappa
    if shape == "rectangle":
        b, h = s["width"], s["height"]
        n = np.arange(1, 4001, 2)
        waves = np.tanh(n * np.pi * max(b, h) / (2 * min(b, h))) / n**5.0
        J = max(b, h) * min(b, h) ** 3 / 3 - 64 / np.pi**5 * min(b, h) ** 4 * waves.sum()
        I_z, I_y = b * h**3 / 12, h * b**3 / 12
        return b * h, I_z, I_y, J, I_z + I_y, kappa
    if shape == "box":
        b, h, t = s["width"], s["height"], s["thickness"]
        a, c = b / 2 - t, h / 2 - t  # of the hole
        A, I_z, I_y = b * h - 4 * a * c, (b * h**3 - 16 * a * c**3) / 12, 0.0
        I_y = (h * b**3 - 16 * c * a**3) / 12
        stream = 4 * a * c + 2 * (a + c) * t + 4 * 0.144834 * t**2
        J = 4 * stream**2 / (4 * (a + c) / t + 4 * 0.558729)
        J += 4 * (a + c) * t**3 / 3 + 4 * 0.405824 * t**4
        both = [I**2 / A / box_energy(*half, t) for I, half in ((I_z, (a, c)), (I_y, (c, a)))]  # noqa: E741
        return A, I_z, I_y, J, I_z + I_y, np.array(both)
    if shape == "i_profile":
        parts = [(s["width"], s["flange_thickness"], (s["height"] - s["flange_thickness"]) / 2)] * 2
        parts += [(s["web_thickness"], s["height"] - 2 * s["flange_thickness"], 0.0)]
        A = sum(b * h for b, h, _ in parts)
        I_z = sum(b * h**3 / 12 + b * h * e**2 for b, h, e in parts)
        I_y = sum(h * b**3 / 12 for b, h, _ in parts)
        J = sum(max(b, h) * min(b, h) ** 3 / 3 for b, h, _ in parts)
        return A, I_z, I_y, J, I_z + I_y, kappa
    I_z = s.get("inertia_z", s.get("bending_inertia", 0.0))
    I_y = s.get("inertia_y", 0.0)
    return (
        s["area"],
        I_z,
        I_y,
        s.get("torsion_constant", 0.0),
        s.get("polar_inertia", I_z + I_y),
        kappa,
    )


def box_energy(a: float, c: float, t: float) -> float:
    """∫ (Q/t)² dA of the shear flow in a box with the hole 2a × 2c."""
    flow = t * (c + t / 2)  # first moment of a flange per unit of its length
    entry, more = flow * a, flow * t
    points, weights = np.polynomial.legendre.leggauss(4)
    y = c * (points + 1) / 2
    web = (c / 2 * weights * (entry + more + t * (c**2 - y**2) / 2) ** 2).sum() / t
    corner = 0.558729 * entry**2 + 0.616 * entry * more + 0.459 * more**2
    return float(4 * (flow**2 * a**3 / 3 / t + corner + web))


def bending(s: float, h: float) -> list[tuple[list[int], Array, Array, Array]]:
    """Dofs, deflection, its slopes and curvature at s = x/h, per plane, over twelve and two dofs.

    The two behind the twelve are the constant shear strains: the slopes are θ + γ.
    """
    out = []
    for dofs, sign in (([1, 5, 7, 11, 12], 1.0), ([2, 4, 8, 10, 13], -1.0)):
        flip = np.array([1, sign, 1, sign])
        cubic = flip * [1 - 3 * s**2 + 2 * s**3, h * (s - 2 * s**2 + s**3),
                        3 * s**2 - 2 * s**3, h * (s**3 - s**2)]  # fmt: skip
        first = flip * [(6 * s**2 - 6 * s) / h, 1 - 4 * s + 3 * s**2,
                        (6 * s - 6 * s**2) / h, 3 * s**2 - 2 * s]  # fmt: skip
        second = flip * [(12 * s - 6) / h**2, (6 * s - 4) / h,
                         (6 - 12 * s) / h**2, (6 * s - 2) / h]  # fmt: skip
        shapes = [np.zeros(14) for _ in range(3)]
        for whole, part in zip(shapes, (cubic, first, second), strict=True):
            whole[dofs] = [*part, part @ (flip * [0, 1, 0, 1])]
        out.append((dofs, *shapes))
    return out


def element(
    material: Tree, values: Callable[[float], tuple[float, ...]], h: float, sheared: bool
) -> tuple[Array, Array]:
    """(12, 12) stiffness and mass in the element's axes, by Gauss quadrature.

    ``values`` are those of `section` at a share of the element. The shear strain is constant: an
    inner unknown of its own, eliminated statically.
    """
    return shaped_element(material, values, h, sheared)[:2]


def shaped_element(
    material: Tree, values: Callable[[float], tuple[float, ...]], h: float, sheared: bool
) -> tuple[Array, Array, Array]:
    """The same, and the shear strains behind the twelve dofs, (14, 12), see `bending`."""
    E, rho = material["youngs_modulus"], material["density"]
    G = material.get("shear_modulus", E / (2 + 2 * material.get("poissons_ratio", 0.3)))
    k, m = np.zeros((14, 14)), np.zeros((14, 14))  # two shear strains behind the twelve
    points, weights = np.polynomial.legendre.leggauss(7)
    for s, w in zip(0.5 * (points + 1), 0.5 * h * weights, strict=True):
        A, I_z, I_y, J, I_p, kappa = values(s)
        for dof, stiff, mass in ((0, E * A, rho * A), (3, G * J, rho * I_p)):
            n, dn = np.zeros(14), np.zeros(14)
            n[[dof, dof + 6]], dn[[dof, dof + 6]] = [1 - s, s], [-1 / h, 1 / h]
            k += w * stiff * np.outer(dn, dn)
            m += w * mass * np.outer(n, n)
        each = zip((I_z, I_y), np.broadcast_to(kappa, 2), bending(s, h), strict=True)
        for I, k_s, (dofs, v, slope, bend) in each:  # noqa: E741
            strain = np.zeros(14)
            strain[dofs[-1]] = 1
            theta = slope - strain
            k += w * E * I * np.outer(bend, bend)
            m += w * rho * A * np.outer(v, v)
            if sheared:
                k += w * k_s * G * A * np.outer(strain, strain)
                m += w * rho * I * np.outer(theta, theta)
    T = np.eye(14)[:, :12]
    if sheared:
        T[12:] = -np.linalg.solve(k[12:, 12:], k[12:, :12])
    return T.T @ k @ T, T.T @ m @ T, T


# Assembly


@dataclass
class World:
    """The structure without joints, its rows and its number of rigid motions."""

    K: Array
    M: Array
    rows: list[Array] = field(default_factory=list)
    n_free: int = 0
    pose: Pose | None = None
    dropped: Array | None = None
    where: dict[str, int] = field(default_factory=dict)

    def spectrum(self, count: int) -> Array:
        """The lowest elastic λ; the first ``n_free`` are the rigid motions, left out by count."""
        K, M = self.projected()
        shift = float(np.trace(K) / np.trace(M)) * 1e-8
        for _ in range(2):  # the second time near the lowest modes, which are then most accurate
            mu = np.sort(linalg.eigvalsh(M, K + shift * M))[::-1]
            lam = 1.0 / mu[: self.n_free + count] - shift
            shift = max(float(lam[self.n_free]), 1.0)
        return lam[self.n_free :]

    def rigid(self) -> int:
        """How many eigenvalues vanish beside the sixth elastic one."""
        K, M = self.projected()
        lam = linalg.eigvalsh(K + M, M) - 1.0
        return int((lam < 1e-8 * lam[min(self.n_free + 5, len(lam) - 1)]).sum())

    def projected(self) -> tuple[Array, Array]:
        keep = np.setdiff1d(np.arange(len(self.K)), self.dropped)
        rows = np.array(self.rows)[:, keep] if self.rows else np.zeros((0, len(keep)))
        T = null_space(rows)
        K, M = self.K[np.ix_(keep, keep)], self.M[np.ix_(keep, keep)]
        return T.T @ K @ T, T.T @ M @ T


def null_space(rows: Array) -> Array:
    """Basis of rows d = 0: unknowns eliminated by pivoted QR, the kept ones stay themselves."""
    if not len(rows):
        return np.eye(rows.shape[1])
    _, r, pivot = linalg.qr(rows, mode="economic", pivoting=True)
    rank = int((np.abs(np.diag(r)) > 1e-9 * abs(r[0, 0])).sum())
    T = np.zeros((rows.shape[1], rows.shape[1] - rank))
    T[pivot[rank:]] = np.eye(len(pivot) - rank)
    T[pivot[:rank]] = -linalg.solve_triangular(r[:rank, :rank], r[:rank, rank:])
    return T


def carry(lever: Array) -> Array:
    """(6, 6): motion of a rigid body's point at ``lever`` from that of another."""
    out = np.eye(6)
    out[:3, 3:] = -cross(lever)
    return out


def tensor(given: Any) -> Array:
    if np.ndim(given) == 0:
        return np.diag([0.0, 0.0, given])
    xx, yy, zz, xy, xz, yz = [*given, 0.0, 0.0, 0.0][:6]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def body(mass: float, inertia: Any, lever: Array, R: Array) -> Array:
    """Mass matrix in world axes of a body at ``lever`` (link axes) from the node."""
    to_center = carry(R @ lever)
    block = np.zeros((6, 6))
    block[:3, :3] = mass * np.eye(3)
    block[3:, 3:] = R @ tensor(inertia) @ R.T
    return to_center.T @ block @ to_center


def chain(link: Tree, riders: list[tuple[str, float]]) -> tuple[Array, dict[str, int]]:
    """Stations along a beam and its named nodes; a rider's node splits it at half the elements."""
    n, L = link["elements"], link["length"]
    if not riders:
        return np.linspace(0.0, L, n + 1), {"start": 0, "end": n}
    (name, s), first = riders[0], max(1, n // 2)
    rest = max(1, n - first)
    stations = np.r_[np.linspace(0.0, s, first + 1), np.linspace(s, L, rest + 1)[1:]]
    return stations, {"start": 0, "end": first + rest, f"@{name}": first}


class Builder:
    def __init__(self, tree: Tree, pose: Pose) -> None:
        self.tree, self.pose, self.m = tree, pose, tree["mechanism"]
        self.n, self.K, self.M, self.rows = 0, [], [], []
        self.where: dict[str, int] = {}

    def new(self, count: int = 6) -> int:
        self.n += count
        return self.n - count

    def fill(self) -> tuple[int, Array]:
        """All parts; how many free coordinates there are, and in a plane the dofs out of it."""
        planar = self.m["space"] == "planar"
        for name in self.m["links"]:
            self.add_link(name)
        for data in self.m.get("bodies", {}).values():
            self.add_body(data)
        for data in self.m.get("springs", {}).values():
            self.add_spring(data, planar)
        out = [6 * k + d for k in range(self.n // 6 if planar else 0) for d in (2, 3, 4)]
        n_free = sum(self.add_joint(name) for name in self.m["joints"])
        return n_free, np.array(out, dtype=int)

    def dense_rows(self) -> Array:
        rows = np.zeros((len(self.rows), self.n))
        for i, row in enumerate(self.rows):
            rows[i, list(row)] = list(row.values())
        return rows

    def dense(self) -> tuple[Array, Array]:
        out = []
        for parts in (self.K, self.M):
            full = np.zeros((self.n, self.n))
            for dofs, block in parts:
                full[np.ix_(dofs, dofs)] += block
            out.append(full)
        return out[0], out[1]

    def beam(
        self, R: Array, data: Tree, shares: tuple[float, float], h: float, a: int, b: int
    ) -> None:
        def values(s: float) -> tuple[float, ...]:
            share = shares[0] + (shares[1] - shares[0]) * s
            return section(dimensions(self.m, data["section"], share))

        R = R @ turn(X, data.get("roll", 0.0))
        material = self.m["materials"][data["material"]]
        k, m = element(material, values, h, data.get("shear", False))
        T = np.kron(np.eye(4), R.T)
        dofs = np.r_[a : a + 6, b : b + 6]
        self.K.append((dofs, T.T @ k @ T))
        self.M.append((dofs, T.T @ m @ T))

    def add_link(self, name: str) -> None:
        link, R = self.m["links"][name], self.pose.R[name]
        kind = link.get("type", "beam")
        if kind == "beam":
            self.add_chain(name, link, R)
        elif kind == "frame":
            self.add_frame(name, link, R)
        else:
            origin = self.new()
            mass = body(
                link.get("mass", 0.0), link.get("inertia", 0.0), point(link.get("center")), R
            )
            self.M.append((np.arange(origin, origin + 6), mass))
            nodes = {"start", *link.get("nodes", {})} | ({"end"} if "length" in link else set())
            for node in sorted(nodes):
                at = self.where[f"{name}.{node}"] = self.new()
                lever = R @ place(self.tree, f"{name}.{node}", self.pose.values)
                self.tie(at, origin, lever)

    def tie(self, follower: int, base: int | None, lever: Array) -> None:
        for i in range(6):
            row = {follower + i: 1.0}
            if base is not None:
                row |= {base + j: -v for j, v in enumerate(carry(lever)[i])}
            self.rows.append(row)

    def add_chain(self, name: str, link: Tree, R: Array) -> None:
        riders = [
            (j, self.pose.values[j][0])
            for j, d in self.m["joints"].items()
            if d["type"] in ("carriage", "nut") and d["base"] == name
        ]
        stations, named = chain(link, riders)
        at = [self.new() for _ in stations]
        for k in range(len(at) - 1):
            x, y = stations[k], stations[k + 1]
            shares = x / link["length"], y / link["length"]
            self.beam(R, link, shares, y - x, at[k], at[k + 1])
        for node, k in named.items():
            self.where[f"{name}.{node}"] = at[k]

    def add_frame(self, name: str, link: Tree, R: Array) -> None:
        for node in link["nodes"]:
            self.where[f"{name}.{node}"] = self.new()
        for data in link["beams"].values():
            a, b = (point(link["nodes"][data[k]]) for k in ("from", "to"))
            n, x = data.get("elements", 1), (b - a) / np.linalg.norm(b - a)
            side = np.cross(Z, x)
            y = Y if np.linalg.norm(side) < 1e-9 else side / np.linalg.norm(side)
            axes = np.array([x, y, np.cross(x, y)]).T
            ends = [self.where[f"{name}.{data['from']}"]]
            ends += [self.new() for _ in range(n - 1)] + [self.where[f"{name}.{data['to']}"]]
            for k in range(n):
                self.beam(
                    R @ axes, data, (0.0, 1.0), np.linalg.norm(b - a) / n, ends[k], ends[k + 1]
                )

    def add_body(self, data: Tree) -> None:
        at, R = self.where[data["at"]], self.pose.R[data["at"].split(".")[0]]
        block = body(data.get("mass", 0.0), data.get("inertia", 0.0), point(data.get("offset")), R)
        self.M.append((np.arange(at, at + 6), block))

    def add_spring(self, data: Tree, planar: bool) -> None:
        """Relative motion at the second node's place, the first end carried there rigidly."""
        R = self.pose.R.get(data["between"][0].split(".")[0], np.eye(3)) @ mount(data)
        nodes = [node for node in data["between"] if node != "ground"]
        places = [self.pose.node(self.tree, node) for node in nodes]
        k = np.zeros(6)
        for key, at, axes in (("translational", 0, 3), ("rotational", 3, 3)):
            given = data.get(key, 0.0)
            kept = ([0, 1] if at == 0 else [2]) if planar else range(axes)
            for n, axis in enumerate(kept):
                k[at + axis] = given[n] if np.ndim(given) else given
        D = np.hstack([-carry(places[-1] - places[0]), np.eye(6)])
        D = D[:, np.repeat([node != "ground" for node in data["between"]], 6)]
        dofs = np.concatenate([self.where[node] + np.arange(6) for node in nodes])
        D = np.kron(np.eye(2), R.T) @ D
        self.K.append((dofs, D.T @ np.diag(k) @ D))

    def add_joint(self, name: str) -> int:
        """Rows of one joint; returns how many of its freedoms are free coordinates."""
        joint = self.m["joints"][name]
        base, follower = base_of(name, joint), joint["follower"]
        R_b, R_f = (self.pose.R[n.split(".")[0]] for n in (base, follower))
        A = motions(joint, self.pose.values[name], R_b, R_f)
        lever = self.pose.node(self.tree, follower) - self.pose.node(self.tree, base)
        first = len(self.rows)
        self.tie(self.where[follower], self.where.get(base), lever)
        driven, _ = split_coordinates(self.tree)
        free = 0
        for k in range(A.shape[1]):
            drive: Any = "passive"
            if (name, k) in driven:
                drive = self.tree["coordinates"][driven[name, k]].get("drive", "free")
            if drive == "locked":
                continue
            c = self.new(1)
            for i in range(6):
                self.rows[first + i][c] = -A[i, k]
            held = isinstance(drive, dict) and "stiffness" in drive
            if held:
                self.K.append((np.array([c]), np.array([[drive["stiffness"]]])))
            if isinstance(drive, dict) and "inertia" in drive:
                self.M.append((np.array([c]), np.array([[drive["inertia"]]])))
            free += drive != "passive" and not held
        return free


def world(tree: Tree, q: Any, pose: Pose | None = None) -> World:
    """The assembled mechanism at q."""
    pose = solve_pose(tree, np.atleast_1d(np.asarray(q, float))) if pose is None else pose
    b = Builder(tree, pose)
    n_free, out_of_plane = b.fill()
    return World(*b.dense(), list(b.dense_rows()), n_free, pose, out_of_plane, b.where)
