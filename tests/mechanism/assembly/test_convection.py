"""What a mesh that moves with a carriage or nut adds to the velocity terms, against two oracles.

One knows the motion: a field of the beam that stands still in the material, or grows with time,
must obey the equations of motion in whatever mesh it is written. The other takes the kinetic energy
½ ∫ ρ |v|² of matter by quadrature along the beam and forms Lagrange's equations by differences.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from spatial_cases import ALLOY, Built, built, linkage, shipped
from spatial_oracle import Tree

from eigassign.mechanism import fields, local_links, velocity_terms

LENGTH, ELEMENTS = 1.2, 7  # 3 elements before the carriage, 4 behind
SECTION = {"shape": "rectangle", "width": 0.03, "height": 0.05}


def terms(model: Built) -> Any:
    return velocity_terms(model.case, model.numbers, model.motion)


def unit(M: np.ndarray, A: np.ndarray) -> np.ndarray:
    """A with every unknown scaled to unit mass, so that metres and radians compare."""
    d = np.sqrt(np.diag(M))
    return np.asarray(A / np.outer(d, d))


# A field known in the material


def cantilever(space: str, shear: bool, **more: Any) -> Tree:
    """A clamped beam on which a carriage without mass travels."""
    beam = {"length": LENGTH, "elements": ELEMENTS, "material": "m", "section": "s"}
    return linkage(
        {
            "b": {**beam, "shear": shear, **more},
            "car": {"type": "rigid", "mass": 0.0},
        },
        {
            "foot": {"type": "fixed", "base": "ground", "follower": "b.start"},
            "rail": {"type": "carriage", "base": "b", "follower": "car.start"},
        },
        {"x": {"joint": "rail", "drive": "locked"}},
        section=SECTION,
        space=space,
    )


def nodes(s: float, rate: float, acceleration: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Place, velocity and acceleration of all nodes but the clamped one."""
    first, second = np.arange(1, 4) / 3, np.arange(1, 5) / 4
    share = np.concatenate([first, 1.0 - second])
    fixed = np.concatenate([0.0 * first, LENGTH * second])
    return fixed + share * s, share * rate, share * acceleration


def known(space: str, shear: bool) -> list[tuple[list[np.poly1d], str]]:
    """Fields a clamped beam can take in any mesh: six polynomials in x each.

    Bent by an end force F the section turns by 3x² and sinks by x³ − 6 EI/(κGA) x; κ = 5/6.
    """
    x, o = np.poly1d([1.0, 0.0]), np.poly1d([0.0])
    bends = []
    for side, thick in ((0, SECTION["height"]), (1, SECTION["width"])):
        ratio = ALLOY["youngs_modulus"] * thick**2 / 12 / (ALLOY["shear_modulus"] * 5 / 6)
        sink = 6 * ratio * x if shear else o
        for w, turn in ((x**2, 2 * x), (x**3 - sink, 3 * x**2)):
            rows = [o, w, o, o, o, turn] if side == 0 else [o, o, w, o, -turn, o]
            bends.append((rows, f"bending {side} {w.order}"))
    stretch, twist = [x, o, o, o, o, o], [o, o, o, x, o, o]
    if space == "planar":
        return [(stretch, "stretch"), *bends[:2]]
    return [(stretch, "stretch"), (twist, "twist"), *bends]


def nodal(
    rows: list[np.poly1d], kept: list[int], s: float, rate: float, acceleration: float
) -> list[np.ndarray]:
    """P, Ṗ and P̈: the field at the nodes as they travel."""
    X, V, A = nodes(s, rate, acceleration)
    out = []
    for value in (
        lambda p: p(X),
        lambda p: p.deriv()(X) * V,
        lambda p: p.deriv()(X) * A + p.deriv(2)(X) * V**2,
    ):
        out.append(np.stack([value(rows[k]) for k in kept], axis=1).ravel())
    return out


@pytest.mark.parametrize("shear", [False, True])
@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_a_field_at_rest_in_the_material_stays_at_rest_in_a_mesh_that_moves(
    space: str, shear: bool
) -> None:
    """w(x, t) = p(x) f(t) needs the force M P f̈ and no other, where no carriage weighs.

    With u = P(s(t)) f: f̈ M P + ḟ (2 M Ṗ + C P) + f (M P̈ + C Ṗ + K_v P) = f̈ M P.
    """
    model = built(cantilever(space, shear))
    s, rate, acceleration = 0.47, 0.8, -0.6
    numbers = (np.array([v]) for v in (rate, acceleration))
    C, K_v = terms(model).at(np.array([s]), np.zeros(0), *numbers)
    _, M = model.pencil.matrices(model.pencil.theta(model.x([s])))
    kept = [0, 1, 5] if space == "planar" else list(range(6))
    d = np.sqrt(np.diag(M[0]))
    for rows, what in known(space, shear):
        P, V, A = nodal(rows, kept, s, rate, acceleration)
        first, still = 2 * M[0] @ V + C @ P, M[0] @ A + C @ V + K_v @ P
        size = np.abs(M[0] @ V / d).max(), np.abs(K_v @ P / d).max()
        assert np.abs(first / d).max() < 1e-7 * size[0], what
        assert np.abs(still / d).max() < 1e-7 * size[1], what


