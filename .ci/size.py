#!/usr/bin/env python3
"""The size of the project beside its caps; exit code 1 above one. The caps stand in `caps.toml`.

Lines are counted as ``wc -l`` does. Parts of the package may trade lines with each other: their
caps show where they are meant to be, and only the sums are held.
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGE, MANUAL = ROOT / "eigassign", ROOT / "eigassign" / "docs"


def lines(folder: Path, pattern: str = "*.py") -> int:
    """Lines of all files below a folder whose name matches."""
    found = (path for path in folder.rglob(pattern) if path.suffix != ".pyc" and path.is_file())
    return sum(path.read_bytes().count(b"\n") for path in found)


def part_lines(name: str) -> int:
    """Lines of Python in one folder, or one module, of the package."""
    folder, module = PACKAGE / name, PACKAGE / f"{name}.py"
    if folder.is_dir():
        return lines(folder)
    return module.read_bytes().count(b"\n") if module.exists() else 0


def sizes(parts: dict[str, list[str]]) -> dict[str, int]:
    """Every figure that has a cap, by its name in the table."""
    own = list(PACKAGE.rglob("*.py"))
    defines = re.compile(r"^\s*(?:async def|def|class) ", re.MULTILINE)
    pages = [page for page in MANUAL.rglob("*.md") if page.parent != MANUAL / "reference"]
    return {
        **{name: sum(map(part_lines, folders)) for name, folders in parts.items()},
        "package": lines(PACKAGE),
        "modules with a def or class": sum(bool(defines.search(p.read_text("utf-8"))) for p in own),
        "tests": lines(ROOT / "tests"),
        "words of the manual": sum(len(page.read_text("utf-8").split()) for page in pages),
        "page_builder": lines(ROOT / "page_builder", "*"),
        "templates": lines(PACKAGE / "output" / "templates", "*"),
    }


def main() -> int:
    """Print the table; 1 where a sum is above its cap."""
    table = tomllib.loads((ROOT / ".ci" / "caps.toml").read_text("utf-8"))
    parts, caps = table["parts"], {**table["part_caps"], **table["caps"]}
    found = sizes(parts)
    above = [name for name in table["caps"] if found[name] > caps[name]]
    for name, size in found.items():
        over = "  ABOVE ITS CAP" if name in above else ""
        print(f"{name:<36} {size:>7} of {caps[name]:>7}{over}")
    if above:
        print(f"size: above the cap: {', '.join(above)}; take something away", file=sys.stderr)
    return 1 if above else 0


if __name__ == "__main__":
    sys.exit(main())
