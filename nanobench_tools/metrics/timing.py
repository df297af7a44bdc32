"""Where a position error points, along or across the track, and what one constant delay explains of it.

A time error dt of a vehicle at speed v looks like a position error v dt along the track. A time error cannot make or
hide the error across the track.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from ..settings import number
from .alignment import checked_pair
from .trajectory import rms

MINIMUM_SPEED_M_S = number("tasks.timing.minimum_speed_m_s")


@dataclass(frozen=True)
class TrackErrors:
    """Errors along and across the true track, over the rows that move.

    Attributes
    ----------
    along_rmse_m, across_rmse_m : float
        RMS, m.
    n : int
        Number of rows.
    """

    along_rmse_m: float
    across_rmse_m: float
    n: int


def along_across(estimate_m: np.ndarray, truth_m: np.ndarray, velocity_m_s: np.ndarray,
                 minimum_speed_m_s: float = MINIMUM_SPEED_M_S) -> TrackErrors:
    """Split p_est - p into e.u (along) and |e - (e.u) u| (across), with u = v/|v| the true direction.

    Parameters
    ----------
    estimate_m, truth_m : ndarray
        (n, 3) m, in the same frame.
    velocity_m_s : ndarray
        (n, 3) m/s of the truth.
    minimum_speed_m_s : float
        Slower rows are left out, m/s.

    Returns
    -------
    TrackErrors
        RMS of both, m; nan where no row moves.

    Raises
    ------
    ValueError
        For other shapes, no rows, or values that are not finite.
    """
    estimate, truth = checked_pair(estimate_m, truth_m)
    velocity = checked_pair(velocity_m_s, truth)[0]
    speed = np.linalg.norm(velocity, axis=1)
    moving = speed > minimum_speed_m_s
    if not moving.any():
        return TrackErrors(float("nan"), float("nan"), 0)
    error = (estimate - truth)[moving]
    direction = velocity[moving] / speed[moving, None]
    along = np.sum(error * direction, axis=1)
    return TrackErrors(rms(along), rms(np.linalg.norm(error - along[:, None] * direction, axis=1)), int(moving.sum()))


@dataclass(frozen=True)
class Delay:
    """The one constant delay that fits best.

    Attributes
    ----------
    delay_s : float
        s, positive where the estimate is late.
    rmse_after_m : float
        RMS position error with the delay removed, m.
    rows : ndarray
        (k,) rows that it was computed on.
    truth_m, velocity_m_s : ndarray
        (k, 3) m and m/s: the truth at these rows, with the delay removed.
    """

    delay_s: float
    rmse_after_m: float
    rows: np.ndarray
    truth_m: np.ndarray
    velocity_m_s: np.ndarray


def constant_delay(time_s: np.ndarray, estimate_m: np.ndarray, truth_time_s: np.ndarray, truth_m: np.ndarray,
                   limit_s: float = 0.25) -> Delay:
    """Find the delay d that minimises sum |p_est(t) - p(t - d)|^2, with p a cubic spline through the truth.

    Rows nearer than ``limit_s`` to the ends of the truth are left out, so that every d is judged on the same rows.

    Parameters
    ----------
    time_s : ndarray
        (n,) s.
    estimate_m : ndarray
        (n, 3) m.
    truth_time_s : ndarray
        (m,) s, rising.
    truth_m : ndarray
        (m, 3) m.
    limit_s : float
        Largest delay that is searched, s.

    Returns
    -------
    Delay
        The delay and the remaining error.

    Raises
    ------
    ValueError
        Where no row is left.
    """
    time_s, estimate = np.asarray(time_s, float), np.asarray(estimate_m, float)
    spline = CubicSpline(truth_time_s, truth_m)
    rows = np.flatnonzero((time_s - limit_s >= truth_time_s[0]) & (time_s + limit_s <= truth_time_s[-1]))
    if not len(rows):
        raise ValueError(f"no row lies {limit_s:g} s inside the span of the truth")
    t, e = time_s[rows], estimate[rows]

    def cost(delay: float) -> float:
        return rms(np.linalg.norm(e - spline(t - delay), axis=1))

    grid = np.linspace(-limit_s, limit_s, 21)  # coarse first: the cost of a periodic path has more than one dip
    best = grid[int(np.argmin([cost(d) for d in grid]))]
    step = grid[1] - grid[0]
    bounds = (max(best - step, -limit_s), min(best + step, limit_s))
    found = float(minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": 1e-5}).x)
    return Delay(found, cost(found), rows, spline(t - found), spline(t - found, 1))
