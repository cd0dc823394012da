"""The stages of a run: announced as they begin, timed as they end."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter

EVERY_S = 2.0


class Stages:
    """A stopwatch with a lap for each stage; ``timing_s`` holds them in the order they ran."""

    def __init__(self, progress: Callable[[str], None]) -> None:
        self.timing_s: dict[str, float] = {}
        self._progress = progress
        self._start = perf_counter()
        self._last_line = self._start

    @contextmanager
    def __call__(self, name: str, announcement: str) -> Iterator[None]:
        """Announce the stage, run the body, and add what it took to the stage ``name``."""
        self._progress(announcement)
        start = perf_counter()
        yield
        self.timing_s[name] = self.timing_s.get(name, 0.0) + perf_counter() - start

    def advance(self, done: int, of: int) -> None:
        """Say how far a long stage is, at most every two seconds."""
        now = perf_counter()
        if now - self._last_line >= EVERY_S:
            self._last_line = now
            self._progress(f"  {done} of {of}")

    @property
    def total_s(self) -> float:
        """Seconds since the first stage was to begin."""
        return perf_counter() - self._start
