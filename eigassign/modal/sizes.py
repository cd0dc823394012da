"""Where dense algebra gives way to sparse: one number for the exact solve and the expansion alike.

Measured by ``benchmarks/dense_or_sparse.py``: dense arrays win below, sparse ones above.
"""

from __future__ import annotations

DENSE_LIMIT = 220  # n_dof up to which matrices are kept dense
MOST_TERMS = 20_000  # of one full series that is made without being asked for by order
