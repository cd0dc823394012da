"""What a cache file is: its key, its bytes, and how they are believed.

A file is 512 bytes of header, which HDF5 skips as its user block, and then plain HDF5:

    eigassign-cache 1 | key=<sha256> | sha256=<of all bytes after the header> | complete | zeros

The hash is checked before HDF5 parses anything, so no damaged byte reaches the library.
"""

from __future__ import annotations

import hashlib
import io
import re
import struct
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import EigassignError, UsageError

Array = NDArray[Any]
Part = Array | np.generic | bool | int | float | complex | str | bytes | None | Sequence["Part"]

SCHEMA = 1  # raise it when the layout of the file or the encoding of the key changes
HEADER_BYTES = 512
MARKER = "complete"
_NAME = re.compile(r"[A-Za-z0-9_]+\Z")
_KINDS = {"b": (1,), "i": (1, 2, 4, 8), "u": (1, 2, 4, 8), "f": (2, 4, 8), "c": (8, 16)}


class DamagedError(EigassignError):
    """The bytes are not what a finished writer left; ``str()`` says how they differ."""


def key(parts: Part, *, algorithm: str = "") -> str:
    """SHA-256, 64 hex digits, of ``parts`` in canonical bytes, ``algorithm`` and the schema.

    Every part is written as type tag, length, content, so no two different inputs share bytes.
    Arrays count by dtype, shape and all their values (little-endian, C order), never by ``repr``.
    Raises UsageError for anything that has no canonical bytes (sets, dicts, objects).
    """
    digest = hashlib.sha256()
    digest.update(_encode(("eigassign", SCHEMA, algorithm)))
    digest.update(_encode(parts))
    return digest.hexdigest()


def _encode(part: object) -> bytes:
    tag, content = _content(part)
    return tag + struct.pack("<Q", len(content)) + content


def _content(part: object) -> tuple[bytes, bytes]:
    match part:
        case None:
            return b"n", b""
        case bool() | np.bool_():
            return b"b", bytes([bool(part)])
        case int() | np.integer():
            return b"i", str(int(part)).encode()
        case float() | np.floating():
            return b"f", struct.pack("<d", float(part))
        case complex() | np.complexfloating():
            return b"c", struct.pack("<dd", part.real, part.imag)
        case str():
            return b"s", part.encode("utf-8", "surrogatepass")
        case bytes():
            return b"y", part
        case np.ndarray():
            return b"a", _array_content(part)
        case tuple() | list():
            return b"t", b"".join(map(_encode, part))
    raise UsageError(f"a cache key cannot be made from a {type(part).__name__}")


def _array_content(array: Array) -> bytes:
    _require_plain("a cache key", array)
    little = array.astype(array.dtype.newbyteorder("<"), copy=False)
    return _encode((little.dtype.str, array.shape)) + little.tobytes(order="C")


def _require_plain(name: str, array: Array) -> None:
    if array.dtype.itemsize not in _KINDS.get(array.dtype.kind, ()):
        raise UsageError(f"{name}: arrays of dtype {array.dtype} cannot be stored")


def pack(entry_key: str, arrays: Mapping[str, Array], meta: Mapping[str, str]) -> bytes:
    """The whole file for ``arrays`` and ``meta``; the same input gives the same bytes."""
    import h5py

    body = io.BytesIO()
    with h5py.File(body, "w", userblock_size=HEADER_BYTES) as file:
        for name in sorted(arrays):
            _write_array(file, name, np.asarray(arrays[name]))
        file.create_group("meta").attrs.update({name: meta[name] for name in sorted(meta)})
        file.attrs["datasets"] = len(arrays)
        file.attrs[MARKER] = True
    content = body.getbuffer()[HEADER_BYTES:]
    return b"".join((_header(entry_key, content), content))


def _write_array(file: Any, name: str, array: Array) -> None:
    if not _NAME.match(name) or name == "meta":
        raise UsageError(f"{name!r} cannot name a stored array: use letters, digits and _")
    _require_plain(name, array)
    checked = array.ndim > 0 and array.size > 0  # HDF5 filters need chunks, chunks need extent
    file.create_dataset(name, data=array, **({"fletcher32": True} if checked else {}))


def _header(entry_key: str, content: bytes | memoryview) -> bytes:
    digest = hashlib.sha256(content).hexdigest()
    text = f"eigassign-cache {SCHEMA}\nkey={entry_key}\nsha256={digest}\n{MARKER}\n"
    return text.encode().ljust(HEADER_BYTES, b"\0")


def unpack(entry_key: str, data: bytes) -> tuple[dict[str, Array], dict[str, str]]:
    """Arrays (read-only) and meta of a file made by :func:`pack`.

    Raises DamagedError when any byte differs from what was written under ``entry_key``.
    """
    view = memoryview(data)
    if len(data) <= HEADER_BYTES:
        raise DamagedError(f"only {len(data)} bytes long")
    if view[:HEADER_BYTES] != _header(entry_key, view[HEADER_BYTES:]):
        raise DamagedError("its content does not have the hash that its header promises")
    try:
        return _read(data)
    except (OSError, KeyError, RuntimeError, ValueError) as error:
        raise DamagedError(f"HDF5 cannot read it ({error})") from error


def _read(data: bytes) -> tuple[dict[str, Array], dict[str, str]]:
    import h5py

    with h5py.File(io.BytesIO(data), "r") as file:
        names = [name for name in file if name != "meta"]
        if not file.attrs.get(MARKER, False) or file.attrs["datasets"] != len(names):
            raise DamagedError("it was never completed")
        arrays = {name: np.asarray(file[name][()]) for name in names}
        meta = {name: str(text) for name, text in file["meta"].attrs.items()}
    for array in arrays.values():
        array.setflags(write=False)
    return arrays, meta
