"""results.json keeps the names and numbers that programs rely on."""

import dataclasses
import json

import numpy as np
import pytest
from synthetic_results import as_limit, make_results

from eigassign.errors import EigassignError
from eigassign.output import results_document, to_json
from eigassign.study import ErrorRow, TargetStudy


def read(results) -> dict:
    return json.loads(to_json(results))


def test_the_promised_fields_are_there():
    results = make_results()
    found = read(results)
    target = results.targets[0]
    assert found["eigassign_version"] == "0.1.0"
    assert found["case"]["title"] == results.case.title
    assert found["case"]["sha256"] == results.case.sha256
    assert list(found["design"]) == ["m1", "m2"]
    limits = {k: found["design"]["m1"][k] for k in ("initial", "optimal", "lower", "upper")}
    assert limits == {"initial": 0.0, "optimal": 0.2287, "lower": 0.0, "upper": 0.25}
    for kind in ("initial", "one_shot", "predicted", "exact"):
        assert found["error"][kind] == dataclasses.asdict(getattr(target.error, kind))
        assert found["frequencies"][f"{kind}_hz"] == getattr(target, f"{kind}_hz").tolist()
    assert found["frequencies"]["time_s"] == results.time_s.tolist()
    assert found["frequencies"]["target_hz"] == target.asked.hz.tolist()
    assert found["assignment"]["verdict"] == "reached"
    assert found["assignment"]["optimality"]["kind"] == "local"
    assert [step["taken"] for step in found["assignment"]["steps"]] == [True, False, True]
    assert found["assignment"]["starts"] == 3
    (kept,) = found["targets"]
    assert (kept["kind"], kept["satisfied"]) == ("frequency", True)
    assert kept["worst"] == target.error.exact.max_relative
    solver = ("status", "iterations", "primal_residual", "dual_residual")
    assert [found["solver"][name] for name in solver] == ["solved", 25, 3.1e-17, 2.2e-14]
    assert found["timing_s"] == dict(results.timing_s)


def with_exact(target: TargetStudy, row: ErrorRow) -> TargetStudy:
    return dataclasses.replace(target, error=dataclasses.replace(target.error, exact=row))


def test_with_several_targets_the_error_is_over_all_of_them():
    results = make_results(n_targets=2)
    worse = with_exact(results.targets[1], ErrorRow(0.5, 0.3))
    better = with_exact(results.targets[0], ErrorRow(0.1, 0.4))
    found = read(dataclasses.replace(results, targets=(better, worse)))
    assert found["error"]["exact"]["max_relative"] == 0.5
    assert found["error"]["exact"]["rms_relative"] == pytest.approx(np.sqrt(0.125))
    assert [target["mode"] for target in found["targets"]] == [1, 2]
    assert found["targets"][1]["error"]["exact"]["max_relative"] == 0.5
    assert found["frequencies"] == found["targets"][0]["frequencies"]


def test_every_number_comes_back_bit_for_bit():
    results = make_results(scale_hz=np.pi)
    found = read(results)
    back = np.array(found["frequencies"]["exact_hz"])
    assert back.tobytes() == results.targets[0].exact_hz.tobytes()


def test_the_same_results_give_the_same_bytes_of_plain_json():
    results = make_results(title='"ü" \\')
    text = to_json(results)
    assert text == to_json(make_results(title='"ü" \\'))
    assert text.endswith(b"}\n")
    plain = json.dumps(results_document(results), default=lambda value: value.tolist())
    assert json.loads(text) == json.loads(plain)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_number_that_is_not_finite_is_refused_by_name(bad):
    results = make_results()
    target = with_exact(results.targets[0], ErrorRow(bad, 0.1))
    broken = dataclasses.replace(results, targets=(target,))
    with pytest.raises(EigassignError, match=r"error\.exact\.max_relative"):
        to_json(broken)
    exact = results.targets[0].exact_hz.copy()
    exact[3] = bad
    target = dataclasses.replace(results.targets[0], exact_hz=exact)
    with pytest.raises(EigassignError, match=r"frequencies\.exact_hz"):
        to_json(dataclasses.replace(results, targets=(target,)))


def test_what_an_expansion_cannot_say_is_null():
    results = make_results()
    predicted = results.targets[0].predicted_hz.copy()
    predicted[3] = np.nan
    error = dataclasses.replace(results.targets[0].error, predicted=ErrorRow(np.inf, np.inf))
    target = dataclasses.replace(results.targets[0], predicted_hz=predicted, error=error)
    study = results.studies[0]
    values = dataclasses.replace(study.over_time, linearised_hz=predicted)
    studies = (dataclasses.replace(study, over_time=values),)
    found = read(dataclasses.replace(results, targets=(target,), studies=studies))
    assert found["error"]["predicted"] == {"max_relative": None, "rms_relative": None}
    assert found["frequencies"]["predicted_hz"][2:4] == [predicted[2], None]
    assert found["approximation"][0]["max_relative"]["over_time"]["linearised"] is None


def test_a_limit_has_the_edges_that_it_has():
    results = make_results()
    (target,) = results.targets
    endless = np.full(target.asked.lower.size, np.inf)
    for kind, edges, lacking in (
        ("at_least", (target.asked.lower, endless), "upper_hz"),
        ("at_most", (-endless, target.asked.upper), "lower_hz"),
        ("keep_out", (target.asked.lower, 1.1 * target.asked.lower), None),
    ):
        limit = as_limit(target, kind, *edges)
        found = read(dataclasses.replace(results, targets=(limit,)))
        curves = found["targets"][0]["frequencies"]
        assert found["targets"][0]["kind"] == kind
        assert found["error"]["predicted"] is curves["predicted_hz"] is None
        assert [name for name in ("lower_hz", "upper_hz") if name not in curves] == (
            [lacking] if lacking else []
        )
