"""A part is the same whichever program wrote it: to the last digit of each format."""

import contextlib
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from imported_parts import ELEMENTS, LENGTH, arm, beam_arm, exported, read_matrix
from scipy import sparse
from scipy.io import mmwrite
from spatial_cases import built, case_of
from spatial_oracle import Tree
from writers import (
    Labels,
    abaqus_labels,
    coordinate,
    dmig,
    dofs,
    grids,
    mapping,
    matlab,
    op4_binary,
    op4_text,
)

from eigassign.errors import MechanismError
from eigassign.mechanism import imported_part

IDS = [1000 + 7 * k for k in range(ELEMENTS + 1)]
PLACES = {node: (LENGTH * k / ELEMENTS, 0.0, 0.0) for k, node in enumerate(IDS)}
BY_ID = {"start": {"id": IDS[0]}, "end": {"id": IDS[-1]}}
CSV = "id,x [m],y [m],z [m]\n" + "".join(f"{n},{x!r},0,0\n" for n, (x, *_) in PLACES.items())
Writer = Callable[[Path, np.ndarray, np.ndarray, Labels], Tree]


def labels_of(space: str) -> Labels:
    return [(n, f) for n in IDS for f in ((1, 2, 6) if space == "planar" else range(1, 7))]


def texts(folder: Path, **files: str) -> None:
    for name, text in files.items():
        (folder / name.replace("_", ".")).write_text(text)


# Writers of a whole part: files into a folder, the keys of its link


def of_dmig(folder: Path, K: np.ndarray, M: np.ndarray, labels: Labels) -> Tree:
    text = "$TITLE\n" + grids(PLACES) + dmig("KAAX", K, labels) + dmig("MAAX", M, labels, e="E")
    texts(folder, part_pch=text)
    return {"file": "part.pch", "nodes": BY_ID}


def of_op4(folder: Path, K: np.ndarray, M: np.ndarray, labels: Labels) -> Tree:
    texts(
        folder,
        part_op4=op4_text("KAA", K, "dense") + op4_text("MAA", M, "bigmat"),
        part_dof=dofs(labels),
        nodes_csv=CSV,
    )
    return {"file": "part.op4", "nodes_file": ["part.dof", "nodes.csv"], "nodes": BY_ID}


def of_op4_binary(folder: Path, K: np.ndarray, M: np.ndarray, labels: Labels) -> Tree:
    data = op4_binary("KAA", K, "dense", ">") + op4_binary("MAA", M, "sparse", ">")
    (folder / "part.op4").write_bytes(data)
    texts(folder, part_dof=dofs(labels), nodes_bdf=grids(PLACES, wide=True))
    return {"file": "part.op4", "nodes_file": ["part.dof", "nodes.bdf"], "nodes": BY_ID}


def of_abaqus(folder: Path, K: np.ndarray, M: np.ndarray, labels: Labels) -> Tree:
    inp = "*NODE\n" + "".join(f"{n}, {x!r}, 0., 0.\n" for n, (x, *_) in PLACES.items())
    texts(folder, K_mtx=abaqus_labels(K, labels), M_mtx=abaqus_labels(M, labels), part_inp=inp)
    files = {"stiffness": "K.mtx", "mass": "M.mtx", "nodes_file": "part.inp"}
    return {**files, "nodes": BY_ID}


def of_calculix(folder: Path, K: np.ndarray, M: np.ndarray, labels: Labels) -> Tree:
    texts(folder, p_sti=coordinate(K), p_mas=coordinate(M), p_dof=dofs(labels), nodes_csv=CSV)
    files = {"stiffness": "p.sti", "mass": "p.mas", "nodes_file": ["nodes.csv", "p.dof"]}
    return {**files, "nodes": BY_ID}


def of_ansys(folder: Path, K: np.ndarray, M: np.ndarray, labels: Labels) -> Tree:
    for name, A in (("K", K), ("M", M)):
        file = folder / f"{name}.mmf"
        mmwrite(file, sparse.coo_array(A), symmetry="symmetric", precision=17)
        (folder / f"{name}.mmf.mtx").rename(file)
    texts(folder, p_mapping=mapping(labels), nodes_csv=CSV)
    files = {"stiffness": "K.mmf", "mass": "M.mmf", "nodes_file": ["nodes.csv", "p.mapping"]}
    return {**files, "nodes": BY_ID}


