"""A word that is mistyped once is told once, with what was meant."""

import random
import re
from contextlib import suppress
from pathlib import Path

import pytest

import eigassign
from eigassign.case import parse
from eigassign.errors import CaseError

TEMPLATES = Path(eigassign.__file__).parent / "starters"
WORD = re.compile(r"(?<![\w.#])[a-z_]{3,}(?=[:,.}])")


def mistyped(name: str) -> list[tuple[str, str]]:
    """A template with a letter dropped from one word, for each of its keys and names, once."""
    text, rng, cases = (TEMPLATES / name).read_text(encoding="utf-8"), random.Random(4), []
    for found in WORD.finditer(text):
        line = text[text.rfind("\n", 0, found.start()) + 1 : found.start()]
        if "#" not in line and found[0] not in ("title", "author"):
            k = found.start() + rng.randrange(1, len(found[0]) - 1)
            cases.append((found[0], text[:k] + text[k + 1 :]))
    return cases


@pytest.mark.parametrize("name", ["planar_arm.yaml", "spatial_arm.yaml", "gantry.yaml"])
def test_a_word_mistyped_once_is_told_once(name: str) -> None:
    cases, told = mistyped(name), []
    for word, text in cases:
        with suppress(CaseError):  # a name that nothing refers to is as good as another
            parse(text.encode(), TEMPLATES / name)
            continue
        with pytest.raises(CaseError) as caught:
            parse(text.encode(), TEMPLATES / name)
        of_it = [p for p in caught.value.problems if "rides along a beam" not in p.message]
        told.append((word, len(of_it)))
    assert len(told) > 40
    assert [one for one in told if one[1] > 1] == []


def test_other_places_of_an_unknown_name_are_listed() -> None:
    text = (TEMPLATES / "planar_arm.yaml").read_text(encoding="utf-8")
    with pytest.raises(CaseError) as caught:
        parse(text.replace("    forearm: {", "    frearm: {").encode(), "arm.yaml")
    (problem,) = caught.value.problems
    assert problem.message.startswith("unknown link 'forearm'; did you mean 'frearm'?")
    places = {problem.path, *problem.message.split("; also at ")[1:]}
    assert places == {
        "mechanism.joints.elbow.follower", "mechanism.bodies.payload.at", "trajectory.tip"
    }  # fmt: skip


def test_a_mistyped_joint_of_a_coordinate_says_nothing_of_the_branch() -> None:
    text = (TEMPLATES / "planar_arm.yaml").read_text(encoding="utf-8")
    with pytest.raises(CaseError) as caught:
        parse(text.replace("{joint: elbow,", "{joint: elbw,").encode(), "arm.yaml")
    (problem,) = caught.value.problems
    assert problem.message.startswith("unknown joint 'elbw'; did you mean 'elbow'?")
