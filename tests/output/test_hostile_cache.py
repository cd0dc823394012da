"""Whatever stands in the place of a cache file costs one warning, and never the run."""

import logging
import os
from collections.abc import Callable
from pathlib import Path

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
    path = tmp_path / f"{KEY}.arrays"
    place(path)
    cache = Cache(tmp_path)
    with caplog.at_level(logging.WARNING):
        assert cache.load(KEY) is None
    assert len(caplog.records) == 1
    assert "set aside" in caplog.text
    cache.store(KEY, ARRAYS)
    found = cache.load(KEY)
    assert found is not None
    np.testing.assert_array_equal(found["numbers"], ARRAYS["numbers"])
    assert len(caplog.records) == 1
