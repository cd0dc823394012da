"""What a batch leaves: summary.csv for people, junit.xml for CI servers."""

from __future__ import annotations

import csv
import io
import re
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from eigassign.files import printable
from eigassign.output.formats import percent
from eigassign.output.storage import replace_synced
from eigassign.output.tables import Table

Status = Literal["ok", "tolerance", "failed", "error"]

COLUMNS = (
    "name", "status", "seconds", "initial_max_relative", "predicted_max_relative",
    "exact_max_relative", "design", "message", "path", "run_folder",
)  # fmt: skip
_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_FORMULA = ("=", "+", "-", "@", "\t", "\r")  # spreadsheets run a cell that starts so


@dataclass(frozen=True)
class CaseOutcome:
    """How one case of a batch ended.

    ``status``: ok; tolerance (it ran, and misses the tolerance asked for); failed (it ran, and
    there is no answer: infeasible, unreachable); error (wrong input, no disk, a bug).
    Errors are fractions of the target; None where there is no number.
    """

    name: str
    path: str
    status: Status
    seconds: float
    message: str = ""
    run_folder: str | None = None
    initial_max_relative: float | None = None
    predicted_max_relative: float | None = None
    exact_max_relative: float | None = None
    design: tuple[tuple[str, float], ...] = ()


def batch_table(outcomes: Sequence[CaseOutcome]) -> Table:
    """One line a case: name, status, seconds, worst exact error if there is one, message."""
    rows = []
    for one in outcomes:
        worst = "" if one.exact_max_relative is None else percent(one.exact_max_relative)
        rows.append((one.name, one.status, f"{one.seconds:.2f} s", worst, one.message))
    return Table("Batch", ("case", "status", "time", "worst error", "message"), tuple(rows))


def write_summary(path: Path, outcomes: Sequence[CaseOutcome]) -> None:
    """summary.csv: one line a case, numbers as ``repr`` writes them."""
    replace_synced(path, summary_csv(outcomes).encode())


def write_junit(path: Path, outcomes: Sequence[CaseOutcome], suite: str = "eigassign") -> None:
    """junit.xml as CI servers read it."""
    replace_synced(path, junit_xml(outcomes, suite))


def summary_csv(outcomes: Sequence[CaseOutcome]) -> str:
    """The text of summary.csv."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for outcome in outcomes:
        writer.writerow([_cell(outcome, column) for column in COLUMNS])
    return text.getvalue()


def _cell(outcome: CaseOutcome, column: str) -> str:
    value = getattr(outcome, column)
    if column == "design":
        value = "; ".join(f"{name}={amount!r}" for name, amount in outcome.design)
    if value is None:
        return ""
    if isinstance(value, float):
        return repr(value)
    text = printable(" ".join(str(value).split("\n")))
    return "'" + text if text.startswith(_FORMULA) else text


def junit_xml(outcomes: Sequence[CaseOutcome], suite: str = "eigassign") -> bytes:
    """The bytes of junit.xml: missed tolerances and unsolvable cases are failures."""
    counts = {
        "tests": str(len(outcomes)),
        "failures": str(sum(o.status in ("failed", "tolerance") for o in outcomes)),
        "errors": str(sum(o.status == "error" for o in outcomes)),
        "time": _seconds(sum(o.seconds for o in outcomes)),
    }
    root = ET.Element("testsuites", {"name": suite, **counts})
    inside = ET.SubElement(root, "testsuite", {"name": suite, **counts, "skipped": "0"})
    for outcome in outcomes:
        inside.append(_testcase(outcome, suite))
    ET.indent(root)
    return bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True)) + b"\n"


def _testcase(outcome: CaseOutcome, suite: str) -> ET.Element:
    attributes = {
        "name": _xml(outcome.name),
        "classname": _xml(suite),
        "file": _xml(outcome.path),
        "time": _seconds(outcome.seconds),
    }
    case = ET.Element("testcase", attributes)
    if outcome.status != "ok":
        tag = "error" if outcome.status == "error" else "failure"
        first = (outcome.message.splitlines() or [outcome.status])[0]
        reason = ET.SubElement(case, tag, {"type": outcome.status, "message": _xml(first)})
        reason.text = _xml(outcome.message)
    if outcome.run_folder is not None:
        ET.SubElement(case, "system-out").text = _xml(f"run folder: {outcome.run_folder}")
    return case


def _seconds(value: float) -> str:
    return f"{value:.3f}"


def _xml(text: str) -> str:
    """``text`` without the characters that XML cannot hold, shown as ``\\x1b``."""
    return _NOT_XML.sub(lambda found: found.group().encode("unicode_escape").decode(), text)
