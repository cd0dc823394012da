"""Arrays in one file: HDF5 for everybody, with a record in front by which it is read again.

    eigassign-stored 2 <SHA-256 of all bytes after this line>
    {"key": …, "words": {…}, "arrays": {name: [dtype, shape, place in the file], …}}
    zeros up to 512, 1024, 2048, … bytes: the user block, which HDF5 skips
    HDF5: each array a contiguous dataset, the words once more as attributes of the group ``meta``

What is read of our own is the record: an array is so many bytes at its place, checked against the
length of the file and not copied. HDF5 itself is never asked, so that links, external and virtual
datasets, filters, references and nested groups, which anybody may put into a file, mean nothing
here, and no file takes more memory than it is long.

The hash tells damage; it is no signature. A file with another content and a hash to match is what
its author made of it, and the classes and shapes that its reader expects are all that is checked.
"""

from __future__ import annotations

import hashlib
import io
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import EigassignError, UsageError
from eigassign.files import STORED, read_bytes

Array = NDArray[Any]
SCHEMA = 2  # raise it when the layout of the file changes
LEAST_BLOCK = 512  # bytes of HDF5's least user block; every other one is a power of two of them
LONGEST_RECORD = 1_000_000  # bytes: parsed JSON takes up to 35 times as much
PLACE = 10**18  # stands for a place not known yet: no longer number does
_START = f"eigassign-stored {SCHEMA} ".encode()
_NAME = re.compile(r"[A-Za-z0-9_]+\Z")
_DTYPES = {np.dtype(code).newbyteorder("<").str for code in "?bhiqBHIQefdFD"}


class DamagedError(EigassignError):
    """The bytes are not what a finished writer left; the message says how they differ."""


@dataclass(frozen=True)
class Stored:
    """Arrays (read-only) and what they are, in words."""

    arrays: dict[str, Array]
    words: dict[str, str]


def get(path: Path, key: str) -> Stored:
    """The arrays that were packed there; raises as `read_bytes` and `unpack` do."""
    return unpack(key, read_bytes(path, STORED))


def content_key(arrays: Mapping[str, Array], algorithm: str) -> str:
    """SHA-256, 64 hex digits, of ``algorithm`` and of names, dtypes, shapes and values of arrays.

    Values count in little-endian bytes and C order, whatever the memory looks like.
    """
    plain = {name: _plain(name, arrays[name]) for name in sorted(arrays)}
    layout = {name: [array.dtype.str, array.shape] for name, array in plain.items()}
    digest = hashlib.sha256(json.dumps([algorithm, layout]).encode())
    for array in plain.values():
        digest.update(array.tobytes())
    return digest.hexdigest()


def pack(key: str, arrays: Mapping[str, Array], words: Mapping[str, str]) -> bytes:
    """The whole file; the same input gives the same bytes.

    Raises UsageError for names and dtypes that cannot be stored.
    """
    import h5py

    plain = {name: _plain(name, arrays[name]) for name in sorted(arrays)}
    words = {name: words[name] for name in sorted(words)}
    longest = len(_START) + 65 + len(_record(key, words, plain, dict.fromkeys(plain, PLACE)))
    block = LEAST_BLOCK
    while block < longest:
        block *= 2
    body = io.BytesIO()
    aligned = {"alignment_threshold": 8, "alignment_interval": 8}  # bytes, as NumPy wants numbers
    with h5py.File(body, "w", userblock_size=block, **aligned) as file:
        made = {name: file.create_dataset(name, data=array) for name, array in plain.items()}
        file.create_group("meta").attrs.update(words)
        places = {name: dataset.id.get_offset() or 0 for name, dataset in made.items()}
    record = _record(key, words, plain, places).ljust(block - len(_START) - 65, b"\0")
    rest = record + body.getbuffer()[block:]
    return _sealed(rest) + rest


def _plain(name: str, array: Array) -> Array:
    """``array`` as it is stored: little-endian, C order."""
    array = np.asarray(array)
    little = array.dtype.newbyteorder("<")
    if not _NAME.match(name) or name == "meta":
        raise UsageError(f"{name!r} cannot name a stored array: use letters, digits and _")
    if little.str not in _DTYPES:
        raise UsageError(f"{name}: arrays of dtype {array.dtype} cannot be stored")
    return np.asarray(array, dtype=little, order="C")


def _record(
    key: str, words: Mapping[str, str], arrays: Mapping[str, Array], places: Mapping[str, int]
) -> bytes:
    what = {name: [a.dtype.str, a.shape, places[name]] for name, a in arrays.items()}
    return (json.dumps({"key": key, "words": words, "arrays": what}) + "\n").encode()


def _sealed(rest: bytes | memoryview) -> bytes:
    """The first line of a file."""
    return _START + hashlib.sha256(rest).hexdigest().encode() + b"\n"


def unpack(key: str, data: bytes) -> Stored:
    """What `pack` made a file of.

    Raises DamagedError when any byte differs from what was written under ``key``.
    """
    if not data.startswith(_START):
        raise DamagedError("it is no stored file of this version")
    first = len(_START) + 65
    if data[:first] != _sealed(memoryview(data)[first:]):
        raise DamagedError("its content does not have the hash that it begins with")
    try:
        end = data.index(b"\n", first, first + LONGEST_RECORD)
        record = json.loads(data[first:end])
        if record["key"] != key:
            raise DamagedError(f"it holds {record['key']!r:.80}, not {key!r}")
        arrays = {str(name): _array(data, *what) for name, what in record["arrays"].items()}
        words = {str(name): str(text) for name, text in record["words"].items()}
    except (LookupError, ValueError, TypeError, AttributeError, RecursionError) as error:
        what = f"it holds something that was never stored ({type(error).__name__})"
        raise DamagedError(what) from error
    return Stored(arrays, words)


def _array(data: bytes, dtype: str, shape: list[int], place: int) -> Array:
    if dtype not in _DTYPES or {*map(type, shape), type(place)} != {int}:
        raise ValueError("an array of another kind")
    count, kind = prod(shape), np.dtype(dtype)
    if min([*shape, place]) < 0 or place + count * kind.itemsize > len(data):
        raise ValueError("an array beyond its end")
    return np.frombuffer(data, kind, count, place).reshape(shape)
