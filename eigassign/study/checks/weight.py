"""What gravity changes that the frequencies do not contain, beside the errors of mesh and links.

Where the case states gravity, they contain the forces inside, and what the links sag by is left:
at the poses where it does most to a mode, or to the links, the mechanism is assembled as it is
bent. Where the case does not, both are left, whichever way is down: c (n_axes,) of an axis each,
relative to λ and linear in g, give x = 9.81 m/s² ‖c‖, and of λ (1 ± x) the worse is 1 − √(1 − x)
away in frequency. From x = 1 on the mechanism may buckle, or fall.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.errors import EigassignError
from eigassign.modal.model import Model
from eigassign.modal.under_load import (
    STANDARD_GRAVITY,
    buckling,
    sag_changes,
    sag_of_nodes,
    strut_error,
    weight_changes,
)
from eigassign.study.results import SagRow, WeightRow

Floats = NDArray[np.float64]
GIVEN = "given"  # a pose and design that stand above what is said
WARNED = 0.005  # of a frequency: what a measurement tells, and a mesh of few elements leaves out
SAID = 1e-5  # below which a line has no digits: symmetry makes many of these round-off
# of the buckling load: λ, linear in the load, is then off by some 1 % as the links bend more
NEAR_BUCKLING = 0.2
# Where a mechanism is not assembled as it is bent, θ² times this is what is of second order where
# the links turn by θ: of a cantilever that lies flat 0.39 at θ = 0.21 and 0.22 at 1.1 (elastica)
BENT = 0.4


@dataclass(frozen=True)
class WeightStudy:
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
    return WeightStudy(row, whole, tuple(_warnings(file, row)), of_modes)


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
    """Say why no number can be vouched for: gravity changes a mode ``asked`` for by too much.

    Where none is, nothing that is asked rests on a frequency or on how far links bend.
    """
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


def _warnings(file: CaseFile, row: WeightRow) -> Iterator[str]:
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
        yield f"{row.sag[0].node} sags by {row.sag[0].most:.3g} m under the weight"
    if row.buckling is not None:
        yield _share(row.buckling)
    if row.struts is not None:
        yield _struts(row.struts)
