"""What the numbers of a table show about their units: a vector against the rate of another, noise, plausible sizes."""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np
from scipy.ndimage import convolve1d
from scipy.signal import savgol_filter

from ..settings import number, setting

AGREES = number("audit.column_evidence.agrees")
SAME = number("audit.column_evidence.same")
SMALLEST_FLIGHT_M = number("audit.column_evidence.smallest_flight_m")
LARGEST_FLIGHT_M = number("audit.column_evidence.largest_flight_m")
"""And at most this much."""
FASTEST_RAD_S = number("audit.column_evidence.fastest_rad_s")
SLOWEST_PEAK_RAD_S = number("audit.column_evidence.slowest_peak_rad_s")
MOST_M_S2 = number("audit.column_evidence.most_m_s2")
FASTEST_M_S = number("audit.column_evidence.fastest_m_s")
CELLS_V = setting("audit.column_evidence.cells_v")
LEAST_GRAVITY = number("audit.column_evidence.least_gravity")
YAW_FOLLOWED_RAD = number("audit.column_evidence.yaw_followed_rad")
YAW_MISSED_RAD = number("audit.column_evidence.yaw_missed_rad")
FASTEST_STEP_S = number("audit.column_evidence.fastest_step_s")
LONGEST_MEAN_S = number("audit.column_evidence.longest_mean_s")
NOISE_APART = number("audit.column_evidence.noise_apart")
"""Axes of an estimate differ less in their noise."""
SENSOR_NOISE_ALIKE = number("audit.column_evidence.sensor_noise_alike")
SENSOR_NOISE_APART = number("audit.column_evidence.sensor_noise_apart")
EPOCH_S = (946684800.0, 4102444800.0)
"""Unix time of the years 2000 and 2100, s."""
LONGEST_COUNT_S = 1e7
"""A clock that starts with the vehicle or its computer counts less: 116 days, s."""
WINDOW = 5
"""Rows a derivative is taken over."""


@dataclass(frozen=True)
class Ratio:
    """Amplitude of one signal over another's, by axis that moves, nan elsewhere; sign of their correlation."""

    size: tuple[float, ...]
    sign: tuple[int, ...]

    @property
    def known(self) -> list[float]:
        return [r for r in self.size if np.isfinite(r)]

    def agrees(self, factor: float) -> bool:
        """Whether every axis that moves has this ratio."""
        return bool(self.known) and all(abs(np.log(r / factor)) < np.log(SAME) for r in self.known)


