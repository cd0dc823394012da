"""Points, directions, angles and inertia tensors: what several parts of a mechanism share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, TypeAlias

from pydantic import AfterValidator

from eigassign.case.schema.parts import OneOrList, Quantity, quantity, wrong

LENGTH = quantity("length", above=0)
ANGLE = quantity("angle")
PLACE = quantity("length")
_SHORTEST = 1e-30  # component of a direction; squares of less end in 0
_ROUND_OFF = 1e-12  # of the trace: a thin rod's zero inertia computed elsewhere


class _Components:
    """Two components in a plane, three in space; the rules of the space say which are wanted."""

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        return {**handler(schema), "minItems": 2, "maxItems": 3}


Vector: TypeAlias = Annotated[tuple[Annotated[float, PLACE], ...], _Components()]
Angle: TypeAlias = Annotated[float, ANGLE]
Orientation: TypeAlias = tuple[Angle, Angle, Angle]  # rad, about x, y, z: R = Rz Ry Rx


def _points_somewhere(direction: tuple[float, ...]) -> tuple[float, ...]:
    if not any(abs(v) >= _SHORTEST for v in direction):
        raise wrong("has no direction: all components are zero")
    return direction


Direction: TypeAlias = Annotated[
    tuple[Annotated[float, Quantity()], ...], _Components(), AfterValidator(_points_somewhere)
]


def parallel(a: Sequence[float], b: Sequence[float]) -> bool:
    """Whether two directions agree within a millionth of a radian."""
    n = max(len(a), len(b), 3)
    x, y = [[*v, *([0.0] * (n - len(v)))] for v in (a, b)]
    cross = (x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0])
    norms = sum(v * v for v in x) * sum(v * v for v in y)
    return sum(c * c for c in cross) <= 1e-12 * norms


# --- Inertia tensors


def tensor(inertia: Sequence[float]) -> list[list[float]]:
    """(Ixx, Iyy, Izz[, Ixy, Ixz, Iyz]) as a matrix; the products are its entries, −∫xy dm."""
    xx, yy, zz, xy, xz, yz = (*inertia, 0.0, 0.0, 0.0)[:6]
    return [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]


def semidefinite(a: list[list[float]]) -> bool:
    """Whether no direction has a negative value: every principal minor is at least zero."""
    scale = sum(abs(a[i][i]) for i in range(3)) or max(abs(v) for row in a for v in row)
    if scale == 0.0:
        return True
    b = [[v / scale for v in row] for row in a]
    pairs = ((0, 1), (0, 2), (1, 2))
    minors = [b[i][i] for i in range(3)]
    minors += [b[i][i] * b[j][j] - b[i][j] ** 2 for i, j in pairs]
    minors.append(_determinant(b))
    return min(minors) >= -_ROUND_OFF


def _determinant(b: list[list[float]]) -> float:
    (a, d, e), (_, f, g), (_, _, h) = b  # symmetric
    return a * (f * h - g * g) - d * (d * h - g * e) + e * (d * g - f * e)


def spread(inertia: Sequence[float]) -> list[list[float]]:
    """tr(J)/2 1 − J = ∫ x xᵀ dm, which no body has negative: the triangle inequality."""
    J = tensor(inertia)
    half = (J[0][0] + J[1][1] + J[2][2]) / 2
    return [[half * (i == j) - J[i][j] for j in range(3)] for i in range(3)]


def _is_inertia(inertia: float | tuple[float, ...]) -> float | tuple[float, ...]:
    if isinstance(inertia, tuple):
        if len(inertia) not in (3, 6):
            message = "expected 3 (Ixx, Iyy, Izz) or 6 (… Ixy, Ixz, Iyz) entries, got "
            raise wrong(f"{message}{len(inertia)}")
        if not semidefinite(tensor(inertia)):
            raise wrong("not positive: turning about some axis would take no energy")
    return inertia


Inertia: TypeAlias = Annotated[
    OneOrList[
        Annotated[float, quantity("rotary inertia", at_least=0)],
        tuple[Annotated[float, quantity("rotary inertia")], ...],
    ],
    AfterValidator(_is_inertia),
]
