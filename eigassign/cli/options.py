"""Options and arguments that several commands share."""

from __future__ import annotations

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


PATH = click.Path(path_type=Path)
POSITIVE = click.FloatRange(0.0, min_open=True)
case = click.argument("case", type=PATH)
json = click.option("--json", "as_json", is_flag=True, help="Print JSON, and nothing else.")
common = several(
    click.option("--quiet", is_flag=True, help="Only errors on stderr."),
    click.option("-v", "--verbose", count=True, help="More on stderr; -vv for all."),
    click.option("--debug", is_flag=True, help="Show the traceback of an error."),
)
cache_dir = click.option(
    "--cache-dir",
    type=PATH,
    help="Cache folder (default: $EIGASSIGN_CACHE_DIR, else the user's cache folder).",
)
caching = several(
    click.option("--no-cache", is_flag=True, help="Neither read nor write the cache."), cache_dir
)
force = click.option("--force", is_flag=True, help="Move what is in the way aside, whatever it is.")
running = several(
    click.option("--out", type=PATH, help="Run folder (default: results/<case>)."),
    caching,
    force,
)
