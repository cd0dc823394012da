"""Path → CaseFile, or all problems of the file at once; canonical YAML of it.

Its content → canonical YAML 1.2 text, in SI and complete, that reads back equal.

bytes or mapping → reader → tree → schema → document → rules → CaseFile

The schema looks at the form of the whole file, the rules at what its parts have in common once the
form is right. Each tells all that it finds at once.
"""

from __future__ import annotations

import errno
import hashlib
import json
import math
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from functools import cached_property, reduce
from itertools import accumulate, islice
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from eigassign.brief import cut, named
from eigassign.case.reader import (
    KeyPath,
    Mark,
    Source,
    Tree,
    dotted,
    entries,
    key_path,
    read_mapping,
    read_yaml,
    resolve,
    told_once,
    value_below,
    with_values,
)
from eigassign.case.rules.consistency import (
    NamedFile,
    inconsistent,
    keys_have_values,
    named_files,
    not_allowed,
    too_many,
    unreadable,
)
from eigassign.case.rules.plausibility import (
    bare_lengths_are_of_machines,
    bounds_hold_nothing_impossible,
    implausible,
)
from eigassign.case.rules.properties import (
    below,
    coordinate_lists,
    known_property,
    properties_of,
    property_at,
    quantities,
    value_at,
    walk,
    with_properties,
    with_uncertain,
)
from eigassign.case.schema.design import RESERVED, Design, Parameter, Tolerance
from eigassign.case.schema.document import Document, validated
from eigassign.case.schema.mechanism import Coordinate, Mechanism, freedom_of
from eigassign.case.schema.parts import FrozenDict, Part, Quantity
from eigassign.case.schema.study import (
    AssignmentKeys,
    DampingForm,
    ExpansionKeys,
    Measurements,
    Sweep,
    ValidationKeys,
)
from eigassign.case.schema.targets import AnyTarget, DrawnResponse, ResponseForm, TargetForm
from eigassign.case.schema.trajectory import (
    Added,
    TrajectoryForm,
    named_trajectories,
)
from eigassign.case.schema.uncertain import BESIDE, Uncertain, UnknownColumn
from eigassign.case.units import SI, Given
from eigassign.errors import CaseError, Problem, StorageError, UsageError
from eigassign.files import CASE, file_digest, objection, read_bytes, seen_from

_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_./-]*")
_WIDTH = 75  # characters of a line, after which the next entry of a list begins another


class _Dumper(getattr(yaml, "CSafeDumper", yaml.SafeDumper)):  # type: ignore[misc]
    """Block style but for mappings of scalars; text in quotes where YAML 1.2 reads it otherwise."""

    def ignore_aliases(self, data: object) -> bool:
        """Everything is written out."""
        return True

    def represent_mapping(self, tag: str, mapping: Any, flow_style: bool | None = None) -> Any:
        """A mapping."""
        node = super().represent_mapping(tag, mapping, flow_style)
        node.flow_style = all(isinstance(value, yaml.ScalarNode) for _, value in node.value)
        return node

    def text(self, text: str) -> Any:
        """A scalar."""
        quoted = not _PLAIN.fullmatch(text) or resolve(text) != text
        return self.represent_scalar("tag:yaml.org,2002:str", text, '"' if quoted else None)


_Dumper.add_representer(str, _Dumper.text)
_Dumper.add_multi_representer(float, _Dumper.represent_float)  # `Written` too


def to_yaml(content: Mapping[str, object]) -> str:
    """Block style, flow style for lists and mappings of scalars; None is left out."""
    form: dict[str, Any] = {"default_flow_style": None, "sort_keys": False, "allow_unicode": True}
    written: str = yaml.dump(plain(content), Dumper=_Dumper, width=_WIDTH, **form)
    return written


