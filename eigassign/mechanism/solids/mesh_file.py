"""A mesh of solid elements from a file: gmsh (.msh), Abaqus and CalculiX (.inp), Nastran (.bdf).

The format is recognised by its content. Elements of lines and surfaces name nodes and do nothing
else; solid ones of other kinds than `KINDS` are refused by name. Such files come from anywhere:
their size is bounded before they are read, and messages quote names of formats only.
"""

from __future__ import annotations

import io
import itertools
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from eigassign.arrays import Floats, Ints
from eigassign.files import MESH, how_to_raise, raised, read_bytes
from eigassign.mechanism.imports.entries import LARGEST, UnfitError
from eigassign.mechanism.imports.parts import guarded
from eigassign.mechanism.imports.programs import CARD, fields_of
from eigassign.mechanism.solids.elements import KINDS

LONGEST = 10_000  # characters of a line: far more than a card or a name
MOST = 100_000  # nodes: a factor of a cube of so many takes 9 GB

_MESH_WITH = "; mesh with tetrahedra of 10 nodes (or of 4), or hexahedra of 20"
_ALONE = (
    ", which is not read: save the elements alone; couplings, masses and springs stand in the case"
)
_EDGES = {  # of each kind, where a format has another order than Abaqus
    ("gmsh", 10): ((0, 1), (1, 2), (2, 0), (3, 0), (2, 3), (1, 3)),
    ("gmsh", 20): (
        *((0, 1), (0, 3), (0, 4), (1, 2), (1, 5), (2, 3)),
        *((2, 6), (3, 7), (4, 5), (4, 7), (5, 6), (6, 7)),
    ),
    ("Nastran", 20): (
        *((0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 5), (2, 6), (3, 7)),
        *((4, 5), (5, 6), (6, 7), (7, 4)),
    ),
}


class Joined(NamedTuple):
    """How a file couples a set to a node of its own, at ``place`` (3,)."""

    place: Floats
    rigid: bool
    alike: bool = False  # each node of the set counts as much, and not by its share of the area


@dataclass(frozen=True, eq=False)
class SolidMesh:
    """Nodes in the file's unit of length, solid elements by their number of nodes, sets of nodes.

    Nodes within elements are in the order of `KINDS`; those of no element are left out. What the
    file couples to a node is a set too.
    """

    x: Floats  # (n, 3)
    elements: dict[int, Ints]  # (m, number of nodes)
    sets: dict[str, Ints]
    joined: dict[str, Joined]

    def pieces(self, most: int) -> Iterator[tuple[int, Ints]]:
        """The elements with their number of nodes, so many at a time at most."""
        for count, rows in self.elements.items():
            for k in range(0, len(rows), max(most, 1)):
                yield count, rows[k : k + max(most, 1)]


@dataclass
class _Raw:
    """What is collected while a file is read: nodes and elements by id, sets of node ids."""

    nodes: dict[int, tuple[float, ...]] = field(default_factory=dict)
    elements: dict[int, list[int]] = field(default_factory=dict)
    sets: dict[str, set[int]] = field(default_factory=dict)
    joined: dict[str, tuple[int, bool, bool]] = field(default_factory=dict)  # by id: see `Joined`

    def stand(self, node: int, place: tuple[float, ...]) -> None:
        """A node at a place; raises UnfitError where it stands at another one."""
        if self.nodes.setdefault(node, place) != place:
            raise UnfitError(f"defines node {node % _OWN} twice, at different places")

    def add(self, name: str, nodes: Iterable[int]) -> None:
        self.sets.setdefault(name, set()).update(nodes)


def read_mesh(file: Path, key: str) -> SolidMesh:
    """The mesh in a file; raises MechanismError at ``key`` for what is none, or has other elements.

    The sets are gmsh's physical groups, Abaqus' node sets, element sets and surfaces, Nastran's
    sets, and ``pid N`` of its surface elements of property N.
    """
    return guarded(lambda: _read(read_bytes(file, MESH)), file, key, "damaged, or breaks off")


