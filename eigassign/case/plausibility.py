"""placeholder"""

from __future__ import annotations

from collections.abc import Iterator

from eigassign.case.document import Document
from eigassign.case.tree import Tree
from eigassign.case.yaml_reader import Finding


def implausible(document: Document, tree: Tree) -> Iterator[Finding]:
    """Nothing yet."""
    yield from ()
