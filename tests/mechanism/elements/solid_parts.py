"""Bars of solid elements, written as gmsh, Abaqus and Nastran write meshes."""

from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from spatial_cases import linkage

METAL = {"youngs_modulus": 70e9, "density": 2700.0, "poissons_ratio": 0.33}
HEX = [(a + k, a + (k + 1) % 4) for a in (0, 4) for k in range(4)] + [(k, k + 4) for k in range(4)]
TET = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
CORNERS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
SIX = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
# the middle nodes of each kind, where a program has another order than Abaqus
GMSH = {10: [0, 1, 2, 3, 5, 4], 20: [0, 3, 8, 1, 9, 2, 10, 11, 4, 7, 5, 6], 4: []}
NASTRAN = {10: range(6), 20: [0, 1, 2, 3, 8, 9, 10, 11, 4, 5, 6, 7], 4: []}


class Bar(NamedTuple):
    """Nodes (n, 3) in m, elements (m, n_nodes) as Abaqus orders nodes, node sets by name."""

    x: np.ndarray
    elements: np.ndarray
    sets: Mapping[str, np.ndarray]


def bar(
    cells: tuple[int, int, int], count: int, size: Any = (0.4, 0.02, 0.03), grading: float = 1.0
) -> Bar:
    """A bar along x from x = 0; with a grading above 1 its cells are shorter towards both ends."""
    a, b, c = size
    edges = ((0.0, a), (-0.5 * b, 0.5 * b), (-0.5 * c, 0.5 * c))
    return blocks(edges, tuple((n,) for n in cells), count, grading=grading)


def blocks(
    edges: Any, cells: Any, count: int, missing: Any = (), grading: float = 1.0, tip: int = 0
) -> Bar:
    """Blocks between ``edges`` of three axes, so many cells in each, some of them ``missing``.

    The root is its start in x, the tip its end in x; with ``tip`` 2 its ends in x and in z.
    """
    kind, bricks = (HEX, [tuple(range(8))]) if count == 20 else (TET, SIX)
    block = [np.repeat(np.arange(len(own)), own) for own in cells]
    places: dict[tuple[int, ...], int] = {}
    elements = []
    for cell in product(*(range(len(own)) for own in block)):
        if tuple(int(own[k]) for own, k in zip(block, cell, strict=True)) in missing:
            continue
        at = 2 * (np.array(cell) + CORNERS)
        for own in bricks:
            corners = at[list(own)]
            middle = [] if count == 4 else [(corners[a] + corners[b]) // 2 for a, b in kind]
            keys = [tuple(map(int, key)) for key in (*corners, *middle)]
            elements.append([places.setdefault(key, len(places)) for key in keys])
    rows, keys = np.array(elements), np.array(list(places)).T
    starts = [2 * np.cumsum([0, *own]) for own in cells]
    x = np.array([np.interp(*each) for each in zip(keys, starts, edges, strict=True)]).T
    length = edges[0][-1]
    s = (x[:, 0] / length) ** grading
    x[:, 0] = length * s / (s + (1.0 - x[:, 0] / length) ** grading)
    for k, (a, b) in enumerate(kind if count != 4 else []):
        middle = rows[:, rows.shape[1] - len(kind) + k]
        x[middle] = 0.5 * (x[rows[:, a]] + x[rows[:, b]])
    ends = {"root": x[:, 0] < 1e-9, "tip": x[:, tip] > edges[tip][-1] - 1e-9}
    if tip:
        ends["root"] = x[:, 0] > length - 1e-9
    return Bar(x, rows, {name: np.flatnonzero(own) for name, own in ends.items()})


def _renumbered(part: Bar, middle: Any) -> np.ndarray:
    first = part.elements.shape[1] - len(middle)
    return np.hstack([part.elements[:, :first], part.elements[:, first:][:, list(middle)]]) + 1


def msh(part: Bar, version: str = "4.1") -> str:
    """gmsh: a surface is a group of points here, one for each node of it."""
    count, n = part.elements.shape[1], len(part.x)
    kind = {4: 4, 10: 11, 20: 17}[count]
    names = "".join(f'0 {k} "{name}"\n' for k, name in enumerate(part.sets, start=1))
    lines = [f"$MeshFormat\n{version} 0 8\n$EndMeshFormat"]
    lines.append(f"$PhysicalNames\n{len(part.sets)}\n{names}$EndPhysicalNames")
    rows = _renumbered(part, GMSH[count]).tolist()
    nodes = [" ".join(f"{v:.17g}" for v in x) for x in part.x]
    if version == "2.2":
        lines += ["$Nodes", str(n), *(f"{k} {x}" for k, x in enumerate(nodes, 1)), "$EndNodes"]
        found = [f"15 2 {k} 1 {i + 1}" for k, own in enumerate(part.sets.values(), 1) for i in own]
        found += [f"{kind} 2 9 1 {' '.join(map(str, row))}" for row in rows]
        lines += ["$Elements", str(len(found)), *(f"{k} {e}" for k, e in enumerate(found, 1))]
        return "\n".join([*lines, "$EndElements\n"])
    lines.append(f"$Entities\n{len(part.sets)} 0 0 1")
    lines += [f"{k} 0 0 0 1 {k} " for k in range(1, 1 + len(part.sets))]
    lines += ["1 0 0 0 1 1 1 1 9 0 ", "$EndEntities", "$Nodes", f"1 {n} 1 {n}", f"3 1 0 {n}"]
    lines += [*map(str, range(1, n + 1)), *nodes, "$EndNodes", "$Elements", "3 0 0 0"]
    key = 0
    for k, own in enumerate(part.sets.values(), 1):
        lines.append(f"0 {k} 15 {len(own)}")
        lines += [f"{(key := key + 1)} {i + 1}" for i in own]
    lines.append(f"3 1 {kind} {len(rows)}")
    lines += [f"{(key := key + 1)} {' '.join(map(str, row))}" for row in rows]
    return "\n".join([*lines, "$EndElements\n"])


def inp(part: Bar, faces: bool = False) -> str:
    """Abaqus; with ``faces`` the tip is a surface of faces of elements."""
    count = part.elements.shape[1]
    lines = ["** a bar", "*NODE, NSET=all"]
    lines += [f"{k}, " + ", ".join(f"{v:.17g}" for v in x) for k, x in enumerate(part.x, 1)]
    lines += [f"*Element, type=C3D{count}{'R' * (count == 20)}, elset=part"]
    for k, row in enumerate(part.elements + 1, 1):
        given = [str(k), *map(str, row.tolist())]
        lines += [", ".join(given[:11]) + "," * (len(given) > 11)]
        lines += [", ".join(given[11:])] * (len(given) > 11)
    for name, own in part.sets.items():
        if not (faces and name == "tip"):
            lines += [f"*NSET, NSET={name}", *(f"{i + 1}," for i in own)]
    if faces:
        lines += ["*SURFACE, NAME=tip, TYPE=ELEMENT", *_faces(part, set(part.sets["tip"].tolist()))]
    return "\n".join([*lines, "*STEP", "*FREQUENCY", "10", "*END STEP\n"])


def _faces(part: Bar, own: set[int]) -> list[str]:
    hexa = [(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)]
    tetra = [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)]
    faces = hexa if part.elements.shape[1] == 20 else tetra
    return [
        f"{k}, S{f}"
        for k, row in enumerate(part.elements.tolist(), 1)
        for f, face in enumerate(faces, 1)
        if {row[c] for c in face} <= own
    ]


