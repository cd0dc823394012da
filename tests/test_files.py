"""What anybody may have put at a path is read within limits, or refused; nothing waits for it."""

import os
from pathlib import Path

import pytest

from eigassign.errors import UsageError
from eigassign.files import json_value, read_bytes


def refusal(path: Path | str, limit: int = 1000) -> str:
    with pytest.raises(OSError) as caught:  # noqa: PT011 - of any kind, with its words
        read_bytes(path, limit)
    return caught.value.strerror or ""


def test_a_file_within_the_limit_is_read_whole(tmp_path: Path) -> None:
    data = os.urandom(3_000_000)
    (tmp_path / "a").write_bytes(data)
    assert read_bytes(tmp_path / "a", 3_000_000) == data


def test_a_file_one_byte_over_the_limit_is_refused_with_the_way_to_raise_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a").write_bytes(bytes(1001))
    assert "EIGASSIGN_LIMITS=2 allows it" in refusal(tmp_path / "a")
    monkeypatch.setenv("EIGASSIGN_LIMITS", "2")
    assert len(read_bytes(tmp_path / "a", 1000)) == 1001


@pytest.mark.parametrize("value", ["0", "-1", "nan", "inf", "many"])
def test_a_limit_that_is_no_number_is_refused(
    value: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("EIGASSIGN_LIMITS", value)
    (tmp_path / "a").write_bytes(b"x")
    with pytest.raises(UsageError, match="EIGASSIGN_LIMITS"):
        read_bytes(tmp_path / "a", 10)


def test_a_sparse_file_of_a_terabyte_is_refused_unread(tmp_path: Path) -> None:
    with open(tmp_path / "a", "wb") as file:
        file.truncate(10**12)
    assert "too large, 0.001 MB at most" in refusal(tmp_path / "a")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_a_pipe_that_nobody_writes_to_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a")
    assert refusal(tmp_path / "a") == "it is a pipe, not a file"


def test_folders_devices_and_endless_links_are_refused(tmp_path: Path) -> None:
    assert refusal(tmp_path) == "it is a folder, not a file"
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    assert "symbolic links" in refusal(tmp_path / "loop")
    if Path("/dev/zero").exists():
        assert refusal("/dev/zero") == "it is a device, not a file"


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="no /proc here")
def test_a_file_that_holds_more_than_its_size_says_is_bounded_as_well() -> None:
    assert os.stat("/proc/self/status").st_size == 0
    assert "too large" in refusal("/proc/self/status", 10)


@pytest.mark.parametrize(
    "text", ["[" + "[]," * 5_000_000 + "0]", '[{"a":1}' + ',{"a":1}' * 3_000_000 + "]"]
)
def test_json_of_more_values_than_memory_holds_is_refused(text: str) -> None:
    for given in (text, text.encode()):
        with pytest.raises(OSError, match="EIGASSIGN_LIMITS=2 allows it"):
            json_value(given)
    assert json_value(text[:3000].rpartition(",")[0] + "]")
