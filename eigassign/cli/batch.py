"""Many cases: `batch`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import eigassign.cli.arguments as arguments
from eigassign.cli.arguments import Reporter, reporting, show
from eigassign.files import folder_name

if TYPE_CHECKING:
    from eigassign.batch.plan import BatchPlan
    from eigassign.batch.runner import Batch
    from eigassign.output.batch.summary import CaseOutcome

_MANY = 50  # cases: above, only failed ones have figures and a report, and are listed at the end


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
@click.option("--dry-run", is_flag=True, help="Count the cases that would run; run nothing.")
@click.option("--jobs", type=click.IntRange(1), help="Number of processes (default: one per core).")
@click.option(
    "--reports",
    type=click.Choice(["none", "failed", "all"]),
    help="Which cases get figures and a light report (default: all up to 50 cases, else failed); "
    "cases that are done but lack theirs run again.",
)
@arguments.out("results, or results/<case>_sweep of one swept case")
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
    others. Exit code 1 if a case failed.
    """
    from eigassign.batch import runner
    from eigassign.batch.plan import cases_in, plan_of
    from eigassign.batch.workers import this_machine
    from eigassign.brief import counted

    cases = cases_in(paths)
    plan = plan_of(cases, settings)
    swept = plan.is_swept and len(cases) == 1
    usual = Path("results", folder_name(f"{cases[0].stem}_sweep") if swept else "")
    with reporting(how) as reporter:
        asked = _batch(plan, how["out"] or usual, how)
        workers = this_machine(jobs)
        if dry_run:
            there = runner.done(asked)
            todo = runner.require_valid(asked, there, reporter.stage)
            show(f"{counted(len(todo), 'case')} would run, {len(there)} are done and still current")
            return 0

        def on_start(total: int, done: int) -> None:
            if done:
                reporter.note(f"{done} of {total} cases are done and still current: skipped")

        def on_outcome(found: CaseOutcome) -> None:
            reporter.stage(f"{found.name}: {found.word}")

        rows = runner.run(asked, workers, on_start, on_outcome, reporter.stage)
        return _told(asked.folder, rows, reporter)


def _batch(plan: BatchPlan, folder: Path, how: Mapping[str, Any]) -> Batch:
    from eigassign.batch.runner import Batch
    from eigassign.batch.work import CaseOptions

    options = CaseOptions(
        out=str(folder),
        cache_dir=how["cache_dir"] and str(how["cache_dir"]),
        use_cache=how["use_cache"] and (not plan.is_swept or how["cache_dir"] is not None),
        force=how["force"],
        figures=how["figures"],
        reports=how["reports"] or ("all" if len(plan) <= _MANY else "failed"),
        redraw=how["reports"] is not None,
        allow_outside=how["allow_outside"],
    )
    return Batch(plan, folder, options)


def _told(folder: Path, rows: Sequence[CaseOutcome], reporter: Reporter) -> int:
    """Show how the cases ended, all of them or the first that failed; the exit code."""
    from eigassign.brief import counted
    from eigassign.output import console
    from eigassign.output.batch.summary import batch_table, said

    bad = [row for row in rows if row.status != "ok"]
    listed = [*rows] if len(rows) <= _MANY else bad[:_MANY]
    console.print_tables([batch_table(listed, console.width(100))] if listed else [])
    if bad:
        reporter.error(f"{len(bad)} of {counted(len(rows), 'case')} gave no answer to use")
    show(f"{folder / 'index.html'}: {counted(len(rows), 'case')}, {said(rows) or 'nothing to run'}")
    return 1 if bad else 0
