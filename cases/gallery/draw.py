"""Draw the first mode of every shipped case: ``python cases/gallery/draw.py``."""

from __future__ import annotations

from pathlib import Path

import eigassign as ea
from eigassign.output import thumbnail
from eigassign.study.pictures.drawing import draw_modes
from eigassign.study.planning import with_middle_loads

HERE = Path(__file__).parent


def main() -> None:
    """One PNG a case, beside this file."""
    for path in sorted(HERE.parent.glob("*.yaml")):
        case = ea.load_case(path)
        q = with_middle_loads(case.file, case.file.expansion.q)
        pictures = draw_modes(case.file, case.model(), q, case.initial_design, 1)
        (HERE / f"{path.stem}.png").write_bytes(thumbnail(pictures))


if __name__ == "__main__":
    main()
