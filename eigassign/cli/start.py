"""The first minute: `init` writes a case to start from, `docs` shows the manual, `completion`."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

import click

import eigassign.cli.arguments as arguments
from eigassign.cli.reporter import show
from eigassign.errors import StorageError, UsageError
from eigassign.files import CASE, quoted, read_bytes

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


def _part(topic: str) -> str:
    """A page by its name, else the part below a heading: of a key, a command, or any that fits.

    What no heading begins with is shown if it stands below one heading alone.
    """
    page, _, place = topic.rpartition("/")[2].partition("#")
    page = page.removesuffix(".md")
    pages, wanted = _pages(), _folded(place or page)
    named = next((name for name in pages if _folded(name) == _folded(page)), None)
    if named and not place:
        return pages[named]
    found = [
        (rank, level, text, start)
        for text in ([pages[named]] if named else pages.values())
        for level, title, start in _headings(text)
        if (rank := _rank(title, place or page, wanted)) is not None
    ]
    if not found:
        found, listed = _mentions(topic, pages), ""
        if len(found) > 1:
            titles = [repr(text.splitlines()[start].strip("# ")) for *_, text, start in found[:4]]
            listed = f"; it is mentioned below {', '.join(titles)}"
        if len(found) != 1:
            raise UsageError(
                f"the manual has no page and no heading {topic!r}{listed}: eigassign docs lists "
                "the pages"
            )
    _, level, text, start = min(found, key=lambda one: one[:2])
    ends = [k for other, _, k in _headings(text) if k > start and other <= level]
    return "\n".join(text.splitlines()[start : ends[0] if ends else None])


def _rank(title: str, written: str, wanted: str) -> int | None:
    """How well a heading fits a topic: 0 as a key is written, 1 as a whole, 2 as it begins."""
    folded = _folded(title)
    if title == written or title.endswith(f" with {written}"):
        return 0
    if folded in (wanted, f"eigassign {wanted}") or folded.endswith(f" with {wanted}"):
        return 1
    return 2 if folded.startswith(wanted) else None


_OF_THE_CODE = {"architecture", "contributing"}  # pages that no user of a case looks for


def _mentions(topic: str, pages: dict[str, str]) -> list[tuple[int, int, str, int]]:
    """Headings that have a word, else those below which it stands, the most often first."""
    word = re.compile(rf"\b{re.escape(_folded(topic).rstrip('s'))}s?\b")
    found, titled = [], []
    for name in pages.keys() - _OF_THE_CODE:
        lines, starts = pages[name].splitlines(), _headings(pages[name])
        ends = [start for _, _, start in starts[1:]] + [len(lines)]
        for (level, title, start), end in zip(starts, ends, strict=True):
            count = len(word.findall(_folded("\n".join(lines[start:end]))))
            found += [(-count, level, pages[name], start)] if count else []
            titled += found[-1:] if word.search(_folded(title)) else []
    return sorted(titled or found, key=lambda one: (one[0], one[1:]))


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


# --- Shell completion

VARIABLE = "_EIGASSIGN_COMPLETE"
SHELLS = {"bash": ".bashrc", "zsh": ".zshrc", "fish": ""}  # and the file that each reads at start
_ZSH = "(( $+functions[compdef] )) || { autoload -Uz compinit && compinit }\n"


@click.command(
    epilog=arguments.examples("eigassign completion bash", "eigassign completion bash --install")
)
@click.argument("shell", type=click.Choice(list(SHELLS)), required=False, metavar="[SHELL]")
@click.option("--install", is_flag=True, help="Set up completion for new terminals of this user.")
def completion(shell: str | None, install: bool) -> int:
    """Set up completion by tab, in bash, zsh or fish.

    Prints the script of SHELL (default: that of $SHELL). With --install it is written to a file in
    your home folder, and for bash and zsh a line is added to .bashrc or .zshrc.
    """
    name = shell or Path(os.environ.get("SHELL", "")).name
    if name not in SHELLS:
        raise UsageError(f"unknown shell {name or '$SHELL'!r}: give bash, zsh or fish")
    script = _script(name)
    if not install:
        click.echo(script)
        return 0
    home = Path.home()
    if name == "fish":
        _write(home / ".config/fish/completions/eigassign.fish", script)
    else:
        place = home / f".local/share/eigassign/completion.{name}"
        _write(place, script)
        _add_line(home / SHELLS[name], f'[ ! -r "{place}" ] || . "{place}"')
    click.echo("open a new terminal, type eigassign and press tab")
    return 0


def complete(cli: click.Command) -> int | None:
    """Print what the shell asks for behind a tab; its exit code, None if it asks nothing."""
    if (asked := os.environ.get(VARIABLE)) is None:
        return None
    from click.shell_completion import shell_complete

    return shell_complete(cli, {}, "eigassign", VARIABLE, asked)


def _script(shell: str) -> str:
    from click.shell_completion import get_completion_class

    made = get_completion_class(shell)
    if made is None:
        raise UsageError(f"this version of click knows no completion of {shell}")
    source = made(click.Command("eigassign"), {}, "eigassign", VARIABLE).source()
    return _ZSH + source if shell == "zsh" else source


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    show(f"{path} written")


def _add_line(path: Path, line: str) -> None:
    """Add a line at the end of a file, unless it has that line."""
    before = read_bytes(path, CASE).decode() if path.exists() else ""
    if line not in before.splitlines():
        apart = "" if before.endswith("\n") or not before else "\n"
        with open(path, "a", encoding="utf-8") as file:
            file.write(f"{apart}{line}\n")
        show(f"{path}: one line added")
