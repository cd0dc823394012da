"""Quick questions about a case, and the first minute: check, modes, schema, init, docs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

import eigassign.cli.arguments as arguments
from eigassign import process
from eigassign.cli.arguments import print_json, reporting, run_options, show
from eigassign.errors import CaseError, EigassignError
from eigassign.files import printable, quoted

if TYPE_CHECKING:
    from eigassign.pipeline.queries import CheckAnswer, ModesAnswer
import re

from eigassign.errors import StorageError, UsageError

LEFT_BY = ("run", "update", "batch", "chart", "charts")


@click.command(
    epilog=arguments.examples(
        "eigassign check planar_arm.yaml",
        "eigassign check planar_arm.yaml --draw",
        "eigassign check cases/*.yaml --json",
    )
)
@click.argument("cases", nargs=-1, required=True, type=arguments.PATH)
@click.option("--draw", is_flag=True, help="Draw the mechanism, into results/<case>_check.")
@arguments.force
@arguments.figures
@arguments.json
@arguments.common
def check(cases: tuple[Path, ...], draw: bool, as_json: bool, **how: Any) -> int:
    """Check case files, and say what they amount to.

    Lists every problem as file:line:column: key: message, also those of the first 100 variants of a
    sweep. For a valid case it prints warnings of implausible values, the degrees of freedom, and
    errors of the model.
    """
    from eigassign.pipeline import queries
    from eigassign.pipeline.stages import Stages

    codes, answers = [0], dict[str, Any]()
    with reporting(how) as reporter:
        for case in cases:
            try:
                with Stages(reporter.stage)("check", f"checking {case}"):
                    answer = queries.check(case, how["allow_outside"])
                    notes = (*answer.notes, *_sweep(case, how["allow_outside"]))
                answers[str(case)] = replace(answer, notes=notes)
                reporter.warn(answer.warnings)
                if draw:
                    folder = queries.draw(case, run_options(how, reporter))
                    reporter.note(f"{folder}/figures written")
            except EigassignError as error:
                codes.append(process.report(error))
                if as_json:
                    answers[str(case)] = process.document(error)
    if as_json:
        print_json(answers)
    else:
        from eigassign.output import console

        for name, answer in answers.items():
            lines = map(printable, _described(name, answer))
            show(*console.wrapped(lines, console.width()))
    return max(codes)


def _sweep(case: Path, allow_outside: bool) -> list[str]:
    """Describe its variants, if any; raises CaseError where one of the first 100 is wrong."""
    from eigassign.batch.plan import plan_of
    from eigassign.batch.work import CaseOptions, faults_of

    plan = plan_of([case])
    if not plan.is_swept:
        return []
    count = min(len(plan), 100)  # half a second
    options = CaseOptions("", allow_outside=allow_outside)
    if wrong := [each for k in range(count) for each in faults_of(plan, k, options)]:
        raise CaseError(tuple(wrong[:10]))
    seen = "all of them valid" if count == len(plan) else f"the first {count} of them valid"
    return [f"sweep: {len(plan)} variants, {seen}: eigassign batch {quoted(case)} --dry-run"]


def _trajectories(answer: CheckAnswer) -> list[str]:
    if not answer.trajectories:
        return ["  no trajectory"]
    if len(answer.trajectories) < 2:
        return [f"  trajectory: {answer.samples} samples in {answer.duration_s:g} s"]
    return [
        f"  trajectory {name!r}: {samples} samples in {duration_s:g} s"
        for name, samples, duration_s in answer.trajectories
    ]


def _described(name: str, answer: CheckAnswer) -> list[str]:
    q, y = (", ".join(names) or "none" for names in (answer.q_names, answer.y_names))
    lines = [
        f"{name}: {answer.title}",
        f"  {answer.n_dof} degrees of freedom, {answer.n_rigid} of them rigid",
        f"  coordinates {q}; design {y}; targets {answer.targets}",
        *_trajectories(answer),
    ]
    lines += [f"  {note}" for note in answer.notes]
    return [*lines, f"  next: {answer.next}"]


@click.command(
    epilog=arguments.examples(
        "eigassign modes planar_arm.yaml",
        'eigassign modes planar_arm.yaml --q "30 deg, 90 deg" --y "45 mm, 8 kN m/rad"',
        "eigassign modes planar_arm.yaml --count 2 --draw",
    )
)
@arguments.case
@arguments.pose
@click.option("--count", type=click.IntRange(1), help="How many (default: 4, or all there are).")
@click.option("--draw", is_flag=True, help="Draw the mode shapes.")
@arguments.out("results/<case>_modes; --out asks for the drawings too")
@arguments.force
@arguments.figures
@arguments.json
@arguments.common
def modes(
    case: Path,
    q: str | None,
    y: str | None,
    count: int | None,
    as_json: bool,
    draw: bool,
    **how: Any,
) -> int:
    """Show exact natural frequencies and mode shapes at one pose.

    Only elastic modes are listed; rigid-body modes are counted. Properties that load cases set may
    follow the coordinates in --q. An angle above two turns needs its unit, rad or deg.
    """
    from eigassign.pipeline import queries

    folder = None
    given = click.get_current_context().get_parameter_source("figures")
    draw = draw or how["out"] is not None or given is ParameterSource.COMMANDLINE
    with reporting(how) as reporter:
        if draw:
            answer, folder = queries.draw_modes(case, run_options(how, reporter), q, y, count)
        else:
            answer = queries.modes(case, q, y, count, how["allow_outside"])
        reporter.warn(answer.warnings)
        if as_json and folder is not None:
            reporter.note(f"{folder} written")
    if as_json:
        from eigassign.output.documents import results_document

        print_json(results_document(answer))
    else:
        _show_modes(answer, folder, how["verbose"] > 0)
    return 0


def _show_modes(answer: ModesAnswer, folder: Path | None, verbose: bool) -> None:
    """The modes; ``verbose``: with what would raise each, and round-off."""
    from eigassign.facts import capital
    from eigassign.output.console import print_tables
    from eigassign.output.tables import modes_table
    from eigassign.study.checks import rounding_line

    found = modes_table(
        answer.frequencies_hz,
        rigid_modes=answer.rigid_modes,
        where=answer.where,
        discretisation=answer.discretisation_error,
        truncation=answer.truncation_error,
        weight=answer.weight,
        levers=answer.levers if verbose else (),
        note=". ".join(map(capital, (*[rounding_line(answer.round_off)] * verbose, *answer.notes))),
    )
    print_tables([found])
    if folder is not None:
        show(f"{folder} written")


@click.command(
    epilog=arguments.examples(
        "eigassign schema > case.schema.json",
        "eigassign schema run > results.schema.json",
    )
)
@click.argument("of", type=click.Choice(["case", *LEFT_BY]), default="case")
def schema(of: str) -> int:
    """Print the JSON Schema of case files or results.

    That of case files is for editors; run and update mean results.json, batch summary.json, chart
    chart.json, and charts the matrix.json of several cases.
    """
    if of == "case":
        from eigassign.case.schema.document import json_schema

        print_json(json_schema(), indent=2)
    else:
        print_json(results_schema(of), indent=2)
    return 0


def results_schema(left_by: str) -> dict[str, Any]:
    """JSON Schema (2020-12) of the file that a run, an update, a batch or charts leave."""
    from eigassign.chart.results import Chart, Matrix
    from eigassign.output.batch.summary import SummaryDocument
    from eigassign.output.documents import schema_of
    from eigassign.study.results import RunResults
    from eigassign.study.updating.fit import UpdateResults

    rows = (RunResults, UpdateResults, SummaryDocument, Chart, Matrix)
    return schema_of(dict(zip(LEFT_BY, rows, strict=True))[left_by])


PACKAGE = Path(__file__).parents[1]
STARTERS = PACKAGE / "starters"
MANUAL = PACKAGE / "docs"

TEMPLATES = {  # files in STARTERS: <name>.yaml, and the folder <name> if there is one
    "planar_arm": "two links with elastic drives, along a path of the tip",
    "spatial_arm": "three joints in space",
    "four_bar": "a closed loop",
    "gantry": "a carriage that travels along a girder",
    "imported_part": "matrices from another finite-element program",
    "casting": "a part by its mesh, from gmsh, Abaqus or Nastran",
}


@click.command(
    epilog=arguments.examples(
        "eigassign init",
        "eigassign init four_bar --out linkage.yaml",
        after="\n".join(["Templates:", *(f"  {n:<14} {what}" for n, what in TEMPLATES.items())]),
    )
)
@click.argument(
    "template", type=click.Choice(list(TEMPLATES)), required=False, metavar="[TEMPLATE]"
)
@click.option(
    "--urdf", type=arguments.PATH, help="Write the case of this robot (default: a template)."
)
@click.option(
    "--out",
    type=arguments.PATH,
    metavar="FOLDER",
    help="Folder of the case file (default: the working folder). A name that ends in .yaml or .yml "
    "is that of the case file itself.",
)
def init(template: str | None, urdf: Path | None, out: Path | None) -> int:
    """Write a commented case file that runs as it is.

    Without TEMPLATE it is planar_arm. With --urdf the case is the robot of a URDF file, and what
    URDF does not contain is listed, to be filled in. Existing files are never overwritten.
    """
    if template is not None and urdf is not None:
        raise UsageError(f"give a template or --urdf, not both: {template} is another mechanism")
    name = template or "planar_arm" if urdf is None else urdf.stem
    case = Path() if out is None else out
    case = case if case.suffix in (".yaml", ".yml") else case / f"{name}.yaml"
    if urdf is None:
        beside = sorted(path for path in STARTERS.glob(f"{name}/*"))
        files = {case: STARTERS / f"{name}.yaml"}
        files |= {case.parent / name / path.name: path for path in beside}
        texts = {
            path: source.read_text(encoding="utf-8").replace(f" {name}.yaml", f" {quoted(case)}")
            for path, source in files.items()
        }
        others = ", ".join(each for each in TEMPLATES if each != name)
        after = [f"other templates: {others}"]
    else:
        from eigassign.pipeline.urdf import urdf_case

        texts, after = {}, []
        texts[case], asked = urdf_case(urdf)
        after = ["to fill in, since URDF has none:", *asked]
    for path in texts:
        if path.exists() or path.is_symlink():
            raise StorageError(f"{path} exists and is left alone: choose another folder with --out")
    for path, text in texts.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(path, "x", encoding="utf-8") as file:
            file.write(text)
        show(f"{path} written")
    show(f"next: eigassign check {quoted(case)} --draw", *after)
    return 0


# --- The manual


@click.command(epilog=arguments.examples("eigassign docs", "eigassign docs own-arm"))
@click.argument("page", required=False)
def docs(page: str | None) -> int:
    """Show a page of the manual.

    Without PAGE, the pages are listed. A page is Markdown.
    """
    index = (MANUAL / "index.md").read_text(encoding="utf-8")
    links = re.findall(r"^- \[(.*?)\]\((.*?)\)", index, re.MULTILINE)
    pages = {Path(link).stem: (title, link) for title, link in links}
    if page is None:
        show(*(f"{name:<18} {title}" for name, (title, _) in pages.items()))
        return 0
    name = Path(page.partition("#")[0]).stem  # of a link in the manual, too
    if name not in pages:
        from eigassign.case.reader import unknown

        raise UsageError(unknown("page", page, pages))
    click.echo_via_pager((MANUAL / pages[name][1]).read_text(encoding="utf-8"))
    return 0
