"""Kriging by SMT and by scikit-learn, trained on eigassign's exact solves.

The question is that of `eigassign chart` on the paper's arm: the first frequency along the
trajectory, over both masses. All are fitted to the same points and compared with the same exact
answers; beside them what needs one exact solve.
"""

from __future__ import annotations

import common  # first: settles the threads

# isort: split
import warnings
from collections.abc import Callable

import numpy as np

import eigassign as ea
from eigassign.chart import Effort, build_bench, build_question, spread_points
from eigassign.pipeline import Stages, prepare

Fit = Callable[[], Callable[[np.ndarray], np.ndarray]]
COUNTS = (27, 64, 125, 343)


def smt_kriging(u: np.ndarray, f: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    from smt.surrogate_models import KRG

    model = KRG(corr="squar_exp", print_global=False, n_start=2, seed=1)
    model.set_training_values(u, f)
    model.train()
    return lambda at: model.predict_values(at)[:, 0]


def sklearn_process(u: np.ndarray, f: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel

    kernel = ConstantKernel(1.0, (1e-3, 1e6)) * RBF(np.ones(u.shape[1]), (1e-2, 1e2))
    model = GaussianProcessRegressor(
        kernel, alpha=1e-10, normalize_y=True, n_restarts_optimizer=1, random_state=1
    )
    return model.fit(u, f).predict


def main() -> None:
    warnings.simplefilter("ignore")
    scene = prepare(ea.load_case(common.CASES / "two_link.yaml"), Stages(lambda line: None), None)
    bench, model = build_bench(scene, Effort()), scene.model
    question = build_question(bench)
    points, exact = question.points, question.exact_hz[:, 0]
    many = points[np.tile(np.arange(len(exact)), 3)]
    solve = common.once(lambda: model.frequencies(points.q, points.y, 1)) / len(exact)
    peers = {"SMT": smt_kriging, "scikit-learn": sklearn_process}
    rows = []
    for count in COUNTS:
        at = bench.nearest(spread_points(count, len(bench.names)))
        f = bench.exact(at)[:, 0]
        for name, fit in peers.items():
            made = fit(at.u, f)
            fitting = common.once(lambda fit=fit, u=at.u, f=f: fit(u, f))
            online = common.medians({"": lambda made=made: made(many.u)}, 3)[""] / len(many)
            off = np.abs(made(points.u) - exact)
            rows.append(_row(name, count, count * solve, fitting, online, off))
    q0, y0 = scene.expansions.full.q0, scene.expansions.full.y0
    ours = {
        "1/λ 4 full": lambda: ea.expand(model, q0, y0, order=4).inverse,
        "1/λ 8 full": lambda: ea.expand(model, q0, y0, order=8).inverse,
        "reduced m = 2, 1 point": lambda: ea.reduce(model, q0, y0, half_order=2),
    }
    for name, build in ours.items():
        made = build()
        jobs = {"fit": build, "run": lambda made=made: made.frequencies(many.q, many.y)}
        spent = common.medians(jobs, 5)
        off = np.abs(made.frequencies(points.q, points.y)[:, 0] - exact)
        solves = 3 if name.startswith("reduced") else 1
        online = spent["run"] / len(many)
        rows.append(_row(f"eigassign: {name}", solves, 0.0, spent["fit"], online, off))
    import sklearn
    import smt

    remarks = [
        f"SMT {smt.__version__}, scikit-learn {sklearn.__version__}",
        f"an exact solve: {solve * 1e6:.3g} µs; those of expansions are in their fit",
        f"errors over {len(exact)} points against the same exact solves",
    ]
    title = "Surrogates of the first frequency: paper's arm, along the trajectory, over both masses"
    common.report("peers_surrogates", title, rows, remarks)


def _row(
    name: str, solves: int, training: float, fitting: float, online: float, off: np.ndarray
) -> dict[str, object]:
    return {
        "method": name,
        "exact solves": solves,
        "solving them": common.milliseconds(training),
        "fit": common.milliseconds(fitting),
        "one evaluation [µs]": online * 1e6,
        "worst error [Hz]": float(off.max()),
        "rms error [Hz]": float(np.sqrt(np.mean(off**2))),
    }


if __name__ == "__main__":
    main()
