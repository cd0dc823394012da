"""What is said about an answer: mesh and links, gravity, the speed of the motion, round-off.

They are measured at some instants (`modal.slow_motion`), together with the stiffness by the loads
−m a of the motion, which stretch and compress links. Where inner dofs have no directions, that
cannot be done.

Where the case states gravity, they contain the forces inside, and what the links sag by is left:
at the poses where it does most to a mode, or to the links, the mechanism is assembled as it is
bent. Where the case does not, both are left, whichever way is down: c (n_axes,) of an axis each,
relative to λ and linear in g, give x = 9.81 m/s² ‖c‖, and of λ (1 ± x) the worse is 1 − √(1 − x)
away in frequency. From x = 1 on the mechanism may buckle, or fall.

`study_accuracy` states the errors of mesh, reduced links and round-off. It needs no exact solves
but those at the few poses where mesh and reduced links are judged.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from eigassign.arrays import Floats
from eigassign.case.case_file import CaseFile
from eigassign.case.units import handy
from eigassign.errors import EigassignError
from eigassign.facts import about
from eigassign.mechanism.assembly.dynamics.velocity_terms import placeless, velocity_terms
from eigassign.mechanism.trajectory.trajectory import rates
from eigassign.modal.arguments import spread
from eigassign.modal.exact.solver import rounding_error
from eigassign.modal.model import Model
from eigassign.modal.slow_motion import motion_effect
from eigassign.modal.under_load import (
    STANDARD_GRAVITY,
    buckling,
    sag_changes,
    sag_of_nodes,
    strut_error,
    weight_changes,
)
from eigassign.study.planning import poses_at
from eigassign.study.results import MeshError, SagRow, WeightRow
from eigassign.study.scene import Scene

MOVED = 0.005  # of a frequency, from which on it is warned of where max_error is larger
INSTANTS, INSTANTS_LARGE = 9, 3
SLOW_INSTANT = 2_000  # degrees of freedom, from which on an instant takes 0.1 s and more
EQUAL = 1e-6  # relative distance below which modes count as this far apart


@dataclass(frozen=True)
class MotionRow:
    """What the motion changes of a mode's frequency, relative, at the sample where it is most."""

    mode: int
    change: float
    where: str

    @property
    def words(self) -> str:
        """The mode, how much and where."""
        return (
            "the neglected velocity terms and forces of the motion change mode "
            f"{self.mode} by about {100 * abs(self.change):.2g} % at {self.where}"
        )


class MotionStudy(NamedTuple):
    """A row a mode, none where inner dofs have no directions, and the words for all."""

    rows: tuple[MotionRow, ...]
    note: str
    warning: str | None


def study_motion(
    scene: Scene, y: Floats, hz: Floats, asked: Collection[int] = ()
) -> MotionStudy | None:
    """Check the case's timed trajectories for the modes of the scene and those ``asked`` for.

    ``hz`` (n_t, n_modes) are exact frequencies of design y (n_y,). None without a timed trajectory.
    """
    if scene.trajectory is None:
        return None
    parts = [part.trajectory for part in scene.trajectory.parts]
    given = np.flatnonzero(~scene.path.inserted)  # what targets ask between samples is no motion
    ends = np.cumsum([len(part.given.time_s) for part in parts])
    samples = np.split(given, ends[:-1])
    timed = [
        (rates(part.given), own) for part, own in zip(parts, samples, strict=True) if len(own) >= 3
    ]
    if not timed:
        return None
    modes, limit = sorted({*scene.modes, *asked}), min(scene.file.validation.max_error, MOVED)
    gap = gap_along(hz, modes)
    if names := placeless(scene.file):
        why = f"the directions of inner dofs of {', '.join(names)} are not known"
        return MotionStudy((), "", f"the effect of the motion's speed is not known, because {why}")
    model, worst = scene.model, dict[int, tuple[float, int]]()
    terms = velocity_terms(model.poses.case, model.poses.parameters, model.motion)
    for motion, own in timed:
        near = gap[own[motion.samples]]
        count = INSTANTS if model.n_dof < SLOW_INSTANT else INSTANTS_LARGE
        found = motion_effect(
            model.pencil, terms, motion, y, tuple(modes), count, model.under_load, near
        )
        for mode, change in zip(modes, found.change.T, strict=True):
            k = int(np.abs(change).argmax())
            one = float(change[k]), int(own[found.samples[k]])
            worst[mode] = max(worst.get(mode, one), one, key=lambda each: abs(each[0]))
    rows = tuple(MotionRow(n, change, scene.path.where(k)) for n, (change, k) in worst.items())
    most = max(rows, key=lambda row: abs(row.change))
    text = f"{most.words}, with the optimal design"
    if abs(most.change) <= limit:
        return MotionStudy(rows, f"speed of the motion: {text}", None)
    warning = (
        f"the motion is not slow: {text}, over {100 * limit:g} %. The frequencies are those of the "
        "mechanism held still at each pose"
    )
    return MotionStudy(rows, "", warning)


