"""World poses of the links."""

from __future__ import annotations

import sys

import numpy as np
from chains import model_of, two_link
from frame_oracle import frame
from scipy.spatial.transform import Rotation

from eigassign.mechanism import JointEdge, Placement


def test_a_two_link_arm_reaches_where_trigonometry_says() -> None:
    model = model_of(two_link())
    q = np.array([[0.4, 1.7], [-1.0, 3.0]])
    tip = model.poses.position(model.x(q, [0.0, 0.0]), "fore", "end")
    np.testing.assert_allclose(tip[:, 0], 0.6 * np.cos(q[:, 0]) + 0.45 * np.cos(q[:, 1]))
    np.testing.assert_allclose(tip[:, 1], 0.6 * np.sin(q[:, 0]) + 0.45 * np.sin(q[:, 1]))
    np.testing.assert_array_equal(tip[:, 2], 0.0)


def test_a_designed_length_moves_the_links_it_carries() -> None:
    design = {"a": {"parameter": "links.upper.length", "min": 0.1, "max": 2.0}}
    model = model_of(two_link(design=design))
    for length in (0.3, 1.5):
        tree = two_link(design={})
        tree["mechanism"]["links"]["upper"]["length"] = length
        expected = frame(tree, np.array([0.4, 1.7]))
        lines = model.poses.lines(model.x([0.4, 1.7], [length]))[0]
        np.testing.assert_allclose(lines[0, 1, :2], expected.ends["upper"])
        np.testing.assert_allclose(lines[1, 1, :2], expected.ends["fore"])


def test_a_chain_may_have_more_links_than_calls_may_nest() -> None:
    count, length, bend = 2 * sys.getrecursionlimit(), 0.1, 1e-3
    R = Rotation.from_euler("z", bend).as_matrix().astype(object)
    none, end = np.array([[0.0] * 3, [length, 0.0, 0.0]], dtype=object)
    link: Placement | None = None
    for _ in range(count):
        foot = none if link is None else end
        edge = JointEdge("", ("ground", ""), ("", "start"))
        link = Placement("", edge, R, none, np.zeros((6, 0)), np.zeros((6, 0)), link, foot, none)
    assert link is not None
    angles = bend * np.arange(1, count)  # of all links that carry another
    reached = [length * np.cos(angles).sum(), length * np.sin(angles).sum(), 0.0]
    np.testing.assert_allclose(link.world_origin.astype(float), reached, rtol=1e-10)
