import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eigassign.assignment import hz_from_lam, trapezoidal_weights
from eigassign.errors import AccuracyError

repeatable = settings(derandomize=True, deadline=None, database=None, max_examples=50)


@pytest.mark.parametrize(
    ("time", "weights"), [([0.0, 1.0, 3.0, 3.5], [0.5, 1.5, 1.25, 0.25]), ([0.3], [1.0])]
)
def test_trapezoidal_weights_are_half_the_neighbouring_steps_and_1_of_one_sample(time, weights):
    np.testing.assert_allclose(trapezoidal_weights(time), weights)


@repeatable
@given(
    st.lists(st.floats(0.01, 10.0), min_size=1, max_size=20),
    st.floats(-5, 5),
    st.floats(-5, 5),
)
def test_trapezoidal_weights_integrate_straight_lines_exactly(steps, offset, slope):
    time = np.cumsum([0.0, *steps])
    integral = trapezoidal_weights(time) @ (offset + slope * time)
    exact = offset * time[-1] + 0.5 * slope * time[-1] ** 2
    scale = (abs(offset) + abs(slope) * time[-1]) * time[-1]
    assert integral == pytest.approx(exact, abs=1e-13 * scale)  # round-off of some 20 terms


@pytest.mark.parametrize("bad", [-1e-3, np.nan, np.inf])
def test_a_predicted_lambda_no_mechanism_has_is_withheld(bad):
    with pytest.raises(AccuracyError, match=r"sample \[1\]"):
        hz_from_lam([1.0, bad])
