"""What a design costs: `optimize` against SciPy's ``least_squares`` on exact frequencies.

All start at the initial design, and SciPy has analytic slopes. On a large arm its frequencies come
from ``eigsh`` about 0 with one sparse factorisation a sample, started from the modes found there
before; on the shipped cases from the package's dense solver. With ``--before DIR``, another
checkout of eigassign, whole processes ``optimize --figures none`` of both are timed instead.
"""

from __future__ import annotations

import common  # first: settles the threads

# isort: split
import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import arms
import numpy as np
import profiles
import references
from references import oracle
from scipy.sparse import linalg

import eigassign as ea
from eigassign.assignment import Optimum, minimise
from eigassign.pipeline import Stages, prepare
from eigassign.study import Task, find_optimum, variant_of

NEAR = 1e-3  # of the best rms: there a search has arrived
ELEMENTS = 230  # a link
SAMPLES = 101


def large(starts: int | str = 1) -> ea.Case:
    """A planar arm of three links on elastic drives: three diameters, three masses, two drives."""
    data = arms.serial_arm(ELEMENTS, {})
    for k in range(5, 2, -1):
        arms.remove_link(data, k)
    stiffness = [3e4, 1e4, 3e3]
    for coordinate, value in zip(data["coordinates"].values(), stiffness, strict=True):
        coordinate["drive"] = {"stiffness": value}
    poses = [[0.2, 0.5, 0.9], [1.0, 1.3, 0.2]]
    data["trajectory"] = {"points": poses, "duration": 1.0, "samples": SAMPLES}
    bounds = {
        **{f"sections.rod{k}.diameter": (0.03 - 0.003 * k, 0.08 - 0.008 * k) for k in range(3)},
        **{f"bodies.mass{k}.mass": (0.1, 3.0) for k in range(3)},
        **{
            f"coordinates.q{k}.drive.stiffness": (0.3 * stiffness[k], 3.0 * stiffness[k])
            for k in range(2)
        },
    }
    data["design"] = {
        f"y{k}": {"parameter": path, "min": low, "max": high}
        for k, (path, (low, high)) in enumerate(bounds.items())
    }
    before = arms.case_of(data)
    hz = before.model().frequencies(before.trajectory.q[[0, -1]], before.initial_design, 2)
    data["targets"] = [
        {"mode": k, "frequency": round(1.3 * float(f), 2)} for k, f in enumerate(hz.mean(axis=0), 1)
    ]
    data["assignment"] = {"starts": starts}
    return arms.case_of(data)


# --- SciPy's


class Timed(oracle.ExactAssignment):
    """Remembers when each rms came."""

    trace: list[tuple[float, float]]

    def errors(self, y: np.ndarray) -> np.ndarray:
        e = super().errors(y)
        self.trace.append((time.process_time(), float(np.linalg.norm(self.roots * e))))
        return e


