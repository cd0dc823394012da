"""Shared set-up: oracles and helpers for tests of several packages; reproducible hypothesis."""

import os
import sys
from pathlib import Path

import pytest
from hypothesis import settings

for library in (
    "OPENBLAS",
    "OMP",
    "MKL",
):  # before NumPy is imported: small algebra is slower on more
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")
for folder in (
    "oracles",
    "assignment",
    "batch",
    "case",
    "chart",
    "faults",
    "mechanism",
    "modal",
    "output",
    "stability",
    "study",
):
    sys.path.insert(0, str(Path(__file__).parent / folder))

FEW = 3  # of a family of random mechanisms or problems that are tried by default


@pytest.hookimpl(tryfirst=True)  # before markers choose
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """A test parametrised by ``seed`` is slow from its fourth seed on."""
    for item in items:
        of = getattr(item, "callspec", None)
        if of is not None and of.indices.get("seed", 0) >= FEW:
            item.add_marker(pytest.mark.slow)


os.environ.pop("COLUMNS", None)  # tables are as wide as they like, wherever tests run

settings.register_profile("repeatable", derandomize=True, deadline=None, database=None)
settings.load_profile("repeatable")