def plain(value: object) -> object:
    """Objects → mappings, lists, numbers and text, in the shape of the file."""
    if isinstance(value, Design | Uncertain):
        beside = {k: getattr(value, k, None) for k in (*RESERVED, *BESIDE)}
        own = {k: v for k, v in value.entries.items() if not isinstance(v, UnknownColumn)}
        return plain({**own, **{k: v for k, v in beside.items() if v}})
    if isinstance(value, Tolerance):
        return value.written()
    if isinstance(value, Part):
        fields = {f.alias or n: getattr(value, n) for n, f in type(value).model_fields.items()}
        if fields.get("base", "ground") != "ground" and not any(fields["position"] or ()):
            del fields["position"]  # of a joint at the node of a link
        return plain({k: v for k, v in fields.items() if v or k != "set"})
    if isinstance(value, Mapping):
        return {key: plain(inner) for key, inner in value.items() if inner is not None}
    if isinstance(value, (tuple, list)):
        return [plain(inner) for inner in value]
    return value


_STEP = re.compile(r"\[(\d+)\]|([^.\[\]]+)")  # of a key path: targets[0].mode


class Load(NamedTuple):
    """A property that trajectories set, in SI: as the file writes it, and along each of them.

    Of what is a design parameter it is what they add: 0 as the file writes it.
    """

    path: str
    written: float
    along: tuple[float, ...]  # one for each trajectory, in the order of the file
    unit: str

    @property
    def range(self) -> tuple[float, float]:
        """Its least and its largest value along any trajectory."""
        return min(self.along), max(self.along)


