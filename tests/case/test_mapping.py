"""A case given as a mapping is the case that a file with the same content is."""

from collections import OrderedDict
from fractions import Fraction
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
import yaml

import eigassign as ea
from eigassign.case import from_mapping, load
from eigassign.errors import CaseError

TWO_LINK = Path(__file__).parents[2] / "cases" / "two_link.yaml"


@pytest.fixture
def content() -> dict[str, Any]:
    found: dict[str, Any] = yaml.safe_load(TWO_LINK.read_text(encoding="utf-8"))
    return found


def test_it_is_the_case_of_the_file(content: dict[str, Any]) -> None:
    assert from_mapping(content) == load(TWO_LINK)
    model = ea.load_case(content).model()
    assert model.frequencies([1.817, 5.312], [0.125, 0.125], 1)[0, 0] == pytest.approx(193.113002)


def test_arrays_numbers_of_numpy_and_other_mappings_are_taken(content: dict[str, Any]) -> None:
    motion = content["trajectory"]
    motion["waypoints"] = np.array(motion["waypoints"])
    motion["samples"] = np.int64(motion["samples"])
    motion["duration"] = np.float64(1.0)
    content["trajectory"] = MappingProxyType(OrderedDict(motion))
    assert from_mapping(content) == load(TWO_LINK)


def test_all_problems_are_named_by_their_keys_without_lines(content: dict[str, Any]) -> None:
    content["trajectory"]["duration"] = "1 kg"
    content["design"]["m1"]["mx"] = 3
    with pytest.raises(CaseError) as caught:
        ea.load_case(content)
    first, second = str(caught.value).splitlines()
    assert first.startswith("case: design.m1.mx: unknown key; did you mean 'max'?")
    assert second.startswith("case: trajectory.duration: expected a time")


def test_what_no_file_could_hold_is_named_first(content: dict[str, Any]) -> None:
    content["trajectory"]["duration"] = "1 kg"
    content["title"] = Fraction(1, 3)
    content["mechanism"][7] = "seven"
    with pytest.raises(CaseError) as caught:
        ea.load_case(content)
    assert str(caught.value).splitlines() == [
        "case: mechanism: keys must be printable text, got 7",
        "case: title: expected printable text, a number, a mapping or a sequence, got a Fraction",
    ]


def test_a_mechanism_that_cannot_be_is_named_by_its_key(content: dict[str, Any]) -> None:
    content["trajectory"]["waypoints"][1] = [3.0, 0.19]
    with pytest.raises(CaseError, match=r"^case: trajectory"):
        _ = ea.load_case(content).trajectory


def test_a_mapping_within_itself_is_refused(content: dict[str, Any]) -> None:
    content["mechanism"]["links"] = content["mechanism"]
    with pytest.raises(CaseError, match="nested more than 50 levels deep"):
        ea.load_case(content)


@pytest.mark.parametrize("text", ["\x00", "\ud800"])
def test_text_that_no_file_can_hold_is_refused(content: dict[str, Any], text: str) -> None:
    content["title"] = text
    with pytest.raises(CaseError, match="case: title: expected printable text"):
        ea.load_case(content)
