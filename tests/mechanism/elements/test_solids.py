"""Solid links: closed forms and CalculiX' frequencies, formats, couplings, wrong meshes."""

import re
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse import linalg
from solid_parts import METAL, Bar, bar, bdf, case, inp, msh
from spatial_cases import linkage

import eigassign
import eigassign as ea
from eigassign.errors import CaseError, MechanismError, MissingMassError
from eigassign.mechanism import Coupling, joined, part_lines, read_mesh, solid_part
from eigassign.modal import Model
from eigassign.study import load_case

# Hz, of the bar with rigid ends, one of them fixed: bending in its flat and its upright plane
BENDING = (103.05, 154.06)
BRACKET = Path(eigassign.__file__).parent / "starters/casting/bracket.msh"


class Link:
    """What a solid link says of its mesh and nodes."""

    def __init__(self, mesh: Path, nodes: dict[str, Any], units: str = "m-kg-s") -> None:
        self.mesh, self.units = str(mesh), units
        self.nodes = {name: Node(**keys) for name, keys in nodes.items()}


class Node:
    def __init__(self, surface: str, coupling: str = "rigid", position: Any = None) -> None:
        self.surface, self.coupling, self.position = surface, coupling, position


ENDS = {"start": {"surface": "root"}, "end": {"surface": "tip"}}


def dense(folder: Path, part: Bar, nodes: Any = ENDS) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """K, M and rigid motion of a part in local dofs."""
    (folder / "part.msh").write_text(msh(part))
    found, _ = solid_part(Link(folder / "part.msh", nodes), METAL["poissons_ratio"], "links.part")
    K = found.stiffness.toarray() * METAL["youngs_modulus"]
    return K, found.mass.toarray() * METAL["density"], found.rigid


def lowest(K: Any, M: Any, count: int) -> np.ndarray:
    """The lowest frequencies in Hz, rigid ones included, by Lanczos on (K + s M)⁻¹ M."""
    s, K, M = (2.0 * np.pi * 50.0) ** 2, sparse.csc_array(K), sparse.csc_array(M)
    start = np.ones(K.shape[0])
    lam = linalg.eigsh(K, count, M, sigma=-s, v0=start, return_eigenvectors=False)
    return np.sqrt(np.abs(np.sort(np.abs(lam)))) / (2.0 * np.pi)


@pytest.mark.parametrize(("cells", "count"), [((17, 2, 2), 10), ((20, 1, 1), 20)])
def test_a_bar_with_rigid_ends_bends_as_it_should(tmp_path: Path, cells: Any, count: int) -> None:
    part = bar(cells, count, grading=1.5)  # 408 and 20 elements, shorter at the ends
    model = ea.load_case(case(tmp_path, part), allow_outside=True).model()
    assert model.frequencies([0.0], [], 2)[0] == pytest.approx(BENDING, rel=3e-3)
    assert model.mass([]) - 1.0 == pytest.approx(0.4 * 0.02 * 0.03 * 2700.0, rel=1e-6)
    # the estimate knows that little is missing
    assert (model.discretisation_error([0.0], [], (1, 2)) < 2e-2).all()


@pytest.mark.parametrize("count", [4, 10, 20])
def test_free_parts_move_rigidly_and_weigh_what_they_should(tmp_path: Path, count: int) -> None:
    K, M, rigid = dense(tmp_path, bar((6, 1, 1), count))
    hz = lowest(K, M, 7)
    assert hz[:6].max() < 2e-3
    assert hz[6] > 100.0
    assert np.abs(K @ rigid).max() < 1e-9 * np.abs(K).max()
    m, (a, b, c) = 0.648, (0.4, 0.02, 0.03)
    moments = [b**2 + c**2, 4.0 * a**2 + c**2, 4.0 * a**2 + b**2]
    exact = np.array([m, m, m, *(m / 12.0 * np.array(moments))])
    assert np.diag(rigid.T @ M @ rigid) == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("count", [4, 10, 20])