def motion_doubt(
    study: MotionStudy | None, asked: Collection[int], accepted: float
) -> Iterator[str]:
    """Say why no number can be vouched for: the motion changes a mode ``asked`` for by too much."""
    rows = () if study is None else study.rows
    own = (row for row in rows if row.mode in asked and abs(row.change) > accepted)
    for worst in sorted(own, key=lambda row: -abs(row.change))[:1]:
        yield f"{worst.words}, and {100 * accepted:.3g} % are accepted"


def gap_along(hz: Floats, wanted: Sequence[int]) -> Floats:
    """g (n_t,), 0 < g ≤ 1: the relative distance of λ of a wanted mode from the next."""
    distance = np.diff(hz**2, axis=1) / hz[:, :-1] ** 2
    beside = [k for k in range(distance.shape[1]) if k + 1 in wanted or k + 2 in wanted]
    return np.asarray(np.maximum(distance[:, beside].min(axis=1, initial=1.0), EQUAL))


GIVEN = "given"  # a pose and design that stand above what is said
WARNED = 0.005  # of a frequency: what a measurement tells, and a mesh of few elements leaves out
SAID = 1e-5  # below which a line has no digits: symmetry makes many of these round-off
# of the buckling load: λ, linear in the load, is then off by some 1 % as the links bend more
NEAR_BUCKLING = 0.2
# Where a mechanism is not assembled as it is bent, θ² times this is what is of second order where
# the links turn by θ: of a cantilever that lies flat 0.39 at θ = 0.21 and 0.22 at 1.1 (elastica)
BENT = 0.4


class WeightStudy(NamedTuple):
    """The numbers, None where gravity is left out on purpose, and the words for them."""

    row: WeightRow | None
    notes: tuple[str, ...]  # of the whole
    warnings: tuple[str, ...] = ()
    of_modes: tuple[str, ...] = ()

    @property
    def lines(self) -> tuple[str, ...]:
        """Every mode's, and those of the whole."""
        return (*self.of_modes, *self.notes)


def study_weight(
    file: CaseFile, model: Model, modes: Sequence[int], q: Floats, y: Floats, design: str
) -> WeightStudy:
    """What gravity changes of ``modes`` at poses q (n, n_q) of one ``design`` y (n_y,)."""
    gravity = file.mechanism.gravity
    if gravity == "none":
        return WeightStudy(None, ("gravity is left out (mechanism.gravity: none)",))
    try:
        row = _row(model, modes, q, y, design, None if gravity is None else np.array(gravity))
    except EigassignError as error:
        return WeightStudy(None, (), (f"the effect of gravity is not known: {error}",))
    where = f", {f'over {len(q)} poses' if len(q) > 1 else 'at one pose'} of the {design} design"
    where = "" if design == GIVEN else where
    each = zip(row.modes, row.change, strict=True)
    of_modes = tuple(f"mode {n}: {_said(row, change, 'it')}{where}" for n, change in each)
    whole = tuple(f"{line}{where}" for line in _of_whole(row))
    if model.n_rigid and gravity is None:
        whole += ("with gravity stated, free coordinates swing or fall, and count as modes",)
    return WeightStudy(row, whole, tuple(_weight_warnings(file, row)), of_modes)


