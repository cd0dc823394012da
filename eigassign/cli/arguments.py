"""Options and arguments that several commands share."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

F = TypeVar("F", bound=Callable[..., Any])


def several(*options: Callable[[F], F]) -> Callable[[F], F]:
    """Several options as one decorator."""

    def decorate(command: F) -> F:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


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
POSITIVE = Number(0.0, min_open=True)
LIMIT = Number(0.0, 1e9, min_open=True)  # s, which systems count in 64 bits
COUNT = Number(1.0)
ACCURACY = Number(1e-15, 1.0, max_open=True)  # relative; double precision ends at 2e-16
case = click.argument("case", type=PATH)
pose = several(
    click.option(
        "--q",
        metavar="VALUES",
        help="Pose, such as '1.817, 5.312' or '104 deg, 304 deg' (default: the expansion point of "
        "the case, or the start of its trajectory).",
    ),
    click.option(
        "--y",
        metavar="VALUES",
        help="Design, such as '0.125, 0.125' or '125 g, 0' (default: as the case file has it).",
    ),
)
json = click.option("--json", "as_json", is_flag=True, help="Print JSON instead of tables.")
common = several(
    click.option("--quiet", is_flag=True, help="Print only errors on stderr."),
    click.option("-v", "--verbose", count=True, help="Print more on stderr (-vv: everything)."),
    click.option("--debug", is_flag=True, help="Print the traceback of an error."),
    click.option(
        "--allow-outside",
        is_flag=True,
        help="Let cases name files outside their own folder.",
    ),
)
cache_dir = click.option(
    "--cache-dir",
    type=PATH,
    metavar="FOLDER",
    help="Cache folder (default: $EIGASSIGN_CACHE_DIR, else the user's cache folder).",
)
caching = several(
    click.option(
        "--no-cache",
        is_flag=True,
        help="Neither read nor write the cache. $EIGASSIGN_CACHE is auto (keep what took over "
        "0.1 s to compute; the default), always or never.",
    ),
    cache_dir,
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
