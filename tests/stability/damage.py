"""Damaged copies of what was stored, with every hash made anew: only what they say can betray them.

Numbers, layout and the tree of classes are changed in the arrays, which are then packed as an
undamaged file is; or bytes of HDF5 are changed, and the header is made to fit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.output import header, pack

HEADER = 512  # bytes of a cache file before its HDF5

Arrays = dict[str, NDArray[Any]]
Damage = Callable[[Arrays, np.random.Generator], None]


def scaled(arrays: Arrays, rng: np.random.Generator) -> None:
    at = rng.integers(len(arrays["numbers"]))
    arrays["numbers"][at] *= 1.0 + rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-6.0, 1.0)


def replaced(arrays: Arrays, rng: np.random.Generator) -> None:
    values = [0.0, 1.0, -1.0, 1e300, 1e-300, np.nan, np.inf, rng.normal()]
    arrays["numbers"][rng.integers(len(arrays["numbers"]))] = values[rng.integers(len(values))]


def one_bit(arrays: Arrays, rng: np.random.Generator) -> None:
    bits = arrays["numbers"].view(np.uint64)
    bits[rng.integers(len(bits))] ^= np.uint64(1) << np.uint64(rng.integers(64))


def swapped(arrays: Arrays, rng: np.random.Generator) -> None:
    numbers = arrays["numbers"]
    i, j = rng.integers(len(numbers), size=2)
    numbers[[i, j]] = numbers[[j, i]]


def shifted(arrays: Arrays, rng: np.random.Generator) -> None:
    i, j = np.sort(rng.integers(len(arrays["numbers"]) + 1, size=2))
    arrays["numbers"][i:j] = np.roll(arrays["numbers"][i:j], 1)


def noisy(arrays: Arrays, rng: np.random.Generator) -> None:
    numbers = arrays["numbers"]
    numbers *= 1.0 + 10.0 ** rng.uniform(-6.0, -1.0) * rng.normal(size=len(numbers))


def counted_otherwise(arrays: Arrays, rng: np.random.Generator) -> None:
    values = arrays["integers"]
    at = rng.integers(len(values))
    values[at] = rng.choice([values[at] + 1, values[at] - 1, -1, 0, 10**9, -(2**62)])


def shortened(arrays: Arrays, rng: np.random.Generator) -> None:
    name = rng.choice(["numbers", "integers"])
    arrays[name] = arrays[name][: rng.integers(len(arrays[name]))].copy()


def misspelt(arrays: Arrays, rng: np.random.Generator) -> None:
    name = rng.choice(["tree", "layout"])
    text = arrays[name]
    digits = np.flatnonzero((text >= 48) & (text < 58))
    for _ in range(rng.integers(1, 4)):
        text[rng.choice(digits)] = rng.integers(48, 58)


def garbled(arrays: Arrays, rng: np.random.Generator) -> None:
    name = rng.choice(["tree", "layout"])
    arrays[name][rng.integers(len(arrays[name]))] = rng.integers(32, 127)


def nested(arrays: Arrays, rng: np.random.Generator) -> None:
    deep = b'{"tuple": [' * 100_000
    arrays[str(rng.choice(["tree", "layout"]))] = np.frombuffer(deep, dtype=np.uint8)


DAMAGES: tuple[Damage, ...] = (
    *(scaled, replaced, one_bit, swapped, shifted, noisy),
    *(counted_otherwise, shortened, misspelt, garbled, nested),
)


def damaged(key: str, arrays: Mapping[str, NDArray[Any]], rng: np.random.Generator) -> bytes:
    """The file that holds ``arrays`` under ``key``, damaged in one way and with the right hash."""
    copies = {name: array.copy() for name, array in arrays.items()}
    kind = int(rng.integers(len(DAMAGES) + 1))
    if kind < len(DAMAGES):
        DAMAGES[kind](copies, rng)
        return pack(key, copies, {})
    data = bytearray(pack(key, copies, {}))
    for _ in range(rng.integers(1, 6)):
        data[rng.integers(HEADER, len(data))] = rng.integers(256)
    data[:HEADER] = header(key, memoryview(data)[HEADER:])
    return bytes(data)
