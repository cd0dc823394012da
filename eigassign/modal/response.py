"""Frequency responses: how far a node moves along a direction per force, at a frequency.

With b_a·x and b_b·x the motions of nodes along directions, x = [u; q̇], and C the damping,

    H_ab(ω) = b_aᵀ (K − ω² M + iωC)⁻¹ b_b = Σ_i (b_a·φ_i)(b_b·φ_i) / d_i + R_ab

over mass-normalised modes. Damping is not in the eigenproblem. By ratios ζ_i, C = MΦ diag(2ζω) ΦᵀM,

    d_i = λ_i − ω² + 2iζ_i ω √λ_i,      R = b_aᵀK⁻¹b_b − Σ_i (b_a·φ_i)(b_b·φ_i) / λ_i,

R being what modes left out do at rest. By loss factors η of materials and drives K becomes complex,
K + iK_loss with K_loss = Σ_c η_c K_c (`mechanism.assembly.build.loss_pencil`), and the modes are
those of Λ + iΦᵀK_lossΦ, complex symmetric,

    d_i = μ_i − ω²,      R over 1 + iη_R,   η_R that of the shape that is left over.

Of one factor for all, μ_i = λ_i (1 + iη). Of several, the shares of strain energy are an estimate,
η_i ≈ φᵀK_lossφ/λ_i, and ζ_i ≈ η_i/2 is what is told of either (Ewins, Modal Testing, 2000, ch. 2).

Slopes. With u = (K − ω²M + iK_loss)⁻¹ b, ∂H/∂x = −uᵀ(K_x + iK_loss,x − ω²M_x)u + 2 b_xᵀu. Ratios
make H a function g(λ) = 1/d of the pencil, and with β_i = b·φ_i, A = ΦᵀK_xΦ and B = ΦᵀM_xΦ

    ∂H/∂x = Σ_ij β_i β_j (g[λ_i, λ_j] A_ij − (λg)[λ_i, λ_j] B_ij) + 2 Σ_i (b_x·φ_i) g_i β_i,

g[λ_i, λ_j] divided differences (Daleckii, Krein; Higham, Functions of Matrices, 2008, ch. 3); what
is at rest is a mode with λ → ∞ in it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.case.schema.study import Damping as Ratios
from eigassign.errors import MechanismError
from eigassign.mechanism.assembly.build import loss_pencil
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.mechanism.forces import Forces, forces
from eigassign.modal.arguments import chunks
from eigassign.modal.exact.solver import lowest_modes
from eigassign.modal.model import Model
from eigassign.modal.under_load import displaced

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Numbers = NDArray[Any]  # complex
NEAR = 1e-9  # relative: of λ that are as good as one, and of what is left at rest
SPAN = (
    30.0  # times the highest frequency asked for: modes beyond are at rest, to 1e-3 of their part
)
FEW = 8  # modes at first


class Damping(NamedTuple):
    """Ratios of modes 1, 2, … and last of all others, or K_loss; neither where none is stated."""

    ratios: tuple[float, ...] = ()
    loss: Pencil | None = None

    def zeta(self, count: int) -> Floats:
        """ζ (count,) of the lowest modes."""
        few = self.ratios or (0.0,)
        return np.array([*few[:-1][:count], *[few[-1]] * (count - len(few) + 1)][:count])


def dampings(model: Model) -> tuple[Damping, ...]:
    """The damping of a case, or where a range is stated the least and the most."""
    case = model.poses.case
    given, factors = case.damping, [*loss_factors(case).values()]
    ends = range(1 + any(isinstance(each, tuple) for each in (*_ratios(given), *factors)))
    if given is not None:
        return tuple(Damping(tuple(_end(own, k) for own in _ratios(given))) for k in ends)
    if not factors:
        return (Damping(),)
    if model.held is not None:
        raise MechanismError("mechanism", "a held mechanism has no response")
    known = case, model.poses.parameters, model.motion, model.meshes

    def loss(end: int) -> Pencil:
        return loss_pencil(*known, lambda part: _end(getattr(part, "loss_factor", None), end))

    return tuple(Damping(loss=loss(k)) for k in ends)


def loss_factors(case: CaseFile) -> Mapping[str, Any]:
    """The loss factors that a case states, by the keys that they stand below."""
    parts: dict[str, Any] = {
        f"mechanism.materials.{n}": m for n, m in case.mechanism.materials.items()
    }
    parts |= {f"coordinates.{name}.drive": own.drive for name, own in case.coordinates.items()}
    own = {path: getattr(part, "loss_factor", None) for path, part in parts.items()}
    return {path: eta for path, eta in own.items() if eta is not None}


def _ratios(given: Any) -> tuple[Any, ...]:
    if given is None:
        return ()
    return (*(given.modes or ()), given.ratio) if isinstance(given, Ratios) else (given,)


def _end(given: Any, k: int) -> float:
    return float((given[k] if isinstance(given, tuple) else given) or 0.0)


def require_held(case: CaseFile, what: str) -> None:
    """Raise MechanismError where a coordinate is free: ``what`` needs all to be held."""
    for name, own in case.coordinates.items():
        if own.moves == "free":
            message = (
                f"is free, and {what} needs what holds it: give it a drive stiffness, or lock it"
            )
            raise MechanismError(f"coordinates.{name}", message)


@dataclass(frozen=True, eq=False)
class ModalResponse:
    """Modes at samples x (n, n_x), and what m unit forces do in them; see the top of this page.

    ``rest`` (n, n_dof, m) is what the forces do to what is left out; ``mu``, ``psi`` and ``gamma``
    are λ, φ and b·φ of the complex modes where there is a K_loss, and else the same.
    """

    model: Model
    damping: Damping
    forces: Forces
    x: Floats
    b: Floats  # (n, n_dof, m)
    lam: Floats  # (n, r)
    phi: Floats  # (n, n_dof, r)
    mu: Numbers  # (n, r)
    psi: Numbers  # (n, n_dof, r)
    gamma: Numbers  # (n, r, m)
    rest: Numbers

    @property
    def beta(self) -> Floats:
        """The modal constants b·φ (n, r, m), 1/√kg."""
        return np.asarray(np.swapaxes(self.phi, 1, 2) @ self.b)

    @property
    def zeta(self) -> Floats:
        """ζ_i (n, r): as stated, or half of the shares of strain energy times loss factors."""
        n, r = self.lam.shape
        if self.damping.loss is None:
            return np.tile(self.damping.zeta(r), (n, 1))
        lost = _seen(self.damping.loss, self.x, self.phi)
        return np.asarray(0.5 * np.einsum("nii->ni", lost) / self.lam)

    def at(self, omega: Floats, a: int = 0, b: int = 0) -> Numbers:
        """H_ab (n, k) in m/N at angular frequencies ω (n, k)."""
        both = self.gamma[..., a] * self.gamma[..., b]
        still = np.einsum("nd,nd->n", self.b[..., a], self.rest[..., b])
        found = np.empty(omega.shape, dtype=complex)
        for k in chunks(np.arange(len(omega)), omega.shape[1] * both.shape[1]):
            found[k] = np.einsum("nkr,nr->nk", self._shares(omega, k), both[k]) + still[k, None]
        return found

    def _shares(self, omega: Floats, k: Ints) -> Numbers:
        """1/d_i (p, k, r) at samples ``k`` (p,); infinite at a peak without damping."""
        w, lam = omega[k][..., None], self.mu[k][:, None]
        zeta = self.damping.zeta(lam.shape[2])
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(1.0 / (lam - w**2 + 2j * zeta * w * np.sqrt(self.lam[k])[:, None]))

    def slopes(self, omega: Floats, wanted: NDArray[np.bool_]) -> Numbers:
        """∂H/∂x (n, k, n_x) of the first force at itself, where ``wanted`` (n_x,)."""
        along, every, pencil = np.flatnonzero(wanted), np.arange(len(self.x)), self.model.pencil
        if not len(along):
            return np.zeros((*omega.shape, self.x.shape[1]))
        g = self._shares(omega, every)
        u = np.einsum("ndr,nkr,nr->ndk", self.psi, g, self.gamma[..., 0]) + self.rest[..., :1]
        found = np.zeros((*omega.shape, self.x.shape[1]), dtype=complex)
        _, by_x = self.forces.at(self.x, along)[0]
        found[..., along] = 2.0 * np.einsum("dne,nek->nkd", by_x, u[:, self.forces.unknowns[0]])
        if self.damping.ratios:
            V = np.concatenate([self.phi * self.gamma[:, None, :, 0], self.rest[..., :1]], axis=2)
            in_K, in_M = self._differences(omega, g)
        else:
            V, in_K = u, np.zeros((*omega.shape, *[omega.shape[1]] * 2), dtype=complex)
            j = np.arange(omega.shape[1])
            in_K[:, j, j, j] = -1.0
            in_M = -in_K * omega[..., None, None] ** 2
        found += _changed(pencil, pencil.stiffness, self.x, V, in_K, along)
        found += _changed(pencil, pencil.mass, self.x, V, in_M, along)
        if (loss := self.damping.loss) is not None:
            found += _changed(loss, loss.stiffness, self.x, V, 1j * in_K, along)
        return found

    def _differences(self, omega: Floats, g: Numbers) -> tuple[Numbers, Numbers]:
        """g[λ_i, λ_j] and −(λg)[λ_i, λ_j] (n, k, r + 1, r + 1), the last of what is at rest."""
        lam, w, r = self.lam[:, None], omega[..., None], self.lam.shape[1]
        zeta = self.damping.zeta(r)
        steep = -(1.0 + 1j * zeta * w / np.sqrt(lam)) * g**2
        apart = lam[..., :, None] - lam[..., None, :]
        near = np.abs(apart) <= NEAR * lam[..., None]
        pairs = []
        for value, slope in ((g, steep), (lam * g, g + lam * steep)):
            mean = 0.5 * (slope[..., :, None] + slope[..., None, :])
            with np.errstate(divide="ignore", invalid="ignore"):
                ratio = (value[..., :, None] - value[..., None, :]) / apart
            pairs.append(np.where(near, mean, ratio))
        edges = (-g, np.full((*omega.shape, 1), -1.0)), (1.0 - lam * g, -(w**2))
        in_K, in_M = (
            np.block([[pair, edge[..., :, None]], [edge[..., None, :], corner[..., None]]])
            for pair, (edge, corner) in zip(pairs, edges, strict=True)
        )
        return in_K, -in_M


def modal_response(
    model: Model,
    damping: Damping,
    nodes: Mapping[str, Sequence[Sequence[float]]],
    x: Floats,
    highest: float,
) -> ModalResponse:
    """Responses to unit forces at nodes, each along its directions, at samples x (n, n_x).

    Of all modes up to ``SPAN`` times the ``highest`` frequency (rad/s) that is asked for, what lies
    beyond being at rest. Raises MechanismError where a coordinate is free.
    """
    case, pencil = model.poses.case, model.pencil
    require_held(case, "a response")
    own = forces(case, model.poses.parameters, model.motion, nodes)
    b = np.zeros((len(x), pencil.n_dof, len(own.unknowns)))
    for k, (places, (values, _)) in enumerate(
        zip(own.unknowns, own.at(x, np.arange(0)), strict=True)
    ):
        b[:, places, k] = values
    theta = pencil.theta(x)
    lam, phi = _modes_up_to(pencil, theta, SPAN * highest)
    beta = np.swapaxes(phi, 1, 2) @ b
    rest = displaced(pencil, theta, b) - phi @ (beta / lam[..., None])
    known = model, damping, own, x, b, lam, phi
    if damping.loss is None:
        return ModalResponse(*known, lam, phi, beta, rest)
    stiff = np.einsum("ndm,ndm->nm", b, rest)
    lost = np.einsum("nmm->nm", _seen(damping.loss, x, rest))
    whole = stiff + (beta**2 / lam[..., None]).sum(axis=1)
    eta = np.divide(lost, stiff, out=np.zeros_like(lost), where=stiff > NEAR * whole)
    mu, X = _complex_modes(lam, _seen(damping.loss, x, phi))
    gamma = np.swapaxes(X, 1, 2) @ beta
    return ModalResponse(*known, mu, phi @ X, gamma, rest / (1.0 + 1j * eta)[:, None])


def _complex_modes(lam: Floats, L: Floats) -> tuple[Numbers, Numbers]:
    """μ (n, r) and X (n, r, r) with (Λ + iL) X = X diag(μ), XᵀX = I; L (n, r, r)."""
    mu, X = np.linalg.eig(lam[..., None] * np.eye(lam.shape[1]) + 1j * L)
    return mu, X / np.sqrt(np.einsum("nij,nij->nj", X, X))[:, None]


def _modes_up_to(pencil: Pencil, theta: Floats, highest: float) -> tuple[Floats, Floats]:
    """λ (n, r) and φ (n, n_dof, r) of all modes up to a frequency in rad/s, of some beyond."""
    count, most = min(FEW, len(pencil.elastic)), len(pencil.elastic)
    while True:
        found = lowest_modes(pencil, theta, 1, count - 1)
        there = found.lam.shape[1]
        if there < count or count == most or found.lam[:, -1].min() > highest**2:
            return found.lam, found.phi
        count = min(2 * count, most)


def _seen(pencil: Pencil, x: Floats, V: Floats) -> Floats:
    """VᵀKV (n, r, r) of vectors (n, n_dof, r)."""
    theta, every = pencil.theta(x), np.arange(len(x))
    parts = []
    for k in chunks(every, pencil.n_dof**2) if pencil.is_dense else every[:, None]:
        if pencil.is_dense:
            KV = pencil.stiffness_matrices(theta[:, k]) @ V[k]
        else:
            KV = np.asarray(pencil.sparse(pencil.stiffness @ theta[:, k[0]]) @ V[k[0]])[None]
        parts.append(np.swapaxes(V[k], 1, 2) @ KV)
    return np.concatenate(parts)


def _changed(
    pencil: Pencil, weights: Any, x: Floats, V: Numbers, C: Numbers, along: Ints
) -> Numbers:
    """Σ_ij C_ij v_iᵀ ∂A/∂x v_j (n, k, n_x) of A = K or M by its ``weights``; C (n, k, r, r)."""
    rates = pencil.theta_slopes(x, along)
    moving = np.flatnonzero(np.abs(rates).max(axis=(0, 2), initial=0.0) > 0.0)
    A = weights[:, moving]
    entries = np.flatnonzero(np.diff(A.indptr))
    A, rows, columns = A[entries], pencil.rows[entries], pencil.columns[entries]
    found = np.zeros((*C.shape[:2], x.shape[1]), dtype=complex)
    for k in chunks(np.arange(len(x)), C.shape[1] * V.shape[2] * max(len(entries), 1)):
        half = C[k] @ np.swapaxes(V[k], 1, 2)[:, None]  # (p, k, r, n_dof)
        W = np.einsum("per,pkre->pke", V[k][:, rows], half[..., columns])
        forms = (W.reshape(-1, len(entries)) @ A).reshape(*W.shape[:2], len(moving))
        found[np.ix_(k, np.arange(C.shape[1]), along)] = np.einsum(
            "pkt,dtp->pkd", forms, rates[:, moving][:, :, k]
        )
    return found


# --- The largest |H| in parts of a range of frequencies

SCAN, ROUNDS, FINER = (
    7,
    5,
    5,
)  # frequencies in a part at first; rounds about the largest, and in each


@dataclass(frozen=True, eq=False)
class Shaken:
    """The largest |H| of a node, in parts of a range of frequencies with these ``ends`` (rad/s)."""

    model: Model
    node: str
    direction: Sequence[float]
    ends: Floats
    dampings: tuple[Damping, ...]

    @classmethod
    def of(
        cls, model: Model, node: str, direction: Sequence[float], ends: Floats, finer: bool = False
    ) -> Shaken:
        """Of a model, or of a mesh of twice the elements."""
        if finer:
            case, pencil = model.refined()
            same = {name: mesh for name, mesh in model.meshes.items() if not mesh.whole.strands}
            frames = replace(model.poses, case=case)
            model = replace(model, pencil=pencil, poses=frames, meshes=same)
        return cls(model, node, direction, ends, dampings(model))

    def at(self, x: Floats, wanted: NDArray[np.bool_]) -> tuple[Floats, Floats]:
        """|H| (n, m) in m/N at x (n, n_x), of m parts and dampings, slopes (n, m, n_x) in those
        ``wanted``; the frequency of a maximum does not move it.
        """
        values, slopes = [], []
        for damping in self.dampings:
            nodes = {self.node: [self.direction]}
            found = modal_response(self.model, damping, nodes, x, float(self.ends[-1]))
            omega = self._largest(found)
            H = found.at(omega)
            values.append(np.abs(H))
            turned = (H.conj() / np.maximum(np.abs(H), np.finfo(float).tiny))[..., None]
            steep = (
                found.slopes(omega, wanted) if wanted.any() else np.zeros((*H.shape, len(wanted)))
            )
            slopes.append((turned * steep).real)
        return np.concatenate(values, axis=1), np.concatenate(slopes, axis=1)

    def _largest(self, found: ModalResponse) -> Floats:
        """ω (n, m) of the largest |H| in each part: by a scan with peaks in it, and finer ones."""
        low, high, n = self.ends[:-1], self.ends[1:], len(found.x)
        own, width = (
            np.sqrt(found.mu.real),
            1.0 + found.zeta[..., None] * [-1.0, -0.5, 0.0, 0.5, 1.0],
        )
        there = (own > 0.5 * low[0]) & (own < 2.0 * high[-1])
        near = (own[..., None] * width)[:, there.any(axis=0)].reshape(n, -1)
        scan = np.linspace(low, high, SCAN).T.ravel()
        omega = np.sort(np.hstack([np.tile(scan, (n, 1)), np.clip(near, low[0], high[-1])]), axis=1)
        size, every = np.abs(found.at(omega)), np.arange(n)[:, None]
        inside = (omega[:, None] >= low[:, None]) & (omega[:, None] <= high[:, None])
        best = np.where(inside, size[:, None], -1.0).argmax(axis=2)
        beside = [np.clip(best + k, 0, omega.shape[1] - 1) for k in (-1, 1)]
        start, end = (np.clip(omega[every, k], low, high) for k in beside)
        for _ in range(ROUNDS):
            omega = np.linspace(start, end, FINER, axis=2)
            best = (
                np.abs(found.at(omega.reshape(n, -1)))
                .reshape(omega.shape)
                .argmax(axis=2)[..., None]
            )
            start, end, top = (
                np.take_along_axis(omega, np.clip(best + k, 0, FINER - 1), axis=2)[..., 0]
                for k in (-1, 1, 0)
            )
        return np.asarray(top)
