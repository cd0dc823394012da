"""Vibration under weight in closed form: pendulums, columns, ropes, lateral buckling, booms.

Rigid links agree to 1e-9, which is round-off; beams of eight elements to the error of their mesh.
"""

from typing import Any

import numpy as np
import pytest
from scipy import linalg
from scipy.special import jn_zeros
from spatial_cases import STEEL, Tree, case_of, linkage

import eigassign as ea
from eigassign.modal import Model, buckling, sag_of_nodes, weight_changes

G = 9.81
WIDTH, HEIGHT = 0.02, 0.004
STRIP = {"shape": "rectangle", "width": WIDTH, "height": HEIGHT}
EI = STEEL["youngs_modulus"] * WIDTH * HEIGHT**3 / 12
LIGHT = {**STEEL, "density": 1e-3}
DOWN = {"planar": [0.0, -G], "spatial": [0.0, 0.0, -G]}


def scene(
    links: Tree,
    joints: Tree,
    bodies: Tree,
    coordinates: Tree,
    space: str = "planar",
    gravity: Any = None,
    section: Tree = STRIP,
    material: Tree = STEEL,
    **more: Any,
) -> Model:
    pull = DOWN[space] if gravity is None else gravity
    own = {"space": space, "gravity": pull, "bodies": bodies, **more}
    tree = linkage(links, joints, coordinates, section=section, material=material, **own)
    return ea.Case(case_of(tree)).model()


def hertz(model: Model, q: Any, count: int) -> np.ndarray:
    return np.asarray(model.frequencies(np.atleast_2d(q), np.zeros(0), count)[0])


def hz(lam: Any) -> np.ndarray:
    return np.asarray(np.sqrt(lam) / (2.0 * np.pi))


def rod(length: float, mass: float = 0.0, **more: Any) -> Tree:
    return {"type": "rigid", "length": length, "mass": mass, **more}


def hinge(base: str, follower: str, **more: Any) -> Tree:
    return {"type": "revolute", "base": base, "follower": f"{follower}.start", **more}


# --- rigid links


def test_a_compound_pendulum_also_held_off_the_vertical_by_a_constant_torque() -> None:
    m, J, r, load, L = 2.0, 0.15, 0.3, 0.7, 0.8
    model = scene(
        {"a": rod(L, m, inertia=J, center=[r, 0.0])}, {"A": hinge("ground", "a")},
        {"b": {"at": "a.end", "mass": load}}, {"q": {"joint": "A"}},
    )  # fmt: skip
    expected = (m * r + load * L) * G / (J + m * r**2 + load * L**2)
    for tilt in (0.0, 0.4):
        wanted = hz([np.cos(tilt) * expected])
        np.testing.assert_allclose(hertz(model, tilt - np.pi / 2, 1), wanted, rtol=1e-9)


def test_a_chain_of_equal_pendulums() -> None:
    """n masses on n rods of length a: λ a/g are the roots of Laguerre's polynomial L_n."""
    n, a = 5, 0.2
    names = [f"l{k}" for k in range(n)]
    below = ["ground", *(f"{name}.end" for name in names)]
    model = scene(
        {name: rod(a) for name in names},
        {f"J{k}": hinge(below[k], name) for k, name in enumerate(names)},
        {f"b{k}": {"at": f"{name}.end", "mass": 1.3} for k, name in enumerate(names)},
        {f"q{k}": {"joint": f"J{k}"} for k in range(n)},
    )
    roots = np.sort(np.polynomial.laguerre.lagroots([0.0] * n + [1.0]))
    pose = [-np.pi / 2, *(0.0 for _ in names[1:])]
    np.testing.assert_allclose(hertz(model, pose, n), hz(G / a * roots), rtol=1e-9)


