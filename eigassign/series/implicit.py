"""Implicit functions p(a) defined by F(p, a) = 0: on samples by continuation, on series by Newton.

The solution followed is the one through a known pair (a_0, p_0), never another branch: samples are
reached from a_0 in small steps, and a passage through a singular ∂F/∂p is refused.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from eigassign.arrays import Bools, Floats
from eigassign.errors import SingularityError
from eigassign.series.algebra import Algebra, Samples, Tangents, Truncated
from eigassign.series.compiler import Program

STEP = 0.15  # rad or m: a continuation step; where it is too long, REFINEMENTS divide it
FARTHEST = 500.0  # rad or m from the known solution: 80 turns
REFINEMENTS = (1, 4, 16, 64)  # of the steps, where ∂F/∂p changes too much for one
MOST_STEPS = 5000  # of a refinement: some seconds
TOLERANCE = 1e-13  # on Newton's step, relative to 1 (rad or m)
# Solutions remembered for slopes: those of K and M and of static forces ask for the same; so loops
# are searched up to 2.5 times as fast. Values alone are sought anew: they are what charts time.
KEPT = 4
ON_THE_WAY = 1e-6  # the same where p is only the start of the next step: what is left is its square
CONVERGED = 1e-8  # last step of a regular solution; at a dead point Newton only creeps
ACCEPT = 1e-9  # on F and on the check rows afterwards
SINGULAR = 1e-5  # smallest over largest singular value of ∂F/∂p that is refused


class _Reached(NamedTuple):
    """p (size, n), whether it is regular, ∂F/∂p (n, n_equations, size) and its least σ (n,)."""

    p: Floats
    regular: Bools
    J: Floats
    smallest: Floats


@dataclass(frozen=True, eq=False)
class ImplicitFunction:
    """p (size,) of arguments a (n_arguments,); ``program`` maps (a, p) to rows F, check, ∂F/∂p.

    F has ``n_equations`` ≥ size rows (consistent if more), ``check`` rows must vanish too, and
    ∂F/∂p follows row by row. ``a0``, ``p0`` is a known solution, ``names`` those of the arguments.
    """

    program: Program
    size: int
    n_equations: int
    n_checks: int
    a0: Floats
    p0: Floats
    names: tuple[str, ...]
    title: str
    # arguments in words, plain numbers without; changes no number, and no key of the cache
    shown: Callable[[Floats], str] | None = field(default=None, compare=False)

    @cached_property
    def found(self) -> dict[tuple[int, bytes], Floats]:
        """The last `KEPT` solutions, by their arguments; nothing that is stored with the rest."""
        return {}

    def samples(self, a: Floats) -> Floats:
        """p (size, n_samples) at a (n_arguments, n_samples).

        Raises SingularityError naming the first sample where the equations are singular or have no
        solution on this branch.
        """
        farthest = float(np.abs(a - self.a0[:, None]).max(initial=0.0))
        if not farthest < FARTHEST:
            worst = np.abs(a - self.a0[:, None]).max(axis=0)
            at = self._named(a[:, int(np.nanargmax(worst))])
            raise SingularityError(f"{self.title} cannot be followed as far as {at}")
        steps = int(np.ceil(farthest / STEP)) or 1
        p = np.empty((self.size, a.shape[1]))
        left = np.arange(a.shape[1])
        worth = [r for r in REFINEMENTS if r == 1 or r * steps <= MOST_STEPS]
        for refinement in worth:
            found, ok, reached = self._continue(a[:, left], steps * refinement)
            p[:, left[ok]] = found[:, ok]
            left, reached = left[~ok], reached[:, ~ok]
            if not len(left):
                for old in list(self.found)[: 1 - KEPT]:
                    self.found.pop(old, None)
                p.setflags(write=False)
                self.found[a.shape[1], a.tobytes()] = p
                return p
        asked, met = a[:, left[0]], reached[:, 0]
        message = f"{self.title} cannot be closed, or is at a dead point, at {self._named(met)}"
        if not np.array_equal(asked, met):
            message += f" on the way to {self._named(asked)}"
        raise SingularityError(message)

    def _continue(self, a: Floats, steps: int) -> tuple[Floats, Bools, Floats]:
        """p after ``steps`` equal steps from a_0, where no step could have changed the branch, and
        how far each sample got.

        ∂F/∂p is regular from one step to the next if it changes by less than its smallest
        singular value: then no other branch has been met.
        """
        p = np.repeat(self.p0[:, None], a.shape[1], axis=1)
        ok = np.ones(a.shape[1], dtype=bool)
        start, reached = self.a0[:, None], a.copy()
        before = self.equations(start, self.p0[:, None])[2]
        smallest = np.linalg.svd(before, compute_uv=False)[:, -1]
        for t in np.linspace(0.0, 1.0, steps + 1)[1:]:
            here = start + t * (a - start)
            made = self._newton(here, p, TOLERANCE if t == 1.0 else ON_THE_WAY, _solved)
            good = made.regular & (np.linalg.norm(made.J - before, axis=(1, 2)) < smallest)
            reached = np.where(ok & ~good, here, reached)
            ok &= good
            p, before, smallest = made.p, made.J, made.smallest
            if not ok.any():
                return p, ok, reached
        F, check, _ = self.equations(a, p)
        missed = np.abs(np.concatenate([F, check])).max(axis=0, initial=0.0)
        return p, ok & (missed < ACCEPT), reached

    def newton(self, a: Floats, p: Floats) -> tuple[Floats, Bools]:
        """Newton from any p at fixed a; whether each sample is regular there."""
        made = self._newton(a, p, TOLERANCE, _least)
        return made.p, made.regular

    def _newton(
        self, a: Floats, p: Floats, tolerance: float, solve: Callable[[Floats, Floats], Floats]
    ) -> _Reached:
        """Newton's steps ``solve`` (J, F) until they are below ``tolerance``."""
        for _ in range(12):
            F, _, J = self.equations(a, p)
            if not np.isfinite(J).all():
                nowhere = np.zeros(len(J))
                return _Reached(p, nowhere > 0.0, J, nowhere)
            step = -solve(J, F.T[:, :, None])[:, :, 0].T
            p = p + np.clip(step, -0.5, 0.5)
            if np.abs(step).max(initial=0.0) < tolerance:
                break
        s = np.asarray(np.linalg.svd(J, compute_uv=False), dtype=np.float64)
        converged = np.abs(step).max(axis=0, initial=0.0) < max(tolerance, CONVERGED)
        return _Reached(p, converged & (s[:, -1] > SINGULAR * s[:, 0]), J, s[:, -1])

    def equations(self, a: Floats, p: Floats) -> tuple[Floats, Floats, Floats]:
        """F (n_equations, n), check (n_checks, n), ∂F/∂p (n, n_equations, size)."""
        rows = self.program.run(Samples(), np.concatenate([a, p]))
        m, c = self.n_equations, self.n_checks
        J = rows[m + c :].T.reshape(-1, m, self.size)
        return rows[:m], rows[m : m + c], J

    def series(self, algebra: Truncated, a: Floats) -> Floats:
        """p (size, N) as power series: each chord step gains one degree."""
        p0 = self.samples(a[:, :1])
        _, _, J = self.equations(a[:, :1], p0)
        inverse = np.linalg.pinv(J[0])
        p = algebra.constant(p0[:, 0])
        for _ in range(algebra.space.order + 1):
            F = self.program.run(algebra, np.concatenate([a, p]))[: self.n_equations]
            F[:, 0] = 0.0  # solved already, to round-off
            p = p - inverse @ F
        return p

    def tangents(self, algebra: Tangents, a: Floats) -> Floats:
        """p (size, …) with its derivatives −(∂F/∂p)⁺ ∂F/∂a a'."""
        n = algebra.samples
        at = a[:, :n].real
        p = self.found.get((n, at.tobytes()))
        p = self.samples(at) if p is None else p
        if np.iscomplexobj(a):  # a rate along the imaginary axis: one step has it exactly
            F, _, J = self.equations(a[:, :n], p)
            p = p - 1j * _solved(J.real, F.imag.T[:, :, None])[:, :, 0].T
        still = np.zeros((self.size, a.shape[1] - n))
        held = np.concatenate([a, np.hstack([p, still])])
        F = self.program.run(algebra, held)[: self.n_equations]
        J = self.equations(a[:, :n], p)[2]
        moved = F[:, n:].reshape(self.n_equations, -1, n).transpose(2, 0, 1)
        slopes = -_solved(J, moved).transpose(1, 2, 0)
        return np.hstack([p, slopes.reshape(self.size, -1)])

    def evaluate(self, algebra: Algebra, a: Floats) -> Floats:
        """The solution p in any algebra."""
        if isinstance(algebra, Truncated):
            return self.series(algebra, a)
        if isinstance(algebra, Tangents):
            return self.tangents(algebra, a)
        return self.samples(a)

    def _named(self, a: Floats) -> str:
        if self.shown is not None:
            return self.shown(a)
        return ", ".join(f"{n} = {v:.6g}" for n, v in zip(self.names, a, strict=True))


def _least(J: Floats, F: Floats) -> Floats:
    """x of least ‖J x − F‖ and least length, sample by sample, whatever J is."""
    return np.asarray(np.linalg.pinv(J) @ F)


def _solved(J: Floats, F: Floats) -> Floats:
    """The solution near a regular J, without its singular values."""
    turned = np.swapaxes(J, 1, 2)
    try:
        if J.shape[1] == J.shape[2]:
            return np.asarray(np.linalg.solve(J, F))
        return np.asarray(np.linalg.solve(turned @ J, turned @ F))
    except np.linalg.LinAlgError:
        return _least(J, F)