def bdf(part: Bar, form: str = "small") -> str:
    """Nastran bulk data in fields of 8 or 16 characters, or free."""
    count, lines = part.elements.shape[1], ["SOL 103", "CEND"]
    for k, own in enumerate(part.sets.values(), 1):
        lines.append(f"SET {k} = " + ",\n ".join(str(i + 1) for i in own))
    lines.append("BEGIN BULK")
    for k, x in enumerate(part.x, 1):
        if form == "small":
            lines.append(f"GRID    {k:<8d}        " + "".join(f"{v:<8.5f}"[:8] for v in x))
        elif form == "large":
            lines.append(f"GRID*   {k:<16d}{'':16s}{x[0]:<16.9E}{x[1]:<16.9E}*")
            lines.append(f"*       {x[2]:<16.9E}")
        else:
            lines.append(f"GRID,{k},," + ",".join(f"{v:.12g}".replace("e", "") for v in x))
    name = "CHEXA" if count == 20 else "CTETRA"
    for k, row in enumerate(_renumbered(part, NASTRAN[count]).tolist(), 1):
        fields = [str(k), "1", *map(str, row)]
        for j in range(0, len(fields), 8):
            head = name if j == 0 else "+"
            if form == "free":
                lines.append(",".join([head, *fields[j : j + 8]]))
            else:
                lines.append(f"{head:8s}" + "".join(f"{v:8s}" for v in fields[j : j + 8]))
    return "\n".join([*lines, "ENDDATA\n"])


def case(folder: Path, part: Bar, held: str = "weld", **more: Any) -> dict[str, Any]:
    """A bar on the ground: welded to a slide that does not move, or free; ``more`` of its keys."""
    (folder / "bar.msh").write_text(msh(part))
    solid = {
        "type": "solid",
        "mesh": str(folder / "bar.msh"),
        "material": "metal",
        "reduce_to": 4e3,
    }
    solid["nodes"] = {"start": {"surface": "root"}, "end": {"surface": "tip"}}
    base = {"type": "prismatic", "base": "ground", "follower": "base.start"}
    return linkage(
        {"base": {"type": "rigid", "mass": 1.0}, "bar": solid | more},
        {
            "slide": base,
            "weld": {"type": "fixed", "base": "base.start", "follower": "bar.start"},
        },
        {"x": {"joint": "slide", "drive": "locked"}},
        materials={"metal": METAL},
        space="spatial",
    ) | {"title": "a bar", "expansion": {"q": [0.0]}}
