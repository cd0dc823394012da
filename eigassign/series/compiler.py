"""Expressions compiled: a straight-line program evaluated level by level, many atoms a call.

The same program runs in two algebras: over samples (values (n_atoms, n_samples)) and over
truncated power series (values (n_atoms, N)), where the product is the Cauchy product. A
:class:`CompiledTable` evaluates a list of scalars, numbers and expressions mixed, by one program.

Power series have few coefficients where few variables meet in one function. A *face* is a set of
variables; every atom of a program is a sum of functions of one face each: a sum has the faces of
all its terms, a product the unions of each face of one factor with each of the other, any other
function one face with all variables.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import prod

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.arrays import Bools, Floats, Ints
from eigassign.errors import UsageError
from eigassign.series.algebra import Algebra, Function, Samples
from eigassign.series.expression import Expression, Node, Recorder, Scalar

WAVES: dict[object, str] = {"sine": "wave", "cosine": "wave"}
# Entries up to which the matrix of a linear step is kept dense: at one sample that saves the 3 µs
# that the call of a sparse product takes; of more entries the products with zeros take as long.
DENSE_FORMS = 2_000


@dataclass(frozen=True, eq=False)
class Instruction:
    """Atoms of one kind and one level: computed together from atoms of lower levels.

    Kinds are "linear", "product", "power", "exponential" and "wave": sines and cosines together.
    """

    kind: str
    targets: Ints
    left: Ints
    right: Ints  # second factors of products; of waves 0 for a sine and 1 for a cosine
    numbers: Floats  # exponents of powers; constants of linear forms
    matrix: sparse.csr_array | None  # of linear forms, over the atoms ``left``
    components: Ints  # which components of a system's solution are wanted
    function: Function | None  # of an implicit step

    @cached_property
    def weights(self) -> sparse.csr_array | Floats:
        """The matrix of linear forms, dense where it is so small that this is quicker."""
        assert self.matrix is not None
        size = self.matrix.shape[0] * self.matrix.shape[1]
        return self.matrix.toarray() if size <= DENSE_FORMS else self.matrix


@dataclass(frozen=True, eq=False)
class Program:
    """Straight-line program from variables (n_variables,) to outputs (n_outputs,)."""

    n_variables: int
    n_atoms: int
    inputs: Ints  # atom of each used variable
    input_variables: Ints  # which variable it is
    steps: tuple[Instruction, ...]
    outputs: Ints  # atom of each output
    dependence: Bools  # (n_outputs, n_variables): structural

    @cached_property
    def is_implicit(self) -> bool:
        """True where a step solves equations: the program may then have no value at all."""
        return any(step.function is not None for step in self.steps)

    @cached_property
    def faces(self) -> Bools:
        """(n_faces, n_variables): every atom is a sum of functions of one face's variables each."""
        return faces(self)

    def is_affine(self, variables: Bools) -> bool:
        """True where no output is of a degree above 1 in these ``variables`` (n_variables,)."""
        degree = np.zeros(self.n_atoms)
        degree[self.inputs] = variables[self.input_variables]
        for step in self.steps:
            a = degree[step.left]
            if step.kind == "product":
                found = a + degree[step.right]
            elif step.matrix is not None:
                found, (rows, columns) = np.zeros(len(step.targets)), step.matrix.nonzero()
                np.maximum.at(found, rows, a[columns])
            elif step.kind == "power":
                whole = (step.numbers >= 0.0) & (step.numbers == np.round(step.numbers))
                found = np.where(a == 0.0, 0.0, np.where(whole, step.numbers * a, np.inf))
            else:
                met = a.any() or (step.kind == "solve" and degree[step.right].any())
                found = np.full(len(step.targets), np.inf if met else 0.0)
            degree[step.targets] = found
        return bool(degree[self.outputs].max(initial=0.0) <= 1.0)

    def run(self, algebra: Algebra, variables: Floats) -> Floats:
        """Outputs as rows, from the variables as rows (n_variables, …) of the algebra.

        Of samples and their tangents they may be complex: for rates along the imaginary axis.
        """
        values = np.empty((self.n_atoms, variables.shape[1]), np.result_type(variables, 1.0))
        values[self.inputs] = variables[self.input_variables]
        for step in self.steps:
            values[step.targets] = _take(step, algebra, values)
        return np.asarray(values[self.outputs])


def _take(step: Instruction, algebra: Algebra, values: Floats) -> Floats:
    a = values.take(step.left, axis=0)
    if step.kind == "product":
        return algebra.product(a, values.take(step.right, axis=0))
    if step.kind == "linear":
        return algebra.linear(step.weights, step.numbers, a)
    if step.kind == "power":
        return algebra.power(a, step.numbers)
    if step.kind == "solve":
        right = values.take(step.right, axis=0)
        return algebra.solve(a, right, int(step.numbers[0]))[step.components]
    if step.kind == "exponential":
        return algebra.exponential(a)
    if step.function is not None:
        return step.function.evaluate(algebra, a)[step.components]
    return algebra.wave(a, step.right)


