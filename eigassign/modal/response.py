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

Slopes. With u = (K − ω²M + iωC)⁻¹ b, and K_loss beside K or C of ratios,

    ∂H/∂x = −uᵀ (K_x − ω²M_x + iωC_x) u + 2 b_xᵀu,

where C = M s(M⁻¹K) of s = 2ζ√λ has, with A = ΦᵀK_xΦ and B = ΦᵀM_xΦ and divided differences s[·, ·],

    (ΦᵀC_xΦ)_ij = s[λ_i, λ_j] A_ij + (s_i + s_j − (λs)[λ_i, λ_j]) B_ij

(Daleckii, Krein; Higham, Functions of Matrices, 2008, ch. 3).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.arrays import Floats, Ints
from eigassign.case.schema.study import Damping as Ratios
from eigassign.errors import MechanismError
from eigassign.mechanism.assembly.build import loss_pencil
from eigassign.mechanism.assembly.held import require_held
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.mechanism.forces import Forces, forces
from eigassign.modal.arguments import chunks
from eigassign.modal.exact.solver import lowest_modes
from eigassign.modal.model import Model
from eigassign.modal.under_load import displaced

Numbers = NDArray[Any]  # complex
CHOSEN = 3  # ranges of damping of which every choice of ends is looked at
NEAR = 1e-9  # relative: of λ that are as good as one, and of what is left at rest
SPAN = (
    30.0  # times the highest frequency asked for: modes beyond are at rest, to 1e-3 of their part
)
LEAST = 1e-300  # what stands for 0 in denominators
FEW = 64  # modes that are all solved; of larger pencils so many at first


class Damping(NamedTuple):
    """Ratios of modes 1, 2, … and last of all others, or K_loss; neither where none is stated."""

    ratios: tuple[float, ...] = ()
    loss: Pencil | None = None

    def zeta(self, count: int) -> Floats:
        """ζ (count,) of the lowest modes."""
        few = self.ratios or (0.0,)
        return np.array([*few[:-1][:count], *[few[-1]] * (count - len(few) + 1)][:count])


def dampings(model: Model) -> tuple[Damping, ...]:
    """The damping of a case; of ranges every choice of their ends, of more than `CHOSEN` two."""
    case = model.poses.case
    if (given := case.damping) is not None:
        ratios = (*(given.modes or ()), given.ratio) if isinstance(given, Ratios) else (given,)
        return tuple(Damping(ends) for ends in _choices(ratios))
    drives = (own.drive for own in case.coordinates.values())
    parts: list[Any] = [*case.mechanism.materials.values(), *drives]
    parts = [part for part in parts if getattr(part, "loss_factor", None) is not None]
    if not parts:
        return (Damping(),)
    known = case, model.poses.parameters, model.motion, model.meshes

    def loss(ends: Sequence[float]) -> Pencil:
        own = {id(part): eta for part, eta in zip(parts, ends, strict=True)}
        return loss_pencil(*known, lambda part: own.get(id(part), 0.0))

    return tuple(Damping(loss=loss(ends)) for ends in _choices([p.loss_factor for p in parts]))


def _choices(given: Sequence[Any]) -> Iterator[tuple[float, ...]]:
    """The values with every choice of the ends of ranges, all least first and all most last."""
    ranges = [k for k, each in enumerate(given) if isinstance(each, tuple)]
    every = product((0, 1), repeat=len(ranges)) if len(ranges) <= CHOSEN else None
    for ends in every or ((0,) * len(ranges), (1,) * len(ranges)):
        at = dict(zip(ranges, ends, strict=True))
        yield tuple(float(one[at[k]] if k in at else one) for k, one in enumerate(given))


