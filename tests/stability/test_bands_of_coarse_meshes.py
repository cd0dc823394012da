"""A band called clear by a coarse mesh or by reduced links is clear by eight times the elements."""

import sys

import numpy as np
import pytest
from weighed_draws import DRAWS

from eigassign.assignment import ForbiddenBand
from eigassign.errors import EigassignError
from eigassign.mechanism import (
    NamedTrajectory,
    Trajectories,
    Trajectory,
    refined,
    with_elements,
    with_reduction,
)
from eigassign.study import automatic_elements, build_model, check_band

FINER = 8.0
EACH = 6  # bands of one mechanism


def judged(seed: int) -> tuple[int, int, list[str]]:
    """Bands called clear, those that are not, and which of the first the fine mesh has modes in.

    Of every second mechanism the links are reduced to a frequency about that of the bands.
    """
    drawn = DRAWS[seed // 2 % len(DRAWS)](seed, 3)
    if drawn is None or not drawn.model.is_meshed:
        return 0, 0, []
    rng, file = np.random.default_rng([seed, 41]), drawn.model.poses.case
    y = drawn.y0
    fine = build_model(refined(file, FINER)[0])
    travelled = {
        joint.base for joint in file.mechanism.joints.values() if joint.type in ("carriage", "nut")
    }  # a case that reduces these is refused
    meshed = [name for name, n in automatic_elements(file).items() if n is not None]
    links = [name for name in meshed if name not in travelled]
    q, clear, open_, wrong = drawn.q0[None], 0, 0, []
    try:
        exact = fine.frequencies(q, y, 8)[0]
        if seed % 2:
            hz = float(exact[1] * rng.uniform(0.5, 4.0))
            model = build_model(with_reduction(file, dict.fromkeys(links, hz)))
        else:
            few = {name: int(rng.integers(1, 4)) for name in meshed}
            model = build_model(with_elements(file, few))
        coarse = model.frequencies(q, y, min(6, model.n_dof - model.n_rigid))[0]
    except EigassignError:
        return 0, 0, []
    path = Trajectories((NamedTrajectory("1", Trajectory(np.zeros(1), q)),))
    for _ in range(EACH):
        below = int(rng.integers(0, len(coarse)))
        upper = coarse[below] * (1.0 - 10.0 ** rng.uniform(-5.0, -0.5))
        floor = coarse[below - 1] if below else 0.3 * upper
        lower = floor + (upper - floor) * rng.uniform(0.01, 0.9)
        if not floor < lower < upper:
            continue
        band = ForbiddenBand("band", "", (), slice(0, 1), np.array([lower]), np.array([upper]))
        try:
            found = check_band(model, path, band, below, y)
        except EigassignError:
            continue
        clear, open_ = clear + found.clear, open_ + (not found.clear)
        if found.clear and ((exact < lower).sum() != below or (exact < upper).sum() != below):
            wrong.append(f"seed {seed}: {lower} to {upper} Hz, {below} below, of {exact}")
    return clear, open_, wrong


def test_bands_that_a_coarse_model_calls_clear_are_clear() -> None:
    found = [judged(seed) for seed in range(6)]
    assert [line for f in found for line in f[2]] == []
    assert sum(f[0] for f in found) > 0
    assert sum(f[1] for f in found) > 0


@pytest.mark.slow
def test_many_bands_that_coarse_models_call_clear_are_clear() -> None:
    found = [judged(seed) for seed in range(400)]
    clear, open_ = sum(f[0] for f in found), sum(f[1] for f in found)
    sys.stdout.write(f"{clear} bands called clear, {open_} not\n")
    assert [line for f in found for line in f[2]] == []
    assert clear > 500
