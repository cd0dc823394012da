"""What a run found as numbers for programs: results.json, and every sample of it as CSV.

The same results give the same bytes. trajectory.csv is what `trajectory: {file: …}` reads.

Numbers are written as ``repr`` writes them, so that they read back to the last bit; a number that
an expansion could not give is left empty.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from itertools import count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import EigassignError
from eigassign.files import plain
from eigassign.mechanism.trajectory.csv import TIME, TIP_COLUMNS
from eigassign.study.results import (
    Comparison,
    ErrorSummary,
    ModeStudy,
    OtherModes,
    RunResults,
    TargetStudy,
    TrajectoryRow,
)
from eigassign.study.updating.fit import UpdateResults

# --- results.json

SCHEMA = 1  # of results.json: raised when a field goes or means something else
_NESTED = (Mapping, list, tuple, str, np.ndarray)


def results_document(results: RunResults) -> dict[str, Any]:
    """Plain values in a fixed order. ``frequencies`` is of the first target, ``error`` of all.

    Of several trajectories all samples stand one after the other, each with its ``trajectory``.
    What the run did not ask for (no target, no trajectory) is null, and so is what an expansion
    cannot say: it predicts no frequency where its eigenvalue comes out negative.
    """
    first = results.targets[0] if results.targets else None
    row, mesh = results.assignment, results.discretisation
    return {
        **origin(results),
        "design": {row.name: without(row, "name") for row in results.design},
        "mass": asdict(results.mass) if results.mass else None,
        "price": results.price,
        "error": _error(results.error) if results.error else None,
        "frequencies": _frequencies(results, first) if first else None,
        "targets": [_target(results, target) for target in results.targets],
        "assignment": {**asdict(row), "finished": row.finished} if row else None,
        **_meaning(results),
        "other_modes": _other_modes(results.others),
        "discretisation": plain(mesh) if mesh else None,
        "approximation": [_study(study) for study in results.studies],
        "trajectory": {
            "time_s": results.time_s,
            **_named(results, slice(None)),
            "coordinates": {
                name: {"unit": unit, "values": results.q[:, i]}
                for i, (name, unit) in enumerate(zip(results.q_names, results.q_units, strict=True))
            },
        },
        "trajectories": [_trajectory(results, row) for row in results.trajectories],
        "solver": asdict(results.solver) if results.solver else None,
        "warnings": results.warnings,
        "notes": results.notes,
        "timing_s": dict(results.timing_s),
    }


def origin(results: RunResults | UpdateResults) -> dict[str, Any]:
    """The version and the case, by its hash, that the numbers are of."""
    return {
        "schema": SCHEMA,
        "eigassign_version": results.version,
        "case": {
            "name": results.case_name,
            "title": results.title,
            "reference": results.reference,
            "sha256": results.case_sha256,
            "files": dict(results.case_files),
        },
    }


def _error(summary: ErrorSummary) -> dict[str, Any]:
    found: dict[str, Any] = {
        name: None if row is None else asdict(row)
        for name in ("initial", "one_shot", "predicted", "exact")
        for row in [getattr(summary, name)]
    }
    if found["predicted"] is not None:
        found["predicted"] = plain(found["predicted"])
    return found


def without(row: Any, *names: str) -> dict[str, Any]:
    """The fields of a row but those of these ``names``."""
    return {name: value for name, value in asdict(row).items() if name not in names}


def _frequencies(results: RunResults, target: TargetStudy) -> dict[str, Any]:
    """Curves of a target; a limit or band has its edges too, null where there is none."""
    asked = target.asked
    edges = {} if asked.is_goal else {"lower_hz": asked.lower, "upper_hz": asked.upper}
    return {
        "time_s": results.time_s[asked.rows],
        **_named(results, asked.rows),
        "target_hz": target.target_hz,
        **{name: hz if np.isfinite(hz).all() else None for name, hz in edges.items()},
        "initial_hz": target.initial_hz,
        "one_shot_hz": target.one_shot_hz,
        "predicted_hz": plain(target.predicted_hz),
        "exact_hz": target.exact_hz,
    }


def _named(results: RunResults, rows: slice) -> dict[str, Any]:
    """The name of the trajectory that each sample belongs to, where there are several."""
    if len(results.trajectories) < 2:
        return {}
    return {"trajectory": trajectory_names(results, rows)}


def _trajectory(results: RunResults, row: TrajectoryRow) -> dict[str, Any]:
    error = results.error_along(row.name)
    return {
        "name": row.name,
        "samples": row.rows.stop - row.rows.start,
        "duration_s": row.duration_s,
        "weight": row.weight,
        **({"set": dict(row.loads)} if row.loads else {}),
        "error": _error(error) if error else None,
    }


def _target(results: RunResults, target: TargetStudy) -> dict[str, Any]:
    asked, followed = target.asked, dict[str, Any]()
    if (row := target.followed) is not None:  # by its shape, and which mode it is at each sample
        numbers = {"initial_modes": row.initial_numbers, "exact_modes": row.exact_numbers}
        followed = {"followed": {"name": row.name, "like": row.like, **numbers}}
    return {
        "kind": asked.kind,
        "label": asked.label,
        "mode": None if followed else asked.mode,
        "modes": asked.modes,
        **followed,
        "satisfied": target.satisfied,
        "worst": target.error.exact.max_relative,
        **({"trajectory": asked.trajectory} if asked.trajectory is not None else {}),
        "error": _error(target.error),
        "frequencies": _frequencies(results, target),
        **({} if target.near is None else {"near": _other_modes(target.near)}),
    }


def _meaning(results: RunResults) -> dict[str, Any]:
    """The meaning of the answer; what was not studied is empty or null."""
    found = results.meaning
    sensitivity: dict[str, Any] = {}
    for row in found.sensitivity:
        own = sensitivity.setdefault(row.parameter, {"unit": row.unit, "targets": []})
        own["targets"].append(without(row, "parameter", "unit"))
    tolerance = found.tolerance
    return {
        "sensitivity": sensitivity,
        "relaxed": [asdict(row) for row in found.relaxed],
        "reach": [asdict(row) for row in found.reach],
        "unreachable": found.unreachable,
        "tolerance": None if tolerance is None else asdict(tolerance),
        "trade_off": None if found.trade_off is None else asdict(found.trade_off),
    }


def _other_modes(others: OtherModes | None) -> list[dict[str, Any]]:
    if others is None:
        return []
    columns = zip(others.modes, others.initial_hz.T, others.optimal_hz.T, strict=True)
    return [{"mode": m, "initial_hz": before, "optimal_hz": after} for m, before, after in columns]


def _study(study: ModeStudy) -> dict[str, Any]:
    over_q = study.over_q.values if study.over_q else None
    over_design = study.over_design.values if study.over_design else None
    return {
        "mode": study.mode,
        "order": study.order,
        "q0": study.q0,
        "y0": study.y0,
        "max_relative": {
            "over_time": _worst(study.over_time),
            "over_q": _worst(over_q),
            "over_design": _worst(over_design),
        },
    }


def _worst(comparison: Comparison | None) -> dict[str, float | None] | None:
    if comparison is None:
        return None
    worst = {"taylor": comparison.worst_taylor, "linearised": comparison.worst_linearised}
    return dict(plain(worst))


def to_json(results: RunResults) -> bytes:
    """results.json as UTF-8 with a newline at its end; numbers as ``repr`` writes them.

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