def compile_program(recorder: Recorder, outputs: Sequence[int], n_variables: int) -> Program:
    """Schedule what the output atoms need; raises UsageError for an unknown variable."""
    wanted = set(outputs)
    for atom in range(len(recorder.nodes) - 1, -1, -1):
        if atom in wanted:
            wanted.update(_arguments(recorder.nodes[atom]))
    nodes = {atom: recorder.nodes[atom] for atom in sorted(wanted)}
    place = np.zeros(len(recorder.nodes), dtype=np.intp)
    place[list(nodes)] = np.arange(len(nodes))
    variables = [(atom, int(str(node[1]))) for atom, node in nodes.items() if node[0] == "variable"]
    final = place[list(outputs)]
    return Program(
        n_variables=n_variables,
        n_atoms=len(nodes),
        inputs=place[[atom for atom, _ in variables]],
        input_variables=np.array([v for _, v in variables], dtype=np.intp),
        steps=_schedule(nodes, place),
        outputs=final,
        dependence=_dependence(nodes, n_variables)[final],
    )


def _arguments(node: Node) -> tuple[int, ...]:
    match node:
        case ("variable", _):
            return ()
        case ("linear", _, terms):
            return tuple(int(atom) for atom, _ in terms)  # type: ignore[attr-defined]
        case ("product", int(a), int(b)):
            return (a, b)
        case ("solve", tuple(left), tuple(right), *_):
            return left + right
        case ("implicit", tuple(arguments), *_):
            return arguments
        case (_, int(a), *_):
            return (a,)
    raise UsageError(f"unknown expression {node!r}")


def _dependence(nodes: Mapping[int, Node], n_variables: int) -> Bools:
    """Variables that each atom is made of: sets of few members, each a bit of one number."""
    depends: dict[int, int] = {}
    for atom, node in nodes.items():
        found = 1 << int(str(node[1])) if node[0] == "variable" else 0
        for argument in _arguments(node):
            found |= depends[argument]
        depends[atom] = found
    return _bits(list(depends.values()), n_variables)


def _bits(sets: Sequence[int], n: int) -> Bools:
    """(n_sets, n): the members of sets whose bit k stands for variable k."""
    size = (n + 7) // 8
    packed = np.frombuffer(b"".join(s.to_bytes(size, "little") for s in sets), dtype=np.uint8)
    bits = np.unpackbits(packed.reshape(len(sets), size), axis=1, bitorder="little")
    return bits[:, :n].astype(bool)


def _schedule(nodes: Mapping[int, Node], place: Ints) -> tuple[Instruction, ...]:
    levels: dict[int, int] = {}
    groups: dict[tuple[int, str, int], list[int]] = {}
    systems: dict[Node, int] = {}
    for atom, node in nodes.items():
        level = levels[atom] = 1 + max((levels[a] for a in _arguments(node)), default=-1)
        if node[0] in ("solve", "implicit"):  # one step for each system of equations
            system = systems.setdefault(node[:-1], len(systems))
            groups.setdefault((level, str(node[0]), system), []).append(atom)
        elif node[0] != "variable":
            groups.setdefault((level, WAVES.get(node[0], str(node[0])), -1), []).append(atom)
    return tuple(
        _instruction(kind, place[atoms], [nodes[atom] for atom in atoms], place)
        for (_, kind, _), atoms in sorted(groups.items())
    )


def _instruction(kind: str, targets: Ints, nodes: list[Node], place: Ints) -> Instruction:
    empty = np.zeros(0, dtype=np.intp)
    if kind == "linear":
        return _linear_forms(targets, nodes, place)
    if kind in ("solve", "implicit"):
        return _system(targets, nodes, place)
    arguments = place[[_arguments(node) for node in nodes]]
    numbers = [float(str(node[2])) for node in nodes] if kind == "power" else []
    right = arguments[:, 1] if kind == "product" else empty
    if kind == "wave":
        right = np.array([node[0] == "cosine" for node in nodes], dtype=np.intp)
    return Instruction(kind, targets, arguments[:, 0], right, np.array(numbers), None, empty, None)


