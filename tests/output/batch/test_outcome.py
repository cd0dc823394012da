"""How a case ended, as one line of JSON and back."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from synthetic_results import as_limit, make_results

from eigassign.errors import StorageError
from eigassign.output import CaseOutcome, frequency_ranges, from_line, to_line

ROW = CaseOutcome(
    name="tool=0.1",
    path="arm.yaml",
    status="ok",
    seconds=0.25,
    design=[["m1", 0.1 + 0.2]],
    frequencies=[["mode 1", 180.0, 190.0, 200.0]],
    verdict="reached",
    values={"mechanism.bodies.tool.mass": "100 g"},
    index=7,
    key="ab12",
)


def test_a_row_comes_back_from_its_line_to_the_last_bit():
    line = to_line(ROW)
    assert line.startswith('{"index": 7, "name": "tool=0.1", "key": "ab12", "values": {')
    assert "\n" not in line
    assert from_line(line) == ROW


def test_what_is_not_finite_is_null():
    line = to_line(replace(ROW, predicted_max_relative=math.inf, exact_max_relative=math.nan))
    assert json.loads(line)["predicted_max_relative"] is None
    assert from_line(line).exact_max_relative is None


def test_a_torn_line_is_an_error():
    with pytest.raises(StorageError, match="has a damaged line"):
        from_line(to_line(ROW)[:-30])
    with pytest.raises(StorageError, match=r"^night/manifest\.jsonl has a damaged line"):
        from_line(to_line(ROW)[:-30], "night")


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
