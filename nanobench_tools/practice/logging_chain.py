"""From what the vehicle and the room saw to a recording: packets, losses, late timestamps, interpolation, motion
capture.

The published files were made so: every message of the vehicle is sent at 100 Hz, and some packets are lost. The rest
get a timestamp on arrival. All columns are then interpolated linearly onto the frames of the motion capture. The last
quarter of a second is a straight line continued, because the streams were shifted by a constant after they ended.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from .. import so3
from ..errors import UsageError
from ..flight import Stream
from ..settings import number, setting
from ..sources.nanobench_columns import STREAMS, units_of
from .clock import ClockError, draw_clock
from .flying import LOGGED, STEP_S, Flown
from .mocap import MocapNoise, mocap_values
from .timeline import LEAD_S, TICK_S

ROOM_NOISE = MocapNoise()


@dataclass(frozen=True)
class LoggingChain:
    """What happens to a flight on its way into a file. The defaults are a clean recording as they come.

    - loss: lowest and highest share of packets lost per stream. The chance that a lost packet is followed by
      another is burst; longest_gap_s is the longest stretch without a packet.
    - battery_period_s: of the battery one packet in this time.
    - offset_s, drift, wander_sd_s: error of the vehicle's timestamps (positive = late): constant, per second, and
      standard deviation of a sawtooth common to all streams.
    - tail_s: lowest and highest length of the continued end (0, 0: none).
    - lost_frames: mean number of gaps in the motion capture, of 20-40 ms; mocap: its noise.
    - tilt_deg: lowest and highest angle between the tracked body frame and the IMU, about a random axis.
    - tilt_rad: in its place the rotation vector (x, y, z) from the IMU's body frame to the tracked one, the same in
      every flight.
    """

    loss: tuple[float, float] = setting("practice.logging_chain.loggingchain_loss")
    burst: float = number("practice.logging_chain.loggingchain_burst")
    longest_gap_s: float = number("practice.logging_chain.loggingchain_longest_gap_s")
    battery_period_s: float = number("practice.logging_chain.loggingchain_battery_period_s")
    offset_s: float = 0.0
    drift: float = 0.0
    wander_sd_s: float = 0.0
    tail_s: tuple[float, float] = setting("practice.logging_chain.loggingchain_tail_s")
    lost_frames: float = number("practice.logging_chain.loggingchain_lost_frames")
    mocap: MocapNoise = ROOM_NOISE
    tilt_deg: tuple[float, float] = setting("practice.logging_chain.loggingchain_tilt_deg")
    tilt_rad: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        if not (0.0 <= self.loss[0] <= self.loss[1] < 0.9 and 0.0 <= self.burst < 1.0):
            raise UsageError(f"packet loss {self.loss} with burst {self.burst}: shares from 0 to 0.9 and below 1")
        if self.longest_gap_s < 2 * TICK_S:
            raise UsageError(f"longest_gap_s {self.longest_gap_s} is shorter than two packets of {TICK_S} s")


PERFECT = LoggingChain(loss=(0.0, 0.0), tail_s=(0.0, 0.0), lost_frames=0.0, mocap=MocapNoise(0.0, (0.0, 0.0, 0.0)),
                       tilt_deg=(0.0, 0.0), battery_period_s=TICK_S)
"""Nothing lost, nothing late, no noise: for tests."""


def received(rng: np.random.Generator, ticks: int, share: float, burst: float, longest_gap_s: float) -> np.ndarray:
    """(ticks,) bool: which packets arrive when ``share`` of them is lost in bursts (two-state Markov chain).

    After a lost packet the next is lost with probability ``burst`` (or ``share`` if that is more). Runs of losses end
    so that neighbouring packets are never more than ``longest_gap_s`` apart.
    """
    again = max(burst, share)
    first = share * (1.0 - again) / (1.0 - share) if share < 1.0 else 1.0
    longest = round(longest_gap_s / TICK_S) - 1
    chance = rng.uniform(size=ticks)
    kept = np.ones(ticks, dtype=bool)
    run = 0
    for k in np.flatnonzero(chance < max(again, first)):
        run = run + 1 if k and not kept[k - 1] else 0
        kept[k] = not (chance[k] < (again if run else first)) or run >= longest
    return kept


def resample(stamps: np.ndarray, values: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Linear interpolation of packets (p,), (p, k) onto rows (m,), continued as straight lines beyond both ends."""
    i = np.clip(np.searchsorted(stamps, rows, side="right") - 1, 0, len(stamps) - 2)
    share = (rows - stamps[i]) / (stamps[i + 1] - stamps[i])
    return np.asarray(values[i] + share[:, None] * (values[i + 1] - values[i]))


