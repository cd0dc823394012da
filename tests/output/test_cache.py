"""A cache hit is bit for bit what was stored, or it is no hit."""

from __future__ import annotations

import errno
import fcntl
import io
import logging
import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from eigassign.errors import StorageError, UsageError
from eigassign.output import Cache, default_directory, header, key, pack, write_files

ARRAYS = {
    "coefficients": np.array([1.0, -0.0, 5e-324, np.nan, np.inf, 1.7e308]).reshape(2, 3),
    "indices": np.arange(12, dtype=np.int32).reshape(4, 3),
    "order": np.array(4),
    "nothing": np.zeros((0, 7)),
    "flags": np.array([True, False]),
    "big_endian": np.arange(3, dtype=">f4"),
    "columns": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
    "phasor": np.array([1 + 2j]),
}
META = {"case": "Zweigelenkarm ä [q1]", "modes": "1"}
KEY = key(("test", 1))
HEADER = 512  # bytes


def bits(arrays: dict[str, np.ndarray]) -> dict[str, tuple[str, tuple[int, ...], bytes]]:
    return {n: (a.dtype.str, a.shape, a.tobytes()) for n, a in arrays.items()}


@pytest.fixture
def cache(tmp_path: Path) -> Cache:
    return Cache(tmp_path / "deep" / "cache")


@pytest.fixture
def stored(cache: Cache) -> Path:
    cache.store(KEY, ARRAYS, META)
    (path,) = cache.directory.iterdir()
    return path


@pytest.mark.usefixtures("stored")
def test_a_hit_is_bit_for_bit_what_was_stored_and_frozen(cache):
    loaded = cache.load(KEY)
    assert bits(loaded) == bits(ARRAYS)
    assert not any(array.flags.writeable for array in loaded.values())


def test_an_unknown_key_is_a_miss(cache):
    assert cache.load(KEY) is None


def test_the_same_content_gives_the_same_file(cache, stored):
    first = stored.read_bytes()
    cache.store(KEY, dict(reversed(ARRAYS.items())), dict(reversed(META.items())))
    assert stored.read_bytes() == first


def test_every_single_flipped_bit_is_noticed(cache, stored):
    whole, rng = stored.read_bytes(), np.random.default_rng(1)
    everywhere = rng.integers(0, len(whole), 400)
    for position in (*range(HEADER), *everywhere, len(whole) - 1):
        data = bytearray(whole)
        data[position] ^= 1 << int(rng.integers(8))
        stored.write_bytes(data)
        assert not cache.entries()[0].intact, position
    stored.write_bytes(whole)
    assert cache.entries()[0].intact


def flipped(path: Path) -> bytes:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 4
    return bytes(data)


def truncated(path: Path) -> bytes:
    return path.read_bytes()[:-100]


def header_only(path: Path) -> bytes:
    return path.read_bytes()[:HEADER]


def empty(path: Path) -> bytes:
    return b""


def longer(path: Path) -> bytes:
    return path.read_bytes() + b"\0"


def of_another_key(path: Path) -> bytes:
    return pack(key("another"), ARRAYS, META)


def without_a_dataset(path: Path) -> bytes:
    return resealed(path, lambda file: file.__delitem__("coefficients"))


def without_the_marker(path: Path) -> bytes:
    return resealed(path, lambda file: file.attrs.__delitem__("complete"))


def resealed(path: Path, change) -> bytes:
    """A file whose hash is right but whose HDF5 content was never finished."""
    buffer = io.BytesIO(path.read_bytes())
    with h5py.File(buffer, "r+") as file:
        change(file)
    content = buffer.getvalue()[HEADER:]
    return header(KEY, content) + content


def not_hdf5(path: Path) -> bytes:
    return header(KEY, b"rubbish") + b"rubbish"


@pytest.mark.parametrize(
    "damage",
    [
        flipped,
        truncated,
        header_only,
        empty,
        longer,
        of_another_key,
        without_a_dataset,
        without_the_marker,
        not_hdf5,
    ],
)
def test_a_damaged_file_is_set_aside_with_a_warning_and_can_be_rebuilt(
    cache, stored, damage, caplog
):
    stored.write_bytes(damage(stored))
    assert cache.load(KEY) is None
    assert "damaged cache file" in caplog.text
    assert [p.name for p in cache.directory.iterdir()] == [f"{KEY}.h5.damaged"]
    cache.store(KEY, ARRAYS, META)
    assert bits(cache.load(KEY)) == bits(ARRAYS)


