"""Solids under load: buckling and frequencies of CalculiX, turns of a loaded part, turning blades.

CalculiX 2.20 (Debian 12, calculix-ccx) had the same nodes and elements. Its rigid bodies leave out
what coupled nodes do to second order: of the column it finds 0.75 % less than 8 elements of a beam
stiffened by such ends. So the castings have a block of 3 000 times the modulus at their tip there,
which is a rigid link here: 60 x 60 x 60 and 40 x 20 x 60 mm, 78 500 kg/m3.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from solid_parts import Bar, bar, blocks, case

import eigassign as ea
from eigassign.modal import buckling, weight_changes

STEEL = {"youngs_modulus": 70e9, "density": 2700.0, "poissons_ratio": 0.3}
NONE = np.zeros((1, 0))


def loaded(folder: Path, part: Bar, gravity: Any, held: Any, **more: Any) -> Any:
    """The model of a part on the ground that carries the link ``held`` at its tip."""
    tree = case(folder, part, reduce_to=9e3, **more)
    mechanism = tree["mechanism"]
    mechanism |= {"gravity": gravity, "materials": {"metal": STEEL}}
    mechanism["links"] = {"bar": mechanism["links"]["bar"], "head": {"type": "rigid", **held}}
    mechanism["joints"] = {
        "foot": {"type": "fixed", "base": "ground", "follower": "bar.start"},
        "neck": {"type": "fixed", "base": "bar.end", "follower": "head.start"},
    }
    return ea.load_case({"title": "t", "mechanism": mechanism}, allow_outside=True).model()


def brick(size: Any, axis: int) -> dict[str, Any]:
    """A rigid block that stands on its start along an axis."""
    mass, square = 78500.0 * float(np.prod(size)), np.square(size)
    center = [0.5 * size[k] * (k == axis) for k in range(3)]
    return {
        "mass": mass,
        "inertia": (mass / 12.0 * (square.sum() - square)).tolist(),
        "center": center,
    }


def waisted(count: int, cells: int) -> Bar:
    """A bar of 16 x 20 mm with a flange of 60 x 60 mm at each end, 300 mm long."""
    edges = ((0, 0.03, 0.27, 0.3), (-0.03, -0.008, 0.008, 0.03), (-0.03, -0.01, 0.01, 0.03))
    missing = [(1, j, k) for j in range(3) for k in range(3) if (j, k) != (1, 1)]
    return blocks(edges, ((1, cells, 1), (1, 1, 1), (1, 1, 1)), count, missing)


# in m/s2 what buckles, by *BUCKLE; then the lowest frequency in Hz (*STATIC with NLGEOM, then
# *FREQUENCY) at these shares of it
SHARES = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5)
COLUMN = (bar((12, 1, 1), 20, (1.0, 0.05, 0.05), 1.3), {"mass": 67.5}, 5e-3, 2e-2)
CASES = {
    "column": (*COLUMN, 1290.33, (6.197451, 6.034193, 5.692983, 5.328994, 4.937154, 4.510169)),
    "waisted, 10": (
        *(waisted(10, 12), brick([0.06] * 3, 0), 3e-4, 3e-4, 765.1656),
        (8.5585, 8.3327, 7.8607, 7.3576, 6.8168, 6.2253),
    ),
    "waisted, 20": (
        *(waisted(20, 6), brick([0.06] * 3, 0), 3e-4, 3e-4, 766.2531),
        (8.5674, 8.3412, 7.8687, 7.3648, 6.8224, 6.2315),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_standing_solids_buckle_and_vibrate_as_in_calculix(tmp_path: Path, name: str) -> None:
    part, held, near, near_share, most, expected = CASES[name]
    for share, hz in zip(SHARES, expected, strict=True):
        model = loaded(tmp_path, part, [-share * most, 0.0, 0.0], held)
        assert model.frequencies([], [], 1)[0, 0] == pytest.approx(hz, rel=near)
        assert buckling(model, NONE, NONE)[0] == pytest.approx(share, rel=near_share)


def test_a_bent_casting_changes_with_the_weight_as_in_calculix(tmp_path: Path) -> None:
    """∂λ/λ by stress and sag, by ±2 % of what buckles: CalculiX' frequencies have both."""
    edges = ((0, 0.04, 0.25), (-0.01, 0.01), (0, 0.04, 0.3))
    part = blocks(edges, ((1, 4), (1,), (1, 5)), 20, [(1, 0, 1)], tip=2)
    down = np.array([0.35, 0.5, -0.79]) / np.linalg.norm([0.35, 0.5, -0.79])
    held = brick([0.04, 0.02, 0.06], 2)
    model = loaded(tmp_path, part, (0.5 * 6108.296 * down).tolist(), held)
    assert buckling(model, NONE, NONE)[0] == pytest.approx(0.5, rel=1e-3)
    found = weight_changes(loaded(tmp_path, part, "none", held), NONE, NONE, (1, 2))
    changes = (found.stress + found.sag)[0] @ (0.02 * 6108.296 * down)
    assert changes == pytest.approx([-0.01909858, -0.00492597], rel=1e-3)


