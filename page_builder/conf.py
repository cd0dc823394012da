"""The manual as pages: `sphinx-build -W -c page_builder . build/site` in the repository's root.

The site has the manual, the README, the cases and the benchmarks, at the places that they have in
the repository, so that every link leads where it does there. The headings of the manual's index and
the links below them are the table of contents. Formulas stand as TeX in the pages, with the field's
symbols as they are (λ, φ, ∂): hosts of repositories set them, `eigassign docs` leaves them so, and
here they are MathML, which needs no script.
"""

from __future__ import annotations

import re

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from docutils.utils.math.mathalphabet2unichar import mathit
from docutils.utils.math.unichar2tex import uni2tex_table
from pygments.lexers import TextLexer
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

import eigassign

project = "eigassign"
version = release = eigassign.__version__
root_doc = "eigassign/docs/index"
include_patterns = ["*.md", "eigassign/docs/**.md", "cases/**.md", "benchmarks/**.md"]
exclude_patterns = [".*", "build", "results", "tests"]
extensions = ["myst_parser"]
myst_heading_anchors = 5
myst_enable_extensions = ["dollarmath"]
html_math_renderer = "mathml"

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


SIGNS = {**uni2tex_table, ord("½"): r"\frac{1}{2}", ord("·"): r"\cdot "}
ACCENTS = {"˙": "\u0307", "¨": "\u0308", "ˆ": "\u0302", "~": "\u0303"}


def mathml(formula: str, as_block: bool = False) -> str:
    """A formula; accents and brackets of matrices as they look without a font for formulas."""
    made = tex2mathml(formula.translate(SIGNS), as_block=as_block)

    def accented(found: re.Match[str]) -> str:
        return f"<mi>{mathit.get(found[1], found[1])}{ACCENTS[found[2]]}</mi>"

    over = r"<mover[^>]*>\s*<mi>(.)</mi>\s*<mo[^>]*>([˙¨ˆ~])</mo>\s*</mover>"
    made = re.sub(over, accented, made)
    made = re.sub(r"<mo[^>]*>\[</mo>\s*<mtable[^>]*>", '<mtable class="matrix">', made)
    return re.sub(r"</mtable>\s*<mo[^>]*>\]</mo>", "</mtable>", made)


def in_text(writer: HTML5Translator, node: nodes.math) -> None:
    """A formula within a line."""
    writer.body.append(mathml(node.astext()))
    raise nodes.SkipNode


def in_a_line_of_its_own(writer: HTML5Translator, node: nodes.math_block) -> None:
    """A formula and its number."""
    formula, number, _ = (*re.split(r"\\tag\{(.*?)\}", node.astext()), "", "")[:3]
    shown = f"<span>({number})</span>" if number else ""
    writer.body.append(f'<div class="formula">{mathml(formula, True)}{shown}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    app.add_html_math_renderer("mathml", (in_text, None), (in_a_line_of_its_own, None))
    app.connect("source-read", with_contents)
    app.add_lexer("csv", TextLexer)  # Pygments has none
