"""An independent planar frame program: global coordinates, joints as linear constraints.

Nothing of the code under test is used. Each link has its own nodes with (x, y, rotation) in world
axes; element matrices are integrated from the shape functions by Gauss quadrature; joints are rows
of a constraint matrix, whose null space the pencil is projected on. Only beams and point masses.
Its lowest modes are right to about 1e-16 × (axial stiffness) / (their own): 1e-10 in the tests.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import linalg


def element(E: float, A: float, I: float, rho: float, h: float) -> tuple[np.ndarray, np.ndarray]:  # noqa: E741
    """Stiffness and consistent mass by 5-point quadrature of Hermite and linear functions."""
    points, weights = np.polynomial.legendre.leggauss(5)
    k, m = np.zeros((6, 6)), np.zeros((6, 6))
    for s, w in zip(0.5 * (points + 1.0), 0.5 * h * weights, strict=True):
        v = np.array([0, 1 - 3 * s**2 + 2 * s**3, h * (s - 2 * s**2 + s**3), 0,
                      3 * s**2 - 2 * s**3, h * (s**3 - s**2)])  # fmt: skip
        v_xx = np.array([0, 12 * s - 6, h * (6 * s - 4), 0, 6 - 12 * s, h * (6 * s - 2)]) / h**2
        u, u_x = np.array([1 - s, 0, 0, s, 0, 0]), np.array([-1, 0, 0, 1, 0, 0]) / h
        k += w * (E * A * np.outer(u_x, u_x) + E * I * np.outer(v_xx, v_xx))
        m += w * rho * A * (np.outer(u, u) + np.outer(v, v))
    return k, m


@dataclass
class Frame:
    """The unconstrained structure, its constraints C d = 0 and its number of mechanisms."""

    K: np.ndarray
    M: np.ndarray
    constraints: np.ndarray
    n_free: int
    origins: dict[str, np.ndarray]
    ends: dict[str, np.ndarray]
    angles: dict[str, float]

    def eigenvalues(self, count: int) -> np.ndarray:
        """The lowest elastic λ: the first ``n_free`` are the rigid motions, left out by count."""
        Z = null_space(self.constraints)
        K, M = Z.T @ self.K @ Z, Z.T @ self.M @ Z
        shift = max(np.sort(linalg.eigvalsh(K, M))[self.n_free], 1.0)
        mu = np.sort(linalg.eigvalsh(M, K + shift * M))[::-1]  # the lowest modes, most accurately
        return (1.0 / mu - shift)[self.n_free : self.n_free + count]


def null_space(constraints: np.ndarray) -> np.ndarray:
    """Basis of C d = 0 for rows "follower − base = 0" or "follower = 0", bases first; 0 and 1."""
    Z = np.eye(constraints.shape[1])
    for row in constraints:
        (follower,) = np.flatnonzero(row > 0)
        base = np.flatnonzero(row < 0)
        Z[follower] = Z[base[0]] if len(base) else 0.0
    return Z[:, Z.any(axis=0)]


def section(data: Mapping[str, Any]) -> tuple[float, float]:
    """Area and inertia."""
    shape = data.get("shape", "bare")
    if shape == "bare":
        return data["area"], data["bending_inertia"]
    if shape == "rectangle":
        return data["width"] * data["height"], data["width"] * data["height"] ** 3 / 12
    if shape == "box":
        b, h = data["width"], data["height"]
        p, q = (side - 2 * data["thickness"] for side in (b, h))
        return b * h - p * q, (b * h**3 - p * q**3) / 12
    outer = data["diameter"] if shape == "circle" else data["outer_diameter"]
    inner = 0.0
    if shape == "tube":
        inner = data.get("inner_diameter") or outer - 2 * data["thickness"]
    return np.pi / 4 * (outer**2 - inner**2), np.pi / 64 * (outer**4 - inner**4)


def frame(tree: Mapping[str, Any], q: np.ndarray) -> Frame:
    """Assemble a case tree in the pose q."""
    mechanism, coordinates = tree["mechanism"], tree["coordinates"]
    value = dict(zip(coordinates, q, strict=True))
    of_joint = {data["joint"]: name for name, data in coordinates.items()}
    first, count = {}, 0
    for name, link in mechanism["links"].items():
        first[name] = count
        count += 3 * (link["elements"] + 1)
    K, M, rows, n_free = np.zeros((count, count)), np.zeros((count, count)), [], 0
    angles, origins, ends = {"ground": 0.0}, {}, {}

    def at(node: str) -> int:
        link, end = node.split(".")
        return first[link] + 3 * mechanism["links"][link]["elements"] * (end == "end")

    waiting = dict(mechanism["joints"])
    while waiting:
        ready = [j for j, d in waiting.items() if d["base"].split(".")[0] in angles]
        name, joint = ready[0], waiting.pop(ready[0])
        base, follower = joint["base"], joint["follower"].split(".")[0]
        coordinate = of_joint.get(name)
        data = coordinates.get(coordinate, {})
        angle = angles[base.split(".")[0]] + joint.get("angle", 0.0)
        if coordinate is not None:
            absolute = data.get("angle") == "absolute"
            angle = value[coordinate] if absolute else angle + value[coordinate]
        if base == "ground":
            origin = np.array(joint.get("position", [0.0, 0.0]))
        else:
            origin = (ends if base.endswith("end") else origins)[base.split(".")[0]]
        link = mechanism["links"][follower]
        angles[follower], origins[follower] = angle, origin
        ends[follower] = origin + link["length"] * np.array([np.cos(angle), np.sin(angle)])
        drive = data.get("drive", "free")
        stiff = joint["type"] == "fixed" or drive == "locked"
        for a in range(3 if stiff else 2):
            row = np.zeros(count)
            row[first[follower] + a] = 1.0
            if base != "ground":
                row[at(base) + a] = -1.0
            rows.append(row)
        if isinstance(drive, dict):
            spin = np.zeros(count)
            spin[first[follower] + 2] = 1.0
            if base != "ground":
                spin[at(base) + 2] = -1.0
            K += drive["stiffness"] * np.outer(spin, spin)
        n_free += joint["type"] == "revolute" and drive == "free"
    for name, link in mechanism["links"].items():
        material = mechanism["materials"][link["material"]]
        A, I = section(mechanism["sections"][link["section"]])  # noqa: E741
        h = link["length"] / link["elements"]
        k, m = element(material["youngs_modulus"], A, I, material["density"], h)
        c, s = np.cos(angles[name]), np.sin(angles[name])
        turn = np.kron(np.eye(2), np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]))
        for e in range(link["elements"]):
            dofs = first[name] + 3 * e + np.arange(6)
            K[np.ix_(dofs, dofs)] += turn.T @ k @ turn
            M[np.ix_(dofs, dofs)] += turn.T @ m @ turn
    for body in mechanism.get("bodies", {}).values():
        i = at(body["at"])
        M[[i, i + 1], [i, i + 1]] += body.get("mass", 0.0)
        M[i + 2, i + 2] += body.get("inertia", 0.0)
    return Frame(K, M, np.array(rows), n_free, origins, ends, angles)