@dataclass(frozen=True)
class CaseFile:
    """One validated case. Two are equal when their content is, wherever they were read from.

    ``path`` and ``sha256`` identify the file and its bytes, ``files`` the bytes of those that it
    names; ``warnings`` are plausibility problems that do not keep the case from being run;
    ``variant`` are the values it has in place of those in the file.
    """

    title: str
    author: str | None
    reference: str | None
    mechanism: Mechanism
    coordinates: Mapping[str, Coordinate]
    damping: DampingForm | None
    trajectory: TrajectoryForm | tuple[TrajectoryForm, ...] | None
    design: Design
    uncertain: Uncertain | None
    expansion: ExpansionKeys
    targets: tuple[TargetForm, ...]
    response: ResponseForm | None
    assignment: AssignmentKeys
    measurements: Measurements | None
    validation: ValidationKeys
    sweep: Sweep | None
    path: Path = field(compare=False)
    sha256: str = field(compare=False)
    warnings: tuple[Problem, ...] = field(compare=False)
    marks: Mark = field(compare=False, repr=False)
    files: Mapping[str, str] = field(compare=False, default_factory=dict)  # SHA-256 by name
    variant: Mapping[str, object] = field(compare=False, default_factory=dict)  # by dotted key
    in_degrees: bool = field(compare=False, default=False)  # it writes angles so

    def __repr__(self) -> str:
        q, y = named(tuple(self.coordinates)), named(tuple(self.design.parameters))
        targets = f"{len(self.targets)} target{'s' if len(self.targets) != 1 else ''}"
        return cut(
            f"<CaseFile {str(self.path)!r}: {cut(self.title, 80)}; q = {q}, y = {y}, {targets}>"
        )

    @property
    def asked(self) -> tuple[tuple[str, AnyTarget], ...]:
        """What is asked of modes, each with its key path: the mode to be highest, the targets."""
        objective = self.assignment.objective
        aim = () if isinstance(objective, str) else (("assignment.objective", objective.target),)
        return (*aim, *((f"targets[{k}]", target) for k, target in enumerate(self.targets)))

    @property
    def responses(self) -> tuple[DrawnResponse, ...]:
        """Those that are drawn."""
        form = self.response or ()
        return form if isinstance(form, tuple) else (form,)

    @property
    def has_question(self) -> bool:
        """True where a design is asked for: by targets, or an objective that needs none."""
        return bool(self.asked) or self.assignment.objective in ("lightest", "fastest")

    def problem(self, key_path: str, message: str) -> Problem:
        """Problem at the line and column of ``key_path`` (``mechanism.links.forearm.length``,
        ``targets[0].mode``), or of the nearest key above it that the file has.

        ``key_path`` may start below `mechanism`, as the paths of design parameters do.
        """
        path: KeyPath = tuple(int(i) if i else name for i, name in _STEP.findall(key_path))
        if path and path[0] in Mechanism.model_fields:
            path = ("mechanism", *path)  # paths of properties start below `mechanism`
        mark = self.marks.find(path)
        return Problem(str(self.path), mark.line, mark.column, dotted(path), message)

    def require(self, command: str, needs: Mapping[str, tuple[bool, str]]) -> None:
        """Raise CaseError naming every key of ``needs`` (whether it is given, what for) missing."""
        problems = tuple(
            self.problem(key, f"is missing, and {command} needs it: {why}")
            for key, (given, why) in needs.items()
            if not given
        )
        if problems:
            raise CaseError(problems)

    @cached_property
    def coordinate_units(self) -> tuple[str, ...]:
        """SI unit of each coordinate, in the order of q: rad, or m where its joint slides.

        Answered as poses are written, of the trajectory first; a bare angle is in rad.
        """
        joints = self.mechanism.joints
        written = zip(*(row for _, row in coordinate_lists(self)), strict=True)
        moved = (freedom_of(joints[c.joint].type, c.component) for c in self.coordinates.values())
        units = ("m" if freedom == "translation" else "rad" for freedom in moved)
        at = {} if self.mechanism.assembly is None else self.mechanism.assembly.at
        rows = ((*next(written, ()), at.get(name, 0.0)) for name in self.coordinates)
        both = zip(units, rows, strict=True)
        return tuple(self._unit(u, *row, "rad" * (u == "rad" and any(row))) for u, row in both)

    def _unit(self, unit: str, *given: object) -> SI:
        """SI ``unit`` of what is written as ``given``; the file may have degrees elsewhere."""
        return SI(unit, *given, "deg" * (unit == "rad" and self.in_degrees))

    @property
    def mass_unit(self) -> str:
        """Kilograms, as the mass of the whole is limited."""
        mass = self.design.mass
        return SI("kg", mass and mass.min, mass and mass.max, "kg")

    def constraint_unit(self, name: str) -> str:
        """SI unit of a constraint of the design; empty where its terms have several."""
        given, own = self.design.constraints[name], [*self.design.parameters]
        first, *more = (self.design_units[own.index(p)] for p, c in given.terms.items() if c)
        return "" if {*more} - {first} else SI(str(first), given.min, given.max, first)

    @property
    def drive_units(self) -> tuple[str, ...]:
        """SI unit of what the drive of each coordinate exerts: N m, or N where its joint slides."""
        limits = (getattr(self.design.torque.get(name), "max", None) for name in self.coordinates)
        pairs = zip(self.coordinate_units, limits, strict=True)
        return tuple(SI("N" if unit == "m" else "N m", limit) for unit, limit in pairs)

    @cached_property
    def design_quantities(self) -> tuple[Quantity, ...]:
        """Dimension and limits of each design parameter, in the order of y."""
        return self.quantities([p.parameter for p in self.design.parameters.values()])

    def quantities(self, paths: Iterable[str]) -> tuple[Quantity, ...]:
        """Dimension and limits of the property at each path."""
        return tuple(property_at(self, path) for path in paths)

    @property
    def design_units(self) -> tuple[str, ...]:
        """SI unit of each design parameter, in the order of y; empty for a plain number."""
        columns = self.design.parameters.values()
        return tuple(
            self._unit(quantity.si, column.min, column.max, self.value_at(column.parameter))
            for quantity, column in zip(self.design_quantities, columns, strict=True)
        )

    @cached_property
    def loads(self) -> Mapping[str, Load]:
        """What trajectories `set`, by path: what q holds beside the coordinates.

        What they add to a design parameter is `<path>.add`.
        """
        sets = [form.set for *_, form in self.trajectories]
        paths = tuple(dict.fromkeys(path for own in sets for path in own))
        of_design = {path for p in self.design.parameters.values() for path in p.factors}
        found = {}
        for path, quantity in zip(paths, self.quantities(paths), strict=True):
            own = 0.0 if path in of_design else self.value_at(path)
            values = [each.get(path, own) for each in sets]
            along = tuple(own + v.add if isinstance(v, Added) else float(v) for v in values)
            written = (v.add if isinstance(v, Added) else v for v in values)
            unit = self._unit(quantity.si, *written, self.value_at(path))
            found[f"{path}.add" if path in of_design else path] = Load(path, own, along, unit)
        return found

    @property
    def load_quantities(self) -> tuple[Quantity, ...]:
        """Dimension and limits of each of the loads, in their order; an amount added has none."""
        found = self.quantities(load.path for load in self.loads.values())
        pairs = zip(self.loads.items(), found, strict=True)
        return tuple(q if name == load.path else Quantity(q.dimension) for (name, load), q in pairs)

    @property
    def q_units(self) -> tuple[str, ...]:
        """SI unit of each entry of q: of the coordinates, then of the loads."""
        return (*self.coordinate_units, *(load.unit for load in self.loads.values()))

    @property
    def variant_units(self) -> Mapping[str, str]:
        """SI unit of each value of its `variant`, by key; empty where the schema knows of none."""
        found = dict[str, str]()
        designed = dict(zip(self.design.parameters, self.design_quantities, strict=True))
        for key, value in self.variant.items():
            *owners, last = key.split(".")
            owner = reduce(below, owners, self)
            own = quantities(type(owner)).get(last) if isinstance(owner, Part) else None
            known = known_property(self, key.removeprefix("mechanism.")) or own
            bound = last in ("min", "max") and owners[:1] == ["design"]
            kind = known or (designed.get(owners[-1]) if bound else None) or Quantity()
            found[key] = SI(kind.si, Given(math.nan, str(value)))
        return found

    @property
    def box(self) -> tuple[tuple[float, float], ...]:
        """Least and largest value of each load, then of each design parameter."""
        of_design = ((p.min, p.max) for p in self.design.parameters.values())
        return (*(load.range for load in self.loads.values()), *of_design)

    @cached_property
    def varied(self) -> Mapping[str, tuple[tuple[int, float], ...]]:
        """Each property that varies, by path, as Σ factor · entry of the loads and the design."""
        found = {load.path: ((k, 1.0),) for k, load in enumerate(self.loads.values())}
        for path, ((k, factor),) in self.design.varied.items():
            found[path] = (*found.get(path, ()), (len(self.loads) + k, factor))
        return found

    @property
    def ranges(self) -> Mapping[str, tuple[float, float]]:
        """Least and largest value of each property that varies, by path."""
        found = {}
        for path, terms in self.varied.items():
            ends = [sorted(factor * end for end in self.box[k]) for k, factor in terms]
            found[path] = (sum(low for low, _ in ends), sum(high for _, high in ends))
        return found

    def value_at(self, path: str) -> float:
        """The number that the file gives to the property at ``path``, in SI."""
        return value_at(self, path)

    @property
    def trajectories(self) -> tuple[tuple[str, str, TrajectoryForm], ...]:
        """Key path, name ("1", "2", … where the file gives none) and content of each trajectory."""
        named = named_trajectories(self.trajectory)
        return tuple((dotted(path), name, trajectory) for path, name, trajectory in named)

    def with_design(self, y: Iterable[float]) -> CaseFile:
        """The case with these values (SI) of its design parameters written into the mechanism."""
        both = zip(self.design.parameters.values(), y, strict=True)
        values = {p: f * float(value) for own, value in both for p, f in own.factors.items()}
        return replace(self, **with_properties(self, values))

    def with_every_property(self, places: bool = True) -> CaseFile:
        """The case with all numbers that may vary, and are not 0, as parameters at their values.

        Without those that trajectories set, and where asked without lengths, places and angles.
        """
        entries = {
            path: Parameter(parameter=path, min=value, max=value)
            for path in properties_of(self, places)
            if path not in self.loads and (value := self.value_at(path))
        }
        return replace(self, design=Design.model_construct(entries=FrozenDict(entries)))

    def resolved(self) -> str:
        """The case as canonical YAML: SI values, defaults filled in; reads back equal."""
        return to_yaml({name: getattr(self, name) for name in Document.model_fields})


