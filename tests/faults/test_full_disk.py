"""A disk that is full at any moment of a run costs that run and nothing else."""

import contextlib
import ctypes
import os
import resource
import shutil
import signal
from collections.abc import Callable
from pathlib import Path

import pytest
from run_scenes import Scene, Stage, added, case_text, faults, optimize, write_a_few_files
from stopping import forked

from eigassign.errors import StorageError

_NEW_MOUNTS, _NEW_USER, _PRIVATE = 0x20000, 0x10000000, 0x44000
PAGE = resource.getpagesize()
FULL = StorageError.exit_code


def code_of(job: Callable[[], int]) -> int:
    try:
        return job()
    except StorageError as error:
        return error.exit_code


def in_a_process(job: Callable[[], int]) -> int:
    """The exit code of a process that does the job."""
    return os.waitstatus_to_exitcode(os.waitpid(forked(job), 0)[1])


def own_disk(folder: Path, options: str) -> None:
    """Mount a disk in memory at ``folder`` that only this process sees, and that ends with it."""
    libc = ctypes.CDLL(None, use_errno=True)
    nobody = os.getuid()
    if libc.unshare(_NEW_MOUNTS | (_NEW_USER if nobody else 0)):
        raise OSError(ctypes.get_errno(), "no mounts of its own")
    if nobody:
        Path("/proc/self/uid_map").write_text(f"0 {nobody} 1")
    name, flags = str(folder).encode(), ctypes.c_ulong
    if libc.mount(None, b"/", None, flags(_PRIVATE), None) or libc.mount(
        b"tmpfs", name, b"tmpfs", flags(0), options.encode()
    ):
        raise OSError(ctypes.get_errno(), "no disk of its own")


def can_mount(folder: Path) -> bool:
    def mounted() -> int:
        with contextlib.suppress(OSError, AttributeError):
            own_disk(folder, "size=1m")
            return 0
        return 1

    return in_a_process(mounted) == 0


def copied(scene: Scene, folder: Path) -> Scene:
    shutil.copytree(scene.root, folder / "scene")
    return Scene(folder / "scene", scene.earlier, scene.mine, scene.before, scene.write)


@pytest.mark.parametrize(
    ("write", "most"),
    [
        pytest.param(write_a_few_files, 12, id="a few files"),
        pytest.param(optimize, 1600, marks=pytest.mark.slow, id="optimize"),
    ],
)
def test_a_disk_with_too_few_pages_costs_the_run_alone(
    tmp_path: Path, write: Callable[[Path, Path, bool], int], most: int
) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    if not can_mount(disk):
        pytest.skip("needs a mount of its own")
    scene = next(Stage(tmp_path / "stage", write, case_text()).scenes(added))
    shutil.rmtree(scene.root / "cache", ignore_errors=True)

    def run_on(pages: int) -> int:
        own_disk(disk, "size=32m")
        there = copied(scene, disk)
        free = os.statvfs(disk).f_bfree
        (disk / "filler").write_bytes(bytes((free - pages) * PAGE))
        code = code_of(there.run)
        whole = there.whole() and not there.lost()
        (disk / "filler").unlink()
        return code if whole and not faults(there) else 100 + code

    codes = [in_a_process(lambda: run_on(pages)) for pages in range(0, most, max(1, most // 12))]  # noqa: B023
    assert set(codes) == {0, FULL}, codes
    assert codes == sorted(codes, reverse=True)
    assert codes.count(FULL) > 2


def test_a_file_that_cannot_grow_costs_the_run_alone(tmp_path: Path) -> None:
    scenes = Stage(tmp_path, write_a_few_files).scenes(added)
    codes = []
    for most, scene in zip([0, 1, 10, 17, 20, 100, 300, 10_000], scenes, strict=False):

        def run(scene: Scene = scene, most: int = most) -> int:
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
            return code_of(scene.run)

        codes.append(in_a_process(run))
        assert not faults(scene), most
    assert codes == [*[FULL] * 7, 0]
