"""Methods are judged where none has looked."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from charts import CASES, SMALL, charted, random_arm

from eigassign import load_case
from eigassign.chart import build_subject, list_methods
from eigassign.errors import AccuracyError


class Watched:
    """A model that keeps the points at which it is solved."""

    def __init__(self, model: Any) -> None:
        self._model, self.solved = model, list[np.ndarray]()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._model, name)

    def frequencies(self, q: np.ndarray, y: np.ndarray, count: int) -> np.ndarray:
        self.solved.append(np.hstack([q, y]))
        return self._model.frequencies(q, y, count)


ARMS = [(m, d) for m in ("none", "one", "several", "tip") for d in ("none", "mass", "length")][1:]


@pytest.mark.parametrize(("motion", "design"), ARMS)
def test_no_method_solves_at_a_test_point_and_these_lie_between_samples(
    motion: str, design: str, tmp_path: Path
) -> None:
    case = tmp_path / "arm.yaml"
    case.write_text(random_arm(motion, design, ARMS.index((motion, design))))
    subject, why = build_subject(load_case(case))
    assert not why
    if subject.path is not None:
        assert subject.path.follows_design is ((motion, design) == ("tip", "length"))
    effort = replace(SMALL, learnt=(12, 30))
    tests = subject.tested(effort)
    exact = subject.exact(tests.x)
    assert np.isfinite(exact).all()
    watched = replace(subject, model=Watched(subject.model))
    judged = 0
    for method in list_methods(watched, effort):
        if method.curve.startswith("exact"):
            continue  # those that solve wherever they are asked
        try:
            built = method.build(watched.learnt(method.learns) if method.learns else tests[:0])
        except AccuracyError:
            continue
        judged += bool(np.isfinite(built.answer(tests)).any())
    assert judged > 15
    solved = np.vstack(watched.model.solved)
    width = np.maximum(np.ptp(np.vstack([solved, tests.x]), axis=0), 1e-3)
    apart = np.abs((solved[:, None] - tests.x) / width).max(axis=2)
    assert apart.min() > 1e-5  # golden sequences of some 1400 points keep 1/3000 apart
    lower, upper = subject.bounds
    y = subject.split(tests.x)[1]
    assert ((y >= lower) & (y <= upper)).all()
    if design != "none":
        assert {*np.unique(y)} >= {lower[0], upper[0]}
    if motion != "none":
        assert (np.abs(tests.place - np.rint(tests.place)) >= 0.05 - 1e-9).all()
        ends = [own.stop - 1 for own in subject.rows]
        assert not np.isin(np.floor(tests.place), ends).any()  # not from one path to the next


def test_what_follows_the_design_is_charted_and_a_pose_that_holds_still_is_tested(
    tmp_path: Path,
) -> None:
    (tmp_path / "tip.yaml").write_text(random_arm("tip", "length", 3))
    assert all(p.failed == 0 for p in charted(tmp_path / "tip.yaml").points)
    text = (CASES / "stress/wide_motion.yaml").read_text()
    hold = (
        "trajectory: [{name: move, q: [[0, 1], [0, 2], [0, 2.5]], duration: 1}, "
        "{name: hold, q: [[0.5, 0.5]]}]\n"
    )
    head, _, tail = text.partition("trajectory:")
    (tmp_path / "hold.yaml").write_text(f"{head}{hold}design:{tail.partition('design:')[2]}")
    subject, _ = build_subject(load_case(tmp_path / "hold.yaml"))
    tests = subject.tested(SMALL)
    held = tests.place == 3.0
    assert len(np.unique(tests.x[held], axis=0)) == len(np.unique(tests.design))
    assert (tests.x[held, :2] == 0.5).all()
