"""index.html of a batch: what it found in a sentence, plots over what was swept, its rows.

The page carries its rows as numbers, rounded and in units that people read; its own script draws
them, as a map or lines over the swept keys and as points of any two columns, and sorts and filters.
"""

from __future__ import annotations

import json
import os
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from eigassign._version import __version__
from eigassign.brief import counted, cut
from eigassign.case.units import QuantityError, handy, handy_unit, number_and_unit
from eigassign.facts import capital, fact
from eigassign.output.batch.columns import quantity
from eigassign.output.batch.outcome import NUMBERS, CaseOutcome, from_line
from eigassign.output.batch.summary import bare_names
from eigassign.output.pages import TEMPLATES, inside, page_of
from eigassign.output.reports.verdict import TONES, WORDS

_MANY = 100  # values of a key: more are a sample's, which need not be told apart
_MESSAGE = 400  # characters of it: a page of a thousand rows stays below 2 MB
_TAIL = re.compile(r"(?<![^.])(?:[0-9]*[^.0-9][^.]*(?:\.[0-9]+)*\.)?[^.]*$")  # in linear time
_DONE, _OVER = "Done", "Over tolerance"
_TONES = {WORDS[verdict]: tone for verdict, tone in TONES.items()} | {_DONE: "good", _OVER: "fair"}
Cell = float | str | None


class Index:
    """The rows that the page shows; those that are not ok are the first to find a place.

    At most ``most``: a browser takes a second to sort so many.
    """

    def __init__(self, most: int = 10_000) -> None:
        self._most = most
        self._good: list[str] = []
        self._bad: list[str] = []
        self._counts = Counter[str]()

    def add(self, row: CaseOutcome, line: str) -> None:
        """Keep the line of a row while there is a place for it."""
        self._counts[row.word] += 1
        lines = self._good if row.status == "ok" else self._bad
        if len(lines) < self._most:
            lines.append(line)

    def page(self, folder: Path, title: str, keys: Sequence[str] = ()) -> bytes:
        """The page of the batch in ``folder``; ``keys`` are those of its sweep."""
        lines = [*self._bad, *self._good][: self._most]
        rows = sorted(map(from_line, lines), key=lambda row: row.index)
        swept, stems = [*_swept(rows, keys)], {Path(row.path).stem for row in rows}
        apart = len({*zip(*(column.cells for column in swept), strict=True)}) == len(rows)
        names = [str(row.index + 1) for row in rows] if apart else bare_names(rows)
        columns = [_Column("case", "name", [*names]), *swept, *_columns(rows)]
        columns = [column for column in columns if any(c not in ("", None) for c in column.cells)]
        counted = sorted(self._counts.items(), key=lambda pair: (_tone(pair[0]) != "good", pair[0]))
        data = {
            "columns": [(column.name, column.unit, column.kind) for column in columns],
            "rows": [*zip(*(column.cells for column in columns), strict=True)],
            "links": [_links(row, folder) for row in rows],
        }
        total, met = self._counts.total(), sum(n for word, n in counted if _tone(word) == "good")
        return page_of(
            "batch.html.j2",
            title=f"Sweep of {', '.join(stems)}" if keys and len(stems) == 1 else title,
            swept=[column.span for column in swept],
            found=_found(met, total, "variant" if keys else "case"),
            tone="good" if met == total else "fair" if met else "bad",
            best=_best(rows, swept) if keys else "",
            total=total,
            shown=len(rows),
            counts=[(word, _tone(word), count) for word, count in counted],
            files=[n for n in ("summary.json", "columns.h5") if (folder / n).exists()],
            version=__version__,
            data=inside(data),
            script=(TEMPLATES / "batch.js").read_text("utf-8"),
        )


def _tone(word: str) -> str:
    return _TONES.get(word, "bad")


def _found(met: int, total: int, noun: str) -> str:
    """How many have an answer to build on, in a sentence."""
    many = {0: "None", total: "All"}.get(met, str(met))
    if not total:
        return "There are no cases."
    if total == 1:
        return f"The {noun} {'meets' if met else 'does not meet'} what is asked."
    of = f"{many} {total}" if many == "All" else f"{many} of {total}"
    return f"{of} {noun}s {'meets' if met == 1 else 'meet'} what is asked."


def _best(rows: Sequence[CaseOutcome], swept: Sequence[_Column]) -> str:
    """The variant that is nearest to its target, in a sentence; empty where none has a distance."""
    errors = [(e, k) for k, row in enumerate(rows) if (e := row.exact_max_relative) is not None]
    error, k = min(errors, default=(0.0, 0))
    if not error:
        return ""
    at = ", ".join(f"{c.name} {c.said(c.cells[k])}" for c in swept)
    nearest = f"Nearest to its target is case {rows[k].index + 1}, {100 * error:.3g} % off at worst"
    return f"{nearest}: {at}."


# --- Columns


