"""Arrays in one file: HDF5 for everybody, with a record in front by which it is read again.

What others wrote, which has no such record, `ForeignFile` reads within limits.

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
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import EigassignError, UsageError
from eigassign.files import MATRIX, STORED, how_to_raise, raised, read_bytes

Array = NDArray[Any]
SCHEMA = 2  # raise it when the layout of the file changes
LEAST_BLOCK = 512  # bytes of HDF5's least user block; every other one is a power of two of them
LONGEST_RECORD = 1_000_000  # bytes: parsed JSON takes up to 35 times as much
PLACE = 10**18  # stands for a place not known yet: no longer number does
_NOWHERE = (1 << 64) - 1  # where nothing is stored
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


# --- What others wrote

_DEFLATE, _SHUFFLE, _CHECKSUM = 1, 2, 3  # filters, by HDF5's numbers
_MOST = 100_000  # pieces of an array, members of a group: each some 10 µs
_SPACE, _TYPE, _LAYOUT, _FILTERS, _MORE, _TABLE = 1, 3, 8, 11, 16, 17  # kinds of messages


class Foreign(NamedTuple):
    """An array in a file of anybody's, or a group, which has no shape."""

    messages: dict[int, int]  # where each kind of message about it begins
    shape: tuple[int, ...] = ()
    dtype: np.dtype[Any] | None = None  # None of all that is no plain number


