"""Input shapers against their constraints, the literature's figures and time integration."""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import eigassign.modal as em
from eigassign.errors import UsageError


def quintic(t: Any, T: float = 0.3) -> tuple[Any, Any, Any]:
    x = np.asarray(t) / T
    q, rate = x**3 * (10 - 15 * x + 6 * x**2), 30 * x**2 * (1 - x) ** 2 / T
    return q, rate, 60 * x * (1 - x) * (1 - 2 * x) / T**2


def left_after(acceleration: Any, hz: Any, zeta: float, end: float) -> float:
    """Amplitude of e'' + 2ζω e' + ω² e = −q'' at ``end``, f there being that of the end."""

    def rate(t: float, e: Any) -> list[float]:
        w = 2 * np.pi * hz(t)
        return [e[1], -2 * zeta * w * e[1] - w**2 * e[0] - acceleration(t)]

    e, v = solve_ivp(rate, (0, end), [0, 0], rtol=1e-10, atol=1e-15, max_step=2e-3).y[:, -1]
    w = 2 * np.pi * hz(end)
    return float(np.hypot(e, (v + zeta * w * e) / (w * np.sqrt(1 - zeta**2))))


@pytest.mark.parametrize("zeta", [0.0, 0.03, 0.2])
def test_nothing_is_left_at_the_design_frequency_and_of_zvd_no_slope(zeta: float) -> None:
    for own in (em.shaper(name, 20.0, zeta) for name in em.SHAPERS):
        assert own.amplitudes.sum() == pytest.approx(1.0, abs=1e-14)
        assert 0.0 == own.times_s[0] < own.delay == own.times_s[-1]
        if "ei" not in own.name:
            assert em.residual_share(own, 20.0, zeta) < 1e-12, own.name
    h = 1e-4  # V ~ h² where the slope is 0, h else
    near = [em.residual_share(em.shaper(n, 1.0, zeta), 1.0 + h, zeta) for n in ("zv", "zvd")]
    assert near[1] < 10 * h**2 < 0.5 * h < near[0]


def undamped(name: str, V: float = 0.05) -> list[float]:
    """Amplitudes at multiples of half a period by the closed forms of Singhose et al. for ζ = 0."""
    X = np.cbrt(V**2 * (np.sqrt(1 - V**2) + 1))
    a = (3 * X**2 + 2 * X + 3 * V**2) / (16 * X)
    b, c = (1 + 3 * V + 2 * np.sqrt(2 * (V**2 + V))) / 16, (1 - V) / 4
    ei, two = [(1 + V) / 4, (1 - V) / 2, (1 + V) / 4], [a, 0.5 - a, 0.5 - a, a]
    return {"ei": ei, "2hump_ei": two, "3hump_ei": [b, c, 1 - 2 * (b + c), c, b]}[name]


@pytest.mark.parametrize(
    ("name", "width", "top"),
    [("ei", 0.40, 0.0495), ("2hump_ei", 0.73, 0.0500), ("3hump_ei", 0.96, 0.0536)],
)
def test_ei_shapers_hold_5_percent_in_the_band_of_the_literature(
    name: str, width: float, top: float
) -> None:
    own, f = em.shaper(name, 1.0), np.linspace(0.3, 1.7, 14001)
    share = em.residual_share(own, f)
    ends = f[share <= 0.05][[0, -1]]
    # Closed forms have 0.399, 0.725 and 0.964; the fits in ζ move V by 0.4 % of the whole at most.
    assert np.ptp(ends) == pytest.approx(width, abs=0.01)
    assert share[(f > ends[0]) & (f < ends[1])].max() == pytest.approx(0.05, abs=0.004)
    assert own.amplitudes == pytest.approx(undamped(name), abs=2e-3)
    assert own.times_s == pytest.approx(0.5 * np.arange(len(own.times_s)), abs=3e-3)
    middle = 0.0 if name == "2hump_ei" else 0.05
    assert em.residual_share(own, 1.0) == pytest.approx(middle, abs=0.004)
    inside = np.linspace(1 - 0.5 * width, 1 + 0.5 * width, 500)  # damped, the band is wider
    damped = em.residual_share(em.shaper(name, 1.0, 0.2), inside, 0.2)
    assert damped.max() == pytest.approx(top, abs=2e-4)  # the fits, measured: a slip moves more


@pytest.mark.parametrize("zeta", [0.0, 0.05])
def test_an_oscillator_stands_still_after_a_shaped_move(zeta: float) -> None:
    own = em.shaper("zv", 5.0, zeta)
    command, end = em.shaped(own, quintic, 0.3)
    left, bare = (
        [left_after(lambda t, of=of: of(t)[2], lambda _, f=f: f, zeta, T) for f in (5, 6)]
        for of, T in ((command, end), (quintic, 0.3))
    )
    assert left[0] < 1e-6 * bare[0]  # of the integration; a mistuned one leaves what V says
    assert left[1] / bare[1] == pytest.approx(float(em.residual_share(own, 6, zeta)), rel=1e-5)


