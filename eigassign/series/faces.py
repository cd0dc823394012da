"""Which variables meet in one function: a power series has no coefficients in others.

A face is a set of variables. Every atom of a program is a sum of functions of one face each: a sum
has the faces of all its terms, a product the unions of each face of one factor with each of the
other, any other function one face with all variables.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from eigassign.series.program import Program, Step

MOST = 16  # faces that an atom may have; more are taken together
Faces = frozenset[int]  # bit k of a face is variable k


def faces(program: Program) -> NDArray[np.bool_]:
    """(n_faces, n_variables), those within another left out."""
    found: list[Faces] = [frozenset({0})] * program.n_atoms
    for atom, variable in zip(program.inputs, program.input_variables, strict=True):
        found[atom] = frozenset({1 << int(variable)})
    for step in program.steps:
        for atom, there in zip(step.targets, _of_step(step, found), strict=True):
            found[atom] = there
    every = sorted(_largest(face for atom in set(found) for face in atom))
    bits = [[bool(face >> k & 1) for k in range(program.n_variables)] for face in every]
    return np.array(bits, dtype=bool).reshape(len(every), program.n_variables)


def _of_step(step: Step, found: list[Faces]) -> list[Faces]:
    """The faces of each of the step's atoms."""
    if step.kind == "product":
        pairs = zip(step.left, step.right, strict=True)
        return [_few(f | g for f in found[a] for g in found[b]) for a, b in pairs]
    if step.kind == "linear":
        assert step.matrix is not None
        ends, columns = step.matrix.indptr, step.matrix.indices
        terms = [step.left[columns[i:j]] for i, j in itertools.pairwise(ends)]
        return [_few(face for atom in atoms for face in found[atom]) for atoms in terms]
    if step.kind in ("solve", "implicit"):
        arguments = [*step.left, *step.right]
        return [_together(f for a in arguments for f in found[a])] * len(step.targets)
    return [_together(found[a]) for a in step.left]


def _few(some: Iterable[int]) -> Faces:
    """The largest of some faces, or one with all their variables where these are too many."""
    kept = _largest(some)
    return kept if len(kept) <= MOST else _together(kept)


def _largest(some: Iterable[int]) -> Faces:
    """Those that are within no other."""
    distinct = set(some)
    return frozenset(f for f in distinct if not any(f != g and f & g == f for g in distinct))


def _together(some: Iterable[int]) -> Faces:
    union = 0
    for face in some:
        union |= face
    return frozenset({union})
