"""Content of a case → canonical YAML 1.2 text, in SI and complete, that reads back equal."""

from __future__ import annotations

import re
from collections.abc import Mapping

from eigassign.case.reader import resolve
from eigassign.case.schema.design import RESERVED, Design, Tolerance
from eigassign.case.schema.joints import JointBase
from eigassign.case.schema.mechanism import Body, Spring
from eigassign.case.schema.parts import Part
from eigassign.case.schema.trajectory import AnyTrajectory, Timed

_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_./-]*")
_WIDTH = 90  # characters of a line, so that it is read without turning a page


def to_yaml(content: Mapping[str, object]) -> str:
    """Block style for what is long, flow style for what fits on a line; None is left out."""
    return "".join(_entry(key, plain(value), 0) for key, value in content.items())


def plain(value: object) -> object:
    """Objects → mappings, lists, numbers and text, in the shape of the file."""
    if isinstance(value, Design):
        limits = {k: getattr(value, k) for k in RESERVED}
        return plain({**value.entries, **{k: v for k, v in limits.items() if v}})
    if isinstance(value, Tolerance):
        return value.written()
    if isinstance(value, Part):
        fields = {
            f.alias or name: getattr(value, name) for name, f in type(value).model_fields.items()
        }
        return plain({key: v for key, v in fields.items() if key not in _superfluous(value)})
    if isinstance(value, Mapping):
        return {key: plain(inner) for key, inner in value.items() if inner is not None}
    if isinstance(value, (tuple, list)):
        return [plain(inner) for inner in value]
    return value


def _superfluous(value: Part) -> set[str]:
    """Keys that say nothing: zero offsets from a link's node, the other space's turn, a share of
    time for a timing law that has none, a trajectory that sets nothing."""
    keys = set()
    if isinstance(value, (JointBase, Spring)) and value.orientation is not None:
        keys.add("angle")
    if isinstance(value, JointBase) and value.base != "ground" and not any(value.position or ()):
        keys.add("position")
    if isinstance(value, Body) and not any(value.offset or ()):
        keys.add("offset")
    if isinstance(value, Timed) and value.timing != "trapezoidal":
        keys.add("acceleration_share")
    if isinstance(value, AnyTrajectory) and not value.set:
        keys.add("set")
    return keys


def _entry(key: str, value: object, depth: int) -> str:
    """One ``key: value`` of a block mapping."""
    if value is None:
        return ""
    pad, flow = "  " * depth, _flow(value)
    fits = len(pad) + len(key) + 2 + len(flow) <= _WIDTH
    if isinstance(value, dict) and value and not (fits and depth):
        return f"{pad}{_word(key)}:\n" + "".join(_entry(k, v, depth + 1) for k, v in value.items())
    if isinstance(value, list) and not fits:
        return f"{pad}{_word(key)}:\n" + "".join(_item(v, depth + 1) for v in value)
    return f"{pad}{_word(key)}: {flow}\n"


def _item(value: object, depth: int) -> str:
    """One entry of a block list; of a long mapping the first key stands beside the dash."""
    pad, flow = "  " * depth, _flow(value)
    if not isinstance(value, dict) or len(pad) + 2 + len(flow) <= _WIDTH:
        return f"{pad}- {flow}\n"
    inner = "".join(_entry(k, v, depth + 1) for k, v in value.items())
    return f"{pad}- {inner.removeprefix(pad + '  ')}"


def _flow(value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_word(k)}: {_flow(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_flow(v) for v in value) + "]"
    return _word(value) if isinstance(value, str) else repr(value)


def _word(text: str) -> str:
    """``text`` as it is where YAML reads it back as text, else in double quotes."""
    if _PLAIN.fullmatch(text) and resolve(text) == text:
        return text
    escaped = (c if c.isprintable() else f"\\U{ord(c):08x}" for c in text)
    return '"' + "".join("\\" + c if c in '"\\' else c for c in escaped) + '"'
