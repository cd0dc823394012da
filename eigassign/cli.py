"""The command line: the only place that prints, catches errors and sets exit codes.

stdout carries results, stderr everything else. Only click is imported here at the top; what a
command needs is imported when it runs, so that ``--help`` is instant.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from eigassign import cli_options as options
from eigassign import failures, signals
from eigassign._version import __version__
from eigassign.errors import EigassignError, UsageError
from eigassign.teller import Teller, telling

if TYPE_CHECKING:
    from eigassign.answers import CheckAnswer
    from eigassign.batch import Job
    from eigassign.output.cache import Cache
    from eigassign.output.tables import CaseOutcome
    from eigassign.run import Options, Outcome
    from eigassign.study.findings import ValidationRow

_CONTEXT = {"help_option_names": ["-h", "--help"], "max_content_width": 100}


def main(args: Sequence[str] | None = None) -> int:
    """Run the command line on ``args`` (default: those of the process); returns the exit code."""
    if args is None:
        signals.expect_to_be_brief()
    arguments = sys.argv[1:] if args is None else list(args)
    signals.prefer_one_thread()
    signals.never_fail_to_encode()
    try:
        with signals.terminable():
            code = _invoke(arguments)
            signals.flush_streams()
            return code
    except BaseException as error:
        return _reported(error, debug="--debug" in arguments)


def _reported(error: BaseException, debug: bool) -> int:
    code = failures.report(error, debug)
    with suppress(OSError):  # the streams are silenced then, and the code is that of the error
        signals.flush_streams()
    return code


def _invoke(arguments: list[str]) -> int:
    """Not click's own ``main``, which would exit with codes of its own."""
    try:
        with cli.make_context("eigassign", arguments) as context:
            return int(cli.invoke(context) or 0)
    except click.exceptions.Exit as done:
        return done.exit_code
    except click.ClickException as error:
        error.show()
        return error.exit_code


@click.group(context_settings=_CONTEXT)
@click.version_option(__version__, prog_name="eigassign")
def cli() -> None:
    """Assign the natural frequencies of moving, flexible mechanisms along their trajectory.

    \b
    Exit codes: 0 fine; 1 infeasible, over the asked tolerance, or some cases
    failed; 2 wrong usage or wrong input; 3 environment or I/O; 4 a bug of
    eigassign; 130 and 143 interrupted and terminated.
    """


@cli.command()
@click.argument("cases", nargs=-1, required=True, type=options.PATH)
@options.json
@options.common
def check(cases: tuple[Path, ...], as_json: bool, **how: Any) -> int:
    """Check case files: every problem with its line, and what is implausible."""
    from eigassign.answers import check as checked

    codes, answers = [0], dict[str, Any]()
    with _telling(how) as tell:
        for case in cases:
            try:
                answers[str(case)] = answer = checked(case)
                tell.warn(answer.warnings)
            except EigassignError as error:
                codes.append(failures.report(error))
                if as_json:
                    answers[str(case)] = {"problems": failures.problems(error)}
    if as_json:
        _print_json(answers)
    else:
        for name, answer in answers.items():
            click.echo(_described(name, answer))
    return max(codes)


def _described(name: str, answer: CheckAnswer) -> str:
    q, y = (", ".join(names) or "none" for names in (answer.q_names, answer.y_names))
    lines = [
        f"{name}: {answer.title}",
        f"  {answer.n_dof} degrees of freedom, {answer.n_rigid} of them rigid",
        f"  coordinates {q}; design {y}; targets {answer.targets}",
        f"  trajectory: {answer.samples} samples in {answer.duration_s:g} s",
    ]
    return "\n".join([*lines, *(f"  {note}" for note in answer.notes)])


@cli.command()
@options.case
@click.option("--q", metavar="VALUES", help="Pose, as '1.817, 5.312' or '104 deg 304 deg'.")
@click.option("--y", metavar="VALUES", help="Design, as '0.125 0.125' or '125 g, 0'.")
@click.option("--count", type=click.IntRange(1), default=4, show_default=True, help="Modes.")
@options.json
@options.common
def modes(case: Path, q: str | None, y: str | None, count: int, as_json: bool, **how: Any) -> int:
    """Exact natural frequencies of the elastic modes at one pose and design.

    Without --q at the case's expansion point, or where its trajectory starts; without --y for the
    design written in the file.
    """
    from eigassign.answers import modes as solved
    from eigassign.values import point

    with _telling(how):
        answer = solved(case, *point(case, q, y), count)
    hz = list(answer.frequencies_hz)
    if as_json:
        _print_json({"rigid_modes": answer.rigid_modes, "frequencies_hz": hz})
    else:
        from eigassign.output.console import print_modes

        print_modes(hz, rigid_modes=answer.rigid_modes)
    return 0


