"""Bytes → plain data with the line and column of every key; the words of messages about it.

The tree is built straight from the parser's events, so depth is bounded before anything recurses
(libyaml's own composer overflows the C stack on deep nesting). Mappings become dicts, sequences
tuples; numbers, booleans and nulls follow the YAML 1.2 core schema (`1e3` is a number, `no`, `on`
and `12:30` are text, `012` is twelve).
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from itertools import accumulate, islice
from pathlib import PurePath
from typing import Any, NamedTuple, NoReturn

import yaml

from eigassign.errors import CaseError, Problem
from eigassign.files import CASE, printable, raised

_LONGEST = 60  # characters of a value: half a line of a message
_SYNONYMS = {  # what others call it
    **dict.fromkeys(("hinge", "pin", "pivot", "rotary", "rotation", "rotational"), "revolute"),
    **dict.fromkeys(("slider", "linear", "translation", "translational", "sliding"), "prismatic"),
    **dict.fromkeys(("ball", "sphere"), "spherical"),
    **dict.fromkeys(("cardan", "hooke"), "universal"),
    **dict.fromkeys(("weld", "welded", "clamp", "clamped", "rigid"), "fixed"),
    **dict.fromkeys(("helical", "lead_screw", "leadscrew"), "screw"),
    **dict.fromkeys(("world", "base", "fixed", "gnd"), "ground"),
    **dict.fromkeys(("round", "rod", "cylinder", "solid_circle"), "circle"),
    **dict.fromkeys(("pipe", "hollow", "ring"), "tube"),
    **dict.fromkeys(("square", "rect"), "rectangle"),
    **dict.fromkeys(("rhs", "shs", "hollow_rectangle", "square_tube", "rectangular_tube"), "box"),
    **dict.fromkeys(("e", "e_modulus", "modulus", "young", "youngs"), "youngs_modulus"),
    "rho": "density",
    **dict.fromkeys(("nu", "poisson", "poissons"), "poissons_ratio"),
}
_BESIDE = re.compile(
    r"[lcuzt]|u[pn][pne]\d*|.*(\bangle|channel|\b[lcuzt][-_ ]?(profile|section)).*"
)
_TWISTED = (
    ": no beam here has a section that bends out of the plane of its load or twists (its shear "
    "centre is not its centroid); where it is held from both write shape: bare with area and "
    "inertias, else the part as a link of type solid"
)
_MOST_NAMES = 20  # of those that are known: two lines of a message
_MOST_CANDIDATES = 200  # names compared with a misspelt one: keeps hostile files cheap


def shown(value: object) -> str:
    """A value as the file would write it, cut short."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) and not math.isfinite(value):
        return f".{value}".replace(".-", "-.")
    if isinstance(value, Mapping):
        return "a mapping"
    if isinstance(value, (tuple, list)):
        return "a list"
    if isinstance(value, int) and abs(value) >= 10**_LONGEST:
        return "a number of more than 60 digits"
    return short(repr(value))


def short(text: str, longest: int = _LONGEST) -> str:
    """``text``, cut short."""
    return text if len(text) <= longest else text[: longest - 1] + "…"


def suggestion(name: str, known: Iterable[str]) -> str:
    """``"; did you mean 'x'?"`` when something known is close, else nothing."""
    candidates = list(islice(known, _MOST_CANDIDATES))
    close = get_close_matches(name[:_LONGEST], candidates, n=1, cutoff=0.6)
    if "i_profile" in candidates and _BESIDE.fullmatch(name.lower()):
        return _TWISTED
    if _SYNONYMS.get(name.lower()) in candidates:
        close = [_SYNONYMS[name.lower()]]
    return f"; did you mean {close[0]!r}?" if close else ""


def listed(names: Iterable[str]) -> str:
    """Names for a message, at most twenty of them."""
    all_names = [short(printable(name)) for name in islice(names, _MOST_NAMES + 1)]
    more = ", …" if len(all_names) > _MOST_NAMES else ""
    return ", ".join(all_names[:_MOST_NAMES]) + more if all_names else "none"


