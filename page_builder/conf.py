"""The manual as pages: `sphinx-build -W -c page_builder . build/site` in the repository's root.

The site has the manual, the README, the cases and the benchmarks, at the places that they have in
the repository, so that every link leads where it does there. The headings of the manual's index and
the links below them are the table of contents.
"""

from __future__ import annotations

import re

from pygments.lexers import TextLexer
from sphinx.application import Sphinx

import eigassign

project = "eigassign"
version = release = eigassign.__version__
root_doc = "eigassign/docs/index"
include_patterns = ["*.md", "eigassign/docs/**.md", "cases/**.md", "benchmarks/**.md"]
exclude_patterns = [".*", "build", "results", "tests"]
extensions = ["myst_parser"]
myst_heading_anchors = 5

html_theme = "furo"
html_title = f"eigassign {version}"
html_static_path = ["style.css"]
html_css_files = ["style.css"]
html_copy_source = html_show_copyright = html_show_sphinx = False
templates_path = ["."]
html_additional_pages = {"index": "index.html"}  # leads to the index of the manual

CONTENTS = "\n```{{toctree}}\n:hidden:\n:glob:\n{options}\n{pages}\n```\n"
REPOSITORY = ["/README", "/cases/README", "/benchmarks/README", "/CHANGELOG"]
BELOW = {"cases/README": "stress/README", "benchmarks/README": "results/*\nresults/*/README"}


def with_contents(_app: Sphinx, name: str, source: list[str]) -> None:
    """A page that lists others, with these in the table of contents."""
    if name in BELOW:
        source[0] += CONTENTS.format(options="", pages=BELOW[name])
    if name == root_doc:
        _, *parts = re.split(r"^## ", source[0], flags=re.MULTILINE)
        listed = {
            part.splitlines()[0]: re.findall(r"^- \[.*?\]\((.*?)\.md\)", part, re.MULTILINE)
            for part in parts
        }
        for caption, pages in {**listed, "The repository": REPOSITORY}.items():
            options = f":caption: {caption}\n"
            source[0] += CONTENTS.format(options=options, pages="\n".join(pages))


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    app.connect("source-read", with_contents)
    app.add_lexer("csv", TextLexer)  # Pygments has none
