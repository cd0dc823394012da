"""A robot from URDF has the frequencies that its XML says, found here without eigassign."""

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.spatial.transform import Rotation

import eigassign as ea
from eigassign.cli import main
from eigassign.errors import CaseError, StorageError, UsageError

Floats = NDArray[np.float64]

ROBOT = Path(__file__).with_name("crane.urdf").read_text("utf-8")
STIFFNESS = {"yaw": 2e4, "pitch": 9e3, "lift": 3e5}
POSE = [0.4, -0.7, 0.06]


@pytest.fixture
def crane(tmp_path: Path) -> Path:
    path = tmp_path / "crane.urdf"
    path.write_text(ROBOT, encoding="utf-8")
    return path


# --- The oracle: poses from the XML, velocities by differences, M = Σ Jᵀ m J


def transform(element: ET.Element | None) -> Floats:
    T = np.eye(4)
    if element is not None:
        rpy = [float(v) for v in element.get("rpy", "0 0 0").split()]
        T[:3, :3] = Rotation.from_euler("xyz", rpy).as_matrix()
        T[:3, 3] = [float(v) for v in element.get("xyz", "0 0 0").split()]
    return T


def poses(root: ET.Element, q: Mapping[str, float]) -> dict[str, Floats]:
    found = {"base_link": np.eye(4)}
    for joint in root.iter("joint"):  # parents stand before children in this file
        parent, child = (joint.find(tag).get("link") for tag in ("parent", "child"))  # type: ignore[union-attr]
        element, motion = joint.find("axis"), np.eye(4)
        axis = np.array([1.0, 0, 0] if element is None else element.get("xyz").split(), dtype=float)  # type: ignore[union-attr]
        value = q.get(str(joint.get("name")), 0.0)
        if joint.get("type") == "prismatic":
            motion[:3, 3] = axis * value
        else:
            motion[:3, :3] = Rotation.from_rotvec(axis * value).as_matrix()
        found[str(child)] = found[str(parent)] @ transform(joint.find("origin")) @ motion
    return found


def mass_matrix(names: list[str], q: Floats) -> Floats:
    root, h = ET.fromstring(ROBOT), 1e-5

    def at(step: Floats) -> dict[str, Floats]:
        return poses(root, dict(zip(names, q + step, strict=True)))

    M, here = np.zeros((len(q), len(q))), at(np.zeros(len(q)))
    ends = [(at(h * e), at(-h * e)) for e in np.eye(len(q))]
    for link in root.iter("link"):
        inertial, name = link.find("inertial"), str(link.get("name"))
        if inertial is None:
            continue
        mass = float(inertial.find("mass").get("value"))  # type: ignore[union-attr, arg-type]
        i = {k: float(v) for k, v in inertial.find("inertia").attrib.items()}  # type: ignore[union-attr]
        I = np.array(  # noqa: E741
            [
                [i["ixx"], i["ixy"], i["ixz"]],
                [i["ixy"], i["iyy"], i["iyz"]],
                [i["ixz"], i["iyz"], i["izz"]],
            ]
        )
        own = transform(inertial.find("origin"))
        R = (here[name] @ own)[:3, :3]
        v, w = np.zeros((3, len(q))), np.zeros((3, len(q)))
        for k, (ahead, behind) in enumerate(ends):
            a, b = ahead[name] @ own, behind[name] @ own
            v[:, k] = (a - b)[:3, 3] / (2 * h)
            spin = (a - b)[:3, :3] @ R.T / (2 * h)
            w[:, k] = [spin[2, 1], spin[0, 2], spin[1, 0]]
        M += mass * v.T @ v + w.T @ R @ I @ R.T @ w
    return M


def test_frequencies_are_those_of_the_rigid_robot_on_its_drives(crane: Path) -> None:
    case = ea.load_case(ea.urdf_mapping(crane, STIFFNESS))
    assert list(case.file.coordinates) == ["yaw", "pitch", "lift"]
    hz = case.model().frequencies(POSE, [], 3)[0]
    M = mass_matrix(list(STIFFNESS), np.array(POSE))
    lam = eigh(np.diag(list(STIFFNESS.values())), M, eigvals_only=True)
    np.testing.assert_allclose(hz, np.sqrt(lam) / (2.0 * math.pi), rtol=1e-8)  # of differences