def test_a_spherical_pendulum() -> None:
    """It swings in two planes; turning about itself costs nothing."""
    link = rod(0.7, 0.5, inertia=[0.01, 0.02, 0.02], center=[0.35, 0.0, 0.0])
    joint = {"type": "spherical", "base": "ground", "follower": "a.start"}
    joint["orientation"] = [0.0, np.pi / 2, 0.0]
    axes = {f"q{k}": {"joint": "A", "component": k} for k in (1, 2, 3)}
    model = scene(
        {"a": link}, {"A": joint},
        {"b": {"at": "a.end", "mass": 3.0}}, axes, "spatial",
    )  # fmt: skip
    moment, inertia = 3.0 * 0.7 + 0.5 * 0.35, 3.0 * 0.7**2 + 0.5 * 0.35**2 + 0.02
    K, M = (model.matrices(np.zeros(3), np.zeros(0))[k] for k in (1, 0))
    expected = [0.0, moment * G / inertia, moment * G / inertia]
    np.testing.assert_allclose(linalg.eigvalsh(K, M), expected, rtol=1e-9, atol=1e-9)


def test_a_pendulum_on_a_turntable_keeps_one_rigid_motion() -> None:
    table = rod(0.3, 1.0, inertia=[0.1, 0.1, 0.1])
    joints = {
        "S": hinge("ground", "t", axis=[0, 0, 1]),
        "A": hinge("t.end", "a", axis=[0, 1, 0]),
    }
    model = scene(
        {"t": table, "a": rod(0.7)}, joints, {"b": {"at": "a.end", "mass": 3.0}},
        {"s": {"joint": "S"}, "q": {"joint": "A"}}, "spatial",
    )  # fmt: skip
    assert model.n_rigid == 1
    np.testing.assert_allclose(hertz(model, [0.3, np.pi / 2], 1), hz([G / 0.7]), rtol=1e-9)


def test_a_pendulum_on_a_carriage_keeps_one_rigid_motion() -> None:
    joints = {
        "S": {"type": "prismatic", "base": "ground", "follower": "cart.start"},
        "A": hinge("cart.start", "a"),
    }
    model = scene(
        {"cart": rod(0.1, 2.0, inertia=0.1), "a": rod(1.5)}, joints,
        {"b": {"at": "a.end", "mass": 3.0}}, {"s": {"joint": "S"}, "q": {"joint": "A"}},
    )  # fmt: skip
    assert model.n_rigid == 1
    expected = G / 1.5 * (1.0 + 3.0 / 2.0)
    np.testing.assert_allclose(hertz(model, [0.3, -np.pi / 2], 1), hz([expected]), rtol=1e-9)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.999])
def test_an_inverted_pendulum_on_a_spring(share: float) -> None:
    """λ = (k − m g h)/J."""
    m, h = 3.0, 0.7
    stiffness = m * G * h / share
    model = scene(
        {"a": rod(h)}, {"A": hinge("ground", "a")}, {"b": {"at": "a.end", "mass": m}},
        {"q": {"joint": "A", "drive": {"stiffness": stiffness}}},
    )  # fmt: skip
    expected = (stiffness - m * G * h) / (m * h**2)
    np.testing.assert_allclose(hertz(model, np.pi / 2, 1), hz([expected]), rtol=1e-9)


# --- beams of eight elements

CLAMP = {"type": "fixed", "base": "ground", "follower": "l.start"}
COLUMN = {"A": {**CLAMP, "angle": np.pi / 2}}
LOAD = {"load": {"at": "l.end", "mass": 3.0}}


def beam(length: float) -> Tree:
    return {"length": length, "material": "m", "section": "s", "elements": 8}


def critical(
    links: Tree, joints: Tree, bodies: Tree, space: str, gravity: list[float], **more: Any
) -> float:
    """How many times the gravity buckles."""
    models = [scene(links, joints, bodies, {}, space, g, **more) for g in ("none", gravity)]
    K, loaded = (model.matrices([], np.zeros(0))[1] for model in models)
    return float(1.0 / linalg.eigvalsh(K - loaded, K)[-1])


