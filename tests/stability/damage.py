"""Damaged copies of what was stored, with the hash as it was or made anew.

Bytes of the file are changed; or numbers in the arrays, which are then packed as an undamaged file
is, so that only what they say can betray them.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Arrays = dict[str, NDArray[Any]]
Damage = Callable[[Arrays, np.random.Generator], None]


def chosen(arrays: Arrays, rng: np.random.Generator, kind: str = "") -> str:
    """The name of an array of this kind, a letter of NumPy's."""
    names = [
        name for name, array in arrays.items() if array.size and kind in (array.dtype.kind, "")
    ]
    return str(rng.choice(names))


def replaced(arrays: Arrays, rng: np.random.Generator) -> None:
    flat = arrays[chosen(arrays, rng, "f")].reshape(-1)
    flat[rng.integers(len(flat))] = rng.choice([np.nan, np.inf, -np.inf])


def scaled(arrays: Arrays, rng: np.random.Generator) -> None:
    flat = arrays[chosen(arrays, rng, "f")].reshape(-1)
    flat[rng.integers(len(flat))] *= rng.choice([0.0, -1.0, 1e-300, 1e300])


def counted_otherwise(arrays: Arrays, rng: np.random.Generator) -> None:
    flat = arrays[chosen(arrays, rng, "i")].reshape(-1)
    at = rng.integers(len(flat))
    flat[at] = rng.choice([flat[at] + 1, flat[at] - 1, -1, 0, 10**9, -(2**62)])


def shortened(arrays: Arrays, rng: np.random.Generator) -> None:
    name = chosen(arrays, rng)
    arrays[name] = arrays[name].reshape(-1)[: rng.integers(arrays[name].size)].copy()


def turned(arrays: Arrays, rng: np.random.Generator) -> None:
    name = chosen(arrays, rng)
    arrays[name] = arrays[name][None].T.copy()


def removed(arrays: Arrays, rng: np.random.Generator) -> None:
    del arrays[chosen(arrays, rng)]


def garbled(arrays: Arrays, rng: np.random.Generator) -> None:
    flat = arrays[chosen(arrays, rng)].reshape(-1).view(np.uint8)
    flat[rng.integers(len(flat))] = rng.integers(32, 127)


DAMAGES: tuple[Damage, ...] = (
    *(replaced, scaled, counted_otherwise, shortened, turned, removed, garbled),
)


def forged(arrays: Mapping[str, NDArray[Any]], rng: np.random.Generator) -> Arrays:
    """``arrays``, damaged in one way."""
    copies = {name: array.copy() for name, array in arrays.items()}
    DAMAGES[int(rng.integers(len(DAMAGES)))](copies, rng)
    return copies


def damaged(whole: bytes, rng: np.random.Generator) -> bytes:
    """Another file, of which bytes are changed, missing or new, and no hash is made."""
    at, data = int(rng.integers(len(whole))), bytearray(whole)
    kind = int(rng.integers(4))
    if kind == 0:
        data[at] ^= 1 << int(rng.integers(8))
    elif kind == 1:
        del data[at : at + int(rng.integers(1, 1000))]
    elif kind == 2:
        data[at:at] = rng.bytes(int(rng.integers(1, 1000)))
    else:  # a block of an erased disk; zeros are what some blocks of a whole file are
        data[at : at + 4096] = b"\xff" * len(data[at : at + 4096])
    return bytes(data)