def _system(targets: Ints, nodes: list[Node], place: Ints) -> Instruction:
    components = np.array([int(str(node[-1])) for node in nodes], dtype=np.intp)
    match nodes[0]:
        case ("solve", tuple(left), tuple(right), int(n), _):
            a, b, numbers = place[list(left)], place[list(right)], np.array([float(n)])
            return Instruction("solve", targets, a, b, numbers, None, components, None)
        case ("implicit", tuple(arguments), function, _):
            a, b, numbers = place[list(arguments)], targets[:0], np.zeros(0)
            return Instruction("implicit", targets, a, b, numbers, None, components, function)  # type: ignore[arg-type]
    raise UsageError(f"unknown system {nodes[0]!r}")


def _linear_forms(targets: Ints, nodes: list[Node], place: Ints) -> Instruction:
    rows, columns, values = [], [], []
    for row, (_, _, terms) in enumerate(nodes):
        for atom, value in terms:  # type: ignore[attr-defined]
            rows.append(row)
            columns.append(atom)
            values.append(value)
    sources, local = np.unique(place[columns], return_inverse=True)
    shape = (len(nodes), len(sources))
    matrix = sparse.csr_array((values, (rows, local)), shape=shape, dtype=np.float64)
    constants = np.array([float(str(node[1])) for node in nodes])
    empty = targets[:0]
    return Instruction("linear", targets, sources, empty, constants, matrix, empty, None)


@dataclass(frozen=True, eq=False)
class CompiledTable:
    """Scalars by one program: values = constants + weights × program outputs."""

    program: Program
    constants: Floats  # (n,)
    weights: sparse.csr_array  # (n, n_outputs)

    def evaluate(self, algebra: Algebra, variables: Floats) -> Floats:
        """The scalars as rows of the algebra, (n, …)."""
        return np.asarray(
            self.weights @ self.program.run(algebra, variables) + algebra.constant(self.constants)
        )


def compile_table(recorder: Recorder, scalars: Sequence[Scalar], n_variables: int) -> CompiledTable:
    """Compile scalars over the variables of one recorder."""
    forms = [s.terms if isinstance(s, Expression) else {} for s in scalars]
    atoms = sorted({atom for form in forms for atom in form})
    at = {atom: k for k, atom in enumerate(atoms)}
    entries = [(row, at[a], c) for row, form in enumerate(forms) for a, c in form.items()]
    rows, columns, values = zip(*entries, strict=True) if entries else ((), (), ())
    return CompiledTable(
        compile_program(recorder, atoms, n_variables),
        np.array([s.constant if isinstance(s, Expression) else float(s) for s in scalars]),
        sparse.csr_array(
            (np.array(values, dtype=np.float64), (np.array(rows, int), np.array(columns, int))),
            shape=(len(scalars), len(atoms)),
        ),
    )


@dataclass(frozen=True, eq=False)
class CompiledArrays:
    """Arrays of scalars by one program, evaluated on many samples together."""

    table: CompiledTable
    shapes: tuple[tuple[int, ...], ...]

    def __call__(self, variables: Floats, algebra: Algebra | None = None) -> list[Floats]:
        """The values (n, *shape) of each array at variables (n_variables, n), rows of the algebra.

        That is of plain samples unless another one is given.
        """
        values = self.table.evaluate(algebra or Samples(), variables).T
        cuts = np.cumsum([prod(shape) for shape in self.shapes])[:-1]
        parts = zip(np.split(values, cuts, axis=1), self.shapes, strict=True)
        return [part.reshape(len(values), *shape) for part, shape in parts]


def compile_arrays(
    recorder: Recorder, arrays: Sequence[NDArray[np.object_]], n_variables: int
) -> CompiledArrays:
    """Compile arrays of scalars over the variables of one recorder."""
    scalars = [scalar for array in arrays for scalar in array.ravel()]
    table = compile_table(recorder, scalars, n_variables)
    return CompiledArrays(table, tuple(array.shape for array in arrays))


# --- Faces of a program

MOST = 16  # faces of an atom, since a product compares all pairs of them; more are taken together
Faces = frozenset[int]  # bit k of a face is variable k


def faces(program: Program) -> Bools:
    """(n_faces, n_variables), those within another left out."""
    found: list[Faces] = [frozenset({0})] * program.n_atoms
    for atom, variable in zip(program.inputs, program.input_variables, strict=True):
        found[atom] = frozenset({1 << int(variable)})
    for step in program.steps:
        for atom, there in zip(step.targets, _of_step(step, found), strict=True):
            found[atom] = there
    every = sorted(_largest(face for atom in set(found) for face in atom))
    return _bits(every, program.n_variables)


def _of_step(step: Instruction, found: list[Faces]) -> list[Faces]:
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
    """Faces that are within no other."""
    distinct = set(some)
    return frozenset(f for f in distinct if not any(f != g and f & g == f for g in distinct))


def _together(some: Iterable[int]) -> Faces:
    union = 0
    for face in some:
        union |= face
    return frozenset({union})