def test_elements_strain_uniformly_where_they_are_pulled(tmp_path: Path, count: int) -> None:
    """The patch test: a linear displacement stores λ (tr ε)² + 2 μ ε:ε in each volume, twice."""
    (tmp_path / "part.msh").write_text(msh(bar((2, 2, 2), count, (1.0, 0.5, 0.8))))
    mesh = read_mesh(tmp_path / "part.msh", "mesh")
    nodes = {key: {"coupling": "distributing", **keys} for key, keys in ENDS.items()}
    part, _ = solid_part(Link(tmp_path / "part.msh", nodes), 0.3, "links.part")
    pulled = np.diag([1.0, -0.3, -0.3])
    for G in (np.random.default_rng(1).standard_normal((3, 3)), pulled):
        u = (mesh.x @ G.T).ravel()
        v = np.linalg.lstsq(part.motion.toarray(), u, rcond=None)[0]
        assert part.motion @ v == pytest.approx(u, abs=1e-9)
        e, lam, mu = 0.5 * (G + G.T), 0.3 / (1.3 * 0.4), 0.5 / 1.3
        energy = 0.4 * (lam * np.trace(e) ** 2 + 2.0 * mu * (e**2).sum())
        assert v @ part.stiffness @ v == pytest.approx(energy, rel=1e-9)
    # nothing pulls at the sides, and elements of any degree strain alike
    assert abs(part.lacked.gram((part.motion @ v)[:, None])[0, 0]) < 1e-12


def test_a_bracket_is_calculix_bracket(tmp_path: Path) -> None:
    """Recorded: see solid_references."""
    nodes = {name: {"surface": name} for name in ("bore", "bolt_a", "bolt_b")}
    part, _ = solid_part(Link(BRACKET, nodes, "mm-t-s"), 0.33, "links.part")
    K, M = part.stiffness * 70e9, part.mass * 2700.0
    hz = lowest(K, M, 12)
    assert hz[:6].max() < 2e-3
    free = [1173.373, 2262.175, 3037.887, 4146.493, 6941.498, 7516.702]
    assert hz[6:] == pytest.approx(free, rel=1e-3)


def test_two_brackets_are_calculix_arm() -> None:
    solid = {"type": "solid", "mesh": str(BRACKET), "units": "mm-t-s", "material": "metal"}
    nodes = {name: {"surface": name} for name in ("bore", "bolt_a", "bolt_b")}
    solid |= {"nodes": nodes, "reduce_to": 2e4}
    arm = linkage(
        {"base": {"type": "rigid", "mass": 1.0}, "one": solid, "two": solid},
        {
            "slide": {"type": "prismatic", "base": "ground", "follower": "base.start"},
            "weld": {"type": "fixed", "base": "base.start", "follower": "one.bolt_a"},
            "hinge": {
                **{"type": "revolute", "base": "one.bore", "follower": "two.bolt_a"},
                "axis": [0, 0, 1],
            },
        },
        {
            "x": {"joint": "slide", "drive": "locked"},
            "turn": {"joint": "hinge", "drive": "locked"},
        },
        materials={"metal": METAL},
        space="spatial",
    ) | {"title": "two brackets", "expansion": {"q": [0.0, 0.0]}}
    model = ea.load_case(arm, allow_outside=True).model()
    joined_hz = [89.38297, 144.1505, 409.0060, 575.7838, 671.3159, 833.3913]
    found = model.frequencies([0.0, np.deg2rad(30.0)], [], 6)[0]
    assert found == pytest.approx(joined_hz, rel=1e-3)


# --- what files hold


@pytest.mark.parametrize("count", [4, 10, 20])
def test_all_formats_hold_the_same_part(tmp_path: Path, count: int) -> None:
    part = bar((3, 1, 2), count)
    texts = {"a.msh": msh(part), "b.msh": msh(part, "2.2"), "c.inp": inp(part)}
    texts |= {"d.inp": inp(part, faces=True)}
    texts |= {f"{form}.bdf": bdf(part, form) for form in ("small", "large", "free")}
    found = {}
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
        surfaces = ("1", "2") if name.endswith("bdf") else ("root", "tip")
        nodes = {key: {"surface": s} for key, s in zip(("a", "b"), surfaces, strict=True)}
        found[name], _ = solid_part(Link(tmp_path / name, nodes), 0.3, "links.part")
    first = np.linalg.eigvalsh(found["a.msh"].stiffness.toarray())
    for name, each in found.items():
        close = 1e-4 if name == "small.bdf" else 1e-8  # fields of eight characters
        own = np.linalg.eigvalsh(each.stiffness.toarray())
        assert own == pytest.approx(first, rel=close, abs=close * first[-1]), name


