"""No damaged file is believed; of one whose hash was made anew, shapes and finite numbers are."""

import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from damage import damaged, forged

import eigassign as ea
from eigassign.modal import expansion_arrays
from eigassign.output import Cache
from eigassign.pipeline import affordable_order, expand_plan, expansion_key
from eigassign.study import Plan, plan_expansion

CASES = Path(__file__).parents[2] / "cases"
FROM_CACHE = "the expansion coefficients come from the cache"
FEW = 12  # of each kind by default
SLOW = [
    pytest.param(name, 100, marks=pytest.mark.slow)
    for name in ("two_link", "five_bar", "pick_and_place", "gantry", "stress/veering")
]
pytestmark = pytest.mark.filterwarnings("ignore:.*encountered in:RuntimeWarning")


def plan_of(case: ea.Case) -> Plan:
    trajectory = None if case.file.trajectory is None else case.trajectory
    return plan_expansion(case.file, case.model(), trajectory)


@pytest.mark.parametrize(("name", "count"), [("two_link", FEW), *SLOW])
def test_files_of_the_cache(
    name: str,
    count: int,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    record_property: Callable[[str, object], None],
) -> None:
    case = ea.load_case(CASES / f"{name}.yaml")
    model, plan = case.model(), plan_of(case)
    true, _ = expand_plan(model, plan, None)
    entry = expansion_key(model, plan, affordable_order(model, plan.order))
    arrays = expansion_arrays(true.full, true.linear)
    rng, cache, believed = np.random.default_rng(12), Cache(tmp_path), 0
    cache.store(entry, arrays)
    whole = (tmp_path / f"{entry}.h5").read_bytes()
    caplog.set_level(logging.CRITICAL)
    for k in range(2 * count):
        if k < count:
            (tmp_path / f"{entry}.h5").write_bytes(damaged(whole, rng))
        else:
            cache.store(entry, forged(arrays, rng))
        found, notes = expand_plan(model, plan, cache)
        again = expansion_arrays(found.full, found.linear)
        assert {n: a.shape for n, a in again.items()} == {n: a.shape for n, a in arrays.items()}
        assert all(np.isfinite(a).all() for a in again.values())
        if k < count or FROM_CACHE not in notes:
            assert FROM_CACHE not in notes
            assert all((again[n] == a).all() for n, a in arrays.items())
        believed += FROM_CACHE in notes
    record_property("believed with the hash made anew", f"{believed} of {count}")
    assert believed < count
