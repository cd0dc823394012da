"""Cases on a cluster: the workers of a dask.distributed scheduler that somebody has started.

A worker that dies is replaced or not, as its cluster does it; what it had in flight runs again on
another one. Workers share the folders of the cases and of the results.
"""

from __future__ import annotations

import contextlib
import logging
import os
from collections.abc import Iterator
from concurrent.futures import Executor
from functools import partial
from typing import TYPE_CHECKING

from eigassign._version import __version__
from eigassign.batch.workers import Workers
from eigassign.errors import EigassignError, StorageError, UsageError

if TYPE_CHECKING:
    from distributed import Client

_AHEAD = 2  # tasks for each worker, so that it need not wait for the next one


@contextlib.contextmanager
def cluster(address: str) -> Iterator[Workers]:
    """The workers at ``address``.

    Raises UsageError where dask.distributed is not installed here, or the workers are not fit for
    this; StorageError where no scheduler answers, or does so no more.
    """
    try:
        from distributed import Client
    except ImportError:
        message = "--scheduler needs dask.distributed: pip install 'eigassign[cluster]'"
        raise UsageError(message) from None
    try:
        for name in ("distributed", "distributed.client"):  # errors are told here
            logging.getLogger(name).setLevel(logging.CRITICAL)
        client = Client(address, timeout=10.0)
    except (OSError, ValueError, TypeError, RuntimeError, ImportError) as error:  # no TLS, no ucx
        raise StorageError(f"--scheduler {address}: no scheduler answers: {error}") from error
    with client:
        try:
            workers = _require_fit(client, os.getcwd())
            yield Workers(_AHEAD * workers, partial(_executor, client))
        except Exception as error:  # a task that is cancelled, a stream that is closed
            if isinstance(error, EigassignError) or client.status == "running":
                raise
            kept = "what is done is kept, and the same command goes on from there"
            raise StorageError(f"--scheduler: the scheduler was lost: {kept}") from error


def _require_fit(client: Client, folder: str) -> int:
    """Number of workers; raises UsageError where one could not do its work."""
    threads = client.nthreads()
    if not threads:
        raise UsageError("--scheduler: it has no workers yet")
    if several := [worker for worker, n in threads.items() if n != 1]:
        raise UsageError(f"--scheduler: worker {several[0]} has several threads; use --nthreads 1")
    try:
        seen = client.run(_seen, folder)
    except Exception as error:
        if client.status != "running":
            raise
        raise UsageError(f"--scheduler: the workers cannot run eigassign: {error}") from error
    for worker, (version, is_there) in seen.items():
        if version != __version__:
            other = f"eigassign {version}, not {__version__}"
            raise UsageError(f"--scheduler: worker {worker} has {other}")
        if not is_there:
            raise UsageError(f"--scheduler: worker {worker} does not see the folder {folder}")
    return len(threads)


def _seen(folder: str) -> tuple[str, bool]:
    return __version__, os.path.isdir(folder)


@contextlib.contextmanager
def _executor(client: Client, _slots: int) -> Iterator[Executor]:
    """That of the client; on an error inside, what is in flight is given up."""
    pool = client.get_executor(pure=False)
    try:
        yield pool
    finally:
        pool.shutdown(wait=False)  # and what is in flight is cancelled