def test_the_frequency_of_a_column_falls_to_nothing_as_it_buckles() -> None:
    """A mass m on a massless column under P: λ m = P / (tan(aL)/a − L) with a² = P/EI."""
    P_cr, shares = np.pi**2 * EI / (4.0 * 2.0**2), np.array([0.5, 0.998])
    gravities = ["none", *([0.0, -share * P_cr / 3.0] for share in shares)]
    found = [
        hertz(scene({"l": beam(2.0)}, COLUMN, LOAD, {}, "planar", g, material=LIGHT), [], 1)[0]
        for g in gravities
    ]
    a = np.sqrt(shares * P_cr / EI)
    expected = shares * P_cr / (np.tan(2.0 * a) / a - 2.0) / (3.0 * EI / 2.0**3)
    np.testing.assert_allclose(np.square(found[1:]) / found[0] ** 2, expected, atol=1e-4)


def test_a_column_buckles_under_its_own_weight() -> None:
    """w L = 7.837 EI / L²."""
    times = critical({"l": beam(2.0)}, COLUMN, {}, "planar", [0.0, -G])
    w = STEEL["density"] * WIDTH * HEIGHT * G * times
    np.testing.assert_allclose(w, 7.8373 * EI / 2.0**3, rtol=1e-3)


@pytest.mark.parametrize("share", [-0.5, 0.3, 5.0])
def test_a_pinned_beam_under_tension(share: float) -> None:
    """λ_n = (nπ/L)² (N + EI (nπ/L)²) / ρA, with the tension N as a share of Euler's load."""
    L, block = 1.5, 2000.0
    N = share * np.pi**2 * EI / L**2
    joints = {
        "A": hinge("ground", "l"),
        "B": {"type": "revolute", "base": "l.end", "follower": "block.start"},
        "C": {
            "type": "prismatic", "base": "ground", "follower": "block.start", "axis": [0.0, 1.0],
            "position": [0.0, 0.0],
        },
    }  # fmt: skip
    guess = {"A": -np.pi / 2, "B": np.pi / 2, "C": -L}
    model = scene(
        {"l": beam(L), "block": rod(0.1, block, inertia=10.0)}, joints, {}, {}, "planar",
        [0.0, -N / block], assembly={"guess": guess},
    )  # fmt: skip
    found = hertz(model, [], 8)
    wave = np.arange(1, 3) * np.pi / L
    mass = STEEL["density"] * WIDTH * HEIGHT
    for expected in hz(wave**2 * (N + EI * wave**2) / mass):
        assert np.abs(found / expected - 1.0).min() < 1e-3


def test_a_hanging_rope() -> None:
    """ω_n = j_0,n/2 √(g/L), of a beam so thin that it bends as a rope does."""
    L, thin = 3.0, {**STRIP, "height": 2e-6}
    free = {"q": {"joint": "A"}}
    model = scene({"l": beam(L)}, {"A": hinge("ground", "l")}, {}, free, section=thin)
    expected = hz((jn_zeros(0, 2) / 2.0) ** 2 * G / L)
    np.testing.assert_allclose(hertz(model, -np.pi / 2, 2), expected, rtol=1e-3)


def test_a_narrow_cantilever_buckles_sideways() -> None:
    """P = 4.013 √(EI_z G J) / L² under a tip load along the height of its section."""
    L, b, h = 1.2, 0.002, 0.08
    plate = {**STRIP, "width": b, "height": h}
    bodies = {"load": {"at": "l.end", "mass": 1.0}}
    P = critical(
        {"l": beam(L)}, {"A": CLAMP}, bodies, "spatial", [0.0, -1.0, 0.0],
        section=plate, material=LIGHT,
    )  # fmt: skip
    E, shear = STEEL["youngs_modulus"], STEEL["youngs_modulus"] / 2.6
    J = h * b**3 * (1.0 / 3.0 - 0.21 * b / h * (1.0 - (b / h) ** 4 / 12.0))
    expected = 4.013 * np.sqrt(E * h * b**3 / 12.0 * shear * J) / L**2
    np.testing.assert_allclose(P, expected, rtol=1e-2)