def test_a_stiffness_is_a_parameter_and_the_case_can_be_kept(crane: Path, tmp_path: Path) -> None:
    content = ea.urdf_mapping(crane, {"yaw": None, "pitch": "9 kN m/rad", "lift": 3e5})
    wanted = {"parameter": "coordinates.pitch.drive.stiffness", "min": 5e3, "max": 2e4}
    case = ea.load_case({**content, "design": {"k": wanted}})
    assert case.initial_design == pytest.approx([9e3])
    assert case.model().n_rigid == 1
    (tmp_path / "crane.yaml").write_text(case.file.resolved(), encoding="utf-8")
    again = ea.load_case(tmp_path / "crane.yaml")
    first, second = (each.model().frequencies(POSE, [1e4], 2) for each in (case, again))
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('type="prismatic"', 'type="floating"', "joint lift: type floating is not supported"),
        ('<child link="tool"/>', '<child link="slide"/>', "do not connect all links to one tree"),
        ('<parent link="slide"/>', "", "not a URDF file"),
        ("</robot>", "", "not a URDF file"),
        ("<robot", "<!DOCTYPE x [<!ENTITY a 'b'>]><robot", "no document type and no entities"),
        ('<axis xyz="0 0 1"/>', '<mimic joint="jaw"/>', "joint yaw mimics jaw, which is no joint"),
        ('<axis xyz="0 0 1"/>', '<mimic joint="yaw"/>', "joint yaw mimics itself, by yaw"),
        ('<mass value="5"/>', '<mass value="inf"/>', "expected a number"),
        ('name="slide"', 'name="sledge"', "do not connect all links to one tree"),
        ('"slide"', '"upper_arm"', "two names of links or joints are alike"),
        ('"yaw"', '"ground"', "or one is ground"),
        ('<mass value="5"/>', "", "link upper-arm: inertial needs mass and inertia"),
        ('<mass value="5"/>', '<mass value="five"/>', "expected a number"),
        ('xyz="0 0.6 0.8"', 'xyz="0 0.6"', "expected 3 numbers"),
        ('xyz="0 0.6 0.8"', 'xyz="0 0 0"', "joint pitch: its axis has no direction"),
        ('xyz="0 0.6 0.8"', 'xyz="0 0 ${a}"', r"xacro .*crane.urdf > robot.urdf expands it"),
        ("<robot", '<xacro:x xmlns:xacro="http://ros.org/wiki/xacro"/><robot', "xacro"),
        ("robot", "sdf", "it begins with <sdf>, not <robot>"),
        ('name="pitch"', 'name="yaw"', "two links or two joints have one name"),
    ],
)
def test_what_is_no_such_robot_is_refused(crane: Path, old: str, new: str, said: str) -> None:
    crane.write_text(ROBOT.replace(old, new), encoding="utf-8")
    with pytest.raises(UsageError, match=said):
        ea.urdf_mapping(crane, 1e4)


def test_wrong_arguments_are_refused(crane: Path) -> None:
    with pytest.raises(UsageError, match="no stiffness is given for joint pitch"):
        ea.urdf_mapping(crane, {"yaw": 1.0})
    with pytest.raises(UsageError, match="no such URDF file"):
        ea.urdf_mapping(crane.with_name("none.urdf"), 1e4)
    with pytest.raises(StorageError, match="cannot be read"):
        ea.urdf_mapping(crane.parent, 1e4)
    with pytest.raises(CaseError, match=r"case: coordinates\.yaw\.drive\.stiffness"):
        ea.load_case(ea.urdf_mapping(crane, "4 kg"))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-16-be"])
def test_entities_are_refused_in_every_encoding(crane: Path, encoding: str) -> None:
    declared = f'<?xml version="1.0" encoding="{encoding[:6]}"?>'
    text = ROBOT.replace('<?xml version="1.0"?>', declared)
    if encoding != "utf-16-be":  # which the parser knows by its mark alone
        crane.write_bytes(text.encode(encoding))
        assert len(ea.urdf_mapping(crane, 1e4)["coordinates"]) == 3
    crane.write_bytes(
        text.replace("<robot", "<!DOCTYPE x [<!ENTITY a 'b'>]><robot").encode(encoding)
    )
    with pytest.raises(UsageError, match=r"no document type and no entities|not a URDF file"):
        ea.urdf_mapping(crane, 1e4)


def test_init_writes_a_case_that_runs_and_lists_what_is_to_be_filled_in(
    crane: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(crane.parent)
    assert main(["init", "--urdf", "crane.urdf"]) == 0
    out = capsys.readouterr().out.splitlines()
    asked = out[out.index("to fill in, since URDF has none:") + 1 :]
    lines = (crane.parent / "crane.yaml").read_text(encoding="utf-8").splitlines()
    assert lines[1 : 1 + len(asked)] == [f"# - {each}" for each in asked]
    assert len(asked) == 8
    assert "flexibility of link column: rigid stands there" in asked
    assert "stiffness of the drive of lift: 20 MN/m stands there" in asked
    case = ea.load_case(crane.parent / "crane.yaml")
    drives = {"yaw": "20 kN m/rad", "pitch": "20 kN m/rad", "lift": "20 MN/m"}
    same = ea.load_case(ea.urdf_mapping(crane, drives))
    found, expected = (each.model().frequencies(POSE, [], 3) for each in (case, same))
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert main(["check", "crane.yaml"]) == 0
    assert main(["init", "--urdf", "crane.urdf"]) == 3  # it exists
    assert main(["init", "gantry", "--urdf", "crane.urdf"]) == 2
    assert "give a template or --urdf, not both" in capsys.readouterr().err


def test_a_joint_that_moves_no_mass_is_locked_and_said(
    crane: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(crane.parent)
    start = ROBOT.index("<inertial>", ROBOT.index('name="tool"'))
    end = ROBOT.index("</inertial>", start) + len("</inertial>")
    bare = (ROBOT[:start] + ROBOT[end:]).replace(
        '"flange" type="fixed"', '"flange" type="revolute"'
    )
    crane.write_text(bare, encoding="utf-8")
    assert main(["init", "--urdf", "crane.urdf"]) == 0
    assert (
        "drive of flange: nothing beyond it has mass in the URDF; locked" in capsys.readouterr().out
    )
    assert ea.load_case(crane.parent / "crane.yaml").model().frequencies([*POSE, 0.0], [], 3).all()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('<mass value="5"/>', '<mass value="-5"/>', "gives no case: .*mass: must be >= 0"),
        ('name="pitch"', 'name="ground"', "rename ground$"),
        ("inertial>", "other>", "no joint moves a mass"),
        ("robot", 1000 * "x", "it begins with <xxx"),
    ],
)
def test_init_writes_no_case_that_does_not_run(
    crane: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, said: str
) -> None:
    crane.write_text(ROBOT.replace(old, new), encoding="utf-8")
    assert main(["init", "--urdf", str(crane), "--out", str(crane.parent)]) == 2
    err = capsys.readouterr().err
    assert re.search(said, err.strip())
    assert len(err.replace(str(crane), "")) < 350
    assert not (crane.parent / "crane.yaml").exists()


