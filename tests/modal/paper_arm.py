"""The paper's arm of any mesh, with poses and designs at which automatic choices are judged."""

from __future__ import annotations

import numpy as np
from chains import model_of, two_link

from eigassign import load_case
from eigassign.modal import Model


def build(elements) -> Model:
    return model_of(two_link(elements=(elements["upper"], elements["fore"])))


def samples() -> np.ndarray:
    """Every fourth pose of the paper's trajectory with random masses of its design box."""
    q = load_case("cases/two_link.yaml").trajectory.q[::4]
    return np.hstack([q, np.random.default_rng(5).uniform(0.0, 0.25, (len(q), 2))])


def exact(model: Model, x: np.ndarray, modes) -> np.ndarray:
    return model.frequencies(x[:, :2], x[:, 2:], max(modes))[:, np.array(modes) - 1]