def rate_of(time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(n, k) derivative of (n, k) on (n,) s, smoothed over ``WINDOW`` rows; nan where there is no number."""
    step = float(np.median(np.diff(time_s)))
    if len(values) <= WINDOW or not step > 0.0:
        return np.full(values.shape, np.nan)
    return np.asarray(savgol_filter(values, WINDOW, 2, deriv=1, delta=step, axis=0, mode=_ends(values)))


def smooth(values: np.ndarray) -> np.ndarray:
    """(n, k) as ``rate_of`` smooths."""
    return values if len(values) <= WINDOW else np.asarray(
        savgol_filter(values, WINDOW, 2, axis=0, mode=_ends(values)))


def _ends(values: np.ndarray) -> str:
    """How the filter goes on at the ends: by a polynomial, which needs numbers there."""
    return "interp" if np.isfinite(values[:WINDOW]).all() and np.isfinite(values[-WINDOW:]).all() else "nearest"


def ratio(signal: np.ndarray, reference: np.ndarray) -> Ratio:
    """``signal`` (n, k) over ``reference`` (n, k), axis by axis where they correlate."""
    sizes, signs = [], []
    for a, b in zip(signal.T, reference.T, strict=True):
        there = np.isfinite(a) & np.isfinite(b)
        x, y = (v[there] - np.mean(v[there]) if there.any() else v[:0] for v in (a, b))
        size = float(np.sqrt((x @ x) * (y @ y)))
        r = float(x @ y) / size if size > 0.0 and len(x) > WINDOW else 0.0
        sizes.append(float(np.sqrt((x @ x) / (y @ y))) if abs(r) > AGREES else float("nan"))
        signs.append(int(np.sign(r)) if abs(r) > AGREES else 0)
    return Ratio(tuple(sizes), tuple(signs))


def ratio_of_means(signal: np.ndarray, reference: np.ndarray, step_s: float) -> Ratio:
    """``ratio`` of means over the fewest rows over which an axis correlates: vibration and noise hide it in rows."""
    rows, found = 1, ratio(signal, reference)
    while not found.known and 2 * rows * step_s <= LONGEST_MEAN_S:
        rows *= 2
        found = ratio(*(convolve1d(x, np.full(rows, 1.0 / rows), axis=0) for x in (signal, reference)))
    return found


def is_recent(unix_s: float) -> bool:
    """Whether a time in seconds since 1970 is one at which a recording can have been made."""
    return EPOCH_S[0] <= unix_s <= EPOCH_S[1]


def spans(values: np.ndarray) -> np.ndarray:
    """(k,) between the 1 % and the 99 % quantile."""
    low, high = np.nanquantile(values, (0.01, 0.99), axis=0)
    return np.asarray(high - low)


def noise(values: np.ndarray, orders: tuple[int, int] = (2, 4)) -> np.ndarray:
    """(k,) standard deviation of white noise in (n, k); nan where differences of the two orders do not agree on it.

    Higher orders contain less motion where rows are rare."""
    found = []
    for column in values.T:
        good = column[np.isfinite(column)]
        if len(good) < 8 * WINDOW:
            found.append(float("nan"))
            continue
        low, high = (float(np.median(np.abs(np.diff(good, n)))) * 1.4826 / np.sqrt(comb(2 * n, n)) for n in orders)
        white = high > 0.0 and abs(np.log(low / high)) < 0.5 * np.log(SAME) if low > 0.0 else False
        found.append(high if white else float("nan"))
    return np.array(found)


def one_unit(values: np.ndarray, measured: bool) -> bool:
    """False where axes of (n, k) values carry noise of different sizes: they are not in one unit. ``measured``: by a
    sensor or a tracker, rather than estimated."""
    sizes, most = noise_by_axis(values, measured)
    sizes = sizes[np.isfinite(sizes)]
    return len(sizes) < 2 or bool(sizes.max() < most * sizes.min())


def alike(values: np.ndarray) -> bool:
    """Whether all axes of (n, k) values carry noise of one size, as those of one tracker in one unit do."""
    sizes = noise(values)
    return bool(np.isfinite(sizes).all() and sizes.max() < SENSOR_NOISE_ALIKE * sizes.min())


def noise_by_axis(values: np.ndarray, measured: bool) -> tuple[np.ndarray, float]:
    """(k,) ``noise``, and the largest ratio of two axes in one unit. Uses higher differences where lower ones show the
    noise of one axis at most."""
    sizes = noise(values)
    if np.isfinite(sizes).sum() > 1:
        return sizes, SENSOR_NOISE_APART if measured else NOISE_APART
    return noise(values, (4, 6)), NOISE_APART


def lengths_that_fit(values: np.ndarray, time_s: np.ndarray, factors: dict[str, float]) -> list[str]:
    """Units in which (n, k) positions are a flight: large enough, in reach, not faster than vehicles fly."""
    span, pull = float(np.max(spans(values))), pull_of(values, time_s)
    return [u for u, f in factors.items()
            if SMALLEST_FLIGHT_M <= f * span <= LARGEST_FLIGHT_M and f * pull < MOST_M_S2]


def pull_of(values: np.ndarray, time_s: np.ndarray, exceeded_in: float = 0.1) -> float:
    """Size of the second derivative of (n, k) positions, exceeded in a tenth of the rows."""
    return size_of(rate_of(time_s, rate_of(time_s, smooth(smooth(values)))), exceeded_in)


def no_vehicle_flies(values: np.ndarray, time_s: np.ndarray) -> bool:
    """Whether (n, k) positions, m, leave every room, and in a tenth of the rows faster than vehicles do."""
    if float(np.max(spans(values))) < LARGEST_FLIGHT_M:
        return False
    return pull_of(values, time_s) > MOST_M_S2 or size_of(rate_of(time_s, smooth(values))) > FASTEST_M_S


def size_of(vectors: np.ndarray, exceeded_in: float = 0.1) -> float:
    """Length of (n, k) vectors, exceeded in a tenth of the rows."""
    known = vectors[np.isfinite(vectors).all(axis=1)]
    return float(np.quantile(np.linalg.norm(known, axis=1), 1.0 - exceeded_in)) if len(known) else 0.0


def rates_that_fit(values: np.ndarray, factors: dict[str, float]) -> list[str]:
    """Units in which (n, k) turning rates are those of a flight."""
    peak = float(np.nanquantile(np.abs(values), 0.999))
    return [u for u, f in factors.items() if SLOWEST_PEAK_RAD_S <= f * peak <= FASTEST_RAD_S]


def falls_in_flight(height: np.ndarray) -> bool:
    """Whether a height begins and ends level and only falls in between: its axis points down."""
    good = height[np.isfinite(height)]
    if len(good) < 4 * WINDOW:
        return False
    ends = np.array([np.median(good[:WINDOW]), np.median(good[-WINDOW:])])
    low, high = np.quantile(good, (0.02, 0.98))
    travel = high - low
    return bool(travel > 0.0 and abs(ends[1] - ends[0]) < 0.1 * travel and np.max(ends) > high - 0.1 * travel
                and np.median(good) < high - 0.2 * travel)
