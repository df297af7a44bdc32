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
from .trajectory import velocity_rmse

DIVERGENCE_M = 0.5
"""A row further than this from its setpoint counts as diverged (NanoBench, Task 2)."""

SATURATED_PWM = 65000.0 / 65535.0
"""A motor above this ratio is at its ceiling."""


def position_errors(position_m: np.ndarray, setpoint_m: np.ndarray) -> np.ndarray:
    """Compute |p - p_sp|. Its RMS is RMSE_p, its mean ADE.

    Parameters
    ----------
    position_m, setpoint_m : ndarray
        (n, 3) m, world, at the same times.

    Returns
    -------
    ndarray
        (n,) m.

    Raises
    ------
    ValueError
        For other shapes, no rows, or values that are not finite.
    """
    position, setpoint = checked_pair(position_m, setpoint_m)
    return np.asarray(np.linalg.norm(position - setpoint, axis=1))


def divergence_percent(errors_m: np.ndarray, limit_m: float = DIVERGENCE_M) -> float:
    """Compute the share of rows with a large error.

    Parameters
    ----------
    errors_m : ndarray
        (n,) m.
    limit_m : float
        Error above which a row counts, m.

    Returns
    -------
    float
        %.
    """
    return float(100.0 * np.mean(np.asarray(errors_m) > limit_m))


def worst_decile(errors_m: np.ndarray) -> float:
    """Compute the mean of the largest tenth of the errors, at least one row.

    Parameters
    ----------
    errors_m : ndarray
        (n,) m.

    Returns
    -------
    float
        m.
    """
    worst = np.sort(errors_m)[-max(len(errors_m) // 10, 1):]
    return float(np.mean(worst))


def setpoint_velocity(time_s: np.ndarray, setpoint_m: np.ndarray, window: int = 31, order: int = 3) -> np.ndarray:
    """Compute the Savitzky-Golay derivative of the setpoint, which smooths the corners that radio gaps leave in a log.

    Parameters
    ----------
    time_s : ndarray
        (n,) s, taken as evenly spaced at its median step.
    setpoint_m : ndarray
        (n, 3) m, world.
    window : int
        Rows; 31 are 0.31 s at 100 Hz.
    order : int
        Of the polynomial.

    Returns
    -------
    ndarray
        (n, 3) m/s, world.

    Raises
    ------
    ValueError
        For fewer rows than the window.
    """
    if len(time_s) < window:
        raise ValueError(f"{len(time_s)} rows are fewer than the {window} of the derivative's window")
    step_s = float(np.median(np.diff(time_s)))
    return np.asarray(savgol_filter(setpoint_m, window, order, deriv=1, delta=step_s, axis=0))


def published_velocity_rmse(time_s: np.ndarray, velocity_m_s: np.ndarray, setpoint_m: np.ndarray) -> float:
    """Compute NanoBench's published velocity error: the reference is the raw step to the next setpoint over dt.

    A jump of the setpoint counts as a velocity of tens of m/s. It is kept only to reproduce the table.

    Parameters
    ----------
    time_s : ndarray
        (n,) s.
    velocity_m_s : ndarray
        (n, 3) m/s, world; the last row has no next setpoint and is left out.
    setpoint_m : ndarray
        (n, 3) m, world.

    Returns
    -------
    float
        m/s.
    """
    return velocity_rmse(velocity_m_s[:-1], np.diff(setpoint_m, axis=0) / np.diff(time_s)[:, None])


def heading_error_deg(yaw_rad: np.ndarray, setpoint_yaw_rad: np.ndarray) -> float:
    """Compute the mean |wrap(yaw - yaw_sp)|.

    Parameters
    ----------
    yaw_rad, setpoint_yaw_rad : ndarray
        (n,) rad.

    Returns
    -------
    float
        deg.
    """
    return float(np.degrees(np.mean(np.abs(so3.wrap_angle(np.asarray(yaw_rad) - np.asarray(setpoint_yaw_rad))))))


def published_heading_error_deg(yaw_rad: np.ndarray, setpoint_yaw_deg: np.ndarray) -> float:
    """Compute NanoBench's published heading "error": the setpoint's degrees are taken for radians before both become
    degrees.

    It is kept only to reproduce the table.

    Parameters
    ----------
    yaw_rad : ndarray
        (n,) rad.
    setpoint_yaw_deg : ndarray
        (n,) degrees.

    Returns
    -------
    float
        Of a mixed unit.
    """
    return heading_error_deg(yaw_rad, setpoint_yaw_deg)


def lag(time_s: np.ndarray, position_m: np.ndarray, setpoint_m: np.ndarray,
        limit_s: float = 1.0) -> tuple[float, float]:
    """Find the one delay of the position behind its setpoint that fits best.

    Parameters
    ----------
    time_s : ndarray
        (n,) s, strictly rising.
    position_m, setpoint_m : ndarray
        (n, 3) m, world, at the same times.
    limit_s : float
        Largest delay that is searched, s.

    Returns
    -------
    tuple of float
        Delay [s], positive where the vehicle is late, and the remaining RMS error [m].

    Raises
    ------
    ValueError
        For a stretch shorter than ``limit_s``.
    """
    position, setpoint = checked_pair(position_m, setpoint_m)
    found = constant_delay(time_s, position, time_s, setpoint, limit_s)
    return found.delay_s, found.rmse_after_m


def contour_errors(position_m: np.ndarray, setpoint_m: np.ndarray) -> np.ndarray:
    """Compute the distance of each position to the nearest point of the setpoint's path, at any time.

    The path is the polyline through the setpoints; the nearest vertex is found by a tree, then its two sides are tried.

    Parameters
    ----------
    position_m, setpoint_m : ndarray
        (n, 3) m, world, at the same times.

    Returns
    -------
    ndarray
        (n,) m.

    Raises
    ------
    ValueError
        For other shapes, no rows, or values that are not finite.
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
    """Compute the share of rows with any motor at its limit.

    Parameters
    ----------
    motor : ndarray
        (n, 4) PWM ratio, 0 to 1.
    limit : float
        Ratio above which a motor counts.

    Returns
    -------
    float
        %.
    """
    return float(100.0 * np.mean(np.any(np.asarray(motor) > limit, axis=1)))
