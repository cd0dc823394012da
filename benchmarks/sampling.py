"""Where processor time goes: the Python stack looked at every millisecond of it.

cProfile sees neither operators nor LAPACK wrappers. Here the stack is read when a signal arrives,
and the processor time since the last one is charged to the line that ran. A line's category is
that of the innermost frame that has one: by its module, or by the operation on the line itself.
"""

from __future__ import annotations

import linecache
import re
import signal
import time
from collections import defaultdict
from collections.abc import Callable
from types import FrameType

INTERVAL = 1e-3
LINEAR, SERIES, IO = "linear algebra", "series arithmetic", "reading and writing"
IMPORTS, BUILDING, REST = "imports", "building the model", "rest"
CATEGORIES = (IMPORTS, IO, LINEAR, SERIES, BUILDING, REST)
MODULES = (  # first match wins; None looks at the line, then at the caller
    (r"frozen importlib|importlib/", IMPORTS),
    (r"(numpy|scipy)/linalg/|scipy/sparse/linalg/|/einsumfunc", LINEAR),
    (r"/(h5py|yaml|jinja2|matplotlib|pydantic|rich|json|zipfile|gzip)/", IO),
    (r"eigassign/(output|case)/", IO),
    (r"eigassign/(cli|keeping|signals|teller)", IO),
    (r"eigassign/series/", SERIES),
    (r"eigassign/mechanism/", BUILDING),
)
OPERATION = re.compile(
    r"(?<!^)\s@\s|linalg|einsum|tensordot|lapack|\bblas\b|\.solve\(|solve\(rows|splu|eigsh?\(|"
    r"eigvalsh|cholesky|\bqr\(|\bsvd\(|_mul_|_matmul_|csr_matvec|dgemm|reduceat"
)
OURS = re.compile(r"eigassign/(modal|assignment|study|mechanism/pencil)")
SPARSE_PRODUCT = re.compile(r"scipy/sparse/_(compressed|base|csr|csc|data)\.py")


class Profile:
    """Seconds by category, and of what is not linear algebra or I/O by our own function."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self.functions: dict[str, float] = defaultdict(float)
        self._last = 0.0

    def _tick(self, _: int, frame: FrameType | None) -> None:
        now = time.process_time()
        spent, self._last = now - self._last, now
        category = category_of(frame)
        self.seconds[category] += spent
        if category not in (LINEAR, IO, IMPORTS):
            self.functions[_our_function(frame)] += spent

    def of(self, job: Callable[[], object]) -> Profile:
        """Profile one call; returns itself."""
        signal.signal(signal.SIGPROF, self._tick)
        self._last = time.process_time()
        signal.setitimer(signal.ITIMER_PROF, INTERVAL, INTERVAL)
        try:
            job()
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)
        return self


def category_of(frame: FrameType | None) -> str:
    """The category of the line that runs."""
    if _importing(frame):
        return IMPORTS
    while frame is not None:
        found = _of_frame(frame)
        if found is not None:
            return found
        frame = frame.f_back
    return REST


def _importing(frame: FrameType | None) -> bool:
    while frame is not None:
        if "importlib" in frame.f_code.co_filename:
            return True
        frame = frame.f_back
    return False


def _of_frame(frame: FrameType) -> str | None:
    code = frame.f_code
    if SPARSE_PRODUCT.search(code.co_filename) and "mul" in code.co_name:
        return LINEAR
    if OURS.search(code.co_filename):
        line = linecache.getline(code.co_filename, frame.f_lineno or 0)
        if OPERATION.search(line):
            return LINEAR
        if "mechanism" not in code.co_filename:
            return REST
    for pattern, category in MODULES:
        if re.search(pattern, code.co_filename):
            return category
    return None


def _our_function(frame: FrameType | None) -> str:
    while frame is not None:
        name = frame.f_code.co_filename
        if "eigassign/" in name:
            return f"{name.split('eigassign/')[-1]}: {frame.f_code.co_name}"
        frame = frame.f_back
    return "outside eigassign"