@dataclass(frozen=True, eq=False)
class ModalResponse:
    """Modes at samples x (n, n_x), and what m unit forces do in them; see the top of this page.

    ``rest`` (n, n_dof, m) is what the forces do to what is left out; ``mu`` and ``gamma`` are λ and
    b·φ of the complex modes Φ X where there is a K_loss, and else the same.
    """

    model: Model
    damping: Damping
    forces: Forces
    x: Floats
    b: Floats  # (n, n_dof, m)
    lam: Floats  # (n, r)
    phi: Floats  # (n, n_dof, r)
    mu: Numbers  # (n, r)
    gamma: Numbers  # (n, r, m)
    rest: Numbers
    turn: Numbers | None = None  # X (n, r, r)

    @cached_property
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
        left, still = self._sides
        both, still = left[..., a] * self.gamma[..., b], still[:, a, b]
        found = np.empty(omega.shape, dtype=complex)
        for k in chunks(np.arange(len(omega)), omega.shape[1] * both.shape[1]):
            found[k] = np.einsum("nkr,nr->nk", self._shares(omega, k), both[k]) + still[k, None]
        return found

    @cached_property
    def _sides(self) -> tuple[Numbers, Numbers]:
        """(Φ X)ᵀb (n, r, m), and R (n, m, m)."""
        left = self.beta if self.turn is None else np.swapaxes(self.turn, 1, 2) @ self.beta
        still = np.swapaxes(self.b, 1, 2) @ self.rest
        return left, 0.5 * (still + np.swapaxes(still, 1, 2))

    def _shares(self, omega: Floats, k: Ints) -> Numbers:
        """1/d_i (p, k, r) at samples ``k`` (p,), finite at a peak without damping."""
        w, lam = omega[k][..., None], self.mu[k][:, None]
        zeta = self.damping.zeta(lam.shape[2])
        d = np.asarray(lam - w**2 + 2j * zeta * w * np.sqrt(self.lam[k])[:, None])
        d[d == 0.0] = LEAST
        return 1.0 / d

    def peaks(self, low: float, high: float, beside: Sequence[float]) -> Floats:
        """Frequencies (n, p) of modes between two, rad/s, so many times ζ_i ``beside`` each."""
        own, width = np.sqrt(self.mu.real), 1.0 + self.zeta[..., None] * np.array(beside)
        there = ((own > 0.5 * low) & (own < 2.0 * high)).any(axis=0)
        near = (own[..., None] * width)[:, there].reshape(len(own), -1)
        return np.asarray(np.clip(near, low, high))

    def slopes(self, omega: Floats, wanted: NDArray[np.bool_]) -> Numbers:
        """∂H/∂x (n, k, n_x) of the first force at itself, where ``wanted`` (n_x,)."""
        along, pencil, r = np.flatnonzero(wanted), self.model.pencil, self.lam.shape[1]
        found = np.zeros((*omega.shape, self.x.shape[1]), dtype=complex)
        if not len(along):
            return found
        ones = np.ones((*omega.shape, 1))  # the share of what is at rest
        shares = self._shares(omega, np.arange(len(self.x))) * self.gamma[:, None, :, 0]
        turned = shares if self.turn is None else shares @ np.swapaxes(self.turn, 1, 2)
        rest = self.rest[..., :1]
        u = self.phi @ np.swapaxes(turned, 1, 2) + rest
        _, by_x = self.forces.at(self.x, along)[0]
        pull = 2.0 * np.einsum("dne,nek->nkd", by_x, u[:, self.forces.unknowns[0]])
        c, w = np.concatenate([turned, ones], axis=2), omega[..., None]
        V = np.concatenate([self.phi.astype(rest.dtype), rest], axis=2)
        A, B = (
            _changed(pencil, part, self.x, V, along) for part in (pencil.stiffness, pencil.mass)
        )
        work: Any = _work(A, c) - w**2 * _work(B, c)
        if self.damping.ratios:
            in_A, in_B = _root_differences(self.lam, self.damping.zeta(r))
            work = work + 1j * w * _work(A * in_A[:, None] + B * in_B[:, None], c)
        if (loss := self.damping.loss) is not None:
            work = work + 1j * _work(_changed(loss, loss.stiffness, self.x, V, along), c)
        found[..., along] = pull - work
        return found


def _work(A: Numbers, c: Numbers) -> Numbers:
    """cᵀ A_d c (n, k, d) of matrices (n, d, r, r) and vectors (n, k, r)."""
    n, k, r = c.shape
    half = c @ np.swapaxes(A, 1, 2).reshape(n, r, -1)  # (n, k, d r)
    return np.asarray(np.einsum("nkdr,nkr->nkd", half.reshape(n, k, -1, r), c))


