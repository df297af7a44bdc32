"""How late the rows of a log sent by radio are, told from the packets that are missing, without any reference.

A resampler draws rows on a straight line where no packet came. While the radio waits, the content of a row falls
behind its timestamp. The packets of the gap then come all at once and the timestamps catch up. So the delay rises with
every interpolated row and fades within some tenths of a second. Sums of the interpolated rows so far, forgotten at
several rates, follow it. Causal: a row is known to be drawn when the next one is there. Where rows are packets nothing
is drawn and nothing is late.
"""

import numba as nb
import numpy as np

from nanobench_tools.flight import Flight
from nanobench_tools.settings import setting
from nanobench_tools.signals.radio_gaps import drawn

FORGET_S = setting("imu.radio_clock.forget_s")
LATE_S = setting("imu.radio_clock.late_s")
"""Seconds of lateness per interpolated row, forgotten at FORGET_S; a ridge regression on circles and trefoils."""

def lateness(flight: Flight) -> np.ndarray:
    """(n,) s at the rows of the IMU; the constant part cannot be distinguished from packets and is left to the
    filter."""
    return np.asarray(_forgetting(flight["imu"].time_s, drawn(flight), np.array(FORGET_S)) @ np.array(LATE_S))


@nb.njit(cache=True)
def _forgetting(time_s: np.ndarray, drawn_rows: np.ndarray, forget_s: np.ndarray) -> np.ndarray:
    """(n, k): sums of the rows before i - 1 that were drawn, each fading with ``forget_s`` (k,)."""
    n, k = len(time_s), len(forget_s)
    sums = np.zeros((n, k))
    for i in range(1, n):
        gone = max(time_s[i] - time_s[i - 1], 0.0)
        for j in range(k):
            sums[i, j] = sums[i - 1, j] * np.exp(-gone / forget_s[j]) + drawn_rows[i - 1]
    return sums
