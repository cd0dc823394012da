"""The numbers of a mechanism, floats or expressions, and what riders and properties may be.

Lengths of links and the places of their named nodes, in the link's own frame, are read here, so
that kinematics and elements see the same ones.

A rider at s splits its beam of length L into two segments of equal elements. Beyond the ends there
is no beam; near them elements become so short that their stiffness, as h⁻³, drowns the rest in
round-off: no element may be shorter than L/10⁴ (or a tenth of its share, in finer meshes).

Bounds of a design say where an answer may be; these limits say what a mechanism can have at all,
whoever asks. Each is linear in x = (q, y), rows · x + offset ≥ 0, or > 0.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eigassign.arrays import Bools, Floats
from eigassign.case.case_file import CaseFile
from eigassign.case.rules.properties import limits
from eigassign.case.schema.links import IMPORTED
from eigassign.case.schema.mechanism import RIDING
from eigassign.case.units import SI, handy, shown_point
from eigassign.errors import TravelError, UsageError
from eigassign.mechanism.kinematics.joints import Objects, vector
from eigassign.mechanism.kinematics.topology import NodeName, Topology, build_tree, coordinates
from eigassign.series.compiler import CompiledArrays, compile_arrays
from eigassign.series.expression import Recorder, Scalar


class Moved(NamedTuple):
    """How a node of a bent link is shifted, m (3,), and turned (3, 3), in the link's axes."""

    shift: Floats
    turn: Floats


STILL = Moved(np.zeros(3), np.eye(3))


@dataclass(frozen=True)
class ModelParameters:
    """Variables z = (s, p): joint coordinates s in the order of the case's coordinates, then the
    properties p that vary, those that trajectories set (loads) before the design y.

    A load is ``scales`` times its variable: a power of two near half its range, so that distances
    between poses and loads say something whatever the units; lengths stay in m, as strokes do.
    """

    recorder: Recorder
    coordinates: tuple[str, ...]
    design: tuple[str, ...]
    relative: Floats  # A of s = A q + b
    offset: Floats
    sums: Mapping[str, Sequence[tuple[int, float]]] = field(default_factory=dict)  # over p, by path
    by_path: Mapping[str, Scalar] = field(default_factory=dict)
    passive: tuple[Scalar, ...] = ()
    loads: tuple[str, ...] = ()
    scales: Floats = field(default_factory=lambda: np.zeros(0))  # (n_loads,)
    moved: Mapping[NodeName, Moved] = field(default_factory=dict)  # nodes of links that are bent

    @property
    def varied(self) -> tuple[str, ...]:
        """Names of the properties p."""
        return (*self.loads, *self.design)

    @property
    def count(self) -> int:
        """Number of variables z."""
        return len(self.coordinates) + len(self.varied)

    @property
    def to_z(self) -> Floats:
        """dz/dx with x = (q, y), q the coordinates and the loads, (n_z, n_x)."""
        n, matrix = len(self.coordinates), np.eye(self.count)
        matrix[:n, :n] = self.relative
        loads = range(n, n + len(self.loads))
        matrix[loads, loads] = 1.0 / self.scales
        return matrix

    @property
    def shift(self) -> Floats:
        """z of x = 0."""
        return np.concatenate([self.offset, np.zeros(len(self.varied))])

    def z(self, x: Floats) -> Floats:
        """z (n_z, n) of samples x (n, n_x)."""
        return np.asarray(self.to_z @ x.T + self.shift[:, None])

    def compiled(self, *arrays: NDArray[np.object_]) -> CompiledArrays:
        """Arrays of scalars, to be evaluated at z (n_z, n)."""
        return compile_arrays(self.recorder, arrays, self.count)

    def number(self, path: str, value: float) -> Scalar:
        """The value at a key path of the case, as an expression if it varies."""
        return self.by_path.get(path, value)

    def vector(self, path: str, values: Sequence[float] | None) -> Objects:
        """The vector (3,) at a key path of the case, each component as `number`; else zero."""
        given = enumerate(values or ())
        return vector([self.number(f"{path}.{k}", float(value)) for k, value in given])

    def angles(self, path: str, part: Any) -> Objects:
        """(rx, ry, rz) in rad by which a joint or a spring is turned, in a plane about z alone."""
        turned = getattr(part, "orientation", None)
        if turned is not None:
            return self.vector(f"{path}.orientation", turned)
        return vector([0.0, 0.0, self.number(f"{path}.angle", part.angle)])

    def freedom(self, k: int) -> Scalar:
        """Joint freedom k: a coordinate, or a passive one behind them."""
        n_q = len(self.coordinates)
        return self.recorder.variable(k) if k < n_q else self.passive[k - n_q]

    def with_passive(self, values: Sequence[Scalar]) -> ModelParameters:
        """The parameters with the passive freedoms known."""
        return replace(self, passive=tuple(values))

    def rerecorded(self, recorder: Recorder, n_passive: int) -> ModelParameters:
        """The parameters on another recorder, the passive freedoms being its last variables."""
        moved = _properties(recorder, len(self.coordinates), self.sums, self.scales)
        passive = tuple(recorder.variable(self.count + k) for k in range(n_passive))
        return replace(self, recorder=recorder, by_path=moved, passive=passive)


