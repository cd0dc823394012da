"""Many cases: `batch`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, ExitStack, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import eigassign.cli.arguments as arguments
from eigassign.cli.reporter import Reporter, reporting, show
from eigassign.errors import EigassignError, UsageError
from eigassign.files import folder_name

if TYPE_CHECKING:
    from eigassign.batch.cases import Batch, Progress
    from eigassign.batch.manifest import InOrder
    from eigassign.batch.plan import BatchPlan
    from eigassign.batch.workers import Workers
    from eigassign.output.batch.outcome import CaseOutcome
    from eigassign.output.previous import EarlierResult

_MANY = 50  # cases: above, only failed ones have figures and a report, and are listed at the end
_FOLDERS = 10_000  # cases: above, they have no folders
_FIRST, _LAST = 5, 2  # cases that a dry run lists


@click.command(
    epilog=arguments.examples(
        "eigassign batch cases --jobs 2",
        "eigassign batch planar_arm.yaml --set targets.0.frequency=12..15:4 --reports none",
        "eigassign batch planar_arm.yaml --set expansion.order=2,3,4 --dry-run",
    )
)
@click.argument("paths", nargs=-1, required=True, type=arguments.PATH)
@click.option(
    "--set",
    "settings",
    metavar="KEY=VALUES",
    multiple=True,
    help="Values of a key, as V1,V2 or MIN..MAX:COUNT; several --set make a grid (default: the "
    "sweep of the case).",
)
@click.option("--dry-run", is_flag=True, help="Say what would run, and how long; run nothing.")
@click.option("--jobs", type=click.IntRange(1), help="Number of processes (default: one per core).")
@click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Run on the workers of this dask.distributed scheduler (default: this machine).",
)
@click.option(
    "--reports",
    type=click.Choice(["none", "failed", "all"]),
    help="Which cases get figures and a light report (default: all up to 50 cases, else failed); "
    "cases that are done but lack theirs run again.",
)
@click.option(
    "--columns",
    is_flag=True,
    help="Write columns.h5 instead of a folder for each case; always above 10 000 cases.",
)
@click.option(
    "--case-time",
    type=arguments.LIMIT,
    metavar="SECONDS",
    help="Stop a case that takes longer (default: never).",
)
@arguments.out("results, or results/<case>_sweep of one swept case")
@arguments.against
@arguments.caching
@arguments.force
@arguments.figures
@arguments.common
def batch(
    paths: tuple[Path, ...],
    settings: tuple[str, ...],
    dry_run: bool,
    jobs: int | None,
    **how: Any,
) -> int:
    """Optimize many cases, and the variants of a sweep, in parallel.

    PATHS are case files, and folders that are searched for *.yaml and *.yml. A case with a sweep,
    or with --set, runs once for each variant. Every case has its own folder in --out, beside
    index.html, summary.csv, summary.json and junit.xml. Cases that are done and still current are
    skipped: repeat the command to continue after an interruption. A failed case does not stop the
    others. Exit code 1 if a case failed, or differs from --against.
    """
    from eigassign.batch.plan import cases_in, plan_of

    cases = cases_in(paths)
    plan = plan_of(cases, settings)
    swept = plan.is_swept and len(cases) == 1
    usual = Path("results", folder_name(f"{cases[0].stem}_sweep") if swept else "")
    with reporting(how) as reporter:
        asked = _batch(plan, how["out"] or usual, how)
        with _workers(how["scheduler"], jobs) as workers:
            if dry_run:
                return _tell(asked, workers, reporter)
            since = _comparison(how)
            rows = _watched(asked, workers, reporter)
        return _told(asked.folder, rows, since, reporter)


def _workers(scheduler: str | None, jobs: int | None) -> AbstractContextManager[Workers]:
    from eigassign.batch.workers import this_machine

    if scheduler is None:
        return nullcontext(this_machine(jobs))
    from eigassign.batch.cluster import cluster

    if jobs is not None:
        raise UsageError(
            "--jobs is for this machine: how many work at --scheduler is settled there"
        )
    return cluster(scheduler)


def _batch(plan: BatchPlan, folder: Path, how: Mapping[str, Any]) -> Batch:
    from eigassign.batch.cases import Batch
    from eigassign.batch.work import CaseOptions

    columns = how["columns"] or len(plan) > _FOLDERS
    options = CaseOptions(
        out=str(folder),
        cache_dir=how["cache_dir"] and str(how["cache_dir"]),
        use_cache=not how["no_cache"] and (not plan.is_swept or how["cache_dir"] is not None),
        force=how["force"],
        figures=how["figures"],
        reports=how["reports"] or ("all" if len(plan) <= _MANY else "failed"),
        redraw=how["reports"] is not None,
        columns=columns,
        allow_outside=how["allow_outside"],
        seconds=how["case_time"],
    )
    return Batch(plan, folder, options)


def _comparison(how: Mapping[str, Any]) -> EarlierResult | None:
    """Read what --against names, before it may be written over."""
    from eigassign.output.previous import EarlierResult

    against = how["against"]
    return against and EarlierResult(against, "answers", how["tolerance"])


def _told(folder: Path, rows: InOrder, since: EarlierResult | None, reporter: Reporter) -> int:
    """Show how the cases of a folder ended, all of them or the first that failed; the exit code."""
    from itertools import islice

    from eigassign.output import console
    from eigassign.output.batch.files import write_moves
    from eigassign.output.batch.outcome import from_line, status_of
    from eigassign.output.batch.summary import batch_table, said
    from eigassign.output.previous import Known

    ends, total = rows.ends, rows.ends.total()
    told = (line for line in rows if total <= _MANY or status_of(line) != "ok")
    listed = [from_line(line, folder) for line in islice(told, _MANY)]
    if since is not None:
        every = (from_line(line, folder) for line in rows)
        write_moves(folder, ((row, [*map(str, since.add(Known.of_outcome(row)))]) for row in every))
    console.print_tables([batch_table(listed)] if listed else [])
    console.print_tables([since.table()] if since is not None else [])
    if bad := total - ends["ok"]:
        reporter.error(f"{bad} of {_cases(total)} gave no answer to use")
    show(f"{_cases(total)} in {folder}: {said(ends) or 'nothing to run'}")
    return 1 if bad or (since is not None and since.moves) else 0


def _watched(batch: Batch, workers: Workers, reporter: Reporter) -> InOrder:
    """Run it with a line of progress for each case; the rows of all."""
    from eigassign.batch import runner
    from eigassign.output import console

    with ExitStack() as stack:
        advance: list[Callable[[str], None]] = []

        def on_start(progress: Progress) -> None:
            total, done = progress.total, progress.done
            if done:
                reporter.stage(f"{done} of {total} cases are done and still current: skipped")
            shown = console.progress("case", total - done, stream=reporter.stream())
            advance.append(stack.enter_context(shown))

        def on_outcome(found: CaseOutcome) -> None:
            advance[0](f"{found.name}: {found.word}")

        return runner.run(batch, workers, on_start, on_outcome, reporter.stage)


def _cases(count: int) -> str:
    return "1 case" if count == 1 else f"{count} cases"


def _tell(batch: Batch, workers: Workers, reporter: Reporter) -> int:
    """List the cases that would run, and say about how long, in how much memory and files."""
    from array import array

    from eigassign.batch.cases import seconds_of_done
    from eigassign.batch.runner import require_valid
    from eigassign.facts import duration
    from eigassign.output.console import print_tables
    from eigassign.output.tables import Table

    require_valid(batch, workers, reporter.stage)
    spent = seconds_of_done(batch)
    todo = array("q", (index for index in batch.header.indices() if index not in spent))
    first, last = todo[:_FIRST], todo[_FIRST:][-_LAST:]
    rows = [(str(index + 1), batch.plan[index].name) for index in (*first, *last)]
    if len(todo) > len(rows):
        rows.insert(_FIRST, ("…", f"{len(todo) - len(rows)} more"))
    if rows:
        print_tables([Table("Cases that would run", ("case", "name"), tuple(rows))])
    show(f"{_cases(len(todo))} would run, {len(spent)} are done and still current")
    if not rows:
        return 0
    drawn = len(todo) if batch.options.reports == "all" else 0
    folders = 0 if batch.options.columns else len(todo)
    processes = f"{workers.slots} process{'es' if workers.slots > 1 else ''}"
    case_s, memory_mb = _of_first(batch, todo[0], bool(drawn))
    source = "as measured so far" if spent else "estimated from the first"
    if spent:
        case_s = sum(spent.values()) / len(spent)
    if case_s is not None:
        total = duration(case_s * len(todo) / min(workers.slots, len(todo)))
        show(f"time     about {total} in {processes}: {duration(case_s)} a case, {source}")
    show(f"memory   about {memory_mb:.0f} MB in each of {processes}")
    # of the paper's arm: a folder has 8 files and 30 kB, a report 14 more and 700 kB, a line 1 kB
    disk_mb = (len(todo) + 30 * folders + 700 * drawn) / 1e3
    count = 8 * folders + 14 * drawn
    show(f"files    {count} more, about {disk_mb:.3g} MB, in {batch.folder}")
    return 0


def _of_first(batch: Batch, index: int, drawn: bool) -> tuple[float | None, float]:
    """Seconds of a case, and megabytes of it, from its sizes; None: it has no answer."""
    from time import perf_counter

    from eigassign.batch.work import load
    from eigassign.pipeline.outlook import ALONE_MB, ELSE_S, outlook
    from eigassign.study.planning import expansion_needed, plan_expansion

    started = perf_counter()
    try:
        case = load(batch.plan[index], batch.options)
        needed = expansion_needed(case.file)
        plan = plan_expansion(case.file, case.model(), case.trajectory, needed=needed)
        found = outlook(case, plan, case.trajectory, started)
    except EigassignError:
        return None, ALONE_MB
    if found.optimize_s is None:
        return None, found.memory_mb
    # a light report takes 5 s with its figures
    return found.optimize_s - ELSE_S + (5.0 if drawn else 0.0), found.memory_mb
