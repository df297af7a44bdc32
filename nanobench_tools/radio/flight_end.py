"""How a recorded flight ended whose link was lost in the air: the poses go on, and show a landing or a fall."""

from typing import Any

import numpy as np

from .. import so3

AIR_M = 0.1
"""Height above the lowest pose from which on a vehicle is in the air."""
AFTER_S = 0.3
"""The log ended at least so long before the poses."""
FALLS_M_S, OVER_S = 1.8, 0.05
"""Landings of the vehicle's planner sink with 1.3 m/s at most; a fall has reached this speed after 17 cm. Measured over
OVER_S, so that the noise of single poses does not count."""
TUMBLED_DEG = 60.0
LANDED, FELL, UNKNOWN = "landed", "fell", "unknown"


def lost_link(time_s: np.ndarray, position_m: np.ndarray, quaternion: np.ndarray, logged_s: float) -> dict[str, Any]:
    """For the sheet: ``how`` the flight ended, ``height_m`` at the last log, ``sank_m_s``; {} if it did not end so.

    Parameters
    ----------
    time_s, position_m, quaternion : ndarray
        Poses (n,), (n, 3), (n, 4), world, in the order of time.
    logged_s : float
        Time of the last log packet.
    """
    if len(time_s) < 2 or not time_s[0] < logged_s:
        return {}
    ground_m = float(position_m[:, 2].min())
    height_m = float(np.interp(logged_s, time_s, position_m[:, 2])) - ground_m
    after = time_s > logged_s
    if height_m < AIR_M:
        return {}
    found: dict[str, Any] = {"how": UNKNOWN, "height_m": round(height_m, 3)}
    if not after.any() or time_s[-1] - logged_s < AFTER_S:
        return found | {"why": "no poses after it"} if not after.any() else {}
    t, z = time_s[after], position_m[after, 2]
    sank = float(np.max((z - np.interp(t + OVER_S, t, z)) / OVER_S))
    up = so3.rotate(quaternion[-1], np.array([0.0, 0.0, 1.0]))[2]
    found["sank_m_s"] = round(max(sank, 0.0), 2)
    if sank > FALLS_M_S or np.degrees(np.arccos(np.clip(up, -1.0, 1.0))) > TUMBLED_DEG:
        return found | {"how": FELL}
    if z[-1] - ground_m < AIR_M:
        return found | {"how": LANDED}
    return found | {"why": "in the air at the last pose"}