NO_VALUES: Mapping[str, object] = FrozenDict()
MOST_PROBLEMS = 100  # shown


class Unchecked(NamedTuple):
    """A case file as it is written: its bytes, and the tree in them."""

    path: Path
    data: bytes
    source: Source

    @property
    def sha256(self) -> str:
        """SHA-256 of its bytes."""
        return hashlib.sha256(self.data).hexdigest()

    def content(self) -> str:
        """SHA-256 of what it says, its `sweep` apart, and of every file it names.

        Comments, the form of its lines, and places of files count for nothing.
        """
        tree = {key: body for key, body in self.source.tree.items() if key != "sweep"}
        digests = _digests(named_files(tree, self.path.parent), self.path.parent)
        return hashlib.sha256(" ".join([json.dumps(tree), *digests.values()]).encode()).hexdigest()


def load(path: str | Path, allow_outside: bool = False) -> CaseFile:
    """The case file at ``path``; ``allow_outside``: it may name files outside its folder.

    Raises CaseError with every problem of the file, UsageError if ``path`` is not a file or one too
    large, and StorageError if it cannot be read.
    """
    return checked(read(path), allow_outside)


def parse(data: bytes, path: str | Path, allow_outside: bool = False) -> CaseFile:
    """The case file with content ``data``; ``path`` names it and anchors relative paths in it."""
    return checked(Unchecked(Path(path), data, read_yaml(data, str(path))), allow_outside)


