"""Shared set-up: oracles and helpers for tests of several packages; reproducible hypothesis."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from hypothesis import settings

from eigassign.process import prefer_one_thread

prefer_one_thread()  # before NumPy is imported: threads of small dense algebra wait for each other
for folder in (
    "oracles",
    "assignment",
    "case",
    "faults",
    "mechanism",
    "modal",
    "stability",
    "study",
):
    sys.path.insert(0, str(Path(__file__).parent / folder))

os.environ.pop("COLUMNS", None)  # tables are as wide as they like, wherever tests run

settings.register_profile("repeatable", derandomize=True, deadline=None, database=None)
settings.load_profile("repeatable")