@dataclass(frozen=True)
class Recorded:
    """streams on the rows of the motion capture, times from the first row; ``clock`` is the error that was put in."""

    streams: dict[str, Stream]
    clock: ClockError
    tail_s: float
    tilt_rad: np.ndarray


def record(flown: Flown, flight: int, chain: LoggingChain, rngs: list[np.random.Generator]) -> Recorded:
    """The recording of one flight of ``flown``. rngs: at least three independent generators."""
    radio, clock_rng, room = rngs[:3]
    ticks = flown.ticks_of(flight)
    time = flown.time_s[:ticks]
    first = LEAD_S + room.uniform(0.0, TICK_S)
    rows = np.arange(first, time[-1], TICK_S)[:-1]
    keep = _frames(room, len(rows), chain.lost_frames)
    tilt = np.radians(room.uniform(*chain.tilt_deg)) * _direction(room)
    if chain.tilt_rad is not None:
        tilt = np.asarray(chain.tilt_rad, float)
    rows = rows[keep]
    position, quaternion = _pose_at(flown, flight, ticks, rows)
    seen = mocap_values(rows, position, quaternion, tilt, chain.mocap, room)
    streams = {"mocap": _stream("mocap", rows - first, seen, len(rows), len(rows) / (rows[-1] - rows[0]))}
    clock = draw_clock(clock_rng, rows[-1], chain.offset_s, chain.drift, chain.wander_sd_s)
    tail = radio.uniform(*chain.tail_s)
    shares = radio.uniform(*chain.loss, size=len(LOGGED))
    span = rows[-1] - rows[0] - tail
    for (name, (_, sub)), share in zip(LOGGED.items(), shares, strict=True):
        if name not in flown.messages:
            continue
        sent = time + STEP_S * sub
        arrives = received(radio, ticks, share, chain.burst, chain.longest_gap_s)
        if name == "battery":
            # a slower log block: of every period the first packet that the radio takes
            period = np.floor((sent + radio.uniform(0.0, chain.battery_period_s)) / chain.battery_period_s)
            if chain.battery_period_s > TICK_S:
                kept = np.flatnonzero(arrives)
                arrives[kept[1:]] = np.diff(period[kept]) > 0.0
        stamps = clock.stamp(sent)
        arrives[0] = True  # recording began before the first row: nothing is continued backwards
        arrives &= stamps <= rows[-1] - tail if tail > 0.0 else True
        packets = stamps[arrives]
        values = resample(packets, flown.messages[name][:ticks, flight][arrives], rows)
        inside = int(np.sum((packets >= rows[0]) & (packets <= rows[-1])))
        streams[name] = _stream(name, rows - first, values, inside, inside / span)
    return Recorded(streams, clock.shifted(first), tail, tilt)


def _stream(name: str, time_s: np.ndarray, values: np.ndarray, samples: int, rate_hz: float) -> Stream:
    columns = STREAMS[name]
    frame = {"imu": "body", "motor": "motor", "battery": "-"}.get(name, "world")
    return Stream(time_s, values, tuple(c.name for c in columns), tuple(c.quantity for c in columns), units_of(columns),
                  frame=frame, rate_hz=rate_hz, samples=samples)


def _direction(rng: np.random.Generator) -> np.ndarray:
    """Random axis in the body's x-y plane: yaw is followed by the estimator, so only tilt can differ."""
    angle = rng.uniform(0.0, 2.0 * np.pi)
    return np.array([np.cos(angle), np.sin(angle), 0.0])


def _frames(rng: np.random.Generator, rows: int, mean_gaps: float) -> np.ndarray:
    """(rows,) bool: frames that were not lost; each loss takes 1-3 frames in a row, never at the ends."""
    keep = np.ones(rows, dtype=bool)
    for _ in range(rng.poisson(mean_gaps)):
        at = rng.integers(10, rows - 10)
        if keep[at - 8:at + 8].all():
            keep[at:at + rng.integers(1, 4)] = False
    return keep


def _pose_at(flown: Flown, flight: int, ticks: int, at_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """True position (m, 3) and quaternion (m, 4) between the ticks, cubic with the true rates."""
    time = flown.time_s[:ticks]
    p, v, q, w = (flown.truth[name][:ticks, flight]
                  for name in ("position_m", "velocity_m_s", "quaternion", "rate_rad_s"))
    half_w = np.concatenate([0.5 * w, np.zeros((ticks, 1))], axis=1)
    q = so3.make_continuous(q)
    position = CubicHermiteSpline(time, p, v)(at_s)
    turned = CubicHermiteSpline(time, q, so3.multiply(q, half_w))(at_s)
    return position, turned / np.linalg.norm(turned, axis=1, keepdims=True)
