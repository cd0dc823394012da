"""Couplings, sets and what is missing in meshes of Nastran, Abaqus and gmsh."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from solid_parts import Bar, bar, bdf, case, inp, msh

import eigassign as ea
from eigassign.errors import MechanismError
from eigassign.mechanism import read_mesh

SIZE = (0.3, 0.03, 0.02)
ROOT, TIP = (-0.02, 0.0, 0.0), (0.35, 0.0, 0.0)


def frequencies(mesh: Path, start: Any, end: Any, mass: float = 0.3) -> np.ndarray:
    """Four of a part that is held at its start, with a mass at its end."""
    ends = {"start": start, "end": end}
    tree = case(mesh.parent, bar((1, 1, 1), 4), mesh=str(mesh), nodes=ends, reduce_to=1e5)
    tree["mechanism"] |= {"gravity": "none", "bodies": {"tip": {"at": "bar.end", "mass": mass}}}
    return ea.load_case(tree, allow_outside=True).model().frequencies([0.0], [], 4)[0]


def point(key: int, x: tuple[float, float, float]) -> str:
    return f"{key}, " + ", ".join(f"{v:g}" for v in x)


def abaqus(part: Bar, of_root: str, of_tip: str) -> str:
    n = len(part.x)
    nodes = f"*NODE\n{point(n + 1, ROOT)}\n{point(n + 2, TIP)}\n"
    return inp(part).split("*STEP")[0] + nodes + of_root.format(n + 1) + of_tip.format(n + 2)


BODY = "*RIGID BODY, NSET={}, REF NODE={{}}, ROT NODE=1\n"
COUPLING = "*SURFACE, NAME=s_{0}, TYPE=NODE\n{0}\n*COUPLING, REF NODE={{}}, SURFACE=s_{0}, "
KINEMATIC = COUPLING + "CONSTRAINT NAME=c_{0}\n*KINEMATIC\n1,3\n"
WRITTEN = {
    "rigid bodies": (BODY, ("node 118", "node 119")),
    "couplings": (KINEMATIC, ("c_root", "c_tip")),
    "couplings by their surfaces": (KINEMATIC, ("s_root", "s_tip")),
    "old couplings": ("*KINEMATIC COUPLING, REF NODE={{}}\n{0}, 1, 3\n", ("node 118", "node 119")),
}


@pytest.mark.parametrize("kind", WRITTEN)
def test_rigid_couplings_of_abaqus_are_calculix_ones(tmp_path: Path, kind: str) -> None:
    """CalculiX 2.20 printed these frequencies for the deck with rigid bodies and for couplings."""
    text, names = WRITTEN[kind]
    part = bar((6, 2, 2), 10, SIZE)
    names = tuple(n.replace("118", f"{len(part.x) + 1}") for n in names)
    names = tuple(n.replace("119", f"{len(part.x) + 2}") for n in names)
    (tmp_path / "bar.inp").write_text(abaqus(part, text.format("root"), text.format("tip")))
    found = frequencies(tmp_path / "bar.inp", *({"surface": name} for name in names))
    np.testing.assert_allclose(found, PRINTED_HZ, rtol=1e-4)


def test_reference_points_of_an_assembly_are_no_nodes_of_its_part(tmp_path: Path) -> None:
    """As CAE writes it: both count from 1, and neither elements nor nodes have a set."""
    part = bar((6, 2, 2), 10, SIZE)
    body = inp(part).split("*STEP")[0].replace("*NODE, NSET=NALL", "*NODE")
    own, text = (
        body.partition("*NSET"),
        "*ASSEMBLY, NAME=A\n*INSTANCE, NAME=P-1, PART=P\n*END INSTANCE\n",
    )
    for k, (name, x) in enumerate({"root": ROOT, "tip": TIP}.items(), 1):
        text += f"*NODE\n{point(k, x)}\n*NSET, NSET=rp{k}\n{k},\n"
        nodes = "\n".join(f"{node + 1}," for node in part.sets[name])
        text += f"*NSET, NSET=face{k}, INSTANCE=P-1\n{nodes}\n"
        text += f"*SURFACE, NAME=s{k}, TYPE=NODE\nP-1.face{k}\n"
        text += f"*COUPLING, CONSTRAINT NAME=c{k}, REF NODE=rp{k}, SURFACE=s{k}\n*KINEMATIC\n"
    elements = re.sub(r"(\*ELEMENT, TYPE=\w+)[^\n]*", r"\1", own[0])
    (tmp_path / "cae.inp").write_text(f"*PART, NAME=P\n{elements}*END PART\n{text}*END ASSEMBLY\n")
    found = frequencies(tmp_path / "cae.inp", {"surface": "c1"}, {"surface": "c2"})
    np.testing.assert_allclose(found, PRINTED_HZ, rtol=1e-4)


PRINTED_HZ = [83.43403, 124.6408, 667.6601, 980.7447]


def nastran(part: Bar, *cards: str) -> str:
    n = len(part.x)
    ends = [f"GRID,{n + k},,{','.join(f'{v:g}' for v in x)}" for k, x in ((1, ROOT), (2, TIP))]
    return bdf(part, "large").replace("ENDDATA", "\n".join([*ends, *cards, "ENDDATA"]))


def listed(nodes: np.ndarray, first: list[str]) -> str:
    fields = [*first, *(str(k + 1) for k in nodes)]
    rows = [",".join(fields[k : k + 8]) for k in range(0, len(fields), 8)]
    return "\n,".join(rows)


@pytest.mark.parametrize("freedoms", ["123456", "123"])
def test_rbe2_is_a_rigid_coupling(tmp_path: Path, freedoms: str) -> None:
    part = bar((6, 2, 2), 10, SIZE)
    n = len(part.x)
    cards = (
        f"RBE2,{listed(own, [str(k), str(n + k), freedoms])}"
        for k, own in enumerate(part.sets.values(), 1)
    )
    (tmp_path / "bar.bdf").write_text(nastran(part, *cards))
    found = frequencies(tmp_path / "bar.bdf", {"surface": "RBE2 1"}, {"surface": "rbe2 2"})
    np.testing.assert_allclose(found, PRINTED_HZ, rtol=1e-4)


def test_rbe3_follows_the_mean_of_its_nodes(tmp_path: Path) -> None:
    """With every node of the surface counted alike: by hand from K of the free part."""
    part = bar((4, 1, 1), 10, SIZE)
    n, tip = len(part.x), part.sets["tip"]
    cards = [f"RBE2,{listed(part.sets['root'], ['1', str(n + 1), '123'])}"]
    cards += [f"RBE3,{listed(tip, ['2', '', str(n + 2), '123456', '1.0', '123'])}"]
    (tmp_path / "bar.bdf").write_text(nastran(part, *cards))
    ends = {"surface": "RBE2 1"}, {"surface": "RBE3 2"}
    found = frequencies(tmp_path / "bar.bdf", *ends)
    mesh = read_mesh(tmp_path / "bar.bdf", "mesh")
    assert not mesh.joined["RBE3 2"].rigid
    # a surface of nodes that counts by area is another one
    (tmp_path / "part.msh").write_text(msh(part))
    place = {"position": list(TIP), "coupling": "distributing"}
    by_area = frequencies(
        tmp_path / "part.msh",
        {"surface": "root", "position": list(ROOT)},
        {"surface": "tip", **place},
    )
    assert found == pytest.approx(by_area, rel=0.05)
    assert found != pytest.approx(by_area, rel=1e-5)
    stiff = frequencies(tmp_path / "bar.bdf", ends[0], ends[1] | {"coupling": "rigid"})
    assert (stiff > found).all()


REFUSED = {
    "no node": ("RBE2,9,999,123,1", "couples nodes to one that it does not define, 999"),
    "one direction": ("RBE2,9,1,3,2", "RBE2 of some directions alone"),
    "weights": ("RBE3,9,,1,123456,1.0,123,2,\n,3,2.5,123,4", "several weights"),
    "a bar": ("RBAR,9,1,2,123456", "has RBAR, which is not read"),
    "equations": ("MPC,9,1,1,1.0,2,1,-1.0", "has MPC, which is not read"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_couplings_that_are_not_taken_are_refused_by_name(tmp_path: Path, name: str) -> None:
    card, why = REFUSED[name]
    (tmp_path / "bar.bdf").write_text(nastran(bar((1, 1, 1), 4, SIZE), card))
    with pytest.raises(MechanismError, match=why):
        read_mesh(tmp_path / "bar.bdf", "mesh")


def test_a_coupling_that_no_node_of_the_link_stands_for_is_told(tmp_path: Path) -> None:
    part = bar((2, 1, 1), 10, SIZE)
    card = f"RBE2,{listed(part.sets['tip'], ['7', str(len(part.x) + 2), '123'])}"
    (tmp_path / "bar.bdf").write_text(nastran(part, card))
    free = {"surface": "1"}, {"surface": "1"}
    with pytest.raises(ea.CaseError, match=r"couples nodes by 'RBE2 7', for which no node"):
        frequencies(tmp_path / "bar.bdf", free[0], {"surface": "9"} | free[1])


# --- sets of Nastran's case control


SETS = {
    "SET 1 = ALL": set(range(1, 13)),
    "SET 1=ALL": set(range(1, 13)),
    "set 1 = all": set(range(1, 13)),
    "SET 1 = 1 THRU 10": set(range(1, 11)),
    "SET 1 = 1,2,3,\n 4,5": {1, 2, 3, 4, 5},
    "SET 1 = 1,2,3,\n$ between them\n 4,5": {1, 2, 3, 4, 5},
    "SET 1 = 1 THRU 10 EXCEPT 5, 6": {1, 2, 3, 4, 7, 8, 9, 10},
    "SET 1 = 1 THRU 6 EXCEPT 5, 8": {1, 2, 3, 4, 6, 8},
    "SET 1 = ALL EXCEPT 3": set(range(1, 13)) - {3},
    "SET 1 = 1 THRU 10 BY 2": {1, 3, 5, 7, 9},
    "SUBCASE 1\n  SET 1 = 4": {4},
    "SET 1 = 8 THRU 10, ALL": set(range(1, 13)),
    "SET 1 = NONE": set(),
    "SET 1 = 0.1, 0.25": set(),
    "SET 1 = 1/T1, 2/T2": set(),
    "SET 1 = DMIG,K2": set(),
    "SETS DEFINITION\nOUTTM1,SET 300\nVOLUME 101 SET 300": set(),
}


@pytest.mark.parametrize("control", SETS)
def test_case_control_of_every_form_is_read(tmp_path: Path, control: str) -> None:
    part = bar((2, 1, 1), 4, SIZE)
    plain = bdf(Bar(part.x, part.elements, {}), "free")
    (tmp_path / "bar.bdf").write_text(plain.replace("BEGIN BULK", f"{control}\nBEGIN BULK"))
    mesh = read_mesh(tmp_path / "bar.bdf", "mesh")
    found = mesh.sets.get("1", np.zeros(0, dtype=int))
    assert set((found + 1).tolist()) == SETS[control]


def test_a_mesh_without_a_physical_volume_is_called_that(tmp_path: Path) -> None:
    part = bar((1, 1, 1), 4, SIZE)
    lines = msh(part, "2.2").splitlines()
    flat = [line for line in lines if " 4 2 9 1 " not in line]
    (tmp_path / "part.msh").write_text("\n".join(flat))
    with pytest.raises(MechanismError, match=r"add a Physical Volume, or save with Mesh\.SaveAll"):
        read_mesh(tmp_path / "part.msh", "mesh")


def test_a_binary_mesh_is_called_binary_whatever_its_lines(tmp_path: Path) -> None:
    head = b"$MeshFormat\n4.1 1 8\n" + b"\1\0\0\0\n$EndMeshFormat\n"
    (tmp_path / "part.msh").write_bytes(head + bytes(20_000))
    with pytest.raises(MechanismError, match="is binary: save it as ASCII"):
        read_mesh(tmp_path / "part.msh", "mesh")