def _row(
    model: Model, modes: Sequence[int], q: Floats, y: Floats, design: str, g: Floats | None
) -> WeightRow:
    found = weight_changes(model, q, y, modes)
    if g is None:
        both = found.stress + found.sag, found.stress_mixing + found.sag_mixing
        x = STANDARD_GRAVITY * sum(np.linalg.norm(each, axis=2) for each in both)
    else:
        x = np.abs(found.sag @ g) + found.sag_mixing @ np.abs(g)
    change = np.where(x < 1.0, 1.0 - np.sqrt(1.0 - np.minimum(x, 1.0)), np.inf)
    if g is None:
        return WeightRow(g, tuple(modes), tuple(change.max(axis=0).tolist()), len(q), design)
    names, moved = sag_of_nodes(model, q, y, g)
    worst = np.linalg.norm(moved[:, :, :3], axis=2).argmax(axis=0)
    turns = np.linalg.norm(moved[:, :, 3:], axis=2).max(axis=1, initial=0.0)
    few = np.unique([turns.argmax(), *change.argmax(axis=0)])
    told = sag_changes(model, q[few], y, modes, g)
    change = change + BENT * turns[:, None] ** 2 if told is None else told
    row = WeightRow(g, tuple(modes), tuple(change.max(axis=0).tolist()), len(q), design)
    far = moved[worst, np.arange(len(names)), : len(g)]
    rows = [SagRow(name, along) for name, along in zip(names, far, strict=True)]
    rows.sort(key=lambda one: -one.most)
    share = float(buckling(model, q, y).max())
    known = share if np.isfinite(share) else None
    struts = strut_error(model, q, y, modes)
    return replace(row, sag=tuple(rows), turn=float(turns.max()), buckling=known, struts=struts)


def weight_doubt(
    file: CaseFile, row: WeightRow | None, asked: Collection[int], accepted: float
) -> Iterator[str]:
    """Say why no number can be vouched for: gravity changes a mode ``asked`` for by too much."""
    asks = bool(asked or file.targets)  # of modes or statics
    row = row if asks else None
    said, change = ("", 0.0) if row is None else _worst(row, asked)
    if change > accepted:
        yield f"{said}, and {100 * accepted:.3g} % are accepted{_advice(file)}"
    if asks and row is None and file.mechanism.gravity != "none":
        yield "the effect of gravity is not known"
    if row is not None and row.struts is not None and row.struts > accepted:
        yield f"{_struts(row.struts)}, and {100 * accepted:.3g} % are accepted"
    if file.design.torque and file.mechanism.gravity is None:
        yield (
            "the drives have limits, and carry a weight that the case does not state"
            f"{_advice(file)}"
        )


def _weight_warnings(file: CaseFile, row: WeightRow) -> Iterator[str]:
    said, change = _worst(row, row.modes)
    if change > WARNED:
        yield f"{said}{_advice(file)}"
    if row.struts is not None and row.struts > WARNED:
        yield _struts(row.struts)
    if row.buckling is not None and row.buckling > NEAR_BUCKLING:
        most = f"above {100 * NEAR_BUCKLING:g} % frequencies that are linear in it are inaccurate"
        yield f"{_share(row.buckling)}: {most}"


def _worst(row: WeightRow, modes: Collection[int]) -> tuple[str, float]:
    """What gravity changes most of these modes, in words and relative."""
    own = [each for each in zip(row.change, row.modes, strict=True) if each[1] in modes]
    change, mode = max(own, key=itemgetter(0), default=(0.0, 0))
    return _said(row, change, f"mode {mode}"), change


def _said(row: WeightRow, change: float, mode: str) -> str:
    """What gravity changes of a mode's frequency, in which it is not."""
    known, most = np.isfinite(change), f"{100 * max(change, SAID):.2g} %"
    least = "less than " if change < SAID else ""
    if row.gravity is not None:
        told = f"{least or 'about '}{most}" if known else "an unknown amount"
        return f"sag, which is not in the frequency, changes {mode} by {told}"
    if not known:
        return f"under gravity, which is not stated, {mode} may buckle or fall"
    return f"gravity, which is not stated, changes {mode} by {least or 'up to '}{most}"


