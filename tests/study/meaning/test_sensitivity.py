"""What the answer hangs on, against differences of exact frequencies and of answers."""

from pathlib import Path

import numpy as np
import pytest
from scenes import changed, scene_of

from eigassign.study import (
    Answer,
    Meaning,
    Scene,
    Studies,
    find_answer,
    solve_design,
    study_meaning,
)


def answered(
    folder: Path, text: str, studies: Studies = Studies.CHEAP
) -> tuple[Scene, Answer, Meaning]:
    scene = scene_of(folder, text)
    answer = find_answer(scene, lambda line: None)
    exact = solve_design(scene, (), answer.y)
    return scene, answer, study_meaning(scene, answer, scene.wanted, exact, 0.02, studies)


LIMITS = """
  - {mode: 2, at_least: 100 Hz}
  - {gap: {between: [1, 2], at_least: 10 Hz}}
  - {keep_out: [240 Hz, 250 Hz]}
"""


@pytest.mark.parametrize("method", ["sequential", "one_shot"])
def test_sensitivities_are_the_slopes_of_exact_frequencies(tmp_path: Path, method: str) -> None:
    text = changed(("samples: 152", "samples: 12"))
    if method == "sequential":
        text = changed(("190 Hz}\n", f"190 Hz}}{LIMITS}"), text=text)
    scene, answer, found = answered(tmp_path, f"{text}\nassignment: {{method: {method}}}\n")
    rows = {(row.parameter, row.label): row for row in found.sensitivity}
    modes = {"mode 1 at 190 Hz": (0,)}
    if method == "sequential":
        modes |= {"mode 2 at least 100 Hz": (1,)}
        assert len({label for _, label in rows}) == 5  # the gap, and modes beside the band
    step = 1e-4
    for k, name in enumerate(scene.file.design.parameters):
        # from one side: where the mass is zero there is none on the other
        here, *beside = (scene.exact(answer.y + s * step * np.eye(2)[k]) for s in (0.0, 1.0, 2.0))
        slopes = (4.0 * beside[0] - beside[1] - 3.0 * here) / (2.0 * step)
        for label, (mode,) in modes.items():
            row, of_f = rows[name, label], slopes[:, mode]
            assert row.unit == "kg"
            assert row.hz_per_unit == pytest.approx(of_f.mean(), rel=1e-5)
            assert abs(row.hz_per_unit_largest) == pytest.approx(np.abs(of_f).max(), rel=1e-5)
            share = answer.y[k] / here[:, mode] * of_f
            assert row.percent_per_percent == pytest.approx(share.mean(), rel=1e-5, abs=1e-12)


def test_a_little_more_room_gains_what_the_multiplier_says(tmp_path: Path) -> None:
    text = changed(
        ("samples: 152", "samples: 12"), ("min: 0, max: 250 g}\n  m2", "min: 0, max: 150 g}\n  m2")
    )
    _, before, found = answered(tmp_path, text)
    (row,) = [row for row in found.relaxed if row.name == "m1"]
    assert (row.kind, row.side, row.unit, row.quantity) == ("bound", "upper", "kg", "rms error")
    assert row.words.startswith(f"{1e3 * row.amount:g} g more at the upper bound of m1: rms error ")
    small = 0.01 * row.amount
    _, after, _ = answered(tmp_path, changed(("max: 150 g", f"max: {0.15 + small}"), text=text))
    gained = before.found.best.objective - after.found.best.objective
    promised = (row.before**2 - row.after**2) * small / row.amount
    assert gained == pytest.approx(promised, rel=1e-2)


def test_of_the_worst_case_a_constraint_counts_in_its_own_error(tmp_path: Path) -> None:
    text = changed(
        ("samples: 152", "samples: 12"),
        (
            "max: 250 g}\n\nexp",
            "max: 250 g}\n  constraints:\n    both: {terms: {m1: 1, m2: 1}, max: 150 g}\n\nexp",
        ),
    )
    text += "\nassignment: {objective: worst_case}\n"
    _, answer, found = answered(tmp_path, text)
    (row,) = [row for row in found.relaxed if row.kind == "constraint"]
    assert (row.name, row.unit, row.quantity) == ("both", "kg", "worst error")
    assert row.before == answer.found.best.objective
    assert row.after < row.before


def test_nothing_is_studied_that_is_not_asked_for(tmp_path: Path) -> None:
    text = changed(("samples: 152", "samples: 12"))
    assert answered(tmp_path, text, Studies.NONE)[2] == Meaning()


def test_a_limit_of_the_mass_is_relaxed_in_its_unit(tmp_path: Path) -> None:
    text = changed(
        ("samples: 152", "samples: 12"), ("\nexpansion:", "  mass: {max: 2.1 kg}\n\nexpansion:")
    )
    _, _, found = answered(tmp_path, text)
    (row,) = [row for row in found.relaxed if row.name == "design.mass"]
    assert row.words.startswith(f"{2.1 * row.amount:.3g} kg more mass: rms error ")


def test_a_mass_of_zero_is_no_limit_that_could_be_relaxed(tmp_path: Path) -> None:
    _, answer, found = answered(tmp_path, changed(("samples: 152", "samples: 12")))
    assert answer.y[1] == 0.0
    assert "m2" not in [row.name for row in found.relaxed]
