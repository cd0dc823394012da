"""Random mechanisms under shares of the weight that buckles them, hanging and standing."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from calibration import Drawn, Floats
from scipy import linalg
from wide_draws import FAMILIES

from eigassign.case import CaseFile
from eigassign.errors import EigassignError
from eigassign.modal import Model
from eigassign.study import build_model

DRAWS = tuple(FAMILIES.values())
SHARES = (1e-3, 0.03, 0.2, 0.5, 0.8, 0.95)  # of the load that buckles the weakest of all samples


def weighed(seed: int, samples: int) -> Drawn | None:
    """A random mechanism under a share of its buckling load; None where none is to be had."""
    drawn = DRAWS[seed % len(DRAWS)](seed, samples)
    if drawn is None or not len(drawn.q):
        return None
    return hung(drawn, np.random.default_rng([seed, 25]), SHARES)


def hung(drawn: Drawn, rng: np.random.Generator, shares: Sequence[float]) -> Drawn | None:
    """A mechanism under one of these shares of its buckling load, some direction down."""
    file = drawn.model.poses.case
    down = rng.normal(size=2 if file.mechanism.space == "planar" else 3)
    down /= np.linalg.norm(down)
    share = float(rng.choice(shares))
    for case in (file, _locked(file)):
        for g in (down, -down):
            try:
                model = build_model(_under(case, g))
                most = _buckling(model, drawn)
                if most > 0.0:
                    model = build_model(_under(case, g * (share * min(most, 1e6))))
                    model.frequencies(drawn.q, drawn.y, max(drawn.modes))
                    model.frequencies(drawn.q0, drawn.y0, max(drawn.modes))
                    return replace(drawn, model=model)
            except EigassignError:
                continue
    return None


def _under(file: CaseFile, g: Floats) -> CaseFile:
    mechanism = file.mechanism.model_copy(update={"gravity": tuple(g.tolist())})
    return replace(file, mechanism=mechanism)


def _locked(file: CaseFile) -> CaseFile:
    """The same with all free coordinates locked, for those that would fall either way."""
    held = {
        name: c.model_copy(update={"drive": "locked"}) if c.drive == "free" else c
        for name, c in file.coordinates.items()
    }
    return replace(file, coordinates=type(file.coordinates)(held))


def _buckling(model: Model, drawn: Drawn) -> float:
    """How many times its weight a mechanism bears at all samples; 0 where a coordinate falls."""
    pencil = model.pencil
    q, y = np.vstack([drawn.q, drawn.q0]), np.vstack([drawn.y, drawn.y0])
    theta = pencil.theta(model.x(q, y))
    E, least = pencil.elastic, np.inf
    S = np.isin(E, pencil.weight.joints[pencil.weight.swinging])
    for t in theta.T:
        K, K_g = (pencil.sparse(w @ t).toarray()[np.ix_(E, E)]
                  for w in (pencil.stiffness, pencil.weight.stiffness))  # fmt: skip
        if S.any() and np.linalg.eigvalsh(K_g[np.ix_(S, S)])[0] <= 0.0:
            return 0.0
        drawn_along = np.linalg.solve(K_g[np.ix_(S, S)], K_g[np.ix_(S, ~S)])
        G = K_g[np.ix_(~S, ~S)] - K_g[np.ix_(~S, S)] @ drawn_along
        K_0 = (K - K_g)[np.ix_(~S, ~S)]
        if len(G):
            most = linalg.eigh(-G, K_0, eigvals_only=True)[-1]
            least = min(least, 1.0 / most if most > 0.0 else np.inf)
    return float(least)