@lru_cache(maxsize=4)  # a case reads its meshes for each model anew
def _read(data: bytes) -> SolidMesh:
    if re.match(rb"\s*\$MeshFormat\s+\S+\s+1\s", data):
        raise UnfitError("is binary: save it as ASCII (in gmsh Mesh.Binary = 0)")
    if any(len(line) > LONGEST for line in io.BytesIO(data)):
        raise UnfitError(f"has a line of more than {LONGEST} characters, which no mesh has")
    head = data[:100_000].upper()
    if data.lstrip().startswith(b"$MeshFormat"):
        raw, program = _gmsh(data.decode("utf-8", "replace")), "gmsh"
    elif re.search(rb"^\s*\*(NODE|HEADING|PART|INCLUDE)\b", head, re.MULTILINE):
        raw, program = _abaqus(data.decode("utf-8", "replace")), "Abaqus"
    elif re.search(rb"^(BEGIN\s+BULK|GRID[ *,])", head, re.MULTILINE):
        raw, program = _nastran(data.decode("utf-8", "replace")), "Nastran"
    else:
        raise UnfitError(
            "is no mesh that is known: expected gmsh's .msh (ASCII, 2.2 or 4.1), Abaqus' or "
            "CalculiX's .inp, or Nastran bulk data (.bdf)"
        )
    return _numbered(raw, program)


def _numbered(raw: _Raw, program: str) -> SolidMesh:
    """Nodes by place instead of id, and those within elements in one order."""
    if not raw.elements and program == "gmsh" and raw.sets:
        raise UnfitError(
            "has no solid elements: gmsh saves what is in a physical group alone, so add a "
            "Physical Volume, or save with Mesh.SaveAll = 1"
        )
    if not raw.elements:
        raise UnfitError("has no solid elements" + _MESH_WITH)
    used = sorted({node for nodes in raw.elements.values() for node in nodes})
    if len(used) > raised(MOST):
        most = f"more than {raised(MOST):g} are not read; {how_to_raise(len(used), MOST)}"
        raise UnfitError(f"has {len(used)} nodes: {most}")
    place = {node: k for k, node in enumerate(used)}
    if missing := place.keys() - raw.nodes.keys():
        raise UnfitError(f"has elements with nodes that it does not define, as {min(missing)}")
    x = np.array([raw.nodes[node] for node in used], dtype=np.float64)
    if not (np.abs(x) < LARGEST).all():
        raise UnfitError("has nodes at infinite places")
    found = {}
    for count, kind in KINDS.items():
        own = {key: nodes for key, nodes in raw.elements.items() if len(nodes) == count}
        if own:
            order = list(range(count))
            if (edges := _EDGES.get((program, count))) is not None:
                given = {frozenset(edge): k for k, edge in enumerate(edges, len(kind.corners))}
                order[len(kind.corners) :] = [given[frozenset(edge)] for edge in kind.edges]
            rows = np.array([[place[node] for node in nodes] for nodes in own.values()])
            found[count] = _checked(x, rows[:, order], count, list(own))
    sets = {
        name: np.array(sorted(place[node] for node in nodes if node in place), dtype=np.intp)
        for name, nodes in raw.sets.items()
    }
    if missing := {node for node, *_ in raw.joined.values()} - raw.nodes.keys():
        raise UnfitError(f"couples nodes to one that it does not define, {min(missing) % _OWN}")
    joined = {
        name: Joined(np.array(raw.nodes[node], dtype=np.float64), *kind)
        for name, (node, *kind) in raw.joined.items()
        if len(sets[name])
    }
    return SolidMesh(x, found, {name: own for name, own in sets.items() if len(own)}, joined)


def _checked(x: Floats, elements: Ints, count: int, ids: Sequence[int]) -> Ints:
    """Elements with their nodes outside in where they were inside out."""
    kind, n = KINDS[count], len(KINDS[count].corners)
    for k, (a, b) in enumerate(kind.edges, n):
        ends = x[elements[:, a]], x[elements[:, b]]
        off = np.linalg.norm(x[elements[:, k]] - 0.5 * (ends[0] + ends[1]), axis=1)
        # an arc of a half circle bulges by half its chord; in a wrong order it is far more
        far = off > 0.6 * np.linalg.norm(ends[1] - ends[0], axis=1)
        if far.any():
            raise UnfitError(
                f"has an element, {ids[int(far.argmax())]}, whose middle nodes are not between "
                "its corners: they are missing, or in another order than its format has"
            )
    beside = (1, 3, 4) if count == 20 else (1, 2, 3)  # the first one, along ξ, η and ζ
    corners = x[elements[:, (0, *beside)]]
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1])
    return np.where((volume < 0.0)[:, None], elements[:, kind.turned()], elements)