@dataclass(frozen=True)
class _Column:
    """One column: its name and unit, its cells, and what it is.

    ``kind`` is name, swept, word, number, hidden (for plots only) or text.
    """

    name: str
    kind: str
    cells: Sequence[Cell]
    unit: str = ""

    def said(self, cell: Cell) -> str:
        """A cell with its unit, four digits of a number, and 15000 rather than 1.5e+04."""
        if isinstance(cell, float):
            return f"{float(f'{cell:.4g}'):.7g} {self.unit}".rstrip()
        return str(cell or "")

    @property
    def span(self) -> str:
        """What was swept, in words: ``tool.mass, 10 values from 0.5 to 3 kg``; of a sample none."""
        found = {cell for cell in self.cells if cell is not None}
        values = self.name if len(found) > _MANY else f"{self.name}, {counted(len(found), 'value')}"
        numbers = [cell for cell in found if isinstance(cell, float)]
        if len(numbers) < max(len(found), 2):
            return values
        least, most = (self.said(end) for end in (min(numbers), max(numbers)))
        return f"{values} from {least.removesuffix(f' {self.unit}')} to {most}"


def _swept(rows: Sequence[CaseOutcome], keys: Sequence[str]) -> Iterator[_Column]:
    """What a sweep set, in the unit that it is written in, with digits that tell values apart.

    And the case file, where there are several. Keys are called by their last two names, and numbers
    between them, where that tells them apart.
    """
    if keys and len({row.path for row in rows}) > 1:
        yield _Column("case file", "swept", [Path(row.path).stem for row in rows])
    tails = {key: _TAIL.findall(key)[0] for key in keys}
    several = Counter(tails.values())
    for key, tail in tails.items():
        name, written = key if several[tail] > 1 else tail, [row.values.get(key) for row in rows]
        try:
            pairs = [None if value is None else number_and_unit(value) for value in written]
        except QuantityError:
            words = [v if isinstance(v, str | None) else json.dumps(v) for v in written]
            yield _Column(name, "swept", words)
            continue
        units = {pair[1] for pair in pairs if pair and pair[0]}
        if len(units) == 1 and (unit := units.pop()):
            numbers, size = [pair and float(pair[0]) for pair in pairs], 1.0
        else:
            numbers = [None if value is None else quantity(value) for value in written]
            unit = next((row.units[key] for row in rows if key in row.units), "")
            unit, size = handy_unit(unit, *(n for n in numbers if n is not None))
        for digits in range(4, 18):
            cells = _rounded(numbers, size, digits)
            if len({*cells}) >= min(len({*numbers}), _MANY):
                break
        yield _Column(name, "swept", cells, unit)


def _columns(rows: Sequence[CaseOutcome]) -> Iterator[_Column]:
    """Verdict, errors, mass, price, design, message; for plots frequencies and time too.

    Parameters that less than half of the designs have are told in words.
    """
    yield _Column("verdict", "word", [row.word for row in rows])
    for name in NUMBERS:
        one, kind = fact(CaseOutcome, name), "hidden" if name.startswith("pred") else "number"
        yield _numbers(one.heading, kind, [getattr(row, name) for row in rows], one.unit)
    designs = [dict(row.design) for row in rows]
    counts = Counter(name for design in designs for name in design)
    own = [name for name, count in counts.items() if 2 * count >= sum(map(bool, designs))]
    for name in own:
        unit = next((row.units[name] for row in rows if name in row.units), "")
        yield _numbers(name, "number", [design.get(name) for design in designs], unit)
    yield _Column("design", "text", [_told(row, own) for row in rows])
    ranges = [{name: hz for name, *hz in row.frequencies} for row in rows]
    for name in dict.fromkeys(name for each in ranges for name in each):
        for k, which in ((0, "lowest"), (2, "highest")):
            hz = [each[name][k] if name in each else None for each in ranges]
            yield _numbers(f"{name}, {which}", "hidden", hz, "Hz")
    yield _numbers("time", "hidden", [row.seconds for row in rows], "s")
    told = (row.message.removeprefix(f"{row.verdict.replace('_', ' ')}: ") for row in rows)
    yield _Column("message", "text", [cut(capital(text), _MESSAGE) for text in told])


def _told(row: CaseOutcome, but: Sequence[str]) -> str:
    """The parameters of a design in words: ``m1 229 g, m2 0 kg``."""
    rest = ((name, amount) for name, amount in row.design if name not in but)
    return ", ".join(f"{name} {handy(amount, row.units.get(name, ''))}" for name, amount in rest)


def _numbers(name: str, kind: str, amounts: Sequence[float | None], unit: str) -> _Column:
    """A column in its handy unit, to four digits; of shares and times three."""
    few = unit in ("fraction", "s")
    if unit == "fraction":
        unit, size = "%", 0.01
    else:
        unit, size = handy_unit(unit, *(amount for amount in amounts if amount is not None))
    return _Column(name, kind, _rounded(amounts, size, 3 if few else 4), unit)


def _rounded(amounts: Sequence[float | None], size: float, digits: int) -> list[Cell]:
    return [None if a is None else float(f"{a / size:.{digits}g}") + 0.0 for a in amounts]


def _links(row: CaseOutcome, folder: Path) -> list[str]:
    """The page or else the numbers of a case, and its picture; empty where there is none."""
    if row.run_folder is None:
        return []
    place = Path(row.run_folder)
    wanted = (("report.html", "results.json"), ("figures/frequencies.png",))
    there = (next((f for f in names if (folder / place / f).exists()), None) for names in wanted)
    return ["" if name is None else quote(os.fsencode((place / name).as_posix())) for name in there]
