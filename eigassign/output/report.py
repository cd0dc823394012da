"""report.html, one file that needs no other, no network and no script; and folders full of results.

A page shows what a run or a chart found: tables, warnings and notes, figures. `write_run` leaves
everything that a run shows, `write_modes` the mode shapes as figures and as numbers.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eigassign._version import __version__
from eigassign.output.figures.modes import mode_figures
from eigassign.output.figures.run import run_figures
from eigassign.output.figures.style import FigurePlan, render
from eigassign.output.formats import percent
from eigassign.output.result_files import sample_files, to_json
from eigassign.output.tables import Table, headline, tables
from eigassign.study.results import ModePictures, RunResults

if TYPE_CHECKING:
    from jinja2 import Template

    from eigassign.chart.results import Chart
    from eigassign.study.updating.fit import UpdateResults

# --- The page

_TEMPLATES = Path(__file__).parent / "templates"
_EMBEDDED = {".png": "image/png", ".svg": "image/svg+xml"}  # the first that there is


def to_html(results: RunResults, plans: Sequence[FigurePlan], files: Mapping[str, bytes]) -> bytes:
    """The report of a run as UTF-8; ``files`` holds what `render` made of ``plans``."""
    return page(results, headline(results), tables(results), plans, files)


def page(
    f: RunResults | Chart | UpdateResults,
    line: str | None,
    shown: Sequence[Table],
    plans: Sequence[FigurePlan],
    files: Mapping[str, bytes],
) -> bytes:
    """Any page of ours: what ``f`` is about, its headline ``line``, tables, notes, figures.

    A figure that was written as PDF only is named in its place; of one that was not written
    nothing is said.
    """
    figures = []
    for plan in plans:
        own = {Path(name).suffix: name for name in files if Path(name).stem == plan.name}
        kind = next((kind for kind in _EMBEDDED if kind in own), None)
        image = None
        if kind is not None:
            text = base64.b64encode(files[own[kind]]).decode()
            image = f"data:{_EMBEDDED[kind]};base64,{text}"
        if own:
            figures.append((plan, image, list(own.values())))
    html = _template().render(f=f, headline=line, tables=shown, figures=figures)
    return (html + "\n").encode("utf-8", "xmlcharrefreplace")


@cache
def _template() -> Template:
    """The page's template, compiled once a process."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["percent"] = percent
    return environment.get_template("report.html.j2")


# --- What is left in a folder


def write_run(results: RunResults, folder: Path, formats: Sequence[str] = ("png",)) -> None:
    """results.json, report.html, CSV files and the figures in these formats, in ``folder``.

    It must exist and be empty. Wrap it in :func:`eigassign.output.run_folder.run_folder` to have
    them whole or not at all.
    """
    (folder / "results.json").write_bytes(to_json(results))
    for name, data in sample_files(results).items():
        (folder / name).write_bytes(data)
    plans = run_figures(results)
    files = write_figures(plans, folder, formats)
    (folder / "report.html").write_bytes(to_html(results, plans, files))


def write_figures(
    plans: Sequence[FigurePlan], folder: Path, formats: Sequence[str]
) -> dict[str, bytes]:
    """figures/NAME.FORMAT in ``folder``, each figure in each format; the files by their name."""
    files = render(plans, formats)
    if files:
        (folder / "figures").mkdir()
    for name, data in files.items():
        (folder / "figures" / name).write_bytes(data)
    return files


def write_modes(pictures: ModePictures, folder: Path, formats: Sequence[str] = ("png",)) -> None:
    """figures/mode_1.png, … and modes.json."""
    write_figures(mode_figures(pictures), folder, formats)
    text = json.dumps(document(pictures), ensure_ascii=False, allow_nan=False)
    (folder / "modes.json").write_text(text + "\n", encoding="utf-8")


def document(pictures: ModePictures) -> dict[str, Any]:
    """The modes as numbers: ``rest`` and, mode by mode, ``deformed`` points of every line in m."""
    rest = pictures.rest
    lines = [
        {
            "link": link,
            "rest": points.tolist(),
            "deformed": [mode[k].tolist() for mode in pictures.deformed.lines],
        }
        for k, (link, points) in enumerate(zip(rest.line_links, rest.lines[0], strict=True))
    ]
    return {
        "eigassign_version": __version__,
        "title": pictures.title,
        "q": {name: {"value": value, "unit": unit} for name, value, unit in pictures.q},
        "y": {name: {"value": value, "unit": unit} for name, value, unit in pictures.y},
        "rigid_modes": pictures.rigid_modes,
        "frequencies_hz": list(pictures.frequencies_hz),
        "amplitude": pictures.amplitude,
        "lines": lines,
    }
