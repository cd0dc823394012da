"""Stages are timed, and say how far they are while they last."""

import threading

import pytest

from eigassign.pipeline import Stages, silent


class Lines:
    """Collects lines of progress; ``wait`` returns when there are so many of one stage."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self._changed = threading.Condition()

    def __call__(self, line: str) -> None:
        with self._changed:
            self.lines.append(line)
            self._changed.notify_all()

    def wait(self, count: int) -> None:
        with self._changed:
            assert self._changed.wait_for(lambda: len(self.lines) >= count, timeout=30)


def test_a_stage_that_lasts_says_how_far_it_is() -> None:
    lines = Lines()
    stages = Stages(lines, pause_s=0.01)
    with stages("expansion", "expanding"):
        lines.wait(2)
        stages.tell("start 2")
        stages.advance(7, 8)
        lines.wait(len(lines.lines) + 2)
    assert lines.lines[0] == "expanding"
    assert lines.lines[1] == "  expanding: 0 s"
    assert "  expanding: start 2, 0 s" in lines.lines
    assert lines.lines[-1] == "  expanding: 7 of 8, 0 s, about 0 s left"
    count = len(lines.lines)
    with stages("expansion", "again"):
        lines.wait(count + 2)
    assert lines.lines[-1] == "  again: 0 s"  # nothing is left of the stage before
    assert list(stages.timing_s) == ["expansion"]


def test_a_stage_ends_its_progress_with_an_error_too_and_silent_ones_start_no_thread() -> None:
    before = threading.active_count()
    with pytest.raises(ValueError, match="bad"), Stages(Lines(), pause_s=60.0)("a", "b"):
        raise ValueError("bad")
    with Stages(silent)("a", "b"):
        assert threading.active_count() <= before + 1
    for thread in threading.enumerate():
        if thread.daemon and thread is not threading.current_thread():
            thread.join(timeout=5)
    assert threading.active_count() <= before
