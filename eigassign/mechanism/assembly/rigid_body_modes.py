"""Rigid-body motions that springs leave: combinations of free coordinates that no spring resists.

A spring's rows r(q, y) over the rates of the free coordinates are its ends' relative motion while
nothing deforms. Motions W with r W = 0 at every q and y strain nothing, whatever the stiffnesses.
The columns of eq. (1) are changed to them: in the column of one coordinate of each the others move
along, so that rigid motions are columns again and are projected out exactly.

Under gravity those stay rigid on which the weight works in no pose, such as a turn about the
vertical: there r is the work of the weight per rate, Σ_links Tᵀ J (g, 0).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy import sparse

from eigassign.arrays import Floats, Ints
from eigassign.case.case_file import CaseFile
from eigassign.errors import MechanismError, SingularityError
from eigassign.mechanism.assembly.congruence import LocalLink, inertia
from eigassign.mechanism.assembly.node_motion import MotionRows, SpringEnds
from eigassign.mechanism.assembly.pencil import AffineEntries, Entries, joined
from eigassign.mechanism.kinematics.forward import Kinematics
from eigassign.mechanism.kinematics.joints import DOFS, Objects, multiply, some
from eigassign.mechanism.kinematics.loop_closure import reference
from eigassign.mechanism.kinematics.parameters import ModelParameters
from eigassign.mechanism.kinematics.topology import NodeName
from eigassign.series.compiler import CompiledArrays
from eigassign.series.expression import one_atom

REACH = (0.4, 0.1, 0.02)  # rad or m about the reference, smaller where a loop cannot follow
RESISTED = 1e-9  # relative motion of a spring's ends, scaled to 1, that is not round-off
ROUND_OFF = 1e-12  # of an entry of W, whose largest is about 1, and of m or rad per rad or m


def separated(
    case: CaseFile, parameters: ModelParameters, motion: Kinematics, free: Sequence[int]
) -> Kinematics:
    """The motion with its rigid motions as columns ``rigid``.

    Raises MechanismError where springs leave a motion whose direction changes with the pose, or
    would leave one more where a stiffness that varies is zero.
    """
    rows, springs = _rows(case, parameters, motion, free)

    def moved(W: Floats) -> str:
        """The coordinates that move in W (n_free, n), in words."""
        names = tuple(case.coordinates)
        moving = np.flatnonzero(np.abs(W).max(axis=1) > RESISTED).tolist()
        each = [names[motion.columns[free[k]]] for k in moving]
        return " and ".join([", ".join(each[:-1]), each[-1]] if len(each) > 1 else each)

    units = np.abs(rows).max(axis=(0, 1), initial=0.0)
    units[units == 0.0] = 1.0
    scaled = rows / units  # rad against m
    scaled = scaled / np.maximum(np.abs(scaled).max(axis=(1, 2), keepdims=True), 1e-300)
    always = _null_space(scaled.reshape(-1, len(free)))
    least = min((_null_space(A) for A in scaled.swapaxes(0, 1)), key=lambda W: W.shape[1])
    if least.shape[1] > always.shape[1]:
        paths = tuple(dict.fromkeys(springs))
        raise MechanismError(
            "mechanism." + ".".join(paths[0].split(".")[:2]),
            f"{' and '.join(paths)} hold {moved(least - always @ (always.T @ least))} in one "
            "direction only, which changes with the pose. Give the springs stiffness in the other "
            "directions, lock one of these coordinates, or give it a drive stiffness",
        )
    W, pivots = _echelon(always / units[:, None])
    ranges = case.ranges
    zero = np.array([path in ranges and ranges[path][0] == 0.0 for path in springs], dtype=bool)
    left = _null_space(rows[~zero].reshape(-1, len(free)))
    if zero.any() and left.shape[1] != W.shape[1]:
        raise _unheld(case, np.array(springs)[zero].tolist(), moved(left))
    return _recombined(motion, free, W, pivots)


def _unheld(case: CaseFile, springs: Sequence[str], moved: str) -> MechanismError:
    """Where stiffnesses that vary are least, more moves than elsewhere."""
    paths = dict.fromkeys(springs)
    design = case.design.parameters.items()
    named = {path: name for name, column in design for path in column.factors}
    path = next(iter(paths))
    place = f"design.{named[path]}.min" if path in named else f"mechanism.{path}"
    what = " and ".join(named.get(path, path) for path in paths)
    return MechanismError(
        place,
        f"with {what} = 0 nothing holds {moved}, which adds a rigid-body motion: "
        f"{'take a min' if path in named else 'set a value'} above 0, such as a thousandth of "
        "the largest, or give the coordinate a drive",
    )


def swinging(
    case: CaseFile,
    parameters: ModelParameters,
    motion: Kinematics,
    links: Sequence[LocalLink],
    gravity: Floats,
) -> Kinematics:
    """The motion, of whose rigid motions those are left on which the weight works in no pose.

    ``links`` are those of the placements, with their masses; gravity g (3,) is in m/s².
    """
    if not motion.rigid:
        return motion
    free, kept = list(motion.rigid), list(DOFS[case.mechanism.space])
    parts = []
    for placement, link in zip(motion.placements, links, strict=True):
        pull = np.zeros(6, dtype=object)
        pull[:3] = multiply(placement.world_rotation.T, gravity)
        twist = placement.twist[kept][:, free]
        parts.append(np.concatenate([twist, pull[kept][:, None], inertia(link)], axis=1))
    table = parameters.with_passive(motion.passive).compiled(np.array(parts))
    values = _at_poses(table, case, parameters)
    T, g, J = np.split(values, [len(free), len(free) + 1], axis=-1)
    work = np.einsum("slik,slij,sljo->sk", T, J, g)
    # |work| ≤ |g| √m √(Tᵀ J T) of every link: beside these sums round-off is none
    energy = np.einsum("slik,slij,sljk->slk", T, J, T)
    weight = np.einsum("slio,slij,sljo->slo", g, J, g)
    size = np.sqrt(np.maximum(energy * weight, 0.0)).sum(axis=1).max(axis=0)
    work[:, np.abs(work).max(axis=0) <= RESISTED * size] = 0.0
    size[size == 0.0] = 1.0
    W = _null_space(work / size)  # rad against m
    return _recombined(motion, free, *_echelon(W / size[:, None]))


def apart_from_rigid(
    K_g: Entries,
    M: Entries,
    case: CaseFile,
    parameters: ModelParameters,
    rigid: Sequence[int],
    n_dof: int,
) -> Entries:
    """Pᵀ K_g P with P = I − R M_FF⁻¹ RᵀM, R the columns of rigid motions, the dofs ``rigid`` F.

    On them alone the weight does no work. Yet a motion along a deflected beam, unlike a turn about
    the vertical, may change what elastic displacements cost: K_g couples it to them. Elastic modes
    move it by −C φ_E, C = M_FF⁻¹ M_FE, and feel

        K_EE − K_EF C − Cᵀ K_FE .

    What is but round-off in K_FE is left out.
    """
    rows, columns, atoms, factors = K_g
    if not len(rigid) or not len(rows):
        return K_g
    used, place = np.unique(atoms, return_inverse=True)
    terms = [parameters.recorder.function(a) for a in used.tolist()]
    table = parameters.compiled(np.array(terms, dtype=object))
    moves = np.zeros(n_dof, dtype=bool)
    moves[list(rigid)] = True
    coupled, across = np.zeros_like(moves), moves[rows] & moves[columns]
    for theta in _at_poses(table, case, parameters):
        values = np.where(across, 0.0, factors * theta[place])
        size = abs(sparse.csr_array((values, (rows, columns)), shape=(n_dof, n_dof)))
        # of N against N/m and N m; a rider of this share of the weight is none
        coupled |= moves & (size.max(axis=0).toarray().ravel() > 1e-10 * size.max())
    inner = ~(moves[rows] | moves[columns])
    kept = rows[inner], columns[inner], atoms[inner], factors[inner]
    pulls = ~moves[rows] & coupled[columns]
    if not pulls.any():
        return kept
    K_EF = [each[pulls].tolist() for each in K_g]
    return joined(kept, _drawn_along(K_EF, M, parameters, rigid, np.flatnonzero(coupled), n_dof))


def _drawn_along(
    K_EF: Sequence[Sequence[Any]],
    M: Entries,
    parameters: ModelParameters,
    rigid: Sequence[int],
    coupled: Ints,
    n_dof: int,
) -> Entries:
    """−K_EF C − Cᵀ K_FE, C = M_FF⁻¹ M_FE, of the rigid motions that are ``coupled``."""
    place, among = ({dof: k for k, dof in enumerate(own)} for own in (rigid, coupled.tolist()))
    M_FF = np.zeros((len(place), len(place)), dtype=object)
    M_FE: dict[tuple[int, int], Floats] = {}  # by rigid motion and atom
    for i, j, atom, factor in zip(*(each.tolist() for each in M), strict=True):
        if i in place and j in place:
            value = parameters.recorder.function(atom) * factor
            M_FF[place[i], place[j]] = M_FF[place[i], place[j]] + value
        elif i in place:
            M_FE.setdefault((place[i], atom), np.zeros(n_dof))[j] += factor
    unit = np.eye(len(place))[:, [place[f] for f in among]]
    inverse = parameters.recorder.solve(M_FF.tolist(), unit.tolist())
    pull: dict[int, Objects] = {}  # K_EF row by row
    for i, f, atom, factor in zip(*K_EF, strict=True):
        row = pull.setdefault(i, np.zeros(len(among), dtype=object))
        row[among[f]] = row[among[f]] + parameters.recorder.function(atom) * factor
    out, every = AffineEntries(), np.arange(n_dof)
    for i, row in pull.items():
        shares = [one_atom(share) for share in multiply(np.array(inverse), row[:, None])[:, 0]]
        for (f, atom), v in M_FE.items():
            share = shares[f] * parameters.recorder.function(atom)
            out.add_coupling(share * -1.0, v, every, [(i, 1.0)])
    return out.finish(n_dof)


def _recombined(
    motion: Kinematics, free: Sequence[int], W: Floats, pivots: Sequence[int]
) -> Kinematics:
    """The motion with W (n_free, n_rigid) as its rigid columns, in place of those of the pivots."""
    change = np.eye(len(motion.columns))
    change[np.ix_(free, [free[k] for k in pivots])] = W
    rigid = tuple(sorted(free[k] for k in pivots))
    if np.array_equal(change, np.eye(len(change))):
        return replace(motion, rigid=rigid)
    moved = tuple(replace(p, twist=multiply(p.twist, change)) for p in motion.placements)
    rates = motion.coordinates._replace(rates=motion.coordinates.rates @ change)
    passive = motion.passive_rates
    if passive is not None:
        passive = multiply(passive, change)
    return replace(motion, placements=moved, coordinates=rates, rigid=rigid, passive_rates=passive)


def _rows(
    case: CaseFile, parameters: ModelParameters, motion: Kinematics, free: Sequence[int]
) -> tuple[Floats, tuple[str, ...]]:
    """r (n_rows, n_poses, n_free) over the free columns, zero where it is but round-off; and the
    path of the stiffness of each row.
    """

    def stiff(_: NodeName) -> MotionRows:
        return [{} for _ in range(6)]

    known = parameters.with_passive(motion.passive)
    springs = list(SpringEnds(case, known, motion, stiff, 0).all())
    entries = [[[row.get(k, 0.0) for k in free] for row in pair] for _, *pair in springs]
    table = parameters.compiled(np.array(entries, dtype=object))
    values = np.moveaxis(_at_poses(table, case, parameters), 0, -1)
    ends = values.reshape(-1, 3, *values.shape[1:])  # three axes of v or ω together
    size = np.abs(ends).max(axis=(1, 2, 3, 4), initial=0.0)[:, None, None, None]
    apart = ends[:, :, 1] - ends[:, :, 0]
    noise = np.abs(apart).max(axis=3, keepdims=True) <= np.maximum(RESISTED * size, ROUND_OFF)
    rows = np.where(noise, 0.0, apart).reshape(len(springs), len(free), -1).swapaxes(1, 2)
    held = [some(k) for k, *_ in springs]
    paths = [
        f"springs.{name}.{key}"
        for name in case.mechanism.springs
        for key in 3 * ("translational",) + 3 * ("rotational",)
    ]
    return rows[held], tuple(path for path, holds in zip(paths, held, strict=True) if holds)


def _at_poses(table: CompiledArrays, case: CaseFile, parameters: ModelParameters) -> Floats:
    """Values (n_poses, …) at random within a rad or m and half of each range, else twice there."""
    z, n, rng = reference(case, parameters), len(parameters.coordinates), np.random.default_rng(0)
    half = [0.5 * (high - low) for low, high in case.box]
    span = np.append(np.ones(n), parameters.to_z[n:, n:] @ half)
    # six poses tell what a direction that changes with the pose resists
    directions = rng.uniform(-1.0, 1.0, (len(z), 6)) * span[:, None]
    for reach in REACH:
        try:
            return table(z[:, None] + reach * directions)[0]
        except SingularityError:
            continue
    return np.repeat(table(z[:, None])[0], 2, axis=0)


def _null_space(A: Floats) -> Floats:
    _, s, V = np.linalg.svd(A)
    return np.asarray(V[int((s > RESISTED).sum()) :].T)


def _echelon(W: Floats) -> tuple[Floats, list[int]]:
    """The space with the identity on pivot rows; round-off beside whole numbers removed."""
    W = W / np.abs(W).max(axis=0, initial=0.0)
    pivots = []
    for column in range(W.shape[1]):
        size = np.abs(W[:, column])
        pivots.append(int(np.flatnonzero(size > 0.5 * size.max())[0]))
        W[:, column] /= W[pivots[-1], column]
        others = np.arange(W.shape[1]) != column
        W[:, others] -= np.outer(W[:, column], W[pivots[-1], others])
    whole = np.round(W)
    return np.where(np.abs(W - whole) < ROUND_OFF, whole, W), pivots