def test_elements_that_are_inside_out_are_turned(tmp_path: Path) -> None:
    for count in (4, 10, 20):
        part = bar((2, 1, 1), count)
        mirrored = Bar(part.x * [1.0, -1.0, 1.0], part.elements, part.sets)
        K, M, _ = dense(tmp_path, part)
        turned = dense(tmp_path, mirrored)
        assert np.linalg.eigvalsh(turned[0]) == pytest.approx(np.linalg.eigvalsh(K), abs=1e-3)
        assert np.trace(turned[1]) == pytest.approx(np.trace(M), rel=1e-9)


WRONG = {
    "wedges": ("*NODE\n1,0,0,0\n*ELEMENT, TYPE=C3D15\n1,1\n", "wedges of type 'C3D15'"),
    "bricks": ("*NODE\n1,0,0,0\n*ELEMENT, TYPE=C3D8R\n1,1\n", "type 'C3D8R'"),
    "none": ("*NODE\n1,0,0,0\n", "has no solid elements"),
    "two parts": (
        "*PART, NAME=a\n*ELEMENT, TYPE=C3D4\n1,1,2,3,4\n*PART, NAME=b\n*ELEMENT, TYPE=C3D4\n",
        "several parts",
    ),
    "two instances": ("*NODE\n*INSTANCE, NAME=a\n*INSTANCE, NAME=b\n", "several instances"),
    "breaks off": ("*NODE\n1,0,0,0\n*ELEMENT, TYPE=C3D4\n1,1,2\n", "damaged, or breaks off"),
    "no nodes": ("*NODE\n1,0,0,0\n*ELEMENT, TYPE=C3D4\n1,1,2,3,4\n", "does not define, as 2"),
    "no mesh": ("hello", "is no mesh that is known"),
    "included": ("*NODE\n1,0,0,0\n*INCLUDE, INPUT=x\n", "includes other files"),
    "binary": ("$MeshFormat\n4.1 1 8\n", "is binary"),
    "old": ("$MeshFormat\n4 0 8\n$EndMeshFormat\n", "version of gmsh's format"),
    "bricks of gmsh": (
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n1\n1 0 0 0\n$EndNodes\n$Elements\n1\n"
        "1 5 2 1 1 1 1 1 1 1 1 1 1\n$EndElements\n",
        "hexahedra of 8 nodes",
    ),
    "wedges of Nastran": ("BEGIN BULK\nCPENTA,1,1,1,2,3,4,5,6\n", "CPENTA of 6 nodes"),
    "own axes": ("BEGIN BULK\nGRID,1,5,0.,0.,0.\n", "coordinate system of their own"),
    "one line": ("*NODE\n1,0,0,0\n*ELEMENT, TYPE=C3D4\n" + 9999 * "1,", "a line of more than"),
    "tied": ("*NODE\n1,0,0,0\n*TIE, NAME=a\nb,c\n", r"has \*TIE, which is not read"),
    "moved": ("*INSTANCE, NAME=a, PART=b\n0.,1.,0.\n*NODE\n1,0,0,0\n", "moves or turns its part"),
    "left where it is": ("*INSTANCE, NAME=a, PART=b\n0.,0.,0.\n*NODE\n1,0,0,0\n", "no solid elem"),
    "two metals": (
        "*SOLID SECTION, MATERIAL=a\n*SOLID SECTION, MATERIAL=b\n*NODE\n1,0,0,0\n",
        "is of 2 materials",
    ),
    "two metals of Nastran": ("BEGIN BULK\nPSOLID,1,1\nPSOLID,2,7\n", "is of 2 materials"),
    "heavy point": ("BEGIN BULK\nCONM2,1,1,0,5.0\n", "has CONM2, which is not read"),
    "own axes by default": ("BEGIN BULK\nGRDSET,,5\nGRID,1,,0.,0.,0.\n", "GRDSET with a coord"),
    "own axes of Abaqus": ("*NODE, SYSTEM=C\n1,0,0,0\n", "NODE that makes or moves"),
    "generated": ("*NODE\n1,0,0,0\n*NGEN\n1,5,1\n", "NGEN that makes or moves"),
    "more mass": ("*NODE\n1,0,0,0\n*NONSTRUCTURAL MASS\n5.\n", "NONSTRUCTURAL MASS, which is not"),
    "a radius": ("*NODE\n1,0,0,0\n*COUPLING, INFLUENCE RADIUS=1.\n", "a radius of its own"),
    "one name": (
        "*PART\n*NODE\n1,0,0,0\n*NSET, NSET=a\n1\n*END PART\n*ASSEMBLY\n*NSET, NSET=a\n1\n",
        "a set of one name",
    ),
    "coupled to nothing": (
        "*NODE\n1,0,0,0\n*KINEMATIC COUPLING, REF NODE=1\n",
        "of a set that it does not define",
    ),
    "free turns of Abaqus": (
        "*NODE, NSET=n\n1,0,0,0\n*SURFACE, TYPE=NODE, NAME=s\nn\n*COUPLING, REF NODE=1, SURFACE=s\n"
        "*DISTRIBUTING\n1,3\n",
        "DISTRIBUTING of some directions alone",
    ),
    "glued": ("BEGIN BULK\nBSURFS,1,,,,1\n", "has BSURFS, which is not read"),
    "two superelements": ("BEGIN BULK\nGRID,1,,0.,0.,0.\nBEGIN SUPER=1\n", "several superelements"),
    "twice": ("BEGIN BULK\nGRID,7,,0.,0.,0.\nGRID,7,,1.,0.,0.\n", "defines node 7 twice"),
    "no number": ("BEGIN BULK\nGRID,7,,0.,.,0.\n", "GRID 7 at a place that is no number"),
    "free turns": (
        "BEGIN BULK\nGRID,9,,0.,0.,0.\nRBE3,1,,9,123,1.0,123,1\n",
        "RBE3 of some directions alone",
    ),
    "huge set": ("*NODE\n1,0,0,0\n*NSET, NSET=a, GENERATE\n1,99999999999\n", "more than it can"),
}


