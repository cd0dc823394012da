"""The stages of a run: announced as they begin, heard of while they last, timed as they end.

A stage that lasts says every few seconds how far it is, in a line of progress that begins with two
spaces: how many of its pieces are done where they are counted, else for how long it has been going.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread
from time import perf_counter


def silent(_line: str) -> None:
    """No progress is shown."""


class Stages:
    """A stopwatch with a lap for each stage; ``timing_s`` holds them in the order they ran.

    The first line of progress comes after ``first_s``, each further one after twice as long as the
    one before, 10 s at most.
    """

    def __init__(self, progress: Callable[[str], None], first_s: float = 2.0) -> None:
        self.timing_s: dict[str, float] = {}
        self._progress, self._first_s = progress, first_s
        self._begun = perf_counter()
        self._counted = ""

    @contextmanager
    def __call__(self, name: str, announcement: str, at_once: bool = True) -> Iterator[None]:
        """Announce the stage, run the body, and add what it took to the stage ``name``.

        Not ``at_once``: announced with the first line of progress, if it lasts so long.
        """
        if at_once:
            self._progress(announcement)
        self._counted = ""
        start, over, late = perf_counter(), Event(), "" if at_once else announcement
        clock = Thread(target=self._tell, args=(start, over, late), daemon=True)
        if self._progress is not silent:
            clock.start()
        try:
            yield
        finally:
            over.set()
        self.timing_s[name] = self.timing_s.get(name, 0.0) + perf_counter() - start

    def advance(self, done: int, of: int) -> None:
        """Count the pieces of the stage that are done."""
        self._counted = f"{done} of {of}"

    def _tell(self, start: float, over: Event, late: str) -> None:
        pause = self._first_s
        while not over.wait(pause):
            pause = min(2.0 * pause, 10.0)
            if late:
                self._progress(late)
                late = ""
            self._progress(f"  {self._counted or f'{perf_counter() - start:.0f} s'}")

    @property
    def total_s(self) -> float:
        """Seconds since the first stage was to begin."""
        return perf_counter() - self._begun