def read(path: str | Path) -> Unchecked:
    """The case file at ``path`` before its keys are looked at; raises as `load` does."""
    path = Path(path)
    try:
        data = read_bytes(path, CASE)
    except (FileNotFoundError, NotADirectoryError, ValueError):
        meant = f"; did you mean {path}.yaml?" if os.path.isfile(f"{path}.yaml") else ""
        raise UsageError(f"{path}: no such case file{meant}") from None
    except OSError as error:
        if error.errno in (errno.EINVAL, errno.EFBIG):
            raise UsageError(f"{path}: expected a case file: {error.strerror}") from None
        raise StorageError(f"{path}: cannot be read: {error.strerror}") from error
    return Unchecked(path, data, read_yaml(data, str(path)))


_DEGREES = re.compile(rb"\d\s*(deg\b|\xc2\xb0|\\u00b0)")  # as YAML has them, and JSON


def from_mapping(
    given: Mapping[str, Any], path: str | Path = "case", allow_outside: bool = False
) -> CaseFile:
    """The case with the content ``given`` in place of a file.

    Values are as in a file, ``"30 mm"`` or 0.03; ``path`` names it and anchors relative paths.
    Raises CaseError with every problem, by its key.
    """
    source = read_mapping(given, str(path))
    written = Unchecked(Path(path), json.dumps(source.tree).encode(), source)
    return checked(written, allow_outside)


