"""Whatever stands in the place of a cache file costs one warning, and never the run."""

from __future__ import annotations

import io
import logging
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import eigassign as ea
from eigassign.errors import StorageError
from eigassign.output import Cache, header, key, pack

KEY = key(("hostile",))
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


@pytest.mark.parametrize("place", PLACED, ids=lambda place: place.__name__)
def test_what_is_no_file_is_no_reduced_model(place: Callable[[Path], None], tmp_path: Path) -> None:
    place(tmp_path / "a.h5")
    with pytest.raises(StorageError, match=r"cannot read .*a\.h5"):
        ea.load_reduced(tmp_path / "a.h5")


def external(file: Any) -> None:
    file.create_dataset("numbers", shape=(6,), dtype="f8", external=[("/etc/passwd", 0, 48)])


def external_link(file: Any) -> None:
    file["numbers"] = h5py.ExternalLink("/etc/other.h5", "/numbers")


def soft_link(file: Any) -> None:
    file["numbers"] = h5py.SoftLink("/integers")


def virtual(file: Any) -> None:
    layout = h5py.VirtualLayout((6,), "f8")
    layout[:] = h5py.VirtualSource("/etc/other.h5", "numbers", (6,))
    file.create_virtual_dataset("numbers", layout)


def absurd(file: Any) -> None:
    file.create_dataset("numbers", shape=(10**9, 10**9), dtype="f8", chunks=(1000, 1000))


def packed_tight(file: Any) -> None:
    file.create_dataset("numbers", data=np.zeros(10**6), compression="gzip")


def nested(file: Any) -> None:
    file.create_group("numbers/a/b/c/d")


def text(file: Any) -> None:
    file.create_dataset(
        "numbers", data=np.array([b"x"] * 6, dtype=object), dtype=h5py.string_dtype()
    )


MADE = [external, external_link, soft_link, virtual, absurd, packed_tight, nested, text]


@pytest.mark.parametrize("make", MADE, ids=lambda make: make.__name__)
def test_hdf5_that_no_cache_writes_is_damaged_however_right_its_hash(
    make: Callable[[Any], None], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    buffer = io.BytesIO(pack(KEY, ARRAYS, {}))
    with h5py.File(buffer, "r+") as file:
        del file["numbers"]
        make(file)
    content = buffer.getvalue()[512:]  # behind the header
    (tmp_path / f"{KEY}.h5").write_bytes(header(KEY, content) + content)
    assert Cache(tmp_path).load(KEY) is None
    assert "never stored" in caplog.text
