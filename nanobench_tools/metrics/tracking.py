"""How well a vehicle follows its setpoints: position, velocity, heading, divergence, and what a pure lag explains.

position_m, setpoint_m (n, 3) m world at the same times throughout. Source of the published forms: NanoBench, Task 2.
Its faults (steps in the setpoint velocity, mixed angle units) are kept in functions named ``published_``.
"""

import numpy as np
from scipy.signal import savgol_filter
from scipy.spatial import cKDTree

from .. import so3
from .alignment import checked_pair
from .timing import constant_delay
from .trajectory import rms

DIVERGENCE_M = 0.5
"""A row further than this from its setpoint counts as diverged (NanoBench, Task 2)."""

SATURATED_PWM = 65000.0 / 65535.0
"""A motor above this ratio is at its ceiling."""


def position_errors(position_m: np.ndarray, setpoint_m: np.ndarray) -> np.ndarray:
    """(n,) m: |p - p_sp|. Its RMS is RMSE_p, its mean ADE."""
    position, setpoint = checked_pair(position_m, setpoint_m)
    return np.asarray(np.linalg.norm(position - setpoint, axis=1))


def divergence_percent(errors_m: np.ndarray, limit_m: float = DIVERGENCE_M) -> float:
    """Share of rows with an error above ``limit_m`` [%]; errors_m (n,) m."""
    return float(100.0 * np.mean(np.asarray(errors_m) > limit_m))


def worst_decile(errors_m: np.ndarray) -> float:
    """Mean of the largest tenth of the errors [m], at least one row; errors_m (n,) m."""
    worst = np.sort(errors_m)[-max(len(errors_m) // 10, 1):]
    return float(np.mean(worst))


def setpoint_velocity(time_s: np.ndarray, setpoint_m: np.ndarray, window: int = 31, order: int = 3) -> np.ndarray:
    """(n, 3) m/s: Savitzky-Golay derivative of the setpoint over ``window`` rows (0.31 s at 100 Hz), order 3.

    time_s (n,) s, taken as evenly spaced at its median step. Smooths the corners that radio gaps leave in a logged
    setpoint; raises ValueError for fewer rows than the window.
    """
    if len(time_s) < window:
        raise ValueError(f"{len(time_s)} rows are fewer than the {window} of the derivative's window")
    step_s = float(np.median(np.diff(time_s)))
    return np.asarray(savgol_filter(setpoint_m, window, order, deriv=1, delta=step_s, axis=0))


def velocity_rmse(velocity_m_s: np.ndarray, reference_m_s: np.ndarray) -> float:
    """sqrt(mean |v - v_sp|^2) [m/s] over the 3-vector; both (n, 3) m/s."""
    velocity, reference = checked_pair(velocity_m_s, reference_m_s)
    return rms(np.linalg.norm(velocity - reference, axis=1))


def published_velocity_rmse(time_s: np.ndarray, velocity_m_s: np.ndarray, setpoint_m: np.ndarray) -> float:
    """NanoBench's published velocity error [m/s]: the reference is the raw step to the next setpoint over dt.

    time_s (n,) s; velocity_m_s (n, 3) m/s; setpoint_m (n, 3) m; the last row has no next one and is left out. A jump
    of the setpoint counts as a velocity of tens of m/s: kept only to reproduce the table.
    """
    return velocity_rmse(velocity_m_s[:-1], np.diff(setpoint_m, axis=0) / np.diff(time_s)[:, None])


def heading_error_deg(yaw_rad: np.ndarray, setpoint_yaw_rad: np.ndarray) -> float:
    """Mean |wrap(yaw - yaw_sp)| [deg]; both (n,) rad."""
    return float(np.degrees(np.mean(np.abs(so3.wrap_angle(np.asarray(yaw_rad) - np.asarray(setpoint_yaw_rad))))))


def published_heading_error_deg(yaw_rad: np.ndarray, setpoint_yaw_deg: np.ndarray) -> float:
    """NanoBench's published heading "error": the setpoint's degrees are taken for radians before both become degrees.

    yaw_rad (n,) rad, setpoint_yaw_deg (n,) degrees. Kept only to reproduce the table.
    """
    return heading_error_deg(yaw_rad, setpoint_yaw_deg)


def lag(time_s: np.ndarray, position_m: np.ndarray, setpoint_m: np.ndarray,
        limit_s: float = 1.0) -> tuple[float, float]:
    """(lag_s, rmse_m): the one delay of the position behind its setpoint that fits best, and the RMS error left.

    time_s (n,) s strictly rising. Looked for within +-limit_s. Raises ValueError for a stretch shorter than that.
    """
    position, setpoint = checked_pair(position_m, setpoint_m)
    found = constant_delay(time_s, position, time_s, setpoint, limit_s)
    return found.delay_s, found.rmse_after_m


def contour_errors(position_m: np.ndarray, setpoint_m: np.ndarray) -> np.ndarray:
    """(n,) m: distance of each position to the nearest point of the setpoint's path, at any time.

    The path is the polyline through the setpoints; the nearest vertex is found by a tree, then its two sides are tried.
    """
    position, setpoint = checked_pair(position_m, setpoint_m)
    nearest = cKDTree(setpoint).query(position)[1]
    best = np.full(len(position), np.inf)
    for a, b in ((np.maximum(nearest - 1, 0), nearest), (nearest, np.minimum(nearest + 1, len(setpoint) - 1))):
        side = setpoint[b] - setpoint[a]
        length2 = np.sum(side * side, axis=1)
        share = np.sum((position - setpoint[a]) * side, axis=1) / np.where(length2 > 0.0, length2, 1.0)
        foot = setpoint[a] + np.clip(share, 0.0, 1.0)[:, None] * side
        best = np.minimum(best, np.linalg.norm(position - foot, axis=1))
    return best


def saturated_percent(motor: np.ndarray, limit: float = SATURATED_PWM) -> float:
    """Share of rows with any motor at its ceiling [%]; motor (n, 4) PWM ratio 0..1."""
    return float(100.0 * np.mean(np.any(np.asarray(motor) > limit, axis=1)))
