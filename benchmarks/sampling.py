"""Where processor time goes: the Python stack looked at every millisecond.

cProfile sees neither operators nor LAPACK wrappers. A signal's handler runs only once C code has
returned, on whatever line calls something next: large products would be charged to their
neighbours. So a thread looks, which may run while NumPy is within a product, and charges the
processor time since it last looked to the line that runs. A line's category is that of the
innermost frame that has one: by its module, or by the operation on the line itself.
"""

from __future__ import annotations

import linecache
import re
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import FrameType
from typing import NamedTuple

PACKAGE = str(Path(__file__).parents[1] / "eigassign") + "/"
OURS = "ours/"  # what stands for it in a frame
INTERVAL = 1e-3  # s between looks
SWITCH = 1e-4  # s after which Python code lets the thread look
LINEAR, SERIES, READING = "linear algebra", "series arithmetic", "reading the case"
OUTPUT, IMPORTS, BUILDING = "output", "imports", "building the model"
FOLLOWING, REST = "following the trajectory", "rest"
CATEGORIES = (IMPORTS, READING, OUTPUT, LINEAR, SERIES, BUILDING, FOLLOWING, REST)
MODULES = (  # first match wins; no match looks at the caller
    (r"(numpy|scipy)/linalg/|scipy/sparse/linalg/|/einsumfunc", LINEAR),
    (r"/(yaml|pydantic\w*)/|^ours/case/", READING),
    (r"/(h5py|jinja2|matplotlib|json|click)/", OUTPUT),
    (r"^ours/(output/|cli|keeping|signals|teller|failures)", OUTPUT),
    (r"^ours/series/", SERIES),
    (r"^ours/mechanism/(tip_|paths|trajector|inverse_kin|point_to_p|timing|course)", FOLLOWING),
    (r"^ours/mechanism/", BUILDING),
    (r"^ours/", REST),
)
# Products, factorisations and solves; elementwise work on matrices is not among them.
OPERATION = re.compile(
    r"\S @ \S|linalg\.|einsum|tensordot|lapack\.|blas\.|\.solve\(|\bsolve\(|splu|eigsh?\(|"
    r"eigvalsh|cholesky|\bqr\(|\bsvd\("
)
NUMERIC = re.compile(r"^ours/(modal|assignment|study|mechanism|series)/")
SPARSE_PRODUCT = re.compile(r"scipy/sparse/_(compressed|base|csr|csc|data)\.py")
# What others do for us, called from a line of ours or of theirs
THEIRS = re.compile(r"/(yaml|pydantic\w*|h5py|jinja2|matplotlib|json|click)/")
TRANSFER = re.compile(
    r"yaml\.|zlib|crc32|sha256|draw_path|draw_text|buffer_rgba|b64encode|fsync|\bopen\(|"
    r"os\.replace|\.write\w*\(|\.read\w*\(|\.validate\w*\("
)


class Frame(NamedTuple):
    """One line of a stack."""

    file: str
    line: int
    function: str


Stack = tuple[Frame, ...]  # innermost first


@dataclass(frozen=True)
class Profile:
    """Processor time of one call: by category, and by function of ours."""

    seconds: float
    categories: dict[str, float]  # shares of ``seconds``
    functions: dict[str, float]  # shares, without linear algebra, imports and the work of others


def profile(job: Callable[[], object], enough: float) -> Profile:
    """Profile as many calls as take ``enough`` seconds of processor time, at least one."""
    watch = _Watch()
    start, calls = time.process_time(), 0
    with watch:
        while not calls or time.process_time() - start < enough:
            job()
            calls += 1
    total = sum(watch.seconds.values())
    categories: dict[str, float] = defaultdict(float)
    functions: dict[str, float] = defaultdict(float)
    for stack, spent in watch.seconds.items():
        category = category_of(stack)
        categories[category] += spent / total
        if category not in (LINEAR, IMPORTS) and not _of_others(stack):
            functions[_our_function(stack)] += spent / total
    return Profile(total / calls, _sorted(categories), _sorted(functions))


class _Watch:
    """Processor seconds by stack of the thread that made it, while it is entered."""

    def __init__(self) -> None:
        self.seconds: dict[Stack, float] = defaultdict(float)
        self._watched = threading.get_ident()
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._look, daemon=True)

    def __enter__(self) -> None:
        self._interval = sys.getswitchinterval()
        sys.setswitchinterval(SWITCH)
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self._done.set()
        self._thread.join()
        sys.setswitchinterval(self._interval)

    def _look(self) -> None:
        last = time.process_time()
        while not self._done.wait(INTERVAL):
            stack = _stack(sys._current_frames().get(self._watched))
            now = time.process_time()
            self.seconds[stack] += now - last
            last = now


def _stack(frame: FrameType | None) -> Stack:
    found = []
    while frame is not None:
        code = frame.f_code
        found.append(
            Frame(code.co_filename.replace(PACKAGE, OURS), frame.f_lineno or 0, code.co_name)
        )
        frame = frame.f_back
    return tuple(found)


def _sorted(shares: dict[str, float]) -> dict[str, float]:
    return dict(sorted(shares.items(), key=lambda item: -item[1]))


def category_of(stack: Stack) -> str:
    """The category of the line that runs."""
    if any("importlib" in frame.file for frame in stack):
        return IMPORTS
    return next((c for c in map(_of_frame, stack) if c is not None), REST)


def _of_frame(frame: Frame) -> str | None:
    if SPARSE_PRODUCT.search(frame.file) and "mul" in frame.function:
        return LINEAR
    if NUMERIC.search(frame.file) and OPERATION.search(_source(frame)):
        return LINEAR
    return _of_module(frame.file)


@cache
def _of_module(file: str) -> str | None:
    return next((c for pattern, c in MODULES if re.search(pattern, file)), None)


def _source(frame: Frame) -> str:
    return linecache.getline(frame.file.replace(OURS, PACKAGE), frame.line)


def _of_others(stack: Sequence[Frame]) -> bool:
    """Whether a library reads, draws or writes: its frame lies within ours, or ours calls its C."""
    for frame in stack:
        if THEIRS.search(frame.file):
            return True
        if frame.file.startswith(OURS):
            return _of_module(frame.file) in (READING, OUTPUT) and bool(
                TRANSFER.search(_source(frame))
            )
    return False


def _our_function(stack: Stack) -> str:
    for frame in stack:
        if frame.file.startswith(OURS):
            return f"{frame.file.removeprefix(OURS)}: {frame.function}"
    return "outside eigassign"
