"""Motion of second order where something hangs on an arm: −F · w₂ − M · ψ₂ of what it carries.

A node that turns by θ (a rotation vector) moves what is rigidly attached at r by θ × (θ × r)/2 to
second order. Through a joint with lever t, whose follower moves by t₁ and turns by ψ₁ against the
base node in its axes, the follower goes

    w₂ = θ × (θ × t)/2 + θ × t₁,    ψ = θ × ψ₁/2 + ½ Σ_{i<j} A_i × A_j δ_i δ_j

with A_i, δ_i the axes and motions of its own turns in their order. F, M are what it carries.
"""

from __future__ import annotations

import itertools

import numpy as np

from eigassign.mechanism.assembly.affine_entries import AffineEntries
from eigassign.mechanism.assembly.node_motion import MotionRows, combined
from eigassign.mechanism.kinematics.rotations import Objects, cross, multiply, present, skew


def add_arm(target: AffineEntries, turn: MotionRows, force: Objects, arm: Objects) -> None:
    """Hessian of −F · (θ × (θ × r))/2 = −(F·θ r·θ − F·r θ·θ)/2; ``turn`` are the rows of θ."""
    work = np.outer(force, arm) * -0.5
    along = (force[0] * arm[0] + force[1] * arm[1] + force[2] * arm[2]) * 0.5
    add_bilinear(target, work + np.diag([along] * 3), turn, turn)


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
    add_arm(target, base[3:], F, lever)
    # −F · (θ × t₁) = θᵀ [F]× t₁, with t₁ and ψ₁ = A δ
    add_bilinear(target, multiply(skew(F), freedoms[:3]), base[3:], own)
    add_bilinear(target, multiply(skew(M), freedoms[3:]) * 0.5, base[3:], own)
    for i, j in itertools.combinations(range(len(own)), 2):
        turned = multiply(skew(freedoms[3:, i]), freedoms[3:, j])
        work = multiply(M[None], turned)[0] * -0.5
        add_bilinear(target, np.array([[work]], dtype=object), [own[i]], [own[j]])


def add_spring(
    target: AffineEntries, here: MotionRows, there: MotionRows, arm: Objects, force: Objects
) -> None:
    """Hessian of (F, M) · what a spring stretches by to second order, in its axes.

    With D the motion of its second node against the first, θ₁, θ₂ their turns and d the arm:
    −θ₁ × D + θ₁ × (θ₁ × d)/2 and −θ₁ × θ₂/2. ``here`` are the rows of the first node itself.
    """
    F, M = force[:3], force[3:]
    apart = [combined(b, a, -1.0) for a, b in zip(here[:3], there[:3], strict=True)]
    add_arm(target, here[3:], F * -1.0, arm)
    add_bilinear(target, skew(F), here[3:], apart)  # −F · (θ × D) = θᵀ [F]× D
    add_bilinear(target, skew(M) * 0.5, here[3:], there[3:])


def add_bilinear(target: AffineEntries, work: Objects, left: MotionRows, right: MotionRows) -> None:
    """Hessian of aᵀ C b, a and b the motions of two sets of rows."""
    for i, j in zip(*np.nonzero(present(work)), strict=True):
        a, b = list(left[i].items()), list(right[j].items())
        if a and b:
            target.add_product(work[i, j], a, b)
