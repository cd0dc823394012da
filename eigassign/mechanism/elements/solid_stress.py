"""k_σ of a solid part for each load: the stress of its elements, and what couplings move twice.

A unit wrench on a node is balanced by the inertia of the part, −M r (rᵀM r)⁻¹ rᵀ f with its rigid
motions r: loads that balance with its weight, or with its inertia while it speeds up, then leave
that out. While it turns by ω, accelerations S x, S = ω̃ ω̃, are left, balanced likewise. To second
order the stress σ of such a load does the work

    Π₂ = ½ ∫ σ_ij u_k,i u_k,j dV + Σ F_s · w_s,

F_s what the coupling puts on the nodes of a surface, w_s the part of second order of their motion:

    rigid           w_s = θ × (θ × r_s)/2
    distributing    Σ F_s · w_s = −F · (θ × (θ × d))/2 − (M + d × F) · φ,
                    J φ = ∫ (θ × s) × u dA + θ × C θ/2,   C = ∫ s sᵀ dA

with (F, M) on its node, θ its turn, r, s, d and J as in `part`, so that
∫ (s + θ × s + θ × (θ × s)/2) × (s + u) dA = 0. Nodes turn by rotation vectors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy import sparse

from eigassign.arrays import Floats, Ints
from eigassign.mechanism.elements.craig_bampton import factorise
from eigassign.mechanism.solids.elements import KINDS, dofs, gradients, lame, mass, slopes
from eigassign.mechanism.solids.part import AT_ONCE, Coupling, SolidPart, crossed, moments

PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # entries of S


@lru_cache(maxsize=4)
def stressed(part: SolidPart, kept: tuple[int, ...]) -> StressedPart:
    """The part with the freedoms ``kept`` of its nodes."""
    return StressedPart(part, kept)


@dataclass(frozen=True, eq=False)
class StressedPart:
    """k_σ of the unit loads: the wrenches (6) of each node one after the other, then `PAIRS`."""

    part: SolidPart
    kept: tuple[int, ...]

    @cached_property
    def own(self) -> Ints:
        """The part's local dofs that are free."""
        first = 6 * len(self.part.nodes)
        own = np.add.outer(np.arange(0, first, 6), self.kept).ravel()
        return np.append(own, np.arange(first, self.part.stiffness.shape[0]))

    @cached_property
    def motion(self) -> sparse.csr_array:
        """u (3 n,) of the mesh per local dof that is free."""
        return sparse.csr_array(self.part.motion[:, self.own])

    @cached_property
    def _pattern(self) -> sparse.csr_array:
        """∫ N_i N_j dV (n, n), with an entry for each pair of nodes of an element."""
        found, n = [], len(self.part.mesh.x)
        for count, rows in self.part.mesh.pieces(AT_ONCE // 2000):
            values = mass(self.part.mesh.x[rows], count)
            i, j = np.broadcast_arrays(rows[:, :, None], rows[:, None])
            found.append((i.ravel(), j.ravel(), values.ravel()))
        i, j, values = map(np.concatenate, zip(*found, strict=True))
        out = sparse.csr_array((values, (i, j)), shape=(n, n))
        out.sum_duplicates()
        return out

    @cached_property
    def _loads(self) -> tuple[Floats, Floats]:
        """Displacements and own loads of the mesh, (3 n, n_loads), for E = 1."""
        part, x = self.part, self.part.mesh.x
        first, n, own = 6 * len(part.nodes), len(x), self.own
        f = np.zeros((len(own), first + len(PAIRS)))
        held = np.flatnonzero(own < first)
        f[held, own[held]] = 1.0
        field = np.zeros((n, 3, f.shape[1]))
        for k, (i, j) in enumerate(PAIRS, start=first):
            field[:, i, k] -= x[:, j]
            field[:, j, k] -= x[:, i] * (i != j)
        inertia = self._weighed(field)
        f += self.motion.T @ inertia
        r = part.rigid[own][:, list(self.kept)]
        M = sparse.csr_array(part.mass[own][:, own])
        c = np.linalg.solve(r.T @ (M @ r), r.T @ f)
        f -= M @ (r @ c)
        inertia -= self._weighed(np.asarray(self.motion @ (r @ c)).reshape(field.shape))
        K, free = sparse.csc_array(part.stiffness), own[len(self.kept) :]
        v = np.zeros_like(f)
        v[len(self.kept) :] = factorise(K[free][:, free]).solve(f[len(self.kept) :])
        return np.asarray(self.motion @ v), inertia

    def _weighed(self, field: Floats) -> Floats:
        """M a of accelerations (n, 3, n_loads), as (3 n, n_loads)."""
        n = len(field)
        return np.asarray((self._pattern @ field.reshape(n, -1)).reshape(3 * n, -1))

    @cached_property
    def _stresses(self) -> tuple[Floats, Floats]:
        """∫ σ_ij N_a,i N_b,j dV, (n_loads, n_pairs) as in the pattern, and F (3 n, n_loads)."""
        (u, inertia), pattern, mesh = self._loads, self._pattern, self.part.mesh
        n, count = len(mesh.x), u.shape[1]
        (lam, mu), size = lame(self.part.nu), np.diff(pattern.indptr)
        keys = np.repeat(np.arange(n), size) * n + pattern.indices
        found, F = np.zeros((count, pattern.nnz)), -inertia.reshape(n, 3, count)
        for nodes, rows in mesh.pieces(AT_ONCE // (40 * count)):
            xi, weights = KINDS[nodes].points, KINDS[nodes].weights
            dN, det = gradients(mesh.x[rows], nodes, xi, slopes(nodes, xi))
            H = dN @ u.reshape(n, -1)[rows][:, None]  # u_a,i at [..., i, (a, load)]
            H = H.reshape(*dN.shape[:3], 3, count)
            trace = np.einsum("mgiil->mgl", H)[:, :, None, None] * np.eye(3)[..., None]
            stress = lam * trace + mu * (H + H.swapaxes(2, 3))
            heavy = dN * (det * weights)[:, :, None, None]
            np.add.at(F, rows, np.einsum("mgik,mgial->mkal", heavy, stress, optimize=True))
            slope = np.einsum("mgijl,mgjb->lmgib", stress, dN, optimize=True)
            at = np.searchsorted(keys, (rows[:, :, None] * n + rows[:, None]).ravel())
            for one, own in zip(found, slope, strict=True):
                np.add.at(one, at, np.einsum("mgia,mgib->mab", heavy, own, optimize=True).ravel())
        return found, F.reshape(3 * n, count)

    def matrices(self, loads: Sequence[int], basis: Floats | None) -> list[sparse.csr_array]:
        """k_σ (n_local, n_local) of unit ``loads``, in the coordinates of a basis where given."""
        P: sparse.csr_array | Floats = self.motion if basis is None else self.motion @ basis
        axes, out = [P[a::3] for a in range(3)], []
        for load in loads:
            data = self._stresses[0][load], self._pattern.indices, self._pattern.indptr
            S = sparse.csr_array(data, shape=self._pattern.shape)
            curved = self._curved(load)[self.own][:, self.own]
            if basis is not None:
                curved = basis.T @ (curved @ basis)
            found = sparse.csr_array(sum((p.T @ (S @ p) for p in axes), curved))
            out.append(sparse.csr_array(0.5 * (found + found.T)))
        return out

    def _curved(self, load: int) -> sparse.csr_array:
        """The Hessian of Σ F_s · w_s in all local dofs."""
        n = self.part.stiffness.shape[0]
        out = sparse.lil_array((n, n))
        for k, node in enumerate(self.part.nodes):
            turn = slice(6 * k + 3, 6 * k + 6)
            if node.rigid:
                arms = self.part.mesh.x[node.own] - node.place
                D = self._stresses[1][:, load].reshape(-1, 3)[node.own].T @ arms
                out[turn, turn] = _twice(D)
            elif load // 6 == k:
                H, A = self._followed(node, np.eye(6)[load % 6])
                out[turn, turn] = H
                out[turn] += 2.0 * (A @ self.part.motion[dofs(node.own[None])[0]])
        return out.tocsr()

    def _followed(self, node: Coupling, wrench: Floats) -> tuple[Floats, Floats]:
        """H (3, 3) and A (3, 3 n_own): θᵀ H θ/2 + θᵀ A u is the work of a distributing node."""
        w, arms, levers, J = moments(self.part.mesh, node)
        F, d = wrench[:3], node.place - w @ self.part.mesh.x[node.own]
        m = np.asarray(np.linalg.solve(J, wrench[3:] + np.cross(d, F)), dtype=np.float64)
        turned = 0.5 * crossed(m) @ arms.T @ levers
        A = np.einsum("a,ib->aib", m, levers) - np.einsum("i,ab->aib", levers @ m, np.eye(3))
        return turned + turned.T - _twice(np.outer(F, d)), A.reshape(3, -1)


def _twice(D: Floats) -> Floats:
    """The Hessian of Σ F · (θ × (θ × r))/2 with D = Σ F rᵀ."""
    return np.asarray(0.5 * (D + D.T) - np.trace(D) * np.eye(3))
