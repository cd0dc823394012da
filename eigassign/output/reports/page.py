"""report.html, one file that makes no request, from its first screen on; folders full of results.

A page begins with the verdict. A full one plots in the browser with Plotly's own script, which it
carries; a light one shows figures as pictures and has no script. `write_run` leaves everything that
a run shows.
"""

from __future__ import annotations

import base64
import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from eigassign.arrays import Floats
from eigassign.case.units import handy
from eigassign.facts import about, capital, number, percent, positive_percent, priced
from eigassign.files import printable
from eigassign.output.documents import to_json
from eigassign.output.figures.graph import FigurePlan
from eigassign.output.figures.paper import render
from eigassign.output.figures.run import run_figures
from eigassign.output.figures.screen import moving, screen_figure
from eigassign.output.result_files import sample_files
from eigassign.output.tables import SECTIONS, TONES, Table, headline, helps, run_tables, tone_of
from eigassign.study.results import LimitRow, RunResults, TargetStudy, violated

if TYPE_CHECKING:
    from jinja2 import Environment

    from eigassign.chart.results import Chart, Matrix
    from eigassign.output.reports.compare import Compared
    from eigassign.study.updating.fit import UpdateResults

TEMPLATES = Path(__file__).parents[1] / "templates"


def today() -> str:
    """The date as people write it, ``26 November 2026``; that of SOURCE_DATE_EPOCH if it is set."""
    given = os.environ.get("SOURCE_DATE_EPOCH", "")
    day = datetime.fromtimestamp(int(given), UTC) if given.isdecimal() else datetime.now()
    return f"{day.day} {day:%B %Y}"


def page_of(name: str, **shown: Any) -> bytes:
    """The page of the template ``name`` as UTF-8."""
    html = _environment().get_template(name).render(**shown)
    return (html + "\n").encode("utf-8", "xmlcharrefreplace")


