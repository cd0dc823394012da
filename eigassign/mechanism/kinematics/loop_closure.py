"""Closed loops: passive freedoms as implicit functions of the coordinates, and their rates.

For every loop the two ways round must meet: three equations for the position and three for the
orientation (planar: two and one). With passive freedoms p they define p(q, y) on the branch chosen;
differentiated, J_p ṗ = −J_q q̇ gives ṗ = P q̇ and so the motion of the rigid links. The branch is
that of the user's guess, or found and asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.case.schema.joints import FREEDOMS
from eigassign.errors import MechanismError
from eigassign.mechanism.kinematics.coordinates import CoordinateMap
from eigassign.mechanism.kinematics.forward import Kinematics, walk
from eigassign.mechanism.kinematics.parameters import (
    ModelParameters,
    initial_design,
    written_loads,
)
from eigassign.mechanism.kinematics.rotations import DOFS, Floats, Objects, multiply
from eigassign.mechanism.kinematics.topology import Topology
from eigassign.series.compiler import Program, compile_program
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
    if tree.passive:
        name = tree.passive[0].joint
        message = "moves without a coordinate in an open chain: give it one, or make it fixed"
        raise MechanismError(f"mechanism.joints.{name}", message)
    values = [parameters.freedom(k) for k in range(len(tree.freedoms))]
    return walk(case, parameters, tree, coords, values, coords.rates.astype(object))


def all_moving(case: CaseFile, parameters: ModelParameters, motion: Kinematics) -> Kinematics:
    """The same motion with every coordinate among the columns, locked ones too."""
    c = motion.coordinates
    n = len(c.relative)
    rates = np.zeros((len(motion.tree.freedoms), n))
    rates[:n] = c.relative
    coords = replace(c, columns=tuple(range(n)), rates=rates)
    return closed_kinematics(case, parameters, motion.tree, coords)


def _close_loops(
    case: CaseFile, parameters: ModelParameters, tree: Topology, coords: CoordinateMap
) -> Kinematics:
    """ERLS motion of a mechanism with loops: twists T = T_q + T_p P over q̇ alone.

    P (n_passive, n) of ṗ = P q̇ comes from the loops' twist gaps.
    """
    bound = _bind_passive(case, parameters, tree, coords)
    values = [bound.freedom(k) for k in range(len(tree.freedoms))]
    unit = np.eye(len(tree.freedoms), dtype=object)[:, len(coords.relative) :]
    rates = np.concatenate([coords.rates.astype(object), unit], axis=1)
    free = replace(walk(case, bound, tree, coords, values, rates), passive=bound.passive)
    n, kept = len(coords.columns), list(DOFS[case.mechanism.space])
    gaps = np.concatenate([loop.twist_gap[kept] for loop in free.loops])
    P = passive_motion(bound.recorder, gaps[:, n:], gaps[:, :n])

    def narrowed(twist: Objects) -> Objects:
        return twist[:, :n] + multiply(twist[:, n:], P) if P.size else twist[:, :n]

    placements = tuple(replace(p, twist=narrowed(p.twist)) for p in free.placements)
    return replace(free, placements=placements)


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
    program = _reordered(recorder, scalars, used, n_q + n_y, n_p)
    names = (*_joint_names(case, coords), *parameters.varied)
    function = ImplicitFunction(
        program,
        n_p,
        len(F),
        len(check),
        np.zeros(len(used)),
        np.zeros(n_p),
        tuple(names[v] for v in used),
        "the mechanism",
    )
    a0, p0 = choose_branch(case, tree, function, used, parameters)
    solved = replace(function, a0=a0, p0=p0)
    return parameters.with_passive(
        parameters.recorder.implicit(solved, [parameters.recorder.variable(v) for v in used])
    )


def _joint_names(case: CaseFile, coords: CoordinateMap) -> list[str]:
    """The names of the joint coordinates s: those of q, but where q counts absolute angles."""
    plain = (coords.relative == np.eye(len(coords.relative))).all(axis=1) & (coords.offset == 0.0)
    return [
        name if same else f"{name} relative to the base of {c.joint!r}"
        for same, (name, c) in zip(plain, case.coordinates.items(), strict=True)
    ]


def _equations(
    case: CaseFile, parameters: ModelParameters, tree: Topology, coords: CoordinateMap
) -> tuple[list[Scalar], list[Scalar]]:
    """Closure rows F and check rows of all loops, on passive freedoms as plain variables."""
    values = [parameters.freedom(k) for k in range(len(tree.freedoms))]
    still = np.zeros((len(tree.freedoms), 0), dtype=object)
    motion = walk(case, parameters, tree, coords, values, still)
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
                f"{MEETS:g} m and rad are taken for rounded digits. Correct the positions, lengths "
                "and angles of the loop, or give one of its joints a freedom",
            )


def _gap(F: Floats, n: int) -> tuple[float, float]:
    """The largest distance (m) and turn (rad) between two sides, of rows F (k n, 1)."""
    rows = F.reshape(-1, n)
    m = 2 if n == 3 else 3
    turn = np.arcsin(np.minimum(np.linalg.norm(rows[:, m:], axis=1), 1.0))
    return float(np.linalg.norm(rows[:, :m], axis=1).max()), float(turn.max())


def _spelt(gap: tuple[float, float]) -> str:
    return f"{gap[0]:.2g} m and {gap[1]:.2g} rad"


def _reordered(
    recorder: Recorder, scalars: Sequence[Scalar], used: list[int], n: int, n_p: int
) -> Program:
    """Compile over (used variables, passive freedoms) numbered from 0."""
    program = compile_program(recorder, [recorder.atom(s) for s in scalars], n + n_p)
    order = {v: k for k, v in enumerate([*used, *range(n, n + n_p)])}
    renamed = np.array([order[int(v)] for v in program.input_variables], dtype=np.intp)
    return replace(program, input_variables=renamed, n_variables=len(order))


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
CHANGE = 1e-5  # rad or m, for central differences of F
IMMOBILE = 1e-5  # share of ∂F/∂a beyond what ∂F/∂p can meet; differences leave some 1e-9 of it
RANK = 1e-7  # of the largest singular value of ∂F/∂p: those below do not count


def choose_branch(
    case: CaseFile,
    tree: Topology,
    function: ImplicitFunction,
    used: Sequence[int],
    parameters: ModelParameters,
) -> tuple[Floats, Floats]:
    """A solution (a_0, p_0) of the closure at the reference configuration.

    Raises MechanismError when there is none, when the passive freedoms are not determined, or when
    several branches exist and the case gives no guess; the branches are then listed.
    """
    assembly = getattr(case.mechanism, "assembly", None)
    a0 = reference(case, parameters)[list(used)]
    guess = _guess(tree, assembly)
    drawn = np.zeros(function.size)
    if guess is None:  # as the file places the joints, where that closes the loops
        F, check, _ = function.equations(a0[:, None], drawn[:, None])
        guess = drawn if np.abs(np.concatenate([F, check])).max() < ACCEPT else None
    starts = guess[None] if guess is not None else _starts(function.size)
    kinds = [FREEDOMS[case.mechanism.joints[f.joint].type][f.component] for f in tree.passive]
    turning = np.array([kind != "translation" for kind in kinds], dtype=bool)
    angles = turning, _balls(case, tree)  # the same after a full turn
    found = _solutions(function, a0, starts, *angles)
    if not len(found):
        others = _solutions(function, a0, _starts(function.size), *angles)
        n = len(DOFS[case.mechanism.space])
        message = _unclosable(tree, function, a0, n)
        if guess is not None and len(others):
            message = "the guess leads to no closed pose: " + _ambiguous(
                case, tree, function.names, a0, others
            )
        raise MechanismError("mechanism.assembly" if assembly else "mechanism.joints", message)
    _check_determined(tree, function, a0, found[0])
    _check_movable(case, function, used, a0, found[0])
    if guess is None and len(found) > 1:
        raise MechanismError("mechanism.joints", _ambiguous(case, tree, function.names, a0, found))
    return a0, found[0]


def reference(case: CaseFile, parameters: ModelParameters) -> Floats:
    """z where the branch is chosen, properties as written."""
    written = (written_loads(case), initial_design(case))
    return parameters.z(np.concatenate([reference_coordinates(case), *written])[None])[:, 0]


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


def _starts(n: int) -> Floats:
    """Evenly spread starting points over a turn, or π metres, each way."""
    return np.pi * (2.0 * kronecker(64, n) - 1.0)


def kronecker(count: int, n: int) -> Floats:
    """Evenly spread points (count, n) of the unit cube: (1/2 + k α) mod 1 (Roberts 2018)."""
    return np.mod(0.5 + np.arange(count)[:, None] * strides(n), 1.0)


def strides(n: int) -> Floats:
    """α_i = g^-i (n,), g > 1 the root of g^(n+1) = g + 1, the golden ratio for n = 1."""
    g = 1.5
    for _ in range(60):  # contracts by at least 2 a step
        g = (1.0 + g) ** (1.0 / (n + 1.0))
    return np.asarray(g ** -np.arange(1.0, n + 1.0))


def _balls(case: CaseFile, tree: Topology) -> list[int]:
    """The first angle of each spherical joint whose three angles are all passive."""
    found = [k for k, f in enumerate(tree.passive) if f.component == 0]
    joints = case.mechanism.joints
    return [
        k
        for k in found
        if joints[tree.passive[k].joint].type == "spherical"
        and sum(f.joint == tree.passive[k].joint for f in tree.passive) == 3
    ]


def _solutions(
    function: ImplicitFunction,
    a0: Floats,
    starts: Floats,
    turning: NDArray[np.bool_],
    balls: Sequence[int] = (),
) -> Floats:
    """Distinct solutions from many starting points, the nearest to the first start first.

    Rx(α) Ry(β) Rz(γ) = Rx(α + π) Ry(π − β) Rz(γ + π): ``balls`` are given with |β| ≤ π/2.
    """
    n = len(starts)
    a = np.repeat(a0[:, None], n, axis=1)
    p = starts.T
    for _ in range(6):
        p, _ = function.newton(a, p)
    F, check, _ = function.equations(a, p)
    good = np.abs(np.concatenate([F, check])).max(axis=0) < ACCEPT
    distinct: list[Floats] = []
    for candidate in p.T[good]:
        turned = np.mod(candidate + np.pi, 2.0 * np.pi) - np.pi
        for k in balls if n > 1 else ():
            if abs(turned[k + 1]) > np.pi / 2:
                turned[k : k + 3] = [
                    turned[k] + np.pi,
                    np.pi - turned[k + 1],
                    turned[k + 2] + np.pi,
                ]
                turned[k : k + 3] = np.mod(turned[k : k + 3] + np.pi, 2.0 * np.pi) - np.pi
        near = np.where(turning & (n > 1), turned, candidate)
        apart = (near - d for d in distinct)  # full turns not counted
        # solutions within 1e-6 rad or m are one: Newton settles at round-off
        if all(np.abs(np.where(turning, 2.0 * np.sin(d / 2.0), d)).max() > 1e-6 for d in apart):
            distinct.append(near)
    return np.array(distinct).reshape(-1, function.size)


def _check_determined(tree: Topology, function: ImplicitFunction, a0: Floats, p0: Floats) -> None:
    J = function.equations(a0[:, None], p0[:, None])[2][0]
    missing = function.size - int(np.linalg.matrix_rank(J, RANK))
    if missing:
        joints = ", ".join(sorted({f.joint for f in tree.passive}))
        n = len(tree.freedoms) - len(tree.passive)
        raise MechanismError(
            "coordinates",
            f"{missing} more coordinate(s) needed: the mechanism has {n + missing} freedom(s) and "
            f"{n} coordinate(s), which do not determine the joints {joints}; or "
            f"{_at(function.names, a0)} is a dead point",
        )


def _check_movable(
    case: CaseFile, function: ImplicitFunction, used: Sequence[int], a0: Floats, p0: Floats
) -> None:
    """Refuse arguments of p that cannot change: ∂F/∂p ṗ = −∂F/∂a has no solution in all rows."""
    J = function.equations(a0[:, None], p0[:, None])[2][0]
    steps = np.repeat(a0[:, None], 2 * len(a0), axis=1)
    steps += CHANGE * np.hstack([np.eye(len(a0)), -np.eye(len(a0))])
    F = function.equations(steps, np.repeat(p0[:, None], steps.shape[1], axis=1))[0]
    slope = (F[:, : len(a0)] - F[:, len(a0) :]) / (2.0 * CHANGE)
    unmet = np.linalg.norm(slope - J @ (np.linalg.pinv(J) @ slope), axis=0)
    moves = [c.moves for c in case.coordinates.values()]
    for k, v in enumerate(used):
        held = v < len(moves) and moves[v] == "locked"  # the only pose it has is then enough
        if unmet[k] > IMMOBILE * np.linalg.norm(slope[:, k]) and not held:
            raise MechanismError(
                "coordinates" if v < len(moves) else "design",
                f"{function.names[k]} cannot change at {_at(function.names, a0)}: the loops pose "
                f"{function.n_equations} conditions, of which the {function.size} passive "
                "freedom(s) can meet none more. It is a structure, or stretched to a dead point: "
                "give a joint another freedom, lock the coordinate, or choose another pose with "
                "mechanism.assembly.at",
            )


def _unclosable(tree: Topology, function: ImplicitFunction, a0: Floats, n: int) -> str:
    """Where the loops do not close, and whether there are too many conditions or too little length.

    Conditions beyond the rank of ∂F/∂p at general places are no passive freedom's to meet.
    """
    message = f"the loops cannot be closed at {_at(function.names, a0)}"
    starts = _starts(function.size).T
    J = function.equations(np.repeat(a0[:, None], starts.shape[1], axis=1), starts)[2]
    beyond = function.n_equations - int(np.linalg.matrix_rank(J, RANK).max())
    if not beyond:
        gap = _spelt(_nearest(function, a0, n))
        return (
            f"{message}: links do not reach, or lie beyond a dead point; the nearest pose found "
            f"leaves {gap}. Correct the lengths and positions, or name coordinates at which the "
            "mechanism can be put together: mechanism.assembly: {at: {coordinate: value}}"
        )
    joints = ", ".join(dict.fromkeys(f.joint for f in tree.passive))
    left = _nearest(function, a0, n)
    # rounded dimensions of a loop with passive joints leave less than 1e-3 m and rad
    if max(left) < 1e-3:
        return (
            f"{message}, but nearly: {_spelt(left)} are left, where {ACCEPT:g} are accepted. They "
            f"pose {function.n_equations} conditions, of which {joints} can meet "
            f"{function.n_equations - beyond}, so that the others must agree in their dimensions: "
            "give positions, lengths and angles with twelve digits, or give joints more freedoms, "
            "such as spherical for universal, or cylindrical for revolute"
        )
    return (
        f"{message}: they pose {function.n_equations} conditions, of which {joints} can meet "
        f"{function.n_equations - beyond}: {beyond} coordinate(s) too many, or joints with too few "
        f"freedoms for dimensions that do not agree. The nearest pose found leaves {_spelt(left)}"
    )


def _nearest(function: ImplicitFunction, a0: Floats, n: int) -> tuple[float, float]:
    """The smallest gap of the loops, m and rad, that Newton's steps find in least squares."""
    starts = _starts(function.size)
    a, p = np.repeat(a0[:, None], len(starts), axis=1), starts.T
    for _ in range(6):
        p, _ = function.newton(a, p)
    F, check, _ = function.equations(a, p)
    missed = np.abs(np.concatenate([F, check])).max(axis=0)
    return _gap(F[:, [int(np.nanargmin(missed))]], n)


