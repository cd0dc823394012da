"""Rows of facts as JSON, and results.json: what it holds, as rows of which each says what it is.

To add a fact to a file, give one of its rows a field: the file, its JSON Schema and its page in the
manual have it then. The same results give the same bytes; numbers are written as ``repr`` writes
them, so that they read back to the last bit.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from typing import Annotated, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import EigassignError
from eigassign.facts import OF_ROW, Curve, Fact, Seconds, Share, written
from eigassign.files import plain
from eigassign.study.results import (
    AssignmentRow,
    DesignRow,
    DriveRow,
    ErrorSummary,
    FollowedRow,
    MassRow,
    MeshError,
    ModeAnatomy,
    ModeStudy,
    OtherModes,
    RangeRow,
    RelaxedRow,
    RunResults,
    SensitivityRow,
    SolverRow,
    StaticRow,
    TargetStudy,
    ToleranceRows,
    ViolationRow,
    WeightRow,
)
from eigassign.study.updating.fit import UpdateResults

T = TypeVar("T")
Floats = NDArray[np.float64]
SCHEMA = 2  # of results.json: raised when a field goes or means something else
_NESTED = (Mapping, list, tuple, str, np.ndarray)

# --- What results.json holds

OfSamples = Annotated[Sequence[str] | None, Fact("of each sample, of several", optional=True)]


@dataclass(frozen=True)
class CaseDocument:
    """The case that the numbers are of."""

    name: Annotated[str, Fact("of the case file, without its ending")]
    title: str
    author: str | None
    reference: Annotated[str | None, Fact("source of the case")]
    sha256: Annotated[str, Fact("of the case file")]
    files: Annotated[Mapping[str, str], Fact("SHA-256 of each file that it names")]


@dataclass(frozen=True)
class OriginDocument:
    """The beginning of results.json."""

    schema: Annotated[int, Fact("raised when a field goes or means something else")]
    eigassign_version: str
    case: CaseDocument


@dataclass(frozen=True)
class CurvesDocument:
    """A target over its samples."""

    time_s: Annotated[Floats, Fact("from the start of its trajectory", unit="s")]
    trajectory: OfSamples
    target_hz: Annotated[Curve, Fact("wanted, or the limit, of a band the lower edge")]
    initial_hz: Annotated[Curve, Fact("exact, at the initial design")]
    one_shot_hz: Annotated[Curve | None, Fact("exact, at the paper's design")]
    predicted_hz: Annotated[Curve | None, Fact("by the last program", may_lack=True)]
    exact_hz: Annotated[Curve, Fact("exact, at the answer")]


@dataclass(frozen=True)
class LimitDocument(CurvesDocument):
    """A limit or band over its samples."""

    lower_hz: Annotated[Curve | None, Fact("lower edge")]
    upper_hz: Annotated[Curve | None, Fact("upper edge")]


@dataclass(frozen=True)
class ModeDocument:
    """Exact frequencies of a mode before and after."""

    mode: int
    initial_hz: Curve
    optimal_hz: Curve


@dataclass(frozen=True)
class TargetDocument:
    """A target, and what became of it."""

    kind: Annotated[str, Fact("the key of the case file: frequency, at_least, keep_out, …")]
    label: Annotated[str, Fact("what is asked, in words")]
    mode: Annotated[int | None, Fact("the lowest of its modes; null of one followed by its shape")]
    modes: tuple[int, ...]
    followed: Annotated[FollowedRow | None, Fact("by its shape", optional=True)]
    satisfied: bool
    worst: Annotated[Share, Fact("the largest error or violation of the answer")]
    trajectory: Annotated[str | None, Fact("the only one on which it holds", optional=True)]
    error: ErrorSummary
    frequencies: CurvesDocument | LimitDocument
    near: Annotated[Sequence[ModeDocument] | None, Fact("modes about a band", optional=True)]


@dataclass(frozen=True)
class SensitivityDocument:
    """Changes of the targets with one parameter."""

    unit: str
    targets: Sequence[SensitivityRow]


@dataclass(frozen=True)
class StudyDocument:
    """The accuracy of the expansion of one mode, at (q0, y0), against exact frequencies."""

    mode: int
    order: int
    q0: Floats
    y0: Floats
    max_relative: Annotated[
        Mapping[str, Mapping[str, Share] | None],
        Fact(
            "over_time, over_q, over_design, and with a margin everywhere; of each taylor and "
            "linearised",
            may_lack=True,
        ),
    ]


@dataclass(frozen=True)
class CoordinateDocument:
    """A coordinate at all samples."""

    unit: str
    values: Annotated[Floats, Fact(unit=OF_ROW)]


@dataclass(frozen=True)
class MotionDocument:
    """The samples, of several trajectories one after the other."""

    time_s: Annotated[Floats, Fact("from the start of its trajectory", unit="s")]
    trajectory: OfSamples
    coordinates: Mapping[str, CoordinateDocument]


@dataclass(frozen=True)
class TrajectoryDocument:
    """One trajectory."""

    name: str
    samples: int
    duration_s: Seconds
    weight: float
    set: Annotated[Mapping[str, float] | None, Fact("properties that it sets, SI", optional=True)]
    error: ErrorSummary | None


@dataclass(frozen=True)
class RunDocument(OriginDocument):
    """A run; what it did not ask for is null or empty."""

    design: Annotated[Mapping[str, DesignRow], Fact("by parameter, in the order of the case")]
    mass: MassRow | None
    drives: Annotated[Mapping[str, DriveRow], Fact("what each exerts, by coordinate")]
    statics: Annotated[Mapping[str, StaticRow], Fact("of static targets, by what they ask")]
    price: Annotated[float | None, Fact("of the change of the design")]
    error: Annotated[ErrorSummary | None, Fact("of all wanted frequencies, else of all limits")]
    violation: Annotated[ViolationRow | None, Fact("the largest of any limit, and which has it")]
    frequencies: Annotated[CurvesDocument | LimitDocument | None, Fact("of the first target")]
    targets: Annotated[Sequence[TargetDocument], Fact("in the order of the case")]
    assignment: Annotated[AssignmentRow | None, Fact("the verdict, and how the answer was found")]
    sensitivity: Annotated[Mapping[str, SensitivityDocument], Fact("by parameter")]
    relaxed: Annotated[Sequence[RelaxedRow], Fact("what more room at limits gains")]
    anatomies: Annotated[Sequence[ModeAnatomy], Fact("modes that are missed: what they are")]
    reach: Annotated[Sequence[RangeRow], Fact("over all designs within the bounds")]
    unreachable: Annotated[Sequence[str], Fact("what is out of reach, in words")]
    tolerance: Annotated[ToleranceRows | None, Fact("what deviations do to the targets")]
    other_modes: Annotated[Sequence[ModeDocument], Fact("some modes without a target")]
    discretisation: Annotated[MeshError | None, Fact("how much too high the mesh is")]
    weight: Annotated[WeightRow | None, Fact("what gravity changes that is not computed")]
    approximation: Annotated[Sequence[StudyDocument], Fact("of the expansion, mode by mode")]
    trajectory: Annotated[MotionDocument, Fact("all samples")]
    trajectories: Annotated[Sequence[TrajectoryDocument], Fact("in the order of the case")]
    solver: Annotated[SolverRow | None, Fact("the certificate of the one shot's program")]
    warnings: Sequence[str]
    notes: Annotated[Sequence[str], Fact("what was chosen and why")]
    timing_s: Annotated[Mapping[str, float], Fact("by stage", unit="s")]


# --- What a run puts there


def filled(document: type[T], *sources: object, **own: Any) -> T:
    """A document whose facts are its ``own``, or else those of that name in the first source."""
    names = [field.name for field in fields(document)]  # type: ignore[arg-type]
    found = {k: getattr(s, k) for s in reversed(sources) for k in names if hasattr(s, k)}
    return document(**found | own)


def run_document(results: RunResults) -> RunDocument:
    """``frequencies`` is of the first target, ``error`` of all."""
    targets = [_target(results, target) for target in results.targets]
    meaning, slopes = results.meaning, results.meaning.sensitivity
    coordinates = zip(results.q_names, results.q_units, results.q.T, strict=True)
    motion = {name: CoordinateDocument(unit, values) for name, unit, values in coordinates}
    return filled(
        RunDocument,
        beginning(results),
        results,
        design={row.name: row for row in results.design},
        drives={row.name: row for row in results.drives},
        statics={row.name: row for row in results.statics},
        frequencies=targets[0].frequencies if targets else None,
        targets=targets,
        sensitivity={
            name: SensitivityDocument(unit, [row for row in slopes if row.parameter == name])
            for name, unit in dict.fromkeys((row.parameter, row.unit) for row in slopes)
        },
        relaxed=meaning.relaxed,
        reach=meaning.reach,
        unreachable=meaning.unreachable,
        anatomies=meaning.anatomies,
        tolerance=meaning.tolerance,
        other_modes=_modes(results.others),
        approximation=[
            filled(StudyDocument, study, max_relative=_worst(study)) for study in results.studies
        ],
        trajectory=MotionDocument(results.time_s, _named(results, slice(None)), motion),
        trajectories=[
            filled(
                TrajectoryDocument,
                row,
                samples=row.rows.stop - row.rows.start,
                set=row.loads or None,
                error=results.error_along(row.name),
            )
            for row in results.trajectories
        ],
    )


def beginning(results: RunResults | UpdateResults) -> OriginDocument:
    """The version and the case, by its hash, that the numbers are of."""
    name, title, author = results.case_name, results.title, results.author
    origin = results.reference, results.case_sha256, results.case_files
    case = CaseDocument(name, title, author, *origin)
    return OriginDocument(SCHEMA, results.version, case)


def _target(results: RunResults, target: TargetStudy) -> TargetDocument:
    asked = target.asked
    edges = {
        f"{side}_hz": hz if np.isfinite(hz).all() else None
        for side, hz in (("lower", asked.lower), ("upper", asked.upper))
        if not asked.is_goal
    }
    curves = filled(
        LimitDocument if edges else CurvesDocument,
        target,
        time_s=results.time_s[asked.rows],
        trajectory=_named(results, asked.rows),
        **edges,
    )
    return filled(
        TargetDocument,
        target,
        asked,
        mode=None if target.followed else asked.mode,
        followed=next(iter(target.followed), None),
        worst=target.error.exact.max_relative,
        frequencies=curves,
        near=None if target.near is None else _modes(target.near),
    )


def _named(results: RunResults, rows: slice) -> Sequence[str] | None:
    return trajectory_names(results, rows) if len(results.trajectories) > 1 else None


def trajectory_names(results: RunResults, rows: slice = slice(None)) -> list[str]:
    """The name of each sample's trajectory."""
    names = [row.name for row in results.trajectories for _ in range(row.rows.start, row.rows.stop)]
    return names[rows]


