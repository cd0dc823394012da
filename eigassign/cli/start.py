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
from eigassign.files import CASE, at_home, quoted, read_bytes

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
    "--urdf", type=arguments.PATH, help="Write the case of this robot (default: none, a template)."
)
@click.option(
    "--out", type=arguments.PATH, help="Case file, or its folder (default: <template>.yaml)."
)
def init(template: str | None, urdf: Path | None, out: Path | None) -> int:
    """Write a commented case file that runs as it is, to start from.

    TEMPLATE is planar_arm unless another is named. With --urdf the case is a robot from a URDF
    file, and what URDF does not know is listed with its lines. Files that exist are never
    overwritten.
    """
    if template is not None and urdf is not None:
        raise UsageError(f"name a template or --urdf, not both: {template} is a robot of its own")
    name = template or "planar_arm" if urdf is None else urdf.stem
    case = Path(name) if out is None else out / name if out.is_dir() else out
    case = case if case.suffix else case.with_name(f"{case.name}.yaml")
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
            raise StorageError(f"{path} exists and is left alone: choose another name with --out")
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
    """Show the manual: a page, or the part of a page below a heading.

    TOPIC is the name of a page, the beginning of a heading, or what stands in brackets behind a
    link; without it, the list of pages. In a pipe it is the text as it is written, in Markdown.
    """
    text = _part(" ".join(topic) or "index")
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
    """A page by its name, else the part below a heading, by its beginning; or what a link names."""
    page, _, place = topic.rpartition("/")[2].partition("#")
    wanted = _folded(place or page.removesuffix(".md"))
    pages = {_folded(name): text for name, text in _pages().items()}
    if place and page:
        pages = {
            _folded(page.removesuffix(".md")): pages.get(_folded(page.removesuffix(".md")), "")
        }
    elif wanted in pages:
        return pages[wanted]
    found = [
        (not _is_about(_folded(title), wanted), level, start, text)
        for text in pages.values()
        for level, title, start in _headings(text)
        if _is_about(_folded(title), wanted) or _folded(title).startswith(wanted)
    ]
    if not found:
        where = _mentions(page or topic)
        listed = f"; it is mentioned below {', '.join(where)}" if where else ""
        raise UsageError(
            f"no page and no heading begins with {topic!r}{listed}: eigassign docs lists the pages"
        )
    exact = [one for one in found if not one[0]]
    _, level, start, text = min(exact or found[:1], key=lambda one: one[1])
    ends = [k for other, _, k in _headings(text) if k > start and other <= level]
    return "\n".join(text.splitlines()[start : ends[0] if ends else None])


def _is_about(title: str, wanted: str) -> bool:
    """True for the heading of the topic, or of a part that is told apart by it."""
    return title == wanted or title.endswith(f" with {wanted}")


_OF_THE_CODE = {"architecture", "contributing"}  # pages that no user of a case looks for


def _mentions(topic: str) -> list[str]:
    """The headings below which a word stands most often, without what stands below others."""
    word = re.compile(rf"\b{re.escape(topic.rstrip('s'))}s?\b", re.IGNORECASE)
    counts: dict[str, int] = {}
    for name, text in _pages().items():
        if name in _OF_THE_CODE:
            continue
        lines, starts = text.splitlines(), _headings(text)
        ends = [start for _, _, start in starts[1:]] + [len(lines)]
        for (_, title, start), end in zip(starts, ends, strict=True):
            counts[title] = counts.get(title, 0) + len(word.findall("\n".join(lines[start:end])))
    most = sorted(counts, key=lambda title: -counts[title])[:4]
    return [repr(title) for title in most if counts[title]]


def _folded(text: str) -> str:
    """The text as links spell headings, in lower case without punctuation; blanks for dashes."""
    return re.sub(r"[^\w ]", "", text.lower().replace("-", " "))


def _headings(text: str) -> list[tuple[int, str, int]]:
    """Level, title and line of each; lines of code blocks are none."""
    found, code = [], False
    for k, line in enumerate(text.splitlines()):
        code ^= line.startswith("```")
        marks, _, title = line.partition(" ")
        if marks and set(marks) == {"#"} and not code:
            found.append((len(marks), title, k))
    return found


# --- Shell completion

VARIABLE = "_EIGASSIGN_COMPLETE"
SHELLS = {"bash": ".bashrc", "zsh": ".zshrc", "fish": ""}  # and the file that each reads at start
_ZSH = "(( $+functions[compdef] )) || { autoload -Uz compinit && compinit }\n"


@click.command(
    epilog=arguments.examples("eigassign completion bash", "eigassign completion bash --install")
)
@click.argument("shell", type=click.Choice(list(SHELLS)), required=False, metavar="[SHELL]")
@click.option("--install", is_flag=True, help="Set it up for new terminals of this user.")
def completion(shell: str | None, install: bool) -> int:
    """Completion of commands, options and files in bash, zsh or fish (default: that of $SHELL).

    Prints the script; with --install it is written where the shell finds it: a file in your home
    folder, and in bash and zsh a line in .bashrc or .zshrc.
    """
    name = shell or Path(os.environ.get("SHELL", "")).name
    if name not in SHELLS:
        raise UsageError(f"the shell {name or 'of $SHELL'!r} is not known: name bash, zsh or fish")
    script = _script(name)
    if not install:
        click.echo(script)
        return 0
    home = at_home("~", "--install")
    if name == "fish":
        _write(home / ".config/fish/completions/eigassign.fish", script)
    else:
        place = home / f".local/share/eigassign/completion.{name}"
        _write(place, script)
        _add_line(home / SHELLS[name], f'[ ! -r "{place}" ] || . "{place}"')
    click.echo("open a new terminal, and press tab behind eigassign")
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
