"""Draw the first mode of every shipped case: ``python cases/gallery/draw.py``."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import eigassign as ea
from eigassign.output.figures import style
from eigassign.output.figures.modes import thumbnail
from eigassign.study.drawing import draw_modes

HERE = Path(__file__).parent


def main() -> None:
    """One PNG a case, beside this file."""
    for path in sorted(HERE.parent.glob("*.yaml")):
        case = ea.load_case(path)
        q = np.array(case.file.expansion.q, dtype=float)
        pictures = draw_modes(case.file, case.model(), q, case.initial_design, 1)
        with style.applied():
            (HERE / f"{path.stem}.png").write_bytes(style.encoded(thumbnail(pictures), "png"))


if __name__ == "__main__":
    main()
