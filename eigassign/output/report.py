"""report.html: one file that needs no other, no network and no script."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from jinja2 import Environment, FileSystemLoader, StrictUndefined, Template

from eigassign.output.figures import FigurePlan
from eigassign.output.formats import percent
from eigassign.output.summary import Table, tables
from eigassign.study.findings import ErrorSummary, Findings

if TYPE_CHECKING:
    from eigassign.study.chart_data import Chart

_TEMPLATES = Path(__file__).parent / "templates"


def to_html(findings: Findings, plans: Sequence[FigurePlan], images: Mapping[str, bytes]) -> bytes:
    """The report as UTF-8; ``images`` holds the PNG file of every plan by its file name."""
    return page(findings, findings.error, tables(findings), plans, images)


def page(
    f: Findings | Chart,
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