@cli.command()
@options.case
@options.running
@options.json
@options.common
def optimize(case: Path, as_json: bool, **how: Any) -> int:
    """Assign the frequencies: the best design, proved by exact solves, in a run folder."""
    from eigassign import run

    return _finished(run.optimize, case, as_json, how)


@cli.command()
@options.case
@click.option("--order", type=click.IntRange(1, 20), help="Order, instead of the case's.")
@click.option("--linear", is_flag=True, help="Keep the partially linearised set only.")
@click.option("--mode", "modes", type=click.IntRange(1), multiple=True, help="Mode (repeatable).")
@options.running
@options.json
@options.common
def expand(
    case: Path, order: int | None, linear: bool, modes: tuple[int, ...], as_json: bool, **how: Any
) -> int:
    """Expand eigenvalues in q and y: coefficients and their accuracy, in a run folder.

    That is results/<case>_expansion unless --out says otherwise.
    """
    from eigassign import run

    def expanded(path: Path, options: Options) -> Outcome:
        return run.expand_case(path, options, order=order, modes=modes or None, linear=linear)

    out = how["out"] or Path("results", f"{case.stem}_expansion")
    return _finished(expanded, case, as_json, {**how, "out": out})


def _finished(
    work: Callable[[Path, Options], Outcome], case: Path, as_json: bool, how: Mapping[str, Any]
) -> int:
    """Run one case into its folder and show what it found; the exit code."""
    with _telling(how) as tell:
        outcome = work(case, _options(how, tell))
        tell.warn(outcome.warnings)
        _show(outcome, as_json)
        if not outcome.within_tolerance:
            tell.error("the expansion is further from exact than validation.max_error allows")
    return 0 if outcome.within_tolerance else 1


def _options(how: Mapping[str, Any], tell: Teller) -> Options:
    from eigassign.run import Options

    return Options(
        out=how.get("out"),
        cache_dir=how["cache_dir"],
        use_cache=not how["no_cache"],
        force=how.get("force", False),
        progress=tell.stage,
    )


def _show(outcome: Outcome, as_json: bool) -> None:
    if as_json:
        from eigassign.output.results_json import results

        _print_json({"run_folder": str(outcome.folder), **results(outcome.findings)})
    else:
        from eigassign.output.console import print_assignment

        print_assignment(outcome.findings)
        click.echo(f"{outcome.folder} written in {outcome.seconds:.2f} s")


@cli.command()
@click.argument("cases", nargs=-1, type=options.PATH)
@options.caching
@options.json
@options.common
def validate(cases: tuple[Path, ...], as_json: bool, **how: Any) -> int:
    """Compare both expansions with exact frequencies, along the trajectory and over boxes.

    CASES are files or folders; the files of ./cases (not of folders below it) when none is named.
    Exit code 1 where an expansion is further off than the case's validation.max_error.
    """
    from eigassign import run
    from eigassign.batch import cases_in, default_cases

    rows: list[ValidationRow] = []
    codes = [0]
    with _telling(how) as tell:
        for case in cases_in(cases or default_cases()):
            try:
                answer = run.validate(case, _options(how, tell))
            except EigassignError as error:
                codes.append(failures.report(error))
                continue
            tell.warn(answer.warnings)
            rows.extend(answer.rows)
            codes.append(0 if answer.passed else 1)
    if as_json:
        _print_json(rows)
    elif rows:
        from eigassign.output.console import print_validation

        print_validation(rows)
    return max(codes)


@cli.command()
@click.argument("paths", nargs=-1, required=True, type=options.PATH)
@click.option("--jobs", type=click.IntRange(1), help="Processes (default: one per core).")
@options.running
@options.common
def batch(paths: tuple[Path, ...], jobs: int | None, **how: Any) -> int:
    """Optimize many cases in parallel: files, or folders searched for *.yaml and *.yml.

    Every case gets its own folder below --out (default: results), beside summary.csv and
    junit.xml. A failed case does not stop the others; exit code 1 if any failed.
    """
    from eigassign import batch as many

    out = how["out"] or Path("results")
    cache_dir = how["cache_dir"] and str(how["cache_dir"])
    each = many.CaseOptions(str(out), cache_dir, not how["no_cache"], how["force"])
    with _telling(how) as tell:
        outcomes = _watched(many.plan(many.cases_in(paths), each), jobs, out, tell)
        bad = sum(outcome.status != "ok" for outcome in outcomes)
        if bad:
            tell.error(f"{bad} of {len(outcomes)} cases failed")
    return 1 if bad else 0