def _root_differences(lam: Floats, zeta: Floats) -> tuple[Floats, Floats]:
    """What of ΦᵀC_xΦ goes with ΦᵀK_xΦ and with ΦᵀM_xΦ, each (n, r + 1, r + 1).

    s[λ_i, λ_j] and s_i + s_j − (λs)[λ_i, λ_j] of s = 2ζ√λ; the last row is of what is at rest.
    """
    n, r = lam.shape
    s = 2.0 * zeta * np.sqrt(lam)
    apart = lam[:, :, None] - lam[:, None]
    near = np.abs(apart) <= NEAR * lam[:, None]
    in_A, in_B = np.zeros((2, n, r + 1, r + 1))
    pairs = []
    for value, slope in ((s, 0.5 * s / lam), (lam * s, 1.5 * s)):
        mean = 0.5 * (slope[:, :, None] + slope[:, None])
        ratio = (value[:, :, None] - value[:, None]) / np.where(near, 1.0, apart)
        pairs.append(np.where(near, mean, ratio))
    in_A[:, :r, :r] = pairs[0]
    in_B[:, :r, :r] = s[:, :, None] + s[:, None] - pairs[1]
    in_B[:, :r, r] = in_B[:, r, :r] = s
    return in_A, in_B


def unit_forces(model: Model, nodes: Mapping[str, Sequence[Sequence[float]]]) -> Forces:
    """Unit forces at nodes along directions; raises MechanismError where a coordinate is free."""
    case = model.poses.case
    if model.held is not None:
        raise MechanismError("mechanism", "a node is held: ask the mechanism itself for responses")
    require_held(case, model.motion, "a response")
    return forces(case, model.poses.parameters, model.motion, nodes)


def modal_response(
    model: Model, damping: Damping, own: Forces, x: Floats, highest: float
) -> ModalResponse:
    """Responses to `unit_forces` at samples x (n, n_x).

    Of all modes of a small pencil, and else of those up to ``SPAN`` times the ``highest`` frequency
    (rad/s) that is asked for: what lies beyond is at rest.
    """
    pencil = model.pencil
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
        return ModalResponse(*known, lam, beta, rest)
    stiff = np.einsum("ndm,ndm->nm", b, rest)
    lost = np.einsum("nmm->nm", _seen(damping.loss, x, rest))
    whole = stiff + (beta**2 / lam[..., None]).sum(axis=1)
    eta = np.divide(lost, stiff, out=np.zeros_like(lost), where=stiff > NEAR * whole)
    # (Λ + iL) X = X diag(μ), by the inverse: its largest eigenvalues are those of the lowest modes
    stiff_and_lossy = lam[..., None] * np.eye(lam.shape[1]) + 1j * _seen(damping.loss, x, phi)
    nu, X = np.linalg.eig(np.linalg.inv(stiff_and_lossy))
    gamma = np.linalg.solve(X, beta)  # of modes that coincide X need not be orthogonal
    return ModalResponse(*known, 1.0 / nu, gamma, rest / (1.0 + 1j * eta)[:, None], X)


def _modes_up_to(pencil: Pencil, theta: Floats, highest: float) -> tuple[Floats, Floats]:
    """λ (n, r) and φ (n, n_dof, r) of all modes up to a frequency in rad/s, of some beyond."""
    most = len(pencil.elastic)
    count = most if most <= FEW else FEW
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


