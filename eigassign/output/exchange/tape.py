"""A reduced model as flat arrays, from which any program can evaluate it.

The functions θ(q, y) of K̂ = Σ θ_j K̂_j and M̂ = Σ θ_j M̂_j are lists of elementary operations over a
growing row of values: a function's arguments, then what each operation appends. Function 0 takes
z = ``to_program`` (q, y) + ``shift``; the others are the equations of closed loops.

    operation                 its atoms (places of values)     its number   appends
    0 linear                  those of its terms               constant     number + Σ weight value
    1 product                 two                              -            their product
    2 power                   one                              exponent     value^exponent
    3 sine, 4 cosine, 5 exp   one                              -            sin, cos, exp
    6 solve                   A (n, n), B (n, m), row by row   n            X of A X = B, row by row
    7 close                   the arguments a of a loop        function     p of F(p, a) = 0
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import UsageError
from eigassign.modal.reduced.model import ReducedModel
from eigassign.series.compiler import Instruction, Program
from eigassign.series.implicit import ImplicitFunction

Array = NDArray[Any]
LINEAR, PRODUCT, POWER, SINE, COSINE, EXPONENTIAL, SOLVE, CLOSE = range(8)
ROUND_OFF = 1e-9  # of a limit of q or y, by which digits may be lost on the way to a reader
_ONE = {"power": POWER, "exponential": EXPONENTIAL}


ANYWHERE = 1e300  # stands for no limit: a number that every language can write


def reduced_tape(reduced: ReducedModel, within: Array | None = None) -> dict[str, Array]:
    """Everything that frequencies follow from, as int64 and float64 arrays by name.

    ``within`` (n, n_x) are the samples (q, y) that the model was judged at: readers refuse what is
    not between the ``lower`` and ``upper`` ends of these.
    ``stiffness`` (n_terms, k (k + 1)/2) and ``mass`` are lower triangles row by row; their terms
    belong to ``stiffness_terms`` and ``mass_terms`` of θ, of which θ_0 = 1.
    """
    tape = _Tape()
    tape.function(reduced.program)
    k, total = reduced.size, reduced.mass.shape[1]
    n_x = reduced.n_q + reduced.n_y
    ends = np.array([np.full(n_x, -ANYWHERE), np.full(n_x, ANYWHERE)])
    if within is not None:
        ends = np.array([within.min(axis=0), within.max(axis=0)])
        ends += [[-ROUND_OFF], [ROUND_OFF]] * np.maximum(*np.abs(ends))
    rows, columns = np.tril_indices(k), np.tril_indices(total)
    return {
        "n_q": _integers([reduced.n_q]),
        "n_y": _integers([reduced.n_y]),
        "modes": _integers(reduced.modes),
        "size": _integers([k]),
        "rigid": _integers([total - k]),
        "points": reduced.points,
        "lower": ends[0],
        "upper": ends[1],
        "to_program": reduced.to_program,
        "shift": reduced.shift,
        "stiffness_terms": _integers(reduced.stiffness_terms),
        "stiffness": reduced.stiffness[:, rows[0], rows[1]],
        "mass_terms": _integers(reduced.mass_terms),
        "mass": reduced.mass[:, columns[0], columns[1]],
        **tape.arrays(),
    }


def _integers(values: Any) -> NDArray[np.int64]:
    return np.asarray(values, dtype=np.int64).reshape(-1)


@dataclass
class _Tape:
    """The functions so far, each as its own lists; see the names in `arrays`."""

    kinds: list[int] = field(default_factory=list)
    numbers: list[float] = field(default_factory=list)
    first_atom: list[int] = field(default_factory=lambda: [0])
    atoms: list[int] = field(default_factory=list)
    weights: list[float] = field(default_factory=list)
    functions: list[tuple[list[int], list[int], list[float]]] = field(default_factory=list)

    def function(self, program: Program, closed: ImplicitFunction | None = None) -> int:
        """Append a program, those that it calls before it; its number, 0 of the first."""
        number = len(self.functions)
        self.functions.append(([], [], []))
        inner = {}
        for called in (step.function for step in program.steps if step.function is not None):
            if not isinstance(called, ImplicitFunction):
                raise UsageError(f"a {type(called).__name__} cannot be exported")
            inner[id(called)] = self.function(called.program, called)
        begin, place = len(self.kinds), {}
        for atom, variable in zip(program.inputs, program.input_variables, strict=True):
            place[int(atom)] = int(variable)
        count = program.n_variables
        for step in program.steps:
            count = self._step(step, place, count, inner)
        sizes = [0, 0, 0]
        known: list[float] = []
        if closed is not None:
            sizes = [closed.size, closed.n_equations, closed.n_checks]
            known = [*closed.a0.tolist(), *closed.p0.tolist()]
        about = [begin, len(self.kinds), program.n_variables, count, *sizes]
        self.functions[number] = (about, [place[int(a)] for a in program.outputs], known)
        return number

    def _step(
        self, step: Instruction, place: dict[int, int], count: int, inner: dict[int, int]
    ) -> int:
        """Append the operations of a step; the number of values after it."""
        left = [place[int(a)] for a in step.left]
        if step.kind in ("solve", "implicit"):
            if step.function is not None:
                self._operation(CLOSE, left, number=inner[id(step.function)])
                size = step.function.size
            else:
                right = [place[int(a)] for a in step.right]
                self._operation(SOLVE, left + right, number=step.numbers[0])
                size = len(right)
            for target, component in zip(step.targets, step.components, strict=True):
                place[int(target)] = count + int(component)
            return count + size
        for k, target in enumerate(step.targets):
            if step.kind == "linear":
                assert step.matrix is not None
                row = slice(step.matrix.indptr[k], step.matrix.indptr[k + 1])
                atoms = [left[c] for c in step.matrix.indices[row]]
                weights = step.matrix.data[row].tolist()
                self._operation(LINEAR, atoms, weights, step.numbers[k])
            elif step.kind == "product":
                self._operation(PRODUCT, [left[k], place[int(step.right[k])]])
            elif step.kind == "wave":
                self._operation(COSINE if step.right[k] else SINE, [left[k]])
            else:
                exponent = step.numbers[k] if step.kind == "power" else 0.0
                self._operation(_ONE[step.kind], [left[k]], number=exponent)
            place[int(target)] = count
            count += 1
        return count

    def _operation(
        self, kind: int, atoms: list[int], weights: list[float] | None = None, number: float = 0.0
    ) -> None:
        self.kinds.append(kind)
        self.numbers.append(float(number))
        self.atoms += atoms
        self.weights += weights or [0.0] * len(atoms)
        self.first_atom.append(len(self.atoms))

    def arrays(self) -> dict[str, Array]:
        """The lists as arrays.

        ``functions`` (n, 7): first and last operation, numbers of arguments and of values, and of
        a loop the numbers of unknowns p, equations F and check rows. ``outputs`` and ``known``
        (a_0, p_0 of a loop) of function f begin at ``first_output``[f] and ``first_known``[f].
        """
        abouts, outputs, known = zip(*self.functions, strict=True)
        ends = [np.cumsum([0, *map(len, each)]) for each in (outputs, known)]
        return {
            "kinds": _integers(self.kinds),
            "numbers": np.array(self.numbers),
            "first_atom": _integers(self.first_atom),
            "atoms": _integers(self.atoms),
            "weights": np.array(self.weights),
            "functions": np.array(abouts, dtype=np.int64),
            "first_output": _integers(ends[0]),
            "outputs": _integers([a for each in outputs for a in each]),
            "first_known": _integers(ends[1]),
            "known": np.array([a for each in known for a in each], dtype=np.float64),
        }
