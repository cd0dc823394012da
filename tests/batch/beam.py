"""A case that is solved at once: one beam, one mass."""

from pathlib import Path

TEXT = Path(__file__).with_name("beam.yaml").read_text(encoding="utf-8")