def test_a_rolled_beam_carries_its_fields_in_turned_axes() -> None:
    """The roll turns no field of the list as a whole, but rolled by a right angle they swap."""
    model = built(cantilever("spatial", True, roll=np.pi / 2))
    other = cantilever("spatial", True)
    other["mechanism"]["sections"]["s"] = {"shape": "rectangle", "width": 0.05, "height": 0.03}
    q, rate = np.array([0.47]), np.array([0.8])
    found, expected = (terms(m).at(q, np.zeros(0), rate, 0 * rate) for m in (model, built(other)))
    for A, B in zip(found, expected, strict=True):
        np.testing.assert_allclose(A.toarray(), B.toarray(), atol=1e-10 * np.abs(B).max())


@pytest.mark.parametrize("tapered", [False, True])
def test_the_fields_integrate_to_the_consistent_mass(tapered: bool) -> None:
    """∫ ρ Nᵀ N with the inertia the convection uses is the mass matrix, with shear and without."""
    for shear in (False, True):
        tree = cantilever("spatial", shear, roll=0.4)
        if tapered:
            (link,) = (each for each in tree["mechanism"]["links"].values() if "section" in each)
            tree["mechanism"]["sections"]["t"] = {
                **tree["mechanism"]["sections"]["s"],
                "width": 0.2,
            }
            link["section"] = {"start": "s", "end": "t"}
        model = built(tree)
        found = terms(model)
        (one,), (values,) = found.stack.riders, found.values(np.array([[0.47]]), np.zeros(0))
        n = ELEMENTS
        x, phi, rho = values[-3:]
        xi, g = np.polynomial.legendre.leggauss(5)
        h = np.diff(x)[:, None]
        N = fields(np.tile((1 + xi) / 2, (n, 1)), h, phi)
        along = np.polynomial.legendre.legvander(xi, rho.shape[1] - 1) @ rho
        matter = h[..., None] * (g / 2)[:, None] * along
        blocks = np.einsum("epri,epr,eprj->eij", N, matter, N)
        assembled = one.assembled(blocks).toarray()
        mass = found.stack.mass(values)
        np.testing.assert_allclose(unit(mass, assembled), unit(mass, mass), atol=1e-12)


# Lagrange's equations of the kinetic energy along the beam


