"""The tip of a mechanism as a function of its state, with its Jacobian and the closure of loops.

A state z = (q, p) holds the coordinates and, where loops are closed, the passive freedoms. The
links are placed anew with every freedom of every joint as a variable, the passive ones too: so
inverse kinematics closes the loops and reaches the point together, on the branch that it follows.

Shapes: n states, n_q coordinates, n_p passive freedoms, n_e closure equations, d = 2 or 3
components of the tip's position, r = 1 or 3 of its turning.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from eigassign.case.case_file import CaseFile
from eigassign.case.schema.mechanism import ADVANCING, FREEDOMS
from eigassign.mechanism.kinematics.forward import Kinematics, walk
from eigassign.mechanism.kinematics.loop_closure import closure_rows, reference_coordinates
from eigassign.mechanism.kinematics.parameters import ModelParameters, node_position
from eigassign.mechanism.kinematics.topology import Topology, split
from eigassign.series.algebra import Tangents
from eigassign.series.compiler import CompiledArrays, compile_arrays
from eigassign.series.expression import Recorder

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


class TipEvaluation(NamedTuple):
    """The tip at n states, and how far the loops are from closed there."""

    point: Floats  # (n, d) m
    rotation: Floats | None  # (n, 3, 3) to the world; None where it was not asked for
    jacobian: Floats  # (n, d or d + r, n_q + n_p): m and rad per unit of z
    gap: Floats  # F (n, n_e), in m and, for turning, sines
    closure: Floats  # ∂F/∂z (n, n_e, n_q + n_p)


@dataclass(frozen=True)
class LoopAssembly:
    """The assembly of a chain's loops."""

    reference: Floats  # q (n_q,) at which the assembly is chosen
    passive: Callable[[Floats], Floats]  # q (n, n_q) -> p (n, n_p); raises SingularityError
    turning: Bools  # (n_e,) which closure equations are sines of angles


@dataclass(frozen=True)
class TipChain:
    """One node (the tip) of a mechanism, seen from the ground.

    ``kinds`` of the coordinates, then of the passive freedoms: "turn" (rad, a full turn leads
    back), "screw" (rad, it does not) or "slide" (m).
    """

    evaluate: Callable[..., TipEvaluation]  # of z (n, n_q + n_p), and by_design: by y too
    joints: tuple[str, ...]  # of the coordinates, in their order
    relative_map: tuple[Floats, Floats]  # A (n_q, n_q), b (n_q,): joint coordinates A q + b
    kinds: tuple[str, ...]
    turned_by: tuple[int, ...] = ()  # the components of a rotation vector that a tip can have
    assembly: LoopAssembly | None = None
    y: Floats = field(default_factory=lambda: np.zeros(0))  # the design (n_y,) that it is of
    tables: TipTables | None = None  # how it changes with the design; None: not at all

    @property
    def n_q(self) -> int:
        """Number of coordinates."""
        return len(self.joints)

    @property
    def y_names(self) -> tuple[str, ...]:
        """The names of the design parameters (n_y,)."""
        return () if self.tables is None else self.tables.parameters.design

    def redesigned(self, y: Floats) -> TipChain:
        """The chain at another design (n_y,)."""
        return self if self.tables is None else self.tables.chain(y)

    def of_kind(self, kind: str) -> Bools:
        """Mask of the entries of a state that are of this kind, (n_q + n_p,)."""
        return np.array([k == kind for k in self.kinds], dtype=bool)


@dataclass(frozen=True)
class Reduced:
    """A tip evaluation with the passive freedoms eliminated: loops closed to first order."""

    J: Floats  # (n, m, n_q): task components per u of the coordinates
    drift: Floats  # (n, m): what closing the loops adds
    closing: Floats  # (n, n_p): what closes them
    following: Floats  # (n, n_p, n_q): how the passive freedoms follow


def reduced(seen: TipEvaluation, n_q: int) -> Reduced:
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


# --- the chain of a tip, built from the kinematics of its case


def tip_chain(
    case: CaseFile,
    parameters: ModelParameters,
    motion: Kinematics,
    tip: str,
    y: Floats,
    oriented: bool = False,
    loads: Floats | None = None,
) -> TipChain:
    """The chain that carries the node ``tip`` ("link.node") at design y, turned if oriented.

    ``loads`` (n_loads,) are what the trajectory sets, where there are any.
    """
    turns = (2,) if case.mechanism.space == "planar" else (0, 1, 2)
    set_ = np.zeros(0) if loads is None else loads
    return TipTables(case, parameters, motion, tip, turns if oriented else (), set_).chain(y)