def _share(buckling: float) -> str:
    return f"the weight is {100 * buckling:.3g} % of the buckling load"


def _struts(error: float) -> str:
    return (
        "imported matrices have no stress inside, and are struts under the weight: frequencies may "
        f"be off by about {100 * max(error, SAID):.2g} %"
    )


def _advice(file: CaseFile) -> str:
    """The key to write, where it is not there."""
    if file.mechanism.gravity is not None:
        return ""
    down = "[0, -9.81]" if file.mechanism.space == "planar" else "[0, 0, -9.81]"
    return f": write mechanism.gravity: {down}, or none if the machine lies flat"


def _of_whole(row: WeightRow) -> Iterator[str]:
    """Say of stated gravity what sags most, and how near it is to buckling."""
    if row.sag:
        yield f"{row.sag[0].node} sags by {handy(row.sag[0].most, 'm')} under the weight"
    if row.buckling is not None:
        yield _share(row.buckling)
    if row.struts is not None:
        yield _struts(row.struts)


# Of the shipped cases the worst of 5 poses has 97 % of the error of the worst sample at least, of
# all three lowest modes, and of 3 poses 67 %
MESH_POSES = 5
FEW = 3  # of a model of more than `LARGE` degrees of freedom, and against whole links
LARGE = 10_000


def judged_mesh(scene: Scene, y: Floats, design: str) -> MeshError | None:
    """What the mesh leaves out at poses of the trajectory, or at q0, for one design y (n_y,).

    ``design`` is what it is called. None without beams or solids.
    """
    model, modes = scene.model, scene.modes
    if not model.is_meshed and model.solids is None:
        return None
    q = judged_poses(model, _poses(scene, y))
    worst = q if model.solids is not None else q[model.coarsest(q, y, modes)]
    error = model.discretisation_error(worst, y, modes).max(axis=0)
    return MeshError(modes, tuple(float(e) for e in error), len(q), design)


def _poses(scene: Scene, y: Floats) -> Floats:
    """q (n, n_q) at which design y is judged: of the trajectory, or q0."""
    return scene.q0[None] if scene.trajectory is None else poses_at(scene.trajectory, y)


def judged_poses(model: Model, q: Floats, most: int = MESH_POSES) -> Floats:
    """The poses of q (n, n_q) at which the mesh, or the weight, is judged: at ``most`` so many."""
    return spread(q, most if model.n_dof <= LARGE else FEW)


def worst_poses(model: Model, q: Floats, y: Floats, highest: int) -> Floats:
    """Few poses of q (n, n_q) at which reduced links are judged."""
    if not model.is_reduced or model.whole.is_dense:
        return spread(q, FEW)
    q = spread(q, MESH_POSES)
    return q[[model.frequencies(q, y, highest)[:, -1].argmax()]]


def mesh_lines(found: MeshError | None, model: Model) -> list[str]:
    """`judged_mesh` in words, one line a mode."""
    if found is None:
        return []
    where = f"over {found.poses} poses" if found.poses > 1 else "at one pose"
    where = f"{where} of the {found.design} design"
    return [
        f"mode {mode}: the mesh raises its frequency by {about(error)}, {where}"
        if np.isfinite(error)
        else f"mode {mode}: the mesh is too coarse for an error, {where}: {finer(model)}"
        for mode, error in zip(found.modes, found.error, strict=True)
    ]


def model_errors(
    scene: Scene,
    judged: MeshError | None,
    y: Floats,
    modes: Collection[int],
    held: Model | None = None,
) -> dict[int, float]:
    """By how much mesh and reduced links raise each mode at design y (n_y,), about, relative.

    Of the scene's model, or of that with a node ``held``, whose modes are antiresonances. The
    mesh's part of some modes was ``judged`` before. Infinite where nothing is known.
    """
    if not modes:
        return {}
    wanted, q, model = sorted(modes), poses_at(scene.path, y), held or scene.model
    known = {} if judged is None else dict(zip(judged.modes, judged.error, strict=True))
    if unknown := [mode for mode in wanted if mode not in known]:
        mesh = model.discretisation_error(judged_poses(model, q), y, unknown)
        known |= dict(zip(unknown, mesh.max(axis=0).tolist(), strict=True))
    worst = worst_poses(model, q, y, wanted[-1])
    links = model.truncation_error(worst, y, wanted).max(axis=0)
    return {
        mode: (1.0 + known[mode]) * (1.0 + float(share)) - 1.0
        for mode, share in zip(wanted, links, strict=True)
    }


