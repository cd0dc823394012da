"""Options and arguments that several commands share."""

from __future__ import annotations

import math
import re
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


class Shard(click.ParamType):  # type: ignore[type-arg] # no generic one before click 8.4
    """``2/8``: the second of eight parts."""

    name = "shard"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int]:
        """``value`` as (i, n), or a usage error at its option."""
        if isinstance(value, tuple):
            return value
        found = re.fullmatch(r"([0-9]{1,9})/([0-9]{1,9})", value)
        i, n = map(int, found.groups()) if found else (0, 0)
        if not 1 <= i <= n:
            self.fail(f"{value!r} is not I/N with 1 <= I <= N, as 2/8.", param, ctx)
        return i, n


class Age(click.ParamType):  # type: ignore[type-arg]
    """``30d``: so many seconds."""

    name = "age"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """``value`` in seconds, or a usage error at its option."""
        found = re.fullmatch(r"([0-9]{1,9}) ?([hdw])", value)
        if found is None:
            self.fail(f"{value!r} is no age, as 12h, 30d or 8w.", param, ctx)
        return int(found[1]) * {"h": 3600.0, "d": 86400.0, "w": 604800.0}[found[2]]


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
LIMIT = Number(0.0, 1e9, min_open=True)  # s or MB; systems count them in 64 bits
COUNT = Number(1.0)
ACCURACY = Number(1e-15, 1.0, max_open=True)  # relative; double precision ends at 2e-16
case = click.argument("case", type=PATH)
pose = several(
    click.option(
        "--q",
        metavar="VALUES",
        help="Pose, as '1.817, 5.312' or '104 deg, 304 deg' (default: the case's expansion point, "
        "or where its trajectory starts).",
    ),
    click.option(
        "--y",
        metavar="VALUES",
        help="Design, as '0.125, 0.125' or '125 g, 0' (default: as written in the case).",
    ),
)
json = click.option("--json", "as_json", is_flag=True, help="Print JSON, and nothing else.")
common = several(
    click.option("--quiet", is_flag=True, help="Only errors on stderr."),
    click.option("-v", "--verbose", count=True, help="More on stderr (-vv: all)."),
    click.option("--debug", is_flag=True, help="Show the traceback of an error."),
    click.option(
        "--allow-outside",
        is_flag=True,
        help="Cases may name files that do not lie below their own folder.",
    ),
)
cache_dir = click.option(
    "--cache-dir",
    type=PATH,
    help="Cache folder (default: $EIGASSIGN_CACHE_DIR, else the user's cache folder).",
)
caching = several(
    click.option(
        "--no-cache",
        is_flag=True,
        help="Neither read nor write the cache. $EIGASSIGN_CACHE says what is cached: always, "
        "never, or auto, what takes more than 0.1 s to compute (the default).",
    ),
    cache_dir,
)
force = click.option(
    "--force",
    is_flag=True,
    help="Move what is in the way aside, whatever it is; without it the command stops.",
)
figures = click.option(
    "--figures",
    callback=figure_formats,
    metavar="FORMATS",
    default="png",
    show_default=True,
    help="Formats of the figures: png, svg, pdf, a comma between; or none.",
)


against = several(
    click.option(
        "--against",
        type=PATH,
        metavar="PREVIOUS",
        help="Name what has moved since: a results folder, results.json, summary.json, or what "
        "validate --json printed (default: nothing is compared).",
    ),
    click.option(
        "--tolerance",
        type=Number(0.0),
        metavar="HZ",
        default=0.01,
        show_default=True,
        help="How far frequencies may be from those of --against.",
    ),
)


def report_of(usual: str) -> Callable[[F], F]:
    """``--report`` with its default."""
    return click.option(
        "--report",
        type=click.Choice(["full", "light", "none"]),
        default=usual,
        show_default=True,
        help="report.html: full moves and zooms (5 MB); light has pictures, no script; or none.",
    )


report = report_of("full")


def running(folder: str = "results/<case>", usual: str = "full") -> Callable[[F], F]:
    """The options of a command that leaves a run folder: ``folder`` and ``usual`` by default."""
    out = click.option("--out", type=PATH, help=f"Folder of the run (default: {folder}).")
    return several(out, caching, force, figures, report_of(usual))
