"""The sensor alone: overlapping Allan deviation of what was recorded while the motors stood still.

W. J. Riley, "Handbook of Frequency Stability Analysis", NIST SP 1065 (2008), eq. 11, for rates (frequency data).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..flight import Flight, motors_of
from ..settings import number, setting


def overlapping_allan(values: np.ndarray, m: int) -> tuple[np.ndarray, int]:
    """(variance (d,), terms): Allan variance of the columns of ``values`` (n, d) averaged over m samples, overlapping.

    ``terms`` is how many differences it rests on (about terms / m of them independent); nan and 0 where n < 2 m.
    """
    values = np.asarray(values, float)
    terms = len(values) - 2 * m + 1
    if terms < 1 or m < 1:
        return np.full(values.shape[1], np.nan), 0
    total = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    second = total[2 * m :] - 2.0 * total[m:-m] + total[: -2 * m]
    return np.sum(second**2, axis=0) / (2.0 * m * m * terms), terms


ACC = ("acc_x", "acc_y", "acc_z")
GYRO = ("gyro_x", "gyro_y", "gyro_z")
TAUS_S = setting("noise.rest.taus_s")
DENSITY_S = setting("noise.rest.density_s")

OFF = number("noise.rest.off")
LEAST_S = number("noise.rest.least_s")
QUIET_RAD_S = number("noise.rest.quiet_rad_s")

INSTABILITY = 0.664
"""Floor of the Allan deviation over bias instability (IEEE Std 952, sqrt(2 ln 2 / pi))."""


@dataclass(frozen=True)
class Rest:
    """``spans``: stretches at rest; seconds in all; ``taus_s`` (t,) and their Allan deviations acc [m/s^2], gyro
    [rad/s] (t, 3); ``densities`` (3,) per root Hz; ``instability`` (3,), nan where the deviation still falls at the
    longest tau."""

    spans: int
    seconds: float
    taus_s: np.ndarray
    acc: np.ndarray
    gyro: np.ndarray
    acc_density: np.ndarray
    gyro_density: np.ndarray
    acc_instability: np.ndarray
    gyro_instability: np.ndarray


def stretches(flight: Flight) -> list[tuple[np.ndarray, np.ndarray]]:
    """[(time_s (n,), acc and gyro (n, 6))] of the flight at rest; none without a motor stream that says so."""
    if "imu" not in flight or "motor" not in flight or not len(flight["motor"]):
        return []
    imu, motor = flight["imu"], flight["motor"]
    if not all(name in imu for name in ACC + GYRO) or len(imu) < 3:
        return []
    values = imu[ACC + GYRO]
    drive = np.nanmax(np.abs(motor[motors_of(motor)]), axis=1)
    still = np.interp(imu.time_s, motor.time_s, drive) < OFF
    still &= np.isfinite(values).all(axis=1)
    if not still.any():
        return []
    gyro = values[:, 3:]
    still &= (np.abs(gyro - np.median(gyro[still], axis=0)) < QUIET_RAD_S).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(int), [0]])))
    found = [(imu.time_s[a:b], values[a:b]) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return [(t, v) for t, v in found if len(t) > 10 and t[-1] - t[0] >= LEAST_S]


def at_rest(flights: Sequence[Flight]) -> Rest | None:
    """Pooled over all flights, each variance weighted by the time that it rests on; None where nothing stood still."""
    parts = [part for flight in flights for part in stretches(flight)]
    if not parts:
        return None
    rows: list[tuple[float, np.ndarray]] = []
    for tau in TAUS_S:
        total, weight = np.zeros(6), 0.0
        for time_s, values in parts:
            step = float(np.median(np.diff(time_s)))
            m = max(round(tau / step), 1)
            if not 0.7 * tau <= m * step <= 1.4 * tau:
                continue
            variance, terms = overlapping_allan(values, m)
            if terms:
                total, weight = total + variance * terms * step, weight + terms * step
        if weight > 0.0:
            rows.append((tau, np.sqrt(total / weight)))
    if not rows:
        return None
    taus = np.array([tau for tau, _ in rows])
    deviation = np.array([value for _, value in rows])
    between = (taus >= DENSITY_S[0]) & (taus <= DENSITY_S[1])
    density = np.median(deviation[between] * np.sqrt(taus[between])[:, None], axis=0) if between.any() \
        else deviation[-1] * np.sqrt(taus[-1])
    lowest = np.argmin(deviation, axis=0)
    floor = np.where(lowest < len(taus) - 1, deviation[lowest, range(6)] / INSTABILITY, np.nan)
    seconds = float(sum(t[-1] - t[0] for t, _ in parts))
    return Rest(len(parts), seconds, taus, deviation[:, :3], deviation[:, 3:], density[:3], density[3:],
                floor[:3], floor[3:])