def _changed(pencil: Pencil, weights: Any, x: Floats, V: Numbers, along: Ints) -> Numbers:
    """Vᵀ ∂A/∂x V (n, d, r, r) in d variables of A = K or M by its ``weights``; V (n, n_dof, r)."""
    rates = pencil.theta_slopes(x, along)
    moving = np.flatnonzero(np.abs(rates).max(axis=(0, 2), initial=0.0) > 0.0)
    some = weights[:, moving]
    entries = np.flatnonzero(np.diff(some.indptr))
    some, rows, columns = some[entries], pencil.rows[entries], pencil.columns[entries]
    size = len(along), pencil.n_dof, pencil.n_dof
    found = np.zeros((len(x), len(along), V.shape[2], V.shape[2]), dtype=V.dtype)
    every = np.arange(len(x))
    for k in chunks(every, int(np.prod(size))) if pencil.is_dense else every[:, None]:
        values = np.tensordot(rates[:, moving][..., k], some.toarray(), (1, 1))  # (d, p, entries)
        if pencil.is_dense:
            changed = np.zeros((len(k), *size))
            changed[..., rows, columns] = values.swapaxes(0, 1)
            found[k] = np.swapaxes(V[k], 1, 2)[:, None] @ (changed @ V[k][:, None])
            continue
        for d, own in enumerate(values[:, 0]):
            A = sparse.csr_array((own, (rows, columns)), shape=size[1:])
            found[k[0], d] = V[k[0]].T @ (A @ V[k[0]])
    return found


# --- The largest |H| in parts of a range of frequencies

SCAN, ROUNDS, STEP = 5, 4, 3e-4  # frequencies in a part beside peaks; parabolas, relative width


@dataclass(frozen=True, eq=False)
class Shaken:
    """The largest |H| of a node, in parts of a range of frequencies with these ``ends`` (rad/s)."""

    model: Model
    forces: Forces
    ends: Floats
    dampings: tuple[Damping, ...]

    @classmethod
    def of(
        cls, model: Model, node: str, direction: Sequence[float], ends: Floats, finer: bool = False
    ) -> Shaken:
        """Of a model, or of a mesh of twice the elements."""
        model = model.refined() if finer else model
        return cls(model, unit_forces(model, {node: [direction]}), ends, dampings(model))

    def at(self, x: Floats, wanted: NDArray[np.bool_]) -> tuple[Floats, Floats]:
        """|H| (n, m) in m/N at x (n, n_x), of m parts and dampings, slopes (n, m, n_x) in those
        ``wanted``; the frequency of a maximum does not move it.
        """
        values, slopes = [], []
        for damping in self.dampings:
            found = modal_response(self.model, damping, self.forces, x, float(self.ends[-1]))
            omega = self._largest(found)
            H = found.at(omega)
            values.append(np.abs(H))
            turned = (H.conj() / np.maximum(np.abs(H), np.finfo(float).tiny))[..., None]
            slopes.append((turned * found.slopes(omega, wanted)).real)
        return np.concatenate(values, axis=1), np.concatenate(slopes, axis=1)

    def _largest(self, found: ModalResponse) -> Floats:
        """ω (n, m) of the largest |H| in each part: a scan with peaks in it, then vertices of
        parabolas of 1/|H|², which a peak of one mode is. Beside the top slopes are others.
        """
        low, high, every = self.ends[:-1], self.ends[1:], np.arange(len(found.x))[:, None]
        near = found.peaks(low[0], high[-1], (-0.5, 0.0, 0.5))
        scan = np.tile(np.linspace(low, high, SCAN).T.ravel(), (len(near), 1))
        omega = np.sort(np.hstack([scan, near]), axis=1)
        level = _level(found, omega)
        inside = (omega[:, None] >= low[:, None]) & (omega[:, None] <= high[:, None])
        best = np.where(inside, level[:, None], np.inf).argmin(axis=2)
        a, top, c = (omega[every, np.clip(best + k, 0, omega.shape[1] - 1)] for k in (-1, 0, 1))
        a, c = np.maximum(a, low), np.minimum(c, high)
        for _ in range(ROUNDS):
            b, h = top, STEP * top
            f, g, e = (_level(found, b + k * h) for k in (-1, 0, 1))
            bend = f - 2.0 * g + e
            with np.errstate(divide="ignore", invalid="ignore"):
                step = np.where(bend > 0.0, 0.5 * h * (f - e) / bend, np.sign(f - e) * h)
            top = np.clip(b + step, a, c)
            top = np.where(_level(found, top) <= g, top, b)
        return np.asarray(top)


def _level(found: ModalResponse, omega: Floats) -> Floats:
    """1/|H|² (n, m)."""
    return np.asarray(1.0 / np.maximum(np.abs(found.at(omega)), np.finfo(float).tiny) ** 2)
