"""Write the manual's reference: keys and fields of results from schemas, commands from the cli.

`python page_builder/reference.py` writes keys.md, commands.md and results.md in
eigassign/docs/reference. What a key is for stands in the docstring of its model in
`eigassign.case.schema`, what a command does in that of its function in `eigassign.cli`, what a
field of results is at the field of its row (`eigassign.facts`).
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click

from eigassign.case import json_schema
from eigassign.case.units import DIMENSIONS
from eigassign.cli import cli, results_schema
from eigassign.output import NUMBERS

FOLDER = Path(__file__).parents[1] / "eigassign" / "docs" / "reference"
SCHEMA = json_schema()
Node = dict[str, Any]

# --- Keys


@dataclass(frozen=True)
class Section:
    """A heading of the page: a mapping of the case file, a kind of it, or what all kinds share."""

    level: int
    heading: str
    path: str  # "" of a kind: it is that of the heading above
    node: Node
    kinds: tuple[str, ...] = ()  # titles of the definitions below this heading
    others: dict[str, str] | None = None  # keys that an earlier kind explains, and its heading


def keys() -> str:
    """The page of all keys."""
    every = sections("", "Top level", [("", SCHEMA)], 2, set())
    found = [replace(section, heading=section.heading.rstrip(", ")) for section in every]
    headings: list[str] = []
    for k, section in enumerate(found):  # alike below two kinds: told apart by what they need
        if section.heading in headings:
            needed = section.node.get("required", ["other keys"])[0]
            found[k] = replace(section, heading=f"{section.heading}, with {needed}")
        headings.append(found[k].heading)
    assert len(headings) == len(set(headings)), "two headings are alike"
    anchors = {title: anchor(s.heading) for s in reversed(found) for title in s.kinds}
    parts = [KEYS.format(units=units()), *(shown(section, anchors) for section in found)]
    return "\n\n".join(parts) + "\n"


KEYS = """# Keys of a case file

[The case file](../case-file.md) says how they work together. `<name>` is a name that you choose,
`<link>.<node>` a node of a link, {{…}} a mapping with keys of its own. A key without a default may
be left out, unless it is required.

A bare number is in SI units; text may carry another unit:

| quantity | bare | also | from | to |
|---|---|---|---|---|
{units}