@pytest.mark.parametrize("coupling", ["rigid", "distributing"])
@pytest.mark.parametrize("count", [4, 10, 20])
def test_forces_turn_with_a_part(tmp_path: Path, count: int, coupling: str) -> None:
    """∂²Π/∂u∂q of a mechanism that turns by q is −∂f/∂q, f(q) the weight on its elastic u."""
    tree, g = case(tmp_path, bar((4, 2, 1), count)), np.array([7.0, -5.0, 3.0])
    m = tree["mechanism"]
    m["links"]["bar"]["nodes"] = {
        "start": {"surface": "root", "coupling": coupling, "position": [-0.03, 0.02, 0.05]},
        "end": {"surface": "tip", "coupling": coupling, "position": [0.45, -0.04, 0.03]},
    }
    m["joints"]["slide"] |= {"type": "revolute", "axis": [0.3, 1.0, -0.5]}
    m |= {"gravity": g.tolist(), "bodies": {"b": {"at": "bar.end", "mass": 2.0}}}
    m["bodies"]["b"]["offset"] = [0.1, 0.2, -0.05]
    tree["coordinates"]["x"]["drive"] = {"stiffness": 1e4}
    model = ea.load_case(tree, allow_outside=True).model()
    x, h = model.x([0.4], []), 1e-4
    K_g = model.pencil.sparse((model.pencil.weight.stiffness @ model.pencil.theta(x))[:, 0])
    ends = [p.B.T @ (p.mass @ (p.weight() @ g)) for p in model.under_load.at([x[0] - h, x[0] + h])]
    turned = (ends[0] - ends[1])[:-1] / (2.0 * h)
    assert K_g.toarray()[:-1, -1] == pytest.approx(turned, abs=1e-6 * np.abs(turned).max())


def test_a_turning_blade_stiffens_as_beams_do(tmp_path: Path) -> None:
    """φᵀ K_g φ = 1.193 Ω² of a clamped beam in both planes: 1.6 % more with such ends."""
    part, R = bar((16, 1, 1), 20), Rotation.from_rotvec([0.5, 0.9, -0.4]).as_matrix()
    tree = case(tmp_path, part._replace(x=part.x @ R.T))
    tree["mechanism"]["joints"]["slide"] |= {"type": "revolute", "axis": R[:, 2].tolist()}
    model = ea.load_case(tree, allow_outside=True).model()
    phi = model.modes([0.0], [], 2)[1][0]
    still, turns = np.zeros((1, 1)), np.full((1, 1), 10.0)
    (K_g,) = model.under_load.in_motion(still, np.zeros(0), turns, still)
    assert np.diag(phi.T @ (K_g @ phi)) == pytest.approx([119.33, 119.33], rel=1e-2)
