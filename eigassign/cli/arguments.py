"""What several commands share: their options; stages, warnings and the log on stderr; JSON."""

from __future__ import annotations

import json as json_text
import logging
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from functools import reduce
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from eigassign.errors import Problem
from eigassign.files import plain, printable
from eigassign.process import Progress, say

if TYPE_CHECKING:
    from eigassign.pipeline.stages import Options

# --- Options and arguments

F = TypeVar("F", bound=Callable[..., Any])


def several(*options: Callable[[F], F]) -> Callable[[F], F]:
    """Several options as one decorator."""
    return lambda command: reduce(lambda made, option: option(made), reversed(options), command)


def examples(*commands: str, after: str = "") -> str:
    """The end of a command's help: how it is used; the tests run each of them."""
    parts = ["\n".join(["\b", "Examples:", *(f"  {command}" for command in commands)])]
    return "\n\n".join([*parts, *([f"\b\n{after}"] if after else [])])


class Number(click.FloatRange):
    """A number of a range: `nan` compares as inside any, and `inf` is no amount of anything."""

    name = "number"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """``value`` as a float, or a usage error at its option."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number.", param, ctx)
        return number


FORMATS = ("png", "svg", "pdf")  # those of output.figures, which is not imported for --help


def figure_formats(ctx: click.Context, param: click.Parameter, value: str) -> tuple[str, ...]:
    """``"png,svg"`` → ``("png", "svg")``, ``"none"`` → ``()``; else a usage error."""
    names = tuple(dict.fromkeys(name.strip().lower() for name in value.split(",")))
    if names == ("none",):
        return ()
    if "none" in names:
        raise click.BadParameter("none cannot be combined with other formats.")
    for name in names:
        if name not in FORMATS:
            raise click.BadParameter(f"{name!r} is not one of {', '.join(FORMATS)} (or none).")
    return names


PATH = click.Path(path_type=Path)
ACCURACY = Number(1e-15, 1.0, max_open=True)  # relative; double precision ends at 2e-16
case = click.argument("case", type=PATH)
design = click.option(
    "--y",
    metavar="VALUES",
    help="Design, such as '0.125, 0.125' or '125 g, 0' (default: as the case file has it).",
)
pose = several(
    click.option(
        "--q",
        metavar="VALUES",
        help="Pose, such as '1.817, 5.312' or '104 deg, 304 deg' (default: the expansion point of "
        "the case, or the start of its trajectory).",
    ),
    design,
)
json = click.option("--json", "as_json", is_flag=True, help="Print JSON instead of tables.")
common = several(
    click.option("--quiet", is_flag=True, help="Print only errors on stderr."),
    click.option(
        "-v",
        "--verbose",
        count=True,
        help="All tables; more on stderr (-vv: everything).",
    ),
    click.option("--debug", is_flag=True, help="Print the traceback of an error."),
    click.option(
        "--allow-outside",
        is_flag=True,
        help="Let cases name files outside their own folder.",
    ),
)
caching = several(
    click.option(
        "--no-cache",
        "use_cache",
        is_flag=True,
        flag_value=False,
        default=True,
        help="Neither read nor write the cache. $EIGASSIGN_CACHE is auto (keep what took over "
        "0.1 s to compute; the default), always or never.",
    ),
    click.option(
        "--cache-dir",
        type=PATH,
        metavar="FOLDER",
        help="Cache folder (default: $EIGASSIGN_CACHE_DIR, else the user's cache folder).",
    ),
)
force = click.option(
    "--force",
    is_flag=True,
    help="Rename whatever is in the way (to <name>.1); without --force the command stops.",
)
figures = click.option(
    "--figures",
    callback=figure_formats,
    metavar="FORMATS",
    default="png",
    show_default=True,
    help="Formats of the figures: png, svg, pdf, separated by commas; or none.",
)


report = click.option(
    "--report",
    type=click.Choice(["full", "light", "none"]),
    default="full",
    show_default=True,
    help="Report: full is interactive (5 MB), light has pictures only (1 MB), or none.",
)


def out(usual: str) -> Callable[[F], F]:
    """``--out``: in every command the folder of its result, with its default."""
    said = f"Folder of the result (default: {usual})."
    return click.option("--out", type=PATH, metavar="FOLDER", help=said)


def writing(folder: str) -> Callable[[F], F]:
    """The options of a command that leaves a folder with figures and a report."""
    return several(out(folder), force, figures, report)


# --- stderr while a command works

_PLACE = re.compile(r"(.+?:\d+:\d+: )(.+)", re.DOTALL)  # of a problem that is text already


@dataclass(frozen=True)
class Reporter:
    """Writes to stderr. ``level`` 0: errors only; 1: warnings, progress; 2, 3: all, and the log."""

    level: int = 1
    progress: Progress = field(default_factory=Progress)

    def stage(self, line: str) -> None:
        """Progress of long work."""
        if self.level > 1:
            say([line])
        elif self.level > 0:
            self.progress(line)

    def note(self, line: str) -> None:
        """A line that stays."""
        say([line] if self.level > 0 else ())

    def warn(self, warnings: Iterable[Problem | str]) -> None:
        """``file:line:column: warning: path: message``, or without a place."""
        for warning in dict.fromkeys(map(str, warnings)) if self.level > 0 else ():
            located = _PLACE.fullmatch(warning)
            place, message = located.groups() if located else ("", warning)
            say([f"{place}warning: {message}"])

    def error(self, line: str) -> None:
        """Why the exit code will not be 0."""
        say([f"eigassign: {line}"])


@contextmanager
def reporting(how: Mapping[str, Any]) -> Iterator[Reporter]:
    """A reporter of the level that ``--quiet`` and ``-v`` ask for; the package's log on stderr."""
    level = 0 if how["quiet"] else 1 + how["verbose"]
    handler = _Handler()
    ours = logging.getLogger("eigassign")
    before = ours.level
    ours.addHandler(handler)
    ours.setLevel((logging.ERROR, logging.WARNING, logging.INFO, logging.DEBUG)[min(level, 3)])
    try:
        yield (reporter := Reporter(level))
        reporter.progress("")
    finally:
        ours.removeHandler(handler)
        ours.setLevel(before)


class _Handler(logging.Handler):
    """``warning: text``, as all else on stderr."""

    def emit(self, record: logging.LogRecord) -> None:
        say([f"{record.levelname.lower()}: {self.format(record)}"])


_UNASKED = {"use_cache": False, "figures": (), "report": "none", "study": "none"}


def run_options(how: Mapping[str, Any], reporter: Reporter) -> Options:
    """The options of the command line that are those of a run; what a command lacks it is not."""
    from eigassign.pipeline.stages import Options

    own = {field.name for field in fields(Options)}
    given = {name: value for name, value in {**_UNASKED, **how}.items() if name in own}
    return Options(**given, progress=reporter.stage)


# --- stdout


def show(*lines: str) -> None:
    """Lines on stdout, without raw escapes and ends of lines of a name in them."""
    for line in lines:
        click.echo(printable(line))


def print_json(value: object, indent: int | None = None) -> None:
    """`plain` values on stdout, as JSON in ASCII, which every terminal shows."""
    click.echo(json_text.dumps(plain(value), indent=indent, allow_nan=False))
