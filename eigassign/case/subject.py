"""What a chart is about: the content of a case without what only says how it is to be solved."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from pathlib import Path

from eigassign.case.resolved import plain, to_yaml
from eigassign.case.study_parts import Design


def subject_sha256(
    content: Mapping[str, object], design: Design, files: Mapping[str, str], folder: Path
) -> str:
    """SHA-256 of mechanism, coordinates and trajectory (``content``) and of the design's bounds.

    ``files`` (SHA-256 by name as seen from ``folder``) stand for what the case names, so that two
    cases are the same wherever they lie and however they are written.
    """
    digests = {os.path.abspath(folder / name): digest for name, digest in files.items()}
    told = {**content, "design": design.parameters}
    bare = {key: _without_paths(plain(value), digests) for key, value in told.items()}
    return hashlib.sha256(to_yaml(bare).encode()).hexdigest()


def _without_paths(value: object, digests: Mapping[str, str]) -> object:
    """``value`` with the content of a file in the place of its path."""
    if isinstance(value, dict):
        return {key: _without_paths(inner, digests) for key, inner in value.items()}
    if isinstance(value, list):
        return [_without_paths(inner, digests) for inner in value]
    return digests.get(value, value) if isinstance(value, str) else value
