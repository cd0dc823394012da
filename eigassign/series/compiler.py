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
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.errors import UsageError
from eigassign.series.algebra import Algebra, Function
from eigassign.series.expression import Expression, Node, Recorder, Scalar

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
WAVES: dict[object, str] = {"sine": "wave", "cosine": "wave"}
DENSE_FORMS = 2_000  # entries up to which the matrix of a linear step is kept dense


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
    dependence: NDArray[np.bool_]  # (n_outputs, n_variables): structural

    @cached_property
    def is_implicit(self) -> bool:
        """Whether anything in it solves equations: it may then have no value at all."""
        return any(step.function is not None for step in self.steps)

    @cached_property
    def faces(self) -> NDArray[np.bool_]:
        """(n_faces, n_variables): every atom is a sum of functions of one face's variables each."""
        return faces(self)

    def run(self, algebra: Algebra, variables: Floats) -> Floats:
        """Outputs as rows, from the variables as rows (n_variables, …) of the algebra."""
        values = np.empty((self.n_atoms, variables.shape[1]))
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
    needed = sorted(wanted)
    renumbered = {atom: k for k, atom in enumerate(needed)}
    nodes = [_renumber(recorder.nodes[atom], renumbered) for atom in needed]
    arguments = [_arguments(node) for node in nodes]
    levels: list[int] = []
    for atoms in arguments:
        levels.append(1 + max((levels[a] for a in atoms), default=-1))
    depends = _dependence(nodes, arguments, n_variables)
    variables = [(k, int(str(node[1]))) for k, node in enumerate(nodes) if node[0] == "variable"]
    final = np.array([renumbered[atom] for atom in outputs], dtype=np.intp)
    return Program(
        n_variables=n_variables,
        n_atoms=len(nodes),
        inputs=np.array([k for k, _ in variables], dtype=np.intp),
        input_variables=np.array([v for _, v in variables], dtype=np.intp),
        steps=_schedule(nodes, levels),
        outputs=final,
        dependence=depends[final] if len(final) else np.zeros((0, n_variables), dtype=bool),
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


def _renumber(node: Node, new: dict[int, int]) -> Node:
    match node:
        case ("variable", _):
            return node
        case ("linear", constant, terms):
            return ("linear", constant, tuple((new[a], c) for a, c in terms))  # type: ignore[attr-defined]
        case ("product", int(a), int(b)):
            return ("product", new[a], new[b])
        case ("solve", tuple(left), tuple(right), *rest):
            return ("solve", tuple(new[a] for a in left), tuple(new[a] for a in right), *rest)
        case ("implicit", tuple(arguments), *rest):
            return ("implicit", tuple(new[a] for a in arguments), *rest)
        case (kind, int(a), *rest):
            return (kind, new[a], *rest)
    raise UsageError(f"unknown expression {node!r}")


def _dependence(
    nodes: Sequence[Node], arguments: Sequence[tuple[int, ...]], n_variables: int
) -> NDArray[np.bool_]:
    """Which variables each atom is made of: sets of few members, each a bit of one number."""
    depends: list[int] = []
    for node, atoms in zip(nodes, arguments, strict=True):
        found = 1 << int(str(node[1])) if node[0] == "variable" else 0
        for atom in atoms:
            found |= depends[atom]
        depends.append(found)
    size = (n_variables + 7) // 8
    packed = np.frombuffer(b"".join(d.to_bytes(size, "little") for d in depends), dtype=np.uint8)
    bits = np.unpackbits(packed.reshape(len(nodes), size), axis=1, bitorder="little")
    return bits[:, :n_variables].astype(bool)


def _schedule(nodes: Sequence[Node], levels: Sequence[int]) -> tuple[Instruction, ...]:
    groups: dict[tuple[int, str, int], list[int]] = {}
    systems: dict[Node, int] = {}
    for k, (node, level) in enumerate(zip(nodes, levels, strict=True)):
        if node[0] in ("solve", "implicit"):  # one step for each system of equations
            system = systems.setdefault(node[:-1], len(systems))
            groups.setdefault((level, str(node[0]), system), []).append(k)
        elif node[0] != "variable":
            groups.setdefault((level, WAVES.get(node[0], str(node[0])), -1), []).append(k)
    return tuple(_step(kind, atoms, nodes) for (_, kind, _), atoms in sorted(groups.items()))


def _step(kind: str, atoms: list[int], nodes: Sequence[Node]) -> Instruction:
    targets = np.array(atoms, dtype=np.intp)
    empty = np.zeros(0, dtype=np.intp)
    if kind == "linear":
        return _linear_step(targets, [nodes[k] for k in atoms])
    if kind in ("solve", "implicit"):
        return _system_step(targets, [nodes[k] for k in atoms])
    arguments = np.array([_arguments(nodes[k]) for k in atoms], dtype=np.intp)
    numbers = [float(str(nodes[k][2])) for k in atoms] if kind == "power" else []
    right = arguments[:, 1] if kind == "product" else empty
    if kind == "wave":
        right = np.array([nodes[k][0] == "cosine" for k in atoms], dtype=np.intp)
    return Instruction(kind, targets, arguments[:, 0], right, np.array(numbers), None, empty, None)


def _system_step(targets: Ints, nodes: list[Node]) -> Instruction:
    empty = np.zeros(0, dtype=np.intp)
    components = np.array([int(str(node[-1])) for node in nodes], dtype=np.intp)
    match nodes[0]:
        case ("solve", tuple(left), tuple(right), int(n), _):
            a, b = np.array(left, dtype=np.intp), np.array(right, dtype=np.intp)
            return Instruction("solve", targets, a, b, np.array([float(n)]), None, components, None)
        case ("implicit", tuple(arguments), function, _):
            a = np.array(arguments, dtype=np.intp)
            numbers = np.zeros(0)
            return Instruction("implicit", targets, a, empty, numbers, None, components, function)  # type: ignore[arg-type]
    raise UsageError(f"unknown system {nodes[0]!r}")


def _linear_step(targets: Ints, nodes: list[Node]) -> Instruction:
    rows, columns, values = [], [], []
    for row, (_, _, terms) in enumerate(nodes):
        for atom, value in terms:  # type: ignore[attr-defined]
            rows.append(row)
            columns.append(atom)
            values.append(value)
    sources, local = np.unique(np.array(columns, dtype=np.intp), return_inverse=True)
    shape = (len(nodes), len(sources))
    matrix = sparse.csr_array((values, (rows, local)), shape=shape, dtype=np.float64)
    constants = np.array([float(str(node[1])) for node in nodes])
    sources, empty = sources.astype(np.intp), targets[:0]
    return Instruction("linear", targets, sources, empty, constants, matrix, empty, None)


@dataclass(frozen=True, eq=False)
class CompiledTable:
    """values = constants + weights × program outputs."""

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


# --- Faces of a program

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
    """Those that are within no other."""
    distinct = set(some)
    return frozenset(f for f in distinct if not any(f != g and f & g == f for g in distinct))


def _together(some: Iterable[int]) -> Faces:
    union = 0
    for face in some:
        union |= face
    return frozenset({union})
