"""How the time and memory of one expansion grow with the number of unknowns, 1e3 to 1e5.

A trunk of four links (three joints locked) carries more and more chains of three links; eleven
variables, order 4, mode 1. Each size runs in a process of its own, so that its peak memory is its
own. Beside the whole ``ea.expand`` call stand two floors, measured in the same process:

plain   one SuperLU factorisation of the bordered matrix as it is, the best of three orderings, and
        one block solve a degree: what textbook sparse algebra would cost;
own     one factorisation by block elimination as ``eigassign.modal.taylor.bordered`` does it, and
        its solves in blocks that stay in the cache: the least that we know how to do.

An expansion must also find its eigenpair, which takes a factorisation of K of its own before λ is
known: it is counted in the last ratio. The plain floor is timed once, the rest are medians.
"""

from __future__ import annotations

import common  # first: settles the threads

# isort: split
import json
import os
import resource
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Callable

import arms
import numpy as np
from scipy import sparse
from scipy.sparse import linalg

import eigassign as ea
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.mechanism.elements.craig_bampton import factorise
from eigassign.modal import factor_sparse, modes

BLOCK = 16  # right-hand sides at once, as in the recursion
BRANCHES = (3, 10, 33, 103, 326)
Q0 = np.array([0.3, 0.5, -0.4, 0.6])
PLAIN = {
    "COLAMD": {"permc_spec": "COLAMD"},
    "MMD": {"permc_spec": "MMD_AT_PLUS_A", "options": {"SymmetricMode": True}},
    "MMD, threshold 0.01": {
        "permc_spec": "MMD_AT_PLUS_A",
        "diag_pivot_thresh": 0.01,
        "options": {"SymmetricMode": True},
    },
}


def plain_floor(A: sparse.csc_array, border: np.ndarray, blocks: list[int]) -> float:
    """Seconds of the best plain factorisation with its solves."""
    column = sparse.csc_array(border[:, None] * (abs(A.data).max() / abs(border).max()))
    full = sparse.block_array([[A, column], [column.T, None]], format="csc")
    rng = np.random.default_rng(0)
    rhs = [np.asfortranarray(rng.standard_normal((full.shape[0], k))) for k in blocks]

    def run(options: dict[str, object]) -> None:
        factors = linalg.splu(full, **options)
        for block in rhs:
            factors.solve(block)

    return min(common.once(lambda o=options: run(o)) for options in PLAIN.values())


def own_floor(
    pencil: Pencil, data: np.ndarray, border: np.ndarray, phi: np.ndarray, n: int
) -> Callable[[], None]:
    """Our factorisation with n solves."""
    rows = np.random.default_rng(0).standard_normal((n, len(border)))

    def run() -> None:
        solve = factor_sparse(pencil, data, border[None], phi[None])
        for i in range(0, n, BLOCK):
            solve(rows[i : i + BLOCK])

    return run


def stiffness_factor(pencil: Pencil, theta: np.ndarray) -> Callable[[], object]:
    """The factorisation of K alone that finding the eigenpair takes."""
    K = pencil.sparse(pencil.stiffness @ theta)
    K.eliminate_zeros()
    return lambda: factorise(K[pencil.elastic][:, pencil.elastic])


def one(branches: int) -> dict[str, float]:
    """All measurements of one size."""
    start = time.process_time()
    case = arms.case_of(arms.tree(branches))
    reading = time.process_time() - start
    building = common.once(case.model)
    model, y0 = case.model(), case.initial_design
    pencil = model.pencil
    expand = lambda: ea.expand(model, Q0, y0, (1,), 4)  # noqa: E731
    ea.expand(model, Q0, y0, (1,), 2)  # imports
    first = common.once(expand)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    tracemalloc.start()
    expansion = expand()
    peak = tracemalloc.get_traced_memory()[1] / 1e6
    tracemalloc.stop()
    x0 = np.concatenate([Q0, y0])[None]
    theta = pencil.theta(x0)[:, 0]
    lam, phi = expansion.clusters[0].coefficients[0, 0, 0], expansion.clusters[0].vectors[0, :, 0]
    data = pencil.stiffness @ theta - lam * (pencil.mass @ theta)
    border = pencil.sparse(pencil.mass @ theta) @ phi
    A = pencil.sparse(data)
    A.eliminate_zeros()
    counts = np.diff(expansion.vector_space.degree_starts)[1:].tolist()
    jobs = {
        "expand": expand,
        "exact": lambda: modes(pencil, x0, 2),
        "own": own_floor(pencil, data, border, phi, sum(counts)),
        "factor": stiffness_factor(pencil, theta),
    }
    return {
        "n_dof": model.n_dof,
        "reading": reading,
        "building": building,
        "first": first,
        **common.medians(jobs, 7),
        "plain": plain_floor(A, border, counts),
        "peak_mb": peak,
        "rss_mb": memory,
        "vectors_mb": expansion.clusters[0].vectors.nbytes / 1e6,
        "n_lambda": len(expansion.space),
    }


def exponent(n: list[float], values: list[float]) -> float:
    """Slope of log value against log n, least squares."""
    return float(np.polyfit(np.log(n), np.log(values), 1)[0])


def main() -> None:
    found = []
    for branches in BRANCHES:
        command = [sys.executable, __file__, "--one", str(branches)]
        # The largest size is above the limit on elements that case files have.
        allowed = {**os.environ, "EIGASSIGN_LIMITS": "2"}
        done = subprocess.run(command, check=True, capture_output=True, text=True, env=allowed)
        found.append(json.loads(done.stdout))
    rows = [
        {
            "n_dof": f["n_dof"],
            "expand, first call": f"{f['first']:.3g} s",
            "expand": f"{f['expand']:.3g} s",
            "of it the exact solve": f"{f['exact']:.3g} s",
            "plain floor": f"{f['plain']:.3g} s",
            "expand / plain": f["expand"] / f["plain"],
            "own floor": f"{f['own']:.3g} s",
            "expand / own": f["expand"] / f["own"],
            "expand / (own + factor of K)": f["expand"] / (f["own"] + f["factor"]),
            "peak of arrays": f"{f['peak_mb']:.0f} MB",
            "peak of process": f"{f['rss_mb']:.0f} MB",
            "case, model": f"{f['reading']:.2g} s, {f['building']:.2g} s",
        }
        for f in found
    ]
    n = [f["n_dof"] for f in found]
    last = found[-1]
    common.report(
        "growth",
        "Growth with n_dof: order 4 in eleven variables, chains on a trunk",
        rows,
        [
            f"fitted exponent of the time: {exponent(n, [f['expand'] for f in found]):.2f}"
            f" over all sizes, {exponent(n[2:], [f['expand'] for f in found[2:]]):.2f} over the"
            " largest three (wanted at most 1.1); of model building:"
            f" {exponent(n[1:], [f['building'] for f in found[1:]]):.2f}",
            "wanted: at most 3 times the floor at the largest size; small sizes spend their time on"
            f" the {last['n_lambda']} coefficients, whatever n_dof",
            f"peak memory at {n[-1]} dof: {last['peak_mb']:.0f} MB of arrays, of which the vectors"
            f" themselves {last['vectors_mb']:.0f} MB; n_dof × λ coefficients would be"
            f" {n[-1] * last['n_lambda'] * 8 / 1e6:.0f} MB. Exponent of the arrays' peak over the"
            f" largest three: {exponent(n[2:], [f['peak_mb'] for f in found[2:]]):.2f}",
        ],
    )


if __name__ == "__main__":
    if sys.argv[1:2] == ["--one"]:
        print(json.dumps(one(int(sys.argv[2]))))
    else:
        main()
