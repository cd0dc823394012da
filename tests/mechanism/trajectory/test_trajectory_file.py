"""Joint samples from CSV files, good and bad."""

from pathlib import Path

import numpy as np
import pytest

from eigassign.errors import MechanismError, TrajectoryError
from eigassign.mechanism import read_samples

Q = ("q1", "q2")


def written(folder: Path, content: str | bytes) -> Path:
    file = folder / "arm.csv"
    file.write_bytes(content.encode() if isinstance(content, str) else content)
    return file


@pytest.mark.parametrize(
    "content",
    [
        "time,q1,q2\n0,1,2\n0.5,3,4\n",
        "time,q1,q2\n0,1,2\n0.5,3,4",  # no newline at the end
        "q2,time,q1\n2,0,1\n4,0.5,3\n",
        "time [s] , q1 [rad],q2[rad]\n0, 1, 2\n0.5, 3, 4\n",
        "time [ms],q1,q2 [mrad]\n0,1,2000\n500,3,4e3\n",
        "\ufefftime,q1,q2\r\n0,1,2\r\n0.5,3,4\r\n",  # as spreadsheets write it
        '# measured\n\n"time","q1","q2"\n# run 7\n0,1,"2"\n\n+.5,3.,4\n',
        "time;q1;q2\n0;1;2\n0.5;3;4\n",
        "time;q1;q2\n0;1;2\n0,5;3,0;4\n",  # as spreadsheets of half of Europe write them
        "\ufeffsep=;\r\ntime;q1;q2 [mrad]\r\n0;1;2000\r\n0,5;3;4e3\r\n",
        "# by hand\ntime\tq1\tq2\n0\t1\t2\n0,5\t3\t4\n",
    ],
)
def test_files_are_read_in_any_order_unit_and_dress(tmp_path, content):
    table = read_samples(written(tmp_path, content), Q)
    np.testing.assert_array_equal(table.time_s, [0.0, 0.5])
    np.testing.assert_array_equal(table.q, [[1.0, 2.0], [3.0, 4.0]])
    assert table.notes == ()


@pytest.mark.parametrize("unit", ["deg", "°"])
def test_degrees_become_radians(tmp_path, unit):
    table = read_samples(written(tmp_path, f"time,q1 [{unit}],q2\n0,180,1\n1,-90,1\n"), Q)
    np.testing.assert_allclose(table.q, [[np.pi, 1.0], [-np.pi / 2, 1.0]], rtol=1e-15)


@pytest.mark.parametrize("header", ["t (ms),a (deg),b", "t_ms,a_deg,b", "t ms,a deg,b"])
def test_units_are_read_however_a_log_writes_them(tmp_path, header):
    t, a, _ = header.split(",")
    file = written(tmp_path, f"{header}\n0,9,1\n500,-9,1\n")
    table = read_samples(file, Q, written={"time": t, "q1": a, "q2": "b"})
    np.testing.assert_allclose(table.q[:, 0], [np.pi / 20, -np.pi / 20], rtol=1e-15)
    np.testing.assert_array_equal(table.time_s, [0.0, 0.5])


def test_extra_columns_are_ignored_with_a_note(tmp_path):
    table = read_samples(written(tmp_path, "time,q1,q2,torque [N m],\n0,1,2,x,\n1,1,2,,\n"), Q)
    assert table.q.shape == (2, 2)
    assert table.notes == ("arm.csv: ignored the columns torque",)


