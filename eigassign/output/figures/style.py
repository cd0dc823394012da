"""How every figure looks and is written: the style sheet, an empty figure, limits and formats.

Figures are drawn through matplotlib's `Figure` and `Axes` on an Agg canvas; pyplot and its global
state are never used. matplotlib is imported only where a figure is made: a run without figures
does not load it. The user's own settings change nothing, and the same findings give the same bytes.
"""

from __future__ import annotations

import contextlib
import io
import math
import unicodedata
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

FORMATS = ("png", "svg", "pdf")
WIDTH_IN = 8.0
SMALL_PT = 8.0

# Okabe and Ito: can be distinguished with every kind of colour vision
BLACK, ORANGE, SKY, GREEN = "#1a1a1a", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILLION, PURPLE, GREY = "#0072B2", "#D55E00", "#CC79A7", "#8c8c8c"
SERIES = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK, GREY)
DASHED, DOTTED = (0, (5.0, 1.8)), (0, (1.4, 1.4))
DASH_DOTTED = (0, (6.0, 1.5, 1.4, 1.5))
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
    "figure.constrained_layout.h_pad": 0.05,
    "figure.constrained_layout.w_pad": 0.08,
    "figure.dpi": 110.0,
    "figure.titlesize": 10.0,
    "figure.titleweight": "bold",
    "font.family": ["DejaVu Sans"],  # comes with matplotlib: the same everywhere
    "font.size": 9.0,
    "grid.color": "#e3e3e3",
    "image.cmap": SCALE,
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


@dataclass(frozen=True)
class FigurePlan:
    """One figure: its file's name without ending, heading, caption, alternative text, drawing."""

    name: str
    heading: str
    caption: str
    alt: str
    draw: Callable[[], Figure]


def render(plans: Sequence[FigurePlan], formats: Sequence[str] = FORMATS[:1]) -> dict[str, bytes]:
    """Each figure in each format of `FORMATS` asked for, by file name."""
    files: dict[str, bytes] = {}
    if not plans or not formats:
        return files
    with applied():
        for plan in plans:
            figure = plan.draw()
            for kind in formats:
                files[f"{plan.name}.{kind}"] = encoded(figure, kind)
    return files


def encoded(figure: Figure, kind: str) -> bytes:
    """The figure as a file of one of `FORMATS`, without date: the same bytes every time."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    data, metadata = io.BytesIO(), _METADATA[kind]
    if kind == "png":  # savefig draws twice where it has a layout to settle
        canvas: Any = FigureCanvasAgg(figure)
        canvas.print_png(data, metadata=metadata)
    else:
        figure.savefig(data, format=kind, metadata=metadata)
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


def new_figure(
    title: str, height: float, width: float = WIDTH_IN, *, layout: str | None = "constrained"
) -> Figure:
    """An empty figure, inches, with its title; ``layout`` None where positions are given."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure((width, height), layout=layout)  # type: ignore[arg-type]
    FigureCanvasAgg(figure)
    if title:
        place: dict[str, Any] = {} if layout else {"y": 1.0 - 0.1 / height}
        heading = figure.suptitle(title, x=0.1 / width, ha="left", va="top", **place)
        length = len(title)
        while heading.get_window_extent().width > 0.97 * figure.bbox.width:
            length -= 5
            heading.set_text(short(title, length))
    return figure


def legend_above(axes: Axes, handles: Sequence[Artist]) -> None:
    """A legend between title and axes that hides nothing, in as many columns as fit."""
    lengths = [len(str(handle.get_label())) for handle in handles]
    columns = next(n for n in range(len(handles), 0, -1) if n == 1 or _width(lengths, n) <= 100)
    axes.legend(handles=list(handles), loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns)


def _width(lengths: Sequence[int], columns: int) -> int:
    """Of a legend in characters; matplotlib fills one column after the other."""
    full, more = divmod(len(lengths), columns)
    ends = np.cumsum([0] + [full + 1] * more + [full] * (columns - more))
    return sum(max(lengths[a:b]) + 8 for a, b in pairwise(ends))


def series(number: int) -> dict[str, Any]:
    """The ``number``-th of any count of like curves: no two neighbours differ by colour alone."""
    dashes = ("solid", DASHED, DOTTED, DASH_DOTTED)
    line = dashes[(number // len(SERIES) + number) % len(dashes)]
    return {"color": SERIES[number % len(SERIES)], "linestyle": line}


def labelled(quantity: str, unit: str) -> str:
    """``frequency [Hz]``."""
    return f"{quantity} [{unit}]" if unit else quantity


def short(text: str, length: int = 34) -> str:
    """A user's name, without control characters and shortened in its middle."""
    clean = "".join(c if unicodedata.category(c)[0] != "C" else " " for c in text).strip()
    if len(clean) <= length:
        return clean
    head = length * 2 // 3
    return f"{clean[:head]}…{clean[head + 1 - length :]}"


def bounds(values: Sequence[Floats]) -> tuple[float, float]:
    """Smallest and largest finite value; apart even where all are equal but for round-off.

    A relative spread below 1e-6 is drawn as a level line, not as enlarged round-off.
    """
    found = _finite(values)
    low, high = (float(found.min()), float(found.max())) if found.size else (0.0, 1.0)
    size = max(abs(low), abs(high))
    if high - low > 1e-6 * size:
        return low, high
    middle, half = (low + high) / 2.0, 0.02 * size or 0.5
    return middle - half, middle + half


def decades(values: Sequence[Floats], most: int | None = None) -> tuple[float, float]:
    """Whole decades that hold all positive ``values``, or the ``most`` highest of them."""
    found = _finite(values)
    found = found[found > 0.0]
    if not found.size:
        return 1e-11, 1e-10
    top = math.ceil(math.log10(found.max()) + 0.02)
    bottom = min(math.floor(math.log10(found.min()) - 0.02), top - 1)
    if most is not None:
        bottom = max(bottom, top - most)
    return 10.0**bottom, 10.0**top


def _finite(values: Sequence[Floats]) -> Floats:
    found = np.concatenate([np.ravel(v) for v in values] or [np.zeros(0)])
    return np.asarray(found[np.isfinite(found)])


def logarithmic(axes: Axes, which: str, limits: tuple[float, float], *, cut: bool = False) -> None:
    """Make axis ``which`` logarithmic; ``cut``: the lowest label says ≤, for values below it."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set(**{f"{which}scale": "log", f"{which}lim": limits})
    axis = axes.xaxis if which == "x" else axes.yaxis
    axis.set_major_locator(LogLocator(numticks=9))
    axis.set_minor_formatter(NullFormatter())
    low = limits[0] * (1.0 + 1e-9)
    axis.set_major_formatter(
        FuncFormatter(lambda at, _: ("≤" if cut and at <= low else "") + power(at))
    )


def power(value: float) -> str:
    """A power of ten as people read it: ``0.01``, ``10⁻⁷``."""
    exponent = round(math.log10(value))
    if -4 <= exponent <= 4:
        return f"{10.0**exponent:g}"
    return "10" + str(exponent).translate(str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻"))
