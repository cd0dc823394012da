"""Closed loops: passive freedoms as implicit functions of the coordinates, and their rates.

For every loop the two ways round must meet: three equations for the position and three for the
orientation (planar: two and one). With passive freedoms p they define p(q, y) on the branch chosen;
differentiated, J_p ṗ = −J_q q̇ gives ṗ = P q̇ and so the motion of the rigid links. The branch is
that of the user's guess, or found and asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from eigassign.arrays import Floats
from eigassign.case.case_file import CaseFile
from eigassign.case.schema.mechanism import FREEDOMS
from eigassign.case.units import SI, handy, shown_point
from eigassign.errors import MechanismError
from eigassign.mechanism.kinematics.forward import Kinematics, walk
from eigassign.mechanism.kinematics.joints import DOFS, Objects, multiply
from eigassign.mechanism.kinematics.parameters import (
    ModelParameters,
    initial_design,
    written_loads,
)
from eigassign.mechanism.kinematics.topology import CoordinateMap, Freedom, Topology
from eigassign.series.compiler import compile_program
from eigassign.series.expression import Expression, Recorder, Scalar, derivative
from eigassign.series.implicit import ACCEPT, ImplicitFunction


def closed_kinematics(
    case: CaseFile, parameters: ModelParameters, tree: Topology, coords: CoordinateMap
) -> Kinematics:
    """ERLS motion of a mechanism for any choice of columns, its loops closed where it has any.

    Raises MechanismError for what cannot be placed, moved or closed.
    """
    if tree.loops:
        return _close_loops(case, parameters, tree, coords)
    return walk(case, parameters, tree, coords, coords.rates.astype(object))


def all_moving(case: CaseFile, parameters: ModelParameters, motion: Kinematics) -> Kinematics:
    """The motion with every coordinate among the columns, locked ones too."""
    c = motion.coordinates
    n = len(c.relative)
    rates = np.zeros((len(motion.tree.freedoms), n))
    rates[:n] = c.relative
    if np.array_equal(rates, c.rates):
        return motion
    coords = c._replace(columns=tuple(range(n)), rates=rates)
    return closed_kinematics(case, parameters, motion.tree, coords)


def _close_loops(
    case: CaseFile, parameters: ModelParameters, tree: Topology, coords: CoordinateMap
) -> Kinematics:
    """ERLS motion of a mechanism with loops: twists T = T_q + T_p P over q̇ alone.

    P (n_passive, n) of ṗ = P q̇ comes from the loops' twist gaps.
    """
    bound = _bind_passive(case, parameters, tree, coords)
    unit = np.eye(len(tree.freedoms), dtype=object)[:, len(coords.relative) :]
    rates = np.concatenate([coords.rates.astype(object), unit], axis=1)
    free = replace(walk(case, bound, tree, coords, rates), passive=bound.passive)
    n, kept = len(coords.columns), list(DOFS[case.mechanism.space])
    gaps = np.concatenate([loop.twist_gap[kept] for loop in free.loops])
    P = passive_motion(bound.recorder, gaps[:, n:], gaps[:, :n])

    def narrowed(twist: Objects) -> Objects:
        return twist[:, :n] + multiply(twist[:, n:], P) if P.size else twist[:, :n]

    placements = tuple(replace(p, twist=narrowed(p.twist)) for p in free.placements)
    return replace(free, placements=placements, passive_rates=P)


def _bind_passive(
    case: CaseFile, parameters: ModelParameters, tree: Topology, coords: CoordinateMap
) -> ModelParameters:
    """The parameters with each passive freedom as a component of the implicit function."""
    if not tree.passive:
        _check_rigid_loops(case, parameters, tree, coords)
        return parameters
    recorder = Recorder()
    n_q, n_y, n_p = len(coords.relative), len(parameters.varied), len(tree.passive)
    trial = parameters.rerecorded(recorder, n_p)
    F, check = _equations(case, trial, tree, coords)
    J = [[derivative(f, n_q + n_y + k) for k in range(n_p)] for f in F]
    atoms = sorted({a for s in (*F, *check) if isinstance(s, Expression) for a in s.terms})
    depends = compile_program(recorder, atoms, n_q + n_y + n_p).dependence
    used = [v for v in range(n_q + n_y) if depends[:, v].any()]
    scalars = [*F, *check, *(entry for row in J for entry in row)]
    program = compile_program(recorder, [recorder.atom(s) for s in scalars], n_q + n_y + n_p)
    order = {v: k for k, v in enumerate([*used, *range(n_q + n_y, n_q + n_y + n_p)])}
    renamed = np.array([order[int(v)] for v in program.input_variables], dtype=np.intp)
    # the joint coordinates s are those of q, but where q counts absolute angles
    plain = (coords.relative == np.eye(n_q)).all(axis=1) & (coords.offset == 0.0)
    own = [
        name if same else f"{name} relative to the base of {c.joint!r}"
        for same, (name, c) in zip(plain, case.coordinates.items(), strict=True)
    ]
    names = (*own, *parameters.varied)
    units = (*case.coordinate_units, *[""] * len(parameters.varied))
    known = tuple(names[v] for v in used)
    function = ImplicitFunction(
        replace(program, input_variables=renamed, n_variables=len(order)),
        n_p,
        len(F),
        len(check),
        np.zeros(len(used)),
        np.zeros(n_p),
        known,
        "the mechanism",
        partial(shown_point, known, units=tuple(units[v] for v in used)),
    )
    branches = _Branches(case, tree, function, used, parameters, reference_coordinates(case))
    solved = replace(function, a0=branches.a0, p0=branches.chosen())
    return parameters.with_passive(
        parameters.recorder.implicit(solved, [parameters.recorder.variable(v) for v in used])
    )


def _equations(
    case: CaseFile, parameters: ModelParameters, tree: Topology, coords: CoordinateMap
) -> tuple[list[Scalar], list[Scalar]]:
    """Closure rows F and check rows of all loops, on passive freedoms as plain variables."""
    motion = walk(case, parameters, tree, coords)
    return closure_rows(motion, case.mechanism.space == "planar")


def closure_rows(motion: Kinematics, planar: bool) -> tuple[list[Scalar], list[Scalar]]:
    """F = 0 of all loops, per loop the gap in m and the sines of the turns, and the check rows."""
    F: list[Scalar] = []
    check: list[Scalar] = []
    for loop in motion.loops:
        D = loop.misalignment
        turn = [(D[2, 1] - D[1, 2]) * 0.5, (D[0, 2] - D[2, 0]) * 0.5, (D[1, 0] - D[0, 1]) * 0.5]
        F += [*loop.position_gap[:2], turn[2]] if planar else [*loop.position_gap, *turn]
        check.append(D[0, 0] + D[1, 1] + D[2, 2] - 3.0)  # sine rows alone admit a half turn
    return F, check


def _check_rigid_loops(
    case: CaseFile, parameters: ModelParameters, tree: Topology, coords: CoordinateMap
) -> None:
    """Loops without passive freedoms must close as they are drawn, up to rounded dimensions."""
    F, check = _equations(case, parameters, tree, coords)
    n = len(F) // len(tree.loops)
    for k, loop in enumerate(tree.loops):
        rows = [*F[n * k : n * (k + 1)], check[k]]
        path = f"mechanism.joints.{loop.joint}"
        if any(isinstance(value, Expression) for value in rows):
            message = "closes a loop that has no passive joint to follow the coordinates or the "
            raise MechanismError(path, message + "design: leave a joint of it without coordinate")
        values = np.array(rows, dtype=np.float64)
        gap = _gap(values[:n, None], n)
        if max(gap) > MEETS or abs(values[n]) > MEETS:
            half = " and half a turn" if values[n] < -2.0 else ""
            raise MechanismError(
                path,
                f"closes a loop whose two sides do not meet: {_spelt(gap)}{half} apart, where "
                f"{MEETS:g} m and rad pass as rounding. Correct its positions, lengths and angles, "
                "or give one of its joints a freedom",
            )


def _gap(F: Floats, n: int) -> tuple[float, float]:
    """The largest distance (m) and turn (rad) between two sides, of rows F (k n, 1)."""
    rows = F.reshape(-1, n)
    m = 2 if n == 3 else 3
    turn = np.arcsin(np.minimum(np.linalg.norm(rows[:, m:], axis=1), 1.0))
    return float(np.linalg.norm(rows[:, :m], axis=1).max()), float(turn.max())


def _spelt(gap: tuple[float, float]) -> str:
    return f"{gap[0]:.2g} m and {gap[1]:.2g} rad"


def passive_motion(recorder: Recorder, J: Objects, right: Objects) -> Objects:
    """X of J X + ``right`` = 0, by normal equations where rows are redundant."""
    if not J.shape[1] or not right.shape[1]:
        return np.zeros((J.shape[1], right.shape[1]), dtype=object)
    A, B = J, right * -1.0
    if len(J) != J.shape[1]:
        A, B = multiply(J.T, J), multiply(J.T, B)
    solved = recorder.solve(A.tolist(), B.tolist())
    return np.array(solved, dtype=object).reshape(B.shape)


# --- the assembly branch

MEETS = 1e-5  # m and rad: a loop without passive joints closes, its dimensions have six digits
SAME = 1e-6  # rad or m: solutions within it are one, as Newton settles at round-off
# `_apart` from the guess Newton's solution is taken without a look at others: of 400 random
# parallelograms and guesses none within 0.6 was another than the nearest
NEAR = 0.5
CHANGE = 1e-5  # rad or m, for central differences of F
IMMOBILE = 1e-5  # share of ∂F/∂a beyond what ∂F/∂p can meet; differences leave some 1e-9 of it
RANK = 1e-7  # of the largest singular value of ∂F/∂p: those below do not count


@dataclass(frozen=True, eq=False)
class _Branches:
    """The solutions p of the closure at the coordinates q: ways to put the loops together."""

    case: CaseFile
    tree: Topology
    function: ImplicitFunction
    used: Sequence[int]  # the entries of z that are its arguments
    parameters: ModelParameters
    q: Floats  # (n_q,)

    @cached_property
    def a0(self) -> Floats:
        """The arguments at q, properties as written."""
        return reference(self.case, self.parameters, self.q)[list(self.used)]

    def chosen(self) -> Floats:
        """The solution p_0 that the case asks for, or the only one.

        Raises MechanismError when there is none, when the passive freedoms are not determined or
        cannot follow, or when several branches exist and the case gives no guess. The message has
        branches as a case would write them, the nearest to the guess first; where there is none at
        these coordinates, those of other ones.
        """
        assembly = getattr(self.case.mechanism, "assembly", None)
        guess, drawn = _guess(self.tree, assembly), np.zeros(self.function.size)
        near = drawn if guess is None else guess
        found = near[None] if self._missed(near[None])[0] < ACCEPT else self._starts[:0]
        if guess is not None and not len(found):
            found = self._solutions(near[None])
        led = [p for p in found if self._apart(p, near) < NEAR]
        ways = led or sorted(
            self._solutions(np.vstack([found, self._starts])), key=lambda p: self._apart(p, near)
        )
        path, message = "mechanism.assembly" if assembly else "mechanism.joints", ""
        if not ways:
            message = self._unclosable()
        elif not self._is_determined(ways[0]):
            path, message = "coordinates", self._open()
        elif held := self._held(ways[0]):
            path = "design" if held in self.parameters.varied else "coordinates"
            message = (
                f"{held} cannot change at {self._at}: the loops hold it, as a structure or at a "
                f"dead point. Give a joint another freedom, or lock it{self._elsewhere()}"
            )
        elif len(ways) > 1 and (not len(found) or self._apart(ways[0], found[0]) > SAME):
            message = "the guess leads to no closed pose near it: " * (guess is not None)
            message += f"the loops close in {len(ways)} ways at {self._at}: {self._ways(ways)}"
        if message:
            raise MechanismError(path, message)
        return np.asarray(ways[0])

    def _apart(self, p: Floats, guess: Floats) -> float:
        """Σ |2 sin(Δ/2)| of what turns, and of what slides Σ |Δ| in m.

        Of chords one angle that is half a turn off counts 2, less than several that are 60 deg off.
        """
        return float(np.abs(self._gaps(p - guess)).sum())

    def _gaps(self, d: Floats) -> Floats:
        """Differences of p, full turns not counted."""
        return np.where(self._turning, 2.0 * np.sin(d / 2.0), d)

    @cached_property
    def _turning(self) -> NDArray[np.bool_]:
        return np.array([_unit(self.case, f) == "rad" for f in self.tree.passive], dtype=bool)

    @property
    def _starts(self) -> Floats:
        """Evenly spread starting points (64, n_p) over a turn, or π metres, each way."""
        return np.asarray(np.pi * (2.0 * kronecker(64, self.function.size) - 1.0))

    def _equations(self, p: Floats) -> tuple[Floats, Floats, Floats]:
        """F, check and ∂F/∂p at p (n, n_p), see `ImplicitFunction`."""
        return self.function.equations(np.repeat(self.a0[:, None], len(p), axis=1), p.T)

    def _missed(self, p: Floats) -> Floats:
        """The largest of all rows that p (n, n_p) leaves, (n,)."""
        F, check, _ = self._equations(p)
        return np.asarray(np.abs(np.concatenate([F, check])).max(axis=0))

    def _descended(self, starts: Floats) -> Floats:
        """States (n, n_p) that Newton's steps, in least squares, lead to from many starts."""
        p = starts.T
        for _ in range(6):
            p, _ = self.function.newton(np.repeat(self.a0[:, None], len(starts), axis=1), p)
        return p.T

    def _solutions(self, starts: Floats) -> Floats:
        """Distinct solutions from many starting points, the nearest to the first start first.

        Rx(α) Ry(β) Rz(γ) = Rx(α + π) Ry(π − β) Rz(γ + π): of balls |β| ≤ π/2.
        """
        p, several = self._descended(starts), len(starts) > 1
        joints, names = self.case.mechanism.joints, [f.joint for f in self.tree.passive]
        balls = [
            k
            for k, f in enumerate(self.tree.passive)
            if joints[f.joint].type == "spherical"
            and f.component == 0
            and names.count(f.joint) == 3
        ]
        distinct: list[Floats] = []
        for candidate in p[self._missed(p) < ACCEPT]:
            turned = wrapped(candidate)
            for k in balls if several else ():
                if abs(turned[k + 1]) > np.pi / 2:
                    alpha, beta, gamma = turned[k : k + 3]
                    turned[k : k + 3] = wrapped(np.array([alpha, -beta, gamma]) + np.pi)
            near = np.where(self._turning & several, turned, candidate)
            if all(np.abs(self._gaps(near - d)).max() > SAME for d in distinct):
                distinct.append(near)
        return np.array(distinct).reshape(-1, self.function.size)

    def _is_determined(self, p0: Floats) -> bool:
        return int(np.linalg.matrix_rank(self._equations(p0[None])[2][0], RANK)) == len(p0)

    def _open(self) -> str:
        """The sentence on passive freedoms that are not determined: here alone, or everywhere."""
        if elsewhere := self._elsewhere():
            return f"{self._at} is a dead point of the loops{elsewhere}"
        met = int(np.linalg.matrix_rank(self._equations(self._starts)[2], RANK).max())
        missing = max(self.function.size - met, 1)
        joints = ", ".join(sorted({f.joint for f in self.tree.passive}))
        n = len(self.tree.freedoms) - len(self.tree.passive)
        return (
            f"{missing} more coordinate(s) needed: {n} of {n + missing} freedom(s) have one, "
            f"which leaves the joints {joints} open; or {self._at} is a dead point"
        )

    def _elsewhere(self) -> str:
        """The clause on another pose at which the loops close; nothing where none is found."""
        best, text = RANK, ""
        varied = [v for v in self.used if v < len(self.q)]
        turning = np.array(self.case.coordinate_units)[varied] == "rad"
        for share in 2.0 * kronecker(32, max(len(varied), 1))[:, : len(varied)] - 1.0:
            q = self.q.copy()
            # by tens of degrees; what slides by millimetres to metres
            steps = np.where(turning, np.radians(10.0) * np.round(18.0 * share), np.pi * share**3)
            q[varied] += np.where(turning, steps, np.round(steps, 2))
            other = replace(self, q=q)
            ways = [*other._solutions(self._starts)]
            if not ways or not all(other._is_determined(p) and not other._held(p) for p in ways):
                continue
            s = np.linalg.svd(other._equations(np.array(ways))[2], compute_uv=False)
            if (least := float((s[:, -1] / s[:, 0]).min())) > best:
                best, many = least, f"in {len(ways)} ways" if len(ways) > 1 else "so"
                text = f". Put them together where they close {many}: {other._ways(ways)}"
        return text

    def _held(self, p0: Floats) -> str:
        """The first argument that cannot change, "" for none: ∂F/∂p ṗ = −∂F/∂a has no solution."""
        J, n = self._equations(p0[None])[2][0], len(self.a0)
        steps = self.a0[:, None] + CHANGE * np.hstack([np.eye(n), -np.eye(n)])
        F = self.function.equations(steps, np.repeat(p0[:, None], 2 * n, axis=1))[0]
        slope = (F[:, :n] - F[:, n:]) / (2.0 * CHANGE)
        unmet = np.linalg.norm(slope - J @ (np.linalg.pinv(J) @ slope), axis=0)
        moves = [c.moves for c in self.case.coordinates.values()]
        for k, v in enumerate(self.used):
            held = v < len(moves) and moves[v] == "locked"  # the only pose it has is then enough
            if unmet[k] > IMMOBILE * np.linalg.norm(slope[:, k]) and not held:
                return self.function.names[k]
        return ""

    def _unclosable(self) -> str:
        """The sentence on loops that do not close: too many conditions, or too little length."""
        message, n = f"the loops cannot be closed at {self._at}", self.function.n_equations
        met = int(np.linalg.matrix_rank(self._equations(self._starts)[2], RANK).max())
        p = self._descended(self._starts)
        nearest = p[[int(np.nanargmin(self._missed(p)))]]
        left = _gap(self._equations(nearest)[0], len(DOFS[self.case.mechanism.space]))
        if met == n:
            instead = self._elsewhere() or ". Correct lengths and positions"
            return (
                f"{message}: links do not reach, or lie beyond a dead point; the nearest pose "
                f"found leaves {_spelt(left)}{instead}"
            )
        joints = ", ".join(dict.fromkeys(f.joint for f in self.tree.passive))
        # rounded dimensions of a loop with passive joints leave less than 1e-3 m and rad
        if max(left) < 1e-3:
            return (
                f"{message}, but nearly: {_spelt(left)} are left, and {ACCEPT:g} are accepted. Of "
                f"{n} conditions {joints} can meet {met}; dimensions must meet the others: give "
                "these twelve digits, or joints more freedoms (spherical for universal)"
            )
        return (
            f"{message}: they pose {n} conditions, of which {joints} can meet {met}: {n - met} "
            "coordinate(s) too many, or joints with too few freedoms for dimensions that do not "
            f"agree. The nearest pose found leaves {_spelt(left)}"
        )

    @property
    def _at(self) -> str:
        shown = self.function.shown
        return shown(self.a0) if shown is not None and self.used else "its only pose"

    def _ways(self, ways: Sequence[Floats]) -> str:
        """Branches as guesses, eight at most, and the first with all that is to be written."""
        listed = [_as_guess(self.case, self.tree, p) for p in ways[:8]] + ["…"] * (len(ways) > 8)
        choice = f"mechanism.assembly: {as_assembly(self.case, self.tree, self.q, ways[0])}"
        return f"{' | '.join(listed)}; choose one with {choice}" if ways[1:] else choice


