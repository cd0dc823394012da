"""The package as one meets it in an interactive session."""

from __future__ import annotations

import eigassign as ea


def test_dir_lists_every_public_name_though_they_are_loaded_when_used() -> None:
    assert set(ea.__all__) <= set(dir(ea))
    assert all(getattr(ea, name) is not None for name in ea.__all__)
