"""A damaged or hostile matrix file is refused by name: no crash, no wait, nothing of it quoted."""

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from imported_parts import read_matrix
from scipy import sparse

from eigassign.errors import MechanismError

GOOD = sparse.csr_array(np.diag(np.arange(1.0, 6.0)) + np.eye(5, k=1) + np.eye(5, k=-1))
PARTS: dict[str, Any] = {
    "data": GOOD.data,
    "indices": GOOD.indices,
    "indptr": GOOD.indptr,
    "shape": np.array(GOOD.shape),
    "format": np.array(b"csr"),
    "_is_array": np.array(True),
}


def refusal(file: Path) -> str:
    with pytest.raises(MechanismError) as caught:
        read_matrix(file, "key")
    return caught.value.message


def npz(folder: Path, **changes: Any) -> Path:
    np.savez(folder / "K.npz", **{**PARTS, **changes})
    return folder / "K.npz"


def test_an_undamaged_file_is_read(tmp_path: Path) -> None:
    assert (read_matrix(npz(tmp_path), "key").toarray() == GOOD.toarray()).all()


def test_an_entry_that_is_next_to_nothing_is_zero(tmp_path: Path) -> None:
    """A flipped bit makes a 0 of 2.7e-315, by which a scale was divided."""
    np.save(tmp_path / "K.npy", [[2.0, 2.7e-315], [1e-74, 2.0]])
    assert read_matrix(tmp_path / "K.npy", "key").toarray().tolist() == [[2.0, 0.0], [1e-74, 2.0]]


@pytest.mark.parametrize(
    "changes",
    [
        {"indices": np.full_like(GOOD.indices, 10**9)},
        {"indices": np.full_like(GOOD.indices, -7)},
        {"indptr": np.array([0, 10**9, 2, 3, 4, 13])},
        {"indptr": np.array([0, 12, 3, 12, 3, 13])},
        {"indptr": GOOD.indptr[:-2]},
        {"data": GOOD.data[:3]},
        {"indices": GOOD.indices.astype(float) + 0.5},
        {"shape": np.array([5, 5, 5])},
        {"shape": np.array([-5, -5])},
        {"shape": np.array([2**62, 2**62])},
        {"format": np.array(b"nonsense")},
        {"format": np.array(b"csc"), "indices": np.full_like(GOOD.indices, 10**9)},
        {"format": np.array(b"coo"), "row": GOOD.indices + 10**9, "col": GOOD.indices},
        {"format": np.array(b"bsr"), "data": np.ones((13, 1, 1)), "indices": GOOD.indices + 99},
        {"format": np.array(b"dia"), "offsets": np.array([10**9, -(10**18)])},
    ],
    ids=lambda changes: "-".join(changes),
)  # fmt: skip
def test_a_sparse_file_whose_numbers_point_elsewhere_is_refused(
    changes: dict[str, Any], tmp_path: Path
) -> None:
    assert "K.npz" in refusal(npz(tmp_path, **changes))


@pytest.mark.parametrize("last", ["3 3 430E", "3 3 4.", "3 3 4e", "3 3 -", "9 9 1.0", "3 3", "3"])
def test_a_number_that_breaks_off_never_reaches_the_reader(last: str, tmp_path: Path) -> None:
    """SciPy 1.17 reads beyond the end of the first of these."""
    (tmp_path / "K.mtx").write_text(
        f"%%MatrixMarket matrix coordinate real symmetric\n3 3 3\n1 1 2.0\n2 2 3.0\n{last}"
    )
    if last == "3 3 4.":
        assert read_matrix(tmp_path / "K.mtx", "key")[2, 2] == 4.0
    else:
        assert "cannot read K.mtx" in refusal(tmp_path / "K.mtx")


@pytest.mark.parametrize("matrix", [np.zeros((0, 0)), sparse.csr_array((0, 0))])
def test_a_matrix_without_rows_is_refused(matrix: Any, tmp_path: Path) -> None:
    file = tmp_path / ("K.npz" if sparse.issparse(matrix) else "K.npy")
    (sparse.save_npz if sparse.issparse(matrix) else np.save)(file, matrix)
    assert "K.np" in refusal(file)
    (tmp_path / "K.mtx").write_text("%%MatrixMarket matrix coordinate real general\n0 0 0\n")
    assert "K.mtx" in refusal(tmp_path / "K.mtx")


def test_what_unpacks_to_more_than_the_limit_is_refused_packed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with zipfile.ZipFile(tmp_path / "K.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("data.npy", bytes(3_000_000))
    monkeypatch.setenv("EIGASSIGN_LIMITS", "1e-3")
    assert "unpacks to 3 MB: the environment variable" in refusal(tmp_path / "K.npz")


@pytest.mark.parametrize("shape", [(10**6, 10**6), (10**12,), (3, 3, 10**9)])
def test_a_size_that_the_file_cannot_hold_is_not_believed(
    shape: tuple[int, ...], tmp_path: Path
) -> None:
    with open(tmp_path / "K.npy", "wb") as file:
        np.lib.format.write_array_header_1_0(
            file, {"descr": "<f8", "fortran_order": False, "shape": shape}
        )
        file.write(bytes(100))
    assert "cannot read K.npy" in refusal(tmp_path / "K.npy")
    rows = f"{min(shape[0], 10**6)} {min(shape[-1], 10**6)} {10**15}"
    (tmp_path / "K.mtx").write_text(f"%%MatrixMarket matrix coordinate real general\n{rows}\n")
    assert "K.mtx" in refusal(tmp_path / "K.mtx")


@pytest.mark.parametrize("kind", ["mtx", "npy", "npz"])
def test_nothing_of_a_file_of_another_kind_is_quoted(kind: str, tmp_path: Path) -> None:
    (tmp_path / f"K.{kind}").write_text("root:secret:0:0\nPASSWORD=hunter2\n")
    with pytest.raises(MechanismError) as caught:
        read_matrix(tmp_path / f"K.{kind}", "key")
    assert "secret" not in str(caught.value)
    assert "hunter2" not in str(caught.value)
