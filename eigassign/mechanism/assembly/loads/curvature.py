"""Motion of second order where something hangs on an arm: −F · w₂ − M · ψ₂ of what it carries.

A node that turns by θ (a rotation vector) moves what is rigidly attached at r by θ × (θ × r)/2 to
second order. Through a joint with lever t, whose follower moves by t₁ and turns by ψ₁ against the
base node in its axes, the follower goes

    w₂ = θ × (θ × t)/2 + θ × t₁,    ψ = θ × ψ₁/2 + ½ Σ_{i<j} A_i × A_j δ_i δ_j

with A_i, δ_i the axes and motions of its own turns in their order. F, M are what it carries. What
rides on a beam goes δ (u' − θ × e_x) farther and turns by δ θ', the beam's strains where it stands.
"""

from __future__ import annotations

import itertools

import numpy as np

from eigassign.mechanism.assembly.affine_entries import AffineEntries
from eigassign.mechanism.assembly.node_motion import MotionRows, combined
from eigassign.mechanism.elements.beam import PLANES, Shear, shares
from eigassign.mechanism.kinematics.rotations import Objects, cross, multiply, present, skew
from eigassign.series.expression import Scalar


def add_arms(target: AffineEntries, turn: MotionRows, D: Objects) -> None:
    """Hessian of −½ θᵀ(D − tr D)θ, D = Σ F rᵀ of forces on arms; ``turn`` are the rows of θ."""
    work = D * -0.5 + np.diag([(D[0, 0] + D[1, 1] + D[2, 2]) * 0.5] * 3)
    add_bilinear(target, work, turn, turn)


def add_joint(
    target: AffineEntries,
    base: MotionRows,
    own: MotionRows,
    freedoms: Objects,
    lever: Objects,
    wrench: Objects,
) -> None:
    """Hessian of −F · w₂ − M · ψ₂ of a joint: rows of its base node, six, and of its motions δ.

    ``freedoms`` is A (6, k) in the base's axes, the wrench what the follower puts on the base node.
    """
    F = wrench[:3]
    M = wrench[3:] - cross(lever, F)  # about the follower's node
    add_arms(target, base[3:], np.outer(F, lever))
    # −F · (θ × t₁) = θᵀ [F]× t₁, with t₁ and ψ₁ = A δ
    add_bilinear(target, multiply(skew(F), freedoms[:3]), base[3:], own)
    add_bilinear(target, multiply(skew(M), freedoms[3:]) * 0.5, base[3:], own)
    for i, j in itertools.combinations(range(len(own)), 2):
        turned = multiply(skew(freedoms[3:, i]), freedoms[3:, j])
        work = multiply(M[None], turned)[0] * -0.5
        add_bilinear(target, np.array([[work]], dtype=object), [own[i]], [own[j]])


def end_strains(h: Scalar, bent: tuple[Shear, Shear], end: int) -> Objects:
    """Strains (6, 12) at the end 0 or 1 of a beam element, of its dofs and in its axes.

    The stretch, two shear angles and the rates of turning, (u' − θ × e_x, θ'); with the symbols of
    `Shear` −6 h γ = Φ/(1+Φ) (t + r b)ᵀ d and h² κ = bᵀ d + (tᵀ d + 6 h γ) τ, τ = ∓1.
    """
    out, over = np.zeros((6, 12), dtype=object), h**-1.0
    for row in (0, 3):
        out[row, row], out[row, row + 6] = over * -1.0, over
    b, t, tau = (0.0, -1.0, 0.0, 1.0), (6.0, 3.0, -6.0, 3.0), (-1.0, 1.0)[end]
    for (w, theta, sign), each in zip(PLANES, bent, strict=True):
        _, phi, skew = [*shares(each), 0.0, 0.0][:3]
        for k, dof in enumerate((w, theta, w + 6, theta + 6)):
            d = h * sign if k % 2 else 1.0
            sheared = (phi * t[k] + skew * b[k]) * d  # −6 h γ
            out[w, dof] = sheared * over * (-1.0 / 6.0)
            out[theta, dof] = ((b[k] + t[k] * tau) * d - sheared * tau) * over * over * sign
    return out


def add_spring(
    target: AffineEntries, here: MotionRows, there: MotionRows, arm: Objects, force: Objects
) -> None:
    """Hessian of (F, M) · what a spring stretches by to second order, in its axes.

    With D the motion of its second node against the first, θ₁, θ₂ their turns and d the arm:
    −θ₁ × D + θ₁ × (θ₁ × d)/2 and −θ₁ × θ₂/2. ``here`` are the rows of the first node itself.
    """
    F, M = force[:3], force[3:]
    apart = [combined(b, a, -1.0) for a, b in zip(here[:3], there[:3], strict=True)]
    add_arms(target, here[3:], np.outer(F, arm) * -1.0)
    add_bilinear(target, skew(F), here[3:], apart)  # −F · (θ × D) = θᵀ [F]× D
    add_bilinear(target, skew(M) * 0.5, here[3:], there[3:])


def add_bilinear(target: AffineEntries, work: Objects, left: MotionRows, right: MotionRows) -> None:
    """Hessian of aᵀ C b, a and b the motions of two sets of rows."""
    for i, j in zip(*np.nonzero(present(work)), strict=True):
        a, b = list(left[i].items()), list(right[j].items())
        if a and b:
            target.add_product(work[i, j], a, b)