# --- gmsh

_GMSH = {4: 4, 11: 10, 17: 20}
_GMSH_NODES = {15: 1, 1: 2, 8: 3, 2: 3, 9: 6, 3: 4, 10: 9, 16: 8, 20: 9, 21: 10, 26: 4, 27: 5}
_GMSH_OTHER = {
    5: "hexahedra of 8 nodes",
    6: "wedges of 6 nodes",
    7: "pyramids of 5 nodes",
    12: "hexahedra of 27 nodes (save with Mesh.SecondOrderIncomplete = 1)",
    13: "wedges of 18 nodes",
    14: "pyramids of 14 nodes",
    18: "wedges of 15 nodes",
    19: "pyramids of 13 nodes",
}


def _gmsh(text: str) -> _Raw:
    sections = dict(re.findall(r"^\$(\w+)\s*\n(.*?)^\$End\1", text, re.MULTILINE | re.DOTALL))
    version = sections["MeshFormat"].split()[0]
    if version not in ("2.2", "4.1"):
        raise UnfitError("is of a version of gmsh's format that is not read: save as 4.1 or 2.2")
    named = re.findall(r'^\s*(\d+)\s+(\d+)\s+"(.*)"', sections.get("PhysicalNames", ""), re.M)
    names = {(int(dim), int(tag)): name for dim, tag, name in named}
    raw = _Raw()

    def add(dim: int, tags: Iterable[int], kind: int, key: int, nodes: list[int]) -> None:
        if kind in _GMSH:
            raw.elements[key] = nodes
        elif kind not in _GMSH_NODES:
            raise UnfitError(f"has {_GMSH_OTHER.get(kind, 'elements of high order')}{_MESH_WITH}")
        for tag in tags:
            raw.add(names.get((dim, tag), str(tag)) if dim < 3 else "", nodes)

    if version == "2.2":
        for row in sections["Nodes"].splitlines()[1:]:
            tag, *x = row.split()
            raw.nodes[int(tag)] = tuple(map(float, x))
        for row in sections["Elements"].splitlines()[1:]:
            key, kind, count, physical, *rest = map(int, row.split())
            dim = 0 if kind == 15 else 1 if kind in (1, 8, 26, 27) else 2
            nodes = rest[count - 1 :]
            add(3 if kind in _GMSH else dim, [physical] if physical else [], kind, key, nodes)
    else:
        _gmsh_4(sections, raw, add)
    raw.sets.pop("", None)
    return raw


def _gmsh_4(
    sections: dict[str, str],
    raw: _Raw,
    add: Callable[[int, Iterable[int], int, int, list[int]], None],
) -> None:
    physical: dict[tuple[int, int], list[int]] = {}
    rows = iter(sections.get("Entities", "0 0 0 0").splitlines())
    for dim, count in enumerate(map(int, next(rows).split())):
        for _ in range(count):
            entity = next(rows).split()
            first = 4 if dim == 0 else 7
            own = entity[first + 1 : first + 1 + int(entity[first])]
            physical[dim, int(entity[0])] = [abs(int(tag)) for tag in own]
    rows = iter(sections["Nodes"].splitlines()[1:])
    for row in rows:
        count = int(row.split()[3])
        tags = [int(next(rows)) for _ in range(count)]
        for tag in tags:
            raw.nodes[tag] = tuple(map(float, next(rows).split()[:3]))
    rows = iter(sections["Elements"].splitlines()[1:])
    for row in rows:
        dim, tag, kind, count = map(int, row.split())
        for _ in range(count):
            key, *nodes = map(int, next(rows).split())
            add(dim, physical.get((dim, tag), ()), kind, key, nodes)


# --- Abaqus and CalculiX