def raised_by(share: float) -> str:
    """By how much mesh and reduced links raise a frequency, in words."""
    return f"by about {100 * share:.2g} %" if np.isfinite(share) else "by an unknown amount"


def finer(model: Model) -> str:
    """What makes that less."""
    solids = "mesh solids finer, or else " * (model.solids is not None)
    return f"{solids}give the links more elements, raise reduce_to, or write auto for them"


def truncation_lines(scene: Scene, optimum: Floats | None = None) -> Iterator[str]:
    """By how much reduced links raise frequencies at the worst poses, initially and at the optimum.

    Poses are those of the trajectory, or q0.
    """
    model, modes = scene.model, scene.modes
    if not model.is_reduced:
        return
    found = []
    for y in np.unique([scene.initial, *([] if optimum is None else [optimum])], axis=0):
        q = worst_poses(model, _poses(scene, y), y, max(modes))
        found.append(model.truncation_error(q, y, modes))
    error = np.concatenate(found)
    where = f"over {len(error)} poses and designs" if len(error) > 1 else "at one pose"
    for mode, worst in zip(modes, error.max(axis=0), strict=True):
        yield f"mode {mode}: reduced links raise its frequency by {about(worst)}, {where}"


WEIGHT_POSES = 9  # at which the weight is judged; each costs an exact solve
ROUNDED = 3  # at which round-off is measured by nine solves; of a large model one


class Accuracy(NamedTuple):
    """The errors of a run's numbers: of the mesh, and of all in lines of text."""

    mesh: MeshError | None  # None without beams or solids
    weight: WeightStudy
    notes: tuple[str, ...]


def study_accuracy(
    scene: Scene, optimum: Floats | None = None, more: Collection[int] = ()
) -> Accuracy:
    """Errors of mesh, reduced links and round-off, and what gravity changes, per mode.

    Those of mesh and links at the initial design and at the ``optimum`` (n_y,). ``more`` modes than
    are expanded are asked for by targets.
    """
    y, design = (scene.initial, "initial") if optimum is None else (optimum, "optimal")
    first = None if optimum is None else judged_mesh(scene, scene.initial, "initial")
    mesh = judged_mesh(scene, y, design)
    weight = weight_at(scene, y, design, more)
    lines = [line for each in (first, mesh) for line in mesh_lines(each, scene.model)]
    lines += weight.lines
    lines += truncation_lines(scene, optimum)
    return Accuracy(mesh, weight, (*lines, _rounding_note(scene, y)))


def weight_at(scene: Scene, y: Floats, design: str, more: Collection[int] = ()) -> WeightStudy:
    """`study_weight` of the expanded and ``more`` modes at the poses where the mesh is judged."""
    q = judged_poses(scene.model, _poses(scene, y), WEIGHT_POSES)
    return study_weight(scene.file, scene.model, sorted({*scene.modes, *more}), q, y, design)


def _rounding_note(scene: Scene, y: Floats) -> str:
    """`rounding_line` of some poses of design y, and of the first one of the initial design."""
    pencil = scene.model.pencil
    q = spread(_poses(scene, y), ROUNDED if pencil.is_dense else 1)
    x = scene.model.x(q, y)
    if pencil.is_dense:
        x = np.unique(np.vstack([x, scene.model.x(q[:1], scene.initial)]), axis=0)
    lost = max(rounding_error(pencil, each, max(scene.modes)) for each in x)
    line = rounding_line(lost)
    return f"{line}, at {len(x)} poses and designs" if len(x) > 1 and np.isfinite(lost) else line


def rounding_line(lost: float) -> str:
    """The largest relative round-off of the exact frequencies, in words."""
    if not np.isfinite(lost):
        return "round-off of the exact frequencies: not known; they may be only round-off"
    return f"round-off of the exact frequencies: below {lost:.1g}, relative"
