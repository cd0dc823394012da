"""The mesh axis: beams converge with the fourth power of the element length."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenes import SHIPPED, changed

from eigassign import Case, load_case
from eigassign.chart.mesh import chart_meshes, meshes, refined
from eigassign.chart.timing import Patience
from eigassign.study import build_model

ONCE = Patience(rounds=1, seconds=0.0)


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    path: Path = tmp_path_factory.mktemp("arm") / "arm.yaml"
    path.write_text(SHIPPED)
    return load_case(path)


def test_links_are_refined_together_and_keep_an_element(case: Case) -> None:
    assert refined(case.file, 2.0)[1] == (8, 6)
    assert refined(case.file, 0.5)[1] == (2, 2)
    assert refined(case.file, 0.01)[1] == (1, 1)
    assert case.file.mechanism.links["forearm"].elements == 3


PORTAL = """    portal:
      type: frame
      nodes: {start: [0, 0], top: [0.1, 0.1], end: [0.2, 0]}
      beams:
        up: {from: start, to: top, material: aluminium, section: rod, elements: 2}
        down: {from: top, to: end, material: aluminium, section: rod, elements: 3}
"""


def test_links_left_to_auto_are_refined_from_the_elements_that_were_chosen(tmp_path: Path) -> None:
    text = changed(
        ("section: rod, elements: 4}", "section: rod, elements: auto, reduce_to: auto}"),
        ("section: rod, elements: 3}\n", "section: rod, elements: auto}\n" + PORTAL),
        ("  bodies:", "    wrist: {type: fixed, base: forearm.end, follower: portal.start}\n"
         "  bodies:"),
        ("  order: 4", "  order: 4\n  accuracy: 1 %"),
    )  # fmt: skip
    (tmp_path / "auto.yaml").write_text(text)
    case = load_case(tmp_path / "auto.yaml")
    assert case.mesh is not None
    assert case.reduction is not None
    own = (case.mesh.elements["upper_arm"], case.mesh.elements["forearm"], 2, 3)
    assert refined(case.settled, 1.0)[1] == own
    assert refined(case.settled, 2.0)[1] == tuple(2 * n for n in own)
    (same, finer) = meshes(case.settled, (1.0, 2.0))
    assert same.elements == sum(own)
    x = np.array([[1.817, 5.312, 0.125, 0.125]])
    hz, hz_finer = (
        build_model(mesh.file).frequencies(x[:, :2], x[:, 2:], 1) for mesh in (same, finer)
    )
    assert hz == pytest.approx(case.model().frequencies(x[:, :2], x[:, 2:], 1), rel=1e-12)
    assert 0.0 < abs(hz_finer / hz - 1.0) < 0.01
    reduced = case.settled.mechanism.links["upper_arm"].reduce_to
    assert reduced == case.reduction.frequencies["upper_arm"]


def test_errors_fall_with_the_fourth_power_and_the_own_mesh_is_that_far_off(case: Case) -> None:
    listed = list(meshes(case.settled, (1.0, 2.0, 4.0, 8.0)))
    x = np.array([[1.817, 5.312, 0.125, 0.125]])
    rows = chart_meshes(listed, x, (1,), 10_000, ONCE)
    assert [row.elements for row in rows] == [7, 14, 28, 56]
    # a known figure: 193.1130 Hz on the paper's mesh, 193.0537 Hz converged
    assert rows[0].worst_hz == pytest.approx(193.1130 - 193.0537, abs=1e-4)
    assert rows[0].order == pytest.approx(4.0, abs=0.1)
    assert rows[1].order == pytest.approx(4.0, abs=0.1)
    assert rows[-1].order is None


def test_meshes_that_would_be_too_large_are_left_out(case: Case) -> None:
    x = np.array([[1.817, 5.312, 0.125, 0.125]])
    rows = chart_meshes(list(meshes(case.settled, (1.0, 2.0, 4.0))), x, (1,), 50, ONCE)
    assert [row.factor for row in rows] == [1.0, 2.0]
    assert chart_meshes(list(meshes(case.settled, (1.0, 2.0))), x, (1,), 30, ONCE) == ()


def test_factors_that_give_the_same_mesh_count_once(case: Case) -> None:
    assert [mesh.factor for mesh in meshes(case.settled, (0.01, 0.02, 1.0))] == [0.01, 1.0]
