"""The site of the manual is built without a warning, and every link on it leads to a page of it."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

for _package in ("sphinx", "myst_parser", "furo"):
    pytest.importorskip(_package, reason="the extra docs is not installed")
pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[2]


def test_the_site_is_built_and_its_links_lead_somewhere(tmp_path: Path) -> None:
    command = ["-q", "-W", "--keep-going", "-c", "page_builder", "-d", str(tmp_path / "trees"), "."]
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", *command, str(tmp_path / "site")],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    pages = set((tmp_path / "site").rglob("*.html"))
    manual = {p.relative_to(ROOT).with_suffix(".html") for p in ROOT.glob("eigassign/docs/**/*.md")}
    assert {page for page in manual if tmp_path / "site" / page not in pages} == set()
    theory = (tmp_path / "site" / "eigassign" / "docs" / "theory.html").read_text(encoding="utf-8")
    assert theory.count("<math") > 200
    assert re.findall(r"\$|\\[a-z]+|<mtext>\\", re.sub("<pre>.*?</pre>", "", theory)) == []
    for page in pages:
        text = page.read_text(encoding="utf-8")
        for link in re.findall(r'(?:href|src)="(?!https?:|data:|#)([^"#?]*)', text):
            assert (page.parent / link).exists(), f"{page}: {link}"
