"""θ averaged over turned poses: its K_E is the inner product of a reduced model's basis.

A vector smooth in one pose kinks the joints of another, with a strain energy many times that of a
mode. In K_E(x0) numbers of that size would have to cancel; in the mean stiffness they do not.
Loops are not turned: where they close at all, a passive carriage may have left its beam, whose
stiffness is then not one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.pencil import Pencil
from eigassign.series.algebra import Samples

Floats = NDArray[np.float64]


def mean_theta(pencil: Pencil, points: Floats) -> Floats:
    """Mean θ (n_theta,) over quarter turns of all angles from ``points`` (n_points, n_x)."""
    if pencil.program.is_implicit:
        return np.asarray(pencil.theta(points).mean(axis=1))
    z = points @ pencil.to_program.T + pencil.shift
    z[:, pencil.n_q :] = z[0, pencil.n_q :]
    turns = np.zeros(len(pencil.shift))
    turns[: pencil.n_q] = _periodic(pencil, z[0])
    turned = np.concatenate([z + k * turns * (np.pi / 2.0) for k in range(4)])
    theta = _theta_at(pencil, turned)
    return np.asarray(theta[:, np.isfinite(theta).all(axis=0)].mean(axis=1))


def _theta_at(pencil: Pencil, z: Floats) -> Floats:
    """θ (n_theta, n) at program variables z (n, n_z)."""
    return np.vstack([np.ones((1, len(z))), pencil.program.run(Samples(), z.T)])


def _periodic(pencil: Pencil, z: Floats) -> NDArray[np.bool_]:
    """Which joint coordinates are angles (n_q,): a full turn changes nothing but round-off."""
    return np.array([_turns(pencil, z, k) for k in range(pencil.n_q)], dtype=bool)


def _turns(pencil: Pencil, z: Floats, k: int) -> bool:
    turned = np.array([z, z])
    turned[1, k] += 2.0 * np.pi
    here, there = _theta_at(pencil, turned).T
    scale = np.maximum(np.abs(here), np.abs(there))
    return bool((np.abs(there - here) <= 1e-9 * scale).all())
