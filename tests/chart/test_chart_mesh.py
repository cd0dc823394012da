"""The mesh axis: beams converge with the fourth power of the element length."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from chart_scenes import TINY
from scenes import SHIPPED, changed

from eigassign import Case, load_case
from eigassign.chart import MeshRow, chart_meshes
from eigassign.mechanism import refined
from eigassign.study import build_model

X = np.array([[1.817, 5.312, 0.125, 0.125]])
PORTAL = """    portal:
      type: frame
      nodes: {start: [0, 0], top: [0.1, 0.1], end: [0.2, 0]}
      beams:
        up: {from: start, to: top, material: aluminium, section: rod, elements: 2}
        down: {from: top, to: end, material: aluminium, section: rod, elements: 3}
"""


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    path: Path = tmp_path_factory.mktemp("arm") / "arm.yaml"
    path.write_text(SHIPPED)
    return load_case(path)


def charted(case: Case, *factors: float, most_dof: int = 10_000) -> tuple[MeshRow, ...]:
    effort = replace(TINY, factors=factors, most_dof=most_dof)
    return chart_meshes(case.settled.file, X, (1,), effort)


def test_links_are_refined_together_and_keep_an_element(case: Case) -> None:
    assert refined(case.file, 2.0)[1] == (8, 6)
    assert refined(case.file, 0.5)[1] == (2, 2)
    assert refined(case.file, 0.01)[1] == (1, 1)
    assert case.file.mechanism.links["forearm"].elements == 3


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
    assert case.settled.reduction is not None
    own = (case.mesh.elements["upper_arm"], case.mesh.elements["forearm"], 2, 3)
    (same, counts), (finer, doubled) = (refined(case.settled.file, k) for k in (1.0, 2.0))
    assert counts == own
    assert doubled == tuple(2 * n for n in own)
    hz, hz_finer = (build_model(f).frequencies(X[:, :2], X[:, 2:], 1) for f in (same, finer))
    assert hz == pytest.approx(case.model().frequencies(X[:, :2], X[:, 2:], 1), rel=1e-12)
    assert 0.0 < abs(hz_finer / hz - 1.0) < 0.01
    reduced = case.settled.file.mechanism.links["upper_arm"].reduce_to
    assert reduced == case.settled.reduction.values["upper_arm"]


def test_errors_fall_with_the_fourth_power_and_the_own_mesh_is_that_far_off(case: Case) -> None:
    rows = charted(case, 1.0, 2.0, 4.0, 8.0)
    assert [row.elements for row in rows] == [7, 14, 28, 56]
    # a known figure: 193.1130 Hz on the paper's mesh, 193.0537 Hz converged
    assert rows[0].worst_hz == pytest.approx(193.1130 - 193.0537, abs=1e-4)
    assert rows[0].order == pytest.approx(4.0, abs=0.1)
    assert rows[1].order == pytest.approx(4.0, abs=0.1)
    assert rows[-1].order is None


def test_meshes_that_are_too_large_or_the_same_are_left_out(case: Case) -> None:
    assert [row.factor for row in charted(case, 1.0, 2.0, 4.0, most_dof=50)] == [1.0, 2.0]
    assert charted(case, 1.0, 2.0, most_dof=30) == ()
    assert [row.elements for row in charted(case, 0.01, 0.02, 1.0)] == [2, 7]