@pytest.mark.parametrize("name", WRONG)
def test_files_that_hold_no_such_mesh_are_told_apart(tmp_path: Path, name: str) -> None:
    text, why = WRONG[name]
    (tmp_path / "part.inp").write_text(text)
    with pytest.raises(MechanismError, match=why) as caught:
        read_mesh(tmp_path / "part.inp", "links.part.mesh")
    assert caught.value.path == "links.part.mesh"


def test_meshes_that_no_memory_holds_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "part.msh").write_text(msh(bar((2, 1, 1), 10, (0.123, 0.04, 0.05))))
    monkeypatch.setenv("EIGASSIGN_LIMITS", "1e-4")
    with pytest.raises(MechanismError, match="has 45 nodes: more than 10 are not read"):
        read_mesh(tmp_path / "part.msh", "mesh")


def test_random_damage_is_an_error_and_no_crash(tmp_path: Path) -> None:
    part, rng = bar((1, 1, 1), 10), np.random.default_rng(3)
    for text in (msh(part), msh(part, "2.2"), inp(part, True), bdf(part), bdf(part, "large")):
        for _ in range(25):
            data = bytearray(text.encode())
            for at in rng.integers(0, len(data), 3):
                data[at] = rng.integers(32, 127)
            (tmp_path / "part").write_bytes(data[: rng.integers(1, 2 * len(data))])
            try:
                mesh = read_mesh(tmp_path / "part", "mesh")
            except MechanismError:
                continue
            assert np.isfinite(mesh.x).all()


def test_meshes_without_volume_or_of_any_size_are_refused_and_no_crash(tmp_path: Path) -> None:
    """Corners of an element that coincide, places that no part has: read into a whole model."""
    rng, part = np.random.default_rng(4), bar((2, 1, 1), 4)
    x, corners = part.x.copy(), part.elements[3, :2]
    x[corners[1]] = x[corners[0]]
    spoiled = [(x, "have no volume"), (1e-12 * part.x, "from its origin: is it damaged")]
    spoiled += [(1e3 * part.x, "is a part of 2.4e.05 m3: .* units: mm-t-s")]
    spoiled += [(np.where(part.x > 0.39, far, part.x), "has nodes") for far in (1e300, 1e7)]
    for _ in range(16):
        x = part.x.copy()
        x[rng.integers(len(x), size=4), rng.integers(3, size=4)] *= 10.0 ** rng.uniform(-300, 300)
        spoiled.append((x, "has (nodes|elements) |is a part"))
    for places, why in spoiled:
        try:
            ea.load_case(case(tmp_path, part._replace(x=places)), allow_outside=True).model()
        except CaseError as error:
            assert re.search(why, str(error))  # noqa: PT017
        else:
            assert why == "has (nodes|elements) |is a part"


