"""What every command shares: how it speaks on stderr, and JSON on stdout."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager
from typing import Any

import click

from eigassign.teller import Teller
from eigassign.teller import telling as telling_at


def telling(how: Mapping[str, Any]) -> AbstractContextManager[Teller]:
    """A teller as loud as ``--quiet`` and ``-v`` say."""
    return telling_at(how["verbose"], how["quiet"])


def print_json(value: object, indent: int | None = None) -> None:
    """``value`` on stdout, as JSON."""
    from eigassign.plain_json import dumps

    click.echo(dumps(value, indent))