def of_matlab(folder: Path, K: np.ndarray, M: np.ndarray, labels: Labels) -> Tree:
    matlab(folder / "part.mat", {"Kff": K, "Mff": M, "other": np.ones((3, 3))}, "5")
    texts(folder, p_dof=dofs(labels), nodes_csv=CSV)
    files = {"stiffness": "part.mat:Kff", "mass": "part.mat:Mff"}
    return {**files, "nodes_file": ["nodes.csv", "p.dof"], "nodes": BY_ID}


def of_numpy(folder: Path, K: np.ndarray, M: np.ndarray, labels: Labels) -> Tree:
    """As ``np.savez`` has them, with another matrix whose name begins like that of the mass."""
    np.savez(folder / "part.npz", K=K, M=M, modes=np.ones((3, 3)))
    texts(folder, p_dof=dofs(labels), nodes_csv=CSV)
    return {"file": "part.npz", "nodes_file": ["nodes.csv", "p.dof"], "nodes": BY_ID}


WRITERS: tuple[Writer, ...] = (
    of_dmig, of_op4, of_op4_binary, of_abaqus, of_calculix, of_ansys, of_matlab,
    of_numpy,
)  # fmt: skip


def lam(folder: Path, link: Tree, space: str = "spatial", count: int = 6) -> np.ndarray:
    tree = arm(space, {"part": {"type": "superelement", **link}})
    return built(tree, folder / "case.yaml").lam([0.4, 0.9], count)


@pytest.mark.parametrize("space", ["planar", "spatial"])
@pytest.mark.parametrize("write", WRITERS)
def test_frequencies_are_those_of_the_part_in_every_format(
    tmp_path: Path, space: str, write: Writer
) -> None:
    link = write(tmp_path, *exported(space), labels_of(space))
    found, exact = lam(tmp_path, link, space), built(beam_arm(space)).lam([0.4, 0.9], 6)
    np.testing.assert_allclose(np.sqrt(found), np.sqrt(exact), rtol=1e-7)


@pytest.mark.parametrize("write", [of_dmig, of_abaqus])
def test_a_spatial_part_moves_in_a_plane(tmp_path: Path, write: Writer) -> None:
    """Bending in the plane does not move out of it; beside it is bending between held nodes."""
    link = write(tmp_path, *exported("spatial"), labels_of("spatial"))
    exact = built(beam_arm("planar")).lam([0.4, 0.9], 4)
    found = lam(tmp_path, link, "planar", 8)
    nearest = found[np.abs(found[:, None] - exact).argmin(axis=0)]
    np.testing.assert_allclose(nearest, exact, rtol=1e-7)


# Single matrices, to the last digit


@pytest.fixture(scope="module")
def K() -> np.ndarray:
    """Symmetric to the last bit, as few zeros in columns as beams have."""
    A = exported("spatial")[0]
    return np.tril(A) + np.tril(A, -1).T


def same(file: Path, K: np.ndarray, data: str | bytes, digits: int = 17) -> None:
    file.write_bytes(data if isinstance(data, bytes) else data.encode())
    found = read_matrix(file, "key").toarray()
    texts = np.vectorize(lambda v: float(f"{v:.{digits - 1}e}"))
    np.testing.assert_array_equal(found, texts(K) if digits < 17 else K)


@pytest.mark.parametrize("layout", ["dense", "sparse", "bigmat"])
@pytest.mark.parametrize(("width", "digits"), [(16, 10), (23, 17), (26, 20)])
def test_op4_in_text(tmp_path: Path, K: np.ndarray, layout: str, width: int, digits: int) -> None:
    same(tmp_path / "K.op4", K, op4_text("KAA", K, layout, width), digits)


@pytest.mark.parametrize("layout", ["dense", "sparse", "bigmat"])
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("size", [4, 8])
def test_op4_in_binary(tmp_path: Path, K: np.ndarray, layout: str, order: str, size: int) -> None:
    exact = K if size == 8 else K.astype(np.float32).astype(float)
    same(tmp_path / "K.op4", exact, op4_binary("KAA", K, layout, order, size))


@pytest.mark.parametrize(("wide", "digits"), [(True, 10), (False, 3)])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_dmig(tmp_path: Path, K: np.ndarray, wide: bool, digits: int, end: str) -> None:
    text = dmig("KAAX", K, labels_of("spatial"), wide).replace("\n", end)
    same(tmp_path / "K.pch", K, text, digits)


def test_dmig_between_commas(tmp_path: Path) -> None:
    text = "DMIG,KAAX,0,6,2,0,,,2\nDMIG,KAAX,5,1,,5,1,2.5+3\n,7,1,-1.D3\nDMIG,KAAX,7,1,,7,1,4.\n"
    same(tmp_path / "K.pch", np.array([[2500.0, -1000.0], [-1000.0, 4.0]]), text)