# --- trajectory.csv and frequencies.csv

Floats = NDArray[np.float64]
Column = tuple[str, Sequence[object]]  # heading, one entry a sample


def sample_files(results: RunResults) -> dict[str, bytes]:
    """The CSV files of a run by name; none without a trajectory."""
    if not results.trajectories:
        return {}
    several = len(results.trajectories) > 1
    files = {
        f"trajectory_{row.name}.csv" if several else "trajectory.csv": trajectory_csv(results, row)
        for row in results.trajectories
    }
    return {**files, "frequencies.csv": _number_text(frequency_columns(results))}


def trajectory_csv(results: RunResults, row: TrajectoryRow) -> bytes:
    """Time, coordinates and, where the case gives its path, the tip of one trajectory; SI."""
    columns = [*_motion(results, row.rows)]
    if row.tip is not None:
        names = TIP_COLUMNS[: row.tip.shape[1]]
        places = zip(names, row.tip.T, strict=True)
        columns += [(f"{name} [m]", place.tolist()) for name, place in places]
    return _number_text(columns)


def frequency_columns(results: RunResults) -> list[Column]:
    """Every sample with its frequencies in Hz: of targets, or without any of the expanded modes.

    Of several trajectories one below the other, the first column naming them.
    """
    everything = slice(0, results.time_s.size)
    columns: list[Column] = []
    if len(results.trajectories) > 1:
        columns.append(("trajectory", trajectory_names(results)))
    columns += _motion(results, everything)
    return [*columns, *(_assigned(results) if results.targets else _expanded(results))]


