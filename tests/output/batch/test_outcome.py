"""How a case ended, as JSON and back."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from synthetic_results import as_limit, make_results

from eigassign.output import CaseOutcome, frequency_ranges, from_plain, to_plain

ROW = CaseOutcome(
    name="tool=0.1",
    path="arm.yaml",
    status="ok",
    seconds=0.25,
    design=[["m1", 0.1 + 0.2]],
    drives=[["peak torque of q1", 1.5]],
    frequencies=[["mode 1", 180.0, 190.0, 200.0]],
    verdict="reached",
    values={"mechanism.bodies.tool.mass": "100 g"},
    index=7,
    key="ab12",
)


def through(row: CaseOutcome) -> CaseOutcome:
    return from_plain(json.loads(json.dumps(to_plain(row), allow_nan=False)))


def test_a_row_comes_back_from_json_to_the_last_bit():
    assert through(ROW) == ROW
    assert [*to_plain(ROW)][:4] == ["index", "name", "key", "values"]


def test_what_is_not_finite_is_null():
    made = replace(ROW, predicted_max_relative=math.inf, exact_max_relative=math.nan)
    assert to_plain(made)["predicted_max_relative"] is None
    assert through(made).exact_max_relative is None


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("status", ["ok"]),
        ("status", "fine"),
        ("values", None),
        ("seconds", "0.1"),
        ("design", 5),
        ("design", [["m", "1"]]),
        ("frequencies", [["mode 1", 1.0]]),
        ("name", 1),
        ("run_folder", ["a"]),
        ("run_folder", "\0"),
        ("index", 1.0),
    ],
)
def test_what_is_no_row_is_refused(name, wrong):
    with pytest.raises((ValueError, TypeError)):
        from_plain({**to_plain(ROW), name: wrong})


def test_every_range_has_a_name_of_its_own():
    results = make_results()
    (target,) = results.targets
    hz = target.exact_hz
    own = np.array([3.0, 1.0, 2.0])
    limit = as_limit(target, "at_least", hz, np.full_like(hz, np.inf))
    limit = replace(limit, asked=replace(limit.asked, trajectory="pick"), exact_hz=own)
    assert frequency_ranges(replace(results, targets=(target, target, limit))) == (
        ("mode 1", hz.min(), math.fsum(hz) / 152, hz.max()),
        ("mode 1 (2)", hz.min(), math.fsum(hz) / 152, hz.max()),
        ("mode 1 at least along 'pick'", 1.0, 2.0, 3.0),
    )
