"""The stages of a run: announced as they begin, heard of while they last, timed as they end.

A stage that lasts says every few seconds how far it is, in a line of progress that begins with two
spaces. Where pieces are counted, the time left is that of those to come. Where only an estimate of
the whole is known, it is what is left of that at the pace of this process so far, which others on
the machine may slow down.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread
from time import perf_counter, process_time

FIRST_S, MOST_S = 2.0, 10.0  # between two lines of one stage: each twice as long as the one before


def silent(_line: str) -> None:
    """No progress is shown."""


class Stages:
    """A stopwatch with a lap for each stage; ``timing_s`` holds them in the order they ran."""

    def __init__(self, progress: Callable[[str], None], first_s: float = FIRST_S) -> None:
        self.timing_s: dict[str, float] = {}
        self._progress = progress
        self._first_s = first_s
        self._start, self._began = perf_counter(), process_time()
        self._expected_s: float | None = None
        self._counted: tuple[int, int] | None = None

    @contextmanager
    def __call__(self, name: str, announcement: str) -> Iterator[None]:
        """Announce the stage, run the body, and add what it took to the stage ``name``."""
        self._progress(announcement)
        self._expected_s = self._counted = None
        start, over = perf_counter(), Event()
        self._began = process_time()
        clock = Thread(target=self._tell, args=(start, over), daemon=True)
        if self._progress is not silent:
            clock.start()
        try:
            yield
        finally:
            over.set()
        self.timing_s[name] = self.timing_s.get(name, 0.0) + perf_counter() - start

    def expect(self, seconds: float) -> None:
        """From now the stage will take about so long on an idle machine, as far as is known."""
        self._expected_s = process_time() - self._began + seconds

    def advance(self, done: int, of: int) -> None:
        """So many pieces of the stage are done."""
        self._counted = (done, of)

    def _tell(self, start: float, over: Event) -> None:
        pause = self._first_s
        while not over.wait(pause):
            pause = min(2.0 * pause, MOST_S)
            self._progress(f"  {self._far(perf_counter() - start)}")

    def _far(self, spent_s: float) -> str:
        if self._counted is not None and self._counted[0]:
            done, of = self._counted
            return f"{done} of {of}, {_left(spent_s * (of - done) / done)}"
        worked_s = process_time() - self._began
        if self._expected_s is not None and self._expected_s > worked_s > 0.0:
            return f"{spent_s:.0f} s, {_left((self._expected_s / worked_s - 1.0) * spent_s)}"
        return f"{spent_s:.0f} s"

    @property
    def total_s(self) -> float:
        """Seconds since the first stage was to begin."""
        return perf_counter() - self._start


def _left(seconds: float) -> str:
    return f"some {seconds:.0f} s left" if seconds < 100.0 else f"some {seconds / 60:.0f} min left"