def unknown(kind: str, name: str, known: Iterable[str]) -> str:
    """Sentence for a name that does not exist: closest match, and all that do exist."""
    names = list(known)
    return f"unknown {kind} {shown(name)}{suggestion(name, names)}; known: {listed(names)}"


MAX_DEPTH = 50  # levels; a case has ten, and Python calls itself a thousand times
COMMA = "decimals take a point, not a comma"
_TOO_DEEP = f"nested more than {MAX_DEPTH} levels deep"
ENTRIES = 200_000  # of all lists and mappings: some seconds and 400 MB, whatever is wrong with them
KeyPath = tuple[str | int, ...]
Tree = Mapping[str, object]
Finding = tuple[KeyPath, str]  # where, and what is wrong there

_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_INT = re.compile(r"[-+]?[0-9]+")
_BASED = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
NUMBER = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?")
_SPECIAL = re.compile(r"[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)")
_WORDS: dict[str, bool | None] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}
_UNSPACED = re.compile(r"([A-Za-z_]\w*):([^\s/:].*)")  # length:300; no https://, no a::b
_UNPRINTABLE = re.compile(
    r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x84\x86-\x9f\ud800-\udfff\ufeff\ufffe\uffff]"
)


class Mark(NamedTuple):
    """Position of one node (1-based; a mapping's value is found at its key) and of its children."""

    line: int
    column: int
    children: Mapping[str | int, Mark] | None = None

    def find(self, path: KeyPath) -> Mark:
        """Mark of the deepest existing node on ``path``."""
        mark = self
        for key in path:
            if mark.children is None or key not in mark.children:
                break
            mark = mark.children[key]
        return mark


class Source(NamedTuple):
    """One file as plain data, its marks, and the problems that did not keep it from being read."""

    file: str
    tree: Mapping[str, object]
    marks: Mark
    problems: tuple[Problem, ...] = ()

    def problem(self, path: KeyPath, message: str) -> Problem:
        """Problem at the line and column of ``path``, or of the nearest key that exists."""
        mark = self.marks.find(path)
        return Problem(self.file, mark.line, mark.column, dotted(path), message)


_MEANT = re.compile(r"unknown key; did you mean '(.*?)'")
_UNKNOWN = re.compile(r"(?:unknown (?!key)[a-z ]+|expected .*, got) '([^']*)'; did you mean")


def told_once(findings: Sequence[Finding]) -> list[Finding]:
    """Findings without those that others explain.

    A mistyped key is not missing too, and one that says what a part is explains all else there. A
    name that does not exist is told once, with the other places.
    """
    typed = {path: m[1] for path, message in findings if (m := _MEANT.match(message))}
    missing = {(*path[:-1], meant) for path, meant in typed.items()}
    kinds = {path[:-1]: path for path, meant in typed.items() if meant in ("shape", "type")}
    told: dict[object, Finding] = {}
    for path, message in findings:
        if path in missing or kinds.get(path[:-1], path) != path:
            continue
        name = _UNKNOWN.match(message)
        key = name[1] if name else (path, message)
        first, said = told.get(key, (path, message))
        told[key] = first, said + f"; also at {dotted(path)}" * (path != first)
    return [*told.values()]


def dotted(path: KeyPath) -> str:
    """``("targets", 0, "mode")`` → ``"targets[0].mode"``."""
    parts = (
        f"[{p}]"
        if isinstance(p, int)
        else f".{p if p.isprintable() and len(p) <= 80 else shown(p)}"
        for p in path
    )
    return "".join(parts).removeprefix(".")


def resolve(text: str) -> object:
    """Value of a plain (unquoted) scalar under the YAML 1.2 core schema."""
    if text in _WORDS:
        return _WORDS[text]
    if _INT.fullmatch(text):
        return int(text) if len(text) < 400 else float(text)
    if NUMBER.fullmatch(text):
        return float(text)
    if _BASED.fullmatch(text):
        return int(text, 0) if len(text) < 400 else float("inf")
    if _SPECIAL.fullmatch(text):
        return float(text.replace(".", "").lower())
    return text


