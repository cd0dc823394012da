"""The bound on what reduced links leave out, held against the whole mechanism."""

from __future__ import annotations

import copy
import json
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chains import Tree, model_of
from designed_arm import designed
from reduced_links import random_arm, random_x, reduced_tree
from spatial_cases import built, changed
from spatial_examples import four_bar, gantry

from eigassign import Case, load_case
from eigassign.errors import AccuracyError
from eigassign.mechanism import with_elements, with_reduction
from eigassign.modal import eigenvalues
from eigassign.pipeline import Options, check, expand_case, modes
from eigassign.study import plan_expansion

MODES = (1, 2, 3)
NOISE = 1e-9  # relative round-off of the exact frequencies compared with, with room


def judged(
    tree: Tree, whole: Tree, x: np.ndarray, modes: tuple[int, ...] = MODES
) -> tuple[np.ndarray, np.ndarray]:
    """Bounds and true errors (n, n_modes) at x (n, n_x) of links that ``tree`` reduces."""
    model, fine = model_of(tree), model_of(whole)
    q, y = np.split(x, [len(model.q_names)], axis=1)
    hz, exact = (each.frequencies(q, y, modes[-1]) for each in (model, fine))
    assert model.n_dof < fine.n_dof
    return model.truncation_error(q, y, modes), hz / exact - 1.0


def compared(seed: int, design: bool) -> tuple[np.ndarray, np.ndarray]:
    """Of one random arm at random poses and designs."""
    tree, rng = random_arm(seed, design), np.random.default_rng(1000 + seed)
    whole = built(tree)
    x = np.array([random_x(whole, rng) for _ in range(3)])
    lam = eigenvalues(whole.pencil, x, 3)
    cut = np.sqrt(lam.max()) / (2.0 * np.pi) * 10.0 ** rng.uniform(-0.3, 1.2)
    return judged(reduced_tree(tree, float(cut)), tree, x)


@pytest.mark.parametrize(
    ("design", "seeds"),
    [
        (True, range(2, 8)),
        pytest.param(True, range(14), marks=pytest.mark.slow),
        pytest.param(False, range(14), marks=pytest.mark.slow),
    ],
)
def test_the_bound_is_above_the_true_error_and_near_it(design: bool, seeds: range) -> None:
    """Over arms, poses and designs: never below, within twice in 90 %, refused in few."""
    pairs = [compared(seed, design) for seed in seeds]
    bound, true = (np.concatenate(p).ravel() for p in zip(*pairs, strict=True))
    assert (true > -NOISE).all()  # Ritz: from above
    assert (bound >= true - NOISE).all()
    sure = np.isfinite(bound) & (true > 10 * NOISE)
    assert sure.sum() > 5 * len(seeds)
    assert np.quantile(bound[sure] / true[sure], 0.9) < 2
    assert true[sure].min() < 1e-4  # it was put to the test
    if len(seeds) > 10:
        assert np.mean(np.isfinite(bound)) > 0.9
        assert true[sure].max() > 1e-2
        assert true[sure].min() < 1e-5


def test_links_in_a_loop_are_bounded_too() -> None:
    tree = four_bar("free")
    for link in tree["mechanism"]["links"].values():
        link["elements"] = 8
    bound, true = judged(with_links(tree, reduce_to=1000.0), tree, np.array([[0.6], [1.9]]))
    assert (bound >= true - NOISE).all()
    assert (bound <= 2 * true + 10 * NOISE).all()


def test_links_beside_whole_ones_are_bounded_too() -> None:
    """A carriage's girder cannot be reduced, the links around it can."""
    tree = gantry("free")
    names = {n for n, link in tree["mechanism"]["links"].items() if link.get("elements")}
    names -= {j["base"] for j in tree["mechanism"]["joints"].values() if j["type"] == "carriage"}
    fine = with_links(tree, names, elements=7)
    bound, true = judged(with_links(fine, names, reduce_to=400.0), fine, np.array([[0.6]]))
    assert (bound >= true - NOISE).all()
    assert (bound <= 10 * true + 10 * NOISE).all()


def with_links(tree: Tree, names: Collection[str] | None = None, **change: float) -> Tree:
    """A copy with some links, or all, changed."""
    links = tree["mechanism"]["links"]
    changed = {n: {**link, **change} for n, link in links.items() if names is None or n in names}
    return {**tree, "mechanism": {**tree["mechanism"], "links": {**links, **changed}}}


def test_a_mode_above_what_was_kept_has_no_bound() -> None:
    tree = random_arm(1, design=False)
    bound, _ = judged(reduced_tree(tree, 1.0), tree, np.array([[0.3, 0.4]]), tuple(range(1, 7)))
    assert np.isinf(bound[0, -1])


def test_another_design_than_the_basis_was_taken_at_is_bounded() -> None:
    """Designs between the three that the basis knows, where constraint modes differ."""
    tree = random_arm(4)
    tree["design"] = {"length": {"parameter": "links.beam.length", "min": 0.3, "max": 1.0}}
    tree = changed(tree, "links.beam.length", 0.5)
    x = np.array([[0.4, -0.9, length] for length in np.linspace(0.3, 1.0, 8)])
    bound, true = judged(reduced_tree(tree, 600.0, ("beam",)), tree, x)
    assert np.isfinite(bound).all()
    assert (bound >= true - NOISE).all()
    assert np.median(bound / np.maximum(true, NOISE)) < 3