class Sparse(Timed):
    """Lanczos about 0 on the sparse pencil, for drives that hold every joint."""

    last: dict[int, np.ndarray]

    def solve(self, y: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        pencil = self.model.pencil
        theta = pencil.theta(self.model.x(self.q, y))
        stiffness, mass = pencil.stiffness @ theta, pencil.mass @ theta
        lam, phi = [], []
        for k in range(len(self.q)):
            K, M = pencil.sparse(stiffness[:, k]), pencil.sparse(mass[:, k])
            factor = linalg.splu(
                K, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )  # fmt: skip
            inverse = linalg.LinearOperator(K.shape, matvec=factor.solve)
            found, vectors = linalg.eigsh(
                K, count, M, 0.0, v0=self.last.get(k), OPinv=inverse, ncv=10 + 2 * count, tol=1e-10
            )
            self.last[k] = vectors.sum(axis=1)
            lam.append(found)
            phi.append(vectors)
        return np.sqrt(lam) / (2.0 * np.pi), np.array(phi)


def scipy_search(kind: type[Timed], case: ea.Case) -> dict[str, Any]:
    """One ``least_squares`` from the initial design: seconds, solves and what it reached."""
    problem = kind(**vars(oracle.of_case(case)))
    problem.trace, problem.last = [], {}  # type: ignore[attr-defined]
    begun = time.process_time()
    y = oracle.least_squares_from(problem, np.clip(problem.initial, problem.lower, problem.upper))
    seconds = time.process_time() - begun
    best = problem.rms(y)
    arrived = next(at for at, rms in problem.trace if rms <= best * (1.0 + NEAR)) - begun
    solves = problem.evaluations * len(problem.q)
    return {"rms": best, "seconds": seconds, "arrived": arrived, "solves": solves}


# --- Ours


def our_search(case: ea.Case) -> dict[str, Any]:
    """The search of `optimize`."""
    scene, begun = prepare(case, Stages(lambda line: None), None), time.process_time()
    found = find_optimum(scene, (), lambda line: None)
    seconds = time.process_time() - begun
    problem = oracle.of_case(case)
    return {
        "rms": problem.rms(found.best.y),
        "seconds": seconds,
        "solves": found.exact_solves,
        "starts": found.starts,
    }


def of_large() -> None:
    """The table of the large arm."""
    for _ in range(2):  # once to warm up
        ours = our_search(large())
    many, theirs = our_search(large("auto")), scipy_search(Sparse, large())
    rows = [
        _row("SciPy, sparse exact solves", theirs["rms"], theirs["seconds"], theirs),
        _row("  until within 0.1 % of it", theirs["rms"], theirs["arrived"], theirs),
        _row("sequential, exact solves", ours["rms"], ours["seconds"], theirs, ours),
        _row(f"  from {many['starts']} starts", many["rms"], many["seconds"], theirs, many),
    ]
    common.report(
        "assignment_cost",
        f"The cost of a design: {large().model().n_dof} dof, 8 parameters, {SAMPLES} samples",
        rows,
        [
            "one start at the initial design unless said; processor time, one run",
            "wanted: 50 times less without and 5 times less with confirmation than SciPy's",
            "not counted: the model and its expansion, which both need or SciPy does not",
        ],
    )


def _row(
    name: str, rms: float, seconds: float, theirs: dict[str, Any], own: dict[str, Any] | None = None
) -> common.Row:
    given = theirs if name.startswith("SciPy") else own
    return {
        "search": name,
        "rms error": f"{100.0 * rms:.6f} %",
        "exact solves": "" if given is None else given["solves"],
        "time": f"{seconds:.3g} s",
        "SciPy / this": theirs["seconds"] / seconds,
        "SciPy's arrival / this": theirs["arrived"] / seconds,
    }


def same_start() -> Iterator[common.Row]:
    """The sequential steps alone and ``least_squares``, both on dense exact frequencies."""
    for named in references.shipped():
        case = named.case
        problem = oracle.of_case(case)
        if len(problem.C):
            continue
        scene = prepare(case, Stages(lambda line: None), None)
        task = Task(scene, scene.wanted)
        search = partial(_sequential, task)
        found = search()
        y = scipy_search(Timed, case)
        times = common.medians(
            {
                "ours": search,
                "SciPy": partial(scipy_search, Timed, case),
            },
            3,
        )
        yield {
            "case": named.name,
            "ours, rms": f"{100.0 * problem.rms(found.y):.5f} %",
            "SciPy, rms": f"{100.0 * y['rms']:.5f} %",
            "designs": found.appraisals,
            "SciPy's": y["solves"] // len(problem.q),
            "ours": f"{times['ours']:.3g} s",
            "SciPy": f"{times['SciPy']:.3g} s",
            "ratio": times["ours"] / times["SciPy"],
        }


def _sequential(task: Task) -> Optimum:
    return minimise(variant_of(task, ()).problem, task.scene.initial)


# --- Whole processes, this version and another one


def processes(before: Path) -> None:
    """`optimize --figures none` of the cases that both know, and of the six-axis arm, 10⁴ dof."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        arm = Path(folder) / "arm_6r_10000_dof.yaml"
        arm.write_text(profiles.case_text("arm_6r, 10⁴ dof"), encoding="utf-8")
        theirs = sorted((before / "cases").glob("*.yaml"))
        for path in [*theirs, arm]:
            own = path if path == arm else common.CASES / path.name
            times: dict[str, list[float]] = {"before": [], "now": []}
            for _ in range(3):
                times["before"].append(_process(before.resolve(), path.resolve(), Path(folder)))
                times["now"].append(_process(common.CASES.parent, own, Path(folder)))
            then, now = (min(times[k]) for k in ("before", "now"))
            rows.append(
                {
                    "case": path.stem,
                    "before": f"{then:.3g} s",
                    "now": f"{now:.3g} s",
                    "now / before": now / then,
                }
            )
            print(rows[-1], file=sys.stderr, flush=True)
    common.report(
        "optimize_time",
        "The whole process optimize --figures none, and the version without the sequential method",
        rows,
        [
            "processor time, the least of three, in turns; nothing cached",
            "wanted: at most 2 times on shipped cases, at most 0.4 times on the arm of 10⁴ dof",
        ],
    )


def _process(package: Path, case: Path, folder: Path) -> float:
    command = [sys.executable, "-m", "eigassign", "optimize", str(case), "--figures", "none"]
    command += ["--no-cache", "--force", "--out", str(folder / "run")]
    start = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        command,
        env={**os.environ, "PYTHONPATH": str(package)},
        capture_output=True,
        check=False,
        cwd=folder,
    )
    if done.returncode not in (0, 1):
        raise RuntimeError(done.stderr.decode())
    end = resource.getrusage(resource.RUSAGE_CHILDREN)
    return end.ru_utime + end.ru_stime - start.ru_utime - start.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--before", type=Path, help="another checkout of eigassign")
    given = parser.parse_args()
    if given.before is not None:
        processes(given.before)
        return
    of_large()
    common.report(
        "assignment_start",
        "The sequential steps and SciPy's least_squares, both from the initial design",
        list(same_start()),
        ["both on exact frequencies with slopes; wanted: not slower than SciPy's"],
    )


if __name__ == "__main__":
    main()