def reference(case: CaseFile, parameters: ModelParameters, q: Floats | None = None) -> Floats:
    """z at q, by default where the branch is chosen, properties as written."""
    at = reference_coordinates(case) if q is None else q
    written = (written_loads(case), initial_design(case))
    return parameters.z(np.concatenate([at, *written])[None])[:, 0]


def reference_coordinates(case: CaseFile) -> Floats:
    """q (n_q,) at which the assembly is chosen: ``assembly.at``, the expansion's q, or zero."""
    q = np.zeros(len(case.coordinates))
    given = getattr(case.expansion, "q", "auto")
    if not isinstance(given, str):
        q[:] = given
    at = getattr(getattr(case.mechanism, "assembly", None), "at", None) or {}
    for name, value in at.items():
        q[list(case.coordinates).index(name)] = value
    return q


def _guess(tree: Topology, assembly: object) -> Floats | None:
    given = dict(getattr(assembly, "guess", None) or {})
    if not given:
        return None
    out = np.zeros(len(tree.passive))
    for k, freedom in enumerate(tree.passive):
        value = given.get(freedom.joint, 0.0)
        if isinstance(value, (tuple, list)):  # all freedoms of the joint, or the passive ones
            passive = [f.component for f in tree.passive if f.joint == freedom.joint]
            own = len(value) == len(passive)
            out[k] = value[passive.index(freedom.component) if own else freedom.component]
        else:
            out[k] = value
    return out