def _modes(others: OtherModes | None) -> Sequence[ModeDocument]:
    if others is None:
        return []
    columns = zip(others.modes, others.initial_hz.T, others.optimal_hz.T, strict=True)
    return [ModeDocument(*column) for column in columns]


def _worst(study: ModeStudy) -> dict[str, Mapping[str, float] | None]:
    """The largest errors of both expansions by where they were looked for."""
    maps = (("over_q", study.over_q), ("over_design", study.over_design))
    places = {"over_time": study.over_time, **{k: m.values if m else None for k, m in maps}}
    return {
        k: {"taylor": at.worst_taylor, "linearised": at.worst_linearised} if at else None
        for k, at in places.items()
    } | {"everywhere": study.stated}


# --- As JSON


def results_document(results: RunResults) -> dict[str, Any]:
    """The content of results.json as plain values, arrays as they are."""
    return dict(document(run_document(results)))


def document(value: Any, may_lack: bool = False) -> Any:
    """A row and all below it by the names of its facts; null for what these say may lack."""
    if is_dataclass(value):
        kind: Any = type(value)
        return {
            one.name or name: document(inner, may_lack or one.may_lack)
            for name, one in written(kind).items()
            for inner in [getattr(value, name)]
            if not (one.optional and inner is None)
        }
    if isinstance(value, Mapping):
        return {key: document(inner, may_lack) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return type(value)(document(inner, may_lack) for inner in value)
    return plain(value) if may_lack else value


def to_json(results: RunResults) -> bytes:
    """results.json as UTF-8 with a newline at its end.

    Raises EigassignError, naming the field, for a number that is not finite.
    """
    return (dumps(results_document(results)) + "\n").encode()


def dumps(value: Any) -> str:
    """JSON, two spaces a level, a list of numbers on one line; NaN and infinity are refused."""
    return _text(value, "", "")


def _text(value: Any, indent: str, path: str) -> str:
    inner = indent + "  "
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, Mapping):
        pairs = (f"{_leaf(k, path)}: {_text(v, inner, f'{path}.{k}')}" for k, v in value.items())
        return _block("{}", list(pairs), indent)
    if isinstance(value, (list, tuple)) and any(isinstance(v, _NESTED) for v in value):
        items = [_text(v, inner, f"{path}[{i}]") for i, v in enumerate(value)]
        return _block("[]", items, indent)
    return _leaf(value, path)


def _block(brackets: str, items: list[str], indent: str) -> str:
    if not items:
        return brackets
    inside = ",\n".join(f"{indent}  {item}" for item in items)
    return f"{brackets[0]}\n{inside}\n{indent}{brackets[1]}"


def _leaf(value: Any, path: str) -> str:
    try:
        return json.dumps(value, allow_nan=False, ensure_ascii=False)
    except ValueError as error:
        where = path.lstrip(".")
        raise EigassignError(f"results.json: {where} holds a number that is not finite") from error
