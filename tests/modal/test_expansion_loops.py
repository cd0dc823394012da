"""The expansion over loops, spatial arms and travelling carriages: residuals, slopes, derivatives.

Also over every kind of design parameter: section dimensions, modulus, body mass, spring and drive
stiffness, and a length in an open chain and in a loop, where it moves the passive joints too.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from rungs import residual, truncation
from spatial_cases import built, changed
from spatial_examples import arm3r, four_bar, gantry, slider_crank
from spatial_oracle import Tree, world

from eigassign.modal import Expansion, expand


def with_design(tree: Tree, **paths: str) -> Tree:
    design = {n: {"parameter": p, **_bounds(p)} for n, p in paths.items()}
    return {**tree, "design": design}


def _bounds(path: str) -> dict[str, float]:
    """Wide ones, of an elastic modulus or of a length, mass or stiffness."""
    return {"min": 1e6, "max": 1e13} if path.endswith("modulus") else {"min": 1e-4, "max": 1e5}


def loop() -> Tree:
    tree = four_bar("free")
    tree["mechanism"]["bodies"] = {"pin": {"at": "coupler.end", "mass": 0.3, "inertia": 1e-4}}
    return with_design(
        tree, length="links.coupler.length", pin="bodies.pin.mass", height="sections.s.height"
    )


def slider() -> Tree:
    tree = slider_crank("free")
    tree["mechanism"]["springs"] = {
        "seat": {"between": ["rod.end", "ground"], "translational": [0.0, 2e4]}
    }
    return with_design(tree, block="links.slider.mass", rod="links.rod.length")


def spatial_arm() -> Tree:
    tree = arm3r("free")
    tree["coordinates"]["elbow"]["drive"] = {"stiffness": 5e3}
    tree = with_design(
        tree,
        wall="sections.s.inner_diameter",
        modulus="materials.m.youngs_modulus",
        length="links.up.length",
        drive="coordinates.elbow.drive.stiffness",
    )
    tree["design"]["wall"]["max"] = 0.039  # below the outer diameter
    return tree


def portal() -> Tree:
    tree = gantry("free")
    tree["mechanism"]["springs"] = {
        "stop": {"between": ["girder.start", "ground"], "translational": 4e5}
    }
    return with_design(tree, trolley="links.trolley.mass", stop="springs.stop.translational")


# name, tree, q0, half-widths of the box in (q, y)
CASES: list[tuple[Any, list[float], list[float]]] = [
    (loop, [2.1], [1.0, 0.05, 0.1, 5e-4]),
    (slider, [1.0], [1.0, 0.2, 0.05]),
    (spatial_arm, [0.3, 0.5, -0.9], [1.0, 1.0, 1.0, 1e-3, 1e10, 0.05, 1e3]),
    (portal, [0.6], [0.8, 3.0, 4e5]),
]
IDS = [case[0].__name__ for case in CASES]
STEPS = {1: 0.01, 2: 0.03, 3: 0.06, 4: 0.09, 5: 0.12}


@pytest.mark.parametrize("order", STEPS)
@pytest.mark.parametrize(("make", "q0", "span"), CASES, ids=IDS)
def test_the_truncation_error_falls_with_one_power_more_than_the_order(
    make: Any, q0: list[float], span: list[float], order: int
) -> None:
    model = built(make())
    e = expand(model.pencil, q0, model.y, order=order)
    coarse, fine = (
        truncation(model.pencil, e, np.array(span), STEPS[order] * s) for s in (1.0, 0.5)
    )
    assert fine > 1e-13
    assert math.log2(coarse / fine) == pytest.approx(order + 1, abs=0.2)


@pytest.mark.parametrize(("make", "q0", "span"), CASES, ids=IDS)
def test_first_derivatives_are_those_of_the_plain_frame_rebuilt(
    make: Any, q0: list[float], span: list[float]
) -> None:
    """The oracle is built anew for every value: a design parameter that reaches only part of the
    model, or a passive joint that does not follow a length, would show."""
    tree = make()
    model = built(tree)
    e = expand(model.pencil, q0, model.y, order=1)
    paths = [d["parameter"] for d in tree["design"].values()]
    for k, width in enumerate(span):
        h = 1e-3 * width
        rigid = len(model.pencil.rigid)  # springs hold free coordinates too
        lam = [_moved(tree, paths, q0, model.y, k, s * h, rigid) for s in (1, -1)]
        at = np.flatnonzero((e.indices == np.eye(len(span), dtype=int)[k]).all(axis=1))
        found = float(e.coefficients[0, at[0]]) if len(at) else 0.0
        # differences: h² from truncation, 1e-10/1e-3 from round-off, of the change over the box
        size = abs(e.coefficients[0, 0])
        assert found * width == pytest.approx((lam[0] - lam[1]) / 2e-3, rel=1e-4, abs=3e-6 * size)


def _moved(
    tree: Tree, paths: list[str], q0: list[float], y: np.ndarray, k: int, h: float, rigid: int
) -> float:
    q = np.array(q0)
    if k < len(q):
        q[k] += h
    else:
        tree = changed(tree, paths[k - len(q)], float(y[k - len(q)] + h))
    frame = world(tree, q)
    frame.n_free = rigid
    return float(frame.spectrum(1)[0])


@pytest.mark.parametrize(("make", "q0", "span"), CASES, ids=IDS)
def test_second_derivatives_are_differences_of_first_ones(
    make: Any, q0: list[float], span: list[float]
) -> None:
    model = built(make())
    n = len(q0)
    x0 = np.concatenate([q0, model.y])
    e = expand(model.pencil, q0, model.y, order=2)
    second = _tensor(e, len(x0)) * np.outer(span, span)
    scale = np.abs(second).max()
    for k, width in enumerate(span):
        x = np.array([x0 + s * 2e-3 * width * np.eye(len(x0))[k] for s in (1, -1)])
        g = [_gradient(expand(model.pencil, p[:n], p[n:], order=1), len(x0)) for p in x]
        found = (g[0] - g[1]) / 4e-3 * np.array(span)
        np.testing.assert_allclose(second[k], found, rtol=2e-4, atol=2e-5 * scale)


def _gradient(e: Expansion, n: int) -> np.ndarray:
    out = np.zeros(n)
    for index, value in zip(e.indices, e.coefficients[0], strict=True):
        if index.sum() == 1:
            out[int(np.argmax(index))] = value
    return out


def _tensor(e: Expansion, n: int) -> np.ndarray:
    """∂²λ/∂x_i∂x_j."""
    out = np.zeros((n, n))
    for index, value in zip(e.indices, e.coefficients[0], strict=True):
        if index.sum() == 2:
            i, j = np.repeat(np.arange(n), index)
            out[i, j] = out[j, i] = value * (2.0 if i == j else 1.0)
    return out


@pytest.mark.parametrize(("make", "q0", "span"), CASES, ids=IDS)
def test_the_recursion_leaves_no_residual_at_any_multi_index(
    make: Any, q0: list[float], span: list[float]
) -> None:
    model = built(make())
    x0 = np.concatenate([q0, model.y])
    assert residual(model.pencil, x0, np.array(span), 3, (1, 2)).max() < 1e-12


def test_a_coordinate_that_turns_the_whole_mechanism_is_dropped() -> None:
    model = built(arm3r("free"))
    e = expand(model.pencil, [0.3, 0.5, -0.9], [], order=3)
    yaw = e.indices[:, 0]
    np.testing.assert_allclose(e.coefficients[:, yaw > 0], 0.0)


def test_the_partially_linear_expansion_of_a_loop_has_the_full_ones_coefficients() -> None:
    model = built(loop())
    full = expand(model.pencil, [2.1], model.y, order=4)
    part = expand(model.pencil, [2.1], model.y, order=4, linear_in_y=True)
    place = {tuple(row): k for k, row in enumerate(full.indices.tolist())}
    same = [place[tuple(row)] for row in part.indices.tolist()]
    np.testing.assert_allclose(part.coefficients, full.coefficients[:, same], rtol=1e-7)
