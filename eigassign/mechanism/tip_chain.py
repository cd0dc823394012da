"""The tip of a mechanism as a function of its state: what inverse kinematics asks of a chain.

A state z = (q, p) holds the coordinates and, where loops are closed, the passive freedoms. Shapes:
n states, n_q coordinates, n_p passive freedoms, n_e closure equations, d = 2 or 3 components of the
tip's position, r = 1 or 3 of its turning.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


class Look(NamedTuple):
    """The tip at n states, and how far the loops are from closed there."""

    point: Floats  # (n, d) m
    rotation: Floats | None  # (n, 3, 3) to the world; None where it was not asked for
    jacobian: Floats  # (n, d or d + r, n_q + n_p): m and rad per unit of z
    gap: Floats  # F (n, n_e), in m and, for turning, sines
    closure: Floats  # ∂F/∂z (n, n_e, n_q + n_p)


@dataclass(frozen=True)
class Assembly:
    """How the loops of a chain are put together."""

    reference: Floats  # q (n_q,) at which the assembly is chosen
    passive: Callable[[Floats], Floats]  # q (n, n_q) -> p (n, n_p); raises SingularityError
    turning: Bools  # (n_e,) which closure equations are sines of angles


@dataclass(frozen=True)
class TipChain:
    """One node (the tip) of a mechanism, seen from the ground.

    ``kinds`` of the coordinates, then of the passive freedoms: "turn" (rad, a full turn leads
    back), "screw" (rad, it does not) or "slide" (m).
    """

    look: Callable[[Floats], Look]  # z (n, n_q + n_p)
    joints: tuple[str, ...]  # of the coordinates, in their order
    relative_map: tuple[Floats, Floats]  # A (n_q, n_q), b (n_q,): joint coordinates A q + b
    kinds: tuple[str, ...]
    turned_by: tuple[int, ...] = ()  # the components of a rotation vector that a tip can have
    assembly: Assembly | None = None

    @property
    def n_q(self) -> int:
        """How many coordinates there are."""
        return len(self.joints)

    def of_kind(self, kind: str) -> Bools:
        """Which entries of a state are of this kind, (n_q + n_p,)."""
        return np.array([k == kind for k in self.kinds], dtype=bool)


@dataclass(frozen=True)
class Reduced:
    """A look with the passive freedoms eliminated: the loops closed to first order, and kept so."""

    J: Floats  # (n, m, n_q): task components per u of the coordinates
    drift: Floats  # (n, m): what closing the loops adds
    closing: Floats  # (n, n_p): what closes them
    following: Floats  # (n, n_p, n_q): how the passive freedoms follow


def reduced(seen: Look, n_q: int) -> Reduced:
    """Passive freedoms from ∂F/∂p δp = −F and ∂F/∂p ∂p/∂q = −∂F/∂q, least squares if redundant."""
    J = seen.jacobian
    n, m, n_z = J.shape
    if n_z == n_q:
        none = np.zeros((n, 0))
        return Reduced(J, np.zeros((n, m)), none, np.zeros((n, 0, n_q)))
    wanted = -np.concatenate([seen.gap[:, :, None], seen.closure[:, :, :n_q]], axis=2)
    solved = _solved(seen.closure[:, :, n_q:], wanted)
    closing, following = solved[:, :, 0], solved[:, :, 1:]
    J_p = J[:, :, n_q:]
    drift = np.einsum("nmp,np->nm", J_p, closing)
    return Reduced(J[:, :, :n_q] + J_p @ following, drift, closing, following)


def _solved(A: Floats, B: Floats) -> Floats:
    if A.shape[1] == A.shape[2]:
        try:
            return np.asarray(np.linalg.solve(A, B))
        except np.linalg.LinAlgError:  # exactly singular somewhere
            pass
    return np.asarray(np.linalg.pinv(A, rcond=1e-12) @ B)