def kronecker(count: int, n: int) -> Floats:
    """Evenly spread points (count, n) of the unit cube: (1/2 + k α) mod 1 (Roberts 2018).

    α_i = g^-i (n,), g > 1 the root of g^(n+1) = g + 1, the golden ratio for n = 1.
    """
    g = 1.5
    for _ in range(60):  # contracts by at least 2 a step
        g = (1.0 + g) ** (1.0 / (n + 1.0))
    return np.mod(0.5 + np.arange(count)[:, None] * g ** -np.arange(1.0, n + 1.0), 1.0)


def wrapped(angles: Floats) -> Floats:
    """Angles in [−π, π)."""
    return np.asarray(np.mod(angles + np.pi, 2.0 * np.pi) - np.pi)


_PASTED = {"rad": SI("rad", "deg"), "m": SI("m", "m")}  # units of an assembly that is proposed


def _unit(case: CaseFile, freedom: Freedom) -> str:
    """rad of a freedom that turns, m of one that slides."""
    known = FREEDOMS[case.mechanism.joints[freedom.joint].type]
    return "m" if known[freedom.component] == "translation" else "rad"


def as_assembly(case: CaseFile, tree: Topology, q: Floats, p: Floats) -> str:
    """The key `assembly` for passive freedoms p at coordinates q, as a case would have it."""
    named = zip(case.coordinates, q, case.coordinate_units, strict=True)
    at = ", ".join(f"{name}: {handy(value, _PASTED[unit], 6)}" for name, value, unit in named)
    return f"{{at: {{{at}}}, guess: {_as_guess(case, tree, p)}}}"


def _as_guess(case: CaseFile, tree: Topology, p: Floats) -> str:
    """One solution as the guess that leads to it: a list for a joint with several freedoms."""
    values: dict[str, list[str]] = {}
    for freedom, value in zip(tree.passive, p.round(9) + 0.0, strict=True):
        values.setdefault(freedom.joint, []).append(handy(value, _PASTED[_unit(case, freedom)], 4))
    several = {j: v[0] if len(v) == 1 else f"[{', '.join(v)}]" for j, v in values.items()}
    return "{" + ", ".join(f"{joint}: {value}" for joint, value in several.items()) + "}"
