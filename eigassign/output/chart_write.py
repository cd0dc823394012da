"""chart.json, report.html and the figures of a chart, written into a folder."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from eigassign.output import figures, report
from eigassign.output.chart_figures import plan
from eigassign.output.chart_tables import tables
from eigassign.output.figures import FigurePlan
from eigassign.output.results_json import dumps
from eigassign.study.chart_data import Chart
from eigassign.study.chart_follow import SCHEMA


def write_chart(chart: Chart, folder: Path) -> None:
    """Into ``folder``, which must exist: chart.json, report.html, figures/*.png."""
    (folder / "chart.json").write_text(to_json(chart), encoding="utf-8")
    plans = plan(chart)
    images = figures.render(plans) if plans else {}
    (folder / "figures").mkdir()
    for name, data in images.items():
        (folder / "figures" / name).write_bytes(data)
    (folder / "report.html").write_bytes(to_html(chart, plans, images))


def to_json(chart: Chart) -> str:
    """All that a chart holds; every point can be computed again from its parameters."""
    return dumps(_finite({"schema": SCHEMA, **asdict(chart)})) + "\n"


def _finite(value: Any) -> Any:
    """Numbers that JSON has not, of methods that gave none, as null."""
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def to_html(chart: Chart, plans: Sequence[FigurePlan], images: Mapping[str, bytes]) -> bytes:
    """The report as UTF-8; ``images`` holds the PNG file of every plan by its file name."""
    return report.page(chart, None, tables(chart), plans, images)