def test_arrays_that_print_alike_have_different_keys():
    long = np.zeros(5000)
    other = long.copy()
    other[2500] = 1e-300
    assert repr(long) == repr(other)
    assert key(long) != key(other)


DISTINCT = [
    None,
    True,
    1,
    1.0,
    "1",
    b"1",
    1 + 0j,
    0.0,
    -0.0,
    float("nan"),
    (),
    ("",),
    ("ab", "c"),
    ("a", "bc"),
    ("abc",),
    (("abc",),),
    (1, 2),
    ((1,), 2),
    np.array([1, 2]),
    np.array([1, 2], dtype=np.int32),
    np.array([1.0, 2.0]),
    np.array([[1.0, 2.0]]),
    np.array([[1.0], [2.0]]),
    np.array([1.0, 2.0], dtype=np.float32),
    np.array([1.0]),
    np.array(1.0),
    np.zeros((0, 2)),
    np.zeros((2, 0)),
    2**80,
]


def test_different_parts_have_different_keys():
    assert len({key(part) for part in DISTINCT}) == len(DISTINCT)


def test_equal_numbers_have_one_key_whatever_their_memory_looks_like():
    square = np.arange(6.0).reshape(2, 3)
    assert key(square) == key(np.asfortranarray(square)) == key(square.astype(">f8"))
    assert key(np.arange(10.0)[::2]) == key(np.arange(0.0, 10.0, 2.0))
    assert key((1, 2.5, "a")) == key([np.int64(1), np.float64(2.5), "a"])


def test_a_key_depends_on_the_algorithm_and_stays_what_it_was_in_earlier_releases():
    """Changing this value without raising SCHEMA would believe files of the older encoding."""
    parts = ("lam", 4, 0.5, None, (True, b"x"), np.arange(4.0).reshape(2, 2))
    expected = "445d1f3cc56119f0cea1d2c1ea57da9b54d577531cc1f2c022d063a8a6510a9c"
    assert key(parts, algorithm="taylor 1") == expected
    assert key(parts, algorithm="taylor 2") != expected


@pytest.mark.parametrize("part", [{1: 2}, {1}, object(), np.array(["a"]), np.array([None])])
def test_what_has_no_canonical_bytes_is_refused(part):
    with pytest.raises(UsageError):
        key((1, part))


@pytest.mark.parametrize(
    "arrays",
    [{"a/b": np.ones(1)}, {"meta": np.ones(1)}, {"a": np.array(["text"])}, {"": np.ones(1)}],
)
def test_what_cannot_be_stored_is_refused(cache, arrays):
    with pytest.raises(UsageError):
        cache.store(KEY, arrays, {})


def full(*_arguments: object) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_folder_that_cannot_be_written_costs_one_warning_and_nothing_else(
    cache, monkeypatch, caplog
):
    monkeypatch.setattr(os, "replace", full)
    for number in range(3):
        cache.store(key(number), ARRAYS, META)
    assert len([r for r in caplog.records if r.levelno == logging.WARNING]) == 1
    assert "No space left" in caplog.text
    assert cache.load(key(0)) is None


def test_a_file_in_the_place_of_the_folder_costs_one_warning(tmp_path, caplog):
    (tmp_path / "file").write_text("")
    cache = Cache(tmp_path / "file")
    assert cache.load(KEY) is None
    cache.store(KEY, ARRAYS, META)
    assert len(caplog.records) == 1


def test_a_full_disk_in_the_middle_of_a_write_leaves_the_earlier_file(cache, stored, monkeypatch):
    before = stored.read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        cache.store(KEY, {"other": np.ones(3)}, {})
    assert stored.read_bytes() == before
    assert list(cache.directory.iterdir()) == [stored]


def test_no_directory_is_a_cache_that_holds_nothing():
    cache = Cache(None)
    cache.store(KEY, ARRAYS, META)
    assert cache.load(KEY) is None
    assert cache.entries() == ()
    assert cache.clear() == 0


