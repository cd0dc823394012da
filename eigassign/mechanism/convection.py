"""What a mesh that moves along its beam adds to the velocity of the beam's matter.

Nodes travel with a carriage or nut, x_a(s) and h(s) in an element, so that the shapes change at a
fixed place x of the beam: with ξ = (x − x_a)/h and Φ of `beam`,

    Ṅ = d/dt N(ξ, h, Φ),   ξ̇ = −(ẋ_a + ξ ḣ)/h,

and the velocity of matter is N ẇ + Ṅ w for nodal motion w. Its kinetic energy needs

    G = ∫ ρ Nᵀ Ṅ dx,   H = ∫ ρ Ṅᵀ Ṅ dx

with the inertia ρ of each field, as in the consistent mass ∫ ρ Nᵀ N dx of `beam`. N and Ṅ are cubic
in ξ: four Gauss points integrate their products exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.mechanism.beam import bending_shapes, bending_slopes
from eigassign.mechanism.mesh import LinkMesh
from eigassign.series.expression import Scalar

Floats = NDArray[np.float64]
Numbers = NDArray[Any]  # real or complex
PLANES = ((1, 5, 1.0), (2, 4, -1.0))  # deflection, rotation: θ_z = dv/dx, θ_y = −dw/dx
IMAGINARY = 1e-30  # step of derivatives along the imaginary axis, which lose no digits


@dataclass(frozen=True, eq=False)
class Riding:
    """A straight beam whose mesh moves; its varying numbers come as rows of a table of scalars."""

    dofs: NDArray[np.intp]  # (n, 12) local dofs of each element; −1 where a plane has none
    turn: Floats  # (12, 12) from the link's axes to those of the section
    n_local: int

    def at(
        self, values: Sequence[Floats], step: float
    ) -> tuple[sparse.csr_array, sparse.csr_array]:
        """G [kg/s] and H [kg/s²] (n_local, n_local) at the middle of three instants ``step`` apart.

        ``values`` are those of `mesh_scalars` at the three.
        """
        n = len(self.dofs)
        before, now, after = (_Elements(v, n) for v in values)
        xi, weights = np.polynomial.legendre.leggauss(4)
        xi, weights = np.tile(0.5 * (1.0 + xi), (n, 1)), 0.5 * weights
        x_rate, h_rate, phi_rate = (
            (getattr(after, key) - getattr(before, key)) * (0.5 / step) for key in ("x", "h", "phi")
        )
        xi_rate = -(x_rate + xi * h_rate) / now.h
        moved = 1j * IMAGINARY
        shapes = fields(xi + moved * xi_rate, now.h + moved * h_rate, now.phi + moved * phi_rate)
        N, N_rate = shapes.real, shapes.imag / IMAGINARY
        matter = now.h[..., None] * weights[:, None] * now.inertia  # (n, n_xi, 6)
        G = np.einsum("epri,epr,eprj->eij", N, matter, N_rate)
        H = np.einsum("epri,epr,eprj->eij", N_rate, matter, N_rate)
        return self._assembled(G), self._assembled(H)

    def _assembled(self, blocks: Floats) -> sparse.csr_array:
        blocks = self.turn.T @ blocks @ self.turn
        places = self.dofs[:, :, None], self.dofs[:, None, :]
        rows, columns = (np.broadcast_to(a, blocks.shape) for a in places)
        kept = (rows >= 0) & (columns >= 0)
        entries = (blocks[kept], (rows[kept], columns[kept]))
        return sparse.csr_array(entries, shape=(self.n_local, self.n_local))


class _Elements:
    """First node, length, Φ (n, 1, 2) and inertia (n, 1, 6) of all elements at one instant."""

    def __init__(self, values: Floats, n: int) -> None:
        nodes, phi, inertia = np.split(values, [n + 1, 3 * n + 1])
        self.x = nodes[:-1, None]
        self.h = np.diff(nodes)[:, None]
        self.phi = phi.reshape(n, 1, 2)
        self.inertia = inertia.reshape(n, 1, 6)


def riding(mesh: LinkMesh) -> Riding:
    """The beam of a link on which a carriage or nut rides."""
    (strand,) = mesh.strands
    assert strand.axes is not None
    slots = np.array(list(strand.slots), dtype=np.intp)
    turn = np.kron(np.eye(4), strand.axes).astype(np.float64)
    return Riding(np.hstack([slots[:-1], slots[1:]]), turn, mesh.n_local)


def mesh_scalars(mesh: LinkMesh) -> list[Scalar]:
    """What varies in a `Riding`: its nodes' places along the beam, Φ and inertia per element."""
    (strand,) = mesh.strands
    places = [X[0] for X in strand.points]
    shear = [phi for pair in strand.shear for phi in pair]
    return [*places, *shear, *(rho for each in strand.inertia for rho in each)]


def fields(xi: Numbers, h: Numbers, phi: Numbers) -> Numbers:
    """N (n, n_xi, 6, 12): displacements and rotations at ξ per dof of an element, section's axes.

    xi (n, n_xi), h (n, 1) in m, phi (n, 1, 2). Stretch and twist are linear, bending is that of
    `bending_shapes` and `bending_slopes`.
    """
    N = np.zeros((*xi.shape, 6, 12), dtype=np.result_type(xi, h, phi))
    for row in (0, 3):
        N[..., row, row], N[..., row, row + 6] = 1.0 - xi, xi
    one = np.ones_like(h)
    for k, (w, slope, sign) in enumerate(PLANES):
        scale = np.stack([one, sign * h, one, sign * h], axis=-1)
        deflection = bending_shapes(xi, phi[..., k]) * scale
        rotation = bending_slopes(xi, phi[..., k]) * scale * (sign / h)[..., None]
        for j, dof in enumerate((w, slope, w + 6, slope + 6)):
            N[..., w, dof], N[..., slope, dof] = deflection[..., j], rotation[..., j]
    return N