def trajectory_names(results: RunResults, rows: slice = slice(None)) -> list[str]:
    """The name of each sample's trajectory."""
    names = [row.name for row in results.trajectories for _ in range(row.rows.start, row.rows.stop)]
    return names[rows]


def _motion(results: RunResults, rows: slice) -> Iterator[Column]:
    yield f"{TIME} [s]", results.time_s[rows].tolist()
    for i, (name, unit) in enumerate(zip(results.q_names, results.q_units, strict=True)):
        yield f"{name} [{unit}]", results.q[rows, i].tolist()


def _assigned(results: RunResults) -> Iterator[Column]:
    """One group of columns a wanted mode, limit or band, whichever trajectories it holds on.

    A group has each sample once: of what is asked twice of a mode, the second has its own group.
    """
    groups: dict[str, list[TargetStudy]] = {}
    for target in results.targets:
        name = target.asked.curve_name if target.asked.is_goal else target.label
        names = (f"{name} ({k})" if k > 1 else name for k in count(1))
        rows = target.asked.rows
        free = (
            name
            for name in names
            if all(
                own.asked.rows.stop <= rows.start or rows.stop <= own.asked.rows.start
                for own in groups.get(name, ())
            )
        )
        groups.setdefault(next(free), []).append(target)
    for name, targets in groups.items():
        for kind, curves in _curves(targets).items():
            values = np.full(results.time_s.size, np.nan)
            for target, hz in zip(targets, curves, strict=True):
                if hz is not None:
                    values[target.asked.rows] = hz
            yield f"{name} {kind} [Hz]", values.tolist()


def _curves(targets: Sequence[TargetStudy]) -> dict[str, list[Floats | None]]:
    """The edges, and the modes before and after, of each target; by what they are called."""
    found: dict[str, list[Floats | None]] = {
        name: [
            # a curve of a target, or an edge of what it asks
            getattr(target, field) if hasattr(target, field) else getattr(target.asked, name)
            for field in [f"{name.replace(' ', '_')}_hz"]
            for target in targets
        ]
        for name in targets[0].asked.columns
    }
    for mode in sorted({mode for t in targets if t.near for mode in t.near.modes}):
        for when in ("initial", "optimal"):
            found[f"mode {mode} {'exact' if when == 'optimal' else when}"] = [
                getattr(t.near, f"{when}_hz")[:, t.near.modes.index(mode)]
                if t.near and mode in t.near.modes
                else None
                for t in targets
            ]
    return found


def _expanded(results: RunResults) -> Iterator[Column]:
    """Exact frequencies at the initial design, and those of both expansions."""
    for study in results.studies:
        if study.over_time is not None:
            for kind in ("exact", "taylor", "linearised"):
                hz = getattr(study.over_time, f"{kind}_hz")
                yield f"mode {study.mode} {kind} [Hz]", hz.tolist()


def _number_text(columns: Sequence[Column]) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([heading for heading, _ in columns])
    for row in zip(*(values for _, values in columns), strict=True):
        gaps = (isinstance(value, float) and not math.isfinite(value) for value in row)
        writer.writerow(["" if gap else value for gap, value in zip(gaps, row, strict=True)])
    return text.getvalue().encode()
