"""The work on cases: `optimize`, `expand`, `response`, `update`, `compare`, `validate`, `chart`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import eigassign.cli.arguments as arguments
from eigassign import process
from eigassign.cli.arguments import print_json, reporting, run_options, show
from eigassign.errors import EigassignError

if TYPE_CHECKING:
    from eigassign.chart.results import Chart, Matrix
    from eigassign.pipeline.run import Options, Outcome
    from eigassign.study.results import ValidationRow


@click.command(
    epilog=arguments.examples(
        "eigassign optimize planar_arm.yaml",
        "eigassign optimize planar_arm.yaml --study none --figures none",
        "eigassign optimize planar_arm.yaml --json --quiet",
    )
)
@arguments.case
@click.option(
    "--study",
    type=click.Choice(["none", "cheap", "all"]),
    default="cheap",
    show_default=True,
    help="How much of what the answer means is studied: all adds what a large model can reach.",
)
@arguments.writing("results/<case>")
@arguments.caching
@arguments.json
@arguments.common
def optimize(case: Path, as_json: bool, **how: Any) -> int:
    """Find the best design, solve it exactly, and write a report.

    Exit code 1 if the verdict is unreachable, infeasible or do not use, or if the error is above
    assignment.max_error.
    """
    from eigassign.pipeline import run

    return _finished(run.optimize, case, as_json, how)


@click.command(
    epilog=arguments.examples(
        "eigassign expand planar_arm.yaml",
        "eigassign expand planar_arm.yaml --order 6 --mode 1 --mode 2 --out series",
    )
)
@arguments.case
@click.option("--order", type=click.IntRange(1, 20), help="Order (default: that of the case).")
@click.option(
    "--mode",
    "modes",
    type=click.IntRange(1),
    multiple=True,
    help="Mode to expand; repeatable (default: those of the case).",
)
@arguments.writing("results/<case>_expansion")
@arguments.caching
@arguments.json
@arguments.common
def expand(case: Path, order: int | None, modes: tuple[int, ...], as_json: bool, **how: Any) -> int:
    """Write the Taylor expansion of eigenvalues, and its accuracy.

    The expansion is in the coordinates q and the design y. Its coefficients are in
    coefficients.json and coefficients.h5.
    """
    from eigassign.pipeline import run

    work = partial(run.expand_case, order=order, modes=modes or None)
    return _finished(work, case, as_json, how)


@click.command(
    epilog=arguments.examples(
        'eigassign response planar_arm.yaml --at forearm.end --direction "0, 1" --from "5 Hz" '
        '--to "60 Hz" --teeth 4',
    )
)
@arguments.case
@click.option("--at", metavar="NODE", help="Node that is shaken (default: the case's responses).")
@click.option("--direction", metavar="VALUES", help="'0, 1': along which (default: none).")
@click.option("--seen", metavar="NODE", help="Node that is seen to move (default: the same).")
@click.option("--along", metavar="VALUES", help="Along which direction (default: the same).")
@click.option("--from", "lowest", metavar="HZ", help="Lowest frequency, '40 Hz' (default: none).")
@click.option("--to", "highest", metavar="HZ", help="Highest frequency (default: none).")
@click.option("--teeth", type=click.IntRange(1), help="Of a cutter on the spindle (default: none).")
@click.option("--harmonics", type=click.IntRange(1), help="Of its tooth passing (default: 1).")
@arguments.design
@arguments.writing("results/<case>_response")
@arguments.json
@arguments.common
def response(case: Path, y: str | None, as_json: bool, **how: Any) -> int:
    """Compute frequency responses along the trajectory.

    Writes dynamic stiffness over time and frequency, its least value along the path, modes with
    their constants at the nodes, and free speeds of a spindle: modes.csv, response.csv and
    response.h5. Without --at it is the response of the case.
    """
    from eigassign.case.reader import resolve
    from eigassign.pipeline import queries, run

    def place(at: str | None, along: str | None) -> dict[str, object]:
        values = [*map(resolve, queries.split(along or ""))]
        return {**({"at": at} if at else {}), **({"direction": values} if values else {})}

    drawn = place(how["at"], how["direction"])
    if how["seen"] or how["along"]:
        drawn["seen"] = {**drawn, **place(how["seen"], how["along"])}
    names = {"lowest": "from", "highest": "to", "teeth": "teeth", "harmonics": "harmonics"}
    drawn |= {key: how[name] for name, key in names.items() if how[name] is not None}
    return _finished(partial(run.respond_case, drawn=drawn, y=y), case, as_json, how)


def _finished(
    work: Callable[[Path, Options], Outcome], case: Path, as_json: bool, how: Mapping[str, Any]
) -> int:
    """Run one case into its folder and show what it found; the exit code."""
    from eigassign.output.console import print_assignment

    with reporting(how) as reporter:
        outcome = work(case, run_options(how, reporter))
        results = outcome.results
        reporter.warn(results.warnings)
    told = partial(print_assignment, results, verbose=how["verbose"] > 0)
    _show(as_json, outcome.folder, results, outcome.seconds, told)
    if results.shortcoming is not None and as_json:  # else it is in the verdict
        reporter.error(results.shortcoming)
    if results.interrupted:
        kept = "no finished run is replaced"
        reporter.error(f"interrupted: the best design so far is in {outcome.folder}; {kept}")
        return process.INTERRUPTED
    return 0 if results.shortcoming is None else 1


def _show(
    as_json: bool, folder: Path | None, results: Any, seconds: float, told: Callable[[], None]
) -> None:
    """The results on stdout, as JSON or as they are ``told``; the last line says what to open."""
    if as_json:
        from eigassign.output.documents import results_document

        print_json({"run_folder": str(folder), **results_document(results, may_lack=True)})
        return
    told()
    page = folder and folder / "report.html"
    show(f"{page if page and page.exists() else folder} written in {seconds:.2f} s")


@click.command(
    epilog=arguments.examples(
        "eigassign update arm_update.yaml",
        "eigassign update arm_update.yaml --figures none --json",
    )
)
@arguments.case
@arguments.writing("results/<case>_update")
@arguments.json
@arguments.common
def update(case: Path, as_json: bool, **how: Any) -> int:
    """Fit the parameters to measured frequencies.

    Finds by least squares the design parameters whose exact frequencies come nearest to the
    measurements of the case. Reports their intervals, the residual of each measurement, and what
    the measurements cannot determine; updated.yaml is the case with the values found. Exit code 1
    if the measurements are not explained, or do not determine the parameters.
    """
    from eigassign.output.console import print_tables, print_verdict
    from eigassign.output.reports.update import update_tables
    from eigassign.pipeline import studies as updating

    with reporting(how) as reporter:
        done = updating.update(case, run_options(how, reporter))
        results = done.results
        reporter.warn(results.warnings)

    def told() -> None:
        print_verdict(results.headline, results.verdict)
        every, verbose = update_tables(results), how["verbose"] > 0
        own = (one.without("parameter") for one in every if one.section == "parameters")
        print_tables(every if verbose else own)

    _show(as_json, done.folder, results, sum(results.timing_s.values()), told)
    return 0 if results.verdict == "fitted" else 1


@click.command(
    epilog=arguments.examples(
        "eigassign compare planar_arm.yaml four_bar.yaml",
        "eigassign compare results/planar_arm results/four_bar --out side",
    )
)
@click.argument("runs", nargs=-1, required=True, type=arguments.PATH)
@arguments.out("results")
@arguments.force
@arguments.json
@arguments.common
def compare(runs: tuple[Path, ...], out: Path | None, as_json: bool, **how: Any) -> int:
    """Put finished runs side by side.

    RUNS are run folders of optimize, or case files that have one in results. Verdicts, designs,
    errors, mass, price and room to limits are shown in tables, and with the frequencies over each
    other on a page, compare.html.
    """
    from eigassign.output.console import print_tables
    from eigassign.output.reports.compare import comparison, read_results
    from eigassign.output.store.run_folder import put_page

    with reporting(how):
        tables, page = comparison({str(run): read_results(run) for run in runs})
        place = (out or Path("results")) / "compare.html"
        put_page(place, page, force=how["force"])
    if as_json:
        print_json({"page": str(place), "tables": [table._asdict() for table in tables]})
        return 0
    print_tables(tables)
    show(f"{place} written")
    return 0


@click.command(
    epilog=arguments.examples(
        "eigassign validate cases/two_link.yaml",
        "eigassign validate cases --json",
    )
)
@click.argument("cases", nargs=-1, type=arguments.PATH)
@arguments.caching
@arguments.json
@arguments.common
def validate(cases: tuple[Path, ...], as_json: bool, **how: Any) -> int:
    """Compare the expansion with exact frequencies.

    Compares the full expansion, and the one that is linear in the design, along the trajectory,
    within the bounds of the design, and at random points. CASES are files or folders; without any,
    the case files in ./cases. Exit code 1 if an error is above validation.max_error of the case.
    """
    from eigassign.batch.plan import cases_in
    from eigassign.pipeline import run

    rows: list[ValidationRow] = []
    failures: list[dict[str, object]] = []
    codes = [0]
    with reporting(how) as reporter:
        for case in cases_in(cases):
            try:
                answer = run.validate(case, run_options(how, reporter))
            except EigassignError as error:
                codes.append(process.report(error))
                failures.append({"case": case.stem, **process.document(error)})
                continue
            reporter.warn(answer.warnings)
            rows.extend(answer.rows)
            codes.append(0 if answer.passed else 1)
    if as_json:
        print_json([*rows, *failures])
    else:
        from eigassign.output.console import print_tables
        from eigassign.output.tables import validation_table

        table = validation_table(rows)
        brief = table if how["verbose"] else table.without("points").without("order")
        print_tables([brief] if rows else ())
    return max(codes)


@click.command(
    epilog=arguments.examples(
        "eigassign chart planar_arm.yaml --quick",
        "eigassign chart planar_arm.yaml --accuracy 1e-4",
        "eigassign chart cases/stress --quick",
    )
)
@click.argument("cases", nargs=-1, required=True, type=arguments.PATH)
@click.option("--quick", is_flag=True, help="Fewer sizes, points and repeats: some seconds a case.")
@click.option(
    "--accuracy",
    type=arguments.ACCURACY,
    help="The relative error that is wanted of a frequency (default: that of the case's "
    "expansion, else 0.01).",
)
@arguments.writing("results/<case>_chart, or results/charts of several cases")
@arguments.json
@arguments.common
def chart(
    cases: tuple[Path, ...], quick: bool, accuracy: float | None, as_json: bool, **how: Any
) -> int:
    """Chart speed against accuracy, and where methods fail.

    Every method is judged at points that none has seen, and timed on this machine. Names what
    makes methods fail in the case, how far each may be trusted, and what to write. Several CASES,
    or a folder of them, are put side by side. Exit code 1 if one of several is refused.
    """
    from eigassign.batch.plan import cases_in
    from eigassign.chart.question import QUICK, Effort
    from eigassign.output.console import print_tables, print_verdict
    from eigassign.output.reports.chart import chart_tables
    from eigassign.pipeline import charting

    effort, failed = QUICK if quick else Effort(), False
    several = len(cases) > 1 or cases[0].is_dir()
    paths = cases_in(cases) if several else cases
    with reporting(how) as reporter:
        options = run_options(how, reporter)
        made: Chart | Matrix
        if several:
            folder, made = charting.chart_cases(paths, options, effort, accuracy)
            for name, why in made.refused:
                reporter.error(f"{name} is refused: {why}")
            failed = bool(made.refused)
        else:
            folder, made = charting.chart(paths[0], options, effort, accuracy)
        reporter.warn(made.warnings)
        for note in made.notes:
            reporter.note(note)

    def told() -> None:
        print_verdict(made.headline)
        sections = ("fails", "write", "reach") if how["verbose"] else ("fails", "write")
        print_tables(table for table in chart_tables(made) if table.section in sections)

    _show(as_json, folder, made, made.seconds, told)
    return int(failed)
