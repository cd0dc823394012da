"""MATLAB's .mat files of versions 4 to 7.3, which another process reads: see `matlab_child`.

What that process sends is only numbers: it may crash, or be ended by its limits, and indices of
sparse matrices are checked here before anything is computed with them.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.files import MATRIX, how_to_raise, raised
from eigassign.mechanism.imports.entries import ENTRIES, Contents, Matrix, UnfitError, require_few
from eigassign.mechanism.imports.matlab_child import TOO_MUCH
from eigassign.process import ONE_THREAD

_CHILD = str(Path(__file__).with_name("matlab_child.py"))
_START = 300e6  # bytes of addresses: 140 MB after all imports
_ENTRY = 32  # bytes, beside twice the file: 2·10⁷ entries took 680 MB in all, 190 of it the file
_SECONDS = 5.0  # of the processor: it starts in 0.3 s, and 150 MB, packed, took 1.5 s
_PACE = 2e7  # bytes of the file that have a second more


def _is_oldest(data: bytes) -> bool:
    """Version 4 begins with its kind, 0000 to 4052, rows, columns, 0 or 1, and length of a name."""
    if len(data) < 20:
        return False
    for order in "<>":
        kind, rows, columns, imaginary, name = np.frombuffer(data, f"{order}u4", 5).tolist()
        known = kind < 5000 and kind % 10 in (0, 1, 2) and kind // 10 % 10 < 6
        if known and rows > 0 and columns > 0 and imaginary in (0, 1) and 1 < name < 65:
            return data[19 + name : 20 + name] == b"\0"
    return False


def read_matlab(data: bytes) -> Contents | None:
    """Its variables that are matrices of numbers; None of other files."""
    if not data.startswith(b"MATLAB ") and not _is_oldest(data):
        return None
    sent, at, matrices = _sent(data), 0, dict[str, Callable[[], Matrix]]()
    while at < len(sent):
        end = sent.index(b"\n", at) + 1
        name, shape, parts = json.loads(sent[at:end])
        arrays, at = [], end
        for dtype, length in parts:
            arrays.append(np.frombuffer(sent, dtype, length, at))
            at += arrays[-1].nbytes
        matrices[name] = partial(_matrix, shape, arrays)
    return Contents(matrices)


def _sent(data: bytes) -> bytes:
    """What the other process makes of the file.

    Raises UnfitError for more than limits allow, ValueError for a file that it does not survive.
    """
    room = int(raised(MATRIX))
    memory = int(_START + _ENTRY * raised(ENTRIES) + 2 * len(data))
    seconds = int(max(_SECONDS, raised(_SECONDS)) + len(data) / _PACE)
    command = [sys.executable, "-P", "-Wignore", _CHILD, *map(str, (memory, seconds, room))]
    done = subprocess.run(
        command,
        input=data,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        timeout=10 * seconds,  # the only limit on Windows, and for machines with other work
        env={**os.environ, **ONE_THREAD},
    )
    if done.returncode == TOO_MUCH:
        raised_by = how_to_raise(room + 1, MATRIX)
        raise UnfitError(f"unpacks to more than {room / 1e6:.3g} MB: {raised_by}")
    if done.returncode:
        raise ValueError(f"its reader ended with {done.returncode}")
    return done.stdout


def _matrix(shape: tuple[int, int], arrays: list[NDArray[Any]]) -> Matrix:
    if len(arrays) == 1:
        return Matrix(arrays[0].reshape(shape[::-1]).T)
    values, rows, starts = arrays
    require_few(max(shape), len(values))
    found = (values.copy(), rows.astype(np.int64), starts.astype(np.int64))
    A: Any = sparse.csc_array(found, shape)
    A.check_format(full_check=True)
    return Matrix(A)