def checked(
    written: Unchecked, allow_outside: bool = False, values: Mapping[str, object] = NO_VALUES
) -> CaseFile:
    """The case with these ``values`` in place of its own, by dotted key; raises CaseError.

    Each key is in the file, or may be: see `key_objection`.
    """
    source, path = written.source, written.path
    if values:
        source = source._replace(tree=with_values(source.tree, values))
    if crowded := [source.problem(*finding) for finding in too_many(source.tree)]:
        raise CaseError(tuple(crowded))
    named = named_files(source.tree, path.parent)
    bad = [] if allow_outside else [*not_allowed(named, path.parent)]
    bad = bad or [*unreadable([each for each in named if not each.spare])]
    unread = {place for place, _ in bad}
    if not bad:
        source = source._replace(tree=_with_updates(source.tree, named))
    document, found = validated(source.tree, path.parent)
    found = [*islice(keys_have_values(source.tree), MOST_PROBLEMS), *found]
    findings = bad + [finding for finding in found if finding[0] not in unread]
    if document is not None and not findings:
        designed, document = document.design, with_uncertain(document)
        findings = [*islice(inconsistent(document), MOST_PROBLEMS)]
    problems = [*source.problems, *(source.problem(*each) for each in told_once(findings))]
    if problems or document is None:
        raise CaseError(tuple(dict.fromkeys(problems))[:MOST_PROBLEMS])
    doubts = [*implausible(document), *unreadable([each for each in named if each.spare])]
    if not document.assignment.robust:  # what is not known does not count
        document = document.model_copy(update={"design": designed})
    warnings = [source.problem(*finding) for finding in doubts]
    case = CaseFile(
        **{name: getattr(document, name) for name in Document.model_fields},
        path=path,
        sha256=written.sha256,
        warnings=tuple(sorted(warnings, key=lambda p: (p.line, p.column, p.path))),
        marks=source.marks,
        files=_digests(named, path.parent),
        variant=values,
        in_degrees=_DEGREES.search(written.data) is not None,
    )
    if impossible := [source.problem(*each) for each in bounds_hold_nothing_impossible(case)]:
        bare = [source.problem(*each) for each in bare_lengths_are_of_machines(document)]
        raise CaseError(tuple((bare or impossible)[:MOST_PROBLEMS]))
    return case


def _with_updates(tree: Tree, named: Sequence[NamedFile]) -> Tree:
    """The tree with what is uncertain in place of the name of the file that says it."""
    for each in named:
        if each.path == ("uncertain", "file"):
            body = {**entries(tree, "uncertain")}
            told = entries(read_yaml(read_bytes(each.file, CASE), each.file).tree, "uncertain")
            own = {key: value for key, value in body.items() if key != "file" or not told}
            tree = {**tree, "uncertain": {**told, **own}}
    return tree


def _digests(named: Sequence[NamedFile], folder: Path) -> dict[str, str]:
    """SHA-256 of each file that is there by its name from ``folder``; raises StorageError."""
    digests = {}
    for each in named:
        if (sha := file_digest(each.file, each.limit)) is not None:
            digests[seen_from(folder, each.file)] = sha
        elif objection(each.file, each.limit) is None:
            raise StorageError(f"{each.file}: cannot be read: no permission, or the disk fails")
    return digests


# --- Which keys a case could have


def key_objection(tree: Tree, folder: Path, key: str, value: object) -> str | None:
    """Why no case could have this key; None where the file has it, or may have it with ``value``.

    ``folder`` is that of the file.
    """
    path = key_path(tree, key)
    if path[0] == "sweep":
        return "a sweep gives values to other keys than its own"
    there: list[Any] = [*accumulate(path, value_below, initial=tree)]
    if None not in there:
        return None
    known, wrong = there.index(None) - 1, []
    if isinstance(there[known], Mapping):  # perhaps a key that the file leaves to its default
        first = path[: known + 1]
        _, findings = validated(with_values(tree, {key: value}), folder)
        about = [(place, why) for place, why in findings if place[: len(first)] == first]
        wrong = [why for at, why in about if at != path or why.startswith("unknown key")]
        if not wrong:
            return None
    if (near := _nearest(tree, key)) is None:
        return wrong[0] if wrong else f"no such key: {path[known]!r} is not there"
    return f"no such key; did you mean {near!r}?"


def _nearest(tree: Tree, key: str) -> str | None:
    """The key of the file that was probably meant."""
    given = (path for path, node in walk(tree) if not isinstance(node, Mapping))
    names = (".".join(map(str, path)) for path in given if path[0] != "sweep")
    known = list(islice(names, 2000))  # a fraction of a second, however long the file
    longer = [name for name in known if name.endswith(f".{key}")]
    return next(iter(longer or get_close_matches(key, known, n=1, cutoff=0.6)), None)
