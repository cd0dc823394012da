"""How every figure on paper looks and is written: the style sheet, an empty figure, formats.

Figures are drawn through matplotlib's `Figure` and `Axes` on an Agg canvas; pyplot and its global
state are never used. matplotlib is imported only where a figure is made: a run without figures
does not load it. The user's own settings change nothing, and the same findings give the same bytes.
"""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from eigassign.output.figures.graph import BLACK, GREY, short

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = ("png", "svg", "pdf")
WIDTH_IN = 8.0  # 880 pixels at 110 dpi: the width of the text in a report
SMALL_PT = 8.0  # of notes; 9 of all other text, as it is printed in papers

SCALE = "cividis"  # grows evenly in lightness, the same for every kind of colour vision

STYLE: dict[str, Any] = {
    "axes.axisbelow": True,
    "axes.edgecolor": GREY,
    "axes.formatter.useoffset": False,  # a number on an axis is the number itself
    "axes.grid": True,
    "axes.labelcolor": BLACK,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 9.0,
    "axes.xmargin": 0.0,
    "figure.dpi": 110.0,
    "figure.titlesize": 10.0,
    "figure.titleweight": "bold",
    "font.family": ["DejaVu Sans"],  # comes with matplotlib: the same everywhere
    "font.size": 9.0,
    "grid.color": "#e3e3e3",
    "legend.borderaxespad": 0.2,
    "legend.columnspacing": 1.6,
    "legend.fontsize": 9.0,
    "legend.frameon": False,
    "legend.handlelength": 2.6,
    "legend.labelspacing": 0.35,
    "lines.dash_capstyle": "butt",
    "lines.solid_capstyle": "round",
    "patch.linewidth": 0.8,
    "svg.hashsalt": "eigassign",  # else the names inside an SVG are random
    "text.color": BLACK,
    "text.parse_math": False,  # names of the user's may hold any character
    "xtick.color": GREY,
    "xtick.labelcolor": BLACK,
    "ytick.color": GREY,
    "ytick.labelcolor": BLACK,
}
# the date, and who wrote the file, in the words of each format
_METADATA: dict[str, dict[str, str | None]] = {
    "png": {"Software": None},
    "svg": {"Date": None},
    "pdf": {"CreationDate": None},
}


def encoded(figure: Figure, kind: str) -> bytes:
    """The figure as a file of one of `FORMATS`, without date: the same bytes every time."""
    data = io.BytesIO()
    figure.savefig(data, format=kind, metadata=_METADATA[kind])
    return data.getvalue()


@contextlib.contextmanager
def applied() -> Iterator[None]:
    """Draw with `STYLE` over matplotlib's defaults, whatever the user's own settings are."""
    import matplotlib

    settings: Any = dict(matplotlib.rcParamsDefault)
    settings = {k: v for k, v in settings.items() if not k.startswith("backend")} | STYLE
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", category=matplotlib.MatplotlibDeprecationWarning)
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        with matplotlib.rc_context(settings):
            yield


def new_figure(title: str, height: float, width: float = WIDTH_IN) -> Figure:
    """An empty figure, inches, with its title; what is put into it is placed in inches, too.

    matplotlib's own layouts measure every letter twice, a third of the time of a figure.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure((width, height))
    FigureCanvasAgg(figure)
    if title:
        heading = short(title, int(11.0 * width))  # letters an inch: more of them seldom fit
        figure.suptitle(heading, x=0.1 / width, y=1.0 - 0.1 / height, ha="left", va="top")
    return figure


def columns(labels: Sequence[str]) -> int:
    """As many columns of a legend above its axes as fit."""
    for count in range(len(labels), 1, -1):  # matplotlib fills one after the other
        parts = np.array_split([len(label) for label in labels], count)
        if sum(max(part) + 8 for part in parts) <= 92:  # characters
            return count
    return 1