# --- booms: what the issue is about


def boom(length: float, diameter: float, wall: float, load: float, gravity: Any) -> Model:
    tube = {"shape": "tube", "outer_diameter": diameter, "thickness": wall}
    return scene(
        {"l": beam(length)}, {"A": hinge("ground", "l")}, {"load": {"at": "l.end", "mass": load}},
        {"q": {"joint": "A", "drive": "locked"}}, gravity=gravity, section=tube,
        material={"youngs_modulus": 210e9, "density": 7850.0},
    )  # fmt: skip


def ritz(length: float, diameter: float, wall: float, load: float, angle: float) -> float:
    """The first frequency from ten powers of x, the weight along the boom as its axial force.

    x² times Legendre's polynomials, which are 1 at the end, spans the same: of the powers
    themselves the mass matrix is singular but for round-off.
    """
    x, w = np.polynomial.legendre.leggauss(30)
    x, w = 0.5 * (x + 1.0), 0.5 * length * w
    area = np.pi / 4 * (diameter**2 - (diameter - 2 * wall) ** 2)
    EI = 210e9 * np.pi / 64 * (diameter**4 - (diameter - 2 * wall) ** 4)
    square = np.polynomial.Polynomial([0.0, 0.0, 1.0])
    legendre = (np.polynomial.Legendre.basis(n, [0.0, 1.0]) for n in range(10))
    powers = [square * each.convert(kind=np.polynomial.Polynomial) for each in legendre]
    v, slope, curvature = (
        np.array([each.deriv(m)(x) if m else each(x) for each in powers]) / length**m
        for m in range(3)
    )
    mass = 7850.0 * area
    N = -G * np.sin(angle) * (load + mass * length * (1.0 - x))
    K = EI * (curvature * w) @ curvature.T + (slope * w * N) @ slope.T
    M = mass * (v * w) @ v.T + load
    return float(hz(linalg.eigvalsh(K, M)[0]))


@pytest.mark.parametrize(
    "tube", [(40.0, 0.6, 0.012, 8e3), (25.0, 0.4, 0.01, 5e3), (12.0, 0.12, 0.006, 60.0)]
)
@pytest.mark.parametrize("degrees", [-90.0, 0.0, 30.0, 80.0])
def test_booms_under_weight(tube: tuple[float, ...], degrees: float) -> None:
    angle = np.radians(degrees)
    found = hertz(boom(*tube, [0.0, -G]), angle, 1)
    np.testing.assert_allclose(found, ritz(*tube, angle), rtol=1e-3)


# --- when it is not stated: by stress, and by sag

TOWER_STEEL = {"youngs_modulus": 2.1e11, "density": 7850.0, "shear_modulus": 8e10}


def tower(length: float, load: float, **more: Any) -> dict[str, Any]:
    """A tube of 600 × 12 mm at 80° with a load at its tip."""
    tube = {"length": length, "elements": 8, "material": "steel", "section": "tube"}
    return linkage(
        {"boom": tube},
        {
            "foot": {"type": "revolute", "base": "ground", "follower": "boom.start"},
        },
        {"luff": {"joint": "foot", "drive": "locked"}},
        sections={"tube": {"shape": "tube", "outer_diameter": 0.6, "thickness": 0.012}},
        materials={"steel": dict(TOWER_STEEL)},
        bodies={"load": {"at": "boom.end", "mass": load}},
        **more,
    ) | {"title": "a boom"}


def test_a_boom_loses_as_much_as_it_loses_with_stated_gravity() -> None:
    q, weight = [np.radians(80.0)], np.array([0.0, -9.81])
    model = ea.load_case(tower(40.0, 8000.0)).model()
    stated = ea.load_case(tower(40.0, 8000.0, gravity=weight.tolist())).model()
    plain, loaded = (one.frequencies(q, [], 1)[0, 0] for one in (model, stated))
    np.testing.assert_allclose([plain, loaded], [0.1574, 0.1305], atol=5e-5)
    found = weight_changes(model, q, [], (1,))
    exact = (loaded / plain) ** 2 - 1.0
    assert found.stress[0, 0] @ weight == pytest.approx(exact, rel=0.02)
    assert abs(found.sag[0, 0] @ weight) < 1e-4  # a straight link is but shortened