def test_a_line_without_end_is_refused_in_little_memory(tmp_path: Path) -> None:
    (tmp_path / "K.mtx").write_text(5_000_000 * "\t1" + "\n")
    tracemalloc.start()
    with pytest.raises(MechanismError, match="cannot read"):
        read_matrix(tmp_path / "K.mtx", "key")
    assert tracemalloc.get_traced_memory()[1] < 60_000_000
    tracemalloc.stop()


@pytest.mark.parametrize(
    "write",
    [
        coordinate,
        lambda A: abaqus_labels(A, labels_of("spatial")),
    ],
    ids=["coordinate", "labels"],
)
def test_lists_of_entries(tmp_path: Path, K: np.ndarray, write: Any) -> None:
    same(tmp_path / "K.mtx", K, write(K))


@pytest.mark.parametrize("version", ["5", "full"])
@pytest.mark.parametrize("packed", [True, False])
def test_matlab(tmp_path: Path, K: np.ndarray, version: str, packed: bool) -> None:
    matlab(tmp_path / "K.mat", {"anything": K}, version, packed)
    np.testing.assert_array_equal(read_matrix(tmp_path / "K.mat", "key").toarray(), K)


def test_a_matrix_is_told_by_its_content_and_not_by_its_ending(
    tmp_path: Path, K: np.ndarray
) -> None:
    np.save(tmp_path / "K.npy", K)
    same(tmp_path / "K.txt", K, (tmp_path / "K.npy").read_bytes())
    same(tmp_path / "K.npz", K, coordinate(K))


@pytest.mark.parametrize("e", "ED")
def test_rows_without_mass_are_not_in_every_list(tmp_path: Path, e: str) -> None:
    """Lumped masses: rotations of DMIG, and the last rows of a counted list, are left out."""
    K, M = exported("planar")
    lumped = np.diag([M[k, k % 3 :: 3].sum() * (k % 3 < 2) for k in range(len(M))])
    labels = labels_of("planar")
    whole = lam(tmp_path, of_calculix(tmp_path, K, lumped, labels), "planar")
    few = [k for k in range(len(M)) if lumped[k, k]]
    text = dmig("MAAX", lumped[np.ix_(few, few)], [labels[k] for k in few], e=e)
    texts(tmp_path, part_pch=grids(PLACES) + dmig("KAAX", K, labels, e=e) + text)
    found = lam(tmp_path, {"file": "part.pch", "nodes": BY_ID}, "planar")
    np.testing.assert_allclose(found, whole, rtol=2e-7)


# Damage of every kind


def damaged(data: bytes, rng: np.random.Generator) -> bytes:
    """Bytes changed, a piece cut out or doubled, the end cut off; digits made other digits."""
    out = bytearray(data)
    kind, at = rng.integers(5), int(rng.integers(len(out)))
    if kind == 0:
        return bytes(out[:at])
    if kind == 1:
        del out[at : at + int(rng.integers(1, 40))]
    elif kind == 2:
        out[at:at] = out[at : at + int(rng.integers(1, 40))]
    else:
        digits = [k for k in rng.integers(len(out), size=40) if chr(out[k]) in "0123456789"]
        places = digits[:2] if kind == 3 and digits else rng.integers(len(out), size=3)
        for k in places:
            out[k] = rng.choice(list(b"0123456789")) if kind == 3 else rng.integers(256)
    return bytes(out)


def survives(folder: Path, write: Writer, count: int, seed: int) -> None:
    """Each file of a part is damaged in turn: it is read, or refused by name."""
    K, M = (A[:24, :24] for A in exported("spatial"))
    K[18:, 18:] /= 2.0
    link = write(folder, K, M, labels_of("spatial")[:24])
    link = {**link, "nodes": {"start": {"id": IDS[0]}, "end": {"id": IDS[3]}}}
    rng = np.random.default_rng(seed)
    files = [f for f in sorted(folder.iterdir()) if f.suffix != ".yaml"]
    tree = arm("spatial", {"part": {"type": "superelement", **link}})
    for k in range(count):
        file = files[k % len(files)]
        whole = file.read_bytes()
        file.write_bytes(damaged(whole, rng))
        with contextlib.suppress(MechanismError):
            imported_part(case_of(tree, folder / "case.yaml"), "part")
        file.write_bytes(whole)


@pytest.mark.parametrize("write", WRITERS)
def test_damaged_files_are_read_or_refused(tmp_path: Path, write: Writer) -> None:
    survives(tmp_path, write, 5 if write is of_matlab else 40, 1)
