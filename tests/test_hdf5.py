"""What is read of a file of arrays is what was written, bit for bit, or nothing."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable
from typing import Any

import h5py
import numpy as np
import pytest

from eigassign.errors import UsageError
from eigassign.hdf5 import DamagedError, content_key, pack, unpack

ARRAYS = {
    "coefficients": np.array([1.0, -0.0, 5e-324, np.nan, np.inf, 1.7e308]).reshape(2, 3),
    "indices": np.arange(12, dtype=np.int32).reshape(4, 3),
    "order": np.array(4),
    "nothing": np.zeros((0, 7)),
    "flags": np.array([True, False]),
    "columns": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
    "phasor": np.array([1 + 2j]),
}
WORDS = {"case": "Zweigelenkarm ä [q1]", "modes": "1"}
FIRST = len("eigassign-stored 2 ") + 64 + 1  # bytes of the line with the hash
WHOLE = pack("a key", ARRAYS, WORDS)


def bits(arrays: dict[str, np.ndarray]) -> dict[str, tuple[str, tuple[int, ...], bytes]]:
    return {n: (a.dtype.str, a.shape, a.tobytes()) for n, a in arrays.items()}


def sealed(rest: bytes) -> bytes:
    """A file whose hash is right, whatever it holds."""
    return f"eigassign-stored 2 {hashlib.sha256(rest).hexdigest()}\n".encode() + rest


def test_what_is_read_is_bit_for_bit_what_was_written_and_frozen() -> None:
    found = unpack("a key", WHOLE)
    assert bits(found.arrays) == bits(ARRAYS)
    assert found.words == WORDS
    assert not any(array.flags.writeable for array in found.arrays.values())
    assert all(array.flags.aligned for array in found.arrays.values())


def test_others_read_the_same_as_plain_hdf5() -> None:
    many = {f"a{k}": np.arange(float(k)) for k in range(100)}  # a longer record than the least
    for arrays in (ARRAYS, many):
        with h5py.File(io.BytesIO(pack("a key", arrays, WORDS))) as file:
            found = {name: file[name][()] for name in arrays}
            assert dict(file["meta"].attrs) == WORDS
        assert bits(found) == bits(arrays)


def test_the_same_content_gives_the_same_file() -> None:
    turned = dict(reversed(ARRAYS.items())), dict(reversed(WORDS.items()))
    assert pack("a key", *turned) == WHOLE
    swapped = {name: array.astype(array.dtype.newbyteorder(">")) for name, array in ARRAYS.items()}
    assert pack("a key", swapped, WORDS) == WHOLE


def test_every_single_flipped_bit_is_noticed() -> None:
    rng = np.random.default_rng(1)
    for position in (*range(512), *rng.integers(0, len(WHOLE), 400), len(WHOLE) - 1):
        data = bytearray(WHOLE)
        data[position] ^= 1 << int(rng.integers(8))
        with pytest.raises(DamagedError):
            unpack("a key", bytes(data))


RECORD = json.loads(WHOLE[FIRST:].partition(b"\n")[0])


def told(**changes: object) -> bytes:
    """The file with another record, and a hash to match."""
    line = (json.dumps({**RECORD, **changes}) + "\n").encode()
    return sealed(line + WHOLE[FIRST + len(line) :])


def one(*what: object) -> bytes:
    return told(arrays={"a": what})


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "no stored file of this version"),
        (b"eigassign-cache 1\n" + WHOLE, "no stored file of this version"),
        (WHOLE[:FIRST], "does not have the hash"),
        (WHOLE[:-100], "does not have the hash"),
        (WHOLE + b"\0", "does not have the hash"),
        (pack("another", ARRAYS, WORDS), "it holds 'another', not 'a key'"),
        (sealed(b""), "never stored"),
        (sealed(b"rubbish\n"), "never stored"),
        (sealed(b"[" * 100_000 + b"\n"), "never stored"),
        (sealed(b"[]" + b" " * 2_000_000 + b"\n"), "never stored"),
        (told(arrays=[]), "never stored"),
        (told(words=None), "never stored"),
        (one("<f8", [3]), "never stored"),
        (one("<f8", [3], len(WHOLE) - 16), "never stored"),
        (one("<f8", [10**9, 10**9], 512), "never stored"),
        (one("<f8", [-1], 512), "never stored"),
        (one("<f8", [3], -8), "never stored"),
        (one("<f8", [3.0], 512), "never stored"),
        (one("<f8", [1] * 100, 512), "never stored"),
        (one("|O", [3], 512), "never stored"),
        (one("(1000000000,)f8", [3], 512), "never stored"),
        (one([["a", "<f8"]], [3], 512), "never stored"),
    ],
)
def test_anything_else_is_damaged_however_right_its_hash(data: bytes, said: str) -> None:
    with pytest.raises(DamagedError, match=said):
        unpack("a key", data)


def external(file: Any) -> None:
    file.create_dataset("other", shape=(6,), dtype="f8", external=[("/etc/passwd", 0, 48)])


def external_link(file: Any) -> None:
    file["other"] = h5py.ExternalLink("/etc/other.h5", "/columns")


def virtual(file: Any) -> None:
    layout = h5py.VirtualLayout((6,), "f8")
    layout[:] = h5py.VirtualSource("/etc/other.h5", "columns", (6,))
    file.create_virtual_dataset("other", layout)


def bomb(file: Any) -> None:
    file.create_dataset("other", (10**12,), "f8", chunks=(10**6,), compression="gzip")[: 10**7] = 0


def many_names(file: Any) -> None:
    file["more"] = np.zeros(600_000)
    for k in range(300):
        file[f"more{k}"] = file["more"]


def nested(file: Any) -> None:
    file.create_group("/".join("abcd" * 500))


def wide(file: Any) -> None:
    for k in range(3000):
        file.create_group(f"g{k}")


def text(file: Any) -> None:
    file.create_dataset("other", data=np.array([b"x" * 10**6] * 3), dtype=h5py.string_dtype())


def reference(file: Any) -> None:
    file.create_dataset("other", data=file["columns"].ref, dtype=h5py.ref_dtype)


MADE = [external, external_link, virtual, bomb, many_names, nested, wide, text, reference]


@pytest.mark.parametrize("make", MADE, ids=lambda make: make.__name__)
def test_what_hdf5_can_do_besides_means_nothing(make: Callable[[Any], None]) -> None:
    buffer = io.BytesIO(WHOLE)
    with h5py.File(buffer, "r+") as file:
        make(file)
    data = sealed(buffer.getvalue()[FIRST:])
    assert bits(unpack("a key", data).arrays) == bits(ARRAYS)


@pytest.mark.parametrize(
    "arrays", [{"a/b": np.ones(1)}, {"meta": np.ones(1)}, {"a": np.array(["b"])}, {"": np.ones(1)}]
)
def test_what_cannot_be_stored_is_refused(arrays: dict[str, np.ndarray]) -> None:
    with pytest.raises(UsageError):
        pack("a key", arrays, {})
    with pytest.raises(UsageError):
        content_key(arrays, "")


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
