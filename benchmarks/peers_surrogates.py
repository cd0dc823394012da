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
from eigassign.chart.comparison import exact_frequencies
from eigassign.chart.methods import reduced_methods, series_methods
from eigassign.chart.question import build_features, build_points
from eigassign.chart.surrogates import spread_points
from eigassign.pipeline.run import prepare
from eigassign.pipeline.stages import Stages

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
    features = build_features(scene)
    points = build_points(scene, features, 600, 5, 152)
    exact = exact_frequencies(scene, points.x)[:, 0]
    many = points.repeated(3)
    solve = common.once(lambda: exact_frequencies(scene, points.x)) / len(exact)
    peers = {"SMT": smt_kriging, "scikit-learn": sklearn_process}
    rows = []
    for count in COUNTS:
        u = spread_points(count, features.d)
        f = exact_frequencies(scene, features.x(u))[:, 0]
        for name, fit in peers.items():
            made = fit(u, f)
            fitting = common.once(lambda fit=fit, u=u, f=f: fit(u, f))
            online = common.medians({"": lambda made=made: made(many.u)}, 3)[""] / len(many.u)
            off = np.abs(made(points.u) - exact)
            rows.append(_row(name, count, count * solve, fitting, online, off))
    series = [m for m in series_methods(scene, [4, 8], []) if m.family == "1/λ, full"]
    for method in (*series, *reduced_methods(scene, [2], [1])):
        made = method.build(np.zeros((0, 1)))
        jobs = {
            "fit": lambda m=method: m.build(np.zeros((0, 1))),
            "run": lambda made=made: made(many),
        }
        spent = common.medians(jobs, 5)
        off = np.abs(made(points)[:, 0] - exact)
        online = spent["run"] / len(many.u)
        rows.append(
            _row(f"eigassign: {method.name}", method.solves, 0.0, spent["fit"], online, off)
        )
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
