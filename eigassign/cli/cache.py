"""The expansions kept from earlier runs: `cache`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

import eigassign.cli.arguments as arguments
from eigassign.errors import UsageError

if TYPE_CHECKING:
    from eigassign.output.store.cache import Cache


@click.group(epilog=arguments.examples("eigassign cache path", "eigassign cache clear"))
def cache() -> None:
    """Find or clear what was kept from earlier runs."""


@cache.command("path", epilog=arguments.examples("eigassign cache path"))
@arguments.cache_dir
def cache_path(cache_dir: Path | None) -> int:
    """Print the cache folder."""
    click.echo(str(_cache(cache_dir).directory))
    return 0


@cache.command("clear", epilog=arguments.examples("eigassign cache clear"))
@arguments.cache_dir
def cache_clear(cache_dir: Path | None) -> int:
    """Delete all files in the cache.

    Above 1 GB the oldest files go by themselves.
    """
    count = _cache(cache_dir).clear()
    click.echo(f"{count} file{'' if count == 1 else 's'} deleted")
    return 0


def _cache(directory: Path | None) -> Cache:
    from eigassign.output.store.cache import Cache, default_directory

    found = default_directory() if directory is None else directory
    if found is None:
        raise UsageError("there is no home folder for a cache: name one with --cache-dir")
    return Cache(found)
