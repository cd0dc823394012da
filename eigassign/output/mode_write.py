"""What `eigassign modes --draw` leaves: figures, and the shapes as numbers."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from eigassign._version import __version__
from eigassign.output import figures, mode_figures
from eigassign.study.pictures import ModePictures


def write_modes(pictures: ModePictures, folder: Path) -> None:
    """figures/mode_1.png, … and modes.json."""
    (folder / "figures").mkdir()
    for name, data in figures.render(mode_figures.plan_modes(pictures)).items():
        (folder / "figures" / name).write_bytes(data)
    text = json.dumps(document(pictures), ensure_ascii=False, allow_nan=False)
    (folder / "modes.json").write_text(text + "\n", encoding="utf-8")


def document(pictures: ModePictures) -> dict[str, Any]:
    """The modes as numbers: ``rest`` and, mode by mode, ``deformed`` points of every line in m."""
    rest = pictures.rest
    lines = [
        {
            "link": link,
            "rest": points.tolist(),
            "deformed": [mode[k].tolist() for mode in pictures.deformed.lines],
        }
        for k, (link, points) in enumerate(zip(rest.line_links, rest.lines[0], strict=True))
    ]
    return {
        "eigassign_version": __version__,
        "title": pictures.title,
        "q": {name: {"value": value, "unit": unit} for name, value, unit in pictures.q},
        "y": {name: {"value": value, "unit": unit} for name, value, unit in pictures.y},
        "rigid_modes": pictures.rigid_modes,
        "frequencies_hz": list(pictures.frequencies_hz),
        "amplitude": pictures.amplitude,
        "lines": lines,
    }