class Energy:
    """½ Σ w |E ẋ + Ė x|² of a mechanism whose one beam with a rider turns about its own axis only.

    The rows of E(t) are the motions of points that stay the same matter, in axes that turn with the
    links; the beam's are displacements and twist at Gauss points of the mesh of one instant.
    """

    def __init__(self, model: Built, beam: str, path: Callable[[float], float]) -> None:
        self.model, self.beam, self.path = model, beam, path
        self.terms = terms(model)
        placements = model.motion.placements
        self.names = [p.link for p in placements]
        self.rotations = [p.world_rotation for p in placements]
        links, _ = local_links(model.case, model.numbers, model.motion)
        ends = np.cumsum([0, *(len(link.own) for link in links)]).tolist()
        self.rows = [slice(a, b) for a, b in pairwise(ends)]  # of each link among all
        self.data = model.case.mechanism.links[beam]
        self.bodies = list(model.case.mechanism.bodies.values())

    def values(self, t: float) -> Any:
        return self.terms.values(np.array([[self.path(t)]]), self.model.y)[0]

    def turns(self, t: float) -> list[np.ndarray]:
        x = self.model.x([self.path(t)])
        return [R[0] for R in self.model.poses.values(x, self.rotations)]

    def mesh(self, t: float) -> np.ndarray:
        s, L, n = self.path(t), self.data.length, self.data.elements
        halves = np.linspace(0, s, n // 2 + 1), np.linspace(s, L, n - n // 2 + 1)
        return np.concatenate([halves[0], halves[1][1:]])

    def parts(self, t: float, x: np.ndarray) -> list[np.ndarray]:
        """World motions at t of the matter at x of the beam, and of every other link's nodes."""
        turns, out = self.turns(t), []
        motion = self.terms.stack.motion(self.values(t))
        width = 3 if self.model.case.mechanism.space == "planar" else 6
        kept = [0, 1, 5] if width == 3 else list(range(6))
        for name, own, R in zip(self.names, self.rows, turns, strict=True):
            B = motion[own]
            nodal = np.zeros((len(B) // width, 6, B.shape[1]))
            nodal[:, kept] = B.reshape(-1, width, B.shape[1])
            whole = np.kron(np.eye(2), R)
            if name == self.beam:
                out.append(whole @ self.along(x, self.mesh(t), nodal))
                out.append(whole @ nodal[:1])  # the bodies at its start
            else:
                out.append(whole @ nodal)
        return out

    @staticmethod
    def along(x: np.ndarray, mesh: np.ndarray, nodal: np.ndarray) -> np.ndarray:
        """(n_x, 6, n_dof): Hermite deflections, linear stretch and twist; no rotary inertia."""
        e = np.searchsorted(mesh, x) - 1
        h = np.diff(mesh)[e]
        z = (x - mesh[e]) / h
        a, b = nodal[e], nodal[e + 1]
        out = np.zeros((len(x), 6, nodal.shape[2]))
        for k in (0, 3):
            out[:, k] = (1 - z)[:, None] * a[:, k] + z[:, None] * b[:, k]
        cubic = (2 * z**3 - 3 * z**2 + 1, h * (z**3 - 2 * z**2 + z),
                 3 * z**2 - 2 * z**3, h * (z**3 - z**2))  # fmt: skip
        for w, slope, sign in ((1, 5, 1), (2, 4, -1)):
            ends = a[:, w], sign * a[:, slope], b[:, w], sign * b[:, slope]
            out[:, w] = sum(c[:, None] * v for c, v in zip(cubic, ends, strict=True))
        return out

    def weights(self, t: float) -> list[np.ndarray]:
        """(6, 6) of every row of `parts`, in the link's axes."""
        mass, out = self.terms.stack.mass(self.values(t)), []
        mesh = self.mesh(t)
        xi, g = np.polynomial.legendre.leggauss(5)
        share = (np.diff(mesh)[:, None] * g / 2).ravel()
        x = (mesh[:-1, None] + np.diff(mesh)[:, None] * (1 + xi) / 2).ravel()
        kept = [0, 1, 5] if self.model.case.mechanism.space == "planar" else list(range(6))
        for name, own in zip(self.names, self.rows, strict=True):
            if name == self.beam:
                area, polar = self.section(x)
                each = np.stack([area, area, area, polar, 0 * area, 0 * area], axis=1)
                out.append((each * share[:, None])[:, :, None] * np.eye(6))
                out.append(self.rotor()[None])
            else:
                out.append((mass[own, own], kept))
        return out

    def section(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """ρA and ρI_p at the places x."""
        m = self.model.case.mechanism
        rho = m.materials[self.data.material].density
        if not isinstance(self.data.section, str):
            low, high = (m.sections[s] for s in (self.data.section.start, self.data.section.end))
            share = x / self.data.length
            b = low.width + share * (high.width - low.width)
            d = low.height + share * (high.height - low.height)
            return rho * b * d, rho * b * d * (b**2 + d**2) / 12
        section, one = m.sections[self.data.section], np.ones(len(x))
        if section.shape == "circle":
            r = section.diameter / 2
            return rho * np.pi * r**2 * one, rho * np.pi * r**4 / 2 * one
        b, d = section.width, section.height
        return rho * b * d * one, rho * b * d * (b**2 + d**2) / 12 * one

    def rotor(self) -> np.ndarray:
        out = np.zeros((6, 6))
        for body in self.bodies:
            assert body.at == f"{self.beam}.start"
            out += np.diag([body.mass] * 3 + list(body.inertia)[:3])
        return out

    def matrices(self, t: float, step: float = 1e-3) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """M, G and H of T = ½ ẋᵀMẋ + ẋᵀGx + ½ xᵀHx at t."""
        mesh = self.mesh(t)
        xi, _ = np.polynomial.legendre.leggauss(5)
        x = (mesh[:-1, None] + np.diff(mesh)[:, None] * (1 + xi) / 2).ravel()
        at = {k: self.parts(t + k * step, x) for k in (-2, -1, 0, 1, 2)}
        turns = dict(zip(self.names, self.turns(t), strict=True))
        owners = [n for n in self.names for _ in range(2 if n == self.beam else 1)]
        M = G = H = 0.0
        for k, (name, w) in enumerate(zip(owners, self.weights(t), strict=True)):
            back = np.kron(np.eye(2), turns[name].T)
            rate = (8 * (at[1][k] - at[-1][k]) - (at[2][k] - at[-2][k])) / (12 * step)
            E, V = back @ at[0][k], back @ rate
            if isinstance(w, tuple):  # nodes coupled by a mass matrix
                m, kept = w
                E, V = (a[:, kept].reshape(len(m), -1) for a in (E, V))
                M, G, H = M + E.T @ m @ E, G + E.T @ m @ V, H + V.T @ m @ V
                continue
            M, G, H = (
                sum_ + np.einsum("pri,prs,psj->ij", a, w, b)
                for sum_, a, b in ((M, E, E), (G, E, V), (H, V, V))
            )
        return M, G, H

    def lagrange(self, step: float = 1e-3) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """M, C and K_v at t = 0 of d/dt ∂T/∂ẋ − ∂T/∂x = M ẍ + C ẋ + K_v x."""
        M, G, H = self.matrices(0.0)
        at = {k: self.matrices(k * step) for k in (-2, -1, 1, 2)}

        def rate(i: int) -> np.ndarray:
            near, far = at[1][i] - at[-1][i], at[2][i] - at[-2][i]
            return np.asarray((8 * near - far) / (12 * step))

        return M, rate(0) + G - G.T, rate(1) - H


TAPERED = (
    ("section: girder, ", "section: {start: girder, end: column}, "),
    ("girder: {shape: rectangle, width: 50 mm, height: 50 mm}",
     "girder: {shape: rectangle, width: 20 mm, height: 80 mm}"),
)  # fmt: skip
FAST_SCREW = (("lead: 10 mm", "lead: 200 mm"), ("-188.496", "-9.42478"))  # as fast as it travels


@pytest.mark.parametrize(
    ("name", "beam", "changes", "s"),
    [
        ("gantry", "girder", (), 0.65),
        ("gantry", "girder", TAPERED, 0.65),
        ("gantry", "girder", (("drive: locked", "drive: free"),), 0.65),
        ("ball_screw", "shaft", FAST_SCREW, 0.22),
        ("ball_screw", "shaft", (), 0.22),
    ],
)
def test_the_velocity_terms_are_lagranges_of_the_kinetic_energy_along_the_beam(
    name: str, beam: str, changes: Any, s: float
) -> None:
    model = shipped(name, *changes)
    rate, acceleration = 0.3, 0.4
    if beam == "shaft" and not changes:
        rate, acceleration = 0.003, 0.0  # the shaft turns 628 rad/m
    energy = Energy(model, beam, lambda t: s + rate * t + acceleration * t * t / 2)
    M, C, K_v = energy.lagrange()
    numbers = (np.array([v]) for v in (rate, acceleration))
    found = energy.terms.at(np.array([s]), model.y, *numbers)
    _, mass = model.pencil.matrices(model.pencil.theta(model.x([s])))
    np.testing.assert_allclose(unit(M, M), unit(M, mass[0]), atol=1e-9)
    for got, expected in zip(found, (C, K_v), strict=True):
        right = unit(M, expected)
        np.testing.assert_allclose(unit(M, got.toarray()), right, atol=1e-6 * np.abs(right).max())


def test_a_nut_that_turns_fast_while_it_travels_slowly_is_resolved() -> None:
    """A lopsided nut turns 628 rad per metre: a difference by its travel alone would be blunt.

    In its own axes what it inherits from the shaft turns at −ω, which ω̃ has to cancel: what is left
    of ω and ω² is an error of the differences, whatever their step.
    """
    tree = cantilever("spatial", False)
    lopsided = {"mass": 2.0, "inertia": [0.01, 0.02, 0.03], "center": [0.0, 0.02, 0.1]}
    tree["mechanism"]["links"]["car"] = {"type": "rigid", **lopsided}
    tree["mechanism"]["joints"]["rail"] |= {"type": "nut", "lead": 0.01}
    model = built(tree)
    found, q, rate = terms(model), np.array([0.47]), 0.01
    _, M = model.pencil.matrices(model.pencil.theta(model.x(q)))
    spin = 2 * np.pi / 0.01 * rate
    at = q, np.zeros(0), np.array([rate]), np.zeros(1)
    fine, coarse = (one.at(*at) for one in (found, replace(found, step=4e-4)))
    for power, one, other in zip((1, 2), fine, coarse, strict=True):
        error = unit(M[0], one.toarray() - other.toarray())
        assert np.abs(error).max() < 1e-5 * spin**power
