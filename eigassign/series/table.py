"""A list of scalars, numbers and expressions mixed, compiled so that it is evaluated in one go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.series.algebra import Algebra
from eigassign.series.expression import Expression, Recorder, Scalar
from eigassign.series.program import Program, compile_program

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Table:
    """values = constants + weights × program outputs."""

    program: Program
    constants: Floats  # (n,)
    weights: sparse.csr_array  # (n, n_outputs)

    def evaluate(self, algebra: Algebra, variables: Floats) -> Floats:
        """The scalars as rows of the algebra, (n, …)."""
        return np.asarray(
            self.weights @ self.program.run(algebra, variables) + algebra.constant(self.constants)
        )


def compile_table(recorder: Recorder, scalars: Sequence[Scalar], n_variables: int) -> Table:
    """Compile scalars over the variables of one recorder."""
    forms = [s.terms if isinstance(s, Expression) else {} for s in scalars]
    atoms = sorted({atom for form in forms for atom in form})
    at = {atom: k for k, atom in enumerate(atoms)}
    entries = [(row, at[a], c) for row, form in enumerate(forms) for a, c in form.items()]
    rows, columns, values = zip(*entries, strict=True) if entries else ((), (), ())
    return Table(
        compile_program(recorder, atoms, n_variables),
        np.array([s.constant if isinstance(s, Expression) else float(s) for s in scalars]),
        sparse.csr_array(
            (np.array(values, dtype=np.float64), (np.array(rows, int), np.array(columns, int))),
            shape=(len(scalars), len(atoms)),
        ),
    )