GOOD = "time,q1,q2\n0,1,2\n"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "arm.csv: is empty"),
        ("\n\n# nothing\n", "arm.csv: is empty"),
        ("time,q1,q2\n", "arm.csv: 0 samples; at least two"),
        (GOOD, "arm.csv: 1 samples; at least two"),
        ("time,q1\n0,1\n1,2\n", "arm.csv:1: no column q2; the columns are time, q1"),
        ("# x\ntimes,q1,q2\n0,1,2\n", "arm.csv:2: no column time; .* did you mean 'times'"),
        ("time;q1\n0;1\n1;2\n", "arm.csv:1: no column q2; the columns are time, q1"),
        ("time q1 q2\n0 1 2\n", "arm.csv:1: no column time; .* separated by commas, semi"),
        (
            "0,1,2\n1,1,2\n",
            r"are 0, 1, 2.* first line must be a header, such as time \[s\],q1",
        ),
        (
            "time_ms,q1\n0,1\n",
            r"no column time; .* if it is 'time_ms', call it time \[ms\]",
        ),
        (
            "time,Q1,q2\n0,1,2\n",
            r"no column q1; .* Q1, q2.* if it is 'Q1', call it q1 \[rad\]",
        ),
        ("time,q1,q2,q1 [deg]\n0,1,2,3\n", "arm.csv:1: column q1 appears 2 times"),
        ("time,q1 [degrees],q2\n0,1,2\n", "arm.csv:1: column q1: unknown unit 'degrees'"),
        ("time,q1 [mm],q2\n0,1,2\n", r"arm.csv:1: column q1: \[mm\] is no unit of angle"),
        ("time [rad],q1,q2\n0,1,2\n", r"arm.csv:1: column time: \[rad\] is no unit of time"),
        ("time,q1 [rpm],q2\n0,1,2\n", "arm.csv:1: column q1: .rpm. is no unit of "),
        ("time,q1 [deg,q2\n0,1,2\n", r"arm.csv:1: column 'q1 \[deg' must read"),
    ],
)
def test_files_that_are_wrong_as_a_whole(tmp_path, content, message):
    with pytest.raises(MechanismError, match=message) as error:
        read_samples(written(tmp_path, content), Q)
    assert error.value.path == "trajectory.file"
    assert not isinstance(error.value, TrajectoryError)
    assert error.value.exit_code == 2


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("1,x,2", "column q1: 'x' is not a finite number"),
        ("1,,2", "column q1: '' is not a finite number"),
        ("1,nan,2", "column q1: 'nan' is not a finite number"),
        ("1,2,inf", "column q2: 'inf' is not a finite number"),
        ("1,2,1e999", "column q2: '1e999' is not a finite number"),
        ("1,1_000,2", "column q1: '1_000' is not a finite number"),
        ("1,0x10,2", "column q1: '0x10' is not a finite number"),
        ("1,30 deg,2", "column q1: '30 deg' is not a finite number"),
        ("12:30,1,2", "column time: '12:30' is not a finite number"),
        ("1,2", "2 values for 3 columns"),
        ("1,2,3,4", "4 values for 3 columns"),
        ("0,5,1,2", "4 values for 3 columns"),  # a decimal comma
    ],
)
def test_lines_that_are_wrong_are_named(tmp_path, line, message):
    with pytest.raises(TrajectoryError, match=f"arm.csv:4: {message}") as error:
        read_samples(written(tmp_path, f"{GOOD}\n{line}\n"), Q)
    assert error.value.sample == 1


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"time,q1,q2\n0,1,\xff\n", "not a text file in UTF-8"),
        (b"\x89PNG\r\n\x1a\n\x00\x00", "not a text file in UTF-8"),
        (b"time,q1,q2\n0,1,\x00\n", "zero bytes"),
        ("time,q1,q2\n".encode("utf-16"), "not a text file in UTF-8"),
        (b'time,q1,q2\n0,1,"2\n', "arm.csv:2: unexpected end of data.*close every quote"),
        (
            b"time,q1,q2\n0,1," + b"9" * 200_000 + b"\n",
            "arm.csv:2: field larger.*one number, or one name",
        ),
    ],
)
def test_files_that_are_no_table_of_text(tmp_path, content, message):
    with pytest.raises(MechanismError, match=message):
        read_samples(written(tmp_path, content), Q)


def test_a_file_that_cannot_be_read_is_named_with_the_reason(tmp_path):
    with pytest.raises(MechanismError, match=r"none\.csv: cannot be read: No such file"):
        read_samples(tmp_path / "none.csv", Q)
    with pytest.raises(MechanismError, match="cannot be read: it is a folder"):
        read_samples(tmp_path, Q)


def test_strokes_are_lengths(tmp_path: Path) -> None:
    file = written(tmp_path, "time,q1 [deg],q2 [mm]\n0,180,1\n1,-90,2\n")
    table = read_samples(file, Q, ("rad", "m"))
    np.testing.assert_allclose(table.q, [[np.pi, 1e-3], [-np.pi / 2, 2e-3]])
    with pytest.raises(MechanismError, match=r"\[deg\] is no unit of length"):
        read_samples(file, Q, ("m", "m"))


