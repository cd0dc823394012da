"""Points, directions, angles and inertia tensors: what several parts of a mechanism share.

Vectors have two components in a plane and three in space, and some keys belong to one space only.
The space of the mechanism is the context of a validation, {"space": "planar"}; without one, as of
parts built in Python, every space is right.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, TypeAlias

from pydantic import AfterValidator, BeforeValidator, ValidationInfo
from pydantic_core import core_schema

from eigassign.case.schema.parts import OneOrList, Quantity, must, quantity, wrong

LENGTH = quantity("length", above=0)
ANGLE = quantity("angle")
PLACE = quantity("length")
_SHORTEST = 1e-30  # component of a direction; squares of less end in 0
_ROUND_OFF = 1e-12  # of the trace: a thin rod's zero inertia computed elsewhere


def space_of(info: ValidationInfo) -> str | None:
    """planar or spatial; None where the file does not say, or there is no file."""
    space = info.context and info.context["space"]
    return space if space in ("planar", "spatial") else None


def only_in(space: str, message: str, neutral: object = None) -> Any:
    """Validator of a key that belongs to one space; in the other it may be ``neutral``."""

    def belongs(value: object, info: ValidationInfo) -> object:
        if value != neutral and space_of(info) not in (None, space):
            raise wrong(message)
        return value

    return BeforeValidator(belongs) if neutral is None else AfterValidator(belongs)


IN_PLANE = only_in("planar", "is for planar mechanisms: in space write orientation: [rx, ry, rz]")
IN_SPACE = only_in("spatial", "is for spatial mechanisms: in a plane write angle")


class Components:
    """A component along each axis: two in a plane, three in space."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> core_schema.CoreSchema:
        def fits(value: Any, info: ValidationInfo) -> Any:
            space = space_of(info) or ""
            axes = {"planar": "x, y", "spatial": "x, y, z"}.get(space)
            if axes and isinstance(value, tuple) and len(value) != len(axes.split()):
                needed = f"{space}: needs {len(axes.split())} components ({axes})"
                raise wrong(f"{needed}, got {len(value)}")
            return value

        return core_schema.with_info_before_validator_function(fits, handler(source))

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        return {**handler(schema), "minItems": 2, "maxItems": 3}


Vector: TypeAlias = Annotated[tuple[Annotated[float, PLACE], ...], Components()]
Angle: TypeAlias = Annotated[float, ANGLE]
Orientation: TypeAlias = tuple[Angle, Angle, Angle]  # rad, about x, y, z: R = Rz Ry Rx


Direction: TypeAlias = Annotated[
    tuple[Annotated[float, Quantity()], ...],
    Components(),
    must(
        lambda direction: any(abs(v) >= _SHORTEST for v in direction),
        "has no direction: all components are zero",
    ),
]


def parallel(a: Sequence[float], b: Sequence[float]) -> bool:
    """True for directions that agree within a millionth of a radian."""
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
    """True where no direction has a negative value: every principal minor is at least zero."""
    scale = sum(abs(a[i][i]) for i in range(3)) or max(abs(v) for row in a for v in row)
    if scale == 0.0:
        return True
    b = [[v / scale for v in row] for row in a]
    pairs = ((0, 1), (0, 2), (1, 2))
    minors = [b[i][i] for i in range(3)]
    minors += [b[i][i] * b[j][j] - b[i][j] ** 2 for i, j in pairs]
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = b
    determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    return min(*minors, determinant) >= -_ROUND_OFF


def spread(inertia: Sequence[float]) -> list[list[float]]:
    """tr(J)/2 1 − J = ∫ x xᵀ dm, which no body has negative: the triangle inequality."""
    J = tensor(inertia)
    half = (J[0][0] + J[1][1] + J[2][2]) / 2
    return [[half * (i == j) - J[i][j] for j in range(3)] for i in range(3)]


def _is_inertia(
    inertia: float | tuple[float, ...], info: ValidationInfo
) -> float | tuple[float, ...]:
    if isinstance(inertia, tuple):
        if space_of(info) == "planar":
            raise wrong("planar: one number, about the axis out of the plane, got a list")
        if len(inertia) not in (3, 6):
            message = "expected 3 (Ixx, Iyy, Izz) or 6 (… Ixy, Ixz, Iyz) entries, got "
            raise wrong(f"{message}{len(inertia)}")
        if not semidefinite(tensor(inertia)):
            raise wrong("not positive: turning about some axis would take no energy")
    elif inertia != 0 and space_of(info) == "spatial":
        raise wrong("spatial: needs [Ixx, Iyy, Izz] or [Ixx, Iyy, Izz, Ixy, Ixz, Iyz]")
    return inertia


Inertia: TypeAlias = Annotated[
    OneOrList[
        Annotated[float, quantity("rotary inertia", at_least=0)],
        tuple[Annotated[float, quantity("rotary inertia")], ...],
    ],
    AfterValidator(_is_inertia),
]
