"""The search of designs ends when it is told to, and keeps the best until then."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import SHIPPED, automatic, scene_of

from eigassign.assignment import End
from eigassign.modal import Model
from eigassign.study import Found, find_optimum


def found_of(folder: Path, text: str, starts: list[str]) -> Found:
    scene = scene_of(folder, text)
    return find_optimum(scene, [], starts.append)


class PressedModel:
    """A model at whose ``call``-th design, as the search asks for it, Ctrl-C is pressed.

    It counts the samples that are solved, but those of designs that are only screened.
    """

    def __init__(self, model: Model, call: int) -> None:
        self.model, self.call, self.calls, self.samples = model, call, 0, 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self.model, name)

    def x(self, q: np.ndarray, y: np.ndarray) -> np.ndarray:
        self.calls += 1
        if self.calls == self.call:
            raise KeyboardInterrupt
        x = self.model.x(q, y)
        self.samples += len(x)
        return x


@pytest.mark.parametrize("call", [1, 3, 9, 12])
def test_ctrl_c_ends_the_whole_search_and_not_one_start_of_it(call: int, tmp_path: Path) -> None:
    scene = scene_of(tmp_path, SHIPPED)
    pressed, starts = PressedModel(scene.model, call), []
    found = find_optimum(replace(scene, model=pressed), [], starts.append)
    assert found.best.end is End.INTERRUPTED
    assert len(starts) <= 3
    assert pressed.calls <= call + 4  # what is known is judged on all samples, no step is made
    assert found.best.objective <= found.initial[1]


def test_exact_solves_are_those_of_the_search_and_of_the_answer(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, SHIPPED)
    counting = PressedModel(scene.model, 0)
    found = find_optimum(replace(scene, model=counting), [], lambda line: None)
    assert found.exact_solves == counting.samples + len(scene.path.q)


def test_no_time_leaves_the_initial_design_and_says_so(tmp_path: Path) -> None:
    starts: list[str] = []
    found = found_of(tmp_path, SHIPPED + "\nassignment: {seconds: 1e-9}\n", starts)
    assert found.best.end is End.SECONDS
    assert starts == ["  time used up: judging the best that is known", "  start 1 of 100 at most"]
    np.testing.assert_array_equal(found.best.y, [0.0, 0.0])


# An arm of two tubes with drives: three starts in a row lead to an optimum of 9.6 %, few to 4.69 %
# (SLSQP on the exact epigraph from ten starts; the better one was found once).
MANY_OPTIMA = Path(__file__).with_name("many_optima.yaml").read_text(encoding="utf-8")


def test_starts_that_agree_on_a_poor_optimum_are_not_enough(tmp_path: Path) -> None:
    found = found_of(tmp_path, MANY_OPTIMA, [])
    assert found.best.objective == pytest.approx(0.04689, rel=1e-3)
    assert len(found.optima) > 1


def test_what_is_cheapest_of_all_and_meets_all_limits_ends_the_search(tmp_path: Path) -> None:
    """F is negative there; nothing within the bounds is below it."""
    priced = MANY_OPTIMA[: MANY_OPTIMA.index("targets:")].replace("12 mm}", "12 mm, price: 2 / mm}")
    found = found_of(tmp_path, priced + "targets: [{mode: 1, at_least: 10 Hz}]\n", [])
    assert found.best.objective == pytest.approx(
        -2.0 * (found.variant.problem.cost.reference[0] - 0.002) * 1e3
    )
    assert found.starts == 1


def test_starts_go_on_until_no_half_optimum_more_is_expected(tmp_path: Path) -> None:
    tally = found_of(tmp_path, SHIPPED, []).tally
    assert (tally.starts, tally.optima, tally.unseen) == (7, 1, 0.5)


def test_two_masses_at_one_place_make_no_optima_distinct(tmp_path: Path) -> None:
    """Their sum alone is felt: every start ends at another design of one valley."""
    second = ("    tool_mass: {at: forearm.end, mass: 0}", "    more: {at: forearm.end, mass: 0}")
    more = ("  m2: {", "  m3: {parameter: bodies.more.mass, min: 0, max: 250 g}\n  m2: {")
    tally = found_of(tmp_path, automatic((second[0], "\n".join(second)), more), []).tally
    assert (tally.starts, tally.optima) == (7, 1)
