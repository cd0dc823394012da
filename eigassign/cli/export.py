"""Files for other programs and for people: `animate`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import eigassign.cli.arguments as arguments
from eigassign.cli.reporter import reporting


@click.command(
    epilog=arguments.examples(
        "eigassign animate planar_arm.yaml arm.gif",
        'eigassign animate planar_arm.yaml second.png --mode 2 --q "30 deg, 90 deg"',
    )
)
@arguments.case
@click.argument("file", required=False, type=arguments.PATH)
@click.option(
    "--mode", type=click.IntRange(1), help="A mode's shape (default: the motion instead)."
)
@arguments.pose
@click.option("--trajectory", metavar="NAME", help="One of several (default: the first).")
@arguments.common
def animate(
    case: Path,
    file: Path | None,
    mode: int | None,
    q: str | None,
    y: str | None,
    trajectory: str | None,
    **how: Any,
) -> int:
    """Animate the motion along the trajectory, or with --mode the shape of a mode.

    FILE is a GIF, or an animated PNG by its ending; results/<case>_motion.gif or
    results/<case>_mode_1.gif without one. A file that is there is replaced.
    """
    from eigassign.pipeline.animation import animate as animated
    from eigassign.study.built_case import load_case

    if file is None:
        what = "motion" if mode is None else f"mode_{mode}"
        file = Path("results", f"{case.stem}_{what}.gif")
    with reporting(how) as reporter:
        loaded = load_case(case, how["allow_outside"])
        reporter.stage("drawing the frames")
        animated(loaded, file, mode, q, y, trajectory)
    click.echo(f"{file} written")
    return 0
