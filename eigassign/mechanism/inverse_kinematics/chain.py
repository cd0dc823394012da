"""The tip of a mechanism as a function of its state, with its Jacobian and the closure of loops.

A state z = (q, p) holds the coordinates and, where loops are closed, the passive freedoms. The
links are placed anew with every freedom of every joint as a variable, the passive ones too: so
inverse kinematics closes the loops and reaches the point together, on the branch that it follows.

Shapes: n states, n_q coordinates, n_p passive freedoms, n_e closure equations, d = 2 or 3
components of the tip's position, r = 1 or 3 of its turning.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.case.schema.mechanism import ADVANCING, FREEDOMS
from eigassign.mechanism.kinematics.forward import Kinematics, shifted, walk
from eigassign.mechanism.kinematics.joints import Objects, multiply
from eigassign.mechanism.kinematics.loop_closure import closure_rows, reference_coordinates
from eigassign.mechanism.kinematics.parameters import ModelParameters, node_position
from eigassign.mechanism.kinematics.topology import Topology, split
from eigassign.series.compiler import CompiledArrays, compile_arrays
from eigassign.series.expression import Recorder, derivative

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

    evaluate: Callable[[Floats], TipEvaluation]  # z (n, n_q + n_p)
    joints: tuple[str, ...]  # of the coordinates, in their order
    relative_map: tuple[Floats, Floats]  # A (n_q, n_q), b (n_q,): joint coordinates A q + b
    kinds: tuple[str, ...]
    turned_by: tuple[int, ...] = ()  # the components of a rotation vector that a tip can have
    assembly: LoopAssembly | None = None
    y: Floats = field(default_factory=lambda: np.zeros(0))  # the design (n_y,) that it is of
    design: TipTables | None = None  # how it changes with the design; None of a chain without one

    @property
    def n_q(self) -> int:
        """Number of coordinates."""
        return len(self.joints)

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
    points, turns = (2, (2,)) if case.mechanism.space == "planar" else (3, (0, 1, 2))
    set_ = np.zeros(0) if loads is None else loads / parameters.scales
    own = (points, turns if oriented else (), set_)
    return TipTables(case, parameters, motion, tip, *own).chain(y)


@dataclass(frozen=True, eq=False)
class TipTables:
    """The chain's scalars over z and y, compiled once, and evaluated for all states together.

    The links are placed anew with open loops: passive freedoms are variables, closure is an
    equation to be met, and every freedom moves by itself. Of the design only angles of joints then
    turn links.
    """

    case: CaseFile
    parameters: ModelParameters
    motion: Kinematics
    tip: str
    d: int
    turns: tuple[int, ...]
    loads: Floats  # (n_loads,) as variables of the program: see ModelParameters

    @property
    def names(self) -> tuple[str, ...]:
        """The design parameters y."""
        return self.parameters.design

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
            design=self,
        )

    @cached_property
    def _passive_table(self) -> CompiledArrays:
        """The passive freedoms of the model itself."""
        return self.parameters.compiled(np.array(self.motion.passive, dtype=object))

    def _assembly(self, y: Floats) -> LoopAssembly:
        """The branch of the model itself: where it was chosen, and its passive freedoms."""

        def passive(q: Floats) -> Floats:
            return self._passive_table(self._variables(q, y))[0]

        gaps, sines = (2, 1) if self.case.mechanism.space == "planar" else (3, 3)
        loops = len(self.motion.tree.loops)
        turning = np.array(([False] * gaps + [True] * sines) * loops, dtype=bool)
        return LoopAssembly(reference_coordinates(self.case), passive, turning)

    def properties(self, y: Floats) -> Floats:
        """The loads and the design y as variables of the program, behind s."""
        return np.append(self.loads, y)

    @cached_property
    def _recorded(self) -> tuple[Recorder, list[Objects]]:
        """Place (d,), rotation (9,) or nothing, J (d + r, n_z), F (n_e,) and ∂F/∂z."""
        case, tree, A = self.case, self.motion.tree, self.motion.relative
        n_z = len(tree.freedoms)
        recorder = Recorder()
        variables = self.parameters.rerecorded(recorder, len(tree.passive))
        values = [variables.freedom(k) for k in range(n_z)]
        moving = walk(
            case, variables, tree, self.motion.coordinates, values, np.eye(n_z, dtype=object)
        )
        link, node = split(self.tip)
        X = node_position(case, variables, tree, (link, node))
        rotation, place = moving.placement(link).at(X)
        twist = shifted(moving.placement(link).twist, X)
        velocity, spin = multiply(rotation, twist[:3]), multiply(rotation, twist[3:])
        J = _per_coordinate(np.concatenate([velocity[: self.d], spin[list(self.turns)]]), A)
        F, dF = _closure(moving, self.d == 2, len(self.parameters.varied), A)
        turned = rotation.ravel() if self.turns else rotation[:0].ravel()
        return recorder, [place[: self.d], turned, J, F, dF]

    @property
    def _n_y(self) -> int:
        return len(self.parameters.design)

    def _compiled(self, arrays: Sequence[Objects]) -> CompiledArrays:
        n_variables = len(self.motion.tree.freedoms) + len(self.parameters.varied)
        return compile_arrays(self._recorded[0], arrays, n_variables)

    @cached_property
    def _state_table(self) -> CompiledArrays:
        return self._compiled(self._recorded[1])

    @cached_property
    def _design_table(self) -> CompiledArrays:
        """∂(place)/∂y (d, n_y), ∂(rotation)/∂y (9 or 0, n_y) and ∂F/∂y (n_e, n_y)."""
        place, rotation, _, F, _ = self._recorded[1]
        first = len(self.motion.offset) + len(self.loads)
        columns = range(first, first + self._n_y)
        parts = [
            np.array([[derivative(f, k) for k in columns] for f in of], dtype=object)
            for of in (place, rotation, F)
        ]
        return self._compiled([part.reshape(-1, self._n_y) for part in parts])

    def evaluate(self, z: Floats, y: Floats) -> TipEvaluation:
        """Evaluate the tip at states z (n, n_z) and design y."""
        point, turned, J, F, dF = self._state_table(self._variables(z, y))
        R = turned.reshape(len(z), 3, 3) if self.turns else None
        return TipEvaluation(point, R, J, F, dF)

    def evaluate_with_design(self, z: Floats, y: Floats) -> TipEvaluation:
        """The same with derivatives by (q, y, p) instead of (q, p)."""
        seen = self.evaluate(z, y)
        place, turning, closing = self._design_table(self._variables(z, y))
        J = np.zeros((*seen.jacobian.shape[:2], self._n_y))
        J[:, : self.d] = place
        if seen.rotation is not None:  # ω per y of Ṙ Rᵀ = [ω]×
            W = np.einsum("nijy,nkj->nyik", turning.reshape(len(z), 3, 3, -1), seen.rotation)
            spin = [W[:, :, 2, 1], W[:, :, 0, 2], W[:, :, 1, 0]]
            J[:, self.d :] = np.stack([spin[k] for k in self.turns], axis=1)
        after = [len(self.motion.offset)]
        parted = [np.split(both, after, axis=2) for both in (seen.jacobian, seen.closure)]
        tip, closure = (
            np.concatenate([by_q, by_y, by_p], axis=2)
            for (by_q, by_p), by_y in zip(parted, (J, closing), strict=True)
        )
        return seen._replace(jacobian=tip, closure=closure)

    def _variables(self, z: Floats, y: Floats) -> Floats:
        """s = A q + b, loads, y and p as rows."""
        A, b, given = self.motion.relative, self.motion.offset, self.properties(y)
        n_q = len(b)
        at = np.empty((z.shape[1] + len(given), len(z)))
        at[:n_q] = (z[:, :n_q] @ A.T + b).T
        at[n_q : n_q + len(given)] = given[:, None]
        at[n_q + len(given) :] = z[:, n_q:].T
        return at


def _per_coordinate(rates: Objects, A: Floats) -> Objects:
    """Derivatives by (s, p) as derivatives by (q, p), s = A q + b."""
    n_q = len(A)
    if np.array_equal(A, np.eye(n_q)):
        return rates
    return np.concatenate([multiply(rates[:, :n_q], A), rates[:, n_q:]], axis=1)


def _closure(motion: Kinematics, planar: bool, n: int, A: Floats) -> tuple[Objects, Objects]:
    """F (n_e,) and ∂F/∂(q, p) (n_e, n_z) of loops that passive freedoms close.

    Between the variables of q and of p are those of ``n`` properties.
    """
    n_q, n_z = len(A), len(motion.tree.freedoms)
    if not motion.tree.passive:
        return np.zeros(0, dtype=object), np.zeros((0, n_z), dtype=object)
    F, _ = closure_rows(motion, planar)
    variables = [*range(n_q), *range(n_q + n, n_z + n)]
    dF = np.array([[derivative(f, k) for k in variables] for f in F], dtype=object)
    return np.array(F, dtype=object), _per_coordinate(dF, A)


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
