"""Draw the pictures of the how-to pages: `python page_builder/pictures.py`, about a minute.

Each is made from a shipped case: a figure of a command as it is, or a plot of its numbers. They are
small palette PNGs in eigassign/docs/how-to, named after their page, and belong to the site and the
repository; installed packages leave them out.
"""

from __future__ import annotations

import csv
import io
import json
import tempfile
from collections.abc import Callable
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from PIL import Image

import eigassign as ea
from eigassign.cli import main

ROOT = Path(__file__).parents[1]
PAGES = ROOT / "eigassign" / "docs" / "how-to"
COLOURS = 128  # of a palette: figures of lines and areas need no more
LIGHT = ("--study", "none", "--report", "none")
BLUE, GREEN, ORANGE = "#0072b2", "#009e73", "#d55e00"


def run(command: str, case: str, *options: str) -> Path:
    """The folder of a command's result for a shipped case or starter."""
    path = ROOT / "cases" / f"{case}.yaml"
    path = path if path.exists() else ROOT / "eigassign" / "starters" / f"{case}.yaml"
    folder = Path(f"{case}_{command}")
    out = () if command == "check" else ("--out", str(folder))
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        assert main([command, str(path), *out, *options, "--quiet"]) in (0, 1)
    return Path("results", f"{case}_check") if command == "check" else folder


def figure(command: str, case: str, name: str, *options: str) -> Callable[[], Image.Image]:
    """A figure that a command writes."""
    return lambda: Image.open(run(command, case, *options) / "figures" / f"{name}.png")


def plotted(title: str, x: str, y: str, height: float = 3.2) -> tuple[Figure, plt.Axes]:
    """A figure as wide as those of runs, with named axes."""
    made, axes = plt.subplots(figsize=(8.0, height), dpi=110, layout="constrained")
    axes.set_title(title, loc="left", fontsize=10, fontweight="bold")
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(color="#e5e5e5")
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    return made, axes


def as_image(made: Figure) -> Image.Image:
    """A plot as pixels."""
    data = io.BytesIO()
    made.savefig(data)
    plt.close(made)
    return Image.open(data)


def json_of(*command: str) -> dict:
    """What a command prints with --json."""
    said = io.StringIO()
    with redirect_stdout(said):
        assert main([*command, "--json", "--quiet"]) == 0
    return json.loads(said.getvalue())


def combinations() -> Image.Image:
    """The best combinations of sections for the scissor lift."""
    folder = run("optimize", "scissor_lift", *LIGHT, "--figures", "none")
    found = json.loads((folder / "results.json").read_text())["assignment"]["catalogue"]["best"]
    plot, axes = plotted("Scissor lift: the five best combinations", "mass [kg]", "price")
    for k, one in enumerate(found):
        axes.plot(one["mass"], one["price"], "o", color=ORANGE if k == 0 else BLUE, markersize=8)
        arms, deck, screw = (one["choices"][name] for name in ("arms", "deck", "screw"))
        label = f"{arms}, {deck}, {float(screw) / 1e6:g} MN/m"
        axes.annotate(label, (one["mass"], one["price"]), (8, -3), textcoords="offset points")
    axes.margins(x=0.3, y=0.2)
    return as_image(plot)


def levers() -> Image.Image:
    """What 1 % more of each property does to mode 1 of the six-axis arm."""
    made = json_of("modes", str(ROOT / "cases" / "arm_6r.yaml"), "--count", "1")
    rows = made["levers"][:12][::-1]
    plot, axes = plotted("Six-axis arm, mode 1: 1 % more of", "change of the frequency [%]", "")
    axes.barh([one["property"] for one in rows], [one["percent_per_percent"] for one in rows])
    return as_image(plot)


def under_weight() -> Image.Image:
    """The first frequency of the crane boom over its angle, with and without gravity."""
    text = (ROOT / "cases" / "crane_boom.yaml").read_text()
    plot, axes = plotted("Crane boom with 8 t at its tip", "luffing angle [deg]", "mode 1 [Hz]")
    angles = np.linspace(10.0, 80.0, 36)
    q = np.column_stack([np.deg2rad(angles), np.full(len(angles), 7000.0)])
    for gravity, colour, words in (
        ("[0, -9.81]", BLUE, "under its weight"),
        ("none", ORANGE, "gravity: none"),
    ):
        assert "gravity: [0, -9.81]" in text
        Path("boom.yaml").write_text(text.replace("gravity: [0, -9.81]", f"gravity: {gravity}"))
        case = ea.load_case("boom.yaml")
        hz = case.model().frequencies(q, case.initial_design, count=1)
        axes.plot(angles, hz[:, 0], color=colour, label=words)
    axes.legend(frameon=False)
    return as_image(plot)


def sweep() -> Image.Image:
    """What the variants of a sweep come to."""
    settings = ("--set", "targets.0.frequency=180..200:9")
    settings += ("--set", "design.m1.max=100 g,200 g,300 g")
    folder = run("batch", "two_link", *settings, "--reports", "none", "--jobs", "1")
    with open(folder / "summary.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    most, wanted = "design.m1.max", "targets.0.frequency"
    plot, axes = plotted("Paper's arm: a sweep of 27 variants", "target [Hz]", "worst error [%]")
    values = dict.fromkeys(row[most] for row in rows)
    for colour, value in zip((BLUE, GREEN, ORANGE), values, strict=True):
        own = [row for row in rows if row[most] == value]
        x = [float(row[wanted].split()[0]) for row in own]
        y = [100.0 * float(row["exact_max_relative"]) for row in own]
        axes.plot(x, y, "o-", color=colour, label=f"at most {value} at the elbow")
    axes.legend(frameon=False)
    return as_image(plot)


PICTURES: dict[str, Callable[[], Image.Image]] = {
    "own-arm": figure("check", "planar_arm", "mechanism", "--draw"),
    "objective": figure("optimize", "camera_arm", "frequencies", *LIGHT),
    "imported-part": figure("modes", "superelement_arm", "mode_1", "--count", "1"),
    "solid-part": figure("modes", "casting_arm", "mode_1", "--count", "1"),
    "what-would-help": levers,
    "at-the-tool": figure("response", "milling_arm", "response_1", "--report", "none"),
    "static-stiffness": figure("optimize", "drilling_arm", "statics", *LIGHT),
    "fastest-move": figure("optimize", "scara", "lobes_1", *LIGHT),
    "keep-out-bands": figure("optimize", "milling_column", "frequencies", *LIGHT),
    "catalogue": combinations,
    "link-lengths": figure("optimize", "arm_lengths", "mechanism", *LIGHT),
    "under-load": under_weight,
    "updating": figure("update", "arm_update", "parameters", "--report", "none"),
    "parallelogram": figure("check", "palletiser", "mechanism", "--draw"),
    "ci": figure("expand", "two_link", "approximation_mode_1_time", "--report", "none"),
    "cluster": sweep,
}


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        for page, made in PICTURES.items():
            picture = made().convert("RGB").quantize(COLOURS)
            picture.save(PAGES / f"{page}.png", optimize=True)
