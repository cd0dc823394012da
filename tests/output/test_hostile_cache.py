"""Whatever stands in the place of a cache file costs one warning, and never the run."""

import hashlib
import logging
import os
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from eigassign.output import Cache

KEY = 64 * "0"
ARRAYS = {"numbers": np.arange(6.0), "integers": np.arange(3)}


def pipe(path: Path) -> None:
    os.mkfifo(path)


def folder(path: Path) -> None:
    path.mkdir()
    (path / "inside").touch()


def endless_link(path: Path) -> None:
    path.symlink_to(path)


def device(path: Path) -> None:
    path.symlink_to("/dev/zero")


def terabyte(path: Path) -> None:
    with open(path, "wb") as file:
        file.truncate(10**12)


def empty(path: Path) -> None:
    path.touch()


def of_another_key(path: Path) -> None:
    other = Cache(path.parents[1] / "other")
    other.store(64 * "1", ARRAYS)
    path.write_bytes((other.directory / f"{64 * '1'}.h5").read_bytes())


PLACED = [pipe, folder, endless_link, device, terabyte, empty, of_another_key]


@pytest.mark.parametrize("place", PLACED, ids=lambda place: place.__name__)
def test_what_is_no_file_of_the_cache_is_set_aside_with_one_warning(
    place: Callable[[Path], None], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    cache = Cache(tmp_path / "cache")
    cache.directory.mkdir()
    place(cache.directory / f"{KEY}.h5")
    with caplog.at_level(logging.WARNING):
        assert cache.load(KEY) is None
    assert len(caplog.records) == 1
    assert "set aside" in caplog.text
    assert [p.name for p in cache.directory.iterdir()] == [f"{KEY}.h5.damaged"]
    cache.store(KEY, ARRAYS)
    found = cache.load(KEY)
    np.testing.assert_array_equal(found["numbers"], ARRAYS["numbers"])
    assert len(caplog.records) == 1


def test_a_stored_file_is_hdf5_for_everybody(tmp_path: Path) -> None:
    Cache(tmp_path).store(KEY, ARRAYS)
    with h5py.File(tmp_path / f"{KEY}.h5") as file:
        assert {name: stored[()].tolist() for name, stored in file.items()} == {
            name: array.tolist() for name, array in ARRAYS.items()
        }


def bomb(file: h5py.File) -> None:
    file.create_dataset("numbers", (10**12,), "f8", compression="gzip", fillvalue=1.0)


def unwritten(file: h5py.File) -> None:
    file.create_dataset("numbers", (10**12,), "f8")


def link(file: h5py.File) -> None:
    file["numbers"] = h5py.ExternalLink("other.h5", "numbers")


def elsewhere(file: h5py.File) -> None:
    file.create_dataset("numbers", (64,), "u1", external=[("/etc/hostname", 0, 64)])


def group(file: h5py.File) -> None:
    file.create_group("numbers")


@pytest.mark.parametrize("made", [bomb, unwritten, link, elsewhere, group])
def test_a_file_with_a_hash_to_match_reads_no_other_file_and_takes_no_more_memory_than_it_is_long(
    made: Callable[[h5py.File], None], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    cache, path = Cache(tmp_path), tmp_path / f"{KEY}.h5"
    cache.store(KEY, ARRAYS)
    start = path.read_bytes().partition(b" ")[0]
    with h5py.File(path, "w", userblock_size=512) as file:
        made(file)
    data = path.read_bytes()
    digest = hashlib.sha256(KEY.encode() + data[512:]).hexdigest()
    block = start + f" 4 {digest}\n".encode()
    path.write_bytes(block.ljust(512, b"\0") + data[512:])
    with caplog.at_level(logging.WARNING):
        assert cache.load(KEY) is None
    assert "never stored" in caplog.text
