"""A reduced model as two files: its numbers, and what reads them; both written whole."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign._version import __version__
from eigassign.errors import StorageError, UsageError
from eigassign.files import CASE, read_bytes
from eigassign.modal.reduced.model import ReducedModel
from eigassign.output.exchange.c_source import c_source, identifier
from eigassign.output.exchange.tape import reduced_tape
from eigassign.output.store.atomic import replace_synced

FORMAT = "eigassign reduced model 2"
ENDINGS = (".npz", ".mat", ".c")
_HERE = Path(__file__).parent
_OURS = b"eigassign"  # in every reader


def write_exchange(
    reduced: ReducedModel,
    path: Path,
    title: str = "",
    within: NDArray[np.float64] | None = None,
) -> tuple[Path, Path]:
    """Write ``path``, whose ending is one of `ENDINGS`, and its reader beside it.

    arm.npz with arm_frequencies.py, arm.mat with arm_frequencies.m, arm.c with arm.h. These answer
    between the samples ``within`` (n, n_x), see `reduced_tape`. Raises
    UsageError for numbers that are not finite, StorageError where they cannot be written or where
    a file that is no such reader has the reader's name.
    """
    tape, name = reduced_tape(reduced, within), identifier(path.stem)
    if not all(np.isfinite(values).all() for values in tape.values()):
        raise UsageError("the reduced model has numbers that are not finite")
    about = _about(reduced, title or path.stem)
    if path.suffix == ".c":
        reader = path.with_suffix(".h")
        source, text = c_source(tape, path.stem, about)
        data = source.encode()
    elif path.suffix == ".npz":
        reader = path.with_name(f"{name}_frequencies.py")
        text = (_HERE / "numpy_reader.py").read_text(encoding="utf-8")
        stream: Any = io.BytesIO()
        arrays: dict[str, Any] = {**tape, "about": np.array(about), "format": np.array(FORMAT)}
        np.savez_compressed(stream, **arrays)
        data = stream.getvalue()
    else:
        reader = path.with_name(f"{name}_frequencies.m")
        text = (_HERE / "reader.m").read_text(encoding="ascii").replace("@NAME@", reader.stem)
        text = text.replace("@FILE@", path.name).replace("@ABOUT@", about)
        from scipy.io import savemat

        stream = io.BytesIO()
        named = {**tape, "about": about, "format": FORMAT}
        savemat(stream, named, do_compression=True, oned_as="row")
        data = stream.getvalue()
    try:
        if reader.exists() and _OURS not in read_bytes(reader, CASE):
            raise StorageError(f"{reader} is in the way: it reads no reduced model")
        replace_synced(path, data)
        replace_synced(reader, text.encode())
    except OSError as error:
        raise StorageError(f"cannot write {path} and {reader}: {error.strerror}") from error
    return path, reader


def _about(reduced: ReducedModel, title: str) -> str:
    """The model in a line that is a comment in any language."""
    points = len(reduced.points)
    text = (
        f"{title}: modes {', '.join(map(str, reduced.modes))}, {reduced.size} unknowns, {points} "
        f"expansion point{'s' if points > 1 else ''}; eigassign {__version__}"
    )
    words = text.encode("ascii", "replace").decode().replace("*/", "* /").replace("\\", "/")
    return " ".join(words.split())
