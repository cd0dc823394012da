"""Plane frames that bend far: corotational beams at rest under their weight, and their vibration.

Nodes have places and turns in world axes, pins share places. A drive holds the turn of one node
against another while the frame finds its rest, then gives as a spring. An element's forces are
linear in its stretch and in the turns of its ends against its chord.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy import linalg
from spatial_oracle import Array


@dataclass
class Frame:
    """Elements (node, node, EA, EI, ρA), bodies (node, m, J, arm), drives (node, node, k)."""

    points: list[Array] = field(default_factory=list)
    dofs: list[list[int]] = field(default_factory=list)  # of each node, −1 on the ground
    elements: list[tuple[int, int, float, float, float]] = field(default_factory=list)
    bodies: list[tuple[int, float, float, Array]] = field(default_factory=list)
    drives: list[tuple[int, int, float]] = field(default_factory=list)
    count: int = 0

    def node(self, point: Array, given: tuple[int, ...] = ()) -> int:
        """A node whose first dofs are ``given``, the others new."""
        fresh = range(self.count, self.count + 3 - len(given))
        self.count = fresh.stop
        self.points.append(point)
        self.dofs.append([*given, *fresh])
        return len(self.points) - 1

    def assembled(self, z: Array, g: Array) -> tuple[Array, Array, Array]:
        """Tangent stiffness, mass and what the forces leave at z (count,)."""
        n, at = self.count, np.append(z, 0.0)
        K, M, f = np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1)), np.zeros(n + 1)
        for a, b, EA, EI, rho in self.elements:
            d = self.dofs[a] + self.dofs[b]
            v, before = at[d], self.points[b] - self.points[a]
            after, L = before + v[3:5] - v[:2], np.hypot(*before)
            (c, s), h = after / np.hypot(*after), np.hypot(*after)
            turn = np.arctan2(before[0] * s - before[1] * c, before @ [c, s])
            r, w = np.array([-c, -s, 0, c, s, 0]), np.array([s, -c, 0, -s, c, 0])
            B = np.array([r, np.eye(6)[2] - w / h, np.eye(6)[5] - w / h])
            k = linalg.block_diag(EA / L, EI / L * np.array([[4, 2], [2, 4]]))
            N, *moments = inside = k @ [h - L, v[2] - turn, v[5] - turn]
            bent = sum(moments) / h**2 * np.outer(r, w)
            K[np.ix_(d, d)] += B.T @ k @ B + N / h * np.outer(w, w) + bent + bent.T
            M[np.ix_(d, d)] += turned(beam_mass(rho, L), c, s)
            f[d] += turned(beam_mass(rho, L), *before / L) @ [*g, 0, *g, 0] - B.T @ inside
        for a, m, J, arm in self.bodies:
            d, c, s = self.dofs[a], np.cos(at[self.dofs[a][2]]), np.sin(at[self.dofs[a][2]])
            x, y = np.array([[c, -s], [s, c]]) @ arm
            R = np.array([[1, 0, -y], [0, 1, x]])
            M[np.ix_(d, d)] += m * R.T @ R + np.diag([0, 0, J])
            f[d] += m * g @ R
            K[d[2], d[2]] += m * (g @ [x, y])
        return K[:n, :n], M[:n, :n], f[:n]

    def frequencies(self, g: Array, count: int) -> Array:
        """The lowest, Hz, at rest under g (2,)."""
        n, z, free = self.count, np.zeros(self.count), np.eye(self.count + 1)
        springs = np.zeros((n + 1, n + 1))
        for a, b, k in self.drives:
            here, there = self.dofs[a][2], self.dofs[b][2]
            row = np.eye(n + 1)[there] - np.eye(n + 1)[here]
            springs += k * np.outer(row, row)
            free[:, here] += free[:, there]
            free[:, there] = 0.0
        T = free[:n, :n][:, free[:n, :n].any(axis=0)]
        for share in (0.25, 0.5, 0.75, *[1.0] * 4):
            for _ in range(3):
                K, _, f = self.assembled(z, share * g)
                step = T @ np.linalg.solve(T.T @ K @ T, T.T @ f)
                z = z + step
        assert np.abs(step).max() < 1e-9
        K, M, _ = self.assembled(z, g)
        lam = linalg.eigh(K + springs[:n, :n], M, eigvals_only=True)
        return np.sqrt(lam[:count]) / (2 * np.pi)


def turned(m: Array, c: float, s: float) -> Array:
    T = linalg.block_diag(*2 * [np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])])
    return np.asarray(T.T @ m @ T)


def beam_mass(rho: float, L: float) -> Array:
    m = np.zeros((6, 6))
    m[np.ix_([0, 3], [0, 3])] = [[140, 70], [70, 140]]
    rows = [[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]]
    m[np.ix_([1, 2, 4, 5], [1, 2, 4, 5])] = np.array(rows) * np.outer([1, L, 1, L], [1, L, 1, L])
    return m * (rho * L / 420)
