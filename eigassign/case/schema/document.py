"""The whole case file as one pydantic model, its errors as readable findings, its JSON Schema.

To add a key: give `Document` a field, with a model of what stands below it.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, Field, TypeAdapter, ValidationError
from pydantic.json_schema import GenerateJsonSchema

from eigassign.case.reader import COMMA, Finding, Tree, shown, suggestion, unspaced
from eigassign.case.schema.design import RESERVED, Design, is_entry
from eigassign.case.schema.mechanism import Coordinate, Mechanism
from eigassign.case.schema.parts import TAG, FrozenDict, Mistakes, Named, Part, must, wrong
from eigassign.case.schema.study import (
    AssignmentKeys,
    DampingForm,
    ExpansionKeys,
    Measurements,
    Sweep,
    ValidationKeys,
)
from eigassign.case.schema.targets import ResponseForm, TargetForm
from eigassign.case.schema.trajectory import TrajectoryForms
from eigassign.case.schema.uncertain import BESIDE, Uncertain

P = TypeVar("P", bound=Part)
typed = cache(TypeAdapter)  # what reads values of a type
_ONE_LINE = must(str.isprintable, "expected one line of printable text")


class Document(Part):
    """Everything a case file may hold.

    Keys:
        title: name of the case
        author: whose case it is; the report names them
        reference: source of the case
        mechanism: materials, sections, links, joints, bodies and springs
        coordinates: which joints make up q, in this order, and how each is held
        damping: ratios of modes, for responses; loss factors stand with materials and drives
        trajectory: q over time; one, or a list of them
        design: the design parameters y, in this order, and limits that they share
        uncertain: properties that are not known exactly: robust designs hold for all they may be
        expansion: the power series
        targets: wanted frequencies, limits, bands to keep out of, gaps
        response: responses to draw; one, or a list of them
        assignment: how the optimal design is looked for
        measurements: measured frequencies, for `eigassign update`
        validation: the accuracy that expansions must have
        sweep: variants of the case
    """

    title: Annotated[str, Field(min_length=1, max_length=200), _ONE_LINE]
    author: Annotated[str, Field(min_length=1, max_length=200), _ONE_LINE] | None = None
    reference: Annotated[str, Field(max_length=1000), _ONE_LINE] | None = None
    mechanism: Mechanism
    coordinates: Named[Coordinate] = FrozenDict()
    damping: DampingForm | None = None
    trajectory: TrajectoryForms | None = None
    design: Design = Design.model_construct()
    uncertain: Uncertain | None = None
    expansion: ExpansionKeys = ExpansionKeys.model_construct()
    targets: tuple[TargetForm, ...] = ()
    response: ResponseForm | None = None
    assignment: AssignmentKeys = AssignmentKeys.model_construct()
    measurements: Measurements | None = None
    validation: ValidationKeys = ValidationKeys.model_construct()
    sweep: Sweep | None = None

    def _mistakes(self, space: str | None) -> Mistakes:
        for name in self.uncertain.entries if self.uncertain else ():
            if name in self.design.entries:
                message = "is designed: how far it deviates is its tolerance, or name it otherwise"
                yield wrong(message, "uncertain", name)


# --- Errors of the schema as findings


def validated(tree: Tree, folder: Path) -> tuple[Document | None, list[Finding]]:
    """The document, or None and everything the schema has against it.

    Files are named from ``folder``. Keys without a value are another's to find.
    """
    mechanism = tree.get("mechanism")
    space = mechanism.get("space") if isinstance(mechanism, Mapping) else None
    body, context = _with_entries_apart(tree), {"space": space, "folder": folder}
    document, findings = validated_part(Document, body, context)
    return document, [each for each in findings if not each[1].endswith("got nothing")]


def validated_part(
    model: type[P], body: object, context: Mapping[str, object] | None = None, *place: str
) -> tuple[P | None, list[Finding]]:
    """A part that stands at ``place``, or None and everything the schema has against it."""
    try:
        return model.model_validate(body, context=context), []
    except ValidationError as error:
        return None, _findings(error, *place)


def _findings(error: ValidationError, *below: str) -> list[Finding]:
    """Errors in words, but for echoes: pydantic counts only the valid entries of a list."""
    found: list[Finding] = []
    each: Any
    for each in error.errors(include_url=False)[:200]:  # nobody reads more
        if each["type"] == "too_short" and len(each["input"]) >= each["ctx"]["min_length"]:
            continue
        loc = each["loc"] = (*below, *each["loc"])
        path = tuple(p for p in loc if not str(p).startswith(TAG) and p != "[key]")
        if path[1:2] == ("entries",) and path[0] in WITHOUT_ENTRIES:
            path = (path[0], *path[2:])
        more = each.get("ctx", {})
        words = _WORDS.get(each["type"], each["msg"].replace("{", "").replace("}", ""))
        entry = loc[-1] + 1 if loc and isinstance(loc[-1], int) else ""
        message = words.format(got=shown(each["input"]), entry=entry, **more) + _hint(each)
        found.append(((*path, *more.get("keys", ())), message))
    return found


# In the file entries stand directly under these keys, beside the reserved names
WITHOUT_ENTRIES = {"design": RESERVED, "uncertain": BESIDE}


def _with_entries_apart(tree: Tree) -> Tree:
    """The tree with the key `entries` that the models have."""
    whole = {**tree}
    for group, reserved in WITHOUT_ENTRIES.items():
        if isinstance(body := tree.get(group), Mapping):
            apart = {key: body[key] for key in reserved if key in body and not is_entry(body[key])}
            entries = {name: each for name, each in body.items() if name not in apart}
            whole[group] = {"entries": entries, **apart}
    return whole


_MAPPINGS = ["model_type", "model_attributes_type", "dict_type", "mapping_type", "is_instance_of"]
_WORDS = {
    "at_key": "{text}",
    "missing": "entry {entry} is missing",
    "literal_error": "expected {expected}",
    **dict.fromkeys(_MAPPINGS, "expected a mapping (key: value), got {got}"),
    "tuple_type": "expected a list, got {got}",
    "bool_type": "expected true or false, got {got}",
    "int_type": "expected a whole number, got {got}",
    "int_from_float": "expected a whole number, got {got}",
    "string_type": "expected text (in quotes if need be), got {got}",
    "string_too_short": "expected some text, got {got}",
    "string_too_long": "is longer than {max_length} characters",
    "too_short": "needs at least {min_length} entries, got {actual_length}",
    "too_long": f"takes at most {{max_length}} entries, got {{actual_length}}; {COMMA}",
    "greater_than_equal": "must be >= {ge}, got {got}",
    "less_than_equal": "must be <= {le}, got {got}",
}


def _hint(error: Any) -> str:
    """What goes on behind the words: what else may stand there, and what was probably meant."""
    kind, value, (place, last) = error["type"], error["input"], ("", "", *error["loc"])[-2:]
    match kind:
        case "literal_error":
            parts = {"drive": "{stiffness: ...}", "objective": "{highest: 1}"}
            also = parts.get(place, "") or (last[2:] if str(last).startswith(TAG) else "")
            words = error["ctx"]["expected"].replace("'", "").replace(" or ", ", ").split(", ")
            near = suggestion(value, words) if isinstance(value, str) else ""
            if (place, value) == ("objective", "highest"):
                near = ": say of which mode, as {highest: 1}"
            return f"{also and f', or {also}'}, got {shown(value)}{near}"
        case _ if kind in _MAPPINGS:
            return unspaced(value)
        case "tuple_type":
            one = "{...}" if isinstance(value, Mapping) else shown(value)
            return f"; of one entry it is [{one}]"
        case "int_type" if value == "all" and "mode" in (place, last):
            return ": write modes: all"
        case "string_type" if "parameter" in error["loc"] and isinstance(value, Mapping):
            return ": write a path, or several as [path, {path: factor}]"
        case "string_type" if isinstance(value, int | float) and not isinstance(value, bool):
            return f': write "{value}", in quotes, if that is its name'
    if kind == "too_short" and error["loc"][0] == "trajectory" and value:
        poses = {"time": "one pose alone has no time", "points": "one pose is q: [[...]], alone"}
        return f": {poses[last]}" if last in poses else ""
    return ""


# --- JSON Schema


class _Quiet(GenerateJsonSchema):
    """Empty mappings as defaults need no mention (and no warning)."""

    ignored_warning_kinds = {"skipped-choice", "non-serializable-default"}  # noqa: RUF012

    def encode_default(self, dft: Any) -> Any:
        """A model as default is built first (`defer_build`): pydantic before 2.14 does not."""
        if isinstance(dft, BaseModel):
            type(dft).model_rebuild()
        return super().encode_default(dft)


def json_schema() -> dict[str, Any]:
    """JSON Schema (2020-12); quantities are numbers (SI) or text with a unit."""
    schema = _without_null(Document.model_json_schema(schema_generator=_Quiet))
    definitions = schema["$defs"]
    for model in ("Design", "Uncertain"):
        entries = definitions[model]["properties"].pop("entries")
        definitions[model]["additionalProperties"] = entries["additionalProperties"]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def _without_null(node: Any) -> Any:
    """An optional key is left out of a file, never null."""
    if isinstance(node, list):
        return [_without_null(inner) for inner in node]
    if not isinstance(node, dict):
        return node
    kept = {key: _without_null(inner) for key, inner in node.items()}
    if kept.get("default", 0) is None:
        del kept["default"]
    options = [option for option in kept.get("anyOf", ()) if option != {"type": "null"}]
    if len(options) == 1:
        del kept["anyOf"]
        kept = {**options[0], **kept}
    return kept
