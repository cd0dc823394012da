"""index.html, with plots over what was swept; and all files of a batch together.

The page carries its rows as numbers, rounded and in units that people read; its own script draws
them, as a map or lines over the swept keys and as points of any two columns, and sorts and filters.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from urllib.parse import quote

from eigassign._version import __version__
from eigassign.brief import cut
from eigassign.case.reader import short_keys
from eigassign.case.units import QuantityError, handy, handy_unit, number_and_unit
from eigassign.facts import fact
from eigassign.output.batch.summary import (
    NUMBERS,
    CaseOutcome,
    bare_names,
    junit_xml,
    quantity,
    summary_csv,
    summary_json,
)
from eigassign.output.reports.page import TEMPLATES, inside, page_of
from eigassign.output.store.atomic import replace_synced
from eigassign.output.tables import TONES

_MANY = 100  # values of a key: more are a sample's, which need not be told apart
SAME = 1e-3  # of a peak: what a drive exerts that changes less is no column
_MESSAGE = 400  # characters of it: a page of a thousand rows stays below 2 MB
_LIKE = {"ok": "reached", "tolerance": "improved"}  # how cases without a verdict look
# Name, unit and kind (name, swept, word, number, text, hidden: for plots only); and the cells
Column = tuple[tuple[str, str, str], Sequence[float | str | None]]


def index_page(
    rows: Sequence[CaseOutcome], folder: Path, keys: Sequence[str] = (), most: int = 10_000
) -> bytes:
    """The page of the batch in ``folder``; ``keys`` are those of its sweep.

    It shows ``most`` rows at most, those that are not ok first of all: a browser takes a second to
    sort so many.
    """
    tones = [TONES.get(row.verdict or _LIKE.get(row.status, ""), "bad") for row in rows]
    counts = Counter((row.word, tone) for row, tone in zip(rows, tones, strict=True))
    total, met = len(rows), tones.count("good")
    rows = sorted(sorted(rows, key=lambda row: row.status == "ok")[:most], key=lambda r: r.index)
    swept, stems = [*_swept(rows, keys)], {Path(row.path).stem for row in rows}
    apart = len({*zip(*(cells for _, cells in swept), strict=True)}) == len(rows)
    names = [str(row.index + 1) for row in rows] if apart else bare_names(rows)
    verdict, *others = _columns(rows)
    columns = [(("case", "", "name"), names), verdict, *swept, *others]
    shown = [(head, cells) for head, cells in columns if any(c not in ("", None) for c in cells)]
    data = {
        "columns": [head for head, _ in shown],
        "rows": [*zip(*(cells for _, cells in shown), strict=True)],
        "links": [_links(row, folder) for row in rows],
    }
    return page_of(
        "batch.html.j2",
        title=f"Sweep of {', '.join(stems)}" if keys and len(stems) == 1 else folder.resolve().name,
        noun="variant" if keys else "case",
        total=total,
        met=met,
        shown=len(rows),
        counts=sorted((tone != "good", word, tone, n) for (word, tone), n in counts.items()),
        version=__version__,
        data=inside(data),
        script=(TEMPLATES / "batch.js").read_text("utf-8"),
    )


def _swept(rows: Sequence[CaseOutcome], keys: Sequence[str]) -> Iterator[Column]:
    """What a sweep set, in the unit that it is written in, with digits that tell values apart."""
    if keys and len({row.path for row in rows}) > 1:
        yield ("case file", "", "swept"), [Path(row.path).stem for row in rows]
    for key, name in short_keys(keys, 2).items():
        written = [row.values.get(key) for row in rows]
        try:
            pairs = [None if value is None else number_and_unit(value) for value in written]
        except QuantityError:
            words = [v if isinstance(v, str | None) else json.dumps(v) for v in written]
            yield (name, "", "swept"), words
            continue
        units = {pair[1] for pair in pairs if pair and pair[0]}
        if len(units) == 1 and (unit := units.pop()):
            numbers, size = [pair and float(pair[0]) for pair in pairs], 1.0
        else:
            numbers = [None if value is None else quantity(value) for value in written]
            unit = next((row.unit(key) for row in rows if key in row.units), "")
            unit, size = handy_unit(unit, *(n for n in numbers if n is not None))
        for digits in range(4, 18):
            cells = _rounded(numbers, size, digits)
            if len({*cells}) >= min(len({*numbers}), _MANY):
                break
        yield (name, unit, "swept"), cells


def _columns(rows: Sequence[CaseOutcome]) -> Iterator[Column]:
    """Verdict, errors, mass, price, design, message; for plots frequencies and time too."""
    yield ("verdict", "", "word"), [row.word for row in rows]
    for name in NUMBERS:
        one, kind = fact(CaseOutcome, name), "hidden" if name.startswith("pred") else "number"
        yield _numbers(one.heading, kind, [getattr(row, name) for row in rows], one.unit)
    designs = [dict(row.design) for row in rows]
    counts = Counter(name for design in designs for name in design)
    own = [name for name, count in counts.items() if 2 * count >= sum(map(bool, designs))]
    for name in own:
        unit = next((row.unit(name) for row in rows if name in row.units), "")
        yield _numbers(name, "number", [design.get(name) for design in designs], unit)
    yield ("design", "", "text"), [_told(row, own) for row in rows]
    drives = [dict(row.drives) for row in rows]
    for name in dict.fromkeys(name for each in drives for name in each):
        peaks = [each.get(name) for each in drives]
        unit = next(row.unit(name) for row in rows if name in row.units)
        known = [peak for peak in peaks if peak is not None]
        if max(known) - min(known) > SAME * max(known):  # what is swept changes it
            yield _numbers(name, "number", peaks, unit)
    ranges = [{name: hz for name, *hz in row.frequencies} for row in rows]
    for name in dict.fromkeys(name for each in ranges for name in each):
        for k, which in ((0, "lowest"), (2, "highest")):
            hz = [each[name][k] if name in each else None for each in ranges]
            yield _numbers(f"{name}, {which}", "hidden", hz, "Hz")
    yield _numbers("time", "hidden", [row.seconds for row in rows], "s")
    yield ("message", "", "text"), [cut(row.why, _MESSAGE) for row in rows]


def _told(row: CaseOutcome, but: Sequence[str]) -> str:
    """The parameters of a design in words: ``m1 229 g, m2 0 kg``."""
    rest = ((name, amount) for name, amount in row.design if name not in but)
    told = (f"{name} {handy(amount, row.unit(name))}" for name, amount in rest)
    return ", ".join(text.replace(" ", "\N{NO-BREAK SPACE}") for text in told)


def _numbers(name: str, kind: str, amounts: Sequence[float | None], unit: str) -> Column:
    """A column in its handy unit, to four digits; of shares and times three."""
    few = unit in ("fraction", "s")
    if unit == "fraction":
        unit, size = "%", 0.01
    else:
        unit, size = handy_unit(unit, *(amount for amount in amounts if amount is not None))
    return (name, unit, kind), _rounded(amounts, size, 3 if few else 4)


def _rounded(amounts: Sequence[float | None], size: float, digits: int) -> list[float | None]:
    return [None if a is None else float(f"{a / size:.{digits}g}") + 0.0 for a in amounts]


def _links(row: CaseOutcome, folder: Path) -> list[str]:
    """The page or else the numbers of a case, and its picture; empty where there is none."""
    if row.run_folder is None:
        return []
    place = Path(row.run_folder)
    wanted = (("report.html", "results.json"), ("figures/frequencies.png",))
    there = (next((f for f in names if (folder / place / f).exists()), None) for names in wanted)
    return ["" if name is None else quote(os.fsencode((place / name).as_posix())) for name in there]


NAMES = ("summary.csv", "summary.json", "junit.xml", "index.html")


def write_files(folder: Path, rows: Sequence[CaseOutcome], keys: Sequence[str] = ()) -> None:
    """Write what is made of the rows of a batch; ``keys`` are those of its sweep.

    Raises OSError.
    """
    replace_synced(folder / "summary.csv", summary_csv(rows).encode())
    replace_synced(folder / "summary.json", summary_json(rows).encode())
    replace_synced(folder / "index.html", index_page(rows, folder, keys))
    replace_synced(folder / "junit.xml", junit_xml(rows))
