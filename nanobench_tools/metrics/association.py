"""Truth at an estimator's own timestamps: interpolated, never extrapolated, never across a hole in the truth.

Moving the truth to the estimate (not the other way) keeps the estimate as it was given. Rows are not matched to a
nearest neighbour, so no truth row can be used twice.
"""

from dataclasses import dataclass

import numpy as np

from .. import so3
from ..settings import number

MAXIMUM_GAP_S = number("tasks.association.maximum_gap_s")


SAME_STAMP_S = 1e-6
"""Unix times as floats are good to 2.4e-7 s, and text formats keep 6 or more decimals."""


def snap(time_s: np.ndarray, truth_time_s: np.ndarray) -> np.ndarray:
    """Set timestamps within SAME_STAMP_S of a truth row to that row's timestamp exactly.

    Timestamps that went through Unix time and text otherwise miss the first and last row by rounding.

    Parameters
    ----------
    time_s : ndarray
        (n,) s.
    truth_time_s : ndarray
        (m,) s, rising.

    Returns
    -------
    ndarray
        (n,) s.
    """
    at, t = np.asarray(time_s, float), np.asarray(truth_time_s, float)
    after = np.clip(np.searchsorted(t, at), 1, len(t) - 1)
    near = np.where(at - t[after - 1] < t[after] - at, t[after - 1], t[after])
    return np.where(np.abs(near - at) <= SAME_STAMP_S, near, at)


@dataclass(frozen=True)
class Association:
    """Truth at the kept timestamps.

    Attributes
    ----------
    kept : ndarray
        (n,) bool over the estimate's rows; k of them are kept.
    position_m : ndarray
        (k, 3) m, world.
    quaternion : ndarray
        (k, 4) x, y, z, w, body to world.
    velocity_m_s : ndarray or None
        (k, 3) m/s, world.
    """

    kept: np.ndarray
    position_m: np.ndarray
    quaternion: np.ndarray
    velocity_m_s: np.ndarray | None

    @property
    def dropped(self) -> int:
        """Number of timestamps that are left out."""
        return int(np.sum(~self.kept))


def associate(time_s: np.ndarray, truth_time_s: np.ndarray, position_m: np.ndarray, quaternion: np.ndarray,
              velocity_m_s: np.ndarray | None = None, maximum_gap_s: float = MAXIMUM_GAP_S) -> Association:
    """Return the truth at an estimator's timestamps.

    Position and velocity are interpolated linearly, attitude by slerp between neighbouring rows. A timestamp equal
    to a truth row gets that row exactly. Timestamps outside the truth's span, inside a long hole, or not finite are
    dropped.

    Parameters
    ----------
    time_s : ndarray
        (n,) s of the estimate.
    truth_time_s : ndarray
        (m,) s, strictly rising.
    position_m : ndarray
        (m, 3) m of the truth.
    quaternion : ndarray
        (m, 4) x, y, z, w of the truth.
    velocity_m_s : ndarray, optional
        (m, 3) m/s of the truth.
    maximum_gap_s : float
        Longest hole of the truth that is interpolated, s.

    Returns
    -------
    Association
        Truth at the kept timestamps.

    Raises
    ------
    ValueError
        For a truth that is not strictly rising, or of fewer than two rows.
    """
    at, t = np.asarray(time_s, float), np.asarray(truth_time_s, float)
    if len(t) < 2 or not (np.diff(t) > 0.0).all():
        raise ValueError("the truth needs at least two rows with strictly rising timestamps")
    after = np.clip(np.searchsorted(t, at, side="left"), 1, len(t) - 1)
    on_a_row = (t[after] == at) | (t[after - 1] == at)
    kept = (at >= t[0]) & (at <= t[-1]) & ((t[after] - t[after - 1] <= maximum_gap_s) | on_a_row)
    inside = at[kept]

    def linear(values: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(inside, t, column) for column in np.asarray(values, float).T], axis=1)

    if np.array_equal(inside, t):  # the same timestamps: nothing to interpolate
        attitude = np.array(quaternion, float)
    else:
        attitude = so3.interpolate(t, quaternion, inside)
    return Association(kept, linear(position_m), attitude, None if velocity_m_s is None else linear(velocity_m_s))