class ForeignFile:
    """HDF5 in the first layout of its format, which MATLAB writes and h5py unless told otherwise.

    Links, references and what is stored elsewhere are passed over, and so is what lies deeper than
    a group in the root. Nothing is asked of HDF5's own library, which damaged files make crash; an
    array takes no more memory than matrices may. Methods raise ValueError for damaged files, and
    UsageError for what is not read.
    """

    def __init__(self, data: bytes) -> None:
        self._data, self._base = data, 0
        places = [0, *(LEAST_BLOCK << k for k in range(20))]
        start = next((p for p in places if data[p : p + 8] == b"\x89HDF\r\n\x1a\n"), None)
        if start is None:
            raise ValueError("no HDF5")
        version, offsets, lengths = (data[start + k] for k in (8, 13, 14))
        if (version, offsets, lengths) != (0, 8, 8):
            raise UsageError("is HDF5 in a layout that is not read: MATLAB's save writes another")
        (self._base,) = struct.unpack_from("<Q", data, start + 24)
        (root,) = self._take("Q", start - self._base + 64)
        self.arrays: dict[str, Foreign] = {}
        for name, at in self._members(self._object(root)):
            self.arrays[name] = found = self._object(at)
            for inner, place in self._members(found):
                self.arrays[f"{name}/{inner}"] = self._object(place)

    def read(self, name: str) -> Array:
        """An array; its pieces are unpacked to no more than they should hold."""
        found = self.arrays[name]
        if found.dtype is None:
            raise UsageError("has an array that does not hold plain numbers")
        count = prod(found.shape)
        size = found.dtype.itemsize * count
        if size > raised(MATRIX):
            raise UsageError(f"unpacks to {size / 1e6:.3g} MB: {how_to_raise(size, MATRIX)}")
        at = found.messages[_LAYOUT]
        version, kind = self._take("BB", at)
        if version != 3 or kind > 2:
            raise UsageError("stores an array in a way that is not read: write it in full")
        if kind == 2:
            return self._in_pieces(found, at)
        (place,) = (at + 4,) if kind == 0 else self._take("Q", at + 2)
        if place == _NOWHERE:
            return np.zeros(found.shape, found.dtype)
        return np.frombuffer(self._data, found.dtype, count, self._base + place).reshape(
            found.shape
        )

    def _take(self, layout: str, at: int) -> tuple[Any, ...]:
        if not 0 <= self._base + at < len(self._data):
            raise ValueError("a place beyond its end")
        try:
            return struct.unpack_from(f"<{layout}", self._data, self._base + at)
        except struct.error as error:
            raise ValueError("a place beyond its end") from error

    def _object(self, at: int) -> Foreign:
        """The header of an object: its messages, over all blocks that they lie in."""
        version, _, count, _, size = self._take("BBHII", at)
        if version != 1:
            raise ValueError("no object")
        found, blocks = dict[int, int](), [(at + 16, size)]
        for start, length in blocks:  # which grows
            end = start + length
            while start + 8 <= end and (count := count - 1) >= 0:
                kind, size = self._take("HH", start)
                found[kind] = start + 8
                if kind == _MORE:
                    blocks.append(self._take("QQ", start + 8))
                start += 8 + size
        if not {_SPACE, _TYPE, _LAYOUT} <= found.keys():
            return Foreign(found)
        version, rank = self._take("BB", found[_SPACE])
        shape = self._take(f"{rank}Q", found[_SPACE] + (8 if version == 1 else 4))
        return Foreign(found, shape, self._dtype(found[_TYPE]))

    def _dtype(self, at: int) -> np.dtype[Any] | None:
        kind, bits, size = self._take("BB2xI", at)
        order = ">" if bits & 1 else "<"
        if kind & 15 == 0 and size in (1, 2, 4, 8):
            return np.dtype(f"{order}{'i' if bits & 8 else 'u'}{size}")
        return np.dtype(f"{order}f{size}") if kind & 15 == 1 and size in (4, 8) else None

    def _members(self, group: Foreign) -> Iterator[tuple[str, int]]:
        """Name and place of what is in a group itself; nothing of what is none."""
        table = group.messages.get(_TABLE)
        if table is None:
            return
        tree, heap = self._take("QQ", table)
        (names,) = self._take("Q", heap + 24)
        for node, *_ in self._leaves(tree, 0, "Q"):
            signature, count = self._take("4s2xH", node)
            if signature != b"SNOD":
                raise ValueError("no table of names")
            for k in range(count):
                name, place, kind = self._take("QQI", node + 8 + 40 * k)
                if kind != 2:  # a link to another name
                    start = self._base + names + name
                    text = self._data[start : self._data.index(b"\0", start)]
                    yield text.decode("utf-8", "replace"), place

    def _leaves(self, at: int, kind: int, key: str) -> Iterator[tuple[Any, ...]]:
        """Places and keys of the leaves of a tree, ``key`` the layout of these."""
        step, waiting, seen = struct.calcsize(f"<{key}"), [(at, 255)], 0
        while waiting:
            at, above = waiting.pop()
            signature, own, level, count = self._take("4sBBH", at)
            if signature != b"TREE" or own != kind or level >= above:
                raise ValueError("no tree")
            if (seen := seen + count) > _MOST:
                raise UsageError("stores an array, or names, in too many pieces")
            for k in range(count):
                start = at + 24 + (step + 8) * k
                (child,) = self._take("Q", start + step)
                if level:
                    waiting.append((child, level))
                else:
                    yield child, *self._take(key, start)

    def _in_pieces(self, found: Foreign, at: int) -> Array:
        rank, tree = self._take("BQ", at + 2)
        shape = self._take(f"{rank}I", at + 11)[:-1]
        filters, out = self._filters(found.messages), np.zeros(found.shape, found.dtype)
        if len(shape) != out.ndim or prod(shape) * out.itemsize > raised(MATRIX):
            raise ValueError("pieces of another shape")
        for place, size, mask, *corner in self._leaves(tree, 1, f"II{rank}Q") if out.size else ():
            start = self._base + place
            if start + size > len(self._data):
                raise ValueError("a piece beyond its end")
            used = [each for k, each in enumerate(filters) if not mask >> k & 1]
            piece = _unpacked(self._data[start : start + size], used, shape, out.dtype)
            room = tuple(slice(c, c + n) for c, n in zip(corner, shape, strict=False))
            out[room] = piece[tuple(slice(n) for n in out[room].shape)]
        return out

    def _filters(self, messages: Mapping[int, int]) -> list[int]:
        if _FILTERS not in messages:
            return []
        at, found = messages[_FILTERS], list[int]()
        version, count = self._take("BB", at)
        at += 8 if version == 1 else 2
        for _ in range(count):
            each, name, _, values = self._take("HHHH", at)
            found.append(each)
            # names are padded, an odd number of values too
            at += 8 + -(-name // 8) * 8 + 4 * (values + values % 2)
        if version != 1 or {*found} - {_DEFLATE, _SHUFFLE, _CHECKSUM}:
            raise UsageError("packs an array in a way that is not read: write it uncompressed")
        return found


def _unpacked(
    packed: bytes, filters: Sequence[int], shape: tuple[int, ...], dtype: np.dtype[Any]
) -> Array:
    size = dtype.itemsize * prod(shape)
    for each in reversed(filters):
        if each == _DEFLATE:
            packed = zlib.decompressobj().decompress(packed, size + 4)
        elif each == _CHECKSUM:
            packed = packed[:-4]
        else:
            packed = np.frombuffer(packed, "u1").reshape(dtype.itemsize, -1).T.tobytes()
    return np.frombuffer(packed, dtype).reshape(shape)
