"""How one case of a batch ended; summary.csv and .json, junit.xml, and the table on the console."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from typing import Annotated, Any, Literal

from eigassign._version import __version__
from eigassign.case.schema.document import typed
from eigassign.case.units import SI, QuantityError, handy_unit, read_quantity
from eigassign.facts import Fact, Seconds, Share, capital, verdict_word
from eigassign.files import name_of, printable
from eigassign.output.documents import results_document
from eigassign.output.tables import Table, facts_table
from eigassign.study.results import RunResults

Status = Literal["ok", "tolerance", "failed", "error"]
Range = tuple[str, float, float, float]  # of what, lowest, mean, highest


@dataclass(frozen=True)
class CaseOutcome:
    """How one case of a batch ended.

    ``status``: ok; tolerance (it ran, and misses the tolerance asked for); failed (it ran, and
    there is no answer: infeasible, unreachable); error (wrong input, no disk, a bug).
    Errors are fractions of the target; None where there is no number. ``values`` are what a sweep
    sets, by key; ``frequencies`` the lowest, mean and highest exact frequency in Hz that each
    target has along the trajectory at the answer; ``units`` those in SI of swept values, of the
    design and of drives, by name.
    """

    index: Annotated[int, Fact("place in the batch")] = field(default=0, kw_only=True)
    name: Annotated[str, Fact("of the case, and of its variant", "case")]
    key: Annotated[str, Fact("of what was computed")] = field(default="", kw_only=True)
    values: Mapping[str, Any] = field(default_factory=dict, kw_only=True)
    path: Annotated[str, Fact("of the case file")]
    status: Status
    seconds: Annotated[Seconds, Fact(heading="time")]
    message: str = ""
    run_folder: Annotated[str | None, Fact("as seen from the folder of the batch")] = None
    initial_max_relative: Annotated[Share | None, Fact("largest error", "worst before")] = None
    predicted_max_relative: Annotated[Share | None, Fact(heading="worst predicted")] = None
    exact_max_relative: Annotated[Share | None, Fact("largest error", "worst error")] = None
    exact_rms_relative: Annotated[Share | None, Fact("over time", "rms error")] = None
    initial_violation: Annotated[Share | None, Fact("of any limit", "violated before")] = None
    exact_violation: Annotated[Share | None, Fact("the largest of any limit", "violated by")] = None
    mass: Annotated[float | None, Fact("of all links and bodies", "total mass", "kg")] = None
    price: Annotated[float | None, Fact("of the choices and of the change")] = None
    design: Annotated[Sequence[tuple[str, float]], Fact("the optimum, SI")] = ()
    drives: Annotated[Sequence[tuple[str, float]], Fact("peaks with the answer, SI")] = ()
    room: Annotated[Share | None, Fact("least to a limit on frequencies", "least room")] = None
    frequencies: Annotated[Sequence[Range], Fact("exact, of each target", unit="Hz")] = ()
    verdict: str = ""
    units: Annotated[Mapping[str, str], Fact("SI, of values and design")] = field(
        default_factory=dict
    )
    read_in: Annotated[Mapping[str, str], Fact("units of the case file, of some of these")] = field(
        default_factory=dict
    )

    def unit(self, name: str) -> str:
        """SI unit of a value or parameter, answered in that of the case file."""
        return SI(self.units.get(name, ""), self.read_in.get(name, ""))

    @property
    def why(self) -> Annotated[str, Fact(heading="message")]:
        """The message on one line, without the verdict before it."""
        own = self.message.removeprefix(f"{self.verdict.replace('_', ' ')}: ")
        return capital(" ".join(own.split()))

    @property
    def word(self) -> Annotated[str, Fact(heading="verdict")]:
        """How it ended as people say it: the verdict, or of a case without one its status."""
        return verdict_word(self.verdict) or _WITHOUT.get(self.status, self.status)


_WITHOUT = {"ok": "Done", "tolerance": "Over tolerance", "failed": "No answer", "error": "Failed"}
_SURROGATE = re.compile(r"\\ud[89a-f][0-9a-f]{2}")
NUMBERS = (  # that every case has, or lacks
    "initial_max_relative", "predicted_max_relative", "exact_max_relative", "exact_rms_relative",
    "initial_violation", "exact_violation", "room", "mass", "price",
)  # fmt: skip


def to_plain(outcome: CaseOutcome) -> dict[str, Any]:
    """The outcome as JSON has it, ``index`` first; a number that is not finite is None."""
    return dict(results_document(outcome, may_lack=True))


def from_plain(row: Any) -> CaseOutcome:
    """The outcome that `to_plain` wrote, with lists for tuples.

    Raises ValueError or TypeError for anything else.
    """
    found, text = CaseOutcome(**row), json.dumps(row)
    # names of files may hold what is no Unicode, which pydantic refuses
    typed(CaseOutcome).validate_json(_SURROGATE.sub("?", text), strict=True)
    for place in (found.path, found.run_folder or ""):
        name_of(place)
    return found


def frequency_ranges(results: RunResults, swept: Iterable[str] = ()) -> tuple[Range, ...]:
    """The ``frequencies`` of a run, each under a name of its own; of a band the nearest mode.

    What is wanted is not in the names where it is ``swept``, or may be.
    """
    found: dict[str, Range] = {}
    for target in results.targets:
        asked, hz = target.asked, target.exact_hz.tolist()
        name = asked.form.curve_of(asked.curve_name)
        if target.near:
            edges = any(key.startswith(f"{asked.place}.") for key in swept)
            name = target.closest.partition(" of ")[0] + " of the band" if edges else target.closest
        name += "" if asked.trajectory is None else f" along {asked.trajectory!r}"
        names = (f"{name} ({k})" if k > 1 else name for k in count(1))
        free = next(each for each in names if each not in found)
        found[free] = (free, min(hz), math.fsum(hz) / len(hz), max(hz))
    return tuple(found.values())


# --- The files

FORMAT = 1  # of summary.json
_HASH = re.compile("~[0-9a-f]{10}$")  # of the name of a variant
_FORMULA = ("=", "+", "-", "@", "\t", "\r")  # spreadsheets run a cell that starts so
_AHEAD, _LAST = ("status", "verdict", "seconds", *NUMBERS), ("message", "path", "run_folder")
Cell = float | str | None


@dataclass(frozen=True)
class SummaryDocument:
    """The cases in their order, and how many ended how."""

    format: int
    version: Annotated[str, Fact("of eigassign")]
    cases: Sequence[CaseOutcome]
    counts: Annotated[Mapping[str, int], Fact("by status")]


def summary_json(rows: Sequence[CaseOutcome]) -> str:
    """summary.json, a line for each case."""
    lines = ",\n  ".join(json.dumps(to_plain(row), allow_nan=False) for row in rows)
    counts = json.dumps(dict(sorted(Counter(row.status for row in rows).items())))
    head = f'"format": {FORMAT}, "version": {json.dumps(__version__)}'
    return f'{{{head}, "cases": [\n  {lines}\n], "counts": {counts}}}\n'


def summary_csv(rows: Sequence[CaseOutcome]) -> str:
    """summary.csv: a column for every number, in the unit of the case file, else SI."""
    units = {name: handy_unit(row.unit(name)) for row in rows for name in row.units}
    values, ranges = ([*map(cells, rows)] for cells in (_values, _ranges))
    designs, drives = ([dict(getattr(row, of)) for row in rows] for of in ("design", "drives"))
    parts: list[tuple[str, Sequence[Mapping[str, Cell]]]] = [("", values)]
    parts += [("design/", designs), ("drives/", drives), ("frequencies/", ranges)]
    columns: dict[str, list[Cell]] = {"name": [row.name for row in rows]}
    for prefix, every in parts:
        names = dict.fromkeys(name for row in every for name in row)
        for name in names:
            bare, (unit, size) = name.removesuffix(" (text)"), units.get(name, ("", 1.0))
            head = prefix + (name if bare in names else bare)
            columns[f"{head} [{unit}]" if unit else head] = [
                value / size if isinstance(value, float) else value
                for value in (row.get(name) for row in every)
            ]
        if not prefix:
            columns |= {name: [getattr(row, name) for row in rows] for name in _AHEAD}
    columns |= {name: [getattr(row, name) for row in rows] for name in _LAST}
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(map(cell, columns))
    told = ([cell(c) if isinstance(c, str) else c for c in column] for column in columns.values())
    writer.writerows(zip(*told, strict=True))
    return file.getvalue()


def _values(row: CaseOutcome) -> dict[str, Cell]:
    """What a sweep set: a number in SI units, else text."""
    found: dict[str, Cell] = {}
    for key, value in row.values.items():
        number = quantity(value) if isinstance(value, (int, float, str)) else None
        if number is not None:
            found[key] = number
        else:
            found[f"{key} (text)"] = value if isinstance(value, str) else json.dumps(value)
    return found


def _ranges(row: CaseOutcome) -> dict[str, Cell]:
    statistics = ("lowest_hz", "mean_hz", "highest_hz")
    pairs = ((name, zip(statistics, hz, strict=True)) for name, *hz in row.frequencies)
    return {f"{name}/{what}": hz for name, numbers in pairs for what, hz in numbers}


def quantity(value: float | str) -> float | None:
    """``value`` in SI units; None where it is no number."""
    try:
        return read_quantity(value, None)
    except QuantityError:
        return None


def cell(text: str) -> str:
    """The text as a cell that stays on its line, and that no spreadsheet takes for a formula."""
    if not text.isprintable():
        text = printable(" ".join(text.split("\n")))
    return "'" + text if text.startswith(_FORMULA) else text


def batch_table(outcomes: Sequence[CaseOutcome], room: int = 100) -> Table:
    """One line a case: its name, verdict, worst exact error if there is one, time, message.

    Name and message are cut to the ``room``; files have all of them.
    """
    names = [_cut(name, max(room // 2, 12)) for name in bare_names(outcomes)]
    rows = [replace(o, name=name) for o, name in zip(outcomes, names, strict=True)]
    made = facts_table("Batch", rows, "name word exact_max_relative room seconds why")
    if made.columns[-1] != "message":
        return made
    wide = [max(map(len, column)) for column in zip(made.columns, *made.rows, strict=True)]
    left = max(room - sum(wide[:-1]) - 2 * len(wide[:-1]), 7)
    return made._replace(rows=tuple((*row[:-1], _cut(row[-1], left)) for row in made.rows))


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most - 1]}…"


def bare_names(outcomes: Sequence[CaseOutcome]) -> list[str]:
    """The names of cases, of variants without a hash where they are told apart without."""
    bare = [_HASH.sub("", row.name) if row.values else row.name for row in outcomes]
    many = Counter(bare)
    pairs = zip(outcomes, bare, strict=True)
    return [name if many[name] == 1 else row.name for row, name in pairs]


def said(rows: Sequence[CaseOutcome]) -> str:
    """``58 meet what is asked, 2 do not, 1 failed``: what failed could not be run."""
    count = Counter[str](row.status for row in rows)
    met, failed = count["ok"], count["error"]
    missed = len(rows) - met - failed
    words = [f"{met} meet{'s' * (met == 1)} what is asked"]
    words += [f"{missed} do{'es' * (missed == 1)} not"] * bool(missed)
    words += [f"{failed} failed"] * bool(failed)
    return ", ".join(words) if rows else ""


_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_MARKUP = re.compile('[&<>"\t\n\r]')
SUITE = "eigassign"


def junit_xml(rows: Iterable[CaseOutcome]) -> bytes:
    """One suite, a line for each case; missed tolerances and unsolvable cases are failures."""
    lines, totals = list[str](), Counter({"tests": 0, "failures": 0, "errors": 0})
    time_s = 0.0
    for row in rows:
        line = f'<testcase name="{_escaped(row.name)}" classname="{SUITE}" '
        line += f'file="{_escaped(row.path)}" time="{row.seconds:.3f}">'
        totals["tests"] += 1
        time_s += row.seconds
        if row.status != "ok":
            tag, kind = ("error",) * 2 if row.status == "error" else ("failure", row.word.lower())
            totals[f"{tag}s"] += 1
            first = _escaped((row.message.splitlines() or [kind])[0])
            line += f'<{tag} type="{kind}" message="{first}">{_escaped(row.message)}</{tag}>'
        if row.run_folder:
            line += f"<system-out>run folder: {_escaped(row.run_folder)}</system-out>"
        lines.append(f"{line}</testcase>\n")
    counts = f'name="{SUITE}" ' + " ".join(f'{k}="{v}"' for k, v in totals.items())
    counts += f' time="{time_s:.3f}"'
    header = f'<?xml version="1.0" encoding="utf-8"?><testsuites {counts}><testsuite {counts} '
    end = "</testsuite></testsuites>\n"
    return "".join([header, 'skipped="0">\n', *lines, end]).encode()


def _escaped(text: str) -> str:
    """``text`` as content or attribute, on one line; what XML cannot hold as ``\\x1b``."""
    shown = _NOT_XML.sub(lambda found: found.group().encode("unicode_escape").decode(), text)
    return _MARKUP.sub(lambda found: f"&#{ord(found.group())};", shown)
