"""Files for other programs: `export`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import eigassign.cli.arguments as arguments
from eigassign.cli.reporter import print_json, reporting, show


@click.command(
    epilog=arguments.examples(
        "eigassign export planar_arm.yaml arm.npz",
        "eigassign export planar_arm.yaml arm.mat --mode 1 --mode 2",
        "eigassign export planar_arm.yaml arm.c --accuracy 1e-8",
    )
)
@arguments.case
@click.argument("file", type=arguments.PATH)
@click.option(
    "--mode", "modes", type=click.IntRange(1), multiple=True, help="Mode, repeatable (default: 1)."
)
@click.option(
    "--accuracy",
    type=arguments.ACCURACY,
    default=1e-6,
    show_default=True,
    help="Largest estimated error of a frequency, relative.",
)
@arguments.json
@arguments.common
def export(
    case: Path, file: Path, modes: tuple[int, ...], accuracy: float, as_json: bool, **how: Any
) -> int:
    """Write a reduced model for NumPy, MATLAB or C.

    The model gives frequencies at any pose q and design y without mesh and mechanism. The ending of
    FILE decides its format: .npz for NumPy, .mat for MATLAB and Octave, .c for C99, .h5 for
    eigassign. Its estimated error is below --accuracy along the trajectory and within the bounds of
    the design. An existing FILE is replaced.
    """
    from eigassign.pipeline.export import export as exported
    from eigassign.study.built_case import load_case

    with reporting(how) as reporter:
        loaded = load_case(case, how["allow_outside"])
        reporter.stage("reducing the model")
        made = exported(loaded, file, modes or (1,), accuracy)
    if as_json:
        print_json(vars(made))
        return 0
    numbers = ", ".join(map(str, made.modes))
    show(f"{' and '.join(map(str, made.files))} written")
    show(
        f"  modes {numbers}: {made.size} unknowns, expansion points {made.points}; error estimate "
        f"at most {made.error_estimate:.1e} at {made.samples} poses and designs"
    )
    return 0
