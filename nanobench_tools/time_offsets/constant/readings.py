"""Clock offset of every stream against the motion capture, from the measured delays.

The vehicle's streams share one clock (one radio link with the host's timestamps). Of these, the motion capture predicts
only the gyro without a further delay, so the offset of the vehicle's clock is that of the gyro. Streams of the
estimator (position, attitude, acceleration) also follow their own inputs by 0-40 ms, which is no error of their
timestamps. Such a stream gets the gyro's offset if it follows the gyro by OWN_LAG_S[0] to OWN_LAG_S[1], and the reason
reports its measured delay. Otherwise its own timestamps are wrong, and it gets its measured delay, with an interval
widened by the possible lag. Cameras do not see motors, requests, setpoints and battery. If the clock wanders, the
offset is its mean (``mean_lag``).

The lag that fits a wandering gyro best lies where its error is most often, not at its mean, and scatters by half the
wander. Where the gyro moves with the track (``moving``), the track's error is removed from the gyro's timestamps
first. The remaining lag is the mean, several times sharper. Kept only if the gyro then fits better than before.
"""

from dataclasses import replace

import numpy as np

from ...settings import number
from ...signals import paired_signals, pairs
from ...signals.context import Context
from ...signals.mocap_derivatives import STEP_S, derivatives_of
from ..mathematics.lags import Lag, best_lag, lag_sums
from .drift_and_wander import OWN_LAG_S, moving_clocks, track_of
from .measured_lags import MEASURED_BY, Measured, measured_lags
from .reading import ClockReading

GYRO = ("gyro_x", "gyro_y", "gyro_z")
SMALLEST_RATE_RAD_S = number("audit.readings.smallest_rate_rad_s")
WIDEST_S = number("audit.readings.widest_s")
UNSEEN = {
    "motor": "cameras do not see motor commands",
    "motor_request": "cameras do not see motor commands",
    "setpoint": "the vehicle follows its setpoint by an unknown delay",
    "rpm": "cameras do not see the rotors",
    "pid": "the vehicle follows its requests by an unknown delay",
    "battery": "cameras do not see the voltage",
    "command": "cameras do not see commands",
    "stand": "thrust-stand tables have no motion",
}


def read_clocks(context: Context) -> dict[str, ClockReading]:
    """A reading for every stream of the flight but the motion capture, which is the yardstick."""
    flight = context.flight
    names = [name for name in flight.streams if name != "mocap"]
    if context.once(derivatives_of) is None:
        return {name: ClockReading.unknown("no motion capture to compare with") for name in names}
    measured = dict(context.once(measured_lags))
    mean = context.once(mean_lag)
    if mean is not None:
        gyro = measured["imu"]
        measured["imu"] = replace(gyro, lag=mean, by=f"{gyro.by} with the track's wander taken out")
    readings = {}
    for name in names:
        if name in measured:
            readings[name] = _with_wander(context, name, _reading(context, name, measured))
        elif name in MEASURED_BY:
            readings[name] = ClockReading.unknown("less than three seconds in the air with true values")
        else:
            readings[name] = ClockReading.unknown(UNSEEN.get(name, "cameras do not see it"))
    return readings


def _reading(context: Context, name: str, measured: dict[str, Measured]) -> ClockReading:
    own = measured[name]
    gyro = measured.get("imu")
    if gyro is not None and not gyro.by.startswith("gyro"):
        gyro = None
    why_not = _why_not(context, own, is_gyro=own is gyro)
    if own is gyro:
        return (
            ClockReading.unknown(why_not)
            if why_not
            else _of(own.lag.offset_s, own.lag.half_width_s, (0.0, 0.0), f"{own.by} against the motion capture")
        )
    if gyro is None or _why_not(context, gyro, is_gyro=True):
        text = why_not or (
            f"{own.by} follow by {_ms(own)}, of which the estimator's own delay is an unknown part that the gyro "
            "cannot separate"
        )
        return ClockReading.unknown(text)
    behind = own.lag.offset_s - gyro.lag.offset_s
    doubt = np.hypot(own.lag.half_width_s, gyro.lag.half_width_s)
    if why_not or OWN_LAG_S[0] - doubt <= behind <= OWN_LAG_S[1] + doubt:
        explanation = why_not or f"{own.by} follow {1e3 * behind:.0f} ms behind it, the estimator's own delay"
        return _of(gyro.lag.offset_s, gyro.lag.half_width_s, (0.0, 0.0), f"clock of the gyro; {explanation}")
    return _of(own.lag.offset_s, own.lag.half_width_s, OWN_LAG_S,
               f"{own.by} follow the gyro by {1e3 * behind:.0f} ms, more than an estimator's own delay")


def _with_wander(context: Context, name: str, reading: ClockReading) -> ClockReading:
    """The link's clock wanders for all its streams alike: that of the estimated track where the gyro confirms it."""
    moving = context.once(moving_clocks)
    known = moving.get(name)
    if reading.reason.startswith("clock of the gyro") and "imu" in moving and moving["imu"].wanders:
        known = moving["imu"]
    return reading if known is None else replace(reading, wander_sd_s=known.wander_sd_s)


def _of(offset_s: float, half_s: float, own_lag_s: tuple[float, float], reason: str) -> ClockReading:
    """The interval runs down by the longest and up by the shortest own delay."""
    return ClockReading(offset_s, (offset_s - half_s - own_lag_s[1], offset_s + half_s - own_lag_s[0]), True, reason)


def _ms(own: Measured) -> str:
    return f"{1e3 * own.lag.offset_s:.0f} +- {1e3 * own.lag.half_width_s:.0f} ms"


def _why_not(context: Context, own: Measured, is_gyro: bool) -> str:
    """Why this measurement is uninformative; otherwise empty."""
    if is_gyro:
        pair = context.once(pairs.gyro_pair)
        rate = 0.0 if pair is None else float(np.linalg.norm(pair.rms[:2]))
        if rate < SMALLEST_RATE_RAD_S:
            return f"too little rotation: {rate:.3f} rad/s RMS, noise of the poses is {SMALLEST_RATE_RAD_S:.1f}"
    if own.lag.half_width_s > WIDEST_S:
        return f"{own.by} fit anywhere within {_ms(own)}: too little motion, or a clock that moves too much"
    return ""


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