def test_rates_of_a_shaped_command_are_its_derivatives_in_several_coordinates() -> None:
    def two(t: Any) -> tuple[Any, ...]:
        return tuple(np.stack([part, -2 * part], axis=-1) for part in quintic(t))

    command, end = em.shaped(em.shaper("ei", 9.0, 0.02), two, 0.3)
    t = np.linspace(-0.01, end + 0.01, 4001)
    q, rate, acceleration = command(t)
    assert q[[0, -1]] == pytest.approx(np.array([[0.0, 0.0], [1.0, -2.0]]), abs=1e-14)
    assert command(t[7])[0] == pytest.approx(q[7])
    steady, _ = em.shaped(em.shaper("zv", 9.0), lambda t: (t, 1.0 + 0.0 * t, 0.0 * t), 0.3)
    assert steady(np.array([-1.0, 0.01, 1.0]))[1] == pytest.approx([0.0, 0.5, 0.0])
    # Central differences of steps of 0.1 ms; q'' has kinks, where they are off by a step's change.
    assert np.abs(np.gradient(q, t, axis=0) - rate).max() < 1e-4 * np.abs(rate).max()
    assert np.abs(np.gradient(rate, t, axis=0) - acceleration).max() < 2e-3 * acceleration.max()


def test_convolved_shapers_null_both_modes_and_multiply_shares() -> None:
    a, b, f = em.shaper("zv", 10.0, 0.02), em.shaper("zvd", 27.0, 0.05), np.linspace(5, 40, 50)
    both = em.convolved(a, b)
    assert both.delay == a.delay + b.delay
    product = em.residual_share(a, f, 0.03) * em.residual_share(b, f, 0.03)
    assert em.residual_share(both, f, 0.03) == pytest.approx(product, abs=1e-14)
    assert em.residual_share(both, [10.0, 27.0], [0.02, 0.05]).max() < 1e-12


@pytest.mark.parametrize("name", ["zv", "mzv", "3hump_ei"])
def test_the_best_design_frequency_is_that_of_a_grid(name: str) -> None:
    hz = np.stack([np.linspace(18, 26, 7), np.full(7, 31.0), np.full(7, 90.0)], axis=1)
    modes = em.excited_modes(hz, 0.02, [1.0, 0.3, 0.01])
    assert [(m.mode, m.hz_range) for m in modes] == [(1, (18.0, 26.0)), (2, (31.0, 31.0))]
    one, each = sorted(em.best_designs(modes, [name]), key=lambda d: len(d.shaper.hz))
    assert each.shaper.name == f"{name}*{name}"
    assert each.worst < one.worst
    f, grid = np.linspace(18, 26, 161), np.linspace(9, 46, 3701)
    weighted = np.append(np.ones(161), 0.3)
    shares = [em.residual_share(em.shaper(name, d, 0.02), np.append(f, 31), 0.02) for d in grid]
    worst = (shares * weighted).max(axis=1)
    # A grid of 0.01 Hz is off by half a step at most, V by its slope, about 2/f, of that.
    assert one.shaper.hz[0] == pytest.approx(grid[worst.argmin()], abs=0.02)
    assert worst.min() - 1e-3 < one.worst <= worst.min() + 1e-4


def test_a_shaper_that_follows_the_mode_leaves_less_than_any_that_does_not() -> None:
    def hz(s: Any) -> Any:
        return 4.0 + 2.0 * quintic(np.clip(s, 0.0, 1.0), 1.0)[0]

    t = np.linspace(0.0, 1.0, 1001)
    times, q = em.shaped_along(t, quintic(t, 1.0)[0], hz(t))
    assert (q[-1], times[-1]) == pytest.approx((1.0, 1.0 + 0.5 / 6.0), abs=1e-3)
    acceleration = np.gradient(np.gradient(q, times), times)
    left = left_after(lambda s: np.interp(s, times, acceleration), hz, 0.0, float(times[-1]))
    bare = left_after(lambda s: quintic(s, 1.0)[2], hz, 0.0, 1.0)
    assert left < 0.04 * bare  # 0.024; half the local period leaves 0.061
    still, own = em.shaped_along(t, quintic(t, 1.0)[0], 5.0, 0.1)
    command = em.shaped(em.shaper("zv", 5.0, 0.1), lambda s: quintic(s, 1.0), 1.0)[0]
    assert own == pytest.approx(command(still)[0], abs=1e-9)  # of the spline: h⁴ and more
    with pytest.raises(UsageError):
        em.shaped_along(t[::-1], t, 5.0)


def test_controllers_are_told_what_they_know_and_nothing_else() -> None:
    x, y = em.shaper("mzv", 41.5, 0.04), em.shaper("2hump_ei", 30.0, 0.2)
    lines = em.klipper_lines(x).splitlines()
    own = ["shaper_type_x: mzv", "shaper_freq_x: 41.5000", "damping_ratio_x: 0.040000"]
    assert lines[:5] == ["[input_shaper]", *own, "shaper_type_y: mzv"]
    assert em.reprap_line(x) == 'M593 P"mzv" F41.5000 S0.040000'
    assert em.reprap_line(y).startswith(f'M593 P"ei2" F{30 / np.sqrt(0.96):.4f} ')
    zv = em.shaper("zv", 30.0)
    wrong = [(em.shaper("zvdd", 30.0), em.klipper_lines)]
    wrong += [(zv, em.reprap_line), (em.shaper("zvd", 3.0), em.reprap_line)]
    for given, lines_of in wrong:
        with pytest.raises(UsageError):
            lines_of(given)
    for name, zeta in (("zvv", 0.0), ("ei", 0.5)):
        with pytest.raises(UsageError):
            em.shaper(name, 3.0, zeta)