def parameters(case: CaseFile) -> ModelParameters:
    """The variables of a case."""
    recorder, maps = Recorder(), coordinates(case, build_tree(case))
    scales = np.array([_scale(load.path, *load.range) for load in case.loads.values()])
    return ModelParameters(
        recorder=recorder,
        coordinates=tuple(case.coordinates),
        loads=tuple(case.loads),
        design=tuple(case.design.parameters),
        relative=maps.relative,
        offset=maps.offset,
        scales=scales,
        sums=case.varied,
        by_path=_properties(recorder, len(case.coordinates), case.varied, scales),
    )


def _properties(
    recorder: Recorder,
    first: int,
    sums: Mapping[str, Sequence[tuple[int, float]]],
    scales: Floats,
) -> dict[str, Scalar]:
    """Properties by path, their variables numbered from ``first``; the loads are scaled."""
    found: dict[str, Scalar] = {}
    for path, terms in sums.items():
        for k, factor in terms:
            scale = scales[k] if k < len(scales) else 1.0
            found[path] = found.get(path, 0.0) + recorder.variable(first + k) * (factor * scale)
    return found


def _scale(path: str, low: float, high: float) -> float:
    """A power of two near half the range, or near the value where there is none."""
    size = 0.5 * (high - low) or abs(high)
    of_space = path.startswith(("links.", "joints."))
    return 2.0 ** round(np.log2(size)) if size and not of_space else 1.0


def initial_design(case: CaseFile) -> Floats:
    """y as the mechanism is written in the file, (n_y,) in SI units."""
    paths = [p.parameter for p in case.design.parameters.values()]
    return np.array([case.value_at(path) for path in paths], dtype=np.float64)


def written_loads(case: CaseFile) -> Floats:
    """The loads as the mechanism is written in the file, (n_loads,) in SI units."""
    return np.array([load.written for load in case.loads.values()], dtype=np.float64)


def link_type(case: CaseFile, link: str) -> str:
    """beam, rigid, frame, superelement or solid."""
    return str(getattr(case.mechanism.links[link], "type", "beam"))


def is_imported(case: CaseFile, link: str) -> bool:
    """True where a link is known by its matrices: nobody knows where its inner dofs point."""
    return link_type(case, link) in IMPORTED


def length(case: CaseFile, parameters: ModelParameters, link: str) -> Scalar:
    """Length of a link in m: a number, or a design parameter."""
    data: Any = case.mechanism.links[link]
    return parameters.number(f"links.{link}.length", data.length)


def node_position(
    case: CaseFile, parameters: ModelParameters, tree: Topology, node: NodeName
) -> Objects:
    """Position of a named node in its link's frame, m (3,).

    A node "@joint" is the place where a carriage or nut stands: the joint's own coordinate.
    """
    if node in parameters.moved:
        still = node_position(case, replace(parameters, moved={}), tree, node)
        return np.asarray(still + parameters.moved[node].shift)
    link, name = node
    data = case.mechanism.links[link]
    if name.startswith("@"):
        return vector([station(parameters, tree, name[1:])])
    named = getattr(data, "nodes", None) or {}
    if name in named:
        given = named[name]
        place = getattr(given, "position", given)
        if place is None and link_type(case, link) == "solid":
            from eigassign.mechanism.solids.part import couplings

            # the centre of its surface
            centre = couplings(data, f"mechanism.links.{link}")[1][name].place
            place = centre[: 2 if case.mechanism.space == "planar" else 3].tolist()
        elif place is None:
            from eigassign.mechanism.imports.parts import imported_part

            place = imported_part(case, link).places[name]
        return parameters.vector(f"links.{link}.nodes.{name}", place)
    if name == "end":
        return vector([length(case, parameters, link)])
    return np.zeros(3, dtype=object)


def station(parameters: ModelParameters, tree: Topology, joint: str) -> Scalar:
    """Distance of a carriage or nut from the start of the link it rides on, m."""
    (k,) = tree.of_joint(joint)
    return parameters.freedom(k)


Label = Callable[[int], str]