def test_names_of_surfaces_are_quoted_in_few_words(tmp_path: Path) -> None:
    part = bar((2, 1, 1), 4)
    long = {f"{k}{'x' * 5000}": part.sets["root"] for k in range(50)}
    with pytest.raises(CaseError, match=r"has no surface 'tip'; it has 0xxx.*…, …$") as caught:
        ea.load_case(
            case(tmp_path, part._replace(sets={**long, "root": part.sets["root"]})),
            allow_outside=True,
        ).model()
    assert len(str(caught.value)) < 2000


def test_a_mesh_in_pieces_is_told(tmp_path: Path) -> None:
    one = bar((2, 1, 1), 10)
    n = len(one.x)
    x = np.vstack([one.x, one.x + np.array([0.4, 0.0, 0.0])])  # they touch, and share no node
    elements = np.vstack([one.elements, one.elements + n])
    with pytest.raises(CaseError, match="mesh: is in 2 pieces that share no nodes"):
        ea.load_case(case(tmp_path, Bar(x, elements, one.sets)), allow_outside=True).model()


def test_a_carriage_on_a_solid_is_told_that_it_rides_on_beams(tmp_path: Path) -> None:
    given = case(tmp_path, bar((2, 1, 1), 10), reduce_to="5 kHz")
    given["mechanism"]["links"]["cart"] = {"type": "rigid", "mass": 1.0}
    ride = {"type": "carriage", "base": "bar", "follower": "cart.start"}
    given["mechanism"]["joints"]["ride"] = ride
    given["coordinates"]["s"] = {"joint": "ride", "drive": "locked"}
    with pytest.raises(CaseError, match="rides along a link of type beam") as caught:
        ea.load_case(given, allow_outside=True)
    assert "cannot be reduced" not in str(caught.value)


def test_a_node_far_from_its_part_is_doubted(tmp_path: Path) -> None:
    given = case(tmp_path, bar((2, 1, 1), 10))
    (solid,) = (own for own in given["mechanism"]["links"].values() if own["type"] == "solid")
    for place, said in (([0.4, 5.0, 0.0], True), ([0.4, 0.5, 0.0], False)):
        solid["nodes"]["end"]["position"] = place
        lines = part_lines(ea.load_case(given, allow_outside=True).file)
        assert ("see the positions and their units" in "".join(lines)) == said


@pytest.mark.parametrize("reduce_to", [4e3, "auto", 1e9])
def test_a_solid_without_mass_is_told(tmp_path: Path, reduce_to: Any) -> None:
    given = case(tmp_path, bar((8, 1, 1), 10), reduce_to=reduce_to)
    given["mechanism"]["materials"]["metal"] = METAL | {"density": 0.0}
    with pytest.raises(MissingMassError, match="only 0 modes whose mass"):
        ea.load_case(given, allow_outside=True).model().frequencies([0.0], [], 1)


# --- nodes that stand for surfaces


@pytest.mark.parametrize("count", [4, 10, 20])
def test_a_distributing_node_follows_the_mean_of_its_surface(tmp_path: Path, count: int) -> None:
    """∫ u dA and J⁻¹ ∫ s × u dA of motions that the elements' shape functions hold."""
    (tmp_path / "part.msh").write_text(msh(bar((2, 2, 1), count)))
    mesh = read_mesh(tmp_path / "part.msh", "mesh")
    place = np.array([0.45, 0.01, -0.02])
    T, free = joined(mesh, {"end": Coupling(mesh.sets["tip"], place, False)}, "")
    assert len(free) == T.shape[0] - 6
    rng = np.random.default_rng(5)
    C = rng.standard_normal((3, 3 if count == 4 else 6))

    def motion(y: np.ndarray, z: np.ndarray) -> np.ndarray:
        y, z = 50.0 * y, 50.0 * z
        return np.stack([np.ones_like(y), y, z, y * y, y * z, z * z][: C.shape[1]], axis=-1) @ C.T

    v = np.linalg.lstsq(T.toarray(), motion(mesh.x[:, 1], mesh.x[:, 2]).ravel(), rcond=None)[0]
    at, w = np.polynomial.legendre.leggauss(4)
    y, z = (each.ravel() for each in np.meshgrid(0.01 * at, 0.015 * at, indexing="ij"))
    w = np.outer(w, w).ravel() / 4.0
    u, s = motion(y, z), np.stack([np.zeros_like(y), y, z], axis=1)
    J = np.diag([w @ (y * y + z * z), w @ (z * z), w @ (y * y)])
    theta = np.linalg.solve(J, w @ np.cross(s, u))
    assert v[3:6] == pytest.approx(theta, rel=1e-8)
    assert v[:3] == pytest.approx(w @ u + np.cross(theta, place - [0.4, 0.0, 0.0]), rel=1e-8)


