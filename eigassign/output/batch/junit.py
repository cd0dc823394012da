"""junit.xml as CI servers read it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from eigassign.errors import StorageError
from eigassign.output.store.atomic import replace_synced

_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_MARKUP = re.compile('[&<>"\t\n\r]')
SUITE = "eigassign"
# Name, path of the case file, seconds; ok, error or the kind of failure; message, and output
Test = tuple[str, str, float, str, str, str]


def junit_xml(tests: Iterable[Test]) -> bytes:
    """One suite, a line for each test; missed tolerances and unsolvable cases are failures."""
    lines, totals = list[str](), Counter({"tests": 0, "failures": 0, "errors": 0})
    time_s = 0.0
    for name, path, seconds, status, message, output in tests:
        line = f'<testcase name="{_escaped(name)}" classname="{SUITE}" '
        line += f'file="{_escaped(path)}" time="{seconds:.3f}">'
        totals["tests"] += 1
        time_s += seconds
        if status != "ok":
            tag = "error" if status == "error" else "failure"
            totals[f"{tag}s"] += 1
            first = _escaped((message.splitlines() or [status])[0])
            line += (
                f'<{tag} type="{_escaped(status)}" message="{first}">{_escaped(message)}</{tag}>'
            )
        if output:
            line += f"<system-out>{_escaped(output)}</system-out>"
        lines.append(f"{line}</testcase>\n")
    counts = f'name="{SUITE}" ' + " ".join(f'{k}="{v}"' for k, v in totals.items())
    counts += f' time="{time_s:.3f}"'
    header = f'<?xml version="1.0" encoding="utf-8"?><testsuites {counts}><testsuite {counts} '
    end = "</testsuite></testsuites>\n"
    return "".join([header, 'skipped="0">\n', *lines, end]).encode()


def write_junit(path: Path, tests: Iterable[Test]) -> None:
    """A file of all ``tests``; raises StorageError where it cannot be written."""
    try:
        replace_synced(path, junit_xml(tests))
    except OSError as error:
        raise StorageError(f"{path}: cannot be written: {error.strerror}") from error


def _escaped(text: str) -> str:
    """``text`` as content or attribute, on one line.

    Characters that XML cannot hold are shown as ``\\x1b``.
    """
    shown = _NOT_XML.sub(lambda found: found.group().encode("unicode_escape").decode(), text)
    return _MARKUP.sub(lambda found: f"&#{ord(found.group())};", shown)