@dataclass(frozen=True, eq=False)
class Rails:
    """The place of every rider and the length of its beam, as functions of z = (s, y)."""

    joints: tuple[str, ...]
    links: tuple[str, ...]
    margins: Floats  # (n_riders, 2): of the length, at start and end
    table: CompiledArrays  # station and length of every rider, (n_riders, 2)
    names: tuple[str, ...]  # of the coordinates
    units: tuple[str, ...]  # SI, of these
    length_units: tuple[str, ...]  # SI, of the beams' lengths

    def require(self, z: Floats, x: Floats, label: Label = "sample {}".format) -> None:
        """Raise TravelError for the first sample at which a rider leaves its range.

        z (n_z, n_samples), and x (n_samples, n_x) to name the pose by; ``label`` names sample k of
        several, counted from 0.
        """
        s, L = self.table(z)[0].T
        low, high = self.margins[:, :1] * L, L * (1.0 - self.margins[:, 1:])
        outside = ~((s >= low) & (s <= high))
        if outside.any():
            k = int(np.flatnonzero(outside.any(axis=0))[0])
            rider = int(np.flatnonzero(outside[:, k])[0])
            where = f"in the pose {shown_point(self.names, x[k], self.units)}"
            where += f" ({label(k)})" if len(x) > 1 else ""
            place, *ends = (
                handy(each[rider, k], self.length_units[rider], 6) for each in (s, low, high)
            )
            message = (
                f"stands at {place} of {self.links[rider]!r} {where}: it can travel from "
                f"{ends[0]} to {ends[1]}. Lengthen the link, or travel less far"
            )
            raise TravelError(f"mechanism.joints.{self.joints[rider]}", message, k)


def rails(case: CaseFile, parameters: ModelParameters, tree: Topology) -> Rails | None:
    """The ranges of a mechanism; None where nothing rides."""
    riders = [(joint, link) for link in case.mechanism.links for joint in tree.riders[link]]
    if not riders:
        return None
    scalars = [
        [station(parameters, tree, joint) for joint, _ in riders],
        [length(case, parameters, link) for _, link in riders],
    ]
    links: Any = case.mechanism.links
    n = np.array([links[link].elements for _, link in riders])
    # 1e-4 of the beam's length, or a tenth of an element's share of it
    shortest, first = np.minimum(1e-4, 0.1 / n), np.maximum(1, n // 2)
    return Rails(
        tuple(joint for joint, _ in riders),
        tuple(link for _, link in riders),
        np.stack([first * shortest, np.maximum(1, n - first) * shortest], axis=1),
        parameters.compiled(np.array(scalars, dtype=object).T),
        parameters.coordinates,
        case.coordinate_units,
        tuple(SI("m", case.value_at(f"links.{link}.length"), "m") for _, link in riders),
    )


def resting_pose(case: CaseFile) -> Floats:
    """As the case assembles it, else 0, with every carriage and nut in the middle of its beam."""
    joints: Any = case.mechanism.joints
    links: Any = case.mechanism.links
    at = {} if case.mechanism.assembly is None else case.mechanism.assembly.at
    riding = {name: joints[c.joint] for name, c in case.coordinates.items()}
    middle = {n: 0.5 * links[j.base].length for n, j in riding.items() if j.type in RIDING}
    return np.array([at.get(name, middle.get(name, 0.0)) for name in riding])


ROUND_OFF = 1e-6  # of the bounds: round-off, and the steps of difference quotients


@dataclass(frozen=True, eq=False)
class PropertyLimits:
    """Limits of the loads and design parameters of a case. Immutable."""

    rows: Floats  # (n_limits, n_x)
    offset: Floats  # (n_limits,)
    slack: Floats  # (n_limits,): round-off
    strict: Bools  # (n_limits,): whether the limit itself is impossible
    words: tuple[str, ...]  # what must be
    names: tuple[str, ...]  # of the entries of x
    units: tuple[str, ...]  # SI

    def require(self, x: Floats) -> None:
        """Raise UsageError for the first of samples x (n, n_x) that no mechanism can have."""
        room = x @ self.rows.T + self.offset
        wrong = (room < -self.slack) | (self.strict & (room <= 0.0))
        if not wrong.any():
            return
        k = int(wrong.any(axis=1).argmax())
        limit = int(wrong[k].argmax())
        own = np.flatnonzero(self.rows[limit])
        given = " and ".join(f"{self.names[j]} = {handy(x[k, j], self.units[j], 6)}" for j in own)
        where = f" (sample {k})" if len(x) > 1 else ""
        raise UsageError(f"no mechanism has {given}{where}: {self.words[limit]}")


def property_limits(case: CaseFile) -> PropertyLimits | None:
    """The limits of a case; None where nothing varies that has any."""
    n_q = len(case.coordinates)
    names = (*case.coordinates, *case.loads, *case.design.parameters)
    if not (found := [*limits(case)]):
        return None
    rows = np.zeros((len(found), len(names)))
    for row, each in zip(rows, found, strict=True):
        for k, factor in each.factors.items():
            row[n_q + k] = factor
    reach = np.zeros(len(names))
    reach[n_q:] = [max(abs(low), abs(high)) for low, high in case.box]
    return PropertyLimits(
        rows=rows,
        offset=np.array([each.offset for each in found]),
        slack=ROUND_OFF * np.abs(rows) @ reach,
        strict=np.array([each.strict for each in found]),
        words=tuple(each.words for each in found),
        names=names,
        units=(*case.q_units, *case.design_units),
    )
