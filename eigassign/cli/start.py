"""The first minute: `init` writes a case to start from, `docs` shows the manual."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
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
    URDF does not contain is listed with its lines, to be filled in. Existing files are never
    overwritten.
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
        texts[case], asked = urdf_case(urdf, str(case))
        after = ["to fill in:", *asked]
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


@click.command(
    epilog=arguments.examples("eigassign docs", "eigassign docs own-arm", "eigassign docs targets")
)
@click.argument("topic", nargs=-1)
def docs(topic: tuple[str, ...]) -> int:
    """Show the manual.

    TOPIC is a key, a command, a page or a heading, or the address of a link in the manual, such as
    case-file.md#targets. Without it, the list of pages is shown. In a pipe the text is Markdown.
    """
    text = in_plain_text(_part(" ".join(topic) or "index"))
    if sys.stdout.isatty():
        from eigassign.output.console import markdown

        text = markdown(text, sys.stdout)
    click.echo_via_pager(text)
    return 0


def _pages() -> dict[str, str]:
    """Text by name; the index first."""
    pages = sorted(MANUAL.rglob("*.md"), key=lambda p: (p.stem != "index", len(p.parts), p.stem))
    return {p.stem: p.read_text(encoding="utf-8") for p in pages}


_OF_THE_CODE = {"architecture", "contributing"}  # pages that no user of a case looks for
_BEGINS = 2  # a rank of headings


def _part(topic: str) -> str:
    """A page by its name, else the part below the heading that fits best.

    What no heading begins with is shown where it is found below one heading alone.
    """
    page, _, place = topic.rpartition("/")[2].partition("#")
    page = page.removesuffix(".md")
    named = {name: text for name, text in _pages().items() if _folded(name) == _folded(page)}
    if named and not place:
        return next(iter(named.values()))
    found = sorted(_ranked(named or _pages(), place or page))
    alike = [one for one in found if one[0] == found[0][0]]
    if not found or (found[0][0] > _BEGINS and len(alike) > 1):
        titles = ", ".join(repr(title) for *_, title, _, _ in alike[:4])
        listed = f"; it is mentioned below {titles}" if titles else ""
        missing = f"the manual has no page and no heading {topic!r}{listed}"
        raise UsageError(f"{missing}: eigassign docs lists the pages")
    _, _, level, _, start, text = found[0]
    ends = [k for other, _, k in _headings(text) if k > start and other <= level]
    return "\n".join(text.splitlines()[start : ends[0] if ends else None])


def _ranked(pages: dict[str, str], written: str) -> Iterator[tuple[int, int, int, str, int, str]]:
    """Headings by how well they fit: rank, minus how often the word stands there, level, title.

    0 is a key as it is written, 1 a whole heading, 2 its beginning, 3 a word of it, 4 of the text.
    """
    wanted = _folded(written)
    word = re.compile(rf"\b{re.escape(wanted.rstrip('s'))}s?\b")
    for name, text in pages.items():
        lines, heads = text.splitlines(), _headings(text)
        ends = [start for *_, start in heads[1:]] + [len(lines)]
        for (level, title, start), end in zip(heads, ends, strict=True):
            folded, count = _folded(title), len(word.findall(_folded("\n".join(lines[start:end]))))
            fits = (
                title == written or title.endswith(f" with {written}"),
                folded in (wanted, f"eigassign {wanted}") or folded.endswith(f" with {wanted}"),
                folded.startswith(wanted),
                word.search(folded) is not None,
                count > 0 and name not in _OF_THE_CODE,
            )
            if any(fits):
                rank = fits.index(True)
                yield rank, -count * (rank > _BEGINS), level, title, start, text


def _folded(text: str) -> str:
    """The text as links spell headings, in lower case without punctuation; blanks for dashes."""
    return re.sub(r"[^\w\s]", "", re.sub("[-–]", " ", text.lower()))


def _headings(text: str) -> list[tuple[int, str, int]]:
    """Level, title and line of each; lines of code blocks are none."""
    found, code = [], False
    for k, line in enumerate(text.splitlines()):
        code ^= line.startswith("```")
        marks, _, title = line.partition(" ")
        if marks and set(marks) == {"#"} and not code:
            found.append((len(marks), title, k))
    return found


# Code, which stays as it is, or a formula of a line of its own, or one in the text.
_FORMULA = re.compile(r"^```.*?^```|`[^`]*`|\$\$(.+?)\$\$|\$([^$]+)\$", re.DOTALL | re.MULTILINE)
_ACCENTS = {"dot": "\u0307", "ddot": "\u0308", "hat": "\u0302", "tilde": "\u0303"}
_RAISED = str.maketrans("0123456789-−T", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁻ᵀ")
_SHOWN = {  # what the formulas of the manual have of TeX, beside characters that are their own sign
    r"\\tag(\{\d.*?\})": r"    (\1)",
    r"\\begin\{bmatrix\}\s*": "[",
    r"\s*\\end\{bmatrix\}": "]",
    r"\s*\\\\": ";",
    r"\s*&": ",",
    r"\\quad": "  ",
    r"\\sqrt\{(.*?)\}": r"√(\1)",
    r"\\text|[{}]": "",
}


def in_plain_text(page: str) -> str:
    """A page with its formulas as text: `B^T` is Bᵀ, and `K_{EE}` K_EE."""
    return _FORMULA.sub(_in_plain_text, page)


def _in_plain_text(found: re.Match[str]) -> str:
    formula = found[1] or found[2]
    if formula is None:
        return found[0]
    formula = re.sub(r"\\(d?dot|hat|tilde)\{(.)\}", lambda one: one[2] + _ACCENTS[one[1]], formula)
    formula = re.sub(
        r"\^(?:\{([-−\dT]+)\}|([\dT]))", lambda n: (n[1] or n[2]).translate(_RAISED), formula
    )
    for pattern, shown in _SHOWN.items():
        formula = re.sub(pattern, shown, formula)
    return formula if found[2] else re.sub(r"^(?=.)", "    ", formula.strip(), flags=re.MULTILINE)
