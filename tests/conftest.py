"""Shared set-up: oracles and helpers for tests of several packages; reproducible hypothesis."""

from __future__ import annotations

import sys
from pathlib import Path

from hypothesis import settings

for folder in ("oracles", "case", "mechanism", "modal", "stability", "study"):
    sys.path.insert(0, str(Path(__file__).parent / folder))

settings.register_profile("repeatable", derandomize=True, deadline=None, database=None)
settings.load_profile("repeatable")
