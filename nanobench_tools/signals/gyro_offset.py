"""Constant offset of the gyro: its rate beyond the turning of the attitude.

The turning is that of the tracked attitude, else of the estimated one. Each axis of the gyro is the body rate through a
matrix near the identity (scale, tilted markers) plus the offset. The uncertainty of the offset includes that of the
matrix: a vehicle that spins steadily does not separate offset and scale. Without any attitude, a rest shows the offset.
"""

from dataclasses import dataclass

import numpy as np

from ..settings import number
from .context import Context
from .dropouts import alive_until
from .estimated_turning import known_estimate, known_gyro, rates_of
from .gravity import gravity_axis
from .mocap_derivatives import derivatives_of
from .paired_signals import BRIDGED_S
from .stream_frames import IMU
from .usable_rows import usable_streams

LIMIT_RAD_S = number("audit.gyro_offset.limit_rad_s")
MATRIX_SD = number("audit.gyro_offset.matrix_sd")
CERTAIN = number("audit.gyro_offset.certain")
BLOCK_S = 0.5
FEWEST_BLOCKS = 10
LONGEST_STEP_S = 0.15
"""Rates between attitudes that are further apart are means over too long."""
STILL_RAD_S = 0.02
STILL_M_S2 = 0.15
"""Scatter of gyro and accelerometer at rest, in a block."""
RESTS = 4
"""Blocks at rest that show an offset."""


@dataclass(frozen=True)
class GyroOffset:
    """offset_rad_s and sd_rad_s (3,), nan for an unknown axis; ``by``: what the gyro is compared with, in words."""

    offset_rad_s: np.ndarray
    sd_rad_s: np.ndarray
    by: str

    @property
    def wrong(self) -> list[int]:
        """Axes whose offset exceeds ``LIMIT_RAD_S`` beyond doubt."""
        return [i for i in range(3) if abs(self.offset_rad_s[i]) > LIMIT_RAD_S + CERTAIN * self.sd_rad_s[i]]


def gyro_offset(context: Context) -> GyroOffset | None:
    """None without a gyro, or without anything to compare it with."""
    found = known_gyro(context)
    if found is None:
        return None
    time_s, gyro = found
    for by, turning in (("tracked attitude", _tracked(context)), ("estimated attitude", _estimated(context))):
        if turning is not None and (offset := _against(time_s, gyro, *turning)) is not None:
            return GyroOffset(*offset, f"the {by} turns")
    return _at_rest(context)


def _tracked(context: Context) -> tuple[np.ndarray, np.ndarray] | None:
    truth = context.once(derivatives_of)
    return None if truth is None else (truth.time_s[truth.good], truth.rate_rad_s[truth.good])


def _estimated(context: Context) -> tuple[np.ndarray, np.ndarray] | None:
    estimate = known_estimate(context)
    if estimate is None:
        return None
    middle, rates = rates_of(estimate)
    return (middle, rates) if len(middle) > 1 and np.median(np.diff(middle)) <= LONGEST_STEP_S else None


def _against(time_s: np.ndarray, gyro: np.ndarray, at: np.ndarray, rates: np.ndarray
             ) -> tuple[np.ndarray, np.ndarray] | None:
    """Offset and its standard deviation (3,), rad/s, by regression over means of blocks."""
    after = np.clip(np.searchsorted(time_s, at), 1, len(time_s) - 1)
    near = (time_s[after] - time_s[after - 1] < BRIDGED_S) & (at >= time_s[0]) & (at <= time_s[-1])
    if near.sum() < 2 * FEWEST_BLOCKS:
        return None
    at, rates = at[near], rates[near]
    measured = np.stack([np.interp(at, time_s, g) for g in gyro.T], axis=1)
    _, block, rows = np.unique(np.floor((at - at[0]) / BLOCK_S), return_inverse=True, return_counts=True)
    full = rows > 0.5 * np.median(rows)
    if full.sum() < FEWEST_BLOCKS:
        return None

    def means(values: np.ndarray) -> np.ndarray:
        return np.stack([np.bincount(block, v) / rows for v in values.T], axis=1)[full]

    turning, left = means(rates), means(measured - rates)
    design = np.column_stack([turning, np.ones(len(turning))])
    found = [_fit(design, left[:, i]) for i in range(3)]
    return np.array([f[0] for f in found]), np.array([f[1] for f in found])


def _fit(design: np.ndarray, values: np.ndarray) -> tuple[float, float]:
    """Last coefficient of ``values`` (n,) by ``design`` (n, 4) and its standard deviation. The first three have a
    normal prior of ``MATRIX_SD``. Blocks far from the fit (a crash, a lost pose) count less."""
    prior = np.diag([*[1.0 / MATRIX_SD**2] * 3, 0.0])
    left = values - np.median(values)
    for _ in range(5):
        size = max(1.4826 * float(np.median(np.abs(left))), 1e-4)
        weight = 1.0 / np.maximum(np.abs(left) / (2.0 * size), 1.0) / size**2
        covariance = np.linalg.inv((design * weight[:, None]).T @ design + prior)
        estimate = covariance @ (design.T @ (weight * values))
        left = values - design @ estimate
    return float(estimate[3]), float(np.sqrt(covariance[3, 3]))


def resting_blocks(context: Context) -> list[tuple[float, np.ndarray, np.ndarray]]:
    """Time [s], mean gyro (3,) rad/s and mean specific force (3,) m/s^2 of every ``BLOCK_S`` in which both are steady.

    Empty without gyro and accelerometer."""
    imu = context.once(usable_streams).get("imu")
    if imu is None or not all(q in imu for vector in IMU for q in vector):
        return []
    known = np.isfinite(imu[(*IMU[0], *IMU[1])]).all(axis=1) & (imu.time_s <= context.once(alive_until)["imu"])
    time_s, gyro, acc = imu.time_s[known], imu[IMU[0]][known], imu[IMU[1]][known]
    block = np.floor((time_s - time_s[0]) / BLOCK_S) if len(time_s) else time_s
    return [(float(time_s[rows].mean()), gyro[rows].mean(axis=0), acc[rows].mean(axis=0))
            for rows in np.split(np.arange(len(time_s)), np.flatnonzero(np.diff(block)) + 1)
            if len(rows) > 4 and gyro[rows].std(axis=0).max() < STILL_RAD_S
            and acc[rows].std(axis=0).max() < STILL_M_S2]


def _at_rest(context: Context) -> GyroOffset | None:
    """By blocks in which gyro and accelerometer are steady: gravity does not turn there, so that the gyro turns about
    it at most. That axis counts only while the motors are off."""
    gravity = context.once(gravity_axis)
    if gravity is None:
        return None
    motor = context.once(usable_streams).get("motor")
    rests = []
    for at, gyro, _ in resting_blocks(context):
        mean = gyro.copy()
        within = None if motor is None else motor.values[np.abs(motor.time_s - at) <= 0.5 * BLOCK_S]
        if within is None or not len(within) or np.nan_to_num(within).any():
            mean[gravity.axis] = np.nan
        rests.append(mean)
    if len(rests) < RESTS:
        return None
    found = np.array(rests)
    known = np.isfinite(found).sum(axis=0) >= RESTS
    offset, sd = np.full(3, np.nan), np.full(3, np.nan)
    offset[known] = np.nanmedian(found[:, known], axis=0)
    sd[known] = 1.4826 * np.nanmedian(np.abs(found[:, known] - offset[known]), axis=0)
    return GyroOffset(offset, sd, "gravity at rest turns")
