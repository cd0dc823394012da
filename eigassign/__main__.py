"""``python -m eigassign``: the same as the ``eigassign`` command."""

from __future__ import annotations

import sys

from eigassign.cli import main

if __name__ == "__main__":  # worker processes import this module under another name
    sys.exit(main())
