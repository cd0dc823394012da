"""Whatever stands in the place of a cache file costs one warning, and never the run."""

from __future__ import annotations

import hashlib
import logging
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

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


PLACED = [pipe, folder, endless_link, device, terabyte]


@pytest.mark.parametrize("place", PLACED, ids=lambda place: place.__name__)
def test_what_is_no_file_of_the_cache_is_set_aside_with_one_warning(
    place: Callable[[Path], None], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / f"{KEY}.h5"
    place(path)
    cache = Cache(tmp_path)
    assert [entry.intact for entry in cache.entries()] == [False]
    with caplog.at_level(logging.WARNING):
        assert cache.load(KEY) is None
    assert len(caplog.records) == 1
    assert "set aside" in caplog.text
    cache.store(KEY, ARRAYS, {})
    found = cache.load(KEY)
    assert found is not None
    np.testing.assert_array_equal(found["numbers"], ARRAYS["numbers"])
    assert len(caplog.records) == 1


# --- HDF5 of five megabytes that takes a gigabyte where it is believed


def many_names_of_one(file: Any) -> None:
    file["numbers"] = np.zeros(600_000)
    for k in range(400):
        file[f"more{k}"] = file["numbers"]


def packed_tight(file: Any) -> None:
    file.create_dataset("numbers", (10**9,), "f8", chunks=(10**6,), compression="gzip")[: 10**7] = 0


def large_chunks(file: Any) -> None:
    file.create_dataset("numbers", (6,), "f8", chunks=(5 * 10**8,), maxshape=(None,), fillvalue=1.0)


def wide(file: Any) -> None:
    for k in range(5000):
        file.create_group(f"g{k}")


def one_text_many_times(file: Any) -> None:
    texts = np.array([b"x" * 5_000_000] * 2, dtype=object)
    file.create_dataset("numbers", data=texts, dtype=h5py.string_dtype())


def attributes(file: Any) -> None:
    for k in range(80):
        file.attrs[f"a{k}"] = np.zeros(8000)


READ = """
import sys
from pathlib import Path
from eigassign.output import Cache
folder = Path(sys.argv[1])
assert not any(entry.intact for entry in Cache(folder).entries())
assert Cache(folder).load(sys.argv[2]) is None
print(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0])
"""


def test_no_hdf5_takes_more_memory_than_it_is_long(tmp_path: Path) -> None:
    bombs = (many_names_of_one, packed_tight, large_chunks, wide, one_text_many_times, attributes)
    for k, make in enumerate(bombs):
        plain = tmp_path / f"{make.__name__}.h5"
        with h5py.File(plain, "w", userblock_size=512) as file:
            make(file)
        assert plain.stat().st_size < 11_000_000
        rest = plain.read_bytes()[84:]
        line = f"eigassign-stored 2 {hashlib.sha256(rest).hexdigest()}\n".encode()
        (tmp_path / f"{k:064}.h5").write_bytes(line + rest)
    run = [sys.executable, "-c", READ, str(tmp_path), f"{0:064}"]
    done = subprocess.run(run, capture_output=True, text=True, check=True, timeout=60)
    assert int(done.stdout) < 400_000  # kB, of which 150 are the imports
