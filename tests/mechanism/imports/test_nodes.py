"""Nodes by number, units, and what is said where these or the files are wrong."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from imported_parts import ELEMENTS, LENGTH, arm, beam_arm, exported, read_matrix
from scipy import io, sparse
from spatial_cases import built, case_of
from spatial_oracle import Tree
from test_formats import (
    BY_ID,
    CSV,
    IDS,
    PLACES,
    labels_of,
    lam,
    of_abaqus,
    of_calculix,
    of_dmig,
    of_matlab,
    texts,
)
from writers import coordinate, dmig, dofs, grids, matlab

from eigassign.errors import CaseError, MechanismError
from eigassign.mechanism import part_lines

CCX = Path(__file__).parent / "calculix"
MARKET = "%%MatrixMarket matrix coordinate"
PRINTED_HZ = [6634.938, 8549.826, 11988.96, 18453.90, 21866.74, 22228.68]  # by CalculiX


def lines(folder: Path, link: Tree, space: str = "spatial") -> list[str]:
    tree = arm(space, {"part": {"type": "superelement", **link}})
    return list(part_lines(case_of(tree, folder / "case.yaml")))


def refusal(folder: Path, link: Tree, space: str = "spatial") -> str:
    with pytest.raises(MechanismError) as caught:
        lines(folder, link, space)
    return str(caught.value)


def in_units(space: str, length: float, mass: float, time: float) -> tuple[np.ndarray, np.ndarray]:
    """K and M of the beam as a program with such units would have them."""
    K, M = exported(space)
    turning = [f > 3 for _, f in labels_of(space)]
    D = np.diag(np.where(turning, 1.0, length))  # u = D u_file
    energy = mass * (length / time) ** 2
    return D @ K @ D / energy, D @ M @ D / (energy * time**2)


SYSTEMS: dict[str, tuple[float, float, float]] = {
    "m-kg-s": (1.0, 1.0, 1.0),
    "mm-t-s": (1e-3, 1e3, 1.0),
    "mm-kg-ms": (1e-3, 1.0, 1e-3),
    "in-lbf-s": (0.0254, 175.12683524647636, 1.0),
}


@pytest.mark.parametrize("units", SYSTEMS)
@pytest.mark.parametrize("write", [of_dmig, of_abaqus, of_calculix, of_matlab])
def test_files_in_any_units_are_the_same_part(tmp_path: Path, units: str, write: Any) -> None:
    """Places are written in the case: in m, or with their units."""
    K, M = in_units("spatial", *SYSTEMS[units])
    link = write(tmp_path, K, M, labels_of("spatial"))
    ends = {"start": {"position": [0, 0, 0]}, "end": {"position": ["600 mm", 0, 0]}}
    nodes = {name: {**node, **ends[name]} for name, node in link["nodes"].items()}
    found = lam(tmp_path, {**link, "nodes": nodes, "units": units})
    digits = 2e-5 if write is of_dmig else 1e-8  # ten digits of K are fewer of its lowest modes
    np.testing.assert_allclose(found, built(beam_arm("spatial")).lam([0.4, 0.9], 6), rtol=digits)


@pytest.mark.parametrize("header", ["id, x, y, z", "id, x [mm], y [mm], z [mm]"])
def test_places_of_files_are_in_their_units_too(tmp_path: Path, header: str) -> None:
    K, M = in_units("spatial", *SYSTEMS["mm-t-s"])
    link = {**of_abaqus(tmp_path, K, M, labels_of("spatial")), "nodes_file": "nodes.csv"}
    rows = "".join(f"{n}, {1e3 * x!r}, 0, 0\n" for n, (x, *_) in PLACES.items())
    texts(tmp_path, nodes_csv=f"{header}\n{rows}")
    found = lam(tmp_path, {**link, "units": "mm-t-s"})
    np.testing.assert_allclose(found, built(beam_arm("spatial")).lam([0.4, 0.9], 6), rtol=1e-7)


@pytest.mark.parametrize("units", SYSTEMS)
@pytest.mark.parametrize("written", ["m-kg-s", "mm-kg-ms", "in-lbf-s"])
def test_the_error_says_which_units_would_fit(tmp_path: Path, units: str, written: str) -> None:
    link = of_dmig(tmp_path, *in_units("spatial", *SYSTEMS[units]), labels_of("spatial"))
    nodes = {"start": {"id": IDS[0]}, "end": {"id": IDS[-1], "position": [LENGTH, 0, 0]}}
    if SYSTEMS[units][0] == SYSTEMS[written][0]:
        return
    message = refusal(tmp_path, {**link, "nodes": nodes, "units": written})
    assert "strains under rigid motion" in message
    assert re.search(f"write units: .*{units}", message)


def test_a_position_that_lacks_its_unit_is_told(tmp_path: Path) -> None:
    link = of_dmig(tmp_path, *exported("spatial"), labels_of("spatial"))
    nodes = {"start": {"id": IDS[0]}, "end": {"id": IDS[-1], "position": [600.0, 0, 0]}}
    assert "positions a thousandth as large" in refusal(tmp_path, {**link, "nodes": nodes})


@pytest.mark.parametrize("units", ["mm-t-s", "mm-kg-ms"])
def test_a_part_of_half_a_kilometre_and_grams_is_doubted(tmp_path: Path, units: str) -> None:
    """All of its files are in mm, so that nothing strains."""
    K, M = in_units("planar", *SYSTEMS[units])
    link = {**of_abaqus(tmp_path, K, M, labels_of("planar")), "nodes_file": "nodes.csv"}
    rows = "".join(f"{n},{1e3 * x!r},0\n" for n, (x, *_) in PLACES.items())
    texts(tmp_path, nodes_csv=f"id,x,y\n{rows}")
    assert "write units: mm-t-s or mm-kg-ms" in lines(tmp_path, link, "planar")[-1]
    assert "write units" not in "".join(lines(tmp_path, {**link, "units": units}, "planar"))


def test_few_digits_are_told(tmp_path: Path) -> None:
    K, M = exported("planar")
    K[0, 0] *= 1.0 + 5e-6
    link = of_calculix(tmp_path, K, M, labels_of("planar"))
    assert "for few digits alone" in refusal(tmp_path, link, "planar")


# What check says


@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_check_says_what_the_part_is(tmp_path: Path, space: str) -> None:
    first, second = lines(tmp_path, of_dmig(tmp_path, *exported(space), labels_of(space)), space)
    assert "0.972 kg, centre of mass at (0.3, 0" in first
    across = 0.972 * LENGTH**2 / 12
    about = [float(v) for v in re.search("about it (.*) kg m2", first)[1].split(",")]
    assert about[-1] == pytest.approx(across, rel=2e-3)  # thick, and of lumped turning
    assert float(re.search("strain under rigid motion (.*?) ", second)[1]) < 1e-8


# What CalculiX 2.20 wrote


CALCULIX = {
    "stiffness": "rig.sti", "mass": "rig.mas", "nodes_file": ["rig.dof", "rig.inp"],
    "units": "mm-t-s", "nodes": {"start": {"id": [101, 103]}, "end": {"id": [102, 104]}},
}  # fmt: skip


def test_a_part_of_calculix_has_the_frequencies_that_it_printed(tmp_path: Path) -> None:
    for file in CCX.glob("rig.*"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    first = lines(tmp_path, CALCULIX)[0]
    assert f"{7850 * 0.12 * 0.012 * 0.02:.4g} kg, centre of mass at (0.06, 0, 0) m" in first
    K, M = (read_matrix(tmp_path / f"rig.{kind}", "key").toarray() for kind in ("sti", "mas"))
    turned = np.linalg.inv(np.linalg.cholesky(M))
    found = np.sqrt(np.linalg.eigvalsh(turned @ K @ turned.T)[6:12]) / (2 * np.pi)
    np.testing.assert_allclose(found, PRINTED_HZ, rtol=5e-7)  # it printed seven digits


def test_nodes_of_solids_do_not_rotate(tmp_path: Path) -> None:
    for file in CCX.glob("rig.*"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    nodes = {"start": {"id": 101}, "end": {"id": [102, 104]}}
    message = refusal(tmp_path, {**CALCULIX, "nodes": nodes})
    assert "nodes.start.id: node 101 has no freedom 4, 5, 6: nodes of solid" in message
    assert "RBE2" in message


# Wrong ones


def test_a_node_that_is_not_there_is_told(tmp_path: Path) -> None:
    link = of_abaqus(tmp_path, *exported("spatial"), labels_of("spatial"))
    message = refusal(tmp_path, {**link, "nodes": {"start": {"id": 3}, "end": {"id": IDS[-1]}}})
    assert f"the {ELEMENTS + 1} nodes of the matrices have numbers from 1000 to" in message


def test_a_node_without_a_place_is_told(tmp_path: Path) -> None:
    link = of_abaqus(tmp_path, *exported("spatial"), labels_of("spatial"))
    link.pop("nodes_file")
    assert "no place of node 1000 is in the files: write its position" in refusal(tmp_path, link)


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        ("nodes.csv", f"{IDS[-1]},", f"{IDS[-1]}.5,", "column id: expected whole numbers"),
        ("nodes.csv", "0\n", f"0\n{IDS[0]},7,0,0\n", f"node {IDS[0]} stands at several places"),
        ("p.dof", f"{IDS[0]}.2\n", f"{IDS[0]}.1\n", "gives a freedom of a node to two rows"),
        ("nodes.csv", CSV, "17.999\n18.1\n", "the first line must be a header, such as id"),
    ],
)  # fmt: skip
def test_slips_in_files_about_nodes_are_told(
    tmp_path: Path, file: str, old: str, new: str, said: str
) -> None:
    link = of_calculix(tmp_path, *exported("spatial"), labels_of("spatial"))
    text = (tmp_path / file).read_text()
    assert old in text
    (tmp_path / file).write_text(text.replace(old, new, 1))
    assert said in refusal(tmp_path, link)


@pytest.mark.parametrize("field", [1, 5])
def test_a_grid_point_with_axes_of_its_own_is_told(tmp_path: Path, field: int) -> None:
    of_dmig(tmp_path, *exported("spatial"), labels_of("spatial"))
    text = (tmp_path / "part.pch").read_text().splitlines()
    text[1] = text[1].ljust(56)
    text[1] = text[1][: 8 + 8 * field] + f"{4:8d}" + text[1][16 + 8 * field :]
    (tmp_path / "part.pch").write_text("\n".join(text))
    message = refusal(tmp_path, {"file": "part.pch", "nodes": BY_ID})
    assert "node 1000 stands at several places, or in a coordinate system of its own" in message


def test_rows_that_nobody_names_are_told(tmp_path: Path) -> None:
    link = of_calculix(tmp_path, *exported("spatial"), labels_of("spatial"))
    message = refusal(tmp_path, {**link, "nodes_file": "nodes.csv"})
    assert "do not say whose their rows are: write dofs" in message
    texts(tmp_path, p_dof=dofs(labels_of("spatial")[:-1]))
    assert "names 53 rows; the matrices have 54" in refusal(tmp_path, link)


@pytest.mark.parametrize(
    ("named", "twin"),
    [("part.pch", " (MAAX)"), ("part.npz", " (MAA)")],
)
def test_a_missing_mass_is_told(tmp_path: Path, named: str, twin: str) -> None:
    K, _ = exported("spatial")
    texts(tmp_path, part_pch=grids(PLACES) + dmig("KAAX", K, labels_of("spatial")))
    np.savez(tmp_path / "part.npz", KAA=K)
    message = refusal(tmp_path, {"file": named, "nodes": BY_ID})
    assert f"{named} holds stiffness, no mass: export the mass{twin} too" in message


def test_two_files_that_are_exchanged_are_told(tmp_path: Path) -> None:
    K, M = exported("spatial")
    for name, A in (("KAAX", K), ("MAAX", M)):
        (tmp_path / f"{name}.pch").write_text(dmig(name, A, labels_of("spatial")))
    link = {"stiffness": "MAAX.pch", "mass": "KAAX.pch", "nodes": BY_ID}
    assert "MAAX.pch holds mass, no stiffness" in refusal(tmp_path, link)


def test_one_of_several_matrices_is_named(tmp_path: Path) -> None:
    K, M = exported("spatial")
    matlab(tmp_path / "part.mat", {"K1": K, "K2": K, "M": M}, "5")
    link = {"file": "part.mat", "nodes": BY_ID}
    said = "holds 3 matrices, K1, K2, M: in place of file write stiffness: parts.mat:K and mass:"
    assert said in refusal(tmp_path, link)
    link = {"stiffness": "part.mat:K3", "mass": "part.mat:M", "nodes": BY_ID}
    assert "has no matrix 'K3'; it has K1, K2, M" in refusal(tmp_path, link)
    matlab(tmp_path / "part.mat", {"stiffness": K, "mass_1": M, "mass_2": M}, "5")
    assert "K1" not in refusal(tmp_path, {"file": "part.mat", "nodes": BY_ID})
    assert "3 matrices, stiffness, mass_1" in refusal(
        tmp_path, {"file": "part.mat", "nodes": BY_ID}
    )


def test_labels_of_one_of_both_are_told(tmp_path: Path) -> None:
    K, M = exported("spatial")
    texts(tmp_path, K_pch=dmig("K", K, labels_of("spatial")), M_mas=coordinate(M))
    link = {"stiffness": "K.pch", "mass": "M.mas", "nodes": BY_ID}
    assert "only one of stiffness and mass says whose its rows are" in refusal(tmp_path, link)


def test_a_matrix_that_stands_twice_in_a_file_is_told(tmp_path: Path) -> None:
    K, M = exported("spatial")
    text = dmig("KAAX", K, labels_of("spatial"))
    texts(tmp_path, part_pch=text + text + dmig("MAAX", M, labels_of("spatial")))
    message = refusal(tmp_path, {"file": "part.pch", "nodes": BY_ID})
    assert "2 headers" in message
    texts(tmp_path, K_mtx=2 * coordinate(K), M_mtx=coordinate(M))
    link = {"stiffness": "K.mtx", "mass": "M.mtx", "nodes": BY_ID}
    assert "gives an entry twice" in refusal(tmp_path, link)


@pytest.mark.parametrize("write", [of_dmig, of_abaqus, of_calculix])
def test_an_asymmetric_matrix_is_told(tmp_path: Path, write: Any) -> None:
    K, M = exported("spatial")
    link = write(tmp_path, K, M, labels_of("spatial"))
    file = tmp_path / link.get("stiffness", link.get("file"))
    more = {
        "part.pch": "DMIG,KAAX,1007,2,,1000,2,9.0\n",
        "K.mtx": "1000,2, 1007,2, 9.0\n",
        "p.sti": "8 2 9.0\n",
    }
    with open(file, "a") as stream:
        stream.write(more[file.name])
    assert "is not symmetric: entries differ by" in refusal(tmp_path, link)


def test_a_list_that_was_cut_short_is_doubted(tmp_path: Path) -> None:
    link = of_calculix(tmp_path, *exported("spatial"), labels_of("spatial"))
    rows = (tmp_path / "p.sti").read_text().splitlines(keepends=True)
    (tmp_path / "p.sti").write_text("".join(rows[: 2 * len(rows) // 3]))
    assert "is its file whole" in refusal(tmp_path, link)


def test_an_asymmetry_is_told_by_its_own_rows(tmp_path: Path) -> None:
    """Of an entry that is ten thousand times as small as the largest, a fraction."""
    K, M = exported("spatial")
    link = of_calculix(tmp_path, K, M, labels_of("spatial"))
    M[tuple(np.argwhere(np.triu(np.abs(M) > 0.0, 1) & (np.abs(M) < 1e-4 * M.max()))[0])] *= 1.00005
    np.save(tmp_path / "M.npy", M)
    assert "is not symmetric: entries differ by" in refusal(tmp_path, {**link, "mass": "M.npy"})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("DMIG,KAAX,0,6,4,0,,,1\nDMIG,KAAX,1,1,,1,1,2.0\n", "complex"),
        ("DMIG,KAAX,0,9,2,0,,,1\nDMIG,KAAX,1,1,,1,1,2.0\n", "square"),
        ("DMIG,KAAX,0,6,2,0,,,1\nDMIG,KAAX,1,1,,1,1,two\n", "cannot read"),
        ("   2   2   6   4KAA     1P,3E23.16\n   3   1   1\n", "complex"),
        ("   2   3   2   2KAA     1P,3E23.16\n   3   1   1\n", "square"),
        ("  999999  999999       6       2KAA     1P,3E23.16\n", "cannot read"),
        (" 9999999 9999999       6       2KAA     1P,3E23.16\n", "up to 2000000 are supported"),
        ("9999999 9999999 1.0\n", "up to 2000000 are supported"),
        ("-5 1 1.0\n", "cannot read"),
        ("1 1 one\n", "cannot read"),
        ("1,1, 1,1\n", "cannot read"),
        ("MATLAB 7.3 MAT-file, Platform: GLNXA64" + 90 * " ", "save it with '-v7'"),
        ("MATLAB 5.0 MAT-file" + 109 * " ", "cannot read"),
        (f"{MARKET} complex general\n3 3 1\n1 1 1 0\n", "no matrix of real numbers"),
        (f"{MARKET} pattern general\n3 3 1\n1 1\n", "no matrix of real numbers"),
        (f"{MARKET} real skew-symmetric\n3 3 1\n2 1 1\n", "general or symmetric"),
        (f"{MARKET} real general\n3 3 1\n1 9 1\n", "cannot read"),
        (f"{MARKET} real general\n3 3 1\n1 1 one\n", "cannot read"),
        ("hello\n", "cannot read"),
        ("", "cannot read"),
    ],
)  # fmt: skip
def test_what_is_no_matrix_of_a_part_is_told(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "K.mtx").write_text(text)
    with pytest.raises(MechanismError, match=re.escape(message)) as caught:
        read_matrix(tmp_path / "K.mtx", "key")
    assert "K.mtx" in str(caught.value)
    assert "hello" not in str(caught.value)


def test_what_unpacks_to_more_than_the_limit_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    matlab(tmp_path / "K.mat", {"K": np.ones((800, 800))}, "full")
    monkeypatch.setenv("EIGASSIGN_LIMITS", "1e-3")
    with pytest.raises(MechanismError, match="unpacks to more than 1 MB: the environment variable"):
        read_matrix(tmp_path / "K.mat", "key")


# Files are part of what a case is


@pytest.mark.parametrize("file", ["part.pch", "part.dof", "nodes.csv"])
def test_every_file_of_a_part_is_named_and_counts(tmp_path: Path, file: str) -> None:
    link = of_calculix(tmp_path, *exported("spatial"), labels_of("spatial"))
    texts(tmp_path, part_pch="".join(dmig(n, np.eye(2), [(1, 1), (1, 2)]) for n in "KM"))
    (tmp_path / "p.dof").rename(tmp_path / "part.dof")
    part = {"file": "part.pch", "nodes_file": ["nodes.csv", "part.dof"], "nodes": link["nodes"]}
    tree = arm("spatial", {"part": {"type": "superelement", **part}})
    before = case_of(tree, tmp_path / "case.yaml").files[file]
    (tmp_path / file).write_text((tmp_path / file).read_text() + "\n")
    assert case_of(tree, tmp_path / "case.yaml").files[file] != before
    (tmp_path / file).unlink()
    with pytest.raises(CaseError, match=f"no such file.*{file}"):
        case_of(tree, tmp_path / "case.yaml")
    (tmp_path / file).symlink_to("/etc/hostname")
    with pytest.raises(CaseError, match="lies outside the folder"):
        case_of(tree, tmp_path / "case.yaml")


def test_a_matrix_named_in_a_file_is_read_back_from_a_resolved_case(tmp_path: Path) -> None:
    link = of_matlab(tmp_path, *exported("spatial"), labels_of("spatial"))
    tree = arm("spatial", {"part": {"type": "superelement", **link}})
    case = case_of(tree, tmp_path / "case.yaml")
    assert case.mechanism.links["part"].stiffness == f"{tmp_path}/part.mat:Kff"
    assert set(case.files) == {"part.mat", "nodes.csv", "p.dof"}


def test_a_file_that_changes_is_read_again(tmp_path: Path) -> None:
    K, M = exported("spatial")
    link = of_dmig(tmp_path, K, M, labels_of("spatial"))
    one = lam(tmp_path, link)
    two = lam(tmp_path, of_dmig(tmp_path, 4 * K, M, labels_of("spatial")))
    assert (two > 1.001 * one).all()


def test_rows_that_are_zero_in_both_are_named_and_left_out(tmp_path: Path) -> None:
    """As Nastran leaves the rotations of nodes of solids (AUTOSPC)."""
    K, M = exported("spatial")
    link = of_abaqus(tmp_path, K, M, labels_of("spatial"))
    n, more = len(K), [3, 17, 40]
    at = np.setdiff1d(np.arange(n + len(more)), more)
    for name, A in (("K", K), ("M", M)):
        wide = np.zeros((n + len(more),) * 2)
        wide[np.ix_(at, at)] = A
        np.save(tmp_path / f"{name}.npy", wide)
    ends = {"start": at[:6].tolist(), "end": at[-6:].tolist()}
    places = {"start": [0, 0, 0], "end": [LENGTH, 0, 0]}
    own = {"stiffness": "K.npy", "mass": "M.npy"}
    own["nodes"] = {k: {"dofs": v, "position": places[k]} for k, v in ends.items()}
    np.testing.assert_allclose(lam(tmp_path, own), lam(tmp_path, link), rtol=1e-6)
    assert any("rows 3, 17, 40 are zero in stiffness and mass" in s for s in lines(tmp_path, own))
    own["nodes"]["end"]["dofs"] = [*ends["end"][:5], 40]
    assert "its rows 40 are zero in stiffness and in mass" in refusal(tmp_path, own)


def test_entries_of_a_part_instance_are_those_of_its_nodes(tmp_path: Path) -> None:
    """FORMAT=LABELS of Abaqus."""
    link = of_abaqus(tmp_path, *exported("spatial"), labels_of("spatial"))
    plain = lam(tmp_path, link)
    text = {f: (tmp_path / f).read_text() for f in ("K.mtx", "M.mtx")}
    for file, own in text.items():
        named = re.sub(r"(?<!\d)(\d+)(?=,[1-6],)", r"PART-1-1.\1", own)
        (tmp_path / file).write_text("** labels\n" + named)
    assert "PART-1-1.1000,1, PART-1-1.1000,1," in (tmp_path / "K.mtx").read_text()
    np.testing.assert_array_equal(lam(tmp_path, link), plain)
    two = (tmp_path / "K.mtx").read_text().replace("PART-1-1.1000,1,", "PART-2-1.1000,1,", 1)
    (tmp_path / "K.mtx").write_text(two)
    assert "several part instances: write them of one part" in refusal(tmp_path, link)


@pytest.mark.parametrize("full", [True, False])
def test_matrices_in_a_structure_are_found_and_named(tmp_path: Path, full: bool) -> None:
    K, M = (A if full else sparse.csc_array(A) for A in exported("spatial"))
    io.savemat(tmp_path / "part.mat", {"SE": {"K": K, "M": M, "dof": np.arange(3.0), "of": "me"}})
    texts(tmp_path, p_dof=dofs(labels_of("spatial")), nodes_csv=CSV)
    files = {"nodes_file": ["nodes.csv", "p.dof"], "nodes": BY_ID}
    one = lam(tmp_path, {"file": "part.mat", **files})
    both = {"stiffness": "part.mat:SE.K", "mass": "part.mat:SE.M"}
    np.testing.assert_array_equal(lam(tmp_path, {**both, **files}), one)
    np.testing.assert_allclose(one, built(beam_arm("spatial")).lam([0.4, 0.9], 6), rtol=1e-7)


def test_of_all_that_a_punch_holds_the_reduced_matrices_are_taken(tmp_path: Path) -> None:
    """KAAX, MAAX, BAAX, VAX, MUG1T of EXTSEOUT(DMIGPCH)."""
    K, M = exported("spatial")
    link = of_dmig(tmp_path, K, M, labels_of("spatial"))
    plain, text = lam(tmp_path, link), (tmp_path / "part.pch").read_text()
    more = (dmig(name, np.eye(len(K)), labels_of("spatial")) for name in ("BAAX", "MUG1T", "KX"))
    (tmp_path / "part.pch").write_text(text + "".join(more))
    np.testing.assert_array_equal(lam(tmp_path, link), plain)