def _watched(
    jobs: Sequence[Job], workers: int | None, out: Path, tell: Teller
) -> list[CaseOutcome]:
    """Run the jobs with a line of progress each, and a table at the end."""
    from eigassign.batch import run_and_summarise
    from eigassign.output import console

    with console.progress("case", len(jobs), stream=tell.stream()) as advance:
        outcomes = run_and_summarise(
            jobs, workers, out, lambda row: advance(f"{row['name']}: {row['status']}")
        )
    console.print_batch(
        [(o.name, o.status, o.seconds, o.exact_max_relative, o.message) for o in outcomes]
    )
    return outcomes


@cli.command()
@options.case
@click.option("--quick", is_flag=True, help="In seconds: fewer methods, points and repeats.")
@click.option("--accuracy", type=options.POSITIVE, help="Advise for this worst relative error.")
@click.option("--budget", "budget_s", type=options.POSITIVE, help="Advise for so many seconds.")
@click.option("--evaluations", type=options.POSITIVE, help="How many evaluations are wanted.")
@click.option("--out", type=options.PATH, help="Folder (default: results/<case>_chart).")
@click.option("--force", is_flag=True, help="Move what is in the way aside, whatever it is.")
@options.json
@options.common
def chart(case: Path, quick: bool, as_json: bool, **how: Any) -> int:
    """Chart time against accuracy of every way to the frequencies of this case.

    Exact solves, expansions, reduced models, interpolation and surrogates, all against the same
    exact answers on this machine; the mesh; and ways to a design. Leaves figures, chart.json and
    report.html, and says what to choose.
    """
    from eigassign import charting
    from eigassign.study.chart_study import Wish

    wish = Wish(how["accuracy"], how["budget_s"], how["evaluations"])
    out = how["out"] or Path("results", f"{case.stem}_chart")
    with _telling(how) as tell:
        given = _options({**how, "out": out, "cache_dir": None, "no_cache": True}, tell)
        made = charting.chart(case, given, quick, wish)
        tell.warn(made.chart.warnings)
    if as_json:
        _print_json({"run_folder": str(made.folder), **vars(made.chart)})
    else:
        from eigassign.output.console import print_chart

        print_chart(made.chart)
        click.echo(f"{made.folder} written in {made.chart.seconds:.1f} s")
    return 0


@cli.group()
def cache() -> None:
    """The expansions kept from earlier runs."""


@cache.command("path")
@options.cache_dir
def cache_path(cache_dir: Path | None) -> int:
    """Print the cache folder."""
    click.echo(str(_cache(cache_dir).directory))
    return 0


@cache.command("clear")
@options.cache_dir
def cache_clear(cache_dir: Path | None) -> int:
    """Delete everything that is in the cache."""
    count = _cache(cache_dir).clear()
    click.echo(f"{count} file{'' if count == 1 else 's'} deleted")
    return 0


@cache.command("list")
@options.cache_dir
def cache_list(cache_dir: Path | None) -> int:
    """List what is in the cache, oldest first."""
    from eigassign.output.console import print_table

    rows = [
        (
            entry.key[:12],
            f"{entry.size_bytes / 1000:.1f}",
            "; ".join(f"{k} {v}" for k, v in entry.meta.items()) if entry.intact else "damaged",
        )
        for entry in _cache(cache_dir).entries()
    ]
    print_table("", ("key", "kB", "what"), rows)
    return 0


def _cache(directory: Path | None) -> Cache:
    from eigassign.output.cache import Cache, default_directory

    found = default_directory() if directory is None else directory
    if found is None:
        raise UsageError("there is no home folder to keep a cache in: use --cache-dir")
    return Cache(found)


@cli.command()
def schema() -> int:
    """Print the JSON Schema of case files, for editors."""
    from eigassign.case import json_schema

    _print_json(json_schema(), indent=2)
    return 0


def _print_json(value: object, indent: int | None = None) -> None:
    from eigassign.plain_json import dumps

    click.echo(dumps(value, indent))


def _telling(how: Mapping[str, Any]) -> AbstractContextManager[Teller]:
    return telling(how["verbose"], how["quiet"])
