"""Closed loops: passive freedoms as implicit functions of the coordinates, and their rates.

For every loop the two ways round must meet: three equations for the position and three for the
orientation (planar: two and one). With passive freedoms p they define p(q, y) on the branch chosen;
differentiated, J_p ṗ = −J_q q̇ gives the motion of the rigid links.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from eigassign.case import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.branches import choose_branch
from eigassign.mechanism.coordinates import Coordinates
from eigassign.mechanism.kinematics import Kinematics, walk
from eigassign.mechanism.parameters import Parameters
from eigassign.mechanism.rotations import Objects, multiply
from eigassign.mechanism.tree import Tree
from eigassign.series.expression import Expression, Recorder, Scalar, derivative
from eigassign.series.implicit import ImplicitFunction
from eigassign.series.program import Program, compile_program


def close_loops(
    case: CaseFile, parameters: Parameters, tree: Tree, coords: Coordinates
) -> Kinematics:
    """ERLS motion of a mechanism with loops.

    Raises MechanismError when a loop cannot be closed, the branch is ambiguous, or the mechanism
    has more freedoms than coordinates.
    """
    planar = case.mechanism.space == "planar"
    bound = _bind_passive(case, parameters, tree, coords, planar)
    values = [bound.freedom(k) for k in range(len(tree.freedoms))]
    unit = np.eye(len(tree.freedoms), dtype=object)[:, len(coords.relative) :]
    rates = np.concatenate([coords.rates.astype(object), unit], axis=1)
    free = replace(walk(case, bound, tree, coords, values, rates), passive=bound.passive)
    n = len(coords.columns)
    if not n:
        return _narrowed(free, np.zeros((0, 0), dtype=object))
    P = _passive_rates(bound.recorder, free, n, planar)
    return _narrowed(free, P)


def _bind_passive(
    case: CaseFile, parameters: Parameters, tree: Tree, coords: Coordinates, planar: bool
) -> Parameters:
    """The parameters with each passive freedom as a component of the implicit function."""
    if not tree.passive:
        _check_rigid_loops(case, parameters, tree, coords, planar)
        return parameters
    recorder = Recorder()
    n_q, n_y, n_p = len(coords.relative), len(parameters.design), len(tree.passive)
    trial = parameters.rerecorded(recorder, n_p)
    F, check = _equations(case, trial, tree, coords, planar)
    J = [[derivative(f, n_q + n_y + k) for k in range(n_p)] for f in F]
    used = _used_variables(recorder, [*F, *check], n_q + n_y, n_p)
    scalars = [*F, *check, *(entry for row in J for entry in row)]
    program = _reordered(recorder, scalars, used, n_q + n_y, n_p)
    names = (*_joint_names(case, coords), *parameters.design)
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


def _joint_names(case: CaseFile, coords: Coordinates) -> list[str]:
    """What the joint coordinates s are called: q's names, but where q counts absolute angles."""
    plain = (coords.relative == np.eye(len(coords.relative))).all(axis=1) & (coords.offset == 0.0)
    return [
        name if same else f"{name} relative to the base of {c.joint!r}"
        for same, (name, c) in zip(plain, case.coordinates.items(), strict=True)
    ]


def _equations(
    case: CaseFile, parameters: Parameters, tree: Tree, coords: Coordinates, planar: bool
) -> tuple[list[Scalar], list[Scalar]]:
    """Closure rows F and check rows of all loops, on passive freedoms as plain variables."""
    values = [parameters.freedom(k) for k in range(len(tree.freedoms))]
    still = np.zeros((len(tree.freedoms), 0), dtype=object)
    motion = walk(case, parameters, tree, coords, values, still)
    return closure_rows(motion, planar)


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
    case: CaseFile, parameters: Parameters, tree: Tree, coords: Coordinates, planar: bool
) -> None:
    """Loops without passive freedoms must close as they are drawn."""
    F, check = _equations(case, parameters, tree, coords, planar)
    for k, value in enumerate([*F, *check]):
        if isinstance(value, Expression) or abs(value) > 1e-9:
            loop = tree.loops[min(k // (3 if planar else 6), len(tree.loops) - 1)]
            raise MechanismError(
                f"mechanism.joints.{loop.joint}", "closes a loop whose two sides do not meet"
            )


def _used_variables(recorder: Recorder, scalars: Sequence[Scalar], n: int, n_p: int) -> list[int]:
    """Which of the first n variables the closure depends on; n_p passive ones follow them."""
    atoms = sorted({a for s in scalars if isinstance(s, Expression) for a in s.terms})
    depends = compile_program(recorder, atoms, n + n_p).dependence
    return [v for v in range(n) if depends[:, v].any()]


def _reordered(
    recorder: Recorder, scalars: Sequence[Scalar], used: list[int], n: int, n_p: int
) -> Program:
    """Compile over (used variables, passive freedoms) numbered from 0."""
    program = compile_program(recorder, [recorder.atom(s) for s in scalars], n + n_p)
    order = {v: k for k, v in enumerate([*used, *range(n, n + n_p)])}
    renamed = np.array([order[int(v)] for v in program.input_variables], dtype=np.intp)
    return replace(program, input_variables=renamed, n_variables=len(order))


def _passive_rates(recorder: Recorder, motion: Kinematics, n: int, planar: bool) -> Objects:
    """P (n_passive, n) of ṗ = P q̇ from the loops' twist gaps; least squares where redundant."""
    keep = [0, 1, 5] if planar else list(range(6))
    gaps = np.concatenate([loop.twist_gap[keep] for loop in motion.loops])
    J_q, J_p = gaps[:, :n], gaps[:, n:]
    return passive_motion(recorder, J_p, J_q)


def passive_motion(recorder: Recorder, J: Objects, right: Objects) -> Objects:
    """X of J X + ``right`` = 0, by normal equations where rows are redundant."""
    if not J.shape[1] or not right.shape[1]:
        return np.zeros((J.shape[1], right.shape[1]), dtype=object)
    A, B = J, right * -1.0
    if len(J) != J.shape[1]:
        A, B = multiply(J.T, J), multiply(J.T, B)
    solved = recorder.solve(A.tolist(), B.tolist())
    return np.array(solved, dtype=object).reshape(B.shape)


def _narrowed(motion: Kinematics, P: Objects) -> Kinematics:
    """Twists over q̇ alone: T = T_q + T_p P."""
    n = P.shape[1]
    placements = tuple(replace(p, twist=_combined(p.twist, P, n)) for p in motion.placements)
    return replace(motion, placements=placements)


def _combined(twist: Objects, P: Objects, n: int) -> Objects:
    if not n or not len(P):
        return twist[:, :n]
    return np.asarray(twist[:, :n] + multiply(twist[:, n:], P))