def test_surfaces_that_cannot_be_stood_for_are_refused(tmp_path: Path) -> None:
    part = bar((2, 1, 1), 10)
    edge = np.flatnonzero((np.abs(part.x[:, 1] - 0.01) < 1e-9) & (part.x[:, 0] < 1e-9))
    part = part._replace(sets={**part.sets, "edge": edge, "root2": part.sets["root"][:9]})
    for first, second, why in (
        ("edge", "tip", "nodes on one line only"),
        ("root", "root2", "shares nodes with that of 'start'"),
        ("root", "bore", "the mesh has no surface 'bore'; it has root, tip, edge, root2"),
    ):
        given = case(
            tmp_path, part, nodes={"start": {"surface": first}, "end": {"surface": second}}
        )
        with pytest.raises(CaseError, match=why):
            ea.load_case(given, allow_outside=True).model()


# --- what a solid is in a case


def test_modulus_and_density_of_a_solid_are_design(tmp_path: Path) -> None:
    given = case(tmp_path, bar((4, 1, 1), 20), reduce_to="auto") | {
        "design": {
            "E": {"parameter": "materials.metal.youngs_modulus", "min": 30e9, "max": 210e9},
            "rho": {"parameter": "materials.metal.density", "min": 2000, "max": 8000},
        }
    }
    model = ea.load_case(given, allow_outside=True).model()
    y = np.array([[70e9, 2700.0], [210e9, 2700.0], [70e9, 8000.0]])
    hz = model.frequencies(np.zeros((3, 1)), y, 2)
    assert hz[1] == pytest.approx(np.sqrt(3.0) * hz[0], rel=1e-9)
    assert hz[2] == pytest.approx(np.sqrt(2700.0 / 8000.0) * hz[0], rel=1e-9)
    # proportional interiors have one basis: the bound is the same at every design
    bound = model.truncation_error(np.zeros((3, 1)), y, (1, 2))
    assert bound == pytest.approx(np.tile(bound[0], (3, 1)), rel=1e-6)
    mesh = model.discretisation_error(np.zeros((3, 1)), y, (1, 2))
    assert mesh == pytest.approx(np.tile(mesh[0], (3, 1)), rel=1e-6)


@pytest.mark.parametrize("g", [0.0, 9.81, 700.0])
def test_what_a_solid_leaves_out_is_bounded(tmp_path: Path, g: float) -> None:
    """Under its weight too, which softens it by up to a third: what is left out feels none."""

    def model_to(reduce_to: float) -> Model:
        given = case(tmp_path, part, reduce_to=reduce_to)
        given["mechanism"]["bodies"] = {"tool": {"at": "bar.end", "mass": 0.3}}
        given["mechanism"]["gravity"] = [-g, 0.0, 0.3 * g] if g else "none"
        return ea.load_case(given, allow_outside=True).model()

    part = bar((6, 1, 1), 20)
    exact = model_to(1e7).frequencies([0.0], [], 3)[0]
    for to in (100.0, 1000.0, 4000.0):
        model = model_to(to)
        raised = model.frequencies([0.0], [], 3)[0] / exact - 1.0
        bound = model.truncation_error([0.0], [], (1, 2, 3))[0]
        assert (raised > -1e-9).all()
        assert (bound >= raised - 1e-9).all()


def test_weight_of_a_solid_takes_no_dense_matrix(tmp_path: Path) -> None:
    mesh = bar((16, 3, 3), 10)
    given = case(tmp_path, mesh, reduce_to=2e4)
    given["mechanism"]["gravity"] = [0.0, 0.0, -9.81]
    tracemalloc.start()
    model = ea.load_case(given, allow_outside=True).model()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert model.pencil.weight is not None
    assert peak < 8 * (3 * len(mesh[0])) ** 2 / 2