@pytest.mark.parametrize(
    ("content", "line", "says"),
    [
        ("time;q1;q2\n0;0.5;0\n1;0,5;0\n", 3, "'0,5' is not a finite number; .* not both"),
        ("time;q1;q2\n0;1.234,5;0\n1;0,5;0\n", 2, "'1.234,5' is not a finite number"),
        ("time,q1,q2\n0,0,5,0,1\n", 2, r"5 values for 3 columns \(decimals take a point\)"),
    ],
)
def test_decimals_that_can_be_read_in_two_ways_are_refused(tmp_path, content, line, says):
    with pytest.raises(TrajectoryError, match=f"arm.csv:{line}: .*{says}"):
        read_samples(written(tmp_path, content), Q)


def test_degrees_without_their_unit_are_refused_where_they_cannot_be_radians(tmp_path):
    says = r"arm.csv:3: column q2: -91.7 rad is more than two turns.* write q2 \[deg\], or q2 \[rad"
    with pytest.raises(TrajectoryError, match=says) as error:
        read_samples(written(tmp_path, "time,q1 [deg],q2\n0,0,0\n1,45,-91.7\n"), Q)
    assert error.value.sample == 1


@pytest.mark.parametrize(
    ("header", "units"), [("q1 [rad],q2 [rad]", ()), ("q1 [deg],q2 [deg]", ()), ("q1,q2", "mm")]
)
def test_many_turns_and_long_strokes_are_read_where_the_unit_is_clear(tmp_path, header, units):
    file = written(tmp_path, f"time,{header}\n0,0,-720.5\n1,91.7,0\n")
    assert len(read_samples(file, Q, units).q) == 2


LOG = "timestamp;actual_q_0;actual_q_1;\n"
NAMES = {"time": "timestamp", "q1": "actual_q_0 [deg]", "q2": "actual_q_1"}


def test_columns_of_a_log_are_mapped_with_their_units(tmp_path):
    """A separator ends every row, as controllers write it."""
    table = read_samples(written(tmp_path, f"{LOG}0,5;180;1;\n0,75;90;1;\n"), Q, written=NAMES)
    np.testing.assert_allclose(table.q, [[np.pi, 1.0], [np.pi / 2, 1.0]], rtol=1e-15)
    np.testing.assert_array_equal(table.time_s, [0.5, 0.75])
    assert table.notes == ()


def test_a_log_without_time_has_a_rate(tmp_path):
    names = {key: NAMES[key] for key in Q}
    file = written(tmp_path, "actual_q_0,actual_q_1\n0,1\n10,1\n20,1\n")
    table = read_samples(file, Q, written=names, rate_hz=125.0)
    np.testing.assert_allclose(table.time_s, [0.0, 0.008, 0.016], rtol=1e-15)


@pytest.mark.parametrize("zone", ["", "Z", "+02:00"])
def test_times_of_day_count_from_the_first(tmp_path, zone):
    days = ("2026-02-28T23:59:59.998", "2026-03-01T00:00:00.002", "2026-03-01T00:00:00.006")
    rows = "".join(f"{day}{zone},{k},1\n" for k, day in enumerate(days))
    table = read_samples(written(tmp_path, f"time,q1,q2\n{rows}"), Q)
    np.testing.assert_allclose(table.time_s, [0.0, 0.004, 0.008], atol=1e-12)


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ({"q1": "actual_q_7"}, "no column actual_q_7; .*did you mean"),
        ({"q3": "actual_q_0"}, "columns: unknown column 'q3'"),
        ({"q1": "actual_q_0 [kg]"}, "column q1: .*kg"),
        ({"q1": "a[b]c"}, "must read `name` or `name"),
    ],
)
def test_wrong_columns_of_a_log_are_told(tmp_path, names, message):
    with pytest.raises(MechanismError, match=message):
        read_samples(written(tmp_path, f"{LOG}0;1;1;\n1;1;1;\n"), Q, written={**NAMES, **names})
