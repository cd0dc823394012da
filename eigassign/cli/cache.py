"""The expansions kept from earlier runs: `cache`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

import eigassign.cli.arguments as arguments
from eigassign.errors import UsageError

if TYPE_CHECKING:
    from eigassign.output.store.cache import Cache


@click.group(epilog=arguments.examples("eigassign cache list", "eigassign cache clear"))
def cache() -> None:
    """Show or clear what was kept from earlier runs."""


@cache.command("path", epilog=arguments.examples("eigassign cache path"))
@arguments.cache_dir
def cache_path(cache_dir: Path | None) -> int:
    """Print the cache folder."""
    click.echo(str(_cache(cache_dir).directory))
    return 0


@cache.command(
    "clear",
    epilog=arguments.examples("eigassign cache clear", "eigassign cache clear --older-than 30d"),
)
@click.option(
    "--older-than",
    "older_than_s",
    type=arguments.Age(),
    metavar="AGE",
    help="Only what was written so long ago, as 12h, 30d or 8w (default: everything).",
)
@arguments.cache_dir
def cache_clear(older_than_s: float | None, cache_dir: Path | None) -> int:
    """Delete all files in the cache, or old ones.

    Above 1 GB the oldest files go by themselves.
    """
    found = _cache(cache_dir)
    count = found.clear() if older_than_s is None else found.clear(older_than_s)
    click.echo(f"{count} file{'' if count == 1 else 's'} deleted")
    return 0


@cache.command("list", epilog=arguments.examples("eigassign cache list"))
@arguments.cache_dir
def cache_list(cache_dir: Path | None) -> int:
    """List the files in the cache, oldest first."""
    from eigassign.output.console import print_tables
    from eigassign.output.tables import Table

    rows = tuple(
        (
            entry.key[:12],
            f"{entry.size_bytes / 1000:.1f}",
            "; ".join(f"{k} {v}" for k, v in entry.meta.items()) if entry.intact else "damaged",
        )
        for entry in _cache(cache_dir).entries()
    )
    print_tables([Table("", ("key", "kB", "what"), rows)])
    return 0


def _cache(directory: Path | None) -> Cache:
    from eigassign.output.store.cache import Cache, default_directory

    found = default_directory() if directory is None else directory
    if found is None:
        raise UsageError("there is no home folder for a cache: name one with --cache-dir")
    return Cache(found)
