"""Shapes of modes: displacements that carry the modal mass, hang together, and bend as beams do."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import simpson
from spatial_cases import built
from spatial_random import random_closed

import eigassign as ea
from eigassign.case import parse
from eigassign.errors import UsageError
from eigassign.mechanism import section_values, shapes, with_reduction
from eigassign.study import with_middle_loads

CASES = Path(__file__).parents[3] / "cases"
ALL = sorted(path.stem for path in CASES.glob("*.yaml"))
SLIDING = {"prismatic", "carriage", "nut", "cylindrical", "screw"}


def posed(name: str) -> tuple[ea.Case, Any, Any]:
    """A shipped case, and q, y at its expansion point with its initial design."""
    case = ea.load_case(CASES / f"{name}.yaml")
    return case, with_middle_loads(case.file, case.file.expansion.q), case.initial_design


PLANAR = ["two_link", "four_bar", "five_bar", "six_bar", "luffing_boom", "gantry", "slider_crank"]


@pytest.mark.parametrize("name", PLANAR)
def test_what_is_drawn_carries_the_modal_mass(name: str) -> None:
    # ∫ ρA |v|² dx over all that is drawn, plus the bodies, is φᵀMφ = 1. Simpson's rule on two
    # intervals and more an element of these products is right to h⁴ and 1e-4 in the third mode.
    assert (np.abs(drawn_mass(*posed(name)) - 1.0) < [1e-5, 5e-5, 2e-4]).all()


def test_a_beam_soft_in_shear_is_drawn_with_its_shear() -> None:
    # Φ = 3.2 and 1.8 by a small κ and I, so that the rotary inertia, which is not drawn, is 1e-5.
    text = (CASES / "two_link.yaml").read_text(encoding="utf-8")
    for old, new in (
        ("density: 2690.007033", "density: 2690.007033, poissons_ratio: 0.33"),
        ("bending_inertia: 3.97e-8", "bending_inertia: 1.6e-11, shear_coefficient: 1e-5"),
        ("elements: 4", "elements: 4, shear: true"),
        ("elements: 3", "elements: 3, shear: true"),
    ):
        assert text.count(old) == 1
        text = text.replace(old, new)
    case = ea.Case(parse(text.encode(), CASES / "two_link.yaml"))
    assert (np.abs(drawn_mass(case, [1.817, 5.312], [0.0, 0.0]) - 1.0) < 1e-4).all()


@pytest.mark.parametrize("name", ["two_link", "luffing_boom"])
def test_a_reduced_link_is_drawn_with_all_that_it_stands_for(name: str) -> None:
    case, q, y = posed(name)
    limits = {"two_link": {"upper_arm": 2000.0}, "luffing_boom": {"boom": 200.0}}[name]
    reduced = ea.Case(with_reduction(case.file, limits))
    assert reduced.model().n_dof < case.model().n_dof
    assert (np.abs(drawn_mass(reduced, q, y) - 1.0) < [1e-5, 5e-5, 2e-4]).all()
    whole, found = (one.model().shapes(q, y, 1) for one in (case, reduced))
    for strand, other in zip(found.strands, whole.strands, strict=True):
        phase = np.sign((strand.motions * other.motions).sum())
        size = np.abs(other.motions).max()
        np.testing.assert_allclose(phase * strand.motions, other.motions, atol=1e-2 * size)


def drawn_mass(case: ea.Case, q: Any, y: Any) -> Any:
    """∫ ρA |v|² dx over all beams plus m |v|² of bodies and rigid links, in three modes."""
    mechanism = case.file.mechanism
    found = case.model().shapes(q, y, 3)
    total = np.zeros(3)
    beams = iter(
        beam
        for link in case.model().poses.links
        for data in [mechanism.links[link]]
        for beam in getattr(data, "beams", {"": data}).values()
    )
    for strand, beam in zip(found.strands, beams, strict=False):
        if hasattr(beam, "material"):
            section = section_values(mechanism.sections[beam.section], lambda _key, value: value)
            at = np.linalg.norm(strand.places - strand.places[0], axis=1)
            own = simpson((strand.motions**2).sum(axis=2), x=at)
            total += mechanism.materials[beam.material].density * section.area * own
    for body in mechanism.bodies.values():
        node = found.nodes[tuple(body.at.split("."))]  # type: ignore[index]
        total += body.mass * (node.motion[:, :3] ** 2).sum(axis=1)
    for link, data in mechanism.links.items():
        if getattr(data, "type", "") == "rigid":
            total += data.mass * (found.nodes[link, "start"].motion[:, :3] ** 2).sum(axis=1)
    return total


@pytest.mark.parametrize(
    ("name", "parameter", "node"),
    [
        ("two_link", 0, ("upper_arm", "end")),
        ("two_link", 1, ("forearm", "end")),
        ("luffing_boom", 1, ("boom", "head")),
        ("gantry", 1, ("carriage", "start")),
        ("superelement_arm", 1, ("forearm", "end")),
        ("arm_3r", 1, ("upper_arm", "end")),
    ],
)
def test_a_mass_on_a_node_sees_the_node_move_as_drawn(
    name: str, parameter: int, node: tuple[str, str]
) -> None:
    # ∂M/∂m = v vᵀ for any vector, rigid and elastic parts alike, summed over the directions.
    case, q, y = posed(name)
    model = case.model()
    more = y + np.eye(len(y))[parameter]
    difference = model.matrices(q, more)[0] - model.matrices(q, y)[0]
    vectors = np.random.default_rng(3).standard_normal((model.n_dof, 5))
    (found,) = shapes(model.poses, model.x(q, y), vectors[None])
    motion = found.nodes[node].motion[:, :3]
    np.testing.assert_allclose(motion @ motion.T, vectors.T @ difference @ vectors, atol=1e-10)


@pytest.mark.parametrize("space", ["planar", "spatial"])
@pytest.mark.parametrize(
    "seed", [0, 2, 3, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 4, 5, 6, 7))]
)
def test_any_motion_of_any_loops_keeps_their_joints_together(seed: int, space: str) -> None:
    # beams, frames and rigid links, joints written from either side, loops of rigid links alone
    kinds = ("rigid",) if seed % 4 == 3 else ("beam", "rigid", "frame")
    tree, q, _ = random_closed(seed, space, 1 + seed % 2, seed % 2 == 0, kinds)
    model = built(tree)
    vectors = np.random.default_rng(seed).standard_normal((model.pencil.n_dof, 4))
    (found,) = shapes(model.poses, model.x(q), vectors[None])
    together(model.case, model.motion, found)


def together(case: Any, motion: Any, found: Any) -> None:
    """u_f = u_b + ω_b × r in all directions if the joint turns, but for one where it slides."""
    for walked in (*motion.tree.edges, *motion.tree.loops):
        edge = walked.written
        base, follower = found.nodes.get(edge.base), found.nodes[edge.follower]
        gap = follower.motion[:, :3].copy()
        if base is not None:
            arm = follower.place - base.place
            gap -= base.motion[:, :3] + np.cross(base.motion[:, 3:], arm)
        allowed = 1 if case.mechanism.joints[edge.joint].type in SLIDING else 0
        tolerance = 1e-9 * max(1.0, np.abs(follower.motion).max())
        assert np.linalg.matrix_rank(gap, tol=tolerance) <= allowed, edge.joint


@pytest.mark.parametrize("name", ALL)
def test_lines_end_at_their_nodes_and_move_with_them(name: str) -> None:
    case, q, y = posed(name)
    model = case.model()
    found = model.shapes(q, y, 2)
    ends = [(link, pair) for link, pairs in zip(model.poses.links, model.poses.drawn, strict=True)
            for pair in pairs]  # fmt: skip
    assert len(ends) == len(found.strands)
    for (link, pair), strand in zip(ends, found.strands, strict=True):
        d = strand.places.shape[1]
        for node, k in zip(pair, (0, -1), strict=True):
            shape = found.nodes[link, node]
            np.testing.assert_allclose(strand.places[k], shape.place[:d], atol=1e-12)
            np.testing.assert_allclose(strand.motions[:, k], shape.motion[:, :d], atol=1e-12)


def test_shapes_are_of_one_pose() -> None:
    case, q, y = posed("two_link")
    with pytest.raises(UsageError, match="one sample"):
        case.model().shapes([q, q], y)
    found = case.model().shapes(q, y, 2)
    assert found.strands[0].motions.shape == (2, 25, 2)
    np.testing.assert_allclose(found.frequencies, case.model().frequencies(q, y, 2)[0])
