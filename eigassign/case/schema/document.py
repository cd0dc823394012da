"""The whole case file as one pydantic model, and its errors as readable findings.

JSON Schema of case files, from the same models that validate them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel, Field, ValidationError
from pydantic.json_schema import GenerateJsonSchema

from eigassign.case.reader import Finding, KeyPath
from eigassign.case.schema.joints import JOINTS
from eigassign.case.schema.links import LINKS, SHAPES, Taper
from eigassign.case.schema.mechanism import Coordinate, Drive, Mechanism
from eigassign.case.schema.study import Design, Expansion, FrequencyProfile, Target, Validation
from eigassign.case.schema.trajectory import (
    FileTrajectory,
    PointTrajectory,
    SampledTrajectory,
    TipTrajectory,
    Trajectories,
)
from eigassign.case.suggestions import listed, shown, suggestion, unknown
from eigassign.case.units import Frozen, FrozenDict, Part, Quantity, keys_of

# --- The whole case file as one pydantic model, and its errors as readable findings


class Document(Part):
    """Everything a case file may hold."""

    title: Annotated[str, Field(min_length=1, max_length=200)]
    reference: Annotated[str, Field(max_length=1000)] | None = None
    mechanism: Mechanism
    coordinates: Annotated[Mapping[str, Coordinate], Frozen] = FrozenDict()
    trajectory: Trajectories | None = None
    design: Design = Design.model_construct()
    expansion: Expansion = Expansion.model_construct()
    targets: tuple[Target, ...] = ()
    validation: Validation = Validation.model_construct()


_TAGGED: dict[object, type[Part]] = {
    **{f"<{name}>": model for name, model in (SHAPES | LINKS | JOINTS).items()},
    "<taper>": Taper,
    "<drive>": Drive,
    "<tip>": TipTrajectory,
    "<file>": FileTrajectory,
    "<samples>": SampledTrajectory,
    "<points>": PointTrajectory,
    "<profile>": FrequencyProfile,
}
_MOST = 200  # errors explained; nobody reads more
_LEAF_TAGS = {"<word>", "<one>", "<list>", "<constant>", "<number>", "<auto>"}
_TAGS = _LEAF_TAGS | set(_TAGGED)


def validated(tree: Mapping[str, object]) -> tuple[Document | None, list[Finding]]:
    """The document, or None and everything the schema has against it."""
    try:
        return Document.model_validate(tree), []
    except ValidationError as error:
        details = error.errors(include_url=False)
        return None, [_finding(e) for e in details[:_MOST] if not _is_echo(e)]


def _is_echo(error: Any) -> bool:
    """Pydantic counts only valid entries; a list that is long enough had other errors."""
    return error["type"] == "too_short" and bool(len(error["input"]) >= error["ctx"]["min_length"])


def _finding(error: Any) -> Finding:
    path = tuple(p for p in error["loc"] if p not in _TAGS and p != "[key]")
    if path[:2] in (("design", "parameters"),):
        path = (path[0], *path[2:])  # in the file the parameters stand directly under `design`
    explain = _EXPLAIN.get(error["type"], _by_message)
    suffix, message = explain(error)
    return (*path, *suffix), message


_Explained = tuple[KeyPath, str]  # keys to append to the path, message


def _by_message(error: Any) -> _Explained:
    return (), f"{error['msg']}, got {shown(error['input'])}"


def _missing(error: Any) -> _Explained:
    *parent, key = error["loc"]
    if isinstance(key, int):
        return (), f"entry {key + 1} is missing"
    field = keys_of(_model_at(parent))[key]
    kinds = [m.dimension for m in field.metadata if isinstance(m, Quantity) and m.dimension]
    return (), "required key is missing" + "".join(f": {kind}" for kind in kinds)


def _extra(error: Any) -> _Explained:
    *parent, key = error["loc"]
    known = keys_of(_model_at(parent))
    return (), f"unknown key{suggestion(key, known)}; allowed: {listed(known)}"


def _model_at(loc: Any) -> type[Part]:
    """Model whose keys stand at ``loc`` (a pydantic location, union tags included)."""
    model: type[Part] = Document
    in_container = False
    for item in loc:
        if in_container:
            in_container = False
        elif item in _TAGGED:
            model = _TAGGED[item]
        elif item in _LEAF_TAGS:
            in_container = item == "<list>"
        else:
            annotation = keys_of(model)[item].annotation
            in_container = get_origin(annotation) in (Mapping, tuple)
            model = next(_parts_in(annotation), model)
    return model


def _parts_in(annotation: object) -> Iterator[type[Part]]:
    if isinstance(annotation, type) and issubclass(annotation, Part):
        yield annotation
    for argument in get_args(annotation):
        yield from _parts_in(argument)


def _choice(key: str, known: Mapping[str, object]) -> Any:
    def explain(error: Any) -> _Explained:
        if not isinstance(error["input"], Mapping):
            return (), f"expected a mapping, got {shown(error['input'])}"
        if key not in error["input"]:
            return (key,), f"required key is missing: one of {listed(known)}"
        value = error["input"][key]
        if not isinstance(value, str):
            return (key,), f"expected one of {listed(known)}, got {shown(value)}"
        return (key,), unknown(key, value, known)

    return explain


def _motion(error: Any) -> _Explained:
    if not isinstance(error["input"], Mapping):
        return (), f"expected a mapping, got {shown(error['input'])}"
    return (), (
        "expected one of the keys tip (path of a link's node), points (point to point), q (joint "
        "samples) or file (CSV); "
        f"got {listed(error['input'])}"
    )


def _expected(what: str) -> Any:
    def explain(error: Any) -> _Explained:
        return (), f"expected {what}, got {shown(error['input'])}"

    return explain


def _text(error: Any) -> _Explained:
    value = error["input"]
    number = isinstance(value, int | float) and not isinstance(value, bool)
    hint = f': write "{value}", in quotes, if that is its name' if number else ""
    return (), f"expected text (in quotes if need be), got {shown(value)}{hint}"


def _literal(error: Any) -> _Explained:
    expected = error["ctx"]["expected"]
    value = error["input"]
    words = expected.replace("'", "").replace(" or ", ", ").split(", ")
    others = {"<word>": "{stiffness: ...}", "<one>": "a list", "<auto>": "a whole number"}
    also = others.get(error["loc"][-1], "")
    also = f", or {also}" if also else ""
    hint = suggestion(value, words) if isinstance(value, str) else ""
    return (), f"expected {expected}{also}, got {shown(value)}{hint}"


_MAPPING = _expected("a mapping (key: value)")
_LIST = _expected("a list")
_EXPLAIN: dict[str, Any] = {
    "quantity": lambda e: ((), e["ctx"]["text"]),
    "at_key": lambda e: (e["ctx"]["keys"], e["ctx"]["text"]),
    "missing": _missing,
    "extra_forbidden": _extra,
    "choice:shape": _choice("shape", SHAPES),
    "choice:link": _choice("type", LINKS),
    "choice:joint": _choice("type", JOINTS),
    "choice:motion": _motion,
    "literal_error": _literal,
    "model_type": _MAPPING,
    "model_attributes_type": _MAPPING,
    "dict_type": _MAPPING,
    "mapping_type": _MAPPING,
    "is_instance_of": _MAPPING,
    "tuple_type": _LIST,
    "bool_type": _expected("true or false"),
    "int_type": _expected("a whole number"),
    "int_from_float": _expected("a whole number"),
    "string_type": _text,
    "string_too_short": _expected("some text"),
    "string_too_long": lambda e: ((), f"is longer than {e['ctx']['max_length']} characters"),
    "too_short": lambda e: (
        (),
        f"needs at least {e['ctx']['min_length']} entries, got {e['ctx']['actual_length']}",
    ),
    "too_long": lambda e: (
        (),
        f"takes at most {e['ctx']['max_length']} entries, got {e['ctx']['actual_length']}",
    ),
    "greater_than_equal": lambda e: ((), f"must be >= {e['ctx']['ge']}, got {shown(e['input'])}"),
    "less_than_equal": lambda e: ((), f"must be <= {e['ctx']['le']}, got {shown(e['input'])}"),
}


# --- JSON Schema of case files, from the same models that validate them


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
    design = definitions["Design"]
    parameters, constraints = (design["properties"][k] for k in ("parameters", "constraints"))
    design["properties"] = {"constraints": constraints}
    design["additionalProperties"] = parameters["additionalProperties"]
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
        kept.update(options[0])
    return kept