Sizes beyond these are no mechanism's, and are refused. 0 stays 0; what may be negative may be
as small as 10⁻⁶⁰."""


def units() -> str:
    """One line for each quantity that a key can hold."""
    asked = str(SCHEMA)
    rows = [
        f"| {d.name} | {d.si or '1'} | {d.examples} | {power(d.smallest)} | {power(d.largest)} |"
        for d in DIMENSIONS.values()
        if str(d) in asked
    ]
    return "\n".join(rows)


def power(number: float) -> str:
    """``10⁶``."""
    exponent = f"{number:.0e}".partition("e")[2]
    return "10" + f"{int(exponent)}".translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def sections(
    path: str, heading: str, kinds: list[tuple[str, Node]], level: int, seen: set[str]
) -> Iterator[Section]:
    """That of a mapping, or what its kinds share and then each of them; each only once."""
    earlier: dict[tuple[str, str], str] = {}
    titles = tuple(node["title"] for _, node in kinds)
    several = len(kinds) > 1
    if several:
        first, *others = (node["properties"] for _, node in kinds)
        common = {k: v for k, v in first.items() if all(o.get(k) == v for o in others)}
        earlier = {(key, str(node)): "" for key, node in common.items()}
        required = kinds[0][1].get("required", ())
        yield Section(level, heading, path, {"properties": common, "required": required}, titles)
        yield from below(path, common, level + 1, seen)
    for title, node in kinds:
        name = f"{heading}, {title}" if several else heading
        listed = {(key, str(inner)): key for key, inner in node["properties"].items()}
        others = {key: earlier[pair] for pair, key in listed.items() if pair in earlier}
        yield Section(level + several, name, "" if several else path, node, titles, others)
        earlier |= {pair: name for pair in listed if pair not in earlier}
        own = {k: v for k, v in node["properties"].items() if k not in others}
        if isinstance(entries := node.get("additionalProperties"), dict):
            own = {"<name>": entries, **own}
        yield from below(path, own, level + several + 1 if path else 2, seen, title)


def below(
    path: str, properties: Node, level: int, seen: set[str], kind: str = ""
) -> Iterator[Section]:
    """The sections of what stands below some keys; a heading that is taken says of which kind."""
    for key, node in properties.items():
        names = [name for name in dict.fromkeys(references(node)) if name not in seen]
        seen |= set(names)
        if names:
            named = ".<name>" if "additionalProperties" in node else ""
            whole = f"{path}.{key}{'[]' if node.get('type') == 'array' else named}".strip(".")
            heading = f"entries of {path}" if key == "<name>" else key
            heading = f"{heading}, {kind}" if f"# {heading}" in seen else heading
            seen.add(f"# {heading}")
            yield from sections(whole, heading, list(told_apart(names)), level, seen)


def references(node: Any) -> Iterator[str]:
    """Names of the definitions that a value may be."""
    if isinstance(node, dict):
        if "$ref" in node:
            yield node["$ref"].rpartition("/")[2]
        node = list(node.values())
    if isinstance(node, list):
        for inner in node:
            yield from references(inner)


def told_apart(names: list[str]) -> Iterator[tuple[str, Node]]:
    """Each kind with what tells it from the others: `type: beam`, or a key that only it needs."""
    nodes = [SCHEMA["$defs"][name] for name in names]
    for node in nodes:
        others = {k for other in nodes if other is not node for k in other.get("required", ())}
        words = [f"{k}: {v['const']}" for k, v in node["properties"].items() if "const" in v]
        required = node.get("required", ())
        words += [f"with {k}" for k in required if k not in others] or [
            f"with {k}" for k in required
        ]
        yield next(iter(words), ""), node


def anchor(heading: str) -> str:
    """Of a heading, as the common hosts make it."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def shown(section: Section, anchors: dict[str, str]) -> str:
    """Heading, place, what it is, and a table of its keys."""
    node, others = section.node, section.others or {}
    said = [" ".join(p.split()) for p in node.get("description", "").split("\n\n")]
    place = f"`{section.path}`" if section.path else ""
    if node is not SCHEMA:
        said[0] = ": ".join(filter(None, (place, said[0])))
    else:
        said = []
    required = node.get("required", ())
    listed = [k for k, v in node["properties"].items() if k not in others and "const" not in v]
    rows = [
        row(key, node["properties"][key], key in required, anchors)
        for key in sorted(listed, key=lambda key: key not in required)
    ]
    if rows:
        said.append("\n".join(["| key | value | default | content |", "|---|---|---|---|", *rows]))
    for heading in dict.fromkeys(filter(None, others.values())):
        same = ", ".join(f"`{key}`" for key, other in others.items() if other == heading)
        said.append(f"{same}: as of [{heading}](#{anchor(heading)}).")
    if groups := [" and ".join(f"`{k}`" for k in g["required"]) for g in node.get("anyOf", ())]:
        said.append(f"Needs {', or '.join(groups)}.")
    return "\n\n".join(filter(None, [f"{'#' * section.level} {section.heading}", *said]))


def row(key: str, node: Node, required: bool, anchors: dict[str, str]) -> str:
    """One line of a table."""
    content, _, holds = node["description"].partition("\n\n")
    value = alternatives(values({**node, "description": holds}, anchors))
    default = "required" if required else written(node.get("default"))
    return f"| `{key}` | {value} | {default} | {content} |".replace("|  |", "| |")


def written(default: Any) -> str:
    """A default as a file has it."""
    if default is None or isinstance(default, (dict, list)):
        return ""
    if isinstance(default, bool):
        return str(default).lower()
    return f"{default:.3g}" if isinstance(default, float) else f"{default}"


def alternatives(words: Iterator[str]) -> str:
    """Each once."""
    return " or ".join(dict.fromkeys(words))


