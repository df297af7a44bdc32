"""The mean offset of a link whose clock wanders.

The lag that fits a wandering gyro best lies where its error is most often, not at its mean, and scatters by half the
wander. Where the gyro moves with the track (``moving``), the track's error is removed from the gyro's timestamps
first. The remaining lag is the mean, several times sharper. Kept only if the gyro then fits better than before.
"""

from dataclasses import replace

import numpy as np

from ...signals import paired_signals
from ...signals.context import Context
from ...signals.mocap_derivatives import STEP_S, derivatives_of
from ..mathematics.lags import Lag, best_lag, lag_sums
from .drift_and_wander import moving_clocks, track_of
from .measured_lags import measured_lags

GYRO = ("gyro_x", "gyro_y", "gyro_z")


def mean_lag(context: Context) -> Lag | None:
    """The gyro's lag without the wander that the track shows; None where it is unknown."""
    clock, track = context.once(moving_clocks).get("imu"), context.once(track_of)
    plain = context.once(measured_lags).get("imu")
    placed, truth = paired_signals.on_grid(context, "imu", GYRO), context.once(derivatives_of)
    if clock is None or not clock.like_track or track is None or plain is None or placed is None or truth is None:
        return None
    t = truth.time_s
    true_time = np.maximum.accumulate(t - np.interp(t, track.time_s, track.late_s))
    values = np.stack([np.interp(t, true_time, placed[0][:, k]) for k in range(3)], axis=1)
    pair = paired_signals.pair_of(context, "imu", GYRO, lambda v: v, values, placed[1], truth.rate_rad_s,
                                  paired_signals.RATE_BAND_HZ, True)
    if pair is None:
        return None
    sums = lag_sums(pair.measured, pair.reference, pair.use, STEP_S, pair.reach_s)
    if sums is None:
        return None
    lag = best_lag(sums)
    if np.log(1.0 - lag.explained).sum() >= np.log(1.0 - plain.lag.explained).sum():
        return None
    return replace(lag, half_width_s=float(np.hypot(lag.half_width_s, 1.96 * track.mean_sd_s)))
