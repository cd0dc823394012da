"""The command line: the only place that prints, catches errors and sets exit codes.

stdout carries results, stderr everything else. Only click is imported here at the top; what a
command needs is imported when it runs, so that ``--help`` is instant.

Reading order:

    arguments  what several commands share: options, what is written on stderr, JSON
    runs       optimize, compare, expand, response, update, validate, chart
    inspect    check, modes, schema, init, docs
    batch      batch
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import suppress

import click

import eigassign.cli.arguments as arguments
from eigassign import process
from eigassign._version import __version__
from eigassign.cli.arguments import print_json
from eigassign.cli.batch import batch
from eigassign.cli.inspect import check, docs, init, modes, schema
from eigassign.cli.inspect import results_schema as results_schema
from eigassign.cli.runs import chart, compare, expand, optimize, response, update, validate
from eigassign.errors import UsageError


def main(args: Sequence[str] | None = None) -> int:
    """Run the command line on ``args`` (default: those of the process); returns the exit code."""
    arguments = sys.argv[1:] if args is None else list(args)
    process.prefer_one_thread()
    process.refuse_closed_stdout()
    process.replace_what_cannot_be_encoded()
    try:
        with process.terminable():
            code = _invoke(arguments)
            process.flush_streams()
            return code
    except BaseException as error:
        return _reported(error, arguments)


def _reported(error: BaseException, arguments: list[str]) -> int:
    """Say what went wrong on stderr, and with --json on stdout too; the exit code."""
    code = process.report(error, debug="--debug" in arguments)
    with suppress(OSError):  # the streams are silenced then, and the code is that of the error
        if "--json" in arguments:
            print_json(process.document(error))
        process.flush_streams()
    return code


def _invoke(arguments: list[str]) -> int:
    """Run the command as click's ``main`` would, which has exit codes of its own."""
    try:
        with cli.make_context("eigassign", arguments) as context:
            return int(cli.invoke(context) or 0)
    except click.exceptions.Exit as done:
        return done.exit_code
    except click.ClickException as error:
        error.show()
        if "--json" in arguments:
            print_json(process.document(UsageError(error.format_message())))
        return error.exit_code


class _InOrder(click.Group):
    """Lists its commands in the order in which they are needed, those of every day first."""

    def list_commands(self, _context: click.Context) -> list[str]:
        return list(self.commands)

    def resolve_command(
        self, context: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args[0] not in self.commands and args[0].endswith((".yaml", ".yml")):
            context.fail(f"{args[0]!r} is a case: say what to do, 'eigassign check {args[0]}'.")
        return super().resolve_command(context, args)

    def format_commands(self, _context: click.Context, formatter: click.HelpFormatter) -> None:
        rows = [(name, each.get_short_help_str(200)) for name, each in self.commands.items()]
        for heading, some in (("Commands", rows[: len(FIRST)]), ("More", rows[len(FIRST) :])):
            with formatter.section(heading):
                formatter.write_dl(some)


@click.group(
    cls=_InOrder,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog=arguments.examples(
        "eigassign init",
        "eigassign check planar_arm.yaml --draw",
        "eigassign optimize planar_arm.yaml",
        "eigassign docs case-file",
    ),
)
@click.version_option(__version__, prog_name="eigassign")
def cli() -> None:
    """Assign the natural frequencies of moving, flexible mechanisms along their trajectory.

    \b
    Exit codes: 0 success; 1 no usable design, an accuracy missed, or a case
    failed; 2 wrong usage or case file; 3 disk, memory or permissions; 4 a bug
    of eigassign; 130 and 143 interrupted and terminated.
    """


FIRST = (init, check, optimize, update, batch, docs)
MORE = (compare, modes, response, expand, validate, chart, schema)
for command in (*FIRST, *MORE):
    cli.add_command(command)
