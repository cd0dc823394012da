"""Input shapers: commands as a few delayed copies that leave a mode without vibration.

A shaper is impulses A_i at times t_i, Σ A_i = 1. The shaped command is Σ A_i q(t − t_i), and of the
vibration that an impulse leaves in a mode of frequency ω and ratio ζ it leaves, at t_n, the share

    V = e^(−ζω t_n) √(C² + S²),   C, S = Σ A_i e^(ζω t_i) cos, sin(ω_d t_i),   ω_d = ω √(1 − ζ²).

With K = e^(−πζ/√(1−ζ²)) and the damped period T_d, ZV is (1, K)/(1 + K) at 0 and T_d/2; ZVD, ZVDD
and ZVDDD are ZV two, three and four times over (Singer and Seering, J. Dyn. Syst. Meas. Control
112, 1990). EI allows 5 % at the frequency, and the two and three humps so much beside it, for a
wider band: the fits in ζ of Singhose, Seering and Singer (J. Mech. Des. 116, 1994; Proc. ACC, 1997)
as controllers have them. MZV is that of Klipper: (1, √2 κ, κ²) at 0, 3/8 and 3/4 T_d, κ = K^(3/4).

Two shapers one after the other leave the product of their shares. Where a mode changes along the
path, ZV with A(t) delays by half a period of its phase, to g(t):

    q_shaped(t) = A_1 q(t) + A_2 q(g(t)),   ∫_g^t ω_d ds = π,

so that g always grows. An oscillator that went from 4 to 6 Hz in a move of 1 s kept 2.4 % of its
vibration; 6.1 % with half the period of each instant, 37 % or more with that of 4, 5 or 6 Hz.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.optimize import minimize_scalar
from scipy.special import comb

from eigassign.errors import UsageError

Floats = NDArray[np.float64]
Command = Callable[[Any], tuple[Any, Any, Any]]  # q, q̇ and q̈ at times
V = 0.05  # what EI shapers leave
# Impulses without damping, and the step between them in damped periods.
_EVEN: dict[str, tuple[Any, float]] = {
    "mzv": ([1.0, np.sqrt(2.0), 1.0], 0.375),
    **{f"zv{'d' * n}": (comb(n + 1, np.arange(n + 2)), 0.5) for n in range(4)},
}
# Largest ζ by name: of EI shapers where their fits still hold V to 5.7 %, measured.
SHAPERS = {**dict.fromkeys(_EVEN, 0.99), "ei": 0.4, "2hump_ei": 0.3, "3hump_ei": 0.2}
KLIPPER = "zv", "mzv", "zvd", "ei", "2hump_ei", "3hump_ei"  # its Config_Reference
REPRAP = {name: name for name in _EVEN if name != "zv"} | {"2hump_ei": "ei2", "3hump_ei": "ei3"}
REPRAP_HZ = 5.73, 1000.0  # half a period is at most 65535 of 750 000 ticks a second
FINE = 100  # steps along a path at least, between whose samples humps would hide
SCAN = 300  # design frequencies looked at before the best is polished

# A row per impulse: coefficients of 1, ζ, ζ², ζ³ of its amplitude and of its time in periods 1/f,
# for EI in damped ones.
# fmt: off
_FITS = {
    "ei": np.array([  # polynomials of V = 5 %
        [0.2621605, 0.861744, 0.654648, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.4756125, -0.100003, -1.261411, 0.0, 0.4999, 0.044525575, -0.0585255, 0.930273],
        [0.2622270, -0.761741, 0.606763, 0.0, 1.0, 0.0, 0.0, 0.0],
    ]),
    "2hump_ei": np.array([
        [0.16054, 0.76699, 2.26560, -1.22750, 0.0, 0.0, 0.0, 0.0],
        [0.33911, 0.45081, -2.58080, 1.73650, 0.49890, 0.16270, -0.54262, 6.16180],
        [0.34089, -0.61533, -0.68765, 0.42261, 0.99748, 0.18382, -1.58270, 8.17120],
        [0.15997, -0.60246, 1.00280, -0.93145, 1.49920, -0.09297, -0.28338, 1.85710],
    ]),
    "3hump_ei": np.array([
        [0.11275, 0.76632, 3.29160, -1.44380, 0.0, 0.0, 0.0, 0.0],
        [0.23698, 0.61164, -2.57850, 4.85220, 0.49974, 0.23834, 0.44559, 12.4720],
        [0.30008, -0.19062, -2.14560, 0.13744, 0.99849, 0.29808, -2.36460, 23.3990],
        [0.23775, -0.73297, 0.46885, -2.08650, 1.49870, 0.10306, -2.01390, 17.0320],
        [0.11244, -0.45439, 0.96382, -1.46000, 1.99960, -0.28231, 0.61536, 5.40450],
    ]),
}
# fmt: on


@dataclass(frozen=True, eq=False)
class Shaper:
    """Impulses ``amplitudes`` (k,), whose sum is 1, at ``times_s`` (k,) from 0 on, in seconds.

    ``hz`` and ``zeta`` are what it was designed for, one each per shaper that it is made of.
    """

    name: str
    amplitudes: Floats
    times_s: Floats
    hz: tuple[float, ...]
    zeta: tuple[float, ...]

    def __post_init__(self) -> None:
        for array in (self.amplitudes, self.times_s):
            array.setflags(write=False)

    @property
    def delay(self) -> float:
        """By how many seconds a command becomes longer."""
        return float(self.times_s[-1])


def shaper(name: str, hz: float, zeta: float = 0.0) -> Shaper:
    """The shaper ``name`` of `SHAPERS` for f in Hz (undamped) and ζ.

    Raises UsageError for an unknown name, f not above 0, and ζ beyond where the shaper holds.
    """
    if name not in SHAPERS:
        raise UsageError(f"no input shaper is called {name!r}; there are {', '.join(SHAPERS)}")
    if not (0.0 < hz < np.inf and 0.0 <= zeta <= SHAPERS[name]):
        raise UsageError(f"{name} needs hz > 0 and zeta of 0 to {SHAPERS[name]}: {hz}, {zeta}")
    damped = 1.0 / (hz * np.sqrt(1.0 - zeta**2))
    if name in _FITS:
        A, t = np.moveaxis(_FITS[name].reshape(-1, 2, 4) @ zeta ** np.arange(4), 1, 0)
        t = t * (damped if name == "ei" else 1.0 / hz)
    else:
        undamped, step = _EVEN[name]
        t = step * damped * np.arange(len(undamped))
        A = undamped * np.exp(-2.0 * np.pi * hz * zeta * t)
    return Shaper(name, A / A.sum(), t, (float(hz),), (float(zeta),))


def convolved(first: Shaper, second: Shaper) -> Shaper:
    """The two one after the other, k₁ k₂ impulses in order of time: what either nulls is nulled."""
    t = np.add.outer(first.times_s, second.times_s).ravel()
    order, name = np.argsort(t, kind="stable"), f"{first.name}*{second.name}"
    A = np.outer(first.amplitudes, second.amplitudes).ravel()[order]
    return Shaper(name, A, t[order], first.hz + second.hz, first.zeta + second.zeta)


def residual_share(shaper: Shaper, hz: ArrayLike, zeta: ArrayLike = 0.0) -> Floats:
    """V of modes of f in Hz and ζ, arrays of any shapes that broadcast; 1 is no shaper at all."""
    f, z = np.broadcast_arrays(np.asarray(hz, float), np.asarray(zeta, float))
    s = 2.0 * np.pi * f * (-z + 1j * np.sqrt(1.0 - z**2))
    left = np.exp(s[..., None] * (shaper.delay - shaper.times_s)) @ shaper.amplitudes
    return np.abs(left)


# --- The shapers of a path


class ModeOnPath(NamedTuple):
    """A mode that counts: ``hz``, ``zeta`` and ``weight`` (n,) along the path, the most being 1."""

    mode: int  # 1, 2, … as the columns
    hz: Floats
    zeta: Floats
    weight: Floats

    @property
    def hz_range(self) -> tuple[float, float]:
        """Lowest and highest frequency in Hz."""
        return float(self.hz.min()), float(self.hz.max())


class Design(NamedTuple):
    """A shaper and the worst share of vibration it leaves, of that of the most excited mode."""

    shaper: Shaper
    worst: float


def excited_modes(
    hz: ArrayLike, zeta: ArrayLike, weights: ArrayLike = 1.0
) -> tuple[ModeOnPath, ...]:
    """The modes of ``hz`` (n, m), in Hz at n samples of a path, that are excited enough to count.

    ``zeta`` and ``weights`` (how strongly each is excited) broadcast to (n, m). Left out is what is
    below `V` of the most, as EI leaves as much of that. Between samples values are linear.
    Raises UsageError unless f > 0, 0 <= ζ < 1, weights >= 0 and one above.
    """
    f, z, w = np.broadcast_arrays(np.atleast_2d(np.asarray(hz, float)), zeta, weights)
    if not (np.all((f > 0.0) & (z >= 0.0) & (z < 1.0) & (w >= 0.0)) and w.max() > 0.0):
        raise UsageError("shapers need frequencies above 0, 0 <= zeta < 1 and a weight above 0")
    n, w = len(f), w / w.max()
    fine = np.linspace(0.0, n - 1.0, -(-FINE // max(n - 1, 1)) * (n - 1) + 1)

    return tuple(
        ModeOnPath(i + 1, *(np.interp(fine, np.arange(n), x[:, i]) for x in (f, z, w)))
        for i in np.flatnonzero(w.max(axis=0) >= V).tolist()
    )


def worst_share(shaper: Shaper, modes: Sequence[ModeOnPath], spread: float = 0.0) -> float:
    """Largest weighted V along the path, each frequency uncertain by ± ``spread``, at 5 values."""
    by = np.linspace(1.0 - spread, 1.0 + spread, 5 if spread else 1)[:, None]
    shares = (m.weight * residual_share(shaper, by * m.hz, m.zeta) for m in modes)
    return max(float(share.max()) for share in shares)


def best_design(name: str, modes: Sequence[ModeOnPath], spread: float = 0.0) -> Design:
    """The shaper ``name`` of the design frequency that leaves the least worst share of ``modes``.

    Its ζ is the mean. Searched from half the lowest frequency to 1.5 times the highest. Where all
    are constant any zero of the shaper is as good: give a ``spread``. Raises as `shaper` does.
    """
    zeta = float(np.mean([np.average(mode.zeta, weights=mode.weight) for mode in modes]))
    low, high = min(m.hz_range[0] for m in modes), max(m.hz_range[1] for m in modes)
    grid = np.geomspace(1.5 * high, 0.5 * low, SCAN)  # from above: of equals the shortest

    def worst(hz: float) -> float:
        return worst_share(shaper(name, hz, zeta), modes, spread)

    k = int(np.argmin([worst(hz) for hz in grid]))
    ends = float(grid[min(k + 1, SCAN - 1)]), float(grid[max(k - 1, 0)])
    polished = minimize_scalar(worst, bounds=ends, method="bounded", options={"xatol": 1e-9 * high})
    hz = min(float(polished.x), float(grid[k]), key=worst)
    return Design(shaper(name, hz, zeta), worst(hz))


def best_designs(
    modes: Sequence[ModeOnPath], names: Iterable[str] = tuple(SHAPERS), spread: float = 0.0
) -> tuple[Design, ...]:
    """Every shaper at its best for all ``modes``, and of several, one for each convolved, by delay.

    Raises UsageError as `shaper` does.
    """
    found = []
    for name in names:
        found.append(best_design(name, modes, spread))
        if len(modes) > 1:
            each = reduce(convolved, (best_design(name, [m], spread).shaper for m in modes))
            found.append(Design(each, worst_share(each, modes, spread)))
    return tuple(sorted(found, key=lambda design: design.shaper.delay))


# --- Shaped commands


def shaped(shaper: Shaper, motion: Command, duration: float) -> tuple[Command, float]:
    """The shaped command and its duration, of ``motion`` at rest before 0 and after ``duration``.

    Commands take times in seconds, one or (n,), and give q, q̇ and q̈ whose first axis is that of
    the times. Raises UsageError for a duration that is not above 0.
    """
    if not duration > 0.0:
        raise UsageError(f"a command needs a duration above 0 s, not {duration}")

    def command(times: Any) -> tuple[Any, Any, Any]:
        sums: list[Any] = [0.0, 0.0, 0.0]
        for A, delay in zip(shaper.amplitudes, shaper.times_s, strict=True):
            u = np.asarray(times, float) - delay
            moves = (u >= 0.0) & (u <= duration)
            for k, part in enumerate(map(np.asarray, motion(np.clip(u, 0.0, duration)))):
                on = moves.reshape(moves.shape + (1,) * (part.ndim - moves.ndim))
                sums[k] = sums[k] + A * (part * on if k else part)
        return sums[0], sums[1], sums[2]

    return command, duration + shaper.delay


def shaped_along(
    times_s: ArrayLike, q: ArrayLike, hz: ArrayLike, zeta: ArrayLike = 0.0
) -> tuple[Floats, Floats]:
    """Times and q by a ZV that changes with f (n,) in Hz and ζ along q (n, …), at rest at its ends.

    The times go on by the last step until all is at rest, f and ζ staying. Between samples q is a
    spline. Raises UsageError where times do not ascend, f is not above 0 or ζ not in [0, 1).
    """
    t, q = np.asarray(times_s, float), np.asarray(q, float)
    f, z = (np.broadcast_to(np.asarray(each, float), t.shape) for each in (hz, zeta))
    if not (np.all(np.diff(t) > 0.0) and np.all(f > 0.0) and np.all((z >= 0.0) & (z < 1.0))):
        raise UsageError("a command needs ascending times, frequencies above 0 and 0 <= zeta < 1")
    root, step = np.sqrt(1.0 - z**2), t[-1] - t[-2]
    more = int(np.ceil(0.5 / (f * root)[-1] / step))
    times = np.append(t, t[-1] + step * np.arange(1, more + 1))
    damped, K = (np.pad(x, (0, more), "edge") for x in (f * root, np.exp(-np.pi * z / root)))
    phase = PchipInterpolator(times, damped).antiderivative()(times)  # monotone between samples
    g = PchipInterpolator(phase, times)(np.maximum(phase - 0.5, 0.0))
    spline, K = CubicSpline(t, q, bc_type="clamped"), K.reshape(-1, *(1,) * (q.ndim - 1))
    own, late = (spline(np.clip(each, t[0], t[-1])) for each in (times, g))
    return times, (own + K * late) / (1.0 + K)


# --- Lines for controllers


def klipper_lines(shaper: Shaper, axes: Iterable[str] = "xy") -> str:
    """Section [input_shaper] of printer.cfg, for axes x, y and z (in newer releases).

    Raises UsageError for a shaper that Klipper does not know.
    """
    if shaper.name not in KLIPPER:
        raise UsageError(f"Klipper has {', '.join(KLIPPER)}, not {shaper.name}")
    lines = "shaper_type_{0}: {1}\nshaper_freq_{0}: {2:.4f}\ndamping_ratio_{0}: {3:.6f}\n"
    own = shaper.name, shaper.hz[0], shaper.zeta[0]
    return "[input_shaper]\n" + "".join(lines.format(axis, *own) for axis in axes)


def reprap_line(shaper: Shaper) -> str:
    """M593 of RepRapFirmware 3.4 and later; there EI2 and EI3 count in damped periods, as F says.

    Raises UsageError for a shaper or frequency that the firmware does not take.
    """
    if shaper.name not in REPRAP:
        raise UsageError(f"RepRapFirmware has {', '.join(REPRAP)}, no {shaper.name}")
    zeta = shaper.zeta[0]
    f = shaper.hz[0] / (np.sqrt(1.0 - zeta**2) if shaper.name in _FITS else 1.0)
    if not REPRAP_HZ[0] <= f <= REPRAP_HZ[1]:
        raise UsageError(f"RepRapFirmware takes {REPRAP_HZ[0]} to {REPRAP_HZ[1]} Hz, not {f:.4g}")
    return f'M593 P"{REPRAP[shaper.name]}" F{f:.4f} S{zeta:.6f}'
