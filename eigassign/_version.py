"""The version, kept apart so that it can be read without importing anything."""

from __future__ import annotations

__version__ = "0.3.0"