def test_modes_that_are_not_near_mix_under_weight_too() -> None:
    """One rod up and one down, a spring between them: neither mode feels the weight by itself."""
    rod = {"type": "rigid", "length": 1.0, "mass": 0.0}
    ends = {"a": "q1", "b": "q2"}
    tree = linkage(
        dict.fromkeys(ends, rod),
        {
            name: {"type": "revolute", "base": "ground", "follower": f"{name}.start"}
            for name in ends
        },
        {q: {"joint": name, "drive": {"stiffness": 20.0}} for name, q in ends.items()},
        bodies={name: {"at": f"{name}.end", "mass": 1.0} for name in ends},
        springs={"s": {"between": ["a.start", "b.start"], "rotational": 1.0}},
    ) | {"title": "twins"}
    q = [np.pi / 2, -np.pi / 2]
    model = ea.load_case(tree).model()
    found = weight_changes(model, q, [], (1, 2))
    np.testing.assert_allclose(found.stress, 0.0, atol=1e-12)
    tree["mechanism"]["gravity"] = [0.0, -9.81]
    plain, stated = (m.frequencies(q, [], 2)[0] for m in (model, ea.load_case(tree).model()))
    most = 9.81 * np.linalg.norm(found.stress_mixing[0], axis=1)
    true = np.abs((stated / plain) ** 2 - 1.0)
    assert (true <= most * (1.0 + 1e-9)).all()
    assert (most <= 1.3 * true).all()


def test_buckling_is_eulers() -> None:
    EI = 2.1e11 * np.pi / 64 * (0.6**4 - 0.576**4)
    tree = tower(40.0, 8000.0, gravity=[0.0, -9.81])
    tree["mechanism"]["materials"]["steel"]["density"] = 1e-3
    model = ea.load_case(tree).model()
    share = buckling(model, [[np.pi / 2], [-np.pi / 2]], [])
    euler = 8000.0 * 9.81 / (np.pi**2 * EI / (4 * 40.0**2))
    np.testing.assert_allclose(share, [euler, 0.0], rtol=1e-4, atol=1e-9)


def test_a_drive_that_gives_way_buckles_too() -> None:
    tree = tower(2.0, 50.0, gravity=[0.0, -9.81])
    tree["mechanism"]["links"]["boom"] = {"type": "rigid", "length": 2.0, "mass": 0.0}
    tree["coordinates"]["luff"]["drive"] = {"stiffness": 4000.0}
    model = ea.load_case(tree).model()
    share = buckling(model, [[np.pi / 2], [0.0], [-np.pi / 2]], [])
    most = 50.0 * 9.81 * 2.0 / 4000.0
    np.testing.assert_allclose(share, [most, 0.0, 0.0], rtol=1e-12, atol=1e-15)


def test_the_sag_of_a_cantilever() -> None:
    EI = 2.1e11 * np.pi / 64 * (0.6**4 - 0.576**4)
    weight = 7850.0 * np.pi / 4 * (0.6**2 - 0.576**2) * 9.81
    names, found = sag_of_nodes(ea.load_case(tower(40.0, 800.0)).model(), [0.0], [], [0.0, -9.81])
    expected = weight * 40.0**4 / (8 * EI) + 800.0 * 9.81 * 40.0**3 / (3 * EI)
    assert names == ("boom.start", "boom.end")
    turned = weight * 40.0**3 / (6 * EI) + 800.0 * 9.81 * 40.0**2 / (2 * EI)
    there = [[0.0] * 6, [0.0, -expected, 0.0, 0.0, 0.0, -turned]]
    np.testing.assert_allclose(found[0], there, atol=1e-9 * expected)
