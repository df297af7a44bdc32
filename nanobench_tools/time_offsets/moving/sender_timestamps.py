"""The delay of a clock whose ticks were logged: then it is measured, and nothing has to be inferred.

A stream with the quantity ``tick`` carries the sender's own time of every sample in addition to the receiver's
timestamp. Timestamps are never early, so the straight line below all of (tick, timestamp) is the sender's clock in the
receiver's time. The distance above it is the delay of the link. Source: the lower-envelope method of Moon, Skelly,
Towsley, "Estimation and removal of clock skew from network delay measurements", INFOCOM 1999, a linear program.
"""

import numpy as np
from scipy.optimize import linprog

from ...flight import Stream
from ...settings import count, number
from ...signals.airborne import airborne_spans
from ...signals.context import Context
from .evidence import collect
from .time_offset import TimeOffset, wander_of

WRAP_S = 2.0**24 / 1000.0
"""The Crazyflie's log packets count milliseconds in 24 bits."""

FEWEST = count("retiming.sender_timestamps.fewest")
MOVES_S = number("retiming.sender_timestamps.moves_s")

LAG_SD_S = number("retiming.sender_timestamps.lag_sd_s")


def unwrapped(tick_s: np.ndarray) -> np.ndarray:
    """(n,) ticks that never run backward by more than half of WRAP_S."""
    falls = np.diff(tick_s) < -0.5 * WRAP_S
    return tick_s + WRAP_S * np.concatenate(([0], np.cumsum(falls)))


def link_delay(stamp_s: np.ndarray, tick_s: np.ndarray) -> tuple[np.ndarray, float]:
    """(n,) delay [s] of each timestamp above the least line below all of them, and the rate of that line less 1."""
    x = tick_s - tick_s[0]
    late = stamp_s - stamp_s[0] - x
    # least sum of late - a - b x with late - a - b x >= 0: as large a line as fits below
    found = linprog([-len(x), -x.sum()], A_ub=np.column_stack([np.ones(len(x)), x]), b_ub=late,
                    bounds=[(None, None), (None, None)], method="highs")
    a, b = found.x
    return late - a - b * x, float(b)


def time_offset_from_ticks(context: Context) -> TimeOffset | None:
    """The measured warp; None without a stream that has ticks in order.

    The least delay of the link itself is not seen in ticks. With motion capture it is the lag that fits the gyro best
    once the varying part is gone. Otherwise it stays unknown and the standard deviation includes this.
    """
    streams = [stream for stream in context.flight.streams.values() if "tick" in stream.quantities]
    measured = [m for m in map(_delay_of, streams) if m is not None]
    if not measured:
        return None
    time_s = np.concatenate([t for t, _, _ in measured])
    delay = np.concatenate([d for _, d, _ in measured])
    order = np.argsort(time_s, kind="stable")
    time_s, delay = time_s[order], delay[order]
    steps = np.concatenate([np.diff(np.unique(tick)) for _, _, tick in measured])
    resolution = float(steps.min()) if len(steps) else 0.0
    constant, doubt, reason = 0.0, float("inf"), "its least delay is unknown (no gyro with motion capture)"
    airborne = context.once(airborne_spans)
    gyro = collect(context, ("gyro",), airborne[0].start_s, airborne[-1].end_s) if airborne else []
    if gyro:
        gyro[0].learn_lag(np.interp(gyro[0].time_s, time_s, delay))
        constant, doubt = gyro[0].lag_s, LAG_SD_S
        reason = f"the gyro adds {1e3 * constant:.0f} ms"
    wander = wander_of(time_s, delay)
    sd = np.full(len(time_s), np.hypot(resolution / np.sqrt(12.0), doubt))
    return TimeOffset(time_s, delay + constant, sd, float(np.median(delay)) + constant, wander, wander > MOVES_S,
                     {}, f"measured from the ticks of {len(measured)} streams: delay moves by {1e3 * wander:.1f} ms "
                         f"(SD); {reason}", ("tick", "gyro") if gyro else ("tick",))


def _delay_of(stream: Stream) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    good = np.isfinite(stream["tick"]) & np.isfinite(stream.time_s)
    stamp_s, tick_s = stream.time_s[good], unwrapped(stream["tick"][good])
    if len(tick_s) < FEWEST or np.any(np.diff(tick_s) < 0.0) or np.ptp(tick_s) == 0.0:
        return None
    return stamp_s, link_delay(stamp_s, tick_s)[0], tick_s
