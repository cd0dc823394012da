"""Files of others that anything has happened to: an answer or an error that names them, no signal.

Of MATLAB's a flipped bit may crash the library that reads them. So may one in a file of the cache,
which is set aside and solved anew.
"""

import json
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from beam import TEXT
from damage import damaged
from fuzz_worker import SECONDS, Worker
from imported_parts import arm, exported, part
from scipy import io, sparse

K, M = exported("planar")
CRASHES = ((177, 2), (145, 8))  # a byte of version 5, and a bit of it: SciPy 1.17


def plain(folder: Path) -> tuple[str, str]:
    io.savemat(folder / "p.mat", {"K": sparse.csc_array(K), "M": M}, do_compression=False)
    return "p.mat:K", "p.mat:M"


def packed(folder: Path) -> tuple[str, str]:
    io.savemat(folder / "p.mat", {"K": K, "M": sparse.csc_array(M)}, do_compression=True)
    return "p.mat:K", "p.mat:M"


def npz(folder: Path) -> tuple[str, str]:
    np.savez(folder / "p.npz", K=K, M=M)
    return "p.npz:K", "p.npz:M"


def npz_sparse(folder: Path) -> tuple[str, str]:
    sparse.save_npz(folder / "p.npz", sparse.csr_array(K))
    np.save(folder / "M.npy", M)
    return "p.npz", "M.npy"


def npy(folder: Path) -> tuple[str, str]:
    np.save(folder / "p.npy", K)
    np.save(folder / "M.npy", M)
    return "p.npy", "M.npy"


WRITERS = (plain, packed, npz, npz_sparse, npy)
SLOW = pytest.mark.slow
EACH = [pytest.param(4), pytest.param(200, marks=SLOW)]


@pytest.fixture(scope="module")
def worker() -> Iterator[Worker]:
    with Worker() as running:
        yield running


@pytest.mark.parametrize("count", EACH)
@pytest.mark.parametrize("write", WRITERS)
def test_a_damaged_matrix_is_read_or_refused(
    write: Callable[[Path], tuple[str, str]],
    count: int,
    tmp_path: Path,
    worker: Worker,
    record_property: Callable[[str, object], None],
) -> None:
    tree = {"title": "a part", **arm("planar", {"part": part("planar", write(tmp_path))})}
    (tmp_path / "case.yaml").write_text(json.dumps(tree))
    (file,) = tmp_path.glob("p.*")
    whole, rng, codes = file.read_bytes(), np.random.default_rng(5), dict[int, int]()
    assert worker.ran(("check", "case.yaml"), tmp_path).code == 0
    crashing = CRASHES if write is plain else ()
    for k in range(count + len(crashing)):
        data = bytearray(whole)
        if k < len(crashing):
            data[crashing[k][0]] ^= crashing[k][1]
        elif k % 2:
            data[rng.integers(len(data))] ^= 1 << rng.integers(8)
        else:
            data[:] = damaged(whole, rng)
        file.write_bytes(data)
        start = time.monotonic()
        outcome = worker.ran(("check", "case.yaml"), tmp_path, f"{write.__name__} {k}")
        took = time.monotonic() - start
        assert not outcome.excesses(), outcome
        assert took < 3 * SECONDS, outcome  # by the clock, on a machine with other work
        assert outcome.code == 0 or "mechanism.links.part" in outcome.err, outcome
        assert "cannot read p.mat: it is damaged" in outcome.err or k >= len(crashing), outcome
        codes[outcome.code] = codes.get(outcome.code, 0) + 1
    record_property("exit codes", codes)


@pytest.mark.parametrize("count", EACH)
def test_a_damaged_file_of_the_cache_is_solved_anew(
    count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("EIGASSIGN_CACHE", "always")
    (tmp_path / "case.yaml").write_text(TEXT)
    command = ("expand", "case.yaml", "--figures", "none", "--report", "none", "--quiet")
    command = (*command, "--cache-dir", "cache", "--out", "run")
    answers, rng = set[str](), np.random.default_rng(6)
    with Worker() as worker:
        for k in range(count + 1):
            outcome = worker.ran(command, tmp_path, str(k))
            assert outcome.code == 0, outcome
            assert not outcome.excesses(), outcome
            answers.add((tmp_path / "run" / "coefficients.json").read_text())
            shutil.rmtree(tmp_path / "run")
            files = list((tmp_path / "cache").glob("*.h5"))
            assert files
            for file in files:
                file.write_bytes(damaged(file.read_bytes(), rng))
    assert len(answers) == 1
    assert len(list((tmp_path / "cache").glob("*.damaged"))) == len(files)