def values(node: Node, anchors: dict[str, str]) -> Iterator[str]:
    """What a key may hold, in words, one after the other."""
    kind = node.get("type")
    if "$ref" in node:
        yield f"[{{…}}](#{anchors[SCHEMA['$defs'][node['$ref'].rpartition('/')[2]]['title']]})"
    elif holds := node.get("description"):
        yield limited(
            UNITS.get(holds, re.sub(" when bare, as.*", "", holds)), [node, *node.get("anyOf", ())]
        )
    elif options := node.get("oneOf", node.get("anyOf")):
        for option in options:
            yield from values(option, anchors)
    elif "const" in node:
        yield f"`{node['const']}`"
    elif "enum" in node:
        yield from (f"`{word}`" for word in node["enum"])
    elif kind == "array":
        inner = alternatives(values(node.get("items") or node["prefixItems"][0], anchors))
        yield f"[{', '.join([inner] * len(node.get('prefixItems', ())) or [inner, '…'])}]"
    elif kind == "object" or "additionalProperties" in node:
        yield f"`<name>`: {alternatives(values(node['additionalProperties'], anchors))}"
    elif kind == "boolean":
        yield from ("`true`", "`false`")
    elif kind in ("integer", "number"):
        yield limited("whole number" if kind == "integer" else "number", [node])
    else:
        yield "text"


UNITS = {str(d): d.si or d.name for d in DIMENSIONS.values()}
_WHATEVER = {d.largest for d in DIMENSIONS.values()}


def limited(what: str, nodes: list[Node]) -> str:
    """With the limits that are not those of its dimension."""
    limits = {key: value for node in nodes for key, value in node.items()}
    signs = {"exclusiveMinimum": ">", "minimum": "≥", "exclusiveMaximum": "<", "maximum": "≤"}
    known = {k: sign for k, sign in signs.items() if k in limits}
    kept = [f"{s} {limits[k]:g}" for k, s in known.items() if abs(limits[k]) not in _WHATEVER]
    return " ".join([what, ", ".join(kept)]).strip()


# --- Commands

COMMANDS = """# Commands

`eigassign COMMAND --help` shows the same. [The command line](../command-line.md) says what output,
reports, run folders and the cache are; the [README](../../../README.md#commands) lists the exit
codes."""


def commands() -> str:
    """The page of all commands."""
    every = dict(paths(cli, "eigassign"))
    used = Counter(option for name, each in every.items() for option in options(each, name))
    shared = [option for option, count in used.items() if count > 2]
    parts = [COMMANDS, *(described(name, each, shared) for name, each in every.items())]
    parts.append("## Options of several commands\n\n" + tabulated(shared))
    return "\n\n".join(parts) + "\n"


def paths(group: click.Group, name: str) -> Iterator[tuple[str, click.Command]]:
    """Every command with its whole name."""
    for word, command in group.commands.items():
        yield f"{name} {word}", command
        if isinstance(command, click.Group):
            yield from paths(command, f"{name} {word}")


def options(command: click.Command, name: str) -> list[tuple[str, str]]:
    """Each option as the help shows it, and its effect, as cells of a table."""
    context = command.make_context(name, [], resilient_parsing=True)
    given = [p for p in command.params if isinstance(p, click.Option)]
    records = [record for p in given if (record := p.get_help_record(context))]
    return [(f"`{names}`".replace("|", "\\|"), marked(effect)) for names, effect in records]


def marked(text: str) -> str:
    """One line; what has a placeholder, such as results/<case>, and $VARIABLES as code."""
    return re.sub(r"[\w/.]*<\w+>[\w/.]*(?<!\.)|\$[A-Z_]+", r"`\g<0>`", " ".join(text.split()))


def tabulated(found: list[tuple[str, str]]) -> str:
    """A table of options."""
    rows = [f"| {names} | {effect} |" for names, effect in found]
    return "\n".join(["| option | effect |", "|---|---|", *rows])