def test_init_takes_robots_as_programs_write_them(crane: Path) -> None:
    """Limits of 0 and 0, products of inertia that are round-off of zeros, a name of two lines."""
    text = re.sub(r'(lower|upper)="[^"]*"', r'\1="0"', ROBOT)
    text = re.sub(r"<inertia .*?/>", '<inertia ixx="0" ixz="1e-20"/>', text, count=1)
    crane.write_text(text.replace('"crane"', '"a&#10;b: c"'), encoding="utf-8")
    assert main(["init", "--urdf", str(crane), "--out", str(crane.parent)]) == 0
    case = ea.load_case(crane.parent / "crane.yaml")
    assert (np.ptp(case.trajectory.q, axis=0) > 0.02).all()


ARM = """

  <?xml version="1.0"?>
<robot name="hand"><link name="base"/>
<link name="a">{a}</link>
<link name="b">{b}</link>
<link name="c">{a}</link>
<joint name="j" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="inf"/></joint>
<joint name="k" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0 0 0.2"/>
<axis xyz="0 1 0"/>{k}</joint>
<joint name="l" type="prismatic"><parent link="b"/><child link="c"/><origin xyz="0 0.1 0.2"/>
<axis xyz="0 1 0"/>{l}</joint></robot>
"""
BODY = """<inertial><origin xyz="0 0 0.1"/><mass value="0.5"/>
<inertia ixx="{0}" iyy="{0}" izz="0.0003" ixy="0" ixz="0" iyz="0"/></inertial>"""
SOUND, FAULTY = BODY.format("0.0012"), BODY.format("-0.0012")


def test_joints_that_mimic_follow_on_locked_drives_and_it_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One mimics a joint that mimics, and stands before blanks and an infinite limit."""
    ties = {"k": '<mimic joint="j" multiplier="-2" offset="0.1"/>', "l": '<mimic joint="k"/>'}
    (tmp_path / "hand.urdf").write_text(ARM.format(a=SOUND, b=SOUND, **ties))
    assert main(["init", "--urdf", str(tmp_path / "hand.urdf"), "--out", str(tmp_path)]) == 0
    asked, case = capsys.readouterr().out, yaml.safe_load((tmp_path / "hand.yaml").read_text())
    first, last = np.array(case["trajectory"]["points"])
    for pose in (first, last):
        assert pose[1:] == pytest.approx([0.1 - 2.0 * pose[0]] * 2)
    assert first[0] != last[0]
    assert [each["drive"] for each in case["coordinates"].values()][1:] == ["locked", "locked"]
    said = "drive of k, which follows as -2 × j + 0.1: locked there"
    assert said in asked
    assert "drive of l, which follows as 1 × k: locked there" in asked
    model = ea.load_case(ea.urdf_mapping(tmp_path / "hand.urdf", 2e3)).model()
    assert model.frequencies(first, [], 1)[0, 0] > 1.0


def refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> str:
    assert main(["init", "--urdf", str(folder / "hand.urdf"), "--out", str(folder)]) == 2
    return capsys.readouterr().err


def test_all_faulty_inertias_are_told_at_once_with_their_lines(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "hand.urdf").write_text(ARM.format(a=FAULTY, b=SOUND, k="", l=""))
    told = refused(tmp_path, capsys)
    assert re.search(
        r"link a \(line 5\), inertia: not pos.*; link c \(line 9\), inertia: not", told
    ), told
    both = ARM.format(a=FAULTY, b=SOUND, k="", l="").replace('value="0.5"', 'value="inf"')
    (tmp_path / "hand.urdf").write_text(both)
    assert refused(tmp_path, capsys).count('<mass value="inf">: expected a number') == 3


def test_a_robot_without_masses_says_whose_are_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "hand.urdf").write_text(ARM.format(a="", b="", k="", l=""))
    assert "give links <inertial>, as base, a, b, c" in refused(tmp_path, capsys)