_ABAQUS = {"C3D4": 4, "C3D10": 10, "C3D20": 20}
_JOINED = (
    *("TIE", "MPC", "EQUATION", "CONTACT PAIR", "CONTACT", "DISTRIBUTING COUPLING", "SPRING"),
    *("NONSTRUCTURAL MASS", "EMBEDDED ELEMENT", "SHELL TO SOLID COUPLING", "MODEL CHANGE"),
    *(
        "FOUNDATION",
        "MATRIX INPUT",
        "MATRIX ASSEMBLE",
        "REBAR",
        "SUBSTRUCTURE PROPERTY",
        "FASTENER",
    ),
    *("SURFACE SECTION", "PRE-TENSION SECTION", "CYCLIC SYMMETRY MODEL", "CONNECTOR SECTION"),
)
_MADE = (
    *("SYSTEM", "NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "ADJUST", "IMPERFECTION"),
    *("IMPORT", "SYMMETRIC MODEL GENERATION"),
)
_OWN = 10**10  # is added to the numbers of an assembly's nodes: parts count theirs from 1 too
_COUPLED = ("RIGID BODY", "KINEMATIC COUPLING", "KINEMATIC", "DISTRIBUTING")
_FLAT = re.compile(r"(CPS|CPE|CAX|S[3468]|STRI|M3D|SFM3D|T2D|T3D|B[23]|R3D|DC2D|AC2D)")


def _abaqus(text: str) -> _Raw:
    raw, groups = _Raw(), _Raw()
    blocks = list(_keywords(text))
    words = [word for word, *_ in blocks if word in ("PART", "ELEMENT", "INSTANCE")]
    if sum(pair == ("PART", "ELEMENT") for pair in itertools.pairwise(words)) > 1:
        raise UnfitError("holds several parts: save the one part alone")
    if words.count("INSTANCE") > 1:
        raise UnfitError("holds several instances of parts: save the one part alone")
    _require_one(
        {options.get("MATERIAL") for word, options, _ in blocks if word == "SOLID SECTION"}
    )
    coupled, couplings, outside = dict[str, str](), list[Any](), False
    scopes = dict[tuple[str, str], bool]()
    for word, options, lines in blocks:
        if word in ("ASSEMBLY", "INSTANCE", "END INSTANCE", "END ASSEMBLY"):
            outside = word in ("ASSEMBLY", "END INSTANCE")  # of its part
        own_number = _OWN if outside and "INSTANCE" not in options else 0
        rows = [[entry.strip() for entry in line.split(",")] for line in lines]
        if word == "INCLUDE" or (word in ("NODE", "ELEMENT") and "INPUT" in options):
            raise UnfitError("includes other files: save the mesh in one")
        if word == "INSTANCE" and any(float(entry or 0.0) for entry in itertools.chain(*rows)):
            raise UnfitError("moves or turns its part as an instance: save the part alone")
        for key in ("NSET", "ELSET", "NAME") if word in ("NSET", "ELSET", "SURFACE") else ():
            if key in options and scopes.setdefault((key, options[key]), outside) != outside:
                raise UnfitError("has a set of one name in its part and its assembly: rename one")
        if word in _JOINED:
            raise UnfitError(f"has *{word}{_ALONE}")
        if word in _MADE or options.get("SYSTEM", "R") != "R":
            raise UnfitError(f"has *{word} that makes or moves nodes or elements: write them out")
        if options.get("WEIGHTING METHOD", "UNIFORM") != "UNIFORM" or "INFLUENCE RADIUS" in options:
            raise UnfitError(f"has *{word} with weights or a radius of its own{_ALONE}")
        if word == "NODE":
            for row in rows:
                place = (*(float(v or 0.0) for v in row[1:4]), 0.0, 0.0)[:3]
                raw.stand(int(row[0]) + own_number, place)
            raw.add(options.get("NSET", ""), (int(row[0]) + own_number for row in rows))
        elif word == "ELEMENT":
            _abaqus_elements(raw, groups, options, rows)
        elif word in ("NSET", "ELSET"):
            target = raw if word == "NSET" else groups
            first = own_number if word == "NSET" else 0
            target.add(options[word], _members(target, rows, "GENERATE" in options, first))
        elif word == "SURFACE":
            raw.add(options["NAME"], _surface(raw, groups, options, rows))
        elif word == "COUPLING":
            coupled = options
        elif word in _COUPLED:
            own = coupled if word in ("KINEMATIC", "DISTRIBUTING") else options
            couplings.append((word, own, rows, own_number))
    for name, ids in raw.sets.items():  # an assembly may name nodes of its only part
        raw.sets[name] = {n if n in raw.nodes else n % _OWN for n in ids}
    for each in couplings:
        _abaqus_coupling(raw, groups, *each)
    for name, elements in groups.sets.items():  # of elements, where no set of nodes has the name
        if name not in raw.sets:
            both = (raw.elements.get(key) or groups.elements.get(key, []) for key in elements)
            raw.add(name, (node for nodes in both for node in nodes))
    raw.sets.pop("", None)
    return raw


def _keywords(text: str) -> Iterator[tuple[str, dict[str, str], list[str]]]:
    """Each keyword with its options and the lines of data below it; names in capitals."""
    lines = [line.strip() for line in text.splitlines()]
    lines = [line for line in lines if line and not line.startswith("**")]
    starts = [k for k, line in enumerate(lines) if line.startswith("*")]
    for k, end in zip(starts, [*starts[1:], len(lines)], strict=True):
        head, first = lines[k], k + 1
        while head.endswith(",") and first < end:
            head, first = head + lines[first], first + 1
        word, *given = (part.strip() for part in head[1:].split(","))
        pairs = [part.partition("=") for part in given]
        options = {key.strip().upper(): value.strip().strip('"').upper() for key, _, value in pairs}
        yield word.upper(), options, lines[first:end]


def _abaqus_elements(
    raw: _Raw, groups: _Raw, options: dict[str, str], rows: list[list[str]]
) -> None:
    kind = options["TYPE"]
    count = next((n for name, n in _ABAQUS.items() if re.fullmatch(f"{name}[A-Z]*", kind)), 0)
    if not count and not _FLAT.match(kind):
        named = "wedges" if kind.startswith(("C3D6", "C3D15")) else "elements"
        raise UnfitError(f"has {named} of type {kind[:12]!r}{_MESH_WITH}")
    entries = [[int(entry) for entry in row if entry] for row in rows]
    if count:
        flat = np.array([n for row in entries for n in row])  # an element may take several lines
        for key, *nodes in flat.reshape(-1, count + 1).tolist():
            raw.elements[key] = nodes
            groups.add(options.get("ELSET", ""), [key])
        return
    for key, *nodes in entries:
        groups.elements[key] = nodes
        groups.add(options.get("ELSET", ""), [key])


def _abaqus_coupling(
    raw: _Raw, groups: _Raw, word: str, options: dict[str, str], rows: list[list[str]], first: int
) -> None:
    """A set that follows a node, under its constraint's name, or ``node 12`` of that node."""
    (node,) = _members(raw, [[options["REF NODE"]]], False, first)
    if word == "KINEMATIC COUPLING":
        own, freedoms = _members(raw, [row[:1] for row in rows], False), [row[1:] for row in rows]
    else:
        keys = ("NSET", "PIN NSET", "TIE NSET", "SURFACE")
        named = (options[k] for k in keys if k in options)
        sets = (raw.sets.get(n, raw.sets.get(n.rpartition(".")[2], ())) for n in named)
        own = set[int]().union(*sets)
        for key in groups.sets[options["ELSET"]] if options.get("ELSET") in groups.sets else ():
            own.update(raw.elements.get(key, groups.elements.get(key, [])))
        freedoms = rows if word in ("KINEMATIC", "DISTRIBUTING") else []
    ends = [[int(entry) for entry in row[:2] if entry] for row in freedoms]
    held = {k for row in filter(None, ends) for k in range(row[0], row[-1] + 1)}
    if not own:
        raise UnfitError(f"has *{word} of a set that it does not define")
    if any(ends) and not held >= ({1, 2, 3, 4, 5, 6} if word == "DISTRIBUTING" else {1, 2, 3}):
        raise UnfitError(f"has *{word} of some directions alone{_ALONE}")
    node = node if node in raw.nodes else node % _OWN
    name = options.get("CONSTRAINT NAME", f"node {node % _OWN}")
    raw.add(name, own)
    raw.joined[name] = (node, word != "DISTRIBUTING", False)


def _members(groups: _Raw, rows: list[list[str]], generate: bool, first_id: int = 0) -> set[int]:
    """Ids of a set: numbers, counted from ``first_id``, ranges, or other sets."""
    found: set[int] = set()
    for row in rows:
        given = [entry for entry in row if entry]
        if generate:
            first, last, step = (*map(int, given), 1)[:3]
            _require_few((last - first) // max(step, 1))
            found.update(range(first_id + first, first_id + last + 1, step))
        else:
            for entry in given:
                plain = entry.upper().rpartition(".")[2]  # without the name of an instance
                known = groups.sets.get(entry.upper(), groups.sets.get(plain, ()))
                number = plain.lstrip("-").isdigit()
                own = first_id if plain == entry else 0
                found.update([int(plain) + own] if number else known)
    return found


def _require_few(count: int) -> None:
    if count > 10 * raised(MOST):
        raise UnfitError(f"has a set of {count} members, more than it can have nodes")


def _surface(raw: _Raw, groups: _Raw, options: dict[str, str], rows: list[list[str]]) -> set[int]:
    """Nodes of a surface: of faces of elements, or by themselves."""
    found: set[int] = set()
    for name, *side in rows:
        if options.get("TYPE", "ELEMENT") == "NODE":
            found |= _members(raw, [[name]], False)
            continue
        face = re.fullmatch(r"S(\d)", (side or [""])[0].upper())
        for key in _members(groups, [[name]], False):
            nodes = raw.elements.get(key)
            if nodes is None:
                found.update(groups.elements.get(key, ()))
            elif face is not None:
                found.update(nodes[k] for k in KINDS[len(nodes)].face(int(face[1]) - 1))
    return found


# --- Nastran bulk data

_JOINS = re.compile(  # elements and joins that are not taken, glue and contact among them
    r"C[A-Z]|RB[AE]|RROD|RTRPLT|RSPLINE|RSSCON|RJOINT|MPC|NSM|GENEL|DMIG|BSURF|BCTSET|BGSET|BGADD"
    r"|BCONTACT|BCONP|BCBODY|BCTABLE|BCPROP|BCTADD|BEDGE|BFRIC"
)
_PASSED = ("CORD1R", "CORD2R", "CORD1C", "CORD2C", "CORD1S", "CORD2S")
_NASTRAN = {"CTETRA": 4, "CHEXA": 8, "CPENTA": 6, "CPYRAM": 5, "CPYRA": 5}
_SURFACES = ("CTRIA3", "CTRIA6", "CQUAD4", "CQUAD8", "CTRIAR", "CQUADR")


def _nastran(text: str) -> _Raw:
    start = re.search(r"^BEGIN\s+BULK.*$", text, re.MULTILINE | re.IGNORECASE)
    control, bulk = ("", text) if start is None else (text[: start.start()], text[start.end() :])
    raw, materials, sets = _Raw(), set[str | None](), dict(_controlled(control))
    for name, values in _cards(bulk):
        if name == "INCLUDE":
            raise UnfitError("includes other files: save the mesh in one")
        if name == "BEGIN":
            raise UnfitError("holds several superelements (BEGIN SUPER): save the one part alone")
        if name == "GRDSET" and values[1] not in ("", "0"):
            raise UnfitError("has GRDSET with a coordinate system (CP): save nodes in 0")
        if name == "GRID":
            if values[1] not in ("", "0"):
                raise UnfitError("has nodes in a coordinate system of their own (CP): save in 0")
            try:
                x = tuple(_real(value) for value in (*values[2:5], "", "", "")[:3])
            except ValueError:
                raise UnfitError(f"has GRID {values[0]} at a place that is no number") from None
            raw.stand(int(values[0]), x)
        elif name in _NASTRAN:
            nodes = [int(value) for value in values[2:] if value]
            if (name, len(nodes)) not in (("CTETRA", 4), ("CTETRA", 10), ("CHEXA", 20)):
                raise UnfitError(f"has {name} of {len(nodes)} nodes{_MESH_WITH}")
            raw.elements[int(values[0])] = nodes
        elif name in _SURFACES:
            n = (4 if "QUAD" in name else 3) * (2 if name in ("CTRIA6", "CQUAD8") else 1)
            raw.add(f"pid {int(values[1])}", (int(v) for v in values[2 : 2 + n] if v))
        elif name == "SET1":
            sets[values[0]] = values[1:]
        elif name in ("RBE2", "RBE3"):
            _nastran_coupling(raw, name, values)
        elif name == "PSOLID":
            materials.add(values[1])
        elif name not in _PASSED and _JOINS.match(name):
            raise UnfitError(f"has {name[:8]}{_ALONE}")
    _require_one(materials)
    for number, entries in sets.items():
        raw.add(number, _listed(entries, raw.nodes))
    return raw


def _nastran_coupling(raw: _Raw, name: str, values: list[str]) -> None:
    """RBE2: EID, GN, CM, nodes, α. RBE3: EID, –, REFGRID, REFC, w, C, nodes, …, UM, …."""
    given = list(itertools.takewhile(lambda v: v.upper() not in ("UM", "ALPHA"), values))
    if name == "RBE2":
        (node, freedoms, *rest), weights = given[1:], set[str]()
    else:
        node, reference, *rest = given[2:]
        weights = {value for value in rest if "." in value}
        starts = [k for k, value in enumerate(rest) if "." in value]
        freedoms = min((rest[k + 1] for k in starts), key=len)
        freedoms = freedoms if {*reference} >= {*"123456"} else ""
        rest = [v for k, v in enumerate(rest) if k - 1 not in starts and k not in starts]
    if not set(freedoms) >= set("123") or len(set(map(_real, weights))) > 1:
        raise UnfitError(f"has {name} of some directions alone, or of several weights{_ALONE}")
    key = f"{name} {int(values[0])}"
    raw.add(key, _listed((v for v in rest if "." not in v), raw.nodes))
    raw.joined[key] = (int(node), name == "RBE2", name == "RBE3")


def _controlled(control: str) -> list[tuple[str, list[str]]]:
    """Number and entries of each SET of the case control, which goes on behind a comma."""
    lines = (line.split("$", 1)[0].strip() for line in control.splitlines())
    whole = re.sub(r",\s*\n", ",", "\n".join(filter(None, lines)))
    found = re.findall(r"^SET\s+(\d+)\s*=(.*)", whole, re.MULTILINE | re.IGNORECASE)
    return [(number, re.split(r"[,\s]+", entries)) for number, entries in found]


def _require_one(materials: set[str | None]) -> None:
    if len(materials) > 1:
        raise UnfitError(
            f"is of {len(materials)} materials: save a mesh of each, a link of its own"
        )


def _listed(entries: Iterable[str], known: Collection[int]) -> set[int]:
    """Ids: 1, 5 THRU 10, 5 THRU 10 BY 2, 5 THRU 10 EXCEPT 7, 8, ALL; none of reals and names."""
    words = [entry.upper() for entry in entries if entry]
    if not all(re.fullmatch(r"\d{1,9}|THRU|BY|EXCEPT|ALL|NONE", word) for word in words):
        return set()
    found, first, last, before = set[int](), 0, -1, ""
    for word in words:
        if not word.isdigit():
            before = word
            if word == "ALL":
                found.update(known)
                last = max(known, default=-1)
        elif before == "EXCEPT" and int(word) <= last:
            found.discard(int(word))
        elif before == "THRU":
            last, before = int(word), ""
            _require_few(last - first)
            found.update(range(first, last + 1))
        elif before == "BY":
            found.difference_update(
                set(range(first, last + 1)) - set(range(first, last + 1, int(word) or 1))
            )
            before = ""
        else:
            first, last, before = int(word), -1, ""
            found.add(first)
    return found


def _cards(bulk: str) -> Iterator[tuple[str, list[str]]]:
    """Name and fields of each card, without comments."""
    lines = (line.split("$", 1)[0].rstrip() for line in bulk.splitlines())
    for card in CARD.finditer("\n".join(filter(None, lines)).encode("ascii", "replace")):
        own = (cell.decode().strip() for cell in fields_of(card.group()).tolist())
        yield card.group(1).decode().upper(), list(own)


def _real(value: str) -> float:
    """A number as Nastran writes it: 1.5-3 is 1.5e-3."""
    return float(re.sub(r"(?<=[\d.])([-+]\d)", r"e\1", value.replace("D", "E"))) if value else 0.0
