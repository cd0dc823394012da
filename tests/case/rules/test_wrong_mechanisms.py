"""Mistakes in links, joints, springs, loops and spatial parts: each told once, at its place."""

from pathlib import Path

import pytest
from mistakes import Wrong, problems_of, tables, told_once
from wide_cases import PLANAR, SPATIAL, changed, write

TABLES = tables("wrong_mechanisms")
LINKS = [Wrong(*row) for row in TABLES["links"]]
JOINTS = [Wrong(*row) for row in TABLES["joints"]]
STUDY = [Wrong(*row) for row in TABLES["study"]]
IN_SPACE = [Wrong(*row) for row in TABLES["in_space"]]
LATER = {  # the place of a mistake that the table cannot mark, or that another line shows
    "profile without web": "profile: {shape",
    "beam of no length": "lower: {from",
    "joint within a link": "B: {type",
    "base and follower exchanged": "hung: {type",
    "spring of no stiffness": "stop: {between",
    "list as design parameter": "parameter: springs.stop",
    "screw without lead": "thread: {type",
    "section that does not twist": "bare: {area",
}
ALSO = {  # what must change besides
    "beam of no length": [("tip: [0.2, 0]", "tip: [0 mm, 0]")],
    "frame without start": [("from: start", "from: foot"), ("bracket.start", "bracket.foot")],
}


@pytest.mark.parametrize("wrong", [*LINKS, *JOINTS, *STUDY], ids=lambda wrong: wrong.name)
def test_a_mistake_in_a_plane_is_told_once_where_it_is(wrong: Wrong, tmp_path: Path) -> None:
    text = changed(PLANAR, wrong.old, wrong.new)
    for old, new in ALSO.get(wrong.name, ()):
        text = changed(text, old, new)
    check(wrong, text, tmp_path)


@pytest.mark.parametrize("wrong", IN_SPACE, ids=lambda wrong: wrong.name)
def test_a_mistake_in_space_is_told_once_where_it_is(wrong: Wrong, tmp_path: Path) -> None:
    check(wrong, changed(SPATIAL, wrong.old, wrong.new), tmp_path)


def check(wrong: Wrong, text: str, folder: Path) -> None:
    if wrong.name in LATER:
        place = LATER[wrong.name]
        assert text.count(place) == 1
        text = text.replace(place, "¦" + place)
    path, message = told_once(text, write(folder, text))
    assert path == wrong.path
    assert wrong.message in message


def test_an_open_mechanism_needs_a_coordinate_for_every_freedom(tmp_path: Path) -> None:
    text = SPATIAL.replace(
        "    nut: {type: nut, base: shaft, follower: table.start, lead: 10 mm}\n", ""
    )
    text = text.replace("  assembly: {at: {x: 400 mm}, guess: {motor: -251.327, way: 0.4}}\n", "")
    text = text.replace("  x: {joint: nut, drive: {stiffness: 1 N/um}}\n", "  m: {joint: motor}\n")
    text = text.replace("  b2: {joint: ball, component: 2}\n", "  w: {joint: way}\n")
    text = text.partition("trajectory:")[0]
    found = problems_of(text, write(tmp_path, text))
    assert [(path, message) for *_, path, message in found] == [
        (
            "mechanism.joints.ball",
            "no coordinate: add one under coordinates, e.g. q10: {joint: ball, component: 2}",
        )
    ]


def test_an_assembly_without_loops_has_nothing_to_choose(tmp_path: Path) -> None:
    text = changed(PLANAR, "    pin: {type: revolute, base: rod.end, follower: slider.pin}\n", "")
    found = problems_of(text, write(tmp_path, text))
    assert ("mechanism.assembly", "no joint closes a loop: there is nothing to choose") in [
        (path, message) for *_, path, message in found
    ]


def test_every_mistake_of_form_is_told_at_once_and_then_every_other(tmp_path: Path) -> None:
    form = {
        ("stiffness: K.mtx", "stiffness: N.mtx"): "mechanism.links.plate.stiffness",
        ("axis: [1, 0.1]", "axis: [0, 0]"): "mechanism.joints.guide.axis",
        ("translational: 100", "translational: 100 N"): "mechanism.springs.soft.translational",
    }
    other = {
        (
            "{from: start, to: tip,",
            "{from: strat, to: tip,",
        ): "mechanism.links.bracket.beams.lower.from",
        ("at: {turn: 60 deg}", "at: {turm: 60 deg}"): "mechanism.assembly.at.turm",
        ("stiffness: 3 kN/m,", "stiffness: 3 N m/rad,"): "coordinates.place.drive.stiffness",
    }
    text = PLANAR
    for mistakes in (other, form):
        for old, new in mistakes:
            text = changed(text, old, new)
        paths = {path for *_, path, _ in problems_of(text, write(tmp_path, text))}
        assert paths >= set(mistakes.values())
