"""Many cases in parallel: `batch`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import eigassign.cli.arguments as arguments
from eigassign.cli.reporter import Reporter, reporting

if TYPE_CHECKING:
    from eigassign.batch.runner import Job
    from eigassign.output.batch.outcome import CaseOutcome


@click.command(
    epilog=arguments.examples(
        "eigassign batch cases --jobs 2",
        "eigassign batch planar_arm.yaml four_bar.yaml --out night --figures none",
    )
)
@click.argument("paths", nargs=-1, required=True, type=arguments.PATH)
@click.option("--jobs", type=click.IntRange(1), help="Processes (default: one per core).")
@arguments.running("results, with a folder for each case", "light")
@arguments.common
def batch(paths: tuple[Path, ...], jobs: int | None, **how: Any) -> int:
    """Optimize many cases in parallel: files, or folders searched for *.yaml and *.yml.

    Every case gets its own folder below --out, beside index.html, summary.csv, summary.json and
    junit.xml. A failed case does not stop the others; exit code 1 if any failed.
    """
    from eigassign.batch import runner as many
    from eigassign.batch.plan import cases_in

    out = how["out"] or Path("results")
    cache_dir = how["cache_dir"] and str(how["cache_dir"])
    each = many.CaseOptions(
        str(out),
        cache_dir,
        not how["no_cache"],
        how["force"],
        how["figures"],
        how["report"],
        how["allow_outside"],
    )
    with reporting(how) as reporter:
        outcomes = _watched(many.plan(cases_in(paths), each), jobs, out, reporter)
        bad = sum(outcome.status != "ok" for outcome in outcomes)
        if bad:
            reporter.error(f"{bad} of {len(outcomes)} cases failed")
    return 1 if bad else 0


def _watched(
    jobs: Sequence[Job], workers: int | None, out: Path, reporter: Reporter
) -> list[CaseOutcome]:
    """Run the jobs with a line of progress each, and a table at the end."""
    from eigassign.batch.runner import run_and_summarise
    from eigassign.output import console
    from eigassign.output.batch.summary import batch_table

    with console.progress("case", len(jobs), stream=reporter.stream()) as advance:
        outcomes = run_and_summarise(
            jobs, workers, out, lambda row: advance(f"{row['name']}: {row['status']}")
        )
    console.print_tables([batch_table(outcomes)])
    return outcomes