def test_entries_name_what_is_there_and_what_is_damaged(cache, stored):
    other = key("other")
    cache.store(other, {"a": np.ones(2)}, {"case": "other"})
    stored.write_bytes(flipped(stored))
    found = {entry.key: entry for entry in cache.entries()}
    assert (found[other].intact, found[other].meta) == (True, {"case": "other"})
    assert (found[KEY].intact, found[KEY].meta) == (False, {})
    assert found[KEY].size_bytes == stored.stat().st_size


def test_clear_removes_what_is_ours_and_nothing_else(cache, stored):
    cache.store(key("other"), {"a": np.ones(2)}, {})
    stored.write_bytes(b"")
    assert cache.load(KEY) is None
    dead = cache.directory / f".{KEY}.h5.1-deadbeef.tmp"
    alive = cache.directory / f".{KEY}.h5.2-deadbeef.tmp"
    foreign = cache.directory / "measurements.h5"
    for path in (dead, alive, foreign):
        path.write_bytes(b"")
    with open(alive) as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        assert cache.clear() == 3
    assert sorted(cache.directory.iterdir()) == sorted([alive, foreign])


def test_what_a_killed_writer_left_is_swept_by_the_next_reader_and_nothing_else(cache, stored):
    ours, theirs = (cache.directory / f".{name}.1-deadbeef.tmp" for name in (f"{KEY}.h5", "notes"))
    for path in (ours, theirs):
        path.write_bytes(b"half")
    assert Cache(cache.directory).load(KEY) is not None
    assert sorted(cache.directory.iterdir()) == sorted([theirs, stored])


def test_clear_says_what_it_cannot_delete(cache, stored, monkeypatch):
    def refuse(self: Path, missing_ok: bool = False) -> None:
        raise PermissionError(errno.EACCES, "Permission denied", str(self))

    monkeypatch.setattr(Path, "unlink", refuse)
    with pytest.raises(StorageError, match="Permission denied"):
        cache.clear()


def test_the_directory_follows_the_environment(tmp_path, monkeypatch):
    monkeypatch.setenv("EIGASSIGN_CACHE_DIR", str(tmp_path / "mine"))
    assert default_directory() == tmp_path / "mine"
    monkeypatch.delenv("EIGASSIGN_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert default_directory() == tmp_path / "eigassign"
    monkeypatch.setenv("XDG_CACHE_HOME", "relative/is/invalid")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setattr(sys, "platform", "linux")
    assert default_directory() == tmp_path / "home" / ".cache" / "eigassign"


WRITER = """
import sys
from pathlib import Path
import numpy as np
from eigassign.output import Cache, key
cache = Cache(Path(sys.argv[1]))
for turn in range(40):
    loaded = cache.load(key("shared"))
    assert loaded is None or (loaded["a"] == loaded["a"][0]).all()
    cache.store(key("shared"), {"a": np.full(2000, float(turn))}, {})
"""


def test_concurrent_processes_always_read_a_whole_file(tmp_path):
    environment = dict(os.environ, PYTHONPATH=os.pathsep.join(sys.path))
    command = [sys.executable, "-W", "error", "-c", WRITER, str(tmp_path / "cache")]
    writers = [subprocess.Popen(command, env=environment, stderr=subprocess.PIPE) for _ in range(3)]
    outcomes = [(writer.communicate()[1], writer.returncode) for writer in writers]
    assert outcomes == [(b"", 0)] * 3
    (path,) = (tmp_path / "cache").iterdir()
    assert path.suffix == ".h5"


def test_what_a_killed_writer_of_a_file_left_is_swept_by_the_next_writer_of_it(tmp_path):
    names = (".summary.csv.1-deadbeef.tmp", ".b.json.1-deadbeef.tmp", ".summary.csv.tmp")
    for name in names:
        (tmp_path / name).write_bytes(b"half")
    write_files(tmp_path, [], 0)
    hidden = {path.name for path in tmp_path.iterdir() if path.name.startswith(".")}
    assert hidden == set(names[1:])
    assert (tmp_path / "summary.csv").read_text().startswith("name,")