@dataclass(frozen=True, eq=False)
class TipTables:
    """The chain's scalars over z and y, compiled once, and evaluated for all states together.

    The links are placed anew with open loops: passive freedoms are variables, closure is an
    equation to be met, and every freedom moves by itself.
    """

    case: CaseFile
    parameters: ModelParameters
    motion: Kinematics
    tip: str
    turns: tuple[int, ...]
    loads: Floats  # (n_loads,)

    def chain(self, y: Floats) -> TipChain:
        """The chain at design y (n_y,)."""
        return TipChain(
            evaluate=partial(self.evaluate, y=y),
            joints=tuple(c.joint for c in self.case.coordinates.values()),
            relative_map=(self.motion.relative, self.motion.offset),
            kinds=_kinds(self.case, self.motion.tree),
            turned_by=self.turns,
            assembly=self._assembly(y) if self.motion.passive else None,
            y=y,
            tables=self,
        )

    def _assembly(self, y: Floats) -> LoopAssembly:
        """The branch of the model itself: where it was chosen, and its passive freedoms."""
        gaps, sines = (2, 1) if self.case.mechanism.space == "planar" else (3, 3)
        turning = np.array(([False] * gaps + [True] * sines) * len(self.motion.tree.loops))
        return LoopAssembly(
            reference_coordinates(self.case),
            lambda q: self._passive(self._variables(q, y))[0],
            turning,
        )

    @cached_property
    def _passive(self) -> CompiledArrays:
        return self.parameters.compiled(np.array(self.motion.passive, dtype=object))

    @cached_property
    def _table(self) -> CompiledArrays:
        """Place (d,), rotation (9,) or nothing, and F (n_e,)."""
        case, tree, n_z = self.case, self.motion.tree, len(self.motion.tree.freedoms)
        variables = self.parameters.rerecorded(Recorder(), len(tree.passive))
        values = [variables.freedom(k) for k in range(n_z)]
        still = np.zeros((n_z, 0), dtype=object)
        moving = walk(case, variables, tree, self.motion.coordinates, values, still)
        link, node = split(self.tip)
        X = node_position(case, variables, tree, (link, node))
        rotation, place = moving.placement(link).at(X)
        planar = case.mechanism.space == "planar"
        F = closure_rows(moving, planar)[0] if tree.passive else []
        arrays = place[: 2 if planar else 3], rotation[: 3 if self.turns else 0].ravel()
        return compile_arrays(
            variables.recorder,
            (*arrays, np.array(F, dtype=object)),
            variables.count + len(tree.passive),
        )

    def evaluate(self, z: Floats, y: Floats, by_design: bool = False) -> TipEvaluation:
        """The tip at states z (n, n_z) and design y, with derivatives ``by_design`` behind q."""
        to_z, n_q, n = self.parameters.to_z, len(self.motion.offset), len(z)
        columns = [*range(n_q), *(range(n_q + len(self.loads), len(to_z)) if by_design else ())]
        moves = block_diag(to_z[:, columns], np.eye(z.shape[1] - n_q))
        variables = np.hstack([self._variables(z, y), np.repeat(moves, n, axis=1)])
        found = self._table(variables, Tangents(n, moves.shape[1]))
        place, turned, F = (each.reshape(len(each) // n, n, *each.shape[1:]) for each in found)
        J, R = place[1:], None
        if self.turns:
            R, *turning = turned.reshape(-1, n, 3, 3)
            W = np.einsum("knij,nlj->ilkn", turning, R)  # Ṙ Rᵀ = [ω]×
            spin = [(W[2, 1], W[0, 2], W[1, 0])[k] for k in self.turns]
            J = np.concatenate([J, np.stack(spin, axis=2)], axis=2)
        jacobian, closure = (np.moveaxis(each, 0, 2) for each in (J, F[1:]))
        return TipEvaluation(place[0], R, jacobian, F[0], closure)

    def _variables(self, z: Floats, y: Floats) -> Floats:
        """The joint coordinates, loads, y and p as rows."""
        q, p = np.split(z, [len(self.motion.offset)], axis=1)
        given = np.broadcast_to(np.append(self.loads, y), (len(z), len(self.loads) + len(y)))
        return np.concatenate([self.parameters.z(np.hstack([q, given])), p.T])


def _kinds(case: CaseFile, tree: Topology) -> tuple[str, ...]:
    """The kind of each freedom; where a loop is closed over a screw, no turn leads back."""
    types = [case.mechanism.joints[f.joint].type for f in tree.freedoms]
    advancing = any(j.type in ADVANCING for j in case.mechanism.joints.values())
    kinds = []
    for freedom, kind in zip(tree.freedoms, types, strict=True):
        slides = FREEDOMS[kind][freedom.component] == "translation"
        turn = "screw" if kind == "screw" or (tree.loops and advancing) else "turn"
        kinds.append("slide" if slides else turn)
    return tuple(kinds)
