"""Shared set-up: helper modules that tests of several packages use, and reproducible hypothesis."""

from __future__ import annotations

import sys
from pathlib import Path

from hypothesis import settings

sys.path.insert(0, str(Path(__file__).parent / "mechanism"))  # chains, frame_oracle

settings.register_profile("repeatable", derandomize=True, deadline=None, database=None)
settings.load_profile("repeatable")
