"""report.html: one file that needs no other, no network and no script.

Everything a run shows, written into a folder.

What `eigassign modes --draw` leaves: figures, and the shapes as numbers.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined, Template

from eigassign._version import __version__
from eigassign.output import results_json
from eigassign.output import results_json as samples_csv
from eigassign.output.figures import modes, plan
from eigassign.output.figures import plan as figures
from eigassign.output.figures.plan import FigurePlan
from eigassign.output.formats import percent
from eigassign.output.tables import Table, tables
from eigassign.study.results import ErrorSummary, ModePictures, RunResults

if TYPE_CHECKING:
    from eigassign.chart.results import Chart


# --- report.html: one file that needs no other, no network and no script

_TEMPLATES = Path(__file__).parent / "templates"


def to_html(results: RunResults, plans: Sequence[FigurePlan], images: Mapping[str, bytes]) -> bytes:
    """The report as UTF-8; ``images`` holds the PNG file of every plan by its file name."""
    return page(results, results.error, tables(results), plans, images)


def page(
    f: RunResults | Chart,
    error: ErrorSummary | None,
    shown: Sequence[Table],
    plans: Sequence[FigurePlan],
    images: Mapping[str, bytes],
) -> bytes:
    """Any page of ours: what ``f`` is about, then tables, warnings and notes, then figures."""
    html = _template().render(
        f=f,
        error=error,
        tables=shown,
        plans=plans,
        images={name: base64.b64encode(data).decode() for name, data in images.items()},
    )
    return (html + "\n").encode("utf-8", "xmlcharrefreplace")


@cache
def _template() -> Template:
    """The page's template, compiled once a process."""
    environment = Environment(
        loader=FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["percent"] = percent
    return environment.get_template("report.html.j2")


# --- Everything a run shows, written into a folder


def write_run(results: RunResults, folder: Path) -> None:
    """results.json, report.html, CSV files and figures/*.png in ``folder``.

    It must exist and be empty. Wrap it in :func:`eigassign.output.run_folder.run_folder` to have
    them whole or not at all.
    """
    (folder / "results.json").write_bytes(results_json.to_json(results))
    for name, data in samples_csv.sample_files(results).items():
        (folder / name).write_bytes(data)
    plans = figures.plan(results)
    images = figures.render(plans) if plans else {}
    (folder / "figures").mkdir()
    for name, data in images.items():
        (folder / "figures" / name).write_bytes(data)
    (folder / "report.html").write_bytes(to_html(results, plans, images))


# --- What `eigassign modes --draw` leaves: figures, and the shapes as numbers


def write_modes(pictures: ModePictures, folder: Path) -> None:
    """figures/mode_1.png, … and modes.json."""
    (folder / "figures").mkdir()
    for name, data in plan.render(modes.plan_modes(pictures)).items():
        (folder / "figures" / name).write_bytes(data)
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
