"""No damaged file of the cache and no damaged reduced model is believed, however right its hash."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from damage import damaged

import eigassign as ea
from eigassign.errors import StorageError
from eigassign.modal import ReducedModel, expansion_arrays
from eigassign.output import Cache, unpack
from eigassign.pipeline import affordable_order, expand_plan, expansion_key
from eigassign.study import Plan, plan_expansion

CASES = Path(__file__).parents[2] / "cases"
WRONG = 1e-8  # relative in Hz; what is nearer than this to the undamaged is no wrong number
pytestmark = pytest.mark.filterwarnings("ignore:.*encountered in:RuntimeWarning")


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("two_link", 10),
        *(
            pytest.param(name, 100, marks=pytest.mark.slow)
            for name in ("two_link", "five_bar", "pick_and_place", "gantry", "stress/veering")
        ),
    ],
)
def test_no_damaged_file_of_the_cache_changes_a_frequency(
    name: str,
    count: int,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    record_property: Callable[[str, object], None],
) -> None:
    case = ea.load_case(CASES / f"{name}.yaml")
    model = case.model()
    plan = plan_of(case)
    true, _ = expand_plan(model, plan, None)
    entry = expansion_key(model, plan, affordable_order(model, plan.order))
    arrays = unpack(entry, _packed(tmp_path, entry, expansion_arrays(true.full, true.linear)))[0]
    rng = np.random.default_rng(12)
    q = plan.q0 + rng.uniform(-0.2, 0.2, (8, len(plan.q0)))
    y = plan.y0 * rng.uniform(0.8, 1.2, (8, len(plan.y0)))
    wanted = true.taylor_hz(q, y), true.linearised_hz(q, y), true.estimate(q, y)
    cache, believed = Cache(tmp_path), 0
    for _ in range(count):
        (tmp_path / f"{entry}.h5").write_bytes(damaged(entry, arrays, rng))
        with caplog.at_level(logging.CRITICAL):
            found, notes = expand_plan(model, plan, cache)
        believed += "the expansion coefficients come from the cache" in notes
        np.testing.assert_allclose(found.taylor_hz(q, y), wanted[0], rtol=WRONG)
        np.testing.assert_allclose(found.linearised_hz(q, y), wanted[1], rtol=WRONG)
        np.testing.assert_allclose(found.estimate(q, y), wanted[2], rtol=1e-3, atol=WRONG)
    record_property("believed, for nothing changed", f"{believed} of {count}")
    assert believed < count // 2


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("two_link", 12),
        *(
            pytest.param(name, 100, marks=pytest.mark.slow)
            for name in ("two_link", "five_bar", "pick_and_place", "gantry", "stress/veering")
        ),
    ],
)
def test_no_damaged_reduced_model_answers_otherwise(
    name: str, count: int, tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    case = ea.load_case(CASES / f"{name}.yaml")
    model = case.model()
    plan = plan_of(case)
    true = ea.reduce(model, plan.q0, plan.y0, plan.modes, 2)
    ea.save_reduced(true, tmp_path / "true.h5")
    entry = (tmp_path / "true.h5").read_bytes()[:200].decode().split("key=")[1][:64]
    arrays = unpack(entry, (tmp_path / "true.h5").read_bytes())[0]
    rng = np.random.default_rng(12)
    q = plan.q0 + rng.uniform(-0.5, 0.5, (12, len(plan.q0)))
    y = plan.y0 * rng.uniform(0.6, 1.4, (12, len(plan.y0)))
    q, y = _answered(true, q, y)
    hz, estimate = true.frequencies(q, y), true.error_estimate(q, y)
    believed = 0
    for _ in range(count):
        (tmp_path / "a.h5").write_bytes(damaged(entry, arrays, rng))
        try:
            found = ea.load_reduced(tmp_path / "a.h5")
        except StorageError:
            continue
        believed += 1
        np.testing.assert_allclose(found.frequencies(q, y), hz, rtol=WRONG)
        told = found.error_estimate(q, y)
        assert (told >= 0.999 * estimate - WRONG).all()  # one that is too high is safe
    record_property("believed, for nothing changed", f"{believed} of {count}")
    assert believed < count // 2


def plan_of(case: ea.Case) -> Plan:
    trajectory = None if case.file.trajectory is None else case.trajectory
    return plan_expansion(case.file, case.model(), trajectory)


def _packed(folder: Path, entry: str, arrays: dict[str, np.ndarray]) -> bytes:
    Cache(folder).store(entry, arrays, {})
    return (folder / f"{entry}.h5").read_bytes()


def _answered(true: ReducedModel, q: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, ...]:
    """The samples at which loops close."""
    kept = []
    for k in range(len(q)):
        try:
            true.frequencies(q[k], y[k])
        except ea.EigassignError:
            continue
        kept.append(k)
    return q[kept], y[kept]