@pytest.mark.parametrize("thick", [0.004, 0.006, 0.01, 0.014, 0.025, 0.03, 0.04])
def test_designs_outside_the_bounds_are_bounded_or_refused(thick: float) -> None:
    """Far from 0.02 m, where the basis was made, other constraint modes matter most."""
    tree = designed("planar", 1e-3)
    tree["design"] = {"thick": {"parameter": "sections.a.diameter", "min": 0.0199, "max": 0.0201}}
    whole = copy.deepcopy(tree)
    for link in whole["mechanism"]["links"].values():
        del link["reduce_to"]
    bound, true = judged(tree, whole, np.array([[0.3, 0.9, thick]]), (1, 2))
    assert (bound >= true).all()
    assert np.isfinite(bound).any()


# reduce_to: auto


def automatic(tmp_path: Path, elements: int = 24, **more: Any) -> Case:
    """Two slender links of many elements, their masses design, reduced as needed."""
    link = {"length": 0.6, "material": "m", "section": "s", "reduce_to": "auto"}
    link["elements"] = elements
    tree = {
        "title": "auto",
        "mechanism": {
            "space": "planar",
            "materials": {"m": {"youngs_modulus": 70e9, "density": 2700}},
            "sections": {"s": {"shape": "circle", "diameter": 0.02}},
            "links": {"one": dict(link), "two": dict(link)},
            "joints": {
                "a": {"type": "revolute", "base": "ground", "follower": "one.start"},
                "b": {"type": "revolute", "base": "one.end", "follower": "two.start"},
            },
            "bodies": {"load": {"at": "two.end", "mass": 0.2}},
        },
        "coordinates": {"q1": {"joint": "a"}, "q2": {"joint": "b"}},
        "trajectory": {"q": [[0.0, 0.4], [0.2, 1.6]], "duration": 2.0},
        "design": {"load": {"parameter": "bodies.load.mass", "min": 0.0, "max": 0.5}},
        "expansion": {"accuracy": 1e-4, "modes": [1, 2], **more},
    }
    (tmp_path / "auto.yaml").write_text(json.dumps(tree))
    return load_case(tmp_path / "auto.yaml")


def test_auto_is_within_its_share_of_the_accuracy_and_no_finer_than_that(tmp_path: Path) -> None:
    case = automatic(tmp_path)
    model, choice = case.model(), case.reduction
    assert choice is not None
    full = Case(with_reduction(case.file, {"one": None, "two": None})).model()
    assert full.reduced is None
    q, y = np.array([[0.0, 0.4], [0.1, 1.0], [0.2, 1.6]]), [0.3]
    true = model.frequencies(q, y, 2) / full.frequencies(q, y, 2) - 1.0
    assert 0 < true.max() <= choice.error.max() <= 0.25e-4
    assert model.n_dof < 0.5 * full.n_dof
    assert choice.reasons[-1].startswith(f"reduced to {choice.frequencies['one']:.4g} Hz: ")
    assert "truncation error at most" in choice.reasons[-1]
    rough = automatic(tmp_path).model()
    assert automatic(tmp_path, accuracy=1e-2).model().n_dof < rough.n_dof


def test_auto_leaves_small_links_whole_and_says_so(tmp_path: Path) -> None:
    case = automatic(tmp_path)
    few = with_elements(case.file, {"one": 2, "two": 2})
    small = Case(few)
    assert small.model().reduced is None
    assert small.reduction is not None
    assert small.reduction.reasons[-1] == "not reduced, because it saves too little: one, two"


def test_an_automatic_order_refuses_links_reduced_too_far(tmp_path: Path) -> None:
    case = automatic(tmp_path, order="auto")
    coarse = Case(with_reduction(case.file, {"one": 60.0, "two": 60.0}))
    x = np.array([[0.1, 1.0, 0.2]])
    assert coarse.model().truncation_error(x[:, :2], x[:, 2:], (1, 2)).max() > 0.25e-4
    with pytest.raises(AccuracyError, match=r"reduced links have an error .*: raise reduce_to"):
        plan_expansion(coarse.file, coarse.model(), coarse.trajectory)


def test_a_run_states_what_its_reduced_links_leave_out(tmp_path: Path) -> None:
    case = automatic(tmp_path, 12)
    for answer in (check(case.file.path), expand_case(case.file.path, Options(out=tmp_path / "r"))):
        notes = getattr(answer, "notes", None) or answer.results.notes
        said = [n for n in notes if "reduced links raise its frequency by" in n]
        assert [n[:7] for n in said] == ["mode 1:", "mode 2:"]
    found = modes(case.file.path, [0.1, 1.0], [0.2], 2)
    assert found.truncation_error is not None
    assert 0.0 < max(found.truncation_error) < 1e-3


def test_a_run_is_refused_where_the_truncation_cannot_be_bounded(tmp_path: Path) -> None:
    text = automatic(tmp_path, modes=[5]).file.path.read_text()
    text = text.replace('"reduce_to": "auto"', '"reduce_to": 1e-3')
    (tmp_path / "far.yaml").write_text(text)
    with pytest.raises(AccuracyError, match=r"has no bound over .*: raise reduce_to"):
        expand_case(tmp_path / "far.yaml", Options(out=tmp_path / "r"))
    assert not (tmp_path / "r").exists()