def described(name: str, command: click.Command, shared: list[tuple[str, str]]) -> str:
    """Usage, what it does, its options, and examples."""
    context = command.make_context(name, [], resilient_parsing=True)
    usage = " ".join([name, *command.collect_usage_pieces(context)])
    text = [f"## {name}", f"`{usage}`"]
    text += [marked(paragraph) for paragraph in (command.help or "").split("\n\n")]
    found = options(command, name)
    if own := [option for option in found if option not in shared]:
        text.append(tabulated(own))
    if others := [option[0] for option in found if option in shared]:
        listed = ", ".join(f"`{re.findall('--[a-z-]+', names)[0]}`" for names in others)
        text.append(f"[As of others](#options-of-several-commands): {listed}.")
    for block in (command.epilog or "").split("\n\n"):
        head, *lines = block.removeprefix("\b\n").splitlines()
        language = "bash" if head == "Examples:" else "text"
        text.append("\n".join([f"```{language}", *(line[2:] for line in lines), "```"]))
    return "\n\n".join(filter(None, text))


# --- Results

FILES = {
    "run": "results.json of a run",
    "update": "results.json of an update",
    "batch": "summary.json",
    "chart": "chart.json",
    "charts": "matrix.json of several charts",
}
PLURALS = {"array": "list", "object": "mapping"}
WORDS = {"string": "text", "boolean": "true or false", "integer": "whole number", "null": "null"}
RESULTS = """# Fields of result files

A field is null where there is no such number; what is optional is left out then. Numbers are in SI
units; a fraction of 0.01 is 1 %. {…} is an object with fields of its own. `eigassign schema run`
prints the same as a JSON Schema for programs; so do `update`, `batch`, `chart` and `charts`."""


def results() -> str:
    """The page of all fields of the files of results; what several files have is explained once."""
    parts, seen = [RESULTS], set[str]()
    for left_by, heading in FILES.items():
        schema = results_schema(left_by)
        parts.append(f"## {heading}")
        for k, (name, node) in enumerate(schema["$defs"].items()):
            if (row := titled(name)) not in seen:
                parts += [f"### {row}", *fields_of(node)] if k else fields_of(node)
            seen.add(row)
    return "\n\n".join(parts) + "\n"


def titled(name: str) -> str:
    """``design row`` for DesignRow: the heading of a row, whether its numbers may lack or not."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name.removesuffix("WithGaps")).lower()


def fields_of(node: Node) -> list[str]:
    """What a row is, and a table of its fields."""
    said = [" ".join(p.split()) for p in node["description"].replace("``", "`").split("\n\n")]
    rows = [
        f"| `{key}` | {alternatives(held(n))} | {n.get('unit', '')} | {words}{optional} |"
        for key, n in node["properties"].items()
        for words in [n["description"] if n["description"] != key.replace("_", " ") else ""]
        for optional in ["" if key in node["required"] else " (optional)"]
    ]
    table = ["| field | value | unit | content |", "|---|---|---|---|", *rows]
    return [*said, re.sub(r"\| +(?=\|)", "| ", "\n".join(table))]


def held(node: Node) -> Iterator[str]:
    """What a field may hold, in words, one after the other."""
    if node.get("items") == NUMBERS["items"]:
        yield "list of numbers"
        return
    if "$ref" in node:
        yield f"[{{…}}](#{anchor(titled(node['$ref'].rpartition('/')[2]))})"
    for option in node.get("anyOf", ()):
        yield from held(option)
    yield from (f"`{word}`" for word in node.get("enum", ()))
    kinds = node.get("type", ())
    for kind in [kinds] if isinstance(kinds, str) else kinds:
        inner = [node.get("items", node.get("additionalProperties", {}))]
        each = [w for one in node.get("prefixItems", inner) for w in held(one) if w != "null"]
        of = f" of {', '.join(dict.fromkeys(each))}" if each else ""
        yield f"{PLURALS[kind]}{of}" if kind in PLURALS else WORDS.get(kind, kind)


PAGES = {"keys.md": keys, "commands.md": commands, "results.md": results}


if __name__ == "__main__":
    for page, made in PAGES.items():
        (FOLDER / page).write_text(made(), encoding="utf-8")
