"""What a worker does: check a variant, run it."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from eigassign.batch.plan import (
    STUDY,
    BatchPlan,
    Variant,
    content_of,
    key_of,
    variant_problem,
)
from eigassign.case.case_file import checked, read
from eigassign.errors import CaseError, EigassignError, Problem, StorageError, UsageError
from eigassign.files import once
from eigassign.output.batch.summary import CaseOutcome, Status, frequency_ranges, to_plain
from eigassign.output.store.run_folder import MARKER, read_record
from eigassign.pipeline.run import Options, solve_case
from eigassign.pipeline.stages import new_run_folder
from eigassign.process import failure_of
from eigassign.study.built_case import BuiltCase
from eigassign.study.results import DriveRow, RunResults

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)  # not of one case only


@dataclass(frozen=True)
class CaseOptions:
    """Options of each case's run, which can be sent to another process."""

    out: str  # the folder of the batch
    cache_dir: str | None = None
    use_cache: bool = True
    force: bool = False
    figures: tuple[str, ...] = ("png",)
    reports: str = "all"  # of which cases there are figures and a report: all, failed or none
    redraw: bool = False  # cases that were done without theirs run again
    allow_outside: bool = False

    def draws(self, status: str) -> bool:
        """True where a case that ended so has figures and a report."""
        return self.reports == "all" or (self.reports == "failed" and status != "ok")


# --- Reading and checking


def faults_of(plan: BatchPlan, index: int, options: CaseOptions) -> tuple[Problem, ...]:
    """What is wrong with a variant that is no valid case, where that was given; else nothing.

    Raises StorageError where a file of it cannot be read.
    """
    variant = plan[index]
    try:
        load(variant, options)
    except StorageError:
        raise
    except CaseError as error:
        return tuple(variant_problem(plan, index, each) for each in error.problems)
    except EigassignError as error:
        return (variant_problem(plan, index, Problem(variant.path, 0, 0, "", str(error))),)
    return ()


def load(variant: Variant, options: CaseOptions) -> BuiltCase:
    """The case of a variant; raises CaseError."""
    return BuiltCase(checked(_written(variant.path), options.allow_outside, variant.values))


_written = once(read, 4)  # case files, parsed


# --- Running


def run_case(variant: Variant, options: CaseOptions) -> CaseOutcome:
    """The outcome of a case; raises StorageError where the disk is full, else no Exception."""
    start = perf_counter()

    def ended(status: Status, message: str, **found: Any) -> CaseOutcome:
        return outcome_of(variant, status, perf_counter() - start, message=message, **found)

    try:
        return _solved(variant, options, ended)
    except MemoryError:
        return ended("error", "out of memory")
    except Exception as error:
        if isinstance(error, StorageError) and getattr(error.__cause__, "errno", 0) in _FULL:
            raise  # no case can be written any more
        failure = failure_of(error)
        return ended("failed" if failure.exit_code == 1 else "error", failure.text)


def outcome_of(
    case: Variant | CaseOutcome, status: Status, seconds: float = 0.0, **found: Any
) -> CaseOutcome:
    """The outcome of this case."""
    named = {name: getattr(case, name) for name in ("name", "path", "values", "index", "key")}
    return CaseOutcome(**named, status=status, seconds=seconds, **found)


def _solved(
    variant: Variant, options: CaseOptions, ended: Callable[..., CaseOutcome]
) -> CaseOutcome:
    """The outcome, in run.json of its folder; that no design meets the limits is an answer too."""
    case, written = load(variant, options), _written(variant.path)
    if key_of(content_of(written), variant.values, written.path.parent) != variant.key:
        raise UsageError(
            "the case file, or a file it names, was changed since the batch began: run it again"
        )
    cache_dir = Path(options.cache_dir) if options.cache_dir else None
    how = Options(None, cache_dir, options.use_cache, report="none", study=STUDY)
    place, row = Path(options.out, variant.name), dict[str, Any]()
    force = options.force or _is_damaged(place)
    with new_run_folder(case.file, place, force, key=variant.key, outcome=row) as folder:
        try:
            results = solve_case(case, how).results
        except EigassignError as error:
            if error.exit_code != 1:
                raise
            outcome = ended("failed", failure_of(error).text)
        else:
            if results.interrupted:  # Ctrl-C ends a batch: the best design so far is no answer
                raise KeyboardInterrupt
            found = _found(case, results)
            drawn = options.draws(found["status"])
            folder.write(results, options.figures if drawn else (), "light" if drawn else "none")
            outcome = ended(**found, run_folder=variant.name)
        row.update(to_plain(outcome))
    return outcome


def _is_damaged(place: Path) -> bool:
    """True where a run has lost its record: what is left of it may be moved aside."""
    left = any(os.path.lexists(place / name) for name in (MARKER, "results.json"))
    return left and read_record(place) is None


def _found(case: BuiltCase, results: RunResults) -> dict[str, Any]:
    error, violation, found = results.error, results.violation, results.assignment
    units = {**case.file.variant_units, **{row.name: row.unit for row in results.design}}
    units |= {_peak(row): row.unit for row in results.drives}
    return {
        "status": _status(results),
        "message": results.shortcoming or "",
        "verdict": found.verdict if found else "",
        "initial_max_relative": error and error.initial.max_relative,
        "predicted_max_relative": error and error.predicted and error.predicted.max_relative,
        "exact_max_relative": error and error.exact.max_relative,
        "exact_rms_relative": error and error.exact.rms_relative,
        "initial_violation": violation and violation.initial,
        "exact_violation": violation and violation.exact,
        "mass": results.mass and results.mass.optimal,
        "price": results.price,
        "room": min((t.room for t in results.targets if t.room is not None), default=None),
        "design": tuple((row.name, row.optimal) for row in results.design),
        "drives": tuple((_peak(row), row.optimal.peak) for row in results.drives),
        "units": units,
        "read_in": {k: own for k, u in units.items() if (own := getattr(u, "answered", ""))},
        "frequencies": frequency_ranges(results, case.file.variant),
    }


def _peak(row: DriveRow) -> str:
    return f"peak{row.quantity} of {row.name}"


def _status(results: RunResults) -> Status:
    """Failed where there is no answer at all, tolerance where there is one that is not enough."""
    if results.shortcoming is None:
        return "ok"
    found = results.assignment
    no_answer = found is not None and found.verdict in ("unreachable", "infeasible")
    return "failed" if no_answer else "tolerance"
