"""How the time error can move from one row to the next: samples are delivered late, never early, in order.

A sample taken on a steady clock arrives after a varying delay. In a radio hang the delay grows by as much as time
passes (firmware time stops on the host), then a burst catches up. Hence d(i) - d(i-1) <= dt always, small steps
mostly, rises of 0..dt while the radio hangs, falls after it. The shares and scales are weak: halving or doubling them
moves the result by far less than its own standard deviation.
"""

import numpy as np

from ...settings import number

CELL_S = 0.0025
"""Grid of the delay; a quarter of a row, and half the finest structure that 100 Hz rows can show."""

LARGEST_FALL_S = number("retiming.packet_delay.largest_fall_s")

SHARE_HANG, SHARE_BURST = number("retiming.packet_delay.share_hang"), number("retiming.packet_delay.share_burst")
SHARE_RESIDUAL = 1.0 - SHARE_HANG - SHARE_BURST
SCALE_RESIDUAL_S = number("retiming.packet_delay.scale_residual_s")
SCALE_BURST_S = number("retiming.packet_delay.scale_burst_s")


def log_step_prior(step_s: float, cell_s: float = CELL_S) -> tuple[np.ndarray, np.ndarray, int]:
    """Steps [s] (b,), their log probability (b,), and how many cells upward are possible in ``step_s``."""
    up = max(1, round(step_s / cell_s))
    x = np.arange(-round(LARGEST_FALL_S / cell_s), up + 1) * cell_s
    laplace = np.exp(-np.abs(x) / SCALE_RESIDUAL_S)
    hang = (x >= 0.0).astype(float)
    burst = np.where(x <= 0.0, np.exp(x / SCALE_BURST_S), 0.0)
    p = (SHARE_RESIDUAL * laplace / laplace.sum() + SHARE_HANG * hang / hang.sum()
         + SHARE_BURST * burst / burst.sum())
    return x, np.log(p), up
