"""What callers get wrong from Python: answered by name, never by an error of NumPy's."""

from pathlib import Path

import numpy as np
import pytest
from chains import model_of, two_link

from eigassign import expand, load_case, reduce
from eigassign.errors import EigassignError, UsageError
from eigassign.modal import Model
from eigassign.modal import expand as expand_pencil
from eigassign.series import lower_set

CASE = Path(__file__).parents[2] / "cases" / "two_link.yaml"
Q0, Y0 = [1.817, 5.312], [0.125, 0.125]


@pytest.fixture(scope="module")
def model() -> Model:
    return model_of(two_link())


WRONG_MODES = [
    ((), "at least one is needed"),
    ((1.5,), "a mode must be a whole number, not 1.5"),
    ((1.0,), "a mode must be a whole number, not 1.0"),
    (("a",), "a mode must be a whole number, not 'a'"),
    ("1", "a mode must be a whole number, not '1'"),
    ((True,), "not True"),
    ((np.nan,), "not nan"),
    ([[1, 2]], "a mode must be a whole number"),
    ((2, 1, 2), "mode 2 is asked for twice"),
    ((-1,), "modes count from 1"),
    ((0, 1), "modes count from 1"),
    (1, "modes must be a sequence of whole numbers, not 1"),
    (None, "modes must be a sequence of whole numbers, not None"),
    ((10**6,), "1000000 modes asked for"),
]


@pytest.mark.parametrize("face", ["expand", "reduce"])
@pytest.mark.parametrize(("modes", "words"), WRONG_MODES)
def test_modes_that_are_none_are_refused(model, face, modes, words):
    calls = {
        "expand": lambda: expand(model, Q0, Y0, modes=modes),
        "reduce": lambda: reduce(model, Q0, Y0, modes=modes),
    }
    with pytest.raises(UsageError, match=words):
        calls[face]()


@pytest.mark.parametrize("face", [expand, reduce])
def test_a_case_in_place_of_its_model_is_refused_with_the_way_to_the_model(face):
    case = load_case(CASE)
    with pytest.raises(UsageError, match=r"not Case: .*case\.model\(\)"):
        face(case, Q0, Y0)
    with pytest.raises(UsageError, match="not str"):
        face("arm", Q0, Y0)


def test_modes_may_come_as_an_array_and_in_any_order(model):
    assert expand(model, Q0, Y0, modes=np.array([2, 1]), order=2).modes == (1, 2)
    assert reduce(model, Q0, Y0, modes=np.array([2, 1]), half_order=1).modes == (1, 2)


@pytest.mark.parametrize("order", [2.5, 4.0, "4", None, np.nan, True, -1, 21])
def test_an_order_that_is_none_is_refused(model, order):
    with pytest.raises(UsageError, match="order"):
        expand(model, Q0, Y0, order=order)
    with pytest.raises(UsageError, match="half_order"):
        reduce(model, Q0, Y0, half_order=order)
    with pytest.raises(UsageError, match="half_order"):
        reduce(model, Q0, Y0, half_order=0)
    if order is not None:
        with pytest.raises(UsageError, match="vector_order"):
            expand(model, Q0, Y0, vector_order=order)


@pytest.mark.parametrize("count", [0, -1, 1.5, None, "a", True, 10**6])
def test_a_count_of_modes_that_is_none_is_refused(model, count):
    with pytest.raises(UsageError, match=r"count must be a whole|modes asked for"):
        model.frequencies(Q0, Y0, count)


WRONG_SAMPLES = [
    ([np.nan, 1.0], "must be finite"),
    ([np.inf, 1.0], "must be finite"),
    (None, "1 values; expected 2|must be finite"),
    ([1.0], "has 1 values; expected 2"),
    ([], "has 0 values; expected 2"),
    (1j, "must be real numbers"),
    (["a", "b"], "must be real numbers"),
    ([[1.0, 2.0], [3.0]], "must be real numbers, every sample with as many"),
    ([[[1.0, 2.0]]], r"has shape \(1, 1, 2\)"),
    ([[1.0, 2.0, 3.0]], r"has shape \(1, 3\)"),
]


@pytest.mark.parametrize(("wrong", "words"), WRONG_SAMPLES)
def test_samples_that_are_none_are_refused(model, wrong, words):
    series, reduced = expand(model, Q0, Y0, order=2), reduce(model, Q0, Y0, half_order=1)
    for ask in (
        model.frequencies,
        model.modes,
        model.matrices,
        series.frequencies,
        series.eigenvalues,
        series.slopes,
        reduced.frequencies,
        lambda q, y: expand(model, q, y),
        lambda q, y: reduce(model, q, y),
    ):
        with pytest.raises(UsageError, match=words):
            ask(wrong, Y0)
        with pytest.raises(UsageError, match=words):
            ask(Q0, wrong)


def test_an_expansion_has_one_point(model):
    with pytest.raises(UsageError, match="2 samples of q and y; one point"):
        expand(model, [Q0, Q0], Y0)


def test_no_samples_have_no_frequencies(model):
    none = np.zeros((0, 2))
    reduced = reduce(model, Q0, Y0, half_order=1)
    for ask in (model.frequencies, reduced.frequencies):
        assert len(ask(none, Y0)) == 0


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ([], "the constant at least"),
        (np.zeros((0, 4)), "the constant at least"),
        ([[0.5, 0.0]], "whole numbers"),
        ([[np.nan, 0.0]], "whole numbers"),
        ([[0, 0], [0]], "whole numbers, all as long"),
        ("x", "whole numbers"),
        ([[[0, 0]]], "whole numbers"),
        ([[0, -1]], "must not be negative"),
        ([[1, 0]], "not a lower set"),
    ],
)
def test_a_lower_set_that_is_none_is_refused(rows, words):
    with pytest.raises(UsageError, match=words):
        lower_set(rows)


def test_a_list_is_not_a_lower_set(model):
    with pytest.raises(UsageError, match="space must be a lower set, not list"):
        expand(model, Q0, Y0, space=[[0, 0, 0, 0]])


@pytest.mark.parametrize("gap", [-0.1, np.nan, np.inf, "a", None])
def test_a_gap_that_is_none_is_refused(model, gap):
    with pytest.raises(UsageError, match="cluster_gap"):
        expand_pencil(model.pencil, Q0, Y0, cluster_gap=gap)


def test_nothing_else_escapes_than_our_own_errors(model):
    for call in (lambda: expand(model, "x", Y0), lambda: model.matrices([Q0, Q0], Y0)):
        with pytest.raises(EigassignError):
            call()