@cache
def _environment() -> Environment:
    """Templates are compiled once a process."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup, escape

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )

    def words(text: str) -> Markup:
        """Text with what stands between backticks as code, and no markup of its own."""
        return Markup(re.sub("`([^`]+)`", r"<code>\1</code>", str(escape(text))))

    dotted = re.compile(r"(?<=[\w\]])\.(?=[a-z_])")  # in key paths: they go on in a new line
    environment.filters |= {"words": words, "number": number, "printable": printable}
    environment.filters["dotted"] = lambda text: Markup(dotted.sub(".<wbr>", text))
    return environment


def inside(data: Any) -> str:
    """JSON that no browser takes for the end of its script."""
    text = json.dumps(data, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


# --- The first screen

MOST = 8  # findings on the first screen


@dataclass(frozen=True)
class Finding:
    """One target before and after, in words, in a tone, and what else there is to say of it."""

    label: str
    before: str
    after: str
    tone: str
    more: tuple[str, ...] = ()


@dataclass(frozen=True)
class FirstScreen:
    """The first screen."""

    word: str
    tone: str  # good | fair | bad
    sentence: str  # what follows the word in the headline
    helps: tuple[str, ...]  # where a target is missed
    findings: tuple[Finding, ...]
    cost: tuple[str, ...]
    trust: tuple[str, ...]


def verdict_of(results: RunResults) -> FirstScreen | None:
    """The first screen of a run, if it has a design; the verdict is of `study.design.judgement`."""
    row = results.assignment
    if row is None:
        return None
    aim, tone = row.aim, TONES.get(row.verdict, "bad")
    findings = [] if aim is None else [Finding(capital(aim.label), aim.before, aim.after, tone)]
    targets = (target for target in results.targets if not target.asked.is_aim)
    thin = {one.label for one in results.thin}
    word, _, sentence = (headline(results) or "").partition(": ")
    static = {one.name for one in results.statics}
    broken = [r for r in row.limits if r.violation or r.initial_violation or r.name in static]
    findings += [
        *map(_kept, broken),
        *(_finding(one, row.max_error, one.label in thin) for one in targets),
    ]
    return FirstScreen(
        word=word,
        tone=tone_of(results),
        sentence=sentence,
        helps=tuple(helps(results)),
        findings=tuple(findings[:MOST]),
        cost=tuple(_cost(results)),
        trust=tuple(_trust(results)),
    )


def _finding(target: TargetStudy, accepted: float, thin: bool) -> Finding:
    """The worst distance before and after, with the rms where that alone fell; of limits theirs."""
    both = target.error.initial, target.error.exact
    before, after = (each.max_relative for each in both)
    more = [f"{_between(target.initial_hz)} → {_between(target.exact_hz)} Hz"]
    better = after < before
    if target.asked.is_goal:
        met, accept = after <= accepted, f"{100 * accepted:.3g} % is accepted"
        said, is_ = percent(before), percent(after)
        first, last = (each.rms_relative for each in both)
        if not better and last < first:
            better, accept = True, f"{accept} at worst"
            pair = f"{percent(first)} and {said}", f"is {percent(last)} off rms, {is_} at worst"
        else:
            accept = f"{percent(first)} → {percent(last)} rms; {accept}"
            pair = said, f"is {is_} off at worst"
        more.insert(0, accept)
    else:
        met = target.satisfied
        pair = violated(before), f"is {violated(after)}"
        more *= len(target.asked.terms) == 1
        if met and target.room is not None:
            more.append(f"room {positive_percent(target.room)}")
    tone = "fair" if thin else "good" if met else "fair" if better else "bad"
    return Finding(capital(target.label), *pair, tone, tuple(more))


def _kept(limit: LimitRow) -> Finding:
    """A limit of a quantity that a design breaks, or of statics, with its amounts."""
    before, after = (handy(each, limit.unit, 4) for each in (limit.initial, limit.optimal))
    tone = "good" if limit.satisfied else "bad"
    return Finding(capital(limit.words), before, f"is {after}", tone)


def _between(hz: Floats) -> str:
    """``186.9–192.6``; one number where they are alike."""
    low, high = f"{np.nanmin(hz):.4g}", f"{np.nanmax(hz):.4g}"
    return low if low == high else f"{low}–{high}"


def _trust(results: RunResults) -> Iterator[str]:
    row = results.assignment
    yield f"Frequencies solved exactly at all {results.time_s.size} samples."
    if row is None:
        return
    if row.model_error != 0.0:
        judged = results.discretisation
        few = judged is not None and judged.poses < results.time_s.size
        where = f" (checked at {judged.poses} samples)" if judged is not None and few else ""
        cause = "of mesh and reduced links" if results.reduced else "of the mesh"
        most = about(np.inf if row.model_error is None else row.model_error)
        yield f"Frequencies are too high because {cause}: {most}{where}."
    yield f"{capital(row.optimality.words)}."
    if not row.finished:
        yield "The search was ended before it was done."
    for clear in row.clearances:
        proof = "checked clear" if clear.clear else "NOT clear"
        below = f"{clear.below} mode{'' if clear.below == 1 else 's'}"
        yield f"{capital(clear.label)}: {proof}, {below} below."
    if row.robust is not None:
        yield f"What robustness costs: {row.robust.words}."


def _cost(results: RunResults) -> Iterator[str]:
    mass = results.mass
    if mass is not None:
        unit, size = mass.handy
        before, after = mass.initial / size, mass.optimal / size
        added = f"{after - before:+.4g} {unit}".replace("-", "−")
        added = added if number(after - before) != "0" else "unchanged"
        yield f"Mass {number(before)} → {number(after)} {unit} ({added})"
    if results.price is not None:
        whole = any(row.choice_price is not None for row in results.design)
        yield f"Price: {priced(results.price, whole)}"


# --- The page

_EMBEDDED = {".png": "image/png", ".svg": "image/svg+xml"}  # the first that there is


@dataclass(frozen=True)
class Shown:
    """One figure on a page: a plot of this height in pixels, or a picture, or the files' names."""

    plan: FigurePlan
    height: int | None = None
    image: str | None = None
    files: tuple[str, ...] = ()


