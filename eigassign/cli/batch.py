"""Many cases: `batch`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import eigassign.cli.arguments as arguments
from eigassign.cli.reporter import Reporter, reporting, show

if TYPE_CHECKING:
    from eigassign.batch.plan import Plan
    from eigassign.batch.progress import Batch, Progress
    from eigassign.batch.workers import Place
    from eigassign.output.batch.outcome import CaseOutcome

_MANY = 50  # cases: above, only failed ones have figures and a report, and are listed at the end
_FOLDERS = 10_000  # cases: above, they have no folders
_FIRST, _LAST = 5, 2  # cases that a dry run lists


@click.command(
    epilog=arguments.examples(
        "eigassign batch cases --jobs 2",
        "eigassign batch planar_arm.yaml --set targets.0.frequency=8..12:5 --reports none",
        "eigassign batch planar_arm.yaml --set expansion.order=2,3,4 --dry-run",
    )
)
@click.argument("paths", nargs=-1, required=True, type=arguments.PATH)
@click.option(
    "--set",
    "settings",
    metavar="KEY=VALUES",
    multiple=True,
    help="Values of a key, as V1,V2 or MIN..MAX:COUNT; several are a grid (default: the sweep).",
)
@click.option("--dry-run", is_flag=True, help="List what would run, with its time and files.")
@click.option("--jobs", type=click.IntRange(1), help="Processes (default: one per core).")
@click.option("--join", is_flag=True, help="Work along with a batch that is at work there.")
@click.option(
    "--reports",
    type=click.Choice(["none", "failed", "all"]),
    help="Cases with figures and a light report (default: all up to 50 cases, else failed).",
)
@click.option(
    "--columns",
    is_flag=True,
    help="No folder a case, but columns.h5 and columns.csv; so it is above 10 000 cases.",
)
@click.option(
    "--case-time",
    type=arguments.POSITIVE,
    metavar="SECONDS",
    help="End a case that takes longer (default: never).",
)
@click.option(
    "--case-memory",
    type=arguments.POSITIVE,
    metavar="MB",
    help="End a case that takes more (default: never).",
)
@click.option(
    "--out", type=arguments.PATH, help="Folder (default: results, or results/<case>_sweep)."
)
@arguments.caching
@arguments.force
@arguments.figures
@arguments.common
def batch(
    paths: tuple[Path, ...],
    settings: tuple[str, ...],
    dry_run: bool,
    jobs: int | None,
    join: bool,
    **how: Any,
) -> int:
    """Optimize many cases in parallel: files, folders searched for *.yaml and *.yml, and sweeps.

    Every case gets its own folder below --out, beside index.html, summary.csv, summary.json and
    junit.xml. A case file with a
    sweep, or with --set, is run once for each variant. Cases that are done and current are left
    out, so that the same command goes on where it was interrupted. A failed case does not stop the
    others; exit code 1 if any failed.
    """
    from eigassign.batch.limits import require_limits_here
    from eigassign.batch.plan import cases_in, plan_of
    from eigassign.batch.workers import this_machine

    require_limits_here(how["case_time"], how["case_memory"])
    cases = cases_in(paths)
    plan = plan_of(cases, settings)
    swept = plan.is_swept and len(cases) == 1
    usual = Path("results", f"{cases[0].stem}_sweep") if swept else Path("results")
    with reporting(how) as reporter:
        asked = _batch(plan, how["out"] or usual, how)
        place = this_machine(jobs)
        if dry_run:
            return _tell(asked, place)
        bad = _watched(asked, place, reporter, join)
    return 1 if bad else 0


def _batch(plan: Plan, folder: Path, how: Mapping[str, Any]) -> Batch:
    from eigassign.batch.progress import Batch
    from eigassign.batch.work import CaseOptions

    columns = how["columns"] or len(plan) > _FOLDERS
    options = CaseOptions(
        out=str(folder),
        cache_dir=how["cache_dir"] and str(how["cache_dir"]),
        use_cache=not how["no_cache"] and (not plan.is_swept or how["cache_dir"] is not None),
        force=how["force"],
        figures=how["figures"],
        reports=how["reports"] or ("all" if len(plan) <= _MANY else "failed"),
        columns=columns,
        allow_outside=how["allow_outside"],
        seconds=how["case_time"],
        megabytes=how["case_memory"],
    )
    return Batch(plan, folder, options)


def _watched(batch: Batch, place: Place, reporter: Reporter, join: bool) -> int:
    """Run it with a line of progress for each case, and a table at the end; how many failed."""
    from eigassign.batch import runner
    from eigassign.batch.manifest import InOrder
    from eigassign.output import console
    from eigassign.output.batch.outcome import from_line
    from eigassign.output.batch.summary import batch_table

    with ExitStack() as stack:
        advance: list[Callable[[str], None]] = []

        def on_start(progress: Progress) -> None:
            total, done = progress.total, progress.done
            if done:
                reporter.stage(f"{done} of {total} cases are done and current: left out")
            shown = console.progress("case", total - done, stream=reporter.stream())
            advance.append(stack.enter_context(shown))

        def on_outcome(found: CaseOutcome) -> None:
            advance[0](f"{found.name}: {found.status}")

        ends = runner.run(batch, place, on_start, on_outcome, join)
    total, bad = ends.total(), ends.total() - ends["ok"]
    listed: list[CaseOutcome] = []
    for found in map(from_line, InOrder(batch.folder, batch.header.indices())):
        if len(listed) < _MANY and (total <= _MANY or found.status != "ok"):
            listed.append(found)
    console.print_tables([batch_table(listed)] if listed else [])
    if bad:
        reporter.error(f"{bad} of {total} cases failed")
    show(f"{total} cases in {batch.folder}: {', '.join(f'{n} {end}' for end, n in ends.items())}")
    return bad


def _tell(batch: Batch, place: Place) -> int:
    """What would run."""
    from eigassign.batch.forecast import forecast
    from eigassign.batch.runner import require_valid
    from eigassign.output.console import print_table
    from eigassign.output.formats import duration

    require_valid(batch, place)
    found = forecast(batch, place.slots)
    first, last = found.todo[:_FIRST], found.todo[_FIRST:][-_LAST:]
    rows = [(str(index + 1), batch.plan[index].name) for index in first]
    if len(found.todo) > _FIRST + _LAST:
        rows.append(("…", f"{len(found.todo) - _FIRST - _LAST} more"))
    rows += [(str(index + 1), batch.plan[index].name) for index in last]
    print_table("Cases that would run", ("case", "name"), rows)
    show(f"{len(found.todo)} cases would run, {found.done} are done and current")
    processes = f"{place.slots} process{'es' if place.slots > 1 else ''}"
    if found.case_s is not None and found.total_s is not None:
        source = "as those that are done took" if found.measured else "estimated from the first"
        each = f"{duration(found.case_s)} a case, {source}"
        show(f"time     about {duration(found.total_s)} in {processes}: {each}")
    show(f"memory   about {found.process_mb:.0f} MB in each of {processes}")
    show(f"files    {found.files} more, about {found.disk_mb:.3g} MB, in {batch.folder}")
    return 0
