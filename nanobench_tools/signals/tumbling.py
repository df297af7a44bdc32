"""Gyro against accelerometer, where no attitude is recorded to compare the gyro with.

The specific force of a flight, turned to the world by the gyro, points upwards on average. With a gyro in a larger unit
than its own, the vehicle would turn head over heels and the force would point anywhere. In 144 real recordings in
rad/s it did in none; with deg/s read as rad/s it did in 123. A gyro in a smaller unit leaves rates that no vehicle
flies with, while the force changes.
"""

from __future__ import annotations

import numpy as np

from .. import so3
from ..settings import number
from .column_evidence import SLOWEST_PEAK_RAD_S
from .context import Context
from .estimated_turning import GYRO, known_gyro
from .gravity import ACC
from .known_factors import DEG, NamedFactor, named_factor
from .pairs import gyro_pair, sums_of
from .usable_rows import even_grid, usable_streams

WINDOW_S = 2.0
STEP_S = 0.02
FEWEST_WINDOWS = 2
TUMBLES = number("audit.tumbling.tumbles")
UPRIGHT = number("audit.tumbling.upright")
FORCE_CHANGES_M_S2 = number("audit.tumbling.force_changes_m_s2")
FACTORS = (DEG, 16.4 * DEG, 1e3 * DEG)
"""Of a gyro in deg/s, in counts of a range of 2000 deg/s, and in mdeg/s, all read as rad/s."""


def gyro_scale(time_s: np.ndarray, gyro: np.ndarray, force: np.ndarray) -> NamedFactor | None:
    """The factor by which a gyro (n, 3) rad/s turns too fast or too slowly for a force (n, 3) m/s^2; None for a gyro
    that fits, and where nothing shows it."""
    rows = np.isfinite(gyro).all(axis=1) & np.isfinite(force).all(axis=1) & np.isfinite(time_s)
    rows[rows] = np.diff(time_s[rows], prepend=-np.inf) > 0.0
    time_s, gyro, force = time_s[rows], gyro[rows], force[rows]
    if len(time_s) < 2 or time_s[-1] - time_s[0] < FEWEST_WINDOWS * WINDOW_S:
        return None
    peak = float(np.quantile(np.abs(gyro), 0.999))
    turns, pulls = _windows(time_s, gyro), _windows(time_s, force)
    low, high = np.quantile(np.linalg.norm(pulls, axis=2), (0.01, 0.99), axis=1)
    flies = high - low > FORCE_CHANGES_M_S2
    if flies.sum() < FEWEST_WINDOWS:
        return None
    if 0.0 < peak < SLOWEST_PEAK_RAD_S:
        return named_factor("rad/s", 1.0 / DEG, 1.01)
    turns, pulls = turns[flies], pulls[flies]
    if _upright(turns, pulls) > TUMBLES:
        return None
    shown = next((f for f in FACTORS if _upright(turns / f, pulls) > UPRIGHT), None)
    return None if shown is None else named_factor("rad/s", shown, 1.01)


def _windows(time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(windows, rows, 3) means over ``STEP_S``."""
    grid = even_grid(time_s[0], time_s[-1], STEP_S, len(time_s))
    if not len(grid):
        return np.empty((0, 1, 3))
    path = np.vstack([np.zeros(3), np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time_s)[:, None], axis=0)])
    means = np.diff(np.stack([np.interp(grid, time_s, p) for p in path.T], axis=1), axis=0) / STEP_S
    size = round(WINDOW_S / STEP_S)
    return means[: len(means) // size * size].reshape(-1, size, 3)


def _upright(turns: np.ndarray, pulls: np.ndarray) -> float:
    """Size of the mean force over the mean size, when turned by the gyro. Three quarters of the windows have less: a
    crash at the end of a flight tumbles, too."""
    turn = np.tile([0.0, 0.0, 0.0, 1.0], (len(turns), 1))
    mean = np.zeros((len(turns), 3))
    for rates, force in zip(turns.swapaxes(0, 1), pulls.swapaxes(0, 1), strict=True):
        mean += so3.rotate(turn, force)
        turn = so3.multiply(turn, so3.exp(STEP_S * rates))
    size = np.linalg.norm(pulls, axis=2).sum(axis=1)
    return float(np.quantile(np.linalg.norm(mean, axis=1) / np.maximum(size, 1e-12), 0.75))


def tumbling(context: Context) -> NamedFactor | None:
    """``gyro_scale`` of a recording; None where motion capture judges the gyro."""
    imu, found = context.once(usable_streams).get("imu"), known_gyro(context)
    if sums_of(context, gyro_pair) is not None or imu is None or found is None or not all(q in imu for q in ACC):
        return None
    end = found[0][-1]
    rows = imu.time_s <= end
    return gyro_scale(imu.time_s[rows], imu[GYRO][rows], imu[ACC][rows])