def test_elements_are_chosen_alike_beside_parts_whose_reduction_is_not_chosen_yet(
    tmp_path: Path,
) -> None:
    found = []
    for reduce_to in ("auto", 5e4):
        given = case(tmp_path, bar((8, 1, 1), 20), reduce_to=reduce_to)
        beam = {"length": 0.6, "material": "metal", "section": "rod", "elements": "auto"}
        given["mechanism"]["sections"] = {"rod": {"shape": "circle", "diameter": 0.02}}
        given["mechanism"]["links"]["arm"] = beam
        joint = {"type": "revolute", "base": "bar.end", "follower": "arm.start", "axis": [0, 0, 1]}
        given["mechanism"]["joints"]["turn"] = joint
        given["coordinates"]["turn"] = {"joint": "turn", "drive": {"stiffness": 1e4}}
        given["expansion"] = {"q": [0.0, 0.3], "accuracy": 1e-4}
        built = load_case(given, allow_outside=True)
        found.append(built.settled.mesh.values["arm"])
        assert built.model().discretisation_error([0.0, 0.3], [], (1,)) < 2e-2
    assert found[0] == found[1]


@pytest.mark.parametrize("cells", [(20, 1, 1), (100, 1, 4)])
def test_of_one_layer_of_four_nodes_nothing_is_known(tmp_path: Path, cells: Any) -> None:
    model = ea.load_case(case(tmp_path, bar(cells, 4)), allow_outside=True).model()
    assert np.isinf(model.discretisation_error([0.0], [], (1, 2, 3))).all()


def test_poissons_ratio_of_a_solid_is_no_design(tmp_path: Path) -> None:
    given = case(tmp_path, bar((2, 1, 1), 20)) | {
        "design": {"nu": {"parameter": "materials.metal.poissons_ratio", "min": 0.2, "max": 0.4}}
    }
    with pytest.raises(CaseError, match="poissons_ratio cannot vary"):
        ea.load_case(given, allow_outside=True)
    given = case(tmp_path, bar((2, 1, 1), 20))
    given["mechanism"]["materials"] = {"metal": {"youngs_modulus": 70e9, "density": 2700.0}}
    with pytest.raises(CaseError, match="a solid needs poissons_ratio"):
        ea.load_case(given, allow_outside=True)


@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_a_slender_solid_is_a_beam_under_its_weight_at_any_design(
    tmp_path: Path, space: str
) -> None:
    """In an arm with a payload; modulus and density are design, and weight bends the arm."""
    (tmp_path / "bar.msh").write_text(msh(bar((12, 1, 1), 20, grading=1.2)))
    solid = {"type": "solid", "mesh": str(tmp_path / "bar.msh"), "nodes": ENDS, "reduce_to": 4e3}
    beam = {"length": 0.4, "elements": 12, "section": "flat", "shear": True}
    turn = {"type": "revolute", **({} if space == "planar" else {"axis": [0, 0, 1]})}
    design = {
        "E": {"parameter": "materials.other.youngs_modulus", "min": 30e9, "max": 90e9},
        "rho": {"parameter": "materials.other.density", "min": 1000, "max": 8000},
    }
    models = []
    for link in (solid, beam):
        arm = linkage(
            {
                "upper": {"length": 0.5, "elements": 3, "material": "metal", "section": "flat"},
                "fore": {"material": "other", **link},
            },
            {
                "a": {**turn, "base": "ground", "follower": "upper.start"},
                "b": {**turn, "base": "upper.end", "follower": "fore.start"},
            },
            {
                "q1": {"joint": "a", "drive": {"stiffness": 300.0}},
                "q2": {"joint": "b", "drive": {"stiffness": 90.0}},
            },
            materials={"metal": METAL, "other": METAL},
            sections={"flat": {"shape": "rectangle", "width": 0.03, "height": 0.02}},
            space=space,
            gravity=[0, -9.81] + [0] * (space == "spatial"),
            bodies={"payload": {"at": "fore.end", "mass": 2.0}},
        ) | {"title": "arm", "design": design, "expansion": {"q": [0.5, 0.8]}}
        models.append(ea.load_case(arm, allow_outside=True).model())
    y = np.array([[70e9, 2700.0], [70e9, 8000.0], [35e9, 1000.0]])
    hz = [model.frequencies(np.tile([0.5, 0.8], (3, 1)), y, 3) for model in models]
    # the second one's third mode bends the whole arm, the first two hang on drives and weight
    assert hz[0][:, :2] == pytest.approx(hz[1][:, :2], rel=2e-4)
    assert hz[0][:, 2] == pytest.approx(hz[1][:, 2], rel=3e-3)
    slopes = [model.slopes([0.5, 0.8], y[1], 2)[1] for model in models]
    assert slopes[0] == pytest.approx(slopes[1], rel=1e-2, abs=1e-9)
