"""Scalar expressions written once and evaluated on numbers, on samples and on power series alike.

An :class:`Expression` is a linear form  c + Σ c_k a_k  in *atoms* a_k: variables, products, powers,
sines, cosines and exponentials, each stored once by the :class:`Recorder` however often it is
written. Plain floats mix freely with expressions, and what is constant folds away as it is written,
so that code for a formula reads the same whether its inputs vary or not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from eigassign.errors import UsageError
from eigassign.series.algebra import Function

if TYPE_CHECKING:
    from typing_extensions import TypeIs

Scalar: TypeAlias = "float | Expression"
Node: TypeAlias = tuple[object, ...]


class Recorder:
    """Collects the atoms of a set of expressions; ``nodes[k]`` is the definition of atom k.

    ``("variable", i)``, ``("linear", c, ((k, c_k), ...))``, ``("product", j, k)``,
    ``("power", j, e)``, ``("sine", j)``, ``("cosine", j)``, ``("exponential", j)``; entry i of the
    solution of A X = B is ``("solve", atoms of A, atoms of B, n, i)``, component i of an implicit
    function of its arguments ``("implicit", atoms, function, i)``. Arguments come before their
    users.
    """

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self._known: dict[Node, int] = {}

    def solve(
        self, A: Sequence[Sequence[Scalar]], B: Sequence[Sequence[Scalar]]
    ) -> list[list[Expression]]:
        """X (n, m) of A X = B for square A (n, n) and B (n, m)."""
        n, m = len(A), len(B[0])
        left = tuple(self.atom(entry) for row in A for entry in row)
        right = tuple(self.atom(entry) for row in B for entry in row)
        return [
            [self._atom(("solve", left, right, n, i * m + j)) for j in range(m)] for i in range(n)
        ]

    def implicit(self, function: Function, arguments: Sequence[Scalar]) -> list[Expression]:
        """The components of an implicit function of ``arguments``."""
        atoms = tuple(self.atom(a) for a in arguments)
        return [self._atom(("implicit", atoms, function, i)) for i in range(function.size)]

    def atom(self, x: Scalar) -> int:
        """A scalar as one atom of factor 1, a number as a constant atom."""
        if not isinstance(x, Expression):
            return next(iter(self._atom(("linear", float(x), ())).terms))
        factor, atom = x.single()
        return atom if factor == 1.0 else x._recorded().single()[1]

    def function(self, atom: int) -> Scalar:
        """One of the atoms that `parts` names, by itself."""
        return Expression(self, 0.0, {atom: 1.0}) if atom >= 0 else 1.0

    def variable(self, index: int) -> Expression:
        """The independent variable number ``index``."""
        return self._atom(("variable", index))

    def _atom(self, node: Node) -> Expression:
        at = self._known.get(node)
        if at is None:
            at = self._known[node] = len(self.nodes)
            self.nodes.append(node)
        return Expression(self, 0.0, {at: 1.0})


class Expression:
    """c + Σ c_k a_k over the atoms of one recorder; immutable."""

    __slots__ = ("constant", "recorder", "terms")
    __array_ufunc__ = None  # so that numpy scalars leave arithmetic to this class

    def __init__(self, recorder: Recorder, constant: float, terms: dict[int, float]) -> None:
        self.recorder = recorder
        self.constant = constant
        self.terms = terms

    def single(self) -> tuple[float, int]:
        """Factor and atom whose product it is; a sum is recorded as a linear form first."""
        if self.constant == 0.0 and len(self.terms) == 1:
            ((atom, factor),) = self.terms.items()
            return factor, atom
        ordered = sorted(self.terms.items())
        # proportional sums are one atom; by the largest, for others may be nothing but round-off
        factor = max((self.constant, *(value for _, value in ordered)), key=abs)
        scaled = tuple((atom, value / factor) for atom, value in ordered)
        node = self.recorder._atom(("linear", self.constant / factor, scaled))
        return factor, next(iter(node.terms))

    def __add__(self, other: Scalar) -> Scalar:
        if not isinstance(other, Expression):
            if other == 0.0:
                return self
            return Expression(self.recorder, self.constant + other, self.terms)
        terms = dict(self.terms)
        for atom, value in other.terms.items():
            total = terms.get(atom, 0.0) + value
            if total:
                terms[atom] = total
            else:
                terms.pop(atom, None)
        return self._build(self.constant + other.constant, terms)

    __radd__ = __add__

    def __neg__(self) -> Scalar:
        return self * -1.0

    def __sub__(self, other: Scalar) -> Scalar:
        return self + other * -1.0

    def __rsub__(self, other: float) -> Scalar:
        return self * -1.0 + other

    def __mul__(self, other: Scalar) -> Scalar:
        if not isinstance(other, Expression):
            factor = float(other)
            if factor == 1.0:
                return self
            terms = {a: value for a, c in self.terms.items() if (value := c * factor)}
            return self._build(self.constant * factor, terms)
        (a, j), (b, k) = self.single(), other.single()
        product = self.recorder._atom(("product", min(j, k), max(j, k)))
        return product * (a * b)

    __rmul__ = __mul__

    def __pow__(self, exponent: float) -> Scalar:
        if exponent == 1.0:
            return self
        if exponent == 2.0:
            return self * self
        if exponent == 3.0:
            return self * (self * self)
        if exponent == 4.0:
            return (self * self) ** 2.0
        factor, atom = self.single()
        if factor < 0.0 and exponent != int(exponent):
            return self._recorded() ** exponent
        power = self.recorder._atom(("power", atom, float(exponent)))
        return power * float(factor**exponent)

    def __truediv__(self, other: Scalar) -> Scalar:
        if isinstance(other, Expression):
            return self * other**-1.0
        return self * (1.0 / other)

    def __rtruediv__(self, other: float) -> Scalar:
        return other * self**-1.0

    def _recorded(self) -> Expression:
        """The value as one atom of factor 1."""
        factor, atom = self.single()
        return self.recorder._atom(("linear", 0.0, ((atom, factor),)))

    def _build(self, constant: float, terms: dict[int, float]) -> Scalar:
        return Expression(self.recorder, constant, terms) if terms else constant


def sin(x: Scalar) -> Scalar:
    """Sine of an angle in rad."""
    if not isinstance(x, Expression):
        return math.sin(x)
    return x.recorder._atom(("sine", x.recorder.atom(x)))


def cos(x: Scalar) -> Scalar:
    """Cosine of an angle in rad."""
    if not isinstance(x, Expression):
        return math.cos(x)
    return x.recorder._atom(("cosine", x.recorder.atom(x)))


def exp(x: Scalar) -> Scalar:
    """Exponential of a number, or of each of an array of numbers."""
    if not isinstance(x, Expression):
        value: float = np.exp(x)
        return value
    return x.recorder._atom(("exponential", x.recorder.atom(x)))


def derivative(x: Scalar, variable: int) -> Scalar:
    """∂x/∂(variable number ``variable``), an expression again; solved atoms are not supported."""
    if not isinstance(x, Expression):
        return 0.0
    memo: dict[int, Scalar] = {}
    total: Scalar = 0.0
    for atom, factor in x.terms.items():
        total = total + _atom_derivative(x.recorder, atom, variable, memo) * factor
    return total


def _atom_derivative(
    recorder: Recorder, atom: int, variable: int, memo: dict[int, Scalar]
) -> Scalar:
    if atom not in memo:
        memo[atom] = _rule(recorder, recorder.nodes[atom], atom, variable, memo)
    return memo[atom]


def _rule(
    recorder: Recorder, node: Node, atom: int, variable: int, memo: dict[int, Scalar]
) -> Scalar:
    """The chain rule for one kind of atom."""

    def inner(k: int) -> Scalar:
        return _atom_derivative(recorder, k, variable, memo)

    def value(k: int) -> Expression:
        return Expression(recorder, 0.0, {k: 1.0})

    match node:
        case ("variable", index):
            return 1.0 if index == variable else 0.0
        case ("linear", _, terms):
            total: Scalar = 0.0
            for k, factor in terms:  # type: ignore[attr-defined]
                total = total + inner(k) * factor
            return total
        case ("product", int(a), int(b)):
            return inner(a) * value(b) + inner(b) * value(a)
        case ("power", int(a), float(e)):
            return inner(a) * (value(a) ** (e - 1.0)) * e
        case ("sine", int(a)):
            return inner(a) * cos(value(a))
        case ("cosine", int(a)):
            return inner(a) * sin(value(a)) * -1.0
        case ("exponential", int(a)):
            return inner(a) * exp(value(a))
    raise UsageError(f"no derivative of {node[0]}")


def is_constant(x: Scalar) -> TypeIs[float]:
    """True for a plain number."""
    return not isinstance(x, Expression)


def parts(x: Scalar) -> list[tuple[int, float]]:
    """The atoms of a scalar and their factors; −1 stands for the number 1."""
    if not isinstance(x, Expression):
        return [(-1, float(x))] if x else []
    constant = [(-1, float(x.constant))] if x.constant != 0.0 else []
    return constant + list(x.terms.items())


def atom_of(x: Scalar, atom: int) -> Scalar:
    """One of the atoms that `parts` names, by itself."""
    return x.recorder.function(atom) if isinstance(x, Expression) else 1.0


def one_atom(x: Scalar) -> Scalar:
    """The scalar as factor × atom, a sum being recorded as an atom of its own."""
    if not isinstance(x, Expression):
        return x
    factor, atom = x.single()
    return Expression(x.recorder, 0.0, {atom: factor})
