"""A reduced model in one file of arrays, checked by its hash before it is read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import StorageError, UsageError
from eigassign.hdf5 import DamagedError, get, pack
from eigassign.modal.reduced.model import ReducedModel
from eigassign.modal.storage import FORMAT, reduced_arrays, reduced_from_arrays
from eigassign.output.exchange.files import ENDINGS, write_exchange
from eigassign.output.store.atomic import replace_synced


def save_reduced(
    reduced: ReducedModel,
    path: str | Path,
    title: str = "",
    within: NDArray[np.float64] | None = None,
) -> tuple[Path, ...]:
    """Write ``reduced`` to ``path``, whole or not at all; the files. Raises StorageError.

    The ending .npz, .mat or .c asks for the `exchange` formats, which answer between the samples
    ``within`` (n, n_x) alone, any other for HDF5.
    """
    path = Path(path)
    if path.suffix in ENDINGS:
        return write_exchange(reduced, path, title, within)
    meta = {
        "what": "reduced model",
        "modes": ", ".join(map(str, reduced.modes)),
        "size": str(reduced.size),
        "expansion points": str(len(reduced.points)),
    }
    try:
        replace_synced(path, pack(FORMAT, reduced_arrays(reduced), meta))
    except OSError as error:
        raise StorageError(f"cannot write {path}: {error.strerror}") from error
    return (path,)


def load_reduced(path: str | Path) -> ReducedModel:
    """Read what `save_reduced` wrote; StorageError for a missing, damaged or other file."""
    path = Path(path)
    try:
        return reduced_from_arrays(get(path, FORMAT).arrays)
    except OSError as error:
        raise StorageError(f"cannot read {path}: {error.strerror}") from error
    except (DamagedError, UsageError) as error:
        raise StorageError(f"{path} is not an intact reduced model: {error}") from error
