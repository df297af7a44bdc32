"""Tracked positions without the jumps of ``faults.mocap_jump``, for checks that need only the height above the ground.
It needs only the positions, so the search for jumps can use it to find when the vehicle flew."""

import numpy as np

from ..settings import count, number

LIMIT_M = number("audit.step_removal.limit_m")
BEND_M_S2 = number("audit.step_removal.bend_m_s2")
"""Between two frames a vehicle bends its path by less (``faults.mocap_jump``)."""
SIDE = count("audit.step_removal.side")


def steps(time_s: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Steps between frames of position (n, k).

    - rows (m,): i.
    - offset (m, k) m: the step from frame i to i + 1 beyond the mean velocity of the SIDE frames on either side.
    - limit (m,) m: what a vehicle can do."""
    i = np.arange(SIDE, len(time_s) - SIDE - 1)
    before = (position[i] - position[i - SIDE]) / (time_s[i] - time_s[i - SIDE])[:, None]
    after = (position[i + 1 + SIDE] - position[i + 1]) / (time_s[i + 1 + SIDE] - time_s[i + 1])[:, None]
    dt = time_s[i + 1] - time_s[i]
    return i, position[i + 1] - position[i] - 0.5 * (before + after) * dt[:, None], LIMIT_M + BEND_M_S2 * dt**2


def grouped(rows: np.ndarray) -> list[np.ndarray]:
    """Rows that are closer than the frames a step disturbs."""
    return np.split(rows, np.flatnonzero(np.diff(rows) > SIDE + 1) + 1) if len(rows) else []


def levelled(time_s: np.ndarray, height: np.ndarray) -> np.ndarray:
    """(n,) heights of one frame: each jump of ``height`` (n,) m is taken out from there on. A spike comes back, and is
    left as it is."""
    rising = len(time_s) > 2 * SIDE + 2 and bool((np.diff(time_s) > 0.0).all())
    if not rising:
        return height
    i, offset, limit = steps(time_s, height[:, None])
    found = height.copy()
    for group in grouped(np.flatnonzero(np.abs(offset[:, 0]) > limit)):
        a, b = i[group[0]], i[group[-1]] + 1
        first, last = max(a - SIDE, 0), min(b + SIDE, len(height) - 1)
        slope = 0.5 * ((height[a] - height[first]) / (time_s[a] - time_s[first]) if a > first else 0.0) + \
            0.5 * ((height[last] - height[b]) / (time_s[last] - time_s[b]) if last > b else 0.0)
        jump = height[b] - height[a] - slope * (time_s[b] - time_s[a])
        if abs(jump) > LIMIT_M:
            found[i[group[int(np.argmax(np.abs(offset[group, 0])))]] + 1:] -= jump
    return found
