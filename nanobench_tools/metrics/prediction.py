"""Multi-horizon prediction errors: mean absolute error h = 1..H steps after a window's start.

The equations are those of MAE_h with two corrections. Windows never cross a flight boundary, and q and -q are the same
attitude.

References
----------
Busetto et al. 2025, "Nonlinear System Identification Nano-drone Benchmark".
"""

from collections.abc import Sequence

import numpy as np

from .. import so3
from ..methods import Prediction

QUANTITIES = ("position_mae_m", "velocity_mae_m_s", "attitude_mae_rad", "rate_mae_rad_s")
HORIZONS = (1, 10, 50)


def window_starts(lengths: Sequence[int], horizon: int, every: int = 1) -> np.ndarray:
    """Return the first rows of all windows in an array of stretches laid end to end.

    A window has its start row and ``horizon`` rows after it, all in one stretch. Windows start at the first row of each
    stretch and every ``every`` rows.

    Parameters
    ----------
    lengths : sequence of int
        Numbers of rows of the stretches.
    horizon : int
        Rows after the start.
    every : int
        Rows between starts.

    Returns
    -------
    ndarray
        (k,) row numbers.

    Examples
    --------
    >>> window_starts([4, 2, 3], horizon=2).tolist()
    [0, 1, 6]
    """
    if not len(lengths):
        return np.empty(0, int)
    first = np.cumsum([0, *lengths[:-1]])
    return np.concatenate([f + np.arange(0, max(n - horizon, 0), every) for f, n in zip(first, lengths, strict=True)])


def window_errors(predicted: Prediction, true: Prediction) -> dict[str, np.ndarray]:
    """Compute errors of n windows at steps 1..H.

    A prediction that is not finite counts as nan, not as good.

    Parameters
    ----------
    predicted, true : Prediction
        Positions, velocities and rates (n, H, 3), quaternions (n, H, 4).

    Returns
    -------
    dict
        (n, H) each: |p - p| m, |v - v| m/s, geodesic angle rad, |w - w| rad/s, by the names of QUANTITIES.

    Raises
    ------
    ValueError
        Where shapes differ.
    """
    for name in ("position_m", "velocity_m_s", "quaternion", "rate_rad_s"):
        found, wanted = getattr(predicted, name).shape, getattr(true, name).shape
        if found != wanted:
            raise ValueError(f"{name} has shape {found} where {wanted} is needed")
    return {"position_mae_m": np.linalg.norm(predicted.position_m - true.position_m, axis=2),
            "velocity_mae_m_s": np.linalg.norm(predicted.velocity_m_s - true.velocity_m_s, axis=2),
            "attitude_mae_rad": so3.geodesic_angle(true.quaternion, predicted.quaternion),
            "rate_mae_rad_s": np.linalg.norm(predicted.rate_rad_s - true.rate_rad_s, axis=2)}


def multi_horizon(mean_errors: np.ndarray, horizons: Sequence[int] = HORIZONS) -> dict[str, float]:
    """Return MAE_h at some horizons, and their sum over 1..H.

    MAE_h is the mean over windows of the error h steps after the start.

    Parameters
    ----------
    mean_errors : ndarray
        (H,) mean error per step.
    horizons : sequence of int
        Those beyond H are left out.

    Returns
    -------
    dict
        ``{"1": MAE_1, "10": .., "50": .., "sum": MAE_1 + .. + MAE_H}``, in the unit of the errors.
    """
    at = {str(h): float(mean_errors[h - 1]) for h in horizons if h <= len(mean_errors)}
    return {**at, "sum": float(np.sum(mean_errors))}