def _at(names: Sequence[str], a: Floats) -> str:
    return ", ".join(f"{n} = {v:.6g}" for n, v in zip(names, a, strict=True)) or "its only pose"


def _ambiguous(
    case: CaseFile, tree: Topology, names: Sequence[str], a0: Floats, found: Floats
) -> str:
    """The sentence that lists all branches, each as it is to be given."""
    listed = " | ".join(_as_guess(tree, p) for p in found)
    at = ", ".join(
        f"{name}: {value:.6g}"
        for name, value in zip(case.coordinates, reference_coordinates(case), strict=True)
    )
    return (
        f"the loops close in {len(found)} ways at {_at(names, a0)}: {listed}; choose one with "
        f"mechanism.assembly: {{at: {{{at}}}, guess: {_as_guess(tree, found[0])}}} (rad, m)"
    )


def _as_guess(tree: Topology, p: Floats) -> str:
    """One solution as the guess that leads to it: a list for a joint with several freedoms."""
    values: dict[str, list[str]] = {}
    for freedom, value in zip(tree.passive, p, strict=True):
        values.setdefault(freedom.joint, []).append(f"{value:.4g}")
    several = {j: v[0] if len(v) == 1 else f"[{', '.join(v)}]" for j, v in values.items()}
    return "{" + ", ".join(f"{joint}: {value}" for joint, value in several.items()) + "}"
