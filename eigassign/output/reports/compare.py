"""Runs of `optimize` side by side, by what their results.json say; what one lacks stays empty."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import UsageError
from eigassign.facts import number, percent, positive_percent, verdict_word
from eigassign.files import MATRIX, json_value, read_bytes
from eigassign.output.figures import graph
from eigassign.output.figures.curves import ROOM, TARGET
from eigassign.output.figures.graph import Curve, FigurePlan, Graph, Look, Mark, Panel, Shade
from eigassign.output.reports.page import page
from eigassign.output.store.run_folder import is_whole, read_record
from eigassign.output.tables import RUNS, Table
from eigassign.study.results import SCHEMA, CaseRow, Origin, violated

Found = Mapping[str, Any]  # a results.json


def read_results(path: Path) -> Found:
    """results.json of a run folder, or of that of a case file in results.

    Raises UsageError, naming the folder, where there is none, or an older or a damaged one.
    """
    folder = Path("results", path.stem) if path.suffix in (".yaml", ".yml") else path
    if (record := read_record(folder)) is None:
        raise UsageError(f"{folder} is no finished run of eigassign optimize")
    if not is_whole(folder, record):
        what = "a file of it was changed or lost, or an older eigassign wrote it"
        raise UsageError(f"{folder}: {what}: run its case again")
    known = "results.json" in record.files
    found: Found = json_value(read_bytes(folder / "results.json", MATRIX)) if known else {}
    if found.get("schema", SCHEMA) != SCHEMA:
        what = f"its results.json has schema {found['schema']}, and {SCHEMA} is read"
        raise UsageError(f"{folder}: {what}: run its case again")
    if not found.get("assignment"):
        raise UsageError(f"{folder} is no run of eigassign optimize, or its case has no targets")
    return found


@dataclass(frozen=True, repr=False, kw_only=True)
class Compared(Origin):
    """What the page says of itself."""

    warnings = notes = ()


def comparison(runs: Mapping[str, Found]) -> tuple[tuple[Table, ...], bytes]:
    """The tables, a column for each of the named ``runs``, and the page, one file."""
    rows = dict[str, dict[str, list[str]]]()
    for k, run in enumerate(runs.values()):
        for title, name, cell in _cells(run):
            rows.setdefault(title, {}).setdefault(name, [""] * len(runs))[k] = cell
    tables = tuple(
        Table(t, ("", *runs), tuple((k, *own) for k, own in r.items() if any(own)), "", RUNS)
        for t, r in rows.items()
    )
    case = CaseRow(", ".join(runs), f"{len(runs)} runs side by side", None, None, "", {})
    words = zip(runs, rows["Runs"]["verdict"], strict=True)
    line, headings = "; ".join(map(": ".join, words)), {RUNS: "Side by side"}
    plans = [_frequencies(runs)]
    return tables, page(Compared(case=case), tables, plans, {}, line=line, headings=headings)


def _cells(run: Found) -> Iterator[tuple[str, str, str]]:
    """Table, row and cell of what was found, of the design, and of targets and limits with room."""
    violation, found = run["violation"], run["assignment"]
    error = any(row["kind"] == "frequency" for row in run["targets"]) and run["error"]
    unfinished = "" if found["finished"] else ", unfinished"
    yield "Runs", "verdict", verdict_word(found["verdict"]) + unfinished
    for name, row, key in (
        ("worst error before", error and error["initial"], "max_relative"),
        ("worst error", error and error["exact"], "max_relative"),
        ("rms error", error and error["exact"], "rms_relative"),
        ("worst violation", violation, "exact"),
    ):
        yield "Runs", name, percent(row[key]) if row else ""
    amounts = {"mass [kg]": run["mass"] and run["mass"]["optimal"], "price": run["price"]}
    yield from (("Runs", k, number(one)) for k, one in amounts.items() if one is not None)
    for name, row in run["design"].items():
        unit, size = row.get("read_in", (row["unit"], 1.0))  # 0.3 does not write it
        words = f"{name} [{unit}]" if unit else name
        yield "Design", words, row["choice"] or number(row["optimal"] / size)
    for row in (*run["targets"], *found["limits"]):
        worst, room = row.get("worst", row.get("violation")), row.get("room")
        words = percent(worst) if row.get("kind") == "frequency" else violated(worst)
        words += f", room {positive_percent(room)}" if words == "met" and room is not None else ""
        yield "Asked", row.get("label") or row["words"], words


def _frequencies(runs: Mapping[str, Found]) -> FigurePlan:
    """Every run's modes in its colour, and what was asked; over shares of unequal durations."""
    last = [max(row["duration_s"] for row in run["trajectories"]) for run in runs.values()]
    alike = max(last) - min(last) <= 1e-9 * max(last)
    marks, looks, held = dict[str, Mark](), dict[str, Look](), list[NDArray[np.float64]]()
    for (name, run), duration in zip(runs.items(), last, strict=True):
        look = looks[name] = replace(graph.series(len(looks)), width=1.8)
        for row in (row for row in run["targets"] if row["kind"] != "gap"):  # that is a distance
            label, curves = row["label"], row["frequencies"]
            t = np.array(curves["time_s"])
            # a gap before each further trajectory, whose time begins anew
            begins = np.flatnonzero(np.diff(t) < 0.0) + 1

            def cut(values: ArrayLike, begins: Any = begins) -> NDArray[np.float64]:
                return np.insert(np.array(values, dtype=float), begins, np.nan)

            x = cut(t / (1.0 if alike else duration))
            own = {f"mode {one['mode']}": one["optimal_hz"] for one in row.get("near") or ()}
            if (kind := row["kind"]) == "keep_out":
                edges = [cut(curves[edge]) for edge in ("lower_hz", "upper_hz")]
                marks[label] = Shade(edges[0], edges[1], graph.VERMILLION, label, x=x)
            else:
                edges = [cut(curves["exact_hz" if kind == "highest" else "target_hz"])]
                if kind != "highest":
                    marks[label] = Curve(edges[0], TARGET, label, x)
                mode = f"mode {row['mode']}" if row["mode"] else row["followed"]["name"]
                own = {mode: curves["exact_hz"]}
            hz, top = np.hstack([*own.values(), []]), float(np.nanmax(edges))
            away = np.maximum(np.nanmin(edges) - hz, hz - top)
            near = {"keep_out": away.min(initial=np.inf), "at_least": 0.0, "at_most": 0.0}
            held += [*edges, hz[away <= max(ROOM * top, near.get(kind, np.inf))]]
            for mode, hz in own.items():
                words = f"{mode}, {name}"
                curve = Curve(cut(hz), look, x=x, end=mode, hover=words)
                marks[f"{words}, {row.get('trajectory')}"] = curve
    low, high = graph.bounds(held)
    ends = low, high = max(low - ROOM * (high - low), 0.0), high + ROOM * (high - low)
    panel = Panel("frequency [Hz]", (*marks.values(),), 4.6, key=(*looks.items(),), within=ends)
    off = {one.hover: 0 for one in panel.curves if not ((low < one.y) & (one.y < high)).any()}
    title, axis = "Frequencies of the answers", "time [s]" if alike else "part of the duration"
    caption = "Exact, along the trajectory: a colour and dashes for each run, and what was asked."
    caption += f" Outside the axis: {', '.join(off)}." * bool(off)
    shows = Graph(title, axis, np.zeros(0), (panel,))
    return FigurePlan("compared", title, caption, "Frequencies of runs over time.", shows, "answer")