def read_yaml(data: bytes, file: str) -> Source:
    """Parse one YAML document whose root is a mapping. Raises CaseError on anything unreadable."""
    text = _decoded(data, file)
    builder = _Builder(file)
    try:
        tree, marks = builder.document(yaml.parse(text, Loader=_LOADER))
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        raise CaseError((_syntax_problem(error, text, file),)) from None
    if not isinstance(tree, dict):
        what = "the file is empty" if tree is None else f"the file holds {shown(tree)}"
        message = f"{what}: expected keys such as title, mechanism, coordinates{unspaced(tree)}"
        raise CaseError((Problem(file, 1, 1, "", message),))
    return Source(file, tree, marks, tuple(builder.problems))


def _decoded(data: bytes, file: str) -> str:
    if len(data) > raised(CASE):
        message = f"larger than {raised(CASE) / 1e6:g} MB: put long trajectories into a CSV file"
        raise CaseError((Problem(file, 1, 1, "", message),))
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line, column = _position(data[: error.start].decode("utf-8", "replace"))
        message = f"not UTF-8 text (byte 0x{data[error.start]:02x}): save the file as UTF-8"
        raise CaseError((Problem(file, line, column, "", message),)) from None
    bad = _UNPRINTABLE.search(text)
    if bad:
        line, column = _position(text[: bad.start()])
        message = f"control character U+{ord(bad.group()):04X}: is this a text file?"
        raise CaseError((Problem(file, line, column, "", message),))
    return text


def _position(before: str) -> tuple[int, int]:
    return before.count("\n") + 1, len(before) - (before.rfind("\n") + 1) + 1


def _syntax_problem(error: Exception, text: str, file: str) -> Problem:
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    line, column = (mark.line + 1, mark.column + 1) if mark else (1, 1)
    parts = (getattr(error, "context", None), getattr(error, "problem", None))
    reason = ", ".join(p for p in parts if p) or "the file cannot be read"
    if "nesting depth" in reason:  # PyYAML's own limit, from 6.0.4 on
        depths = accumulate((c in "[{") - (c in "]}") for c in text)
        deep = next((i for i, depth in enumerate(depths) if depth > MAX_DEPTH), 0)
        return Problem(file, *_position(text[:deep]), "", _TOO_DEEP)
    return Problem(file, line, column, "", f"not valid YAML: {reason}{_hint(reason, text, line)}")


def _hint(reason: str, text: str, line: int) -> str:
    lines = text.splitlines()
    nearby = lines[max(line - 2, 0) : line]
    if any("\t" in row[: len(row) - len(row.lstrip())] for row in nearby) or r"\t" in reason:
        return "; a tab cannot indent YAML: use spaces"
    if hint := next(filter(None, map(unspaced, nearby)), ""):
        return hint
    if "mapping values are not allowed" in reason:
        return "; check the indentation, and quote text that contains ': '"
    if "could not find expected ':'" in reason:
        return "; a key needs ': ' behind it"
    return "; check brackets, quotes and indentation"


def unspaced(value: object) -> str:
    """A hint, where text such as ``length:300`` was meant as a key and its value; else nothing."""
    match = _UNSPACED.match(value.lstrip(" -{")) if isinstance(value, str) else None
    if match is None:
        return ""
    key, rest = match.groups()
    meant = f"{key}: {rest.partition(',')[0].rstrip('}] ')}"
    return f"; a blank is missing behind the colon: write {shown(meant)}"