def page(
    f: RunResults | Chart | Matrix | UpdateResults | Compared,
    shown: Sequence[Table],
    plans: Sequence[FigurePlan],
    files: Mapping[str, bytes],
    *,
    line: str | None = None,
    tone: str = "fair",
    headings: Mapping[str, str] = SECTIONS,
    full: bool = True,
    document: tuple[str, bytes] | None = None,
) -> bytes:
    """Any page of ours as UTF-8; ``files`` holds what `render` made of ``plans``.

    A run begins with its verdict, another page with its ``line`` in a ``tone`` (good, fair, bad),
    and figures of the answer; then come the sections, by key and heading, the appendix folded.
    ``document`` is the file of all numbers, name and content: a full page saves it unless it is
    longer than 400 kB, a tenth of Plotly's script. A light page is at most 1 MB, that it may go by
    mail: pictures for which there is no room are named.
    """
    name, content = document or ("", b"")
    run = f if isinstance(f, RunResults) else None
    graphs = {p.name: screen_figure(p.shows) for p in plans if full and not p.shows.sheet}
    moved = run.moving if run is not None and full else ()
    kept = full and len(content) <= 400_000
    figures = list(_shown(plans, graphs, files, 900_000))
    return page_of(
        "report.html.j2",
        f=f,
        case=f.case,
        verdict=None if run is None else verdict_of(run),
        headline=line,
        tone=tone,
        date=today(),
        answer=[one for one in figures if one.plan.section == "answer"],
        sections=[*_sections(shown, figures, headings)],
        moving=moved,
        moving_json=inside([*map(moving, moved)]) if full else "",
        figures_json=inside(graphs) if full else "",
        document=content.decode().replace("<", "\\u003c") if kept else "",
        document_name=name,
        plotly=_plotly() if full else "",
        script=(TEMPLATES / "report.js").read_text("utf-8") if full else "",
    )


def _sections(
    tables: Sequence[Table], figures: Sequence[Shown], headings: Mapping[str, str]
) -> Iterator[dict[str, Any]]:
    """The sections that there is something in; what is in none of them is the appendix's."""
    for key, heading in {**headings, "appendix": "Appendix"}.items():
        own = tuple(table for table in tables if table.section == key)
        drawn = tuple(one for one in figures if one.plan.section == key)
        if own or drawn:
            yield {"key": key, "heading": heading, "tables": own, "figures": drawn}


@cache
def _plotly() -> str:
    """Plotly's script, from the package's data: its Python side is never imported."""
    return (resources.files("plotly") / "package_data" / "plotly.min.js").read_text("utf-8")


def _shown(
    plans: Sequence[FigurePlan],
    graphs: Mapping[str, dict[str, Any]],
    files: Mapping[str, bytes],
    room: int,
) -> Iterator[Shown]:
    """Plots where there are any; else pictures while there is room."""
    for plan in plans:
        if plan.name in graphs:
            yield Shown(plan, graphs[plan.name]["layout"]["height"])
            continue
        own = {Path(name).suffix: name for name in files if Path(name).stem == plan.name}
        kind = next((kind for kind in _EMBEDDED if kind in own), None)
        text = "" if kind is None else base64.b64encode(files[own[kind]]).decode()
        room -= len(text)
        shown = kind is not None and room >= 0
        image = f"data:{_EMBEDDED[kind]};base64,{text}" if kind is not None and shown else None
        if own:
            yield Shown(plan, image=image, files=tuple(own.values()))


# --- What is left in a folder


def write_run(
    results: RunResults, folder: Path, formats: Sequence[str] = ("png",), kind: str = "full"
) -> None:
    """results.json, report.html, CSV files and the figures in these formats, in ``folder``.

    ``kind`` is full, light or none. The folder must exist and be empty. Wrap it in
    :func:`eigassign.output.store.run_folder.run_folder` to have them whole or not at all.
    """
    for name, data in sample_files(results).items():
        (folder / name).write_bytes(data)
    plans = run_figures(results) if formats or kind != "none" else ()
    write_page(
        results, run_tables(results), plans, folder, formats, kind,
        ("results.json", to_json(results)),
    )  # fmt: skip


def write_page(
    f: RunResults | Chart | Matrix | UpdateResults,
    shown: Sequence[Table],
    plans: Sequence[FigurePlan],
    folder: Path,
    formats: Sequence[str],
    kind: str,
    document: tuple[str, bytes],
    **how: Any,
) -> None:
    """The file of all numbers, the figures, and report.html by ``kind``: full, light or none."""
    (folder / document[0]).write_bytes(document[1])
    files = write_figures(plans, folder, formats)
    if kind != "none":
        html = page(f, shown, plans, files, full=kind == "full", document=document, **how)
        (folder / "report.html").write_bytes(html)


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
