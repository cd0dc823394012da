"""What reduced links change: stated as against the whole links, and kept within its share."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chains import model_of
from reduced_links import random_arm, random_x, reduced_tree
from spatial_cases import built, linkage

from eigassign import Case, load_case
from eigassign.mechanism import with_elements, with_reduction
from eigassign.modal import eigenvalues
from eigassign.pipeline import Options, check, expand_case, modes

MODES = (1, 2, 3)
NOISE = 1e-9  # relative round-off of the exact frequencies compared with, with room


@pytest.mark.parametrize("seed", range(14))
def test_the_error_is_that_against_the_whole_mechanism(seed: int) -> None:
    """Of random arms at poses and designs beside those that the basis was made at."""
    tree, rng = random_arm(seed), np.random.default_rng(1000 + seed)
    whole = built(tree)
    x = np.array([random_x(whole, rng) for _ in range(3)])
    exact = np.sqrt(eigenvalues(whole.pencil, x, 3)) / (2.0 * np.pi)
    cut = exact.max() * 10.0 ** rng.uniform(-0.3, 1.2)
    model = model_of(reduced_tree(tree, float(cut)))
    assert model.n_dof < whole.pencil.n_dof
    q, y = np.split(x, [len(model.q_names)], axis=1)
    true = model.frequencies(q, y, 3) / exact - 1.0
    assert (true > -NOISE).all()  # Ritz: from above
    np.testing.assert_allclose(model.truncation_error(q, y, MODES), true, atol=NOISE)


# reduce_to: auto


def automatic(tmp_path: Path, elements: int = 24, **more: Any) -> Case:
    """Two slender links of many elements, their masses design, reduced as needed."""
    link = {"length": 0.6, "material": "m", "section": "s", "reduce_to": "auto"}
    link["elements"] = elements
    tree = linkage(
        {"one": dict(link), "two": dict(link)},
        {
            "a": {"type": "revolute", "base": "ground", "follower": "one.start"},
            "b": {"type": "revolute", "base": "one.end", "follower": "two.start"},
        },
        {"q1": {"joint": "a"}, "q2": {"joint": "b"}},
        material={"youngs_modulus": 70e9, "density": 2700},
        bodies={"load": {"at": "two.end", "mass": 0.2}},
    ) | {
        "title": "auto",
        "trajectory": {"q": [[0.0, 0.4], [0.2, 1.6]], "duration": 2.0},
        "design": {"load": {"parameter": "bodies.load.mass", "min": 0.0, "max": 0.5}},
        "expansion": {"accuracy": 1e-4, "modes": [1, 2], **more},
    }
    (tmp_path / "auto.yaml").write_text(json.dumps(tree))
    return load_case(tmp_path / "auto.yaml")


def test_auto_is_within_its_share_of_the_accuracy_and_no_finer_than_that(tmp_path: Path) -> None:
    case = automatic(tmp_path)
    model, choice = case.model(), case.settled.reduction
    assert choice.error <= 0.25e-4
    full = Case(with_reduction(case.file, {"one": None, "two": None})).model()
    assert not full.is_reduced
    q, y = np.array([[0.0, 0.4], [0.1, 1.0], [0.2, 1.6]]), [0.3]
    true = model.frequencies(q, y, 2) / full.frequencies(q, y, 2) - 1.0
    assert 0 < true.max() < 1.1 * choice.error
    assert model.n_dof < 0.5 * full.n_dof
    assert choice.reasons[-1].startswith(f"reduced to {choice.values['one']:.4g} Hz: ")
    assert choice.reasons[-1].endswith("% too high")
    rough = automatic(tmp_path).model()
    assert automatic(tmp_path, accuracy=1e-2).model().n_dof < rough.n_dof


def test_auto_leaves_small_links_whole_and_says_so(tmp_path: Path) -> None:
    case = automatic(tmp_path)
    few = with_elements(case.file, {"one": 2, "two": 2})
    small = Case(few)
    assert not small.model().is_reduced
    assert (
        small.settled.reduction.reasons[-1] == "not reduced, because it saves too little: one, two"
    )


def test_a_run_states_what_its_reduced_links_leave_out(tmp_path: Path) -> None:
    case = automatic(tmp_path, 12)
    for answer in (check(case.file.path), expand_case(case.file.path, Options(out=tmp_path / "r"))):
        notes = getattr(answer, "notes", None) or answer.results.notes
        said = [n for n in notes if "reduced links raise its frequency by" in n]
        assert [n[:7] for n in said] == ["mode 1:", "mode 2:"]
    found = modes(case.file.path, [0.1, 1.0], [0.2], 2)
    assert 0.0 < max(found.truncation_error) < 1e-3


def test_a_mode_beyond_the_kept_ones_is_said_to_be_far_too_high(tmp_path: Path) -> None:
    text = automatic(tmp_path, modes=[5]).file.path.read_text()
    text = text.replace('"reduce_to": "auto"', '"reduce_to": 1e-3')
    (tmp_path / "far.yaml").write_text(text)
    notes = expand_case(tmp_path / "far.yaml", Options(out=tmp_path / "r")).results.notes
    (said,) = (n for n in notes if "reduced links raise its frequency by" in n)
    assert float(said.split("about ")[1].split(" %")[0]) > 50.0
