"""junit.xml, as CI servers read it."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path

from eigassign.output.batch.outcome import CaseOutcome
from eigassign.output.storage import replace_synced

_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def write_junit(path: Path, outcomes: Sequence[CaseOutcome], suite: str = "eigassign") -> None:
    """junit.xml as CI servers read it."""
    replace_synced(path, junit_xml(outcomes, suite))


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
