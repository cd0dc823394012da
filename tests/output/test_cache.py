"""A cache hit is bit for bit what was stored, or it is no hit."""

import errno
import logging
import os
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from eigassign.errors import UsageError
from eigassign.output import Cache, content_key, default_directory, write_files

ARRAYS = {"numbers": np.array([[1.0, -0.0], [np.nan, 5e-324]]), "nothing": np.zeros((0, 7))}


def key(name: object) -> str:
    return content_key({}, str(name))


KEY = key("test")


def bits(arrays: dict[str, np.ndarray]) -> dict[str, tuple[str, tuple[int, ...], bytes]]:
    return {n: (a.dtype.str, a.shape, a.tobytes()) for n, a in arrays.items()}


@pytest.fixture
def cache(tmp_path: Path) -> Cache:
    return Cache(tmp_path / "deep" / "cache")


@pytest.fixture
def stored(cache: Cache) -> Path:
    cache.store(KEY, ARRAYS)
    (path,) = cache.directory.iterdir()
    return path


@pytest.mark.usefixtures("stored")
def test_a_hit_is_bit_for_bit_what_was_stored(cache):
    assert bits(cache.load(KEY)) == bits(ARRAYS)


def test_every_single_flipped_bit_is_noticed(cache, stored, caplog):
    caplog.set_level(logging.CRITICAL)
    rng, whole = np.random.default_rng(1), stored.read_bytes()
    for position in (*range(84), *rng.integers(0, len(whole), 100), len(whole) - 1):
        data = bytearray(whole)
        data[position] ^= 1 << int(rng.integers(8))
        stored.write_bytes(data)
        assert cache.load(KEY) is None


def test_what_cannot_be_stored_is_refused(cache):
    with pytest.raises(UsageError):
        cache.store(KEY, {"a": np.array([object()])})


def full(*_arguments: object) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_folder_that_cannot_be_written_costs_one_warning_and_nothing_else(
    cache, monkeypatch, caplog
):
    monkeypatch.setattr(os, "replace", full)
    for number in range(3):
        cache.store(key(number), ARRAYS)
    assert len([r for r in caplog.records if r.levelno == logging.WARNING]) == 1
    assert "No space left" in caplog.text
    assert cache.load(key(0)) is None


def test_a_full_disk_in_the_middle_of_a_write_leaves_the_earlier_file(cache, stored, monkeypatch):
    before = stored.read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        cache.store(KEY, {"other": np.ones(3)})
    assert stored.read_bytes() == before
    assert list(cache.directory.iterdir()) == [stored]


def test_what_a_killed_writer_left_is_swept_by_the_next_reader_and_nothing_else(cache, stored):
    ours, theirs = (cache.directory / f".{name}.1-deadbeef.tmp" for name in (f"{KEY}.h5", "notes"))
    for path in (ours, theirs):
        path.write_bytes(b"half")
    assert Cache(cache.directory).load(KEY) is not None
    assert sorted(cache.directory.iterdir()) == sorted([theirs, stored])


def aged(cache: Cache, days: list[float]) -> list[Path]:
    """Entries that were written so long ago."""
    paths = []
    for number, age in enumerate(days):
        cache.store(key(number), {"a": np.ones(1000)})
        paths.append(cache.directory / f"{key(number)}.h5")
        os.utime(paths[-1], 2 * (time.time() - 86400 * age,))
    return paths


def test_above_the_limit_the_oldest_files_go(cache, monkeypatch):
    paths = aged(cache, [3, 1, 2, 0])
    (cache.directory / "measurements.h5").write_bytes(bytes(10**6))
    size = paths[0].stat().st_size
    monkeypatch.setenv("EIGASSIGN_LIMITS", f"{3.5 * size / 1e9}")
    Cache(cache.directory).store(KEY, {"a": np.ones(1000)})
    left = {path for path in cache.directory.iterdir() if path.name != "measurements.h5"}
    assert left == {paths[1], paths[3], cache.directory / f"{KEY}.h5"}
    monkeypatch.setenv("EIGASSIGN_LIMITS", f"{0.5 * size / 1e9}")
    Cache(cache.directory).store(KEY, {"a": np.ones(1000)})
    assert [path.name for path in cache.directory.glob(f"{KEY}.h5")] == [f"{KEY}.h5"]
    assert not any(path.exists() for path in paths)


def test_what_another_machine_is_writing_is_left_alone_for_a_week(cache, stored):
    """Locks of a network folder may be seen on one machine only."""
    old, young = (cache.directory / f".{KEY}.h5.{n}-{4 * '0'}deadbeef.tmp" for n in (1, 2))
    for path, days in ((old, 8), (young, 6)):
        path.write_bytes(b"half")
        os.utime(path, 2 * (time.time() - 86400 * days,))
    assert Cache(cache.directory).load(KEY) is not None
    assert sorted(cache.directory.iterdir()) == sorted([young, stored])


def test_the_directory_follows_the_environment(tmp_path, monkeypatch):
    monkeypatch.setenv("EIGASSIGN_CACHE_DIR", str(tmp_path / "mine"))
    assert default_directory() == tmp_path / "mine"
    monkeypatch.setenv("EIGASSIGN_CACHE_DIR", "~nosuchuser/x")
    with pytest.raises(UsageError, match="EIGASSIGN_CACHE_DIR: there is no home folder for '~nosu"):
        default_directory()
    monkeypatch.delenv("EIGASSIGN_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert default_directory() == tmp_path / "eigassign"
    monkeypatch.setenv("XDG_CACHE_HOME", "relative/is/invalid")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setattr(sys, "platform", "linux")
    assert default_directory() == tmp_path / "home" / ".cache" / "eigassign"


def test_what_a_killed_writer_of_a_file_left_is_swept_by_the_next_writer_of_it(tmp_path):
    names = (".summary.csv.1-deadbeef.tmp", ".b.json.1-deadbeef.tmp", ".summary.csv.tmp")
    for name in names:
        (tmp_path / name).write_bytes(b"half")
    write_files(tmp_path, [])
    hidden = {path.name for path in tmp_path.iterdir() if path.name.startswith(".")}
    assert hidden == set(names[1:])
    assert (tmp_path / "summary.csv").read_text().startswith("name,")


def test_a_key_of_content_counts_every_bit_and_no_memory_layout() -> None:
    long = np.zeros(5000)
    other = long.copy()
    other[2500] = 1e-300
    square = np.arange(6.0).reshape(2, 3)
    distinct = [
        *({"a": array} for array in (long, other, square, square.ravel(), square.T)),
        *({"a": square.astype(kind)} for kind in ("f4", "i8", "c16")),
        *({"a": np.zeros(shape)} for shape in ((0, 2), (2, 0), (), (1,))),
        *({"a": np.array([x])} for x in (-0.0, np.nan)),
        *({"b": square}, {"a": square, "b": square}, {}),
    ]
    assert len({content_key(arrays, "1") for arrays in distinct}) == len(distinct)
    assert content_key({"a": square}, "1") != content_key({"a": square}, "2")
    alike = (np.asfortranarray(square), square.astype(">f8"), np.repeat(square, 2, axis=1)[:, ::2])
    assert {content_key({"a": array}, "1") for array in (square, *alike)} == {
        content_key({"a": square}, "1")
    }
