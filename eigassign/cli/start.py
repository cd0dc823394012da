"""The first minute: `init` writes a case to start from, `docs` shows the manual."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import click

import eigassign.cli.arguments as arguments
from eigassign.cli.reporter import show
from eigassign.errors import StorageError, UsageError
from eigassign.files import quoted

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

    Without PAGE, the pages are listed. In a pipe a page is Markdown.
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
    text = (MANUAL / pages[name][1]).read_text(encoding="utf-8")
    if sys.stdout.isatty():
        from eigassign.output.console import markdown

        text = markdown(text, sys.stdout)
    click.echo_via_pager(text)
    return 0
