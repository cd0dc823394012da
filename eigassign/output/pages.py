"""HTML pages from their templates; what they carry as data is safe inside a script."""

from __future__ import annotations

import json
import os
import re
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eigassign.facts import number

if TYPE_CHECKING:
    from jinja2 import Environment

TEMPLATES = Path(__file__).parent / "templates"


def today() -> str:
    """The date as people write it, ``26 November 2026``; that of SOURCE_DATE_EPOCH if it is set."""
    given = os.environ.get("SOURCE_DATE_EPOCH", "")
    day = (
        datetime.fromtimestamp(int(given), UTC)
        if given.isdecimal()
        else datetime.now().astimezone()
    )
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

    environment.filters |= {"words": words, "number": number}
    return environment


def inside(data: Any) -> str:
    """JSON that no browser takes for the end of its script."""
    text = json.dumps(data, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")
