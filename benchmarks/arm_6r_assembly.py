"""Where the time goes between a case file and a series: an arm with joints about axes in space.

A serial arm of n links alternates turns about its own axis and pitches, as industrial ones do; all
joints are free. It is expanded to order 4 in the relative joint angles and six design parameters
(three diameters, three masses); the first angle turns the whole arm and drops out. Each stage is
timed by itself, in turns with the others:

model      kinematics, assembly of the affine pencil and its program, from a case already read
theta      power series of every coefficient function θ(q, y)
K, M       the series of K and M, made ready for products: Σ θ_j K_j is never formed beyond order 0
eigenpair  the exact solve at x0, with its factorisation of K
vectors    φ to order 2: one bordered factorisation, and the recursion (with "K, M")
λ          Rayleigh quotient in series arithmetic, order 4 from vectors of order 2
expand     the whole ``ea.expand`` call

Shares are of model and expand together: of the model, and of all that comes before an eigenvector.
"""

from __future__ import annotations

import common  # first: settles the threads

# isort: split
from typing import Any

import arms
import numpy as np

import eigassign as ea
from eigassign.modal.exact.solver import modes
from eigassign.modal.taylor.bordered import pencil_series
from eigassign.modal.taylor.rayleigh import eigenvalue_series
from eigassign.modal.taylor.recursion import expand_subspace, local_space, vector_set

DOFS = (1_000, 3_000, 10_000, 30_000)
LINKS = (2, 4, 6, 9, 12)
ORDER = 4


def arm(links: int, dofs: int) -> dict[str, Any]:
    """A spatial serial arm of about ``dofs`` unknowns."""
    names = [f"link{k}" for k in range(links)]
    bases = ["ground", *(f"{n}.end" for n in names[:-1])]
    axes = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]
    designed = [names[k % links] for k in range(min(links, 3))]
    return {
        "title": f"Spatial arm of {links} links",
        "mechanism": {
            "space": "spatial",
            "materials": {"steel": {**arms.STEEL, "poissons_ratio": 0.3}},
            "sections": {
                f"rod{k}": {"shape": "circle", "diameter": 0.1 - 0.06 * k / links}
                for k in range(links)
            },
            "links": {
                n: {
                    "length": 0.5,
                    "material": "steel",
                    "section": f"rod{k}",
                    "elements": round(dofs / (6 * links)),
                }
                for k, n in enumerate(names)
            },
            "joints": {
                f"joint{k}": {
                    "type": "revolute",
                    "base": base,
                    "follower": f"{n}.start",
                    "axis": list(axes[k % 2]),
                }
                for k, (base, n) in enumerate(zip(bases, names, strict=True))
            },
            "bodies": {
                f"mass{k}": {"at": f"{n}.end", "mass": 1.0, "inertia": [0.01, 0.01, 0.01]}
                for k, n in enumerate(names)
            },
        },
        "coordinates": {f"q{k}": {"joint": f"joint{k}"} for k in range(links)},
        "design": {
            **{
                f"d_{n}": {"parameter": f"sections.rod{k}.diameter", "min": 0.03, "max": 0.12}
                for k, n in enumerate(designed)
            },
            **{
                f"m_{n}": {"parameter": f"bodies.mass{k}.mass", "min": 0.0, "max": 5.0}
                for k, n in enumerate(designed)
            },
        },
    }


def one(links: int, dofs: int, repeats: int = 5) -> dict[str, float]:
    """Seconds of every stage."""
    case = arms.case_of(arm(links, dofs))
    model, y0 = case.model(), case.initial_design
    q0 = 0.3 + 0.2 * np.arange(links)
    pencil, x0 = model.pencil, np.concatenate([q0, y0])
    local = local_space(pencil, ORDER, False, None)
    half, kept = vector_set(local.space, local.n_linear, None)
    theta = pencil.theta_series(local.space, x0, local.to_z)
    found = modes(pencil, x0[None], 1)
    lam0, phi0 = found.lam[0], found.phi[0]
    X = expand_subspace(pencil, theta[:, kept], half, lam0, phi0).vectors
    jobs = {
        "model": lambda: ea.Case(case.file).model(),
        "theta": lambda: pencil.theta_series(local.space, x0, local.to_z),
        "series": lambda: pencil_series(pencil, theta[:, kept], half),
        "eigenpair": lambda: modes(pencil, x0[None], 2),
        "vectors": lambda: expand_subspace(pencil, theta[:, kept], half, lam0, phi0),
        "quotient": lambda: eigenvalue_series(pencil, theta, local.space, half, X),
        "expand": lambda: ea.expand(model, q0, y0, (1,), ORDER),
    }
    return {
        "links": links,
        "n_dof": model.n_dof,
        "n_theta": pencil.n_theta,
        "coefficients": len(local.space),
        **common.medians(jobs, repeats),
    }


def row(f: dict[str, float]) -> dict[str, object]:
    stages = {
        "model": "model",
        "theta": "theta",
        "K, M": "series",
        "eigenpair": "eigenpair",
        "vectors": "vectors",
        "λ": "quotient",
        "expand": "expand",
    }
    return {
        "links": f["links"],
        "n_dof": f["n_dof"],
        "functions θ": f["n_theta"],
        "multi-indices": f["coefficients"],
        **{name: common.milliseconds(f[key]) for name, key in stages.items()},
        "model + expand": common.milliseconds(total(f)),
        "share of model": f["model"] / total(f),
        "with the series of θ, K, M": share(f),
    }


def total(f: dict[str, float]) -> float:
    return f["model"] + f["expand"]


def share(f: dict[str, float]) -> float:
    return (f["model"] + f["theta"] + f["series"]) / total(f)


def exponent(n: list[float], values: list[float]) -> float:
    """Slope of log value against log n, least squares."""
    return float(np.polyfit(np.log(n), np.log(values), 1)[0])


def exponents(found: list[dict[str, float]], n: list[float]) -> str:
    keys = ("model", "expand")
    return ", ".join(f"{key} {exponent(n, [f[key] for f in found]):.2f}" for key in keys)


def main() -> None:
    by_size = [one(6, n) for n in DOFS]
    by_links = [one(n, 10_000) for n in LINKS]
    at = by_size[2]
    sizes, links = ([f[k] for f in part] for part, k in ((by_size, "n_dof"), (by_links, "links")))
    common.report(
        "arm_6r_assembly",
        f"Assembly and expansion of a spatial arm, order {ORDER}, six design parameters",
        [row(f) for f in [*by_size, *by_links]],
        [
            f"six links, {at['n_dof']} dof: {total(at):.3g} s from a case in memory to all its"
            f" coefficients (wanted: seconds), {at['model'] / total(at):.0%} of it assembly of the"
            " model (wanted: below a third)",
            f"fitted exponents in n_dof: {exponents(by_size, sizes)}",
            f"fitted exponents in the number of links at 10⁴ dof: {exponents(by_links, links)}",
        ],
    )


if __name__ == "__main__":
    main()