class _Builder:
    """Builds the tree from parser events; gathers what can be reported together."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.room = raised(ENTRIES)
        self.problems: list[Problem] = []

    def document(self, events: Iterator[Any]) -> tuple[object, Mark]:
        """Root node of the only document; None for an empty file."""
        tree: object = None
        marks = Mark(1, 1)
        for event in events:
            if isinstance(event, yaml.DocumentStartEvent) and self.room < raised(ENTRIES):
                self._refuse(event, (), "a second document starts here: one case per file")
            if isinstance(event, yaml.NodeEvent):
                tree, marks = self.node(event, events, (), Mark(1, 1))
        return tree, marks

    def node(self, event: Any, events: Iterator[Any], path: KeyPath, at: Mark) -> tuple[Any, Mark]:
        """One node, found at ``at``; ``event`` is its first event."""
        self.room -= 1
        if self.room < 0:
            most = f"more than {raised(ENTRIES):g} entries"
            self._refuse(event, (), f"{most}: put long tables into CSV files")
        if len(path) > MAX_DEPTH:
            self._refuse(event, (), _TOO_DEEP)
        if isinstance(event, yaml.AliasEvent) or event.anchor is not None:
            message = "anchors (&) and aliases (*) are refused: write the value out"
            self._refuse(event, path, message)
        if getattr(event, "tag", None) is not None:
            self._refuse(event, path, "tags (!) are refused: write the plain value")
        if isinstance(event, yaml.MappingStartEvent):
            return self._mapping(events, path, at)
        if isinstance(event, yaml.SequenceStartEvent):
            return self._sequence(events, path, at)
        return (event.value if event.style else resolve(event.value)), at

    def _sequence(self, events: Iterator[Any], path: KeyPath, at: Mark) -> tuple[Any, Mark]:
        values: list[object] = []
        marks: dict[str | int, Mark] = {}
        for event in events:
            if isinstance(event, yaml.SequenceEndEvent):
                break
            i = len(values)
            value, marks[i] = self.node(event, events, (*path, i), _mark(event))
            values.append(value)
        return tuple(values), Mark(at.line, at.column, marks)

    def _mapping(self, events: Iterator[Any], path: KeyPath, at: Mark) -> tuple[Any, Mark]:
        values: dict[str, object] = {}
        marks: dict[str | int, Mark] = {}
        number = ""  # of the entry before
        for event in events:
            if isinstance(event, yaml.MappingEndEvent):
                break
            place, rest = _mark(event), getattr(event, "value", "")
            key, _ = self.node(event, events, (*path, "?"), place)
            event = next(events)
            value, mark = self.node(event, events, (*path, str(key)[:80]), place)
            if value is None and number.lstrip("-+").isdecimal() and rest[:1].isdecimal():
                number, (last, there) = f"{number}.{rest}", marks.popitem()
                values[str(last)], marks[last] = resolve(number), there
                where, why = dotted((*path, last)), f"{COMMA}: write {number}"
                self.problems.append(Problem(self.file, there.line, there.column, where, why))
                continue
            usable = self._usable(key, values, marks, path, place)
            number = getattr(event, "value", "") if usable else ""
            if usable and value is None and (hint := unspaced(key)):
                key, _, rest = key.partition(":")
                value, where = resolve(rest), dotted((*path, key))
                found = Problem(self.file, place.line, place.column, where, hint.removeprefix("; "))
                self.problems.append(found)
            if usable:
                values[key], marks[key] = value, mark
        return values, Mark(at.line, at.column, marks)

    def _usable(
        self, key: object, seen: dict[str, object], marks: dict[Any, Mark], path: KeyPath, at: Mark
    ) -> bool:
        if not isinstance(key, str):
            number = isinstance(key, (int, float)) and not isinstance(key, bool)
            comma = f" ({COMMA})" if number else ""
            message = f"keys must be text, got {shown(key)}: put it in quotes{comma}"
        elif key in seen:
            message = f"{shown(key)} is given twice; first in line {marks[key].line}"
        else:
            return True
        where = dotted((*path, key) if isinstance(key, str) else path)
        self.problems.append(Problem(self.file, at.line, at.column, where, message))
        return False

    def _refuse(self, event: Any, path: KeyPath, message: str) -> NoReturn:
        mark = _mark(event)
        raise CaseError((Problem(self.file, mark.line, mark.column, dotted(path), message),))


def _mark(event: Any) -> Mark:
    return Mark(event.start_mark.line + 1, event.start_mark.column + 1)


# --- A mapping in memory instead of a file


def read_mapping(given: Mapping[Any, Any], name: str) -> Source:
    """A case given as nested mappings, sequences, text and numbers; arrays count as sequences.

    Its marks have no lines. Raises CaseError naming everything that no file could hold.
    """
    found: list[Finding] = []
    tree = _plain(given, (), found)
    if found:
        raise CaseError(tuple(Problem(name, 0, 0, dotted(path), why) for path, why in found))
    return Source(name, tree, Mark(0, 0))


def _plain(value: Any, path: KeyPath, found: list[Finding]) -> Any:
    """``value`` as the reader of files would give it; what cannot be in a file is ``found``."""
    if len(path) > MAX_DEPTH:
        found.append((path, _TOO_DEEP))
        return None
    if hasattr(value, "tolist"):  # an array, or a number out of one
        value = value.tolist()
    if isinstance(value, Mapping):
        wrong = {k for k in value if not isinstance(k, str) or _UNPRINTABLE.search(k)}
        found += ((path, f"keys must be printable text, got {shown(key)}") for key in wrong)
        kept = ((key, inner) for key, inner in value.items() if key not in wrong)
        return {key: _plain(inner, (*path, key), found) for key, inner in kept}
    if isinstance(value, (list, tuple)):
        return tuple(_plain(inner, (*path, k), found) for k, inner in enumerate(value))
    if value is None or isinstance(value, (bool, int, float)):
        return value
    if isinstance(value, (str, PurePath)) and not _UNPRINTABLE.search(str(value)):
        return str(value)
    what = "other" if isinstance(value, str) else f"a {type(value).__name__}"
    text = "printable text, a number, a mapping or a sequence"
    found.append((path, f"expected {text}, got {what}"))
    return None


def entries(node: object, *keys: str) -> Mapping[str, object]:
    """The mapping below ``keys`` of a tree; an empty one where there is none."""
    for key in keys:
        node = node.get(key) if isinstance(node, Mapping) else None
    return node if isinstance(node, Mapping) else {}


# --- Other values of some keys: a dotted key, `targets.0.frequency`, is a path into the file

_BRACKET = re.compile(r"\[(\d+)\]")


def key_path(tree: Tree, key: str) -> KeyPath:
    """The path that a dotted key means in the file; what is not there is taken as it is written.

    Where a name holds dots itself, as the paths below `set` do, the longest that is there is meant.
    """
    parts, path = _BRACKET.sub(r".\1", key).split("."), list[str | int]()
    node: Any = tree
    while parts:
        if isinstance(node, tuple) and parts[0].isdecimal():
            step: str | int = int(parts[0])
        else:
            names = (".".join(parts[:n]) for n in range(len(parts), 0, -1))
            known = node if isinstance(node, Mapping) else {}
            step = next((name for name in names if name in known), parts[0])
        path.append(step)
        del parts[: str(step).count(".") + 1]
        node = value_below(node, step)
    return tuple(path)


def short_keys(keys: Iterable[str], least: int = 1) -> dict[str, str]:
    """The end of each key, of so many parts at least, that no other key has; else the whole key."""
    parts = {key: key.rsplit(".", 10) for key in keys}
    ends = {
        key: [".".join(p[-n:]) for n in range(least, len(p)) if not p[-n].isdecimal()]
        for key, p in parts.items()
    }
    counts = Counter(end for own in ends.values() for end in own)
    return {key: next((e for e in own if counts[e] == 1), key) for key, own in ends.items()}


def value_below(node: Any, step: str | int) -> Any:
    """The value below one step of a path, or None."""
    if isinstance(node, tuple):
        return node[step] if isinstance(step, int) and step < len(node) else None
    return node.get(step) if isinstance(node, Mapping) else None


def with_values(tree: Tree, values: Mapping[str, object]) -> Tree:
    """``tree`` with these values at these keys, and without its sweep."""
    changed: Any = {key: body for key, body in tree.items() if key != "sweep"}
    for key, value in values.items():
        changed = _with(changed, key_path(tree, key), value)
    whole: Tree = changed
    return whole


def _with(node: Any, path: KeyPath, value: object) -> Any:
    if not path:
        return value
    step, inner = path[0], _with(value_below(node, path[0]), path[1:], value)
    if isinstance(node, tuple) and isinstance(step, int):
        return (*node[:step], inner, *node[step + 1 :])
    return {**(node or {}), step: inner}
